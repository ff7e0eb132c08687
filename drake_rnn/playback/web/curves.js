// The curves of the run and of runs beside it, and their numbers at a time.

// Number of colours of further lines.
const SERIES = 7;
// Time after its last sample for which a curve still has that value [s].
const STALE = 0.1;
// Share of a bound below which a number is noise.
const NOISE = 1e-6;

/** Times at the left and at the right end of the chart [s]. */
const span = { from: 0, to: data.duration || 1 };

function unpackedCurve(curve) {
  const numbers = { time: unpacked(curve.time), values: unpacked(curve.values) };
  if (curve.desired) numbers.desired = unpacked(curve.desired);
  // A long run: the least and the largest value of each interval.
  for (const name of ["begins", "low", "high"]) {
    numbers[name] = curve[name] ? unpacked(curve[name]) : null;
  }
  return { ...curve, ...numbers };
}

const curves = data.curves.map(unpackedCurve);

/** The runs beside this one: their names, and their curves by key. */
const beside = data.beside.map(({ name, curves: all }) => (
  { name, curves: new Map(all.map((curve) => [curve.key, unpackedCurve(curve)])) }));

/** The value of a curve at a time: that of the run's nearest sample; NaN after its end. */
function valueAt(curve, t, values = curve.values) {
  if (!(t <= curve.time[curve.time.length - 1] + STALE)) return NaN;
  return values[nearest(curve.time, t)];
}

/** Whether a value breaks the curve's bound; values come as single precision. */
function isOver({ bound, above }, value) {
  if (bound === null) return false;
  return above ? value < bound : value > bound * (1 + 1e-6);
}

/** The value of a curve at a time, as text; far below its bounds there is nothing but rounding. */
function toldAt(curve, t, values = curve.values) {
  const value = valueAt(curve, t, values);
  return told(Math.abs(value) < NOISE * leastBound(curve) ? 0 : value, curve.unit);
}

/** The least positive number that bounds a curve; 0 without one. */
function leastBound({ bound, accepted }) {
  const levels = [bound, ...accepted.map(({ level }) => level)].filter((level) => level > 0);
  return levels.length ? Math.min(...levels) : 0;
}

/** Whether a curve has samples to draw. */
const isDrawable = (curve) => curve !== undefined && curve.values.length > 0;

/**
 * The lines of some quantities: of each, one of each run. Each has the curve, its name, and the
 * number by which it is told apart.
 */
function linesOf(chosen) {
  const lines = [];
  for (const curve of chosen) {
    const ofRuns = [[data.name, curve], ...beside.map(({ name, curves: all }) => [name, all.get(curve.key)])];
    for (const [run, one] of ofRuns.filter(([, each]) => isDrawable(each))) {
      const name = ofRuns.length === 1 ? curve.name : chosen.length === 1 ? run : `${run}: ${curve.name}`;
      lines.push({ curve: one, name, run, number: lines.length });
    }
  }
  return lines;
}

/** The colour of a line: a force has its own, the first other one is ink, the rest differ. */
function colourOf({ curve, number }, paint) {
  if (curve.key === "force") return paint("force");
  // In steps of three, neighbours differ most.
  return number === 0 ? paint("curve") : paint(`series-${(3 * number) % SERIES}`);
}

/** The dashes of a line: those of one colour differ. */
const dashOf = ({ number }) => [[], [9, 2], [9, 2, 2, 2], [3, 2]][number % 4];
