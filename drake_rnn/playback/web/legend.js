// What the lines, levels and shades of the chart mean.

const legend = {
  tell() {
    byId("chart-legend").replaceChildren(...this.entries().map(legendEntry));
  },

  /** Each entry has a text and, if it stands for something drawn, how that looks. */
  entries() {
    const lines = chart.lines(), paint = painter(), found = [];
    if (lines.length > 1) {
      for (const line of lines) found.push({ text: line.name, line: colourOf(line, paint), dashed: dashOf(line).length > 0 });
    }
    if (chart.chosen.some(({ desired }) => desired)) found.push({ text: "desired", line: paint("desired"), dashed: true });
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
    for (const { curve, name } of lines) {
      const of = lines.length > 1 ? ` (${name})` : "";
      const axis = chart.drawn?.axes.get(curve.unit);
      const beyond = (...all) => (axis && !all.some(axis.holds) ? ", off the axis" : "");
      const levels = curve.bound === null ? curve.bounds ?? [] : [curve.bound];
      if (levels.length) {
        const text = `bound ${levels.map((level) => plain(level, curve.unit)).join(" and ")}`;
        found.push({ text: text + beyond(...levels), line: paint("bound"), look: "dotted" });
      }
      for (const { level, text, met } of curve.accepted) {
        found.push({ text: `${met ? "accepted" : "✗ accepted"}${of}: ${text}${beyond(level)}`, line: paint("bound"), look: "accepted" });
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

function legendEntry({ text, line, dashed, look }) {
  const entry = document.createElement("li"), mark = document.createElement("i");
  mark.className = look ?? (dashed ? "dashed" : "solid");
  if (line) mark.style.setProperty("--of", line);
  entry.append(mark, text);
  return entry;
}
