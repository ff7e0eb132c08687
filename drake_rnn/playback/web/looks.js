// How the page looks: colours, view, sizes, and what is shown besides.

const THEMES = ["auto", "light", "dark"];
const darkSystem = window.matchMedia("(prefers-color-scheme: dark)");
// Where the browser keeps the choice of colours, for all pages of this kind.
const KEPT = "drake_rnn theme";
let theme = keptTheme();

/** The colours that were chosen before; as the system where none were, or nothing is kept. */
function keptTheme() {
  try {
    const kept = localStorage.getItem(KEPT);
    return THEMES.includes(kept) ? kept : "auto";
  } catch {
    return "auto";
  }
}

function setTheme(name) {
  if (!THEMES.includes(name)) throw new RangeError(`theme: may be ${THEMES.join(", ")}, not ${name}`);
  theme = name;
  paintTheme();
}

/** The next colours, which the browser keeps. */
function nextTheme() {
  setTheme(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]);
  try { localStorage.setItem(KEPT, theme); } catch { /* It keeps nothing of such a page. */ }
}

function paintTheme() {
  const shown = theme === "auto" ? (darkSystem.matches ? "dark" : "light") : theme;
  document.documentElement.dataset.theme = shown;
  const button = byId("theme");
  button.setAttribute("aria-label", `Colours: ${theme}${theme === "auto" ? ", as the system" : ""}`);
  button.title = button.getAttribute("aria-label");
  button.lastElementChild.textContent = theme;
  if (player.ready) {
    picture.paint(shown);
    chart.changed();
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
  effort.setFull(!visible);
  resize();
}

function resize() {
  picture.resize();
  chart.resize();
}

function listenToLooks() {
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => setView(button.dataset.view));
  }
  byId("capsules")?.addEventListener("click", toggleCapsules);
  byId("theme").addEventListener("click", nextTheme);
  byId("details").addEventListener("click", () => {
    const open = document.body.classList.toggle("detailed");
    byId("details").setAttribute("aria-expanded", open);
  });
  darkSystem.addEventListener("change", paintTheme);
  picture.listen();
  new ResizeObserver(resize).observe(byId("stage"));
  new ResizeObserver(resize).observe(byId("chart"));
}
