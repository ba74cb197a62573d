// A page in headless Chromium, and everything that it did which a report page must not do.
import {existsSync, mkdtempSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';
import {fileURLToPath, pathToFileURL} from 'node:url';

const report = fileURLToPath(new URL('../../../tools/report/package.json', import.meta.url));

function playwright() {
  try {
    return createRequire(report)('playwright-core');
  } catch {
    throw new Error('playwright-core is not installed: run scripts/setup --test');
  }
}

const kArguments = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];
// Loading and drawing on a busy machine.
export const kPatienceMs = 60000;

export class Browser {
  static async open({width = 1400, height = 1000, scheme = 'light'} = {}) {
    const program = process.env.HOLDFAST_CHROMIUM || '/usr/bin/chromium';
    if (!existsSync(program)) throw new Error(`${program} is not installed: run scripts/setup --test`);
    const browser = new Browser();
    browser.folder = mkdtempSync(join(tmpdir(), 'holdfast-browser-'));
    browser.context = await playwright().chromium.launchPersistentContext(browser.folder, {
      executablePath: program, args: kArguments, headless: true, chromiumSandbox: false,
      viewport: {width, height}, colorScheme: scheme, timeout: kPatienceMs,
    });
    browser.context.setDefaultTimeout(kPatienceMs);
    return browser;
  }

  async close() {
    await this.context.close();
    rmSync(this.folder, {recursive: true, force: true});
  }

  /** Loads the file; {page, problems}, the latter growing with each thing that went wrong. */
  async load(file) {
    const address = pathToFileURL(resolve(file)).href;
    const problems = [];
    const page = await this.context.newPage();
    page.on('console', (message) => {
      if (['error', 'warning'].includes(message.type())) problems.push(`console ${message.type()}: ${message.text()}`);
    });
    page.on('pageerror', (error) => problems.push(`error in the page: ${error.message}`));
    page.on('dialog', (dialog) => { problems.push(`a dialog opened: ${dialog.message()}`); dialog.dismiss(); });
    page.on('request', (request) => {
      const url = request.url();
      if (url !== address && !/^(data|blob):/.test(url)) problems.push(`the page asked for ${url}`);
    });
    page.on('popup', (other) => problems.push(`the page opened ${other.url()}`));
    await page.goto(address, {waitUntil: 'load'});
    return {page, problems};
  }
}

/** Waits until every figure is drawn, or says that it has no data. */
export async function waitUntilDrawn(page, timeout = kPatienceMs) {
  await page.waitForFunction(() => {
    const {drawn, figures} = document.documentElement.dataset;
    return Number(drawn) + document.querySelectorAll('.no-data').length >= Number(figures);
  }, null, {timeout});
}

/** For each figure what it shows: canvases with their number of pixels that have a hue, or pictures. */
export async function lookAtFigures(page) {
  return page.evaluate(() => {
    // Pixels of a hue: what the data added, since axes are grey. Read from a copy, which leaves the
    // chart's own canvas to its drawing.
    const hued = (canvas) => {
      const copy = document.createElement('canvas');
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const context = copy.getContext('2d', {willReadFrequently: true});
      context.drawImage(canvas, 0, 0);
      const {data} = context.getImageData(0, 0, copy.width, copy.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {
        const [r, g, b, alpha] = data.subarray(i, i + 4);
        if (alpha > 0 && Math.max(r, g, b) - Math.min(r, g, b) > 40) ++count;
      }
      return count;
    };
    return [...document.querySelectorAll('.figure')].map((section) => {
      const canvases = [...section.querySelectorAll('.plot canvas')];
      const pictures = [...section.querySelectorAll('img.picture')];
      return {
        id: section.id, title: section.querySelector('h3').textContent, hasNoData: section.classList.contains('no-data'),
        isMap: section.classList.contains('map'),
        text: section.innerText, charts: canvases.length, hued: canvases.map(hued),
        pictures: pictures.length, loaded: pictures.filter((picture) => picture.complete && picture.naturalWidth > 0).length,
      };
    });
  });
}

export async function xRange(page, id) {
  return page.evaluate((name) => {
    const text = document.getElementById(name).dataset.xRange;
    return text === undefined ? null : text.split(',').map(Number);
  }, id);
}

/** Waits until x spans less than a number ('narrower', number), or is a range ('is', low, high). */
export async function waitForRange(page, id, ...wanted) {
  const isReached = page.waitForFunction(([name, [word, a, b]]) => {
    const [low, high] = document.getElementById(name).dataset.xRange.split(',').map(Number);
    if (word === 'narrower') return high - low < a;
    // Both axes of a map are fitted to each other, with some rounding.
    return Math.max(Math.abs(low - a), Math.abs(high - b)) <= 1e-6 * (b - a);
  }, [id, wanted], {timeout: 20000});
  await isReached.catch(async () => { throw new Error(`${id}: x is ${await xRange(page, id)}, not ${wanted.join(' ')}`); });
  return xRange(page, id);
}

/** Drags across the middle of a figure, from one share of its width to another. */
export async function drag(page, id, from, to, aslant = 0) {
  const area = page.locator(`#${id} .u-over`);
  await area.scrollIntoViewIfNeeded();
  const box = await area.boundingBox();
  const y = box.y + 0.4 * box.height;
  await page.mouse.move(box.x + from * box.width, y);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.5 * (from + to) * box.width, y + 0.5 * aslant, {steps: 4});
  await page.mouse.move(box.x + to * box.width, y + aslant, {steps: 4});
  await page.mouse.up();
}

export async function doubleClick(page, id) {
  const area = page.locator(`#${id} .u-over`);
  await area.scrollIntoViewIfNeeded();
  const box = await area.boundingBox();
  await page.mouse.dblclick(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
}
