// How one figure's content is drawn on uPlot's canvas: spans, bands, levels, lines and points, each
// thinned to what the pixels can show.

const kNumColours = 6;  // --curve0 to --curve5 of the style
const kSpanColours = ['#e69f00', '#56b4e9', '#999999', '#cc79a7'];
// Mostly solid for ordinary curves, open for dashed ones: told apart without colour too.
const kSolidDashes = [[], [18, 3], [18, 3, 3, 3], [18, 3, 3, 3, 3, 3], [9, 2], [30, 4]];
const kOpenDashes = [[6, 5], [2, 4], [9, 4, 2, 4], [4, 4], [12, 6], [1, 3]];
const kBandAlpha = 0.2, kSpanAlpha = 0.22;

function colourOf(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
function seriesColour(series) { return colourOf('--curve' + (series.place % kNumColours)); }
function seriesDashes(series) {
  return (series.isDashed ? kOpenDashes : kSolidDashes)[series.place % kSolidDashes.length];
}
function spanColour(figure, name) { return kSpanColours[figure.spanNames.indexOf(name) % kSpanColours.length]; }

/** Adds the marker of a series (its shape tells the place) around (x, y) to a path. */
function addMarker(path, place, x, y, r) {
  switch (place % 6) {
    case 0: path.moveTo(x + r, y); path.arc(x, y, r, 0, 2 * Math.PI); break;
    case 1: path.rect(x - r, y - r, 2 * r, 2 * r); break;
    case 2: path.moveTo(x, y - 1.2 * r); path.lineTo(x + 1.1 * r, y + r); path.lineTo(x - 1.1 * r, y + r); path.closePath(); break;
    case 3: path.moveTo(x, y - 1.4 * r); path.lineTo(x + 1.4 * r, y); path.lineTo(x, y + 1.4 * r); path.lineTo(x - 1.4 * r, y); path.closePath(); break;
    case 4: path.moveTo(x, y + 1.2 * r); path.lineTo(x + 1.1 * r, y - r); path.lineTo(x - 1.1 * r, y - r); path.closePath(); break;
    default: path.rect(x - 1.5 * r, y - 0.5 * r, 3 * r, r); path.rect(x - 0.5 * r, y - 1.5 * r, r, 3 * r);
  }
}

/** Maps values to canvas pixels; far outside all places look the same. */
class View {
  constructor(u, isLog) {
    const {left, top, width, height} = u.bbox;
    Object.assign(this, {left, top, width, height, isLog, xMin: u.scales.x.min, xMax: u.scales.x.max});
    const f = isLog ? Math.log10 : (value) => value;
    const bottom = f(u.scales.y.min), span = f(u.scales.y.max) - bottom;
    const clamp = (pixel) => Math.max(-1e5, Math.min(1e5, pixel));
    this.x = (value) => clamp(left + (width * (value - this.xMin)) / (this.xMax - this.xMin));
    this.y = (value) => (isLog && value <= 0 ? 1e5 : clamp(top + height * (1 - (f(value) - bottom) / span)));
  }
  canShow(value) { return Number.isFinite(value) && (!this.isLog || value > 0); }
}

/** Calls lineTo or moveTo for the curve; a column of pixels gets at most four points. */
function traceColumns(view, series, from, to, path) {
  const {x, y} = series;
  let column = NaN, isOpen = false, low = 0, high = 0, last = 0, lastX = 0;
  const flush = () => {
    if (!isOpen) return;
    path.lineTo(column, low); path.lineTo(column, high); path.lineTo(lastX, last);
  };
  for (let i = from; i < to; ++i) {
    if (!view.canShow(y[i])) { flush(); isOpen = false; column = NaN; continue; }
    const pixel = Math.round(view.x(x[i])), value = view.y(y[i]);
    if (pixel !== column) {
      flush();
      if (isOpen) {
        if (series.style === 'steps') path.lineTo(pixel, last);
        path.lineTo(pixel, value);
      } else {
        path.moveTo(pixel, value);
      }
      column = pixel; low = high = value; isOpen = true;
    }
    if (value < low) low = value;
    if (value > high) high = value;
    last = value; lastX = pixel;
  }
  flush();
}

/** The curve point by point; points that fall together on the screen are left out. */
function tracePoints(view, series, from, to, path, nearPixels) {
  const {x, y} = series;
  let runLength = 0, lastX = 0, lastY = 0;
  // A lone point between gaps shows as a stroke of its own.
  const close = () => {
    if (runLength === 1) { path.moveTo(lastX - 2, lastY); path.lineTo(lastX + 2, lastY); }
    runLength = 0;
  };
  for (let i = from; i < to; ++i) {
    if (!view.canShow(y[i]) || !Number.isFinite(x[i])) { close(); continue; }
    const px = view.x(x[i]), py = view.y(y[i]);
    if (runLength === 0) {
      path.moveTo(px, py);
    } else {
      if (Math.abs(px - lastX) < nearPixels && Math.abs(py - lastY) < nearPixels) continue;
      if (series.style === 'steps') path.lineTo(px, lastY);
      path.lineTo(px, py);
    }
    ++runLength; lastX = px; lastY = py;
  }
  close();
}

function drawCurve(ctx, view, series, ratio) {
  const [from, to] = series.visible(view.xMin, view.xMax);
  const path = new Path2D();
  const isDense = to - from > 3 * view.width;
  if (isDense && series.isAscending) traceColumns(view, series, from, to, path);
  else tracePoints(view, series, from, to, path, isDense ? 0.7 : 0);
  ctx.strokeStyle = seriesColour(series);
  ctx.lineWidth = (series.isDashed ? 2 : 1.6) * ratio;
  ctx.lineJoin = 'round';
  ctx.lineCap = 'butt';
  // Dashes of a curve denser than the pixels are only noise, and slow.
  ctx.setLineDash(isDense ? [] : seriesDashes(series).map((length) => length * ratio));
  ctx.stroke(path);
  ctx.setLineDash([]);
}

function drawMarkers(ctx, view, series, ratio) {
  const [from, to] = series.visible(view.xMin, view.xMax);
  const radius = (to - from > 2000 ? 1.6 : to - from > 300 ? 2.4 : 3.2) * ratio;
  const cell = Math.max(1, radius / 2);
  const path = new Path2D(), taken = new Set(), columns = Math.ceil(view.width / cell) + 8;
  for (let i = from; i < to; ++i) {
    if (!view.canShow(series.y[i]) || !Number.isFinite(series.x[i])) continue;
    const x = view.x(series.x[i]), y = view.y(series.y[i]);
    if (x < view.left - 9 || x > view.left + view.width + 9 || y < view.top - 9 || y > view.top + view.height + 9) continue;
    const key = Math.round(y / cell) * columns + Math.round((x - view.left) / cell);
    if (taken.has(key)) continue;
    taken.add(key);
    addMarker(path, series.place, x, y, radius);
  }
  ctx.fillStyle = seriesColour(series);
  ctx.fill(path);
}

/** Corners of the band's edges, by columns of pixels where points are denser than these. */
function bandCorners(view, series, from, to) {
  const {x, low, high} = series;
  const isDense = series.isAscending && to - from > 3 * view.width;
  const parts = [];
  let part = null;
  for (let i = from; i < to; ++i) {
    const isUsable = Number.isFinite(x[i]) && Number.isFinite(low[i]) && view.canShow(high[i]);
    if (!isUsable) { part = null; continue; }
    const px = isDense ? Math.round(view.x(x[i])) : view.x(x[i]);
    const top = view.y(high[i]), bottom = view.y(low[i]);
    if (part === null) parts.push((part = []));
    const last = part[part.length - 1];
    if (isDense && last !== undefined && last.x === px) {
      last.top = Math.min(last.top, top);
      last.bottom = Math.max(last.bottom, bottom);
      continue;
    }
    if (series.style === 'steps' && last !== undefined) part.push({x: px, top: last.top, bottom: last.bottom});
    part.push({x: px, top, bottom});
  }
  return parts;
}

function drawBand(ctx, view, series) {
  const [from, to] = series.visible(view.xMin, view.xMax);
  const path = new Path2D();
  for (const part of bandCorners(view, series, from, to)) {
    part.forEach((corner, i) => (i === 0 ? path.moveTo(corner.x, corner.top) : path.lineTo(corner.x, corner.top)));
    for (let i = part.length - 1; i >= 0; --i) path.lineTo(part[i].x, part[i].bottom);
    path.closePath();
  }
  ctx.globalAlpha = kBandAlpha;
  ctx.fillStyle = seriesColour(series);
  ctx.fill(path);
  ctx.globalAlpha = 1;
}

function drawSpans(ctx, view, figure) {
  for (const name of figure.spanNames) {
    if (figure.hiddenSpans.has(name)) continue;
    const path = new Path2D();
    for (const span of figure.spans) {
      if (span.name !== name || span.to < view.xMin || span.from > view.xMax) continue;
      const left = view.x(span.from);
      // A moment is seen too.
      path.rect(left, view.top, Math.max(1, view.x(span.to) - left), view.height);
    }
    ctx.globalAlpha = kSpanAlpha;
    ctx.fillStyle = spanColour(figure, name);
    ctx.fill(path);
    ctx.globalAlpha = 1;
  }
}

function drawLevels(ctx, view, figure, ink, ratio) {
  figure.levels.forEach((level, i) => {
    if (figure.hiddenLevels.has(i) || !view.canShow(level.y)) return;
    const y = view.y(level.y);
    ctx.strokeStyle = ink;
    ctx.lineWidth = 1.2 * ratio;
    ctx.setLineDash((i % 2 === 0 ? [8, 4] : [8, 4, 2, 4]).map((length) => length * ratio));
    ctx.beginPath();
    ctx.moveTo(view.left, y);
    ctx.lineTo(view.left + view.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
  });
}

function drawFigure(u, figure, ink) {
  const view = new View(u, figure.isLog), ctx = u.ctx, ratio = uPlot.pxRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(view.left, view.top, view.width, view.height);
  ctx.clip();
  drawSpans(ctx, view, figure);
  const shown = figure.series.filter((series) => series.isShown);
  for (const series of shown) if (series.low) drawBand(ctx, view, series);
  drawLevels(ctx, view, figure, ink, ratio);
  for (const series of shown) {
    if (series.style === 'points') drawMarkers(ctx, view, series, ratio);
    else drawCurve(ctx, view, series, ratio);
  }
  ctx.restore();
}
