// The target and obstacles, dragged in a plane that faces the camera.

// How far from the target one may touch it [pixels].
const NEAR = 26;

const drag = {
  name: null,
  plane: null,
  offset: null,
  wish: null,

  handles() {
    return Object.entries(panel.controls).filter(([, { kind }]) => kind === "handle");
  },

  /** The handle under the pointer: the target if it is near, otherwise what the ray meets first. */
  under(event) {
    const all = this.handles();
    const target = all.find(([name]) => name === "target");
    if (target) {
      const at = placeOf(target[1].place).project(viewer.camera);
      const [x, y] = [(0.5 + at.x / 2) * pane.clientWidth, (0.5 - at.y / 2) * pane.clientHeight];
      const [px, py] = pointerIn(event);
      if (at.z < 1 && Math.hypot(px - x, py - y) < NEAR) return target[0];
    }
    const ray = rayOf(event);
    const hits = all.filter(([name]) => name !== "target").flatMap(([name, { place }]) =>
      ray.intersectObject(nodeAt(place).object, true).map(({ distance }) => ({ name, distance })));
    return hits.sort((one, other) => one.distance - other.distance)[0]?.name ?? null;
  },

  begin(event) {
    if (!wire.key || event.button > 0) return;
    const name = this.under(event);
    if (name === null) return;
    this.name = name;
    const at = placeOf(panel.controls[name].place);
    const facing = viewer.camera.getWorldDirection(new THREE.Vector3());
    this.plane = new THREE.Plane().setFromNormalAndCoplanarPoint(facing, at);
    this.offset = at.sub(this.met(event) ?? at);
    viewer.controls.enabled = false;
    pane.setPointerCapture(event.pointerId);
    pane.classList.add("dragging");
    event.preventDefault();
  },

  met(event) {
    return rayOf(event).ray.intersectPlane(this.plane, new THREE.Vector3());
  },

  move(event) {
    if (this.name === null) {
      if (!event.buttons) pane.classList.toggle("over-handle", Boolean(wire.key) && this.under(event) !== null);
      return;
    }
    const met = this.met(event);
    if (met === null) return;
    met.add(this.offset);
    const p_W = [met.x, -met.z, met.y];
    this.showWish(p_W);
    wire.set(this.name, p_W);
  },

  end() {
    if (this.name === null) return;
    this.name = null;
    viewer.controls.enabled = true;
    pane.classList.remove("dragging");
    this.showWish(null);
  },

  /** A pale ball where the pointer is: the target follows it at a bounded speed. */
  showWish(at) {
    if (this.wish === null && at !== null) {
      const colour = getComputedStyle(document.documentElement).getPropertyValue("--desired").trim();
      const material = new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.35, depthTest: false });
      this.wish = new THREE.Mesh(new THREE.SphereGeometry(0.012 * data.size, 24, 16), material);
      this.wish.layers.set(LAYERS.large);
      viewer.scene.add(this.wish);
    }
    if (this.wish === null) return;
    this.wish.visible = at !== null;
    if (at !== null) this.wish.position.set(...at);
    viewer.set_dirty();
  },

  listen() {
    pane.addEventListener("pointerdown", (event) => this.begin(event), { capture: true });
    pane.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      pane.addEventListener(name, () => this.end());
    }
  },
};

function placeOf(path) {
  return nodeAt(path).object.getWorldPosition(new THREE.Vector3());
}

function pointerIn({ clientX, clientY }) {
  const { left, top } = pane.getBoundingClientRect();
  return [clientX - left, clientY - top];
}

function rayOf(event) {
  const [x, y] = pointerIn(event), caster = new THREE.Raycaster();
  // What is hidden in the picture is not touched.
  Object.values(LAYERS).forEach((layer) => caster.layers.enable(layer));
  caster.setFromCamera(new THREE.Vector2((2 * x) / pane.clientWidth - 1, 1 - (2 * y) / pane.clientHeight), viewer.camera);
  return caster;
}
