// Lines on a canvas.

/** A line through samples: of those in one column of pixels, the first, least, largest and last. */
function drawLine(context, time, values, toX, toY, colour, dash) {
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.lineJoin = "round";
  context.setLineDash(dash);
  context.beginPath();
  let column = null, pen = false, low = 0, high = 0, last = 0;
  const flush = () => {
    if (column === null) return;
    for (const y of [low, high, last]) context.lineTo(column, y);
  };
  for (let k = 0; k < values.length; k++) {
    if (!isFinite(values[k])) { flush(); column = null; pen = false; continue; }
    const x = Math.round(2 * toX(time[k])) / 2, y = toY(values[k]);
    if (x === column) {
      [low, high, last] = [Math.max(low, y), Math.min(high, y), y];
      continue;
    }
    flush();
    if (pen) context.lineTo(x, y); else context.moveTo(x, y);
    [column, low, high, last, pen] = [x, y, y, y, true];
  }
  flush();
  context.stroke();
  context.setLineDash([]);
}

/** The least and the largest value of each interval, as one line up and down. */
function drawBand(context, { begins, low, high }, toX, toY, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1.75;
  context.beginPath();
  for (let k = 0; k < begins.length; k++) {
    if (!isFinite(low[k])) continue;
    const x = toX(begins[k]);
    context.lineTo(x, toY(low[k]));
    context.lineTo(x, toY(high[k]));
  }
  context.stroke();
}

/** A level line from one place to another. */
function drawLevel(context, from, to, y, colour, dash) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(from, y);
  context.lineTo(to, y);
  context.stroke();
  context.setLineDash([]);
}
