// The strip chart: some quantities over the time of the run, and a cursor at the time that is shown.

// Margins of the plot [pixels]; the right one where there is a second axis.
const MARGINS = { left: 74, right: 24, top: 12, bottom: 22 }, SECOND = 74;
// Dashes of a bound of what may be, and of one of what is accepted.
const BOUND_DASH = [2, 3], ACCEPTED_DASH = [8, 3, 2, 3], DESIRED_DASH = [6, 4];
// Height of the plot for each of its ticks [pixels].
const TICK = 26;
const FONT = "12px system-ui, sans-serif";

/** The value of a colour of the page's style. */
function painter() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

const chart = {
  canvas: byId("chart"),
  chosen: curves.slice(0, 1),
  drawn: null,
  time: 0,
  hovered: null,
  // The scale that was asked for; null for that which suits the curves.
  scale: null,

  /** Draws some quantities, in one or two units, in place of those before. */
  setChosen(chosen) {
    this.chosen = chosen;
    this.scale = null;
    reach.chosen.clear();
    this.changed();
    this.canvas.dispatchEvent(new Event("chosen"));
  },

  /** What is drawn has changed, or the time of its ends. */
  changed() {
    this.drawn = null;
    this.draw();
    legend.tell();
    reach.tell();
  },

  /** Draws the values on a logarithmic axis in place of a linear one, or the other way round. */
  turnScale() {
    const log = this.drawn ? [...this.drawn.axes.values()].some(({ range }) => range.log) : false;
    this.setScale(log ? "linear" : "log");
  },

  setScale(scale) {
    this.scale = scale;
    reach.chosen.clear();
    this.changed();
    this.canvas.dispatchEvent(new Event("chosen"));
  },

  lines() {
    return linesOf(this.chosen);
  },

  show(t) {
    this.time = t;
    choosing.show(t);
    this.draw();
  },

  resize() {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    this.drawn = null;
    hover.hide();
    this.draw();
  },

  frame(width = this.canvas.clientWidth, height = this.canvas.clientHeight) {
    const { left, top, bottom } = MARGINS;
    const right = unitsOf(this.chosen).length > 1 ? SECOND : MARGINS.right;
    return { left, right, top, width: width - left - right, height: height - top - bottom };
  },

  timeAt(x) {
    const { left, width } = this.frame();
    return span.from + clamp((x - left) / width, 0, 1) * (span.to - span.from);
  },

  placeOf(t, { left, width } = this.frame()) {
    return left + (width * (t - span.from)) / (span.to - span.from);
  },

  /** Draws curves and axes only when they change, and the cursor over them. */
  draw() {
    const { canvas } = this;
    if (!this.chosen.length || canvas.width === 0 || canvas.height === 0) return;
    const ratio = window.devicePixelRatio || 1;
    const context = canvas.getContext("2d");
    const paint = painter();
    if (!this.drawn) {
      const still = document.createElement("canvas");
      [still.width, still.height] = [canvas.width, canvas.height];
      const on = still.getContext("2d");
      on.scale(ratio, ratio);
      const frame = this.frame();
      this.drawn = { still, frame, ...drawCurves(on, this.lines(), frame, paint) };
      alignTime(frame);
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(this.drawn.still, 0, 0);
    context.scale(ratio, ratio);
    if (this.hovered !== null) this.drawCursor(context, paint, this.hovered, "muted", 1);
    this.drawCursor(context, paint, this.time, "ink", 1.5);
  },

  drawCursor(context, paint, t, colour, width) {
    const { lines, axes, frame } = this.drawn;
    if (t < span.from || t > span.to) return;
    const x = this.placeOf(t, frame);
    context.strokeStyle = paint(colour);
    context.lineWidth = width;
    context.beginPath();
    context.moveTo(x, frame.top - 4);
    context.lineTo(x, frame.top + frame.height);
    context.stroke();
    for (const { curve } of lines) {
      const axis = axes.get(curve.unit), value = valueAt(curve, t), y = axis.toY(value);
      if (!isFinite(y) || (axis.byHand && !axis.holds(value))) continue;
      context.beginPath();
      context.arc(x, clamp(y, frame.top, frame.top + frame.height), 4, 0, 2 * Math.PI);
      context.fillStyle = paint("panel");
      context.fill();
      context.stroke();
    }
  },
};

/** Gives the chart about half of the page, or its usual height. */
function toggleLargeChart() {
  const large = document.body.classList.toggle("charted");
  byId("large-chart")?.setAttribute("aria-pressed", large);
}

/** Puts the slider of the time where the chart has its time: one axis for both. */
function alignTime({ left, right }) {
  const { style } = byId("numbers");
  style.setProperty("--plot-left", `${left}px`);
  style.setProperty("--plot-right", `${right}px`);
  document.querySelector("#plot .axis.second").hidden = right !== SECOND;
}

/** Draws lines with their axes; returns what is drawn, and the axes by unit. */
function drawCurves(context, lines, frame, paint) {
  const { left, top, width, height } = frame;
  const axes = axesOf(lines, frame);
  const toX = (t) => chart.placeOf(t, frame);
  context.font = FONT;
  shadeTimes(context, frame, toX, paint);
  drawMarks(context, frame, toX, paint);
  axes.slice(0, 2).forEach((axis, k) => drawAxis(context, axis, frame, paint, k === 1));
  drawTimes(context, frame, toX, paint);
  context.save();
  context.beginPath();
  context.rect(left, top - 2, width, height + 4);
  context.clip();
  const byUnit = new Map(axes.map((axis) => [axis.unit, axis]));
  for (const { curve } of lines) drawBounds(context, curve, byUnit.get(curve.unit), frame, toX, paint);
  for (const line of lines) {
    const { curve } = line, { toY } = byUnit.get(curve.unit), colour = colourOf(line, paint);
    if (curve.desired) drawLine(context, curve.time, curve.desired, toX, toY, paint("desired"), DESIRED_DASH);
    if (curve.low) drawBand(context, curve, toX, toY, colour);
    else drawLine(context, curve.time, curve.values, toX, toY, colour, dashOf(line));
  }
  context.restore();
  nameMarks(context, frame, toX, paint);
  return { lines, axes: byUnit };
}

/** Shades the time in which errors are evaluated, and marks the ends of a loop. */
function shadeTimes(context, { left, top, width, height }, toX, paint) {
  const inPlot = (t) => clamp(toX(t), left, left + width);
  if (data.window) {
    const [from, to] = data.window.map(inPlot);
    context.fillStyle = paint("shade");
    context.fillRect(from, top, to - from, height);
  }
  if (player.loop) {
    const [from, to] = player.loop.map(inPlot);
    context.fillStyle = paint("focus");
    context.fillRect(from, top + height - 3, to - from, 3);
  }
}

function drawAxis(context, { unit, range, toY }, { left, top, width, height }, paint, second) {
  context.lineWidth = 1;
  context.fillStyle = paint("muted");
  context.strokeStyle = paint("line");
  context.textAlign = second ? "left" : "right";
  context.textBaseline = "middle";
  for (const tick of ticksOf(range, ticksIn(height))) {
    const y = Math.round(toY(tick)) + 0.5;
    if (!second) {
      context.beginPath();
      context.moveTo(left, y);
      context.lineTo(left + width, y);
      context.stroke();
    }
    context.fillText(tickText(tick, unit, range), second ? left + width + 8 : left - 8, y);
  }
}

function drawTimes(context, { top, width, height }, toX, paint) {
  context.fillStyle = paint("muted");
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const tick of ticksOf({ low: span.from, high: span.to }, Math.max(2, Math.floor(width / 90)))) {
    context.fillText(`${parseFloat(tick.toPrecision(6))} s`, toX(tick), top + height + 6);
  }
}

/** Moments of the run that lie in the plot, such as that at which a joint locks. */
function* marksWithin({ left, width }, toX) {
  for (const [k, { time, name }] of (data.marks || []).entries()) {
    const x = toX(clamp(time, 0, data.duration));
    if (x >= left && x <= left + width) yield { x, name, row: k };
  }
}

/** Draws a line at each of these moments, behind the curves. */
function drawMarks(context, frame, toX, paint) {
  context.lineWidth = 1.5;
  context.strokeStyle = paint("bound");
  context.setLineDash([1, 3]);
  for (const { x } of marksWithin(frame, toX)) {
    context.beginPath();
    context.moveTo(x, frame.top);
    context.lineTo(x, frame.top + frame.height);
    context.stroke();
  }
  context.setLineDash([]);
}

/** Writes their names over the curves, which leave some room round the letters. */
function nameMarks(context, frame, toX, paint) {
  context.textBaseline = "top";
  context.lineJoin = "round";
  context.lineWidth = 5;
  context.strokeStyle = paint("panel");
  context.fillStyle = paint("bound");
  for (const { x, name, row } of marksWithin(frame, toX)) {
    // To the left where there is no room to the right, and never over the edge of a narrow chart.
    const width = context.measureText(name).width;
    const fits = x + 6 + width < frame.left + frame.width;
    const place = [fits ? x + 6 : Math.max(x - 6 - width, frame.left), frame.top + 2 + 15 * row];
    context.textAlign = "left";
    context.strokeText(name, ...place, frame.width);
    context.fillText(name, ...place, frame.width);
  }
}

/** Draws what a curve must not pass, and, in the time that counts, what is accepted of it. */
function drawBounds(context, { bound, bounds = [], accepted }, { toY, holds }, { left, width }, toX, paint) {
  for (const level of bound === null ? bounds : [bound, ...bounds]) {
    if (holds(level)) drawLevel(context, left, left + width, toY(level), paint("bound"), BOUND_DASH);
  }
  for (const { level, windowed } of accepted) {
    if (!holds(level)) continue;
    const ends = windowed && data.window ? data.window : [0, data.duration];
    const [from, to] = ends.map((t) => clamp(toX(t), left, left + width));
    drawLevel(context, from, to, toY(level), paint("bound"), ACCEPTED_DASH);
  }
}
