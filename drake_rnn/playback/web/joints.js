// The joints: where each is between its limits, and how fast; a press draws one in the chart.

const joints = (() => {
  const { names, units, time, position, velocity, lower, upper, speeds, speedsBack } = data.joints;
  const [low, high, fastest, fastestBack] = [lower, upper, speeds, speedsBack].map(unpacked);
  const n = names.length;
  const column = (all, k) => unpacked(all).filter((_, i) => i % n === k);
  const moving = velocity !== "";
  return {
    time: unpacked(time),
    rows: [],
    all: names.map((name, k) => ({
      name,
      unit: units[k],
      lower: low[k],
      upper: high[k],
      fastest: fastest[k],
      fastestBack: fastestBack[k],
      q: column(position, k),
      v: moving ? column(velocity, k) : null,
    })),

    build() {
      const list = byId("joints");
      this.rows = this.all.map((joint, k) => jointRow(joint, () => choosing.press(this.curveOf(k), true)));
      list.append(...this.rows.map(({ item }) => item));
      chart.canvas.addEventListener("chosen", () => this.mark());
    },

    /** The position of a joint as a curve of the chart, with its limits as bounds. */
    curveOf(k) {
      const { name, unit, lower: least, upper: most, q } = this.all[k];
      this.curves ??= new Map();
      if (!this.curves.has(k)) {
        this.curves.set(k, {
          key: name, name: `position of ${name}`, unit, time: this.time, values: q, scale: "linear", bound: null, above: false,
          bounds: [least, most].filter(isFinite), accepted: [], begins: null, low: null, high: null,
        });
      }
      return this.curves.get(k);
    },

    show(t) {
      // Nobody sees them in a sheet that is closed.
      if (!this.rows.length || this.rows[0].item.offsetParent === null) return;
      const at = nearest(this.time, t);
      this.all.forEach((joint, k) => fillRow(this.rows[k], joint, at));
    },

    mark() {
      this.rows.forEach(({ button }, k) => {
        const drawn = chart.chosen.includes(this.curves?.get(k));
        button.setAttribute("aria-pressed", drawn);
        if (drawn) button.scrollIntoView({ block: "nearest" });
      });
    },
  };
})();

function jointRow({ name, unit, lower, upper, fastest, fastestBack }, press) {
  const item = document.createElement("li"), button = document.createElement("button");
  const parts = ["span", "b", "i", "small"].map((tag) => document.createElement(tag));
  const [label, value, gauge, speed] = parts;
  const mark = document.createElement("u");
  gauge.append(mark);
  button.type = "button";
  button.setAttribute("aria-pressed", false);
  label.textContent = name;
  const ends = isFinite(lower) && isFinite(upper) ? `limits ${plain(lower, unit)} to ${plain(upper, unit)}` : "no limits";
  const back = fastestBack === fastest ? "" : ` upwards and ${plain(fastestBack, `${unit}/s`)} downwards`;
  const most = isFinite(fastest) ? `, at most ${plain(fastest, `${unit}/s`)}${back}` : "";
  button.title = `${name}: ${ends}${most}. Press to draw it in the chart.`;
  button.append(...parts);
  button.addEventListener("click", press);
  item.append(button);
  return { item, button, value, gauge, mark, speed };
}

/** Fills a row with the sample `at`; a joint beyond a limit says so by its colour and by a sign. */
function fillRow({ button, value, gauge, mark, speed }, { unit, lower, upper, fastest, fastestBack, q, v }, at) {
  const tooFast = v !== null && Math.abs(v[at]) > (v[at] < 0 ? fastestBack : fastest) * (1 + 1e-6);
  const over = q[at] < lower || q[at] > upper || tooFast;
  value.textContent = `${over ? "✗ " : ""}${fixed(q[at], unit)}`;
  button.classList.toggle("over", over);
  gauge.hidden = !(isFinite(lower) && isFinite(upper));
  mark.style.left = `${100 * clamp((q[at] - lower) / (upper - lower), 0, 1)}%`;
  speed.textContent = v === null ? "" : fixed(v[at], `${unit}/s`);
}

/** A number with as many decimals in each row, so that it stands still while it changes. */
function fixed(value, unit) {
  if (!isFinite(value)) return "–";
  // Without a sign before zeros alone.
  return `${value.toFixed(3).replace(/^-(?=[0.]*$)/, "").replace("-", "−")} ${unit}`;
}
