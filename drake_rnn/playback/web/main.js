// What the user does, and what scripts outside of the page may ask for.

const seekBy = (step) => player.seek(player.time + step);
const stepOf = ({ shiftKey }) => (shiftKey ? 1 : 1 / data.rate);

const KEYS = [
  ["space", "play or pause", { " ": () => player.toggle() }],
  ["← →", "a frame back or on; with shift, a second", {
    ArrowLeft: (event) => seekBy(-stepOf(event)), ArrowRight: (event) => seekBy(stepOf(event)) }],
  [", .", "a sample of the run back or on", { ",": () => player.step(-1), ".": () => player.step(1) }],
  ["Home End", "to the beginning or the end", {
    Home: () => player.seek(0), End: () => player.seek(data.duration) }],
  ["[ ]", "begin or end a loop here", { "[": loopFromHere, "]": loopToHere }],
  ["L", "loop again, or what the chart shows, or end the loop", { l: toggleLoop }],
  ["+ −", "show less or more time in the chart", {
    "+": () => zoom.by(1 / STEP), "=": () => zoom.by(1 / STEP), "-": () => zoom.by(STEP), "−": () => zoom.by(STEP) }],
  ["V", "show less of the y axis; with shift, more", { v: zoomValues }],
  ["0", "show the whole run and axis in the chart", { 0: showAll }],
  ["B", "chart in half of the page, or small", { b: toggleLargeChart }],
  ["Y", "logarithmic or linear axis", { y: () => chart.turnScale() }],
  ["O", "several curves at once, or one", { o: () => setSeveral(!choosing.several) }],
  ["1 2 3", "view of the arm, of tool and path, of the path", {
    1: () => setView("arm"), 2: () => setView("close"), 3: () => setView("path") }],
  ...(data.capsules.length ? [["C", "capsules round the arm", { c: toggleCapsules }]] : []),
  ["P", "traced path in the colours of the first curve, or in one", { p: () => trace.set(!trace.coloured) }],
  ["T", "light, dark or as the system", { t: nextTheme }],
  ["F", "full screen", { f: toggleFullScreen }],
  ["K", "copy a link to what is shown", { k: copyLink }],
];

function setSeveral(on) {
  choosing.setSeveral(on);
  byId("several").checked = on;
}

function listen() {
  byId("play").addEventListener("click", () => player.toggle());
  byId("step-back").addEventListener("click", () => player.step(-1));
  byId("step-on").addEventListener("click", () => player.step(1));
  byId("scrubber").addEventListener("input", (event) => player.seek(event.target.valueAsNumber));
  byId("speed").addEventListener("change", (event) => player.setSpeed(+event.target.value));
  byId("several").addEventListener("change", (event) => setSeveral(event.target.checked));
  byId("large-chart").addEventListener("click", toggleLargeChart);
  byId("turn-scale").addEventListener("click", () => chart.turnScale());
  chart.canvas.addEventListener("dblclick", toggleLargeChart);
  byId("full-screen").addEventListener("click", toggleFullScreen);
  listenToLooks();
  // A sheet that was closed shows the joints as they were.
  byId("details").addEventListener("click", () => joints.show(player.time));
  listenToMenus();
  listenToKeys(KEYS);
  listenToChart((t) => player.seek(t));
  listenToLoop();
  listenToSaving();
  listenToAddress();
  zoom.listen();
  reach.listen();
  trace.listen();
  byId("values-in").addEventListener("click", () => reach.allBy(1 / STEP));
  byId("values-out").addEventListener("click", () => reach.allBy(STEP));
}

function tick(now) {
  if (viewer?.needs_render) effort.note(now); else effort.before = null;
  player.advance(now);
  picture.draw();
  requestAnimationFrame(tick);
}

window.playback = {
  get ready() { return player.ready; },
  get duration() { return data.duration; },
  get time() { return player.time; },
  get playing() { return player.playing; },
  get link() { return linkToHere(); },
  get csv() { return csv(); },
  seek: (t) => player.seek(t),
  play: () => player.play(),
  pause: () => player.pause(),
  setSpeed: (x) => player.setSpeed(x),
  setLoop: (loop) => player.setLoop(loop),
  zoom: (from, to) => zoom.to(from, to),
  setView,
  setTheme,
  setCapsules,
  chrome: setChrome,
};

paintTheme();
choosing.build();
joints.build();
zoom.reset();
// The browser shows first what there is, as the scene takes its time.
setTimeout(() => picture.load().then(() => {
  if (viewer !== null) buildParts();
  listen();
  player.ready = true;
  paintTheme();
  resize();
  setView(data.view);
  player.show(0);
  readAddress();
  byId("loading").hidden = true;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (!calm && !asksForTime()) player.play();
  requestAnimationFrame(tick);
}), 30);
