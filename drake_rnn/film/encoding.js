// What a film asks of a playback's page, which has a player, `window.playback`, and Meshcat's `viewer`.
window.film = {
  setUp(theme, view) {
    window.playback.chrome(false);
    window.playback.setTheme(theme);
    if (view) window.playback.setView(view);
    window.playback.seek(0);
    // What the browser lays out anew is drawn in its next frames.
    this.settling = 3;
    const count = () => { if (--this.settling > 0) requestAnimationFrame(count); };
    requestAnimationFrame(count);
  },

  settled() {
    const canvas = viewer.renderer.domElement.getBoundingClientRect();
    return this.settling <= 0 && canvas.width === innerWidth && canvas.height === innerHeight;
  },

  picture(time) {
    window.playback.seek(time);
    viewer.render();
    return viewer.renderer.domElement.toDataURL("image/png");
  },

  labelled() {
    const places = [...document.querySelectorAll(".label")].map(each => each.getBoundingClientRect());
    const overlap = (a, b) => a !== b && a.left < b.right && b.left < a.right;
    return places.length > 0 && !places.some(a => places.some(b => overlap(a, b)));
  },

  hideScene(hidden) {
    const style = document.getElementById("without-scene") || document.createElement("style");
    style.id = "without-scene";
    style.textContent = "* { background: transparent !important } canvas { visibility: hidden }" +
      " .label { background: var(--veil) !important; visibility: visible !important }";
    if (hidden) document.head.append(style); else style.remove();
  },
};
