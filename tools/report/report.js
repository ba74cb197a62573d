// Builds the charts of the page: axes, zoom and cursor by uPlot, the content by report_draw.js.

const kFont = '12px system-ui, sans-serif';
const kHeight = 300, kMapHeightMin = 280, kMapHeightMax = 640, kYAxisWidth = 62;

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

function shortened(text, size) {
  return text.length > size ? text.slice(0, Math.max(1, size - 1)) + '…' : text;
}

/** A small picture of how an entry is drawn, on a canvas of 30 x 14 pixels or part of a larger one. */
function drawSwatch(ctx, entry, x, y, ratio) {
  ctx.save();
  ctx.translate(x, y);
  ctx.scale(ratio, ratio);
  ctx.strokeStyle = ctx.fillStyle = entry.colour();
  if (entry.hasBand) { ctx.globalAlpha = entry.alpha; ctx.fillRect(0, 1, 30, 12); ctx.globalAlpha = 1; }
  if (entry.isPoints) {
    const path = new Path2D();
    addMarker(path, entry.place, 15, 7, 4);
    ctx.fill(path);
  } else if (entry.dashes) {
    ctx.lineWidth = 2;
    ctx.setLineDash(entry.dashes);
    ctx.beginPath(); ctx.moveTo(0, 7); ctx.lineTo(30, 7); ctx.stroke();
  }
  ctx.restore();
}

/** Legend entries of a figure, in the order of drawing over each other: curves, levels, spans. */
function legendEntries(figure) {
  const toggle = (set, key) => () => { if (!set.delete(key)) set.add(key); };
  const entries = figure.series.map((series) => ({
    name: series.name, series, colour: () => seriesColour(series), place: series.place, isPoints: series.style === 'points',
    dashes: seriesDashes(series), hasBand: series.low !== null, alpha: kBandAlpha,
    isShown: () => series.isShown, toggle: () => { series.isShown = !series.isShown; },
  }));
  figure.levels.forEach((level, i) => entries.push({
    name: level.name, colour: () => colourOf('--ink'), dashes: i % 2 === 0 ? [8, 4] : [8, 4, 2, 4], hasBand: false,
    isShown: () => !figure.hiddenLevels.has(i), toggle: toggle(figure.hiddenLevels, i),
  }));
  for (const name of figure.spanNames) {
    entries.push({
      name, colour: () => spanColour(figure, name), dashes: null, hasBand: true, alpha: 2 * kSpanAlpha,
      isShown: () => !figure.hiddenSpans.has(name), toggle: toggle(figure.hiddenSpans, name),
    });
  }
  return entries;
}

class Chart {
  constructor(section, figure, group) {
    Object.assign(this, {section, figure, group, xView: null, isSetting: false, hasDrawn: false});
    this.xFull = figure.xFull;
    if (figure.isMap) section.classList.add('map');
    this.buildLegend();
    this.plot = element('div', 'plot');
    this.plot.setAttribute('role', 'img');
    this.plot.setAttribute('aria-label', figure.title);
    section.querySelector('.chart').append(this.legend, this.plot);
    this.buildButtons();
  }

  buildLegend() {
    this.legend = element('div', 'legend');
    this.entries = legendEntries(this.figure);
    this.at = element('span', 'at');
    for (const entry of this.entries) {
      const button = element('button');
      button.type = 'button';
      button.title = 'show or hide';
      entry.swatch = element('canvas', 'swatch');
      entry.value = element('span', 'value');
      button.append(entry.swatch, element('span', 'name', entry.name), entry.value);
      button.setAttribute('aria-pressed', 'true');
      button.addEventListener('click', () => {
        entry.toggle();
        button.setAttribute('aria-pressed', String(entry.isShown()));
        this.rescale();
      });
      this.legend.append(button);
    }
    this.legend.append(this.at);
  }

  buildButtons() {
    const bar = this.section.querySelector('.buttons');
    const add = (text, title, act) => {
      const button = element('button', '', text);
      button.type = 'button';
      button.title = title;
      button.addEventListener('click', act);
      bar.append(button);
    };
    add('PNG', 'save this view as a picture', () => savePicture(this));
    add('CSV', 'save the numbers of this figure', () => saveTable(this.figure));
    add('Reset', 'show everything again', () => this.reset());
  }

  paintSwatches() {
    const ratio = Math.max(1, window.devicePixelRatio || 1);
    for (const entry of this.entries) {
      entry.swatch.width = 30 * ratio;
      entry.swatch.height = 14 * ratio;
      drawSwatch(entry.swatch.getContext('2d'), entry, 0, 0, ratio);
    }
  }

  get width() { return Math.max(280, Math.floor(this.plot.clientWidth)); }

  get height() {
    if (!this.figure.isMap) return kHeight;
    const [yLow, yHigh] = this.figure.rangeY(...this.xFull);
    const wanted = ((this.width - kYAxisWidth - 40) * (yHigh - yLow)) / (this.xFull[1] - this.xFull[0]);
    return Math.round(Math.min(kMapHeightMax, Math.max(kMapHeightMin, wanted + 60)));
  }

  axis(scale, label) {
    const isY = scale === 'y', isLog = isY && this.figure.isLog;
    const space = isY ? 32 : 80;
    return {
      scale, label: shortened(label, Math.floor((isY ? this.height - 60 : this.width) / 8)), labelSize: 22, labelGap: 2, size: isY ? kYAxisWidth : 32, font: kFont,
      labelFont: 'bold ' + kFont,
      stroke: () => colourOf('--ink'),
      grid: {stroke: () => colourOf('--grid'), width: 1},
      ticks: {stroke: () => colourOf('--grid'), width: 1, size: 5},
      // uPlot wants a step, and knows the decimals of those from 5 on; the ticks are ours all the same.
      incrs: (u, axisIndex, low, high) => [Math.max(5, high - low)],
      splits: (u, axisIndex, low, high) => {
        const pixels = isY ? u.bbox.height : u.bbox.width;
        return (isLog ? logTicks : linearTicks)(low, high, Math.floor(pixels / uPlot.pxRatio / space) || 4);
      },
      filter: (u, splits) => splits,
      values: (u, splits) => tickLabels(splits, isLog),
    };
  }

  options() {
    const figure = this.figure;
    return {
      width: this.width, height: this.height, padding: [8, 16, 0, 0],
      legend: {show: false},
      scales: {
        x: {time: false, range: (u, low, high) => (this.xView = high > low ? [low, high] : this.xFull)},
        y: {
          distr: figure.isLog ? 3 : 1,
          range: (u, low, high) => (low === null || !(high > low) ? figure.rangeY(...(this.xView || this.xFull)) : [low, high]),
        },
      },
      // The content is drawn by the hook; these two only carry the scales.
      series: [{}, {scale: 'y', paths: () => null, points: {show: false}}],
      axes: [this.axis('x', figure.xLabel), this.axis('y', figure.yLabel)],
      cursor: {
        points: {show: false},
        drag: {x: true, y: true, uni: figure.isMap ? null : 30, dist: 5},
        sync: this.group && {
          key: this.group.key, setSeries: false, scales: ['x', null],
          filters: {pub: (type) => type === 'mousemove' || type === 'mouseleave'},
        },
      },
      hooks: {
        draw: [(u) => this.drawn(u)],
        setScale: [(u, key) => this.scaled(key)],
        setCursor: [(u) => this.readOff(u)],
      },
    };
  }

  create() {
    this.paintSwatches();
    this.u = new uPlot(this.options(), [this.xFull, [null, null]], this.plot);
  }

  drawn(u) {
    drawFigure(u, this.figure, colourOf('--ink'));
    if (this.figure.isMap) this.equalise(u);
    if (!this.hasDrawn) {
      this.hasDrawn = true;
      document.documentElement.dataset.drawn = String(Number(document.documentElement.dataset.drawn || 0) + 1);
    }
  }

  /** Widens the axis with more pixels per unit, so that both have the same. */
  equalise(u) {
    const {x, y} = u.scales;
    const xScale = u.bbox.width / (x.max - x.min), yScale = u.bbox.height / (y.max - y.min);
    if (Math.abs(xScale / yScale - 1) < 1e-3) return;
    const widened = (scale, factor) => {
      const middle = 0.5 * (scale.min + scale.max), half = 0.5 * (scale.max - scale.min) * factor;
      return {min: middle - half, max: middle + half};
    };
    const newX = xScale > yScale ? widened(x, xScale / yScale) : {min: x.min, max: x.max};
    const newY = xScale > yScale ? {min: y.min, max: y.max} : widened(y, yScale / xScale);
    // Not from within its own drawing.
    queueMicrotask(() => u.batch(() => { u.setScale('x', newX); u.setScale('y', newY); }));
  }

  scaled(key) {
    const {min, max} = this.u ? this.u.scales[key] : {min: null, max: null};
    if (min === null) return;
    this.section.dataset[key + 'Range'] = `${min},${max}`;
    if (key === 'x' && this.group && !this.isSetting) this.group.show(this, min, max);
  }

  showX(min, max) {
    if (!this.u || (this.u.scales.x.min === min && this.u.scales.x.max === max)) return;
    this.isSetting = true;
    // Set as a whole, so that the hook runs while the mark is up.
    this.u.batch(() => this.u.setScale('x', {min, max}));
    this.isSetting = false;
  }

  reset() {
    this.u.setScale('x', {min: this.xFull[0], max: this.xFull[1]});
  }

  /** After a change of what is shown: y fits again, x stays. */
  rescale() {
    this.u.setScale('x', {min: this.u.scales.x.min, max: this.u.scales.x.max});
  }

  readOff(u) {
    const {left, top} = u.cursor;
    const isOver = left >= 0 && left !== null && left !== undefined;
    const x = isOver ? u.posToVal(left, 'x') : NaN;
    const y = isOver && this.figure.isMap ? u.posToVal(top, 'y') : NaN;
    this.at.textContent = !isOver ? '' : this.figure.isMap ? `x ${shownNumber(x)}, y ${shownNumber(y)}` : `x ${shownNumber(x)}`;
    for (const entry of this.entries) {
      const series = entry.series;
      if (!series || this.figure.isMap || !series.isAscending) continue;
      const i = isOver ? nearestIndex(series.x, x) : -1;
      entry.value.textContent = i < 0 || !Number.isFinite(series.y[i]) ? '' : shownNumber(series.y[i]);
    }
  }

  resize() {
    const width = this.width, height = this.height;
    if (this.u && (width !== this.u.width || height !== this.u.height)) this.u.setSize({width, height});
  }

  repaint() {
    this.paintSwatches();
    this.u.redraw(false, true);
  }
}

/** Figures that have the quantity on x in common, and much of its range: they zoom together. */
class Group {
  constructor(key, range) { Object.assign(this, {key, range, charts: []}); }

  takes(range) {
    const [a, b] = this.range, [c, d] = range;
    return Math.min(b, d) - Math.max(a, c) >= 0.5 * (Math.max(b, d) - Math.min(a, c));
  }

  add(chart) {
    this.charts.push(chart);
    this.range = [Math.min(this.range[0], chart.xFull[0]), Math.max(this.range[1], chart.xFull[1])];
  }

  align() { for (const chart of this.charts) chart.xFull = this.range; }

  show(source, min, max) {
    for (const chart of this.charts) if (chart !== source) chart.showX(min, max);
  }
}

function groupFor(groups, figure) {
  if (figure.isMap) return null;
  let group = groups.find((other) => other.label === figure.xLabel && other.takes(figure.xFull));
  if (!group) {
    group = new Group('x' + groups.length, figure.xFull);
    group.label = figure.xLabel;
    groups.push(group);
  }
  return group;
}

/** The chart of one figure, or null where there is nothing to draw. */
function chartOf(section, source, xAxes, groups) {
  if (section.classList.contains('no-data')) return null;
  const figure = new FigureData(source, xAxes);
  if (!figure.hasData) {
    // All of it is too large to draw.
    section.classList.add('no-data');
    section.querySelector('.chart').append(element('p', 'empty', 'no data'));
    return null;
  }
  const group = groupFor(groups, figure);
  const chart = new Chart(section, figure, group);
  if (group) group.add(chart);
  return chart;
}

function buildCharts() {
  const data = JSON.parse(document.getElementById('data').textContent);
  const xAxes = data.x.map(decodeNumbers);
  const groups = [];
  document.documentElement.dataset.drawn = '0';
  // A figure that cannot be drawn leaves the others alone.
  const attempt = (i, act) => {
    try {
      return act();
    } catch (error) {
      console.error(error);
      document.querySelector(`#figure-${i + 1} .chart`).append(element('p', 'empty', 'this chart cannot be drawn'));
      return null;
    }
  };
  const charts = data.figures.map((source, i) =>
    attempt(i, () => chartOf(document.getElementById(`figure-${i + 1}`), source, xAxes, groups)));
  for (const group of groups) group.align();
  const drawn = charts.filter((chart, i) => chart && attempt(i, () => { chart.create(); return true; }));
  new ResizeObserver(() => drawn.forEach((chart) => chart.resize())).observe(document.querySelector('main'));
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => drawn.forEach((chart) => chart.repaint()));
}

buildCharts();
