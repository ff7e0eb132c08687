// The address of what is shown: #t=12.3&view=close&curve=position_error leads others to it.

const numbersIn = (text) => text.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));

/** What each key of the address does; all refuse what they cannot do. */
const READERS = {
  t(text) {
    const [t, ...more] = numbersIn(text);
    if (more.length || !(t >= 0 && t <= data.duration)) {
      throw new RangeError(`t: must be a time from 0 to ${data.duration} s, not ${text}`);
    }
    player.seek(t);
  },
  view: (text) => setView(text),
  theme: (text) => setTheme(text),
  speed: (text) => player.setSpeed(Number(text)),
  loop: (text) => player.setLoop(rangeIn("loop", text)),
  zoom: (text) => zoom.to(...rangeIn("zoom", text)),
  curve(text) {
    const chosen = text.split(",").map((key) => {
      const found = curves.find((curve) => curve.key === key);
      const joint = joints.all.findIndex(({ name }) => name === key);
      if (!found && joint < 0) {
        throw new RangeError(`curve: may be ${curves.map((one) => one.key).join(", ")} or a joint, not ${key}`);
      }
      return found ?? joints.curveOf(joint);
    });
    choosing.choose(chosen);
  },
  trace(text) {
    if (!["coloured", "plain"].includes(text)) throw new RangeError(`trace: may be coloured, plain, not ${text}`);
    trace.set(text === "coloured");
  },
  scale(text) {
    if (!["log", "linear"].includes(text)) throw new RangeError(`scale: may be log, linear, not ${text}`);
    chart.setScale(text);
  },
  y(text) {
    const ends = numbersIn(text), units = unitsOf(chart.chosen);
    if (ends.length > 2 * units.length || ends.length % 2 || !ends.every((end, k) => k % 2 === 0 || ends[k - 1] < end)) {
      throw new RangeError(`y: must be two numbers for each axis, such as y=1e-9,1e-6, not ${text}`);
    }
    for (let k = 0; k < ends.length; k += 2) {
      if (!reach.to(units[k / 2], ends[k], ends[k + 1])) throw new RangeError(`y: no axis from ${ends[k]} to ${ends[k + 1]}`);
    }
  },
};

function rangeIn(name, text) {
  const range = numbersIn(text);
  if (range.length !== 2 || !(range[0] < range[1])) {
    throw new RangeError(`${name}: must be two times, such as ${name}=1,2.5, not ${text}`);
  }
  return range;
}

/** Shows what the address asks for; of what it asks wrongly, says why. */
function readAddress() {
  const wrong = [];
  // The axes are those of the curves, which may be named behind them.
  const late = ([key]) => ["scale", "y"].indexOf(key);
  const asked = [...new URLSearchParams(location.hash.slice(1))].sort((one, other) => late(one) - late(other));
  for (const [key, text] of asked) {
    try {
      if (!Object.hasOwn(READERS, key)) throw new RangeError(`${key}: may be ${Object.keys(READERS).join(", ")}`);
      READERS[key](text);
    } catch (error) {
      wrong.push(error.message);
    }
  }
  if (wrong.length) notice(`In the address, ${wrong.join("; ")}`);
}

/** Whether the address asks for a time, at which the page then stands. */
const asksForTime = () => new URLSearchParams(location.hash.slice(1)).has("t");

/** The address of what is shown. */
function linkToHere() {
  const asked = [["t", timeText(player.time)], ["view", camera.view]];
  const keys = chart.chosen.map(({ key }) => key).join(",");
  if (keys && keys !== curves[0].key) asked.push(["curve", keys]);
  if (player.speed !== 1) asked.push(["speed", player.speed]);
  if (player.loop !== null) asked.push(["loop", player.loop.map(timeText).join(",")]);
  if (!zoom.whole) asked.push(["zoom", [span.from, span.to].map(timeText).join(",")]);
  if (trace.coloured) asked.push(["trace", "coloured"]);
  if (chart.scale !== null) asked.push(["scale", chart.scale]);
  if (!reach.whole) asked.push(["y", reach.ends().map((end) => +end.toPrecision(5)).join(",")]);
  if (theme !== "auto") asked.push(["theme", theme]);
  return `${location.href.split("#")[0]}#${asked.map((pair) => pair.join("=")).join("&")}`;
}

async function copyLink() {
  const link = linkToHere();
  // The address of a page in a frame of a notebook is no file.
  if (location.protocol !== "about:") history.replaceState(null, "", link);
  try {
    await navigator.clipboard.writeText(link);
    notice(`Copied: ${link}`);
  } catch {
    notice(`The address bar has the link: ${link}`);
  }
}

function listenToAddress() {
  window.addEventListener("hashchange", readAddress);
  byId("copy-link").addEventListener("click", copyLink);
}
