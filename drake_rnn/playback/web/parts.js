// Switches for what the picture shows.

// What a switch shows or hides: its name, and the scene paths of which it has those that there are.
const PARTS = [
  ["Arm", ["arm", "second", "stand"]],
  ["Desired path", ["desired", "*/desired"]],
  ["Traced path", ["traced", "*/traced"]],
  ["Target posture", ["target", "ahead"]],
  ["Force", ["force"]],
  ["Obstacles", ["obstacles"]],
  ["Surface", ["surface"]],
  ["Ground and grid", ["ground", "Grid"]],
];

function buildParts() {
  const list = byId("parts");
  for (const [name, places] of PARTS) {
    const nodes = places.flatMap(nodesAt).filter(isDrawn);
    if (!nodes.length) continue;
    const row = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked: true });
    box.addEventListener("change", () => {
      for (const node of nodes) node.object.visible = box.checked;
      viewer.set_dirty();
    });
    row.append(box, name);
    list.append(row);
  }
}

/** The nodes of the scene at a path, in which a star stands for any name; none is made. */
function nodesAt(place) {
  let found = [viewer.scene_tree];
  for (const part of place.split("/")) {
    found = found.flatMap(({ children }) => (part === "*" ? below({ children }) : children[part] ?? []));
  }
  return found;
}

/** Whether there is something to see at a node. */
function isDrawn({ object }) {
  let found = false;
  object.traverse((each) => { found ||= Boolean(each.isMesh || each.isLine); });
  return found;
}

/** All nodes below one, at any depth. */
const below = ({ children }) => Object.values(children).flatMap((one) => [one, ...below(one)]);

function toggleFullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen().catch(({ message }) => notice(`There is no full screen here: ${message}`));
}
