// What the user does, and what scripts outside of the page may ask for.

function pressed(event) {
  const { target, key, shiftKey } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || target.tagName === "SELECT") return;
  const step = shiftKey ? 1 : 1 / data.rate;
  // A control that was reached by the keyboard does its own on space.
  const own = target.tagName === "BUTTON" && target.id !== "play" && target.matches(":focus-visible");
  const actions = {
    " ": own ? null : () => player.toggle(),
    ArrowLeft: () => player.seek(player.time - step),
    ArrowRight: () => player.seek(player.time + step),
    Home: () => player.seek(0),
    End: () => player.seek(data.duration),
    1: () => setView("arm"),
    2: () => setView("close"),
    3: () => setView("path"),
    c: toggleCapsules,
  };
  if (!actions[key]) return;
  event.preventDefault();
  actions[key]();
}

function listen() {
  byId("play").addEventListener("click", () => player.toggle());
  byId("scrubber").max = data.duration;
  byId("scrubber").addEventListener("input", (event) => player.seek(event.target.valueAsNumber));
  byId("speed").addEventListener("change", (event) => player.setSpeed(+event.target.value));
  listenToLooks();
  document.addEventListener("keydown", pressed);
  // The browser would click a button on the space key that has just played or paused.
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && event.target.id === "play") event.preventDefault();
  });
  listenToChart();
}

function listenToChart() {
  const { canvas } = chart;
  let held = false;
  const seek = (event) => player.seek(chart.timeAt(event.offsetX));
  canvas.addEventListener("pointerdown", (event) => {
    held = true;
    canvas.setPointerCapture(event.pointerId);
    seek(event);
  });
  canvas.addEventListener("pointermove", (event) => { if (held) seek(event); });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, () => { held = false; });
  }
}

function tick(now) {
  player.advance(now);
  picture.draw();
  requestAnimationFrame(tick);
}

window.playback = {
  get ready() { return player.ready; },
  get duration() { return data.duration; },
  get time() { return player.time; },
  get playing() { return player.playing; },
  seek: (t) => player.seek(t),
  play: () => player.play(),
  pause: () => player.pause(),
  setSpeed: (x) => player.setSpeed(x),
  setView,
  setTheme,
  setCapsules,
  chrome: setChrome,
};

paintTheme();
chart.build();
picture.load().then(() => {
  listen();
  player.ready = true;
  paintTheme();
  resize();
  setView(data.view);
  player.show(0);
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
  requestAnimationFrame(tick);
});
