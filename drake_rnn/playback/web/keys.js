// Keys, and the list of them that a question mark opens.

/**
 * Listens to keys.
 *
 * @param table Rows of [keys as they are written, what they do, {key: action}]; an action is given
 *   the event.
 */
function listenToKeys(table) {
  const actions = Object.assign({}, ...table.map(([, , acts]) => acts), { "?": toggleKeys });
  document.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || isItsOwn(target, key)) return;
    if (byId("keys").open && key !== "?") return;
    const act = actions[key] ?? actions[key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
  // The browser would click a button on the space key that has just played or paused.
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && event.target.id === "play") event.preventDefault();
  });
  byId("keys-list").append(...table.concat([["?", "this list"]]).flatMap(([written, does]) => {
    const [name, meaning] = [document.createElement("dt"), document.createElement("dd")];
    for (const key of written.split(" ")) {
      const cap = document.createElement("kbd");
      cap.textContent = key;
      name.append(cap, " ");
    }
    meaning.textContent = does;
    return [name, meaning];
  }));
  byId("keys-button").addEventListener("click", toggleKeys);
}

/** Whether a control that was reached by the keyboard does something of its own with a key. */
function isItsOwn(control, key) {
  const { tagName, id } = control;
  if (tagName === "SELECT") return true;
  if (tagName === "INPUT") return id !== "scrubber" || ["PageUp", "PageDown"].includes(key);
  return tagName === "BUTTON" && id !== "play" && key === " " && control.matches(":focus-visible");
}

function toggleKeys() {
  const list = byId("keys");
  if (list.open) list.close(); else list.showModal();
}
