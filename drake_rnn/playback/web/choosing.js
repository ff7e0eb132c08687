// The row of quantities: each with its number at the time that is shown, drawn when it is pressed.

const choosing = {
  buttons: [],
  // Whether a press adds a quantity to the others, or takes it away.
  several: false,

  build() {
    const row = byId("curves");
    for (const curve of curves) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.curve = curve.key;
      const name = document.createElement("span");
      name.textContent = curve.name;
      const number = document.createElement("b");
      button.append(name, number);
      button.addEventListener("click", (event) => this.press(curve, event.shiftKey));
      row.append(button);
      this.buttons.push({ curve, button, number });
    }
    if (!curves.length) document.body.classList.add("uncharted");
    this.mark();
    listenToRow(row);
  },

  /** Draws a quantity, or, with others, adds it or takes it away. */
  press(curve, add = false) {
    const chosen = chart.chosen;
    if (!add && !this.several) return this.choose([curve]);
    if (!chosen.includes(curve)) return this.choose([...chosen, curve]);
    if (chosen.length > 1) this.choose(chosen.filter((one) => one !== curve));
  },

  /** Draws quantities together; of more than two units there is no axis. */
  choose(chosen) {
    const units = unitsOf(chosen);
    if (units.length > 2) {
      const [first, second, third] = units.map((unit) => (unit === "1" ? "ratios" : raised(unit)));
      notice(`Cannot add ${third}: both y axes are in use (${first}, ${second}).`);
      return;
    }
    chart.setChosen(chosen);
    this.mark();
  },

  setSeveral(on) {
    this.several = on;
    if (!on && chart.chosen.length > 1) this.choose(chart.chosen.slice(0, 1));
  },

  mark() {
    for (const { curve, button } of this.buttons) {
      button.setAttribute("aria-pressed", chart.chosen.includes(curve));
    }
    this.setStop();
  },

  /** The row is one stop of the tab key: the quantity that is drawn, or the first. */
  setStop() {
    const shown = this.buttons.filter(({ button }) => !button.hidden);
    const stop = shown.find(({ curve }) => chart.chosen.includes(curve)) ?? shown[0];
    for (const each of this.buttons) each.button.tabIndex = each === stop ? 0 : -1;
  },

  show(t) {
    for (const { curve, button, number } of this.buttons) {
      const over = isOver(curve, valueAt(curve, t));
      number.textContent = (over ? "✗ " : "") + this.numberOf(curve, t);
      button.classList.toggle("over", over);
    }
  },

  /** The number of the run and, behind a bar, of those beside it. */
  numberOf(curve, t) {
    const wanted = curve.desired ? ` of ${toldAt(curve, t, curve.desired)}` : "";
    const others = beside.map(({ curves: all }) => all.get(curve.key)).map((one) => (
      isDrawable(one) ? toldAt(one, t) : "–"));
    return [toldAt(curve, t) + wanted, ...others].join(" | ");
  },
};

/** Arrows, Home and End move along a row of buttons, which say whether there are more. */
function listenToRow(row) {
  row.addEventListener("keydown", (event) => {
    const buttons = [...row.querySelectorAll("button")].filter(({ hidden }) => !hidden);
    const at = buttons.indexOf(document.activeElement), last = buttons.length - 1;
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: last }[event.key];
    if (to === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    const next = buttons[clamp(to, 0, last)];
    for (const button of buttons) button.tabIndex = button === next ? 0 : -1;
    next.focus();
    next.scrollIntoView({ block: "nearest", inline: "nearest" });
  });
  const tell = () => {
    const { scrollLeft, clientWidth, scrollWidth } = row;
    row.classList.toggle("more-before", scrollLeft > 4);
    row.classList.toggle("more-behind", scrollLeft + clientWidth < scrollWidth - 4);
  };
  row.addEventListener("scroll", tell, { passive: true });
  new ResizeObserver(tell).observe(row);
  for (const button of row.children) new ResizeObserver(tell).observe(button);
}
