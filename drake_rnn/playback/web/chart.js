// The strip chart: one curve over the time of the run, and all numbers at the time that is shown.

const MARGINS = { left: 74, right: 24, top: 12, bottom: 22 };

/** Times at the left and at the right end of the chart [s]. */
const span = { from: 0, to: data.duration || 1 };

const curves = data.curves.map((curve) => {
  const numbers = { time: unpacked(curve.time), values: unpacked(curve.values) };
  if (curve.desired) numbers.desired = unpacked(curve.desired);
  // A long run: the least and the largest value of each interval.
  for (const name of ["begins", "low", "high"]) {
    numbers[name] = curve[name] ? unpacked(curve[name]) : null;
  }
  return { ...curve, ...numbers };
});

const chart = {
  canvas: byId("chart"),
  curve: curves[0],
  buttons: [],
  time: 0,

  build() {
    const row = byId("curves");
    for (const curve of curves) {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("role", "radio");
      button.dataset.curve = curve.key;
      const name = document.createElement("span");
      name.textContent = curve.name;
      const number = document.createElement("b");
      button.append(name, number);
      button.addEventListener("click", () => this.choose(curve));
      row.append(button);
      this.buttons.push({ curve, button, number });
    }
    if (curves.length) this.choose(curves[0]);
    else byId("numbers").hidden = true;
  },

  choose(curve) {
    this.curve = curve;
    for (const { curve: one, button } of this.buttons) {
      button.setAttribute("aria-checked", one === curve);
    }
    this.drawn = null;
    this.draw();
  },

  /** The value of a curve at a time: that of the run's nearest sample. */
  valueAt(curve, t) {
    return curve.values[nearest(curve.time, t)];
  },

  show(t) {
    this.time = t;
    for (const { curve, button, number } of this.buttons) {
      const value = this.valueAt(curve, t);
      number.textContent = told(value, curve.unit) + this.wanted(curve, t);
      // Values come as single precision.
      const over = curve.bound !== null && (curve.above ? value < curve.bound
        : value > curve.bound * (1 + 1e-6));
      button.classList.toggle("over", over);
    }
    this.draw();
  },

  wanted(curve, t) {
    if (!curve.desired) return "";
    return " of " + told(curve.desired[nearest(curve.time, t)], curve.unit);
  },

  resize() {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    this.drawn = null;
    this.draw();
  },

  frame() {
    const { left, right, top, bottom } = MARGINS;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return { left, top, width: width - left - right, height: height - top - bottom };
  },

  timeAt(x) {
    const { left, width } = this.frame();
    return span.from + clamp((x - left) / width, 0, 1) * (span.to - span.from);
  },

  /** Draws curve and axes only when they change, and the cursor over them. */
  draw() {
    const { canvas, curve } = this;
    if (!curve || canvas.width === 0 || canvas.height === 0) return;
    const ratio = window.devicePixelRatio || 1;
    const context = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const paint = (name) => style.getPropertyValue(`--${name}`).trim();
    if (!this.drawn) {
      const still = document.createElement("canvas");
      [still.width, still.height] = [canvas.width, canvas.height];
      const on = still.getContext("2d");
      on.scale(ratio, ratio);
      this.drawn = { still, ...drawCurve(on, curve, this.frame(), paint) };
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(this.drawn.still, 0, 0);
    context.scale(ratio, ratio);
    this.drawCursor(context, paint);
  },

  drawCursor(context, paint) {
    const { left, top, width, height } = this.frame();
    const x = left + (width * (this.time - span.from)) / (span.to - span.from);
    context.strokeStyle = paint("ink");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, top - 4);
    context.lineTo(x, top + height);
    context.stroke();
    const value = this.valueAt(this.curve, this.time);
    const y = this.drawn.toY(value);
    if (!isFinite(y)) return;
    context.beginPath();
    context.arc(x, clamp(y, top, top + height), 4, 0, 2 * Math.PI);
    context.fillStyle = paint("panel");
    context.fill();
    context.stroke();
  },
};

/** The range of a curve's axis. */
function rangeOf(curve) {
  const arrays = [curve.low || curve.values, curve.high || curve.values, curve.desired || []];
  let low = Infinity, high = -Infinity, least = Infinity;
  for (const array of arrays) {
    for (const value of array) {
      if (!isFinite(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
      if (value > 0) least = Math.min(least, value);
    }
  }
  if (curve.scale === "log" && least < Infinity) {
    const bottom = Math.max(least, high * 1e-8);
    const top = Math.ceil(Math.log10(high) + 0.05);
    return { log: true, low: 10 ** Math.min(Math.floor(Math.log10(bottom)), top - 1), high: 10 ** top };
  }
  // A bound that is far away would flatten the curve.
  const bound = curve.bound;
  if (bound !== null && bound < 4 * high && bound > low - 3 * (high - low)) {
    low = Math.min(low, bound);
    high = Math.max(high, bound);
  }
  if (low > 0 && low < 0.5 * high) low = 0;
  const room = 0.06 * (high - low || Math.abs(high) || 1);
  return { log: false, low: low === 0 ? 0 : low - room, high: high + room };
}

function ticksOf({ log, low, high }, count) {
  if (log) {
    const [first, last] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
    const step = Math.ceil((last - first) / count);
    return Array.from({ length: Math.floor((last - first) / step) + 1 }, (_, k) => 10 ** (last - k * step));
  }
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((x) => x * power).find((x) => x >= raw);
  const ticks = [];
  for (let x = Math.ceil(low / step - 1e-9) * step; x <= high + 1e-9 * step; x += step) {
    ticks.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  }
  return ticks;
}

/** A tick's number, without the digits that it does not need; a linear axis has one unit. */
function tickText(value, unit, { log, low, high }) {
  const [factor, name] = unitFor(log ? value : Math.max(Math.abs(low), Math.abs(high)), unit);
  return `${parseFloat((factor * value).toPrecision(6))} ${name}`.trim().replace("-", "−");
}

function drawCurve(context, curve, frame, paint) {
  const range = rangeOf(curve);
  const { left, top, width, height } = frame;
  const place = range.log ? (v) => Math.log10(v / range.low) / Math.log10(range.high / range.low)
    : (v) => (v - range.low) / (range.high - range.low);
  const toY = (v) => top + height * (1 - clamp(v > 0 || !range.log ? place(v) : 0, -0.02, 1.02));
  const toX = (t) => left + (width * (t - span.from)) / (span.to - span.from);
  context.font = "12px system-ui, sans-serif";
  drawAxes(context, curve, range, frame, { toX, toY, paint });
  context.save();
  context.beginPath();
  context.rect(left, top - 2, width, height + 4);
  context.clip();
  if (curve.desired) drawLine(context, curve.time, curve.desired, toX, toY, paint("desired"), [6, 4]);
  const colour = curve.key === "force" ? paint("force") : paint("traced");
  if (curve.low) drawBand(context, curve, toX, toY, colour);
  else drawLine(context, curve.time, curve.values, toX, toY, colour, []);
  context.restore();
  return { toY };
}

function drawAxes(context, curve, range, { left, top, width, height }, { toX, toY, paint }) {
  if (data.window) {
    const [from, to] = data.window.map((t) => toX(clamp(t, 0, data.duration)));
    context.fillStyle = paint("shade");
    context.fillRect(from, top, to - from, height);
  }
  drawMarks(context, { left, top, width, height }, { toX, paint });
  context.lineWidth = 1;
  context.fillStyle = paint("muted");
  context.strokeStyle = paint("line");
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticksOf(range, Math.max(2, Math.floor(height / 26)))) {
    const y = Math.round(toY(tick)) + 0.5;
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(left + width, y);
    context.stroke();
    context.fillText(tickText(tick, curve.unit, range), left - 8, y);
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const tick of ticksOf({ low: span.from, high: span.to }, Math.max(2, Math.floor(width / 90)))) {
    context.fillText(`${parseFloat(tick.toPrecision(6))} s`, toX(tick), top + height + 6);
  }
  if (curve.bound !== null && curve.bound <= range.high && curve.bound >= range.low) {
    context.strokeStyle = paint("bound");
    context.lineWidth = 1.5;
    context.setLineDash([2, 3]);
    context.beginPath();
    context.moveTo(left, toY(curve.bound));
    context.lineTo(left + width, toY(curve.bound));
    context.stroke();
    context.setLineDash([]);
  }
}

/** Moments of the run, such as that at which a joint locks, with their names. */
function drawMarks(context, { left, top, width, height }, { toX, paint }) {
  context.lineWidth = 1.5;
  context.fillStyle = context.strokeStyle = paint("bound");
  context.textBaseline = "top";
  context.setLineDash([1, 3]);
  (data.marks || []).forEach(({ time, name }, k) => {
    const x = toX(clamp(time, 0, data.duration));
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x, top + height);
    context.stroke();
    // To the left where there is no room to the right.
    const fits = x + 6 + context.measureText(name).width < left + width;
    context.textAlign = fits ? "left" : "right";
    context.fillText(name, x + (fits ? 6 : -6), top + 2 + 15 * k);
  });
  context.setLineDash([]);
}

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
