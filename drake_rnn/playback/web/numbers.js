// Numbers: how they are held in the page, and how they are told.

const data = JSON.parse(document.getElementById("playback-data").textContent);
const byId = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

function bytesOf(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

/** Numbers that Python packed as 32-bit floats. */
function unpacked(text) {
  return new Float32Array(bytesOf(text).buffer);
}

/** A unit with its powers as superscripts, such as rad/s². */
const raised = (unit) => unit.replace(/\^([0-9])/g, (_, power) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[power]);

/** The factor and the name of a unit in which a number has few digits, by the tables of Python. */
function unitFor(value, unit) {
  if (unit === "1") return [1, ""];
  const { prefixes, prefixed, least } = data.units;
  if (!prefixed.includes(unit) || !(Math.abs(value) > 0) || !isFinite(value)) return [1, raised(unit)];
  const suits = ([, factor]) => Math.abs(value) * factor >= least;
  const [prefix, factor] = prefixes.find(suits) || prefixes.at(-1);
  return [factor, prefix + raised(unit)];
}

/** A number with four digits and its unit, e.g. "0.1234 mm". */
function told(value, unit) {
  if (!isFinite(value)) return "–";
  // Rounded before the unit is chosen, as in Python.
  const [factor, name] = unitFor(+value.toPrecision(4), unit);
  const number = value === 0 ? "0" : digitsOf(factor * value);
  return (number + " " + name).trim().replace(/-/g, "−");
}

/** Four digits; of a number so small that zeros would hide them, with a power of ten, as in Python. */
function digitsOf(number) {
  return Math.abs(number) < 1e-4 ? number.toExponential(3).replace(/e-(\d)$/, "e-0$1") : number.toPrecision(4);
}

/** The index of the last entry that is at most x; -1 if there is none. */
function lastUpTo(sorted, x) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= x) low = middle + 1; else high = middle;
  }
  return low - 1;
}

/** The index of the entry nearest to x. */
function nearest(sorted, x) {
  const before = clamp(lastUpTo(sorted, x), 0, sorted.length - 1);
  const after = Math.min(before + 1, sorted.length - 1);
  return x - sorted[before] <= sorted[after] - x ? before : after;
}
