// What the page holds, decoded: series of a figure as typed arrays, and their ranges.

/** Numbers with NaN for null; {start, step, count} stands for evenly spaced ones. */
function decodeNumbers(source) {
  if (Array.isArray(source)) return Float64Array.from(source, (v) => (v === null ? NaN : v));
  const values = new Float64Array(source.count);
  for (let i = 0; i < source.count; ++i) values[i] = source.start + i * source.step;
  return values;
}

function isAscending(x) {
  for (let i = 0; i < x.length; ++i) {
    if (!Number.isFinite(x[i]) || (i > 0 && x[i] < x[i - 1])) return false;
  }
  return true;
}

/** First index whose x is at least value, of ascending x. */
function lowerBound(x, value) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

/** Index of the x nearest to value, of ascending x; -1 when there is none. */
function nearestIndex(x, value) {
  if (x.length === 0) return -1;
  const after = Math.min(lowerBound(x, value), x.length - 1);
  return after > 0 && value - x[after - 1] < x[after] - value ? after - 1 : after;
}

class Extent {
  constructor() { this.low = Infinity; this.high = -Infinity; }
  add(value) {
    // Beyond this uPlot draws no axis: what has run away so far leaves the picture.
    if (!(Math.abs(value) < 1e15)) return;
    if (value < this.low) this.low = value;
    if (value > this.high) this.high = value;
  }
  get isEmpty() { return !(this.low <= this.high); }
}

class Series {
  constructor(data, xAxes, place) {
    this.name = data.name;
    this.style = data.style;
    this.isDashed = data.dashed === true;
    this.x = xAxes[data.x];
    this.y = decodeNumbers(data.y);
    this.low = data.low ? decodeNumbers(data.low) : null;
    this.high = data.high ? decodeNumbers(data.high) : null;
    this.place = place;
    this.isShown = true;
    this.isAscending = isAscending(this.x);
  }

  /** Indices [from, to) that a view of x from xMin to xMax needs: one more on each side. */
  visible(xMin, xMax) {
    if (!this.isAscending) return [0, this.x.length];
    return [Math.max(0, lowerBound(this.x, xMin) - 1), Math.min(this.x.length, lowerBound(this.x, xMax) + 2)];
  }

  extendX(extent) {
    for (let i = 0; i < this.x.length; ++i) {
      if (Number.isFinite(this.y[i]) || (this.low && Number.isFinite(this.low[i]))) extent.add(this.x[i]);
    }
  }

  extendY(extent, xMin, xMax, isLog) {
    const [from, to] = this.visible(xMin, xMax);
    const take = (value) => { if (!isLog || value > 0) extent.add(value); };
    for (let i = from; i < to; ++i) {
      if (this.x[i] < xMin || this.x[i] > xMax) continue;
      take(this.y[i]);
      if (this.low) { take(this.low[i]); take(this.high[i]); }
    }
  }
}

class FigureData {
  constructor(data, xAxes) {
    Object.assign(this, {
      name: data.name, title: data.title, xLabel: data.x_label, yLabel: data.y_label,
      isLog: data.log_y === true, isMap: data.equal === true, levels: data.levels, spans: data.spans,
    });
    this.series = data.series.map((series, i) => new Series(series, xAxes, i));
    this.spanNames = [...new Set(this.spans.map((span) => span.name))];
    this.hiddenSpans = new Set();
    this.hiddenLevels = new Set();
    this.xFull = this.paddedX();
  }

  get hasData() { return this.xFull !== null; }

  paddedX() {
    const extent = new Extent();
    for (const series of this.series) series.extendX(extent);
    if (extent.isEmpty) return null;
    const margin = extent.high > extent.low ? 0.01 * (extent.high - extent.low)
                                            : 0.5 * Math.max(1e-9, Math.abs(extent.low) || 1);
    return [extent.low - margin, extent.high + margin];
  }

  /** Range of y over what is shown between xMin and xMax. */
  rangeY(xMin, xMax) {
    const extent = new Extent();
    for (const series of this.series) if (series.isShown) series.extendY(extent, xMin, xMax, this.isLog);
    this.levels.forEach((level, i) => {
      if (!this.hiddenLevels.has(i) && (!this.isLog || level.y > 0)) extent.add(level.y);
    });
    if (extent.isEmpty) return this.isLog ? [0.1, 1] : [0, 1];
    let {low, high} = extent;
    if (this.isLog) {
      // Half a decade around a single value, else a twentieth of what is shown.
      const margin = low === high ? 0.5 : 0.05 * Math.log10(high / low);
      return [low / 10 ** margin, high * 10 ** margin];
    }
    const margin = high > low ? 0.05 * (high - low) : 0.5 * Math.max(1e-9, Math.abs(low) || 1);
    return [low - margin, high + margin];
  }
}

/** Steps of 1, 2 or 5 times a power of ten, about count of them between low and high. */
function linearTicks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const factor = raw / power;
  const step = power * (factor <= 1 ? 1 : factor <= 2 ? 2 : factor <= 5 ? 5 : 10);
  const ticks = [];
  if (!(step > 0) || low + step === low) return ticks;
  for (let i = Math.ceil(low / step); i * step <= high && ticks.length < 100; ++i) ticks.push(i * step);
  return ticks;
}

/** Powers of ten where the range spans some, else finer steps. */
function logTicks(low, high, count) {
  const decades = Math.log10(high / low);
  if (decades < 1) return linearTicks(low, high, count).filter((tick) => tick > 0);
  const stride = Math.ceil(decades / Math.max(2, count));
  const factors = 3 * decades <= count ? [1, 2, 5] : 2 * decades <= count ? [1, 3] : [1];
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power) {
    if (power % stride !== 0) continue;
    for (const factor of factors) {
      const tick = Number(`${factor}e${power}`);
      if (tick >= low && tick <= high) ticks.push(tick);
    }
  }
  return ticks;
}

/** Labels of ticks with as many decimals as tell them apart. */
function tickLabels(ticks, isLog) {
  if (ticks.length === 0) return [];
  const largest = Math.max(...ticks.map(Math.abs));
  if (isLog) {
    return ticks.map((tick) => (tick >= 1e-3 && tick < 1e5 ? String(Number(tick.toPrecision(6)))
                                                           : tick.toExponential().replace('e+', 'e')));
  }
  const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : largest || 1;
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  if (largest >= 1e6 || (largest > 0 && decimals > 5)) {
    const digits = Math.min(12, Math.max(0, Math.ceil(Math.log10(largest / step) - 1e-9)));
    return ticks.map((tick) => (tick === 0 ? '0' : tick.toExponential(digits).replace('e+', 'e')));
  }
  return ticks.map((tick) => (Math.abs(tick) < 1e-9 * step ? 0 : tick).toFixed(decimals));
}

/** A value for reading off: five digits. */
function shownNumber(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential(4).replace('e+', 'e');
  return String(Number(value.toPrecision(size >= 1e4 ? 8 : 5)));
}
