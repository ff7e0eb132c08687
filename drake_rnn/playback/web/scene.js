// The scene that Drake's Meshcat recorded, shown at any time of the run.

const THREE = MeshCat.THREE;
const pane = byId("meshcat-pane");
// What only the large picture shows, what only the enlarged path shows, the arm, and the ground.
const LAYERS = { large: 1, inset: 2, arm: 3, stage: 4 };
const ARM = ["arm", "target", "stand", "force"];
const STAGE = ["ground", "Grid"];

const viewer = viewerIn(pane);
window.viewer = viewer;

/** A viewer of the scene; null if the browser has no WebGL. */
function viewerIn(pane) {
  try {
    // False: the page draws frames itself, when something has changed.
    const made = new MeshCat.Viewer(pane, false);
    // Those that ask for an animated picture get one drawn by the page.
    made.animate = () => { if (made.needs_render) made.render(); };
    return made;
  } catch (error) {
    console.info(`There is no picture: ${error.message}`);
    pane.replaceChildren();
    return null;
  }
}

function nodeAt(path) {
  return viewer.scene_tree.find(path.split("/").filter(Boolean));
}
function objectAt(path) {
  return nodeAt(path + "/<object>").object;
}

/** Sets up the scene; resolves when all its objects are there, those read from meshes too. */
function loadScene() {
  const commands = JSON.parse(byId("playback-scene").textContent);
  const setObject = viewer.set_object;
  let missing = 0;
  return new Promise((resolve) => {
    viewer.set_object = function (...given) {
      setObject.apply(this, given);
      missing -= 1;
      if (missing === 0) resolve();
    };
    missing += 1;
    for (const text of commands) {
      const command = viewer.decode({ data: bytesOf(text) });
      if (command.type === "set_object") missing += 1;
      viewer.handle_command(command);
    }
    missing -= 1;
    if (missing === 0) resolve();
    // A mesh that cannot be read must not keep the others from being shown.
    setTimeout(resolve, 10000);
  }).then(() => { viewer.set_object = setObject; });
}

/** Meshes of which more faces are seen as time passes. */
let growing = [];
/** What is as thick as suits the view: in the large picture, and enlarged. */
let adjusted = { large: [], inset: [] };

function prepareScene() {
  viewer.animator.play();
  viewer.animator.pause();
  growing = data.grows.map(({ path, time, faces }) => ({
    meshes: [objectAt(path)], path, time: unpacked(time), faces: unpacked(faces),
  }));
  for (const item of data.scaled) prepareScaled(item);
  for (const name of ["desired/axes", "traced/axes"]) {
    nodeAt(name).object.traverse((each) => each.layers.set(LAYERS.large));
  }
  paintSecond();
  for (const name of ARM) nodeAt(name).object.traverse((each) => each.layers.set(LAYERS.arm));
  // As wide as the tool, the ring round the desired point would look like a path where no tool is.
  if (data.legend.ring) {
    nodeAt("desired/point").object.traverse((each) => each.layers.set(LAYERS.arm));
  }
  for (const name of STAGE) nodeAt(name).object.traverse((each) => each.layers.set(LAYERS.stage));
  if (data.inset) prepareSurface();
  const camera = viewer.camera;
  camera.layers.enable(LAYERS.large);
  camera.layers.enable(LAYERS.arm);
  camera.layers.enable(LAYERS.stage);
  for (const name of ["desired", "traced", "beside"]) {
    nodeAt(name).object.traverse((each) => { each.receiveShadow = false; });
  }
  for (const name of ["desired", "traced", "beside", "force"]) paintLit(name);
  aimSun();
}

/** Tints a second arm, which is told from the first one by that. */
function paintSecond() {
  const tinted = new Set();
  nodeAt("second/arm").object.traverse(({ material }) => {
    for (const each of [material].flat()) {
      if (!each?.color || tinted.has(each)) continue;
      tinted.add(each);
      each.color.multiply(new THREE.Color(data.second));
    }
  });
}

const lit = new Set();

/** Lets a path shine by itself in part: its colour is the same in light and shade. */
function paintLit(path) {
  nodeAt(path).object.traverse(({ material }) => {
    // The enlarged path has the material of the other one.
    if (!material || !material.emissive || lit.has(material)) return;
    lit.add(material);
    material.emissive.copy(material.color).multiplyScalar(0.75);
    material.color.multiplyScalar(0.3);
    material.toneMapped = false;
  });
}

/** The enlarged path does not show the arm, so the surface below it does not show its shadow. */
function prepareSurface() {
  const meshes = [];
  nodeAt("surface").object.traverse((each) => { if (each.isMesh) meshes.push(each); });
  for (const mesh of meshes) {
    const unshaded = mesh.clone();
    mesh.layers.set(LAYERS.large);
    unshaded.layers.set(LAYERS.inset);
    unshaded.receiveShadow = false;
    mesh.parent.add(unshaded);
  }
}

/** Keeps what is needed to draw a line or a solid with another radius. */
function prepareScaled({ kind, path, radius }) {
  const large = objectAt(path);
  if (!large.geometry) return;
  const enlarged = data.inset ? large.clone() : null;
  for (const [name, mesh] of [["large", large], ["inset", enlarged]]) {
    if (mesh === null) continue;
    mesh.layers.set(LAYERS[name]);
    adjusted[name].push(kind === "solids" ? (scale) => mesh.scale.setScalar(scale)
      : widening(mesh, radius));
  }
  if (enlarged === null) return;
  enlarged.castShadow = false;
  if (kind === "lines") {
    enlarged.geometry = large.geometry.clone();
    adjusted.inset.pop();
    adjusted.inset.push(widening(enlarged, radius));
    growing.filter((one) => one.path === path).forEach((one) => one.meshes.push(enlarged));
  }
  large.parent.add(enlarged);
}

/** A function that makes a tube so many times as thick: its vertices move along their normals. */
function widening(mesh, radius) {
  const { position, normal } = mesh.geometry.attributes;
  const from = position.array.slice(), along = normal.array.slice();
  return (scale) => {
    const by = (scale - 1) * radius;
    for (let k = 0; k < from.length; k++) position.array[k] = from[k] + by * along[k];
    position.needsUpdate = true;
    mesh.geometry.computeBoundingSphere();
  };
}

/** Shows exactly this time: postures, points, force and the path traced so far. */
function showTime(t) {
  const animator = viewer.animator;
  for (const action of animator.actions) {
    action.paused = false;
    action.enabled = true;
  }
  animator.seek(t);
  animator.display_progress(t);
  for (const { meshes, time, faces } of growing) {
    const count = faces[lastUpTo(time, t + 1e-6)] || 0;
    for (const mesh of meshes) {
      mesh.visible = count > 0;
      mesh.geometry.setDrawRange(0, 3 * count);
    }
  }
  viewer.set_dirty();
}

/** Shows or hides the capsules round the arm. */
function showCapsules(visible) {
  for (const path of data.capsules) nodeAt(path).object.visible = visible;
  viewer.set_dirty();
}

/** Narrows the light's shadow to the scene: sharper, and with fewer points to compute. */
function aimSun() {
  const sun = objectAt("Lights/FillLight");
  const reach = 0.9 * data.size;
  Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
  const length = Math.max(4, 3 * data.size);
  sun.position.setLength(length);
  Object.assign(sun.shadow.camera, { near: 0.1, far: 2.5 * length });
  sun.shadow.camera.updateProjectionMatrix();
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.radius = 3;
}

// Sky from above, at the horizon, ground, grid and its opacity, and the share of the sun's light.
const STAGES = {
  light: { top: 0xc9d6e4, horizon: 0xf1f4f7, ground: 0xffffff, grid: 0x8a94a0, opacity: 0.35, sun: 1 },
  dark: { top: 0x1b2129, horizon: 0x333d48, ground: 0x38424d, grid: 0x8a96a3, opacity: 0.22, sun: 0.72 },
};

/** Intensity of the sun by day. */
let brightness = null;

function paintStage(theme) {
  const { top, horizon, ground, grid, opacity, sun } = STAGES[theme];
  brightness ??= objectAt("Lights/FillLight").intensity;
  objectAt("Lights/FillLight").intensity = sun * brightness;
  const parts = (hex) => [16, 8, 0].map((shift) => ((hex >> shift) & 255) / 255);
  viewer.set_property(["Background", "<object>"], "top_color", parts(top));
  viewer.set_property(["Background", "<object>"], "bottom_color", parts(horizon));
  objectAt("ground").material.color.setHex(ground);
  nodeAt("target").object.traverse(({ material }) => {
    if (material) material.emissive.copy(material.color).multiplyScalar(theme === "dark" ? 0.8 : 0);
  });
  const lines = objectAt("Grid").material;
  lines.vertexColors = false;
  lines.color.setHex(grid);
  Object.assign(lines, { opacity, transparent: true, depthWrite: false, needsUpdate: true });
  viewer.set_dirty();
}
