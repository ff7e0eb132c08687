// The controls, as the program offers them: they change with the law.

// Steps of a slider from its lower end to its upper one, on a logarithmic scale.
const STEPS = 1000;

const panel = {
  controls: {},
  made: "",
  held: null,
  told: -1,

  show({ version, controls, reply }) {
    this.controls = controls;
    const names = JSON.stringify(Object.entries(controls).map(([name, { kind, options }]) => [name, kind, options]));
    if (names !== this.made) this.make();
    this.made = names;
    for (const [name, control] of Object.entries(controls)) this.fill(name, control);
    const said = byId("said");
    said.textContent = reply.text;
    said.title = reply.text;
    said.classList.toggle("refused", reply.refused);
    if (reply.notice && version !== this.told) notice(reply.notice);
    this.told = version;
    for (const button of document.querySelectorAll("[data-press]")) {
      button.hidden = !(button.dataset.press in controls);
    }
    const paused = Boolean(controls.pause?.value);
    document.body.classList.toggle("playing", !paused);
    byId("play").setAttribute("aria-label", paused ? "Play" : "Pause");
    byId("record").setAttribute("aria-pressed", Boolean(controls.record?.value));
    byId("record").hidden = !("record" in controls);
    byId("play").hidden = !("pause" in controls);
  },

  make() {
    const [switches, sliders] = [byId("switches"), byId("sliders")];
    switches.replaceChildren();
    sliders.replaceChildren();
    for (const [name, control] of Object.entries(this.controls)) {
      if (["pause", "record"].includes(name)) continue;
      const row = this.row(name, control);
      if (row) (control.kind === "slider" ? sliders : switches).append(row);
    }
    byId("gains-name").hidden = !sliders.children.length;
  },

  row(name, control) {
    const make = { choice: choiceRow, switch: switchRow, slider: sliderRow, button: buttonRow }[control.kind];
    return make && !(control.kind === "button" && document.querySelector(`[data-press="${name}"]`))
      ? make(name, control) : null;
  },

  fill(name, { kind, value, low, high, unit }) {
    const input = document.querySelector(`[data-control="${CSS.escape(name)}"]`);
    if (!input || this.held === name) return;
    if (kind === "choice") input.value = value;
    if (kind === "switch") input.checked = value;
    if (kind === "slider") {
      input.value = STEPS * Math.log(value / low) / Math.log(high / low);
      input.previousElementSibling.textContent = sliderText(value, unit);
    }
  },

  press(name) { if (name in this.controls) wire.set(name, null); },
  toggle(name) { if (name in this.controls) wire.set(name, !this.controls[name].value); },
};

function sliderText(value, unit) {
  return `${+value.toPrecision(3)} ${raised(unit)}`.trim();
}

/** A row with a name, which tells what it means: under a mouse, and where a finger presses it. */
function labelled(kind, { label, meaning }) {
  const row = document.createElement("label");
  row.className = `row ${kind}`;
  const name = document.createElement("span");
  name.textContent = label;
  row.title = meaning;
  if (meaning) name.addEventListener("pointerup", ({ pointerType }) => { if (pointerType === "touch") notice(meaning); });
  row.append(name);
  return row;
}

function choiceRow(name, control) {
  const { options } = control;
  const row = labelled("choice", control), select = document.createElement("select");
  select.dataset.control = name;
  for (const option of options) select.add(new Option(option.replaceAll("_", " "), option));
  select.addEventListener("change", () => wire.set(name, select.value));
  row.append(select);
  return row;
}

function switchRow(name, control) {
  const row = labelled("switch", control), box = document.createElement("input");
  box.type = "checkbox";
  box.dataset.control = name;
  box.addEventListener("change", () => wire.set(name, box.checked));
  row.append(box);
  return row;
}

function sliderRow(name, control) {
  const { low, high, unit } = control;
  const row = labelled("slider", control), range = document.createElement("input");
  Object.assign(range, { type: "range", min: 0, max: STEPS, step: 1 });
  range.dataset.control = name;
  const shown = document.createElement("output");
  range.addEventListener("input", () => {
    const value = low * (high / low) ** (range.valueAsNumber / STEPS);
    panel.held = name;
    shown.textContent = sliderText(value, unit);
    wire.set(name, value);
  });
  range.addEventListener("change", () => { panel.held = null; });
  row.append(shown, range);
  return row;
}

function buttonRow(name, { label, meaning }) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = label;
  button.title = meaning;
  button.dataset.control = name;
  button.addEventListener("click", () => panel.press(name));
  return button;
}
