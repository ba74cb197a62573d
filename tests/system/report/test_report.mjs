// test_report.mjs WRITE_DEMO: the demonstration page in a browser, at two widths and in two colour
// schemes, with everything one can do on it; then pages that must be found wrong.
import {execFileSync} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {Browser, doubleClick, drag, waitForRange, waitUntilDrawn, xRange} from './browser.mjs';
import {checkPage} from './check_page.mjs';

const kHostile = '</script><script>alert(1)</script><img src=x onerror=alert(2)>';
let numFailures = 0;

function expect(what, isTrue, detail = '') {
  if (isTrue) return;
  ++numFailures;
  console.log(`FAILED: ${what}${detail === '' ? '' : `: ${detail}`}`);
}

async function withPage(options, file, act) {
  const browser = await Browser.open(options);
  try {
    const {page, problems} = await browser.load(file);
    await waitUntilDrawn(page);
    await act(page);
    expect(`${act.name}: nothing went wrong on the page`, problems.length === 0, problems.join('; '));
  } finally {
    await browser.close();
  }
}

async function checkEverywhere(folder) {
  for (const [width, scheme] of [[1400, 'light'], [800, 'dark'], [420, 'light']]) {
    const browser = await Browser.open({width, scheme});
    try {
      for (const name of ['page.html', 'pictures.html']) {
        const withZoom = name === 'page.html';
        const problems = await checkPage(browser, join(folder, name), {withZoom});
        expect(`${name} at ${width} pixels, ${scheme}`, problems.length === 0, problems.join('; '));
      }
    } finally {
      await browser.close();
    }
  }
}

async function hostileNamesAreText(page) {
  const text = await page.evaluate(() => document.body.innerText);
  for (const kind of ['Title', 'series', 'level', 'span', 'note', 'warning', 'cell']) {
    expect(`the hostile ${kind} is shown as text`, text.includes(`${kind} ${kHostile}`));
  }
  const strangers = await page.evaluate(() => document.querySelectorAll('img, [onerror], iframe, link').length);
  expect('no element came from a name', strangers === 0, strangers);
  expect('only our scripts', await page.evaluate(() => document.querySelectorAll('script').length) === 3);
  // Even a script that got in would not run.
  const ran = await page.evaluate(async () => {
    const script = document.createElement('script');
    script.textContent = 'window.intruder = true';
    document.body.append(script);
    return window.intruder === true;
  });
  expect('the policy refuses a foreign script', !ran);
}

async function zoomIsShared(page) {
  const full = await xRange(page, 'figure-1');
  const other = await xRange(page, 'figure-4');
  await drag(page, 'figure-1', 0.25, 0.5);
  const zoomed = await waitForRange(page, 'figure-1', 'narrower', 0.4 * (full[1] - full[0]));
  // A pixel at each end is what a drag can be wrong by; the chart is wider than 500 pixels.
  const span = full[1] - full[0];
  expect('the zoom is where the drag was', Math.abs(zoomed[0] - (full[0] + 0.25 * span)) < 0.01 * span &&
    Math.abs(zoomed[1] - (full[0] + 0.5 * span)) < 0.01 * span, zoomed);
  await waitForRange(page, 'figure-2', 'is', ...zoomed);
  expect('a chart over another quantity stays', String(await xRange(page, 'figure-4')) === String(other));
  await doubleClick(page, 'figure-2');
  await waitForRange(page, 'figure-1', 'is', ...full);
  // Aslant, y is zoomed as well.
  const y = () => page.evaluate(() => document.getElementById('figure-1').dataset.yRange);
  const before = await y();
  await drag(page, 'figure-1', 0.3, 0.6, 60);
  await waitForRange(page, 'figure-1', 'narrower', 0.5 * span);
  const [low, high] = (await y()).split(',').map(Number), [lowBefore, highBefore] = before.split(',').map(Number);
  expect('an aslant drag zooms y', high - low < 0.6 * (highBefore - lowBefore), `${low} ${high}`);
  await page.locator('#figure-1 .buttons button', {hasText: 'Reset'}).click();
  await waitForRange(page, 'figure-1', 'is', ...full);
  expect('Reset brings y back', (await y()) === before, await y());
}

async function legendHides(page) {
  const picture = () => page.evaluate(() => document.querySelector('#figure-2 .plot canvas').toDataURL());
  const button = page.locator('#figure-2 .legend button').first();
  const before = await picture();
  await button.click();
  expect('a hidden curve is marked', await button.getAttribute('aria-pressed') === 'false');
  await page.waitForFunction((old) => document.querySelector('#figure-2 .plot canvas').toDataURL() !== old, before);
  await button.click();
  await page.waitForFunction((old) => document.querySelector('#figure-2 .plot canvas').toDataURL() === old, before);
}

async function cursorReadsOff(page) {
  const area = page.locator('#figure-1 .u-over');
  await area.scrollIntoViewIfNeeded();
  const box = await area.boundingBox();
  await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
  await page.waitForFunction(() => /^x \d/.test(document.querySelector('#figure-1 .at').textContent));
  const values = await page.locator('#figure-1 .legend .value').allTextContents();
  expect('values of the curves at the cursor', values.slice(0, 3).every((value) => Number(value) > 0), values);
  const other = await page.locator('#figure-2 .at').textContent();
  expect('the charts below follow', /^x \d/.test(other), other);
}

async function equalAxes(page) {
  const {x, y, width, height} = await page.evaluate(() => {
    const section = document.getElementById('figure-5'), box = section.querySelector('.u-over').getBoundingClientRect();
    return {x: section.dataset.xRange.split(',').map(Number), y: section.dataset.yRange.split(',').map(Number), width: box.width, height: box.height};
  });
  const ratio = (width / (x[1] - x[0])) / (height / (y[1] - y[0]));
  // The plot's area is rounded to whole pixels, of which there are more than 200 each way.
  expect('a map has one scale', Math.abs(ratio - 1) < 0.01, ratio);
}

async function savesFiles(page) {
  const save = async (id, button) => {
    const [download] = await Promise.all([page.waitForEvent('download'),
      page.locator(`#${id} .buttons button`, {hasText: button}).click()]);
    return {name: download.suggestedFilename(), data: readFileSync(await download.path())};
  };
  const table = await save('figure-6', 'CSV');
  const lines = table.data.toString().trim().split('\n');
  expect('the table', lines.length === 4 && lines[1] === `"series ${kHostile}",0,1,,`, lines.join('|'));
  expect('the name stays a name', /^[a-z0-9_]+\.csv$/.test(table.name), table.name);
  const picture = await save('figure-1', 'PNG');
  expect('the picture', picture.name === 'state_speed.png' && picture.data.subarray(1, 4).toString() === 'PNG');
  const size = [picture.data.readUInt32BE(16), picture.data.readUInt32BE(20)];
  expect('the picture holds more than the chart', size[0] > 600 && size[1] > 340, size);
}

async function longSeriesIsFluid(page) {
  // Milliseconds for a zoom of 200 000 points, the quickest of five, since other programs share the machine.
  const times = [];
  for (let i = 0; i < 5; ++i) {
    times.push(await page.evaluate(async () => {
      const section = document.getElementById('figure-3');
      const start = performance.now();
      section.querySelector('.legend button').click();
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
      return performance.now() - start;
    }));
  }
  expect('200 000 points are drawn in a quarter of a second', Math.min(...times) < 250, times);
}

async function schemeChanges(page) {
  const picture = () => page.evaluate(() => document.querySelector('#figure-1 .plot canvas').toDataURL());
  const light = await picture();
  await page.emulateMedia({colorScheme: 'dark'});
  await page.waitForFunction((old) => document.querySelector('#figure-1 .plot canvas').toDataURL() !== old, light);
  await page.setViewportSize({width: 700, height: 900});
  await page.waitForFunction(() => document.querySelector('#figure-1 .plot canvas').getBoundingClientRect().width < 700);
}

/** Pages with one fault each: the check must find it, else it proves nothing. */
async function faultsAreFound(folder) {
  const figure = '<section class="figure" id="figure-1"><h3>t</h3><div class="plot"><canvas></canvas></div></section>';
  const paint = '<script>const c = document.querySelector("canvas").getContext("2d"); c.fillStyle = "red"; c.fillRect(0, 0, 99, 99);</script>';
  const faults = {
    'error in the page: planted': `${figure}${paint}<script>throw new Error("planted")</script>`,
    'console error: planted': `${figure}${paint}<script>console.error("planted")</script>`,
    'a dialog opened': `${figure}${paint}<script>alert(1)</script>`,
    'asked for': `${figure}${paint}<img src="other.png">`,
    'shows nothing but axes': figure,
    'a drag does not zoom|tells no range': `${figure}${paint}`,
    'has 0 charts': '<section class="figure" id="figure-1"><h3>t</h3></section>',
    'wider than the window': `${figure}${paint}<div style="width: 5000px">wide</div>`,
  };
  const browser = await Browser.open();
  try {
    for (const [expected, body] of Object.entries(faults)) {
      const file = join(folder, 'fault.html');
      writeFileSync(file, `<!DOCTYPE html><html data-figures="1" data-drawn="1"><body>${body}</body></html>`);
      const problems = await checkPage(browser, file);
      expect(`found: ${expected}`, problems.some((problem) => new RegExp(expected).test(problem)), problems.join('; '));
    }
    const file = join(folder, 'undrawn.html');
    writeFileSync(file, readFileSync(join(folder, 'page.html'), 'utf8').replace('"x":0,"y"', '"x":99,"y"'));
    const problems = await checkPage(browser, file, {withZoom: false, patienceMs: 3000});
    expect('found: a chart that was not drawn', problems.some((problem) => problem.startsWith('not drawn')), problems.join('; '));
  } finally {
    await browser.close();
  }
}

async function main() {
  const folder = mkdtempSync(join(tmpdir(), 'holdfast-report-'));
  try {
    execFileSync(process.argv[2], [folder], {stdio: 'inherit'});
    const file = join(folder, 'page.html');
    await checkEverywhere(folder);
    for (const act of [zoomIsShared, legendHides, cursorReadsOff, equalAxes, savesFiles, longSeriesIsFluid, schemeChanges]) {
      await withPage({width: 1000}, file, act);
    }
    const browser = await Browser.open();
    try {
      const {page} = await browser.load(file);
      await waitUntilDrawn(page);
      await hostileNamesAreText(page);
    } finally {
      await browser.close();
    }
    await faultsAreFound(folder);
  } finally {
    rmSync(folder, {recursive: true, force: true});
  }
  console.log(numFailures === 0 ? 'report pages: fine' : `${numFailures} failures`);
  return numFailures === 0 ? 0 : 1;
}

main().then((status) => { process.exitCode = status; }, (error) => { console.error(`test_report: ${error.message}`); process.exitCode = 1; });
