// What the user does, and what scripts outside of the page may ask for.

const THEMES = ["auto", "light", "dark"];
const darkSystem = window.matchMedia("(prefers-color-scheme: dark)");
let theme = "auto";

function setTheme(name) {
  if (!THEMES.includes(name)) throw new RangeError(`theme: may be ${THEMES.join(", ")}, not ${name}`);
  theme = name;
  paintTheme();
}

function paintTheme() {
  const shown = theme === "auto" ? (darkSystem.matches ? "dark" : "light") : theme;
  document.documentElement.dataset.theme = shown;
  const button = byId("theme");
  button.setAttribute("aria-label", `Colours: ${theme === "auto" ? "as the system" : theme}`);
  button.title = button.getAttribute("aria-label");
  button.lastElementChild.textContent = theme;
  if (player.ready) {
    picture.paint(shown);
    chart.drawn = null;
    chart.draw();
  }
}

function setView(name) {
  picture.setView(name);
  for (const button of document.querySelectorAll("[data-view]")) {
    button.setAttribute("aria-pressed", button.dataset.view === name);
  }
}

function setCapsules(visible) {
  picture.showCapsules(visible);
  byId("capsules")?.setAttribute("aria-pressed", visible);
}

function toggleCapsules() {
  setCapsules(byId("capsules")?.getAttribute("aria-pressed") === "false");
}

function setChrome(visible) {
  document.body.classList.toggle("bare", !visible);
  resize();
}

function resize() {
  picture.resize();
  chart.resize();
}

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
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => setView(button.dataset.view));
  }
  byId("capsules")?.addEventListener("click", toggleCapsules);
  byId("theme").addEventListener("click", () => {
    setTheme(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]);
  });
  byId("details").addEventListener("click", () => {
    const open = document.body.classList.toggle("detailed");
    byId("details").setAttribute("aria-expanded", open);
  });
  darkSystem.addEventListener("change", paintTheme);
  document.addEventListener("keydown", pressed);
  // The browser would click a button on the space key that has just played or paused.
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && event.target.id === "play") event.preventDefault();
  });
  listenToChart();
  picture.listen();
  new ResizeObserver(resize).observe(byId("stage"));
  new ResizeObserver(resize).observe(byId("chart"));
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
