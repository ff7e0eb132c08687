// The camera: fitted to the window's shape until the user turns it.

const FIELD_OF_VIEW = (30 * Math.PI) / 180;
const MARGIN = 1.06;
// Radius of the traced path in the picture [pixels], and its largest share of the path's extent.
const THICK = 2.4, THIN = 1.2, SHARE = 0.01;

// Least width of a label, and its distance below its drawing [pixels].
const NARROWEST = 52, BELOW = 8;
// Of the enlarged path: its least size, its distance from the edges, and the height of its name.
const LEAST_INSET = 104, EDGE = 12, NAME = 22;
// Longest bar that tells a length in the picture [pixels].
const LONGEST_BAR = 120;

const toThree = ([x, y, z]) => new THREE.Vector3(x, z, -y);

/** Points of the arm and the path, which the enlarged path must not cover. */
const occupied = [];
unpacked(data.occupied).forEach((x, k, all) => {
  if (k % 3 === 0) occupied.push(toThree([x, all[k + 1], all[k + 2]]));
});

const camera = {
  view: data.view,
  followed: true,
  inset: null,
  corner: { size: LEAST_INSET, x: EDGE, y: EDGE },

  setView(name) {
    if (!(name in data.views)) throw new RangeError(`view: may be arm, close or path, not ${name}`);
    this.view = name;
    this.followed = true;
    this.fit();
  },

  /** Places the camera as near as it can be with all of the view's points in the frame. */
  fit() {
    const [width, height] = [pane.clientWidth, pane.clientHeight];
    if (!this.followed || width === 0 || height === 0) return;
    viewer.camera.fov = (FIELD_OF_VIEW * 180) / Math.PI;
    viewer.camera.zoom = 1;
    const pads = this.pads(height);
    this.stand(width, height, pads);
    if (this.hasInset(width, height) && !this.findCorner(width, height, pads)) {
      // There is no free corner: the arm makes room for one.
      pads.bottom = this.corner.size + 2 * EDGE;
      this.stand(width, height, pads);
    }
    const alone = this.view === "path" && !data.rests;
    for (const layer of [LAYERS.arm, LAYERS.stage]) {
      if (alone) viewer.camera.layers.disable(layer); else viewer.camera.layers.enable(layer);
    }
    this.placeInset(width, height);
    this.adjustLines();
    viewer.set_dirty();
  },

  /** Room that the legend needs above, and labels need below [pixels]. */
  pads(height) {
    const legend = byId("legend");
    const top = legend.offsetHeight ? legend.offsetTop + legend.offsetHeight + 4 : 0;
    const labels = [...document.querySelectorAll(".label")].map((label) => label.offsetHeight);
    const bottom = Math.max(0, ...labels.map((size) => size + 2 * BELOW));
    return { top: Math.min(top, 0.25 * height), bottom: Math.min(bottom, 0.3 * height) };
  },

  /** Places the camera for this view, with room for what lies over the picture. */
  stand(width, height, pads) {
    const { position, target } = placed(data.views[this.view], width, height, pads);
    viewer.camera.position.copy(position);
    viewer.controls.target.copy(target);
    viewer.controls.update();
    viewer.camera.updateMatrixWorld();
    viewer.camera.updateProjectionMatrix();
  },

  /** Whether the path is enlarged in a corner: not in a picture too small for it. */
  hasInset(width, height) {
    return data.inset && this.view === "arm" && width >= 300 && height >= 240;
  },

  /** Finds the largest free square in a corner; otherwise takes a small one, and returns false. */
  findCorner(width, height, { top }) {
    const seen = occupied.map((point) => {
      const { x, y } = point.clone().project(viewer.camera);
      return [(0.5 + x / 2) * width, (0.5 + y / 2) * height];
    });
    // The image of a camera takes the upper corner at the right.
    const free = ([x, y]) => !(data.image && x > EDGE && y > EDGE);
    for (const share of [0.42, 0.36, 0.3]) {
      const size = Math.round(clamp(share * Math.min(width, height), LEAST_INSET, 280));
      const far = [width - size - EDGE, height - size - top - NAME];
      for (const [x, y] of [[far[0], EDGE], [EDGE, EDGE], [far[0], far[1]], [EDGE, far[1]]].filter(free)) {
        this.corner = { size, x, y };
        const within = ([px, py]) => px > x - EDGE && px < x + size + EDGE
          && py > y - EDGE && py < y + size + NAME + EDGE;
        if (!seen.some(within)) return true;
      }
    }
    this.corner = { size: this.corner.size, x: width - this.corner.size - EDGE, y: EDGE };
    return false;
  },

  /** The path alone, enlarged in a corner of a picture of the whole arm. */
  placeInset(width, height) {
    const name = byId("inset-name");
    const shown = this.hasInset(width, height);
    name.hidden = byId("inset-scale").hidden = !shown;
    if (!shown) { this.inset = null; return; }
    const { size, x, y } = this.corner;
    const { position, target } = placed(data.views.path, size, size, { top: 0, bottom: 0 });
    const eye = new THREE.PerspectiveCamera((FIELD_OF_VIEW * 180) / Math.PI, 1, 0.01, 100);
    eye.position.copy(position);
    eye.lookAt(target);
    eye.layers.enable(LAYERS.inset);
    eye.updateMatrixWorld();
    this.inset = { eye, size, x, y };
    const bar = byId("inset-scale");
    showLength(bar, pixelAt(position.distanceTo(target), size), 0.4 * size);
    Object.assign(bar.style, { left: `${x + 4}px`, bottom: `${y + 4}px` });
    name.style.left = `${x - 1}px`;
    name.style.bottom = `${y + size + 2}px`;
    widen("inset", position.distanceTo(target), size);
  },

  adjustLines() {
    const distance = viewer.camera.position.distanceTo(viewer.controls.target);
    widen("large", distance / viewer.camera.zoom, pane.clientHeight);
    const bar = byId("scale");
    bar.classList.toggle("right", this.inset !== null && this.inset.y <= EDGE && this.inset.x <= EDGE);
    showLength(bar, pixelAt(distance / viewer.camera.zoom, pane.clientHeight), LONGEST_BAR);
  },
};

/** Where a camera must be for all points of a view to be within a frame, less its pads. */
function placed(view, width, height, { top, bottom }) {
  const direction = toThree(view.direction);
  const right = new THREE.Vector3(0, 1, 0).cross(direction).normalize();
  const up = direction.clone().cross(right);
  const slope = Math.tan(FIELD_OF_VIEW / 2);
  const across = (slope * width) / height / MARGIN;
  const above = (slope * (1 - (2 * top) / height)) / MARGIN;
  const below = (slope * (1 - (2 * bottom) / height)) / MARGIN;
  const points = view.points.map(toThree);
  const most = (of) => points.reduce((found, point) => Math.max(found, of(point)), -Infinity);
  // Each edge of the frame touches the outermost point, from a distance d along the direction.
  const edge = (axis, sign, s) => most((p) => sign * p.dot(axis) + s * p.dot(direction));
  const [r, l] = [edge(right, 1, across), edge(right, -1, across)];
  const [u, b] = [edge(up, 1, above), edge(up, -1, below)];
  const d = Math.max((r + l) / (2 * across), (u + b) / (above + below));
  const position = new THREE.Vector3()
    .addScaledVector(right, (r - l) / 2)
    .addScaledVector(up, (u - above * d + below * d - b) / 2)
    .addScaledVector(direction, d);
  const depth = d - toThree(view.target).dot(direction);
  return { position, target: position.clone().addScaledVector(direction, -depth) };
}

const widths = { large: 0, inset: 0 };

/** The size of a pixel at a distance [m], in a picture so high [pixels]. */
const pixelAt = (distance, height) => (2 * Math.tan(FIELD_OF_VIEW / 2) * distance) / height;

/** Shows a round length as a bar, which is no longer than so many pixels. */
function showLength(bar, pixel, longest) {
  if (bar.pixel === pixel) return;
  bar.pixel = pixel;
  const most = longest * pixel, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((x) => x * power).find((x) => x <= most);
  bar.firstElementChild.style.width = `${length / pixel}px`;
  bar.lastElementChild.textContent = plain(length, "m");
}

/** Draws lines as thick as suits a camera at a distance [m] and a picture so high [pixels]. */
function widen(picture, distance, height) {
  if (!data.scaled.length) return;
  const pixel = pixelAt(distance, height);
  const wanted = clamp(SHARE * data.extent, THIN * pixel, THICK * pixel);
  const scale = wanted / data.scaled[0].unit;
  if (Math.abs(scale / widths[picture] - 1) < 0.04) return;
  widths[picture] = scale;
  for (const set of adjusted[picture]) set(scale);
}

/** Draws the picture, and the enlarged path over it. */
function drawInset() {
  if (camera.inset === null) return;
  const { eye, size, x, y } = camera.inset;
  const renderer = viewer.renderer, shadows = renderer.shadowMap;
  const colour = new THREE.Color(), opacity = renderer.getClearAlpha();
  renderer.getClearColor(colour);
  renderer.setScissorTest(true);
  renderer.setClearColor(document.documentElement.dataset.theme === "dark" ? 0x8a96a3 : 0x6b7683, 1);
  renderer.setScissor(x - 1, y - 1, size + 2, size + 2);
  renderer.clear();
  renderer.setScissor(x, y, size, size);
  renderer.setViewport(x, y, size, size);
  shadows.autoUpdate = false;
  renderer.render(viewer.scene, eye);
  shadows.autoUpdate = true;
  renderer.setScissorTest(false);
  renderer.setClearColor(colour, opacity);
  renderer.setViewport(0, 0, pane.clientWidth, pane.clientHeight);
}

function placeLabels() {
  const labels = document.querySelectorAll(".label");
  const places = data.labels.map(({ point }) => {
    const seen = toThree(point).project(viewer.camera);
    const left = (0.5 + seen.x / 2) * pane.clientWidth;
    return { left, top: (0.5 - seen.y / 2) * pane.clientHeight, ahead: seen.z < 1 };
  });
  // Labels are as wide as the room between the drawings, and break their lines.
  const sorted = places.map(({ left }) => left).sort((a, b) => a - b);
  const room = Math.min(...sorted.slice(1).map((left, k) => left - sorted[k])) - 8;
  const shown = room >= NARROWEST && !document.body.classList.contains("bare");
  places.forEach(({ left, top, ahead }, k) => {
    const { style } = labels[k];
    style.maxWidth = `${clamp(room, NARROWEST, 320)}px`;
    style.visibility = ahead && shown ? "visible" : "hidden";
    const half = labels[k].offsetWidth / 2;
    const x = clamp(left, half + 8, Math.max(half + 8, pane.clientWidth - half - 8));
    style.transform = `translate(${x}px, ${top + BELOW}px) translateX(-50%)`;
  });
}

/** Lets the viewer draw all that belongs to the picture. */
function drawWith(viewer) {
  const drawScene = viewer.render.bind(viewer);
  viewer.render = () => {
    camera.adjustLines();
    drawScene();
    drawInset();
    placeLabels();
  };
}
