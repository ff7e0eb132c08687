// What is shown of each sample, and what the user does.

// Samples of the chart a second, and the least way of the tool for a piece of its trace [m].
const DRAWN = 10, PIECE = 0.002;
// Pieces of the trace that are kept, and how far an arrow key moves the target [m].
const PIECES = 1500, NUDGE = 0.02;

/** What looks.js asks of whatever makes time pass. */
const player = { ready: false };

const trace = {
  mesh: null,
  ends: [],
  count: 0,
  last: null,
  width: 0,

  prepare() {
    for (const { path } of data.grows) objectAt(path).visible = false;
    // What is dragged is seen through the arm.
    const knob = objectAt("desired/point");
    if (knob.material) Object.assign(knob.material, { depthTest: false, transparent: true });
    knob.renderOrder = 4;
    const colour = getComputedStyle(document.documentElement).getPropertyValue("--traced").trim();
    const shape = new THREE.CylinderGeometry(1, 1, 1, 8, 1, true);
    this.mesh = new THREE.InstancedMesh(shape, new THREE.MeshBasicMaterial({ color: colour, toneMapped: false }), PIECES);
    this.mesh.count = 0;
    this.mesh.frustumCulled = false;
    this.mesh.layers.set(LAYERS.large);
    viewer.scene.add(this.mesh);
  },

  clear() {
    this.ends = [];
    this.count = 0;
    this.last = null;
    if (this.mesh) this.mesh.count = 0;
  },

  add(point) {
    if (!this.mesh) return;
    // The scene has the axes of the world frame W, z upwards.
    const at = new THREE.Vector3(...point);
    if (this.last === null) { this.last = at; return; }
    if (at.distanceTo(this.last) < PIECE) return;
    const k = this.count % PIECES;
    this.ends[k] = [this.last, at];
    this.last = at;
    this.count += 1;
    this.mesh.count = Math.min(this.count, PIECES);
    this.place(k);
    this.mesh.instanceMatrix.needsUpdate = true;
  },

  place(k) {
    const [from, to] = this.ends[k], along = to.clone().sub(from), length = along.length();
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
    const middle = from.clone().add(to).multiplyScalar(0.5);
    const radius = this.radius();
    this.mesh.setMatrixAt(k, new THREE.Matrix4().compose(middle, turn, new THREE.Vector3(radius, length, radius)));
  },

  radius() {
    return (widths.large || 1) * (data.scaled[0]?.unit ?? 0.002);
  },

  /** As thick as suits the view. */
  adjust() {
    if (!this.mesh || Math.abs(this.radius() - this.width) < 0.04 * this.width) return;
    this.width = this.radius();
    for (let k = 0; k < this.mesh.count; k++) this.place(k);
    this.mesh.instanceMatrix.needsUpdate = true;
  },
};

const live = {
  asking: false,
  time: 0,
  rate: 0,
  drawn: 0,
  desired: null,
  samples: 0,

  hear(sample) {
    if (sample === null) {
      byId("rate").textContent = "not connected";
      return;
    }
    const [version, time, rate, recorded] = sample;
    if (version !== panel.told) this.refresh();
    if (time < this.time) this.clear();
    const numbers = sample.slice(HEAD, -TAIL), [tool, desired] = [sample.slice(-TAIL, -3), sample.slice(-3)];
    if (time > this.time || this.samples === 0) this.keep(time, numbers);
    [this.time, this.rate, this.desired] = [time, rate, desired];
    this.samples += 1;
    trace.add(tool);
    byId("clock").textContent = `${time.toFixed(1)} s`;
    byId("rate").textContent = document.body.classList.contains("playing") ? `${rate.toFixed(2)}× real time` : "paused";
    const runs = byId("record").getAttribute("aria-pressed") === "true";
    byId("record").lastElementChild.textContent = runs ? `${recorded.toFixed(1)} s` : "Record";
    byId("save").textContent = runs || !(recorded > 0) ? "Save" : `Save ${recorded.toFixed(1)} s`;
    this.draw();
  },

  keep(time, numbers) {
    data.numbers.forEach((key, k) => {
      const curve = curves.find((one) => one.key === (key === "force_desired" ? "force" : key));
      if (!curve) return;
      const into = key === "force_desired" ? curve.desired : curve.values;
      into.push(numbers[k]);
      if (into === curve.values) curve.time.push(time);
    });
    for (const curve of curves) {
      while (curve.time.length && curve.time[0] < time - data.duration) {
        for (const part of [curve.time, curve.values, curve.desired]) part?.shift();
      }
    }
    span.to = Math.max(time, data.duration);
    span.from = span.to - data.duration;
  },

  clear() {
    trace.clear();
    for (const curve of curves) {
      for (const part of [curve.time, curve.values, curve.desired]) if (part) part.length = 0;
    }
  },

  draw() {
    const now = performance.now();
    if (now - this.drawn < 1000 / DRAWN) return;
    this.drawn = now;
    this.hideEmpty();
    this.tellAway();
    chart.drawn = null;
    chart.show(this.time);
  },

  /** What the law that runs does not have is not offered, nor drawn. */
  hideEmpty() {
    let changed = false;
    for (const { curve, button } of choosing.buttons) {
      const empty = !curve.values.some(isFinite);
      changed ||= button.hidden !== empty;
      button.hidden = empty;
    }
    if (!changed) return;
    const shown = choosing.buttons.filter(({ button }) => !button.hidden).map(({ curve }) => curve);
    const kept = chart.chosen.filter((curve) => shown.includes(curve));
    choosing.choose(kept.length ? kept : shown.slice(0, 1));
  },

  /** Says what may be dragged and cannot be seen. */
  tellAway() {
    const away = viewer === null ? [] : drag.handles().filter(([, { place }]) => {
      const { x, y, z } = placeOf(place).project(viewer.camera);
      return Math.max(Math.abs(x), Math.abs(y)) > 1 || z > 1;
    });
    byId("away").hidden = !away.length;
    const names = away.map(([, { label }]) => label).join(", ");
    byId("away").textContent = `out of view: ${names}. Turn the view, or press Arm or Reset.`;
  },

  /** Asks what the controls are: one question at a time, and again with the next sample if it fails. */
  async refresh() {
    if (this.asking) return;
    this.asking = true;
    try { panel.show(await wire.state()); } catch { /* The program has ended, or is busy. */ }
    this.asking = false;
  },

  nudge(by) {
    if (this.desired === null || !("target" in panel.controls)) return;
    wire.set("target", this.desired.map((x, k) => x + NUDGE * by[k]));
  },
};

function onKeys(held) {
  byId("panel").disabled = !held;
  byId("lent").hidden = held;
  for (const button of document.querySelectorAll("#actions button, #play")) button.disabled = !held;
}

/** Keys of a control that the page has. */
function keysOf(name, ...keys) {
  return data.offers.includes(name) ? keys : [];
}

const KEYS = [
  ...keysOf("pause", ["space", "pause or go on", { " ": () => panel.toggle("pause") }]),
  ...keysOf("target",
    ["← →", "target to the left or right", { ArrowLeft: () => live.nudge([0, 1, 0]), ArrowRight: () => live.nudge([0, -1, 0]) }],
    ["↑ ↓", "target away or nearer", { ArrowUp: () => live.nudge([1, 0, 0]), ArrowDown: () => live.nudge([-1, 0, 0]) }],
    ["Page↑ Page↓", "target up or down", { PageUp: () => live.nudge([0, 0, 1]), PageDown: () => live.nudge([0, 0, -1]) }]),
  ...keysOf("path", ["F", "follow the path", { f: () => panel.press("path") }]),
  ...keysOf("stop", ["S", "stop the target", { s: () => panel.press("stop") }]),
  ...keysOf("record", ["R", "record, or end the recording", { r: () => panel.toggle("record") }]),
  ["1 2 3", "view of the arm, of tool and path, of the path", {
    1: () => setView("arm"), 2: () => setView("close"), 3: () => setView("path") }],
  ...(data.capsules.length ? [["C", "capsules round the arm", { c: toggleCapsules }]] : []),
  ["B", "chart in half of the page, or small", { b: toggleLargeChart }],
  ["Y", "logarithmic or linear axis", { y: () => chart.turnScale() }],
  ["V", "show less of the y axis of the chart; with shift, more", { v: zoomValues }],
  ["0", "show the whole y axis", { 0: () => reach.reset() }],
  ["T", "light, dark or as the system", { t: nextTheme }],
];

function listen() {
  listenToLooks();
  byId("play").addEventListener("click", () => panel.toggle("pause"));
  byId("record").addEventListener("click", () => panel.toggle("record"));
  for (const button of document.querySelectorAll("[data-press]")) {
    button.addEventListener("click", () => panel.press(button.dataset.press));
  }
  byId("ask").addEventListener("click", () => wire.ask());
  chart.canvas.addEventListener("dblclick", toggleLargeChart);
  listenToKeys(KEYS);
  listenToChart(null);
  reach.listen();
  if (viewer !== null) drag.listen();
}

function frame(now) {
  effort.note(now);
  trace.adjust();
  picture.draw();
  requestAnimationFrame(frame);
}

window.live = {
  get ready() { return player.ready && live.samples > 0 && panel.told >= 0; },
  get time() { return live.time; },
  get rate() { return live.rate; },
  get controls() { return panel.controls; },
  get held() { return Boolean(wire.key); },
  set: (name, value) => wire.set(name, value),
  desired: () => live.desired,
  setView,
  setTheme,
};

for (const curve of curves) {
  [curve.time, curve.values] = [[], []];
  if (curve.key === "force") curve.desired = [];
}
paintTheme();
choosing.build();
onKeys(false);
byId("lent").hidden = true;
picture.load().then(() => {
  if (viewer !== null) trace.prepare();
  listen();
  player.ready = true;
  byId("loading").hidden = true;
  paintTheme();
  resize();
  setView(data.view);
  chart.changed();
  wire.onSample = (sample) => live.hear(sample);
  wire.onKey = onKeys;
  wire.begin();
  requestAnimationFrame(frame);
});
