// Saving a chart as a picture and its numbers as a table.

function saveAs(blob, fileName) {
  const link = element('a');
  link.href = URL.createObjectURL(blob);
  link.download = fileName;
  link.click();
  // The browser has read the address by the next turn of its loop.
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** Places of legend entries in rows no wider than the picture. */
function legendRows(ctx, entries, width, ratio) {
  const rows = [[]];
  let x = 0;
  for (const entry of entries) {
    const entryWidth = ctx.measureText(entry.name).width + 54 * ratio;
    if (x > 0 && x + entryWidth > width) { rows.push([]); x = 0; }
    rows[rows.length - 1].push({entry, x});
    x += entryWidth;
  }
  return rows;
}

/** Title, legend and chart, as they are seen now. */
function savePicture(chart) {
  const source = chart.u.ctx.canvas, ratio = uPlot.pxRatio;
  const canvas = element('canvas'), ctx = canvas.getContext('2d');
  const margin = 10 * ratio, rowHeight = 20 * ratio, titleHeight = 28 * ratio;
  const legendFont = `${12 * ratio}px system-ui, sans-serif`;
  ctx.font = legendFont;
  const rows = legendRows(ctx, chart.entries.filter((entry) => entry.isShown()), source.width - 2 * margin, ratio);
  const top = titleHeight + rows.length * rowHeight + margin;
  canvas.width = source.width;
  canvas.height = source.height + top + margin;
  ctx.fillStyle = colourOf('--paper');
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.fillStyle = colourOf('--ink');
  ctx.textBaseline = 'middle';
  ctx.font = `bold ${14 * ratio}px system-ui, sans-serif`;
  ctx.fillText(chart.figure.title, margin, margin + titleHeight / 2, canvas.width - 2 * margin);
  ctx.font = legendFont;
  rows.forEach((row, r) => {
    const y = titleHeight + margin + (r + 0.5) * rowHeight;
    for (const {entry, x} of row) {
      drawSwatch(ctx, entry, margin + x, y - 7 * ratio, ratio);
      ctx.fillStyle = colourOf('--ink');
      ctx.fillText(entry.name, margin + x + 36 * ratio, y);
    }
  });
  ctx.drawImage(source, 0, top);
  canvas.toBlob((blob) => saveAs(blob, chart.figure.name + '.png'), 'image/png');
}

function csvText(text) {
  // A spreadsheet takes these beginnings for a formula.
  const safe = /^[=+\-@\t\r]/.test(text) ? "'" + text : text;
  return '"' + safe.replaceAll('"', '""') + '"';
}

function csvNumber(value) { return Number.isFinite(value) ? String(Number(value.toPrecision(12))) : ''; }

/** One row a point: series, x, y, low, high. */
function saveTable(figure) {
  const lines = ['series,x,y,low,high'];
  for (const series of figure.series) {
    const name = csvText(series.name);
    for (let i = 0; i < series.x.length; ++i) {
      const band = series.low ? [csvNumber(series.low[i]), csvNumber(series.high[i])] : ['', ''];
      lines.push([name, csvNumber(series.x[i]), csvNumber(series.y[i]), ...band].join(','));
    }
  }
  saveAs(new Blob([lines.join('\n') + '\n'], {type: 'text/csv'}), figure.name + '.csv');
}
