// The picture of the arm, as the page uses it; where the browser draws none, a sentence says so, and
// what the run has come to is in its place.

/** What is done with a picture that there is. */
const drawn = {
  load() {
    drawWith(viewer);
    return loadScene().then(prepareScene);
  },
  paint: paintStage,
  show: showTime,
  showCapsules,
  setView: (name) => camera.setView(name),
  resize() {
    viewer.set_3d_pane_size(pane.clientWidth, pane.clientHeight);
    camera.fit();
  },
  draw() { if (viewer.needs_render) viewer.render(); },
  listen() {
    viewer.controls.addEventListener("start", () => { camera.followed = false; });
  },
};

/** What is done with one that there is not. */
const undrawn = {
  async load() {
    document.body.classList.add("undrawn");
    byId("undrawn").hidden = false;
  },
  paint() {},
  show() {},
  showCapsules() {},
  setView() {},
  resize() {},
  draw() {},
  listen() {},
};

const picture = viewer === null ? undrawn : drawn;
