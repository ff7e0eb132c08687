// What the lines, levels and shades of the chart mean.

const legend = {
  tell() {
    byId("chart-legend").replaceChildren(...this.entries().map(legendEntry));
  },

  /** Each entry has a text and, if it stands for something drawn, how that looks. */
  entries() {
    const lines = chart.lines(), paint = painter(), found = [];
    for (const line of lines) found.push({ text: line.name, line: colourOf(line, paint), dash: dashOf(line) });
    if (chart.chosen.some(({ desired }) => desired)) found.push({ text: "desired", line: paint("desired"), dash: DESIRED_DASH });
    found.push(...this.levels(paint));
    if (data.window) {
      const [from, to] = data.window.map((t) => timeText(clamp(t, 0, data.duration)));
      found.push({ text: `errors evaluated from ${from} to ${to} s`, look: "shade" });
    }
    if (player.loop) found.push({ text: `loop from ${player.loop.map(timeText).join(" to ")} s`, look: "loop" });
    return found;
  },

  /** Bounds of what may be, and of what is accepted: of which line, where there are several. */
  levels(paint) {
    const found = [], lines = chart.lines();
    const bounded = lines.filter(({ curve }) => curve.bound !== null || curve.bounds?.length).length;
    for (const { curve, name } of lines) {
      const of = lines.length > 1 ? ` (${name})` : "";
      const axis = chart.drawn?.axes.get(curve.unit);
      const beyond = (...all) => (axis && !all.some(axis.holds) ? ", off the axis" : "");
      const levels = curve.bound === null ? curve.bounds ?? [] : [curve.bound];
      if (levels.length) {
        const text = `bound${bounded > 1 && curve.bounds ? of : ""} ${together(levels, curve.unit)}`;
        found.push({ text: text + beyond(...levels), line: paint("bound"), dash: BOUND_DASH });
      }
      for (const { level, text, met, judged } of curve.accepted) {
        const mark = met ? "accepted" : judged ? "✗ accepted" : "accepted, not judged";
        found.push({ text: `${mark}${of}: ${text}${beyond(level)}`, line: paint("bound"), dash: ACCEPTED_DASH });
      }
    }
    return [...new Map(found.map((one) => [one.text, one])).values()];
  },
};

/** A time without digits that it does not need. */
const timeText = (t) => String(parseFloat(t.toFixed(3)));

/** A bound, with as few digits as it needs. */
function plain(value, unit) {
  const [factor, name] = unitFor(value, unit);
  return `${parseFloat((factor * value).toPrecision(4))} ${name}`.trim().replace("-", "−");
}

/** Bounds of one curve, in the unit that suits the largest. */
function together(levels, unit) {
  const [factor, name] = unitFor(Math.max(...levels.map(Math.abs)), unit);
  const numbers = levels.map((level) => String(parseFloat((factor * level).toPrecision(4))).replace("-", "−"));
  return numbers.map((number) => `${number} ${name}`.trim()).join(" and ");
}

function legendEntry({ text, line, dash, look }) {
  const entry = document.createElement("li"), mark = document.createElement("i");
  if (look) mark.className = look;
  entry.append(line ? sampleOf(line, dash) : mark, text);
  return entry;
}

/** A piece of a line as the chart draws it, with its dashes. */
function sampleOf(colour, dash) {
  const mark = document.createElement("i");
  let at = 0;
  const parts = (dash.length ? dash : [9]).map((length, k) => {
    const from = at;
    at += length;
    return `${k % 2 ? "transparent" : colour} ${from}px ${at}px`;
  });
  mark.style.background = `repeating-linear-gradient(to right, ${parts.join(", ")})`;
  return mark;
}
