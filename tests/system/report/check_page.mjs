#!/usr/bin/env node
// check_page.mjs PAGE.html [--screenshot FILE] [--width PIXELS] [--scheme light|dark] [--quick]
//
// Opens a report page in headless Chromium and prints what is wrong with it: errors, dialogs, requests
// other than the file itself, charts that were not drawn, a zoom by drag that does nothing or that a
// double click does not undo, words that overlap. Exit status 0: nothing; 1: something; 2: wrong use.
// --quick leaves the zoom out.
import {existsSync} from 'node:fs';
import {pathToFileURL} from 'node:url';
import {Browser, doubleClick, drag, lookAtFigures, waitForRange, waitUntilDrawn, xRange} from './browser.mjs';

function figureProblems(figures, numExpected) {
  const problems = [];
  if (figures.length !== numExpected) problems.push(`${figures.length} figures, the page promises ${numExpected}`);
  for (const figure of figures) {
    const where = `${figure.id} ("${figure.title.slice(0, 40)}")`;
    if (figure.hasNoData) {
      if (!figure.text.includes('no data')) problems.push(`${where} has no data and does not say so`);
    } else if (figure.pictures > 0) {
      if (figure.loaded !== figure.pictures) problems.push(`${where}: its picture does not load`);
    } else if (figure.charts !== 1) {
      problems.push(`${where} has ${figure.charts} charts`);
    } else if (figure.hued[0] < 20) {
      problems.push(`${where} shows nothing but axes`);
    }
  }
  return problems;
}

async function zoomProblems(page, figures) {
  const problems = [];
  for (const {id, charts, isMap} of figures) {
    if (charts === 0) continue;
    const before = await xRange(page, id);
    if (before === null) { problems.push(`${id} tells no range of x`); continue; }
    try {
      // On a map both axes follow, so the drag goes aslant.
      await drag(page, id, 0.3, 0.6, isMap ? 80 : 0);
      await waitForRange(page, id, 'narrower', 0.9 * (before[1] - before[0]));
    } catch { problems.push(`${id}: a drag does not zoom`); continue; }
    try {
      await doubleClick(page, id);
      await waitForRange(page, id, 'is', ...before);
    } catch { problems.push(`${id}: a double click does not show everything again`); }
  }
  return problems;
}

/** Text that runs into other text, or out of the page. */
async function layoutProblems(page) {
  return page.evaluate(() => {
    const problems = [];
    if (document.documentElement.scrollWidth > window.innerWidth + 1) problems.push('the page is wider than the window');
    for (const section of document.querySelectorAll('.figure')) {
      const boxes = ['.head h3', '.buttons', '.legend', '.plot', '.note'].map((name) => section.querySelector(name))
        .filter((part) => part && part.getClientRects().length > 0).map((part) => part.getBoundingClientRect());
      for (let i = 0; i < boxes.length; ++i) {
        for (let j = i + 1; j < boxes.length; ++j) {
          const width = Math.min(boxes[i].right, boxes[j].right) - Math.max(boxes[i].left, boxes[j].left);
          const height = Math.min(boxes[i].bottom, boxes[j].bottom) - Math.max(boxes[i].top, boxes[j].top);
          if (width > 1 && height > 1) problems.push(`${section.id}: parts ${i} and ${j} overlap`);
        }
      }
    }
    return problems;
  });
}

/** Every problem of the page in this file. */
export async function checkPage(browser, file, {screenshot = null, withZoom = true, patienceMs = undefined} = {}) {
  const {page, problems} = await browser.load(file);
  const numExpected = await page.evaluate(() => Number(document.documentElement.dataset.figures));
  if (!Number.isInteger(numExpected)) problems.push('the page does not tell its number of figures');
  try {
    await waitUntilDrawn(page, patienceMs);
  } catch {
    problems.push(`not drawn in time: ${await page.evaluate(() => JSON.stringify({...document.documentElement.dataset}))}`);
  }
  const figures = await lookAtFigures(page);
  problems.push(...figureProblems(figures, numExpected), ...await layoutProblems(page));
  if (screenshot) await page.screenshot({path: screenshot, fullPage: true});
  if (withZoom) problems.push(...await zoomProblems(page, figures));
  await page.close();
  return problems;
}

function parse(words) {
  const options = {width: 1400, scheme: 'light', screenshot: null, withZoom: true};
  while (words.length > 0) {
    const word = words.shift();
    if (word === '--screenshot') options.screenshot = words.shift();
    else if (word === '--width') options.width = Number(words.shift());
    else if (word === '--scheme') options.scheme = words.shift();
    else if (word === '--quick') options.withZoom = false;
    else if (word.startsWith('--') || options.file) return null;
    else options.file = word;
  }
  const isFine = options.file && options.width > 0 && ['light', 'dark'].includes(options.scheme) && options.screenshot !== undefined;
  return isFine ? options : null;
}

async function main() {
  const options = parse(process.argv.slice(2));
  if (!options) {
    console.error('usage: check_page.mjs PAGE.html [--screenshot FILE] [--width PIXELS] [--scheme light|dark] [--quick]');
    return 2;
  }
  if (!existsSync(options.file)) {
    console.error(`check_page: there is no ${options.file}`);
    return 2;
  }
  const browser = await Browser.open(options);
  try {
    const problems = await checkPage(browser, options.file, options);
    for (const problem of problems) console.log(problem);
    return problems.length > 0 ? 1 : 0;
  } finally {
    await browser.close();
  }
}

if (import.meta.url === pathToFileURL(process.argv[1]).href) {
  main().then((status) => { process.exitCode = status; }, (error) => { console.error(`check_page: ${error.message}`); process.exitCode = 1; });
}
