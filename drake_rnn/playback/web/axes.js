// Axes: ranges that suit the curves, ticks, and where a value is.

// How far above the largest value an accepted bound may be to be drawn, as a factor: on a
// logarithmic and on a linear axis.
const FAR_LOG = 3e4, FAR = 4;

/** The part of an array of samples that is in the chart, with one more on either side. */
function inSpan(time, values) {
  if (span.from <= 0 && span.to >= data.duration) return values;
  const from = Math.max(0, lastUpTo(time, span.from));
  return values.slice(from, lastUpTo(time, span.to) + 2);
}

/** The least, the largest and the least positive of all values of some curves in the chart. */
function extremesOf(all) {
  const found = { low: Infinity, high: -Infinity, least: Infinity };
  const note = (value) => {
    if (!isFinite(value)) return;
    found.low = Math.min(found.low, value);
    found.high = Math.max(found.high, value);
    if (value > 0) found.least = Math.min(found.least, value);
  };
  for (const curve of all) {
    if (curve.low) {
      inSpan(curve.begins, curve.low).forEach(note);
      inSpan(curve.begins, curve.high).forEach(note);
    } else inSpan(curve.time, curve.values).forEach(note);
    if (curve.desired) inSpan(curve.time, curve.desired).forEach(note);
  }
  return found;
}

/** The levels of bounds of some curves: of what may be, and of what is accepted. */
function levelsOf(all) {
  const bounds = all.flatMap(({ bound, bounds = [] }) => (bound === null ? bounds : [bound, ...bounds]));
  return { bounds, accepted: all.flatMap(({ accepted }) => accepted.map(({ level }) => level)) };
}

/** The range of an axis of some curves. */
function rangeOf(all) {
  let { low, high, least } = extremesOf(all);
  const { bounds, accepted } = levelsOf(all);
  const log = chart.scale === null ? all.some(({ scale }) => scale === "log") : chart.scale === "log";
  if (log && least < Infinity) {
    const bottom = Math.max(least, high * 1e-8, Math.min(high, NOISE * Math.min(...all.map(leastBound))));
    const reached = accepted.filter((x) => x > 0 && x < FAR_LOG * high);
    const top = Math.ceil(Math.log10(Math.max(high, ...reached)) + 0.05);
    const least10 = Math.floor(Math.log10(Math.min(bottom, ...reached)));
    return { log: true, low: 10 ** Math.min(least10, top - 1), high: 10 ** top };
  }
  if (!(low <= high)) [low, high] = [0, 1];
  // A bound that is far away would flatten the curve.
  const reach = high - low;
  for (const bound of [...bounds, ...accepted]) {
    if (bound < FAR * Math.max(high, 0) && bound > low - 3 * reach) {
      low = Math.min(low, bound);
      high = Math.max(high, bound);
    }
  }
  if (low > 0 && low < 0.5 * high) low = 0;
  const room = 0.06 * (high - low || Math.abs(high) || 1);
  return { log: false, low: low === 0 ? 0 : low - room, high: high + room };
}

/** The number of ticks that there is room for. */
const ticksIn = (height) => Math.max(2, Math.floor(height / TICK));

/** The step between ticks of a linear axis. */
function stepOf10({ low, high }, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((x) => x * power).find((x) => x >= raw);
}

/** A linear range that ends at a tick where that is near, so that the largest value has a label. */
function roundedUp(range, count) {
  if (range.log) return range;
  const step = stepOf10(range, count), next = step * Math.ceil(range.high / step - 1e-9);
  return next - range.high <= 0.5 * step ? { ...range, high: next } : range;
}

function ticksOf(range, count) {
  if (!range.log) return evenTicks(range, count);
  const [first, last] = decadesOf(range);
  if (last - first < 2) return fineTicks(range, count);
  const step = Math.ceil((last - first) / count);
  return Array.from({ length: Math.floor((last - first) / step) + 1 }, (_, k) => 10 ** (last - k * step));
}

/** The least and the largest power of ten in a range. */
const decadesOf = ({ low, high }) => [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];

/** Ticks of a logarithmic axis with few powers of ten: 1, 2 and 5, or even ones, as far as there is room. */
function fineTicks(range, count) {
  const [first, last] = decadesOf(range), { low, high } = range;
  const powers = Array.from({ length: last - first + 3 }, (_, k) => 10 ** (first - 1 + k));
  let ticks = powers.flatMap((power) => [1, 2, 5].map((digit) => digit * power));
  ticks = ticks.filter((tick) => tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9));
  if (ticks.length < 3) ticks = evenTicks(range, count);
  const ranks = (tick) => Math.log(tick / low) / Math.log(high / low);
  // Powers of ten come first, and then whatever is not too near to another.
  const isPower = (tick) => Math.abs(Math.log10(tick) - Math.round(Math.log10(tick))) < 1e-9;
  const taken = [];
  for (const tick of [...ticks.filter(isPower), ...ticks.filter((each) => !isPower(each))]) {
    if (taken.every((other) => Math.abs(ranks(other) - ranks(tick)) >= 0.6 / count)) taken.push(tick);
  }
  return taken;
}

function evenTicks({ low, high }, count) {
  const step = stepOf10({ low, high }, count);
  const ticks = [];
  for (let x = Math.ceil(low / step - 1e-9) * step; x <= high + 1e-9 * step; x += step) {
    ticks.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  }
  return ticks;
}

/** A tick's number, without the digits that it does not need; a linear axis has one unit. */
function tickText(value, unit, { log, low, high }) {
  const [factor, name] = unitFor(log ? value : Math.max(Math.abs(low), Math.abs(high)), unit);
  const number = factor * value;
  const text = log && number < 1e-3 ? number.toExponential(0) : parseFloat(number.toPrecision(6));
  return `${text} ${name}`.trim().replace(/-/g, "−");
}

/** The axes of some lines: one for each unit, the first at the left, the second at the right. */
function axesOf(lines, { top, height }) {
  return unitsOf(lines.map(({ curve }) => curve)).map((unit) => {
    const suits = roundedUp(rangeOf(lines.map(({ curve }) => curve).filter((curve) => curve.unit === unit)), ticksIn(height));
    const byHand = reach.chosen.has(unit), range = byHand ? reach.chosen.get(unit) : suits;
    const share = range.log ? (v) => Math.log10(v / range.low) / Math.log10(range.high / range.low)
      : (v) => (v - range.low) / (range.high - range.low);
    // What is outside of a range that suits lies at its end, and of one chosen by hand out of sight.
    const room = byHand ? 20 : 0.02, least = byHand ? -room : 0;
    const toY = (v) => top + height * (1 - clamp(v > 0 || !range.log ? share(v) : least, -room, 1 + room));
    return { unit, range, suits, byHand, toY, holds: (v) => v >= range.low && v <= range.high };
  });
}

const unitsOf = (all) => [...new Set(all.map(({ unit }) => unit))];
