// Menus that a button opens above itself; the browser closes them on Escape or a press elsewhere.

function listenToMenus() {
  for (const menu of document.querySelectorAll("[popover]")) {
    const button = document.querySelector(`[popovertarget="${menu.id}"]`);
    menu.addEventListener("toggle", ({ newState }) => {
      button.setAttribute("aria-expanded", newState === "open");
      if (newState === "open") placeMenu(menu, button.getBoundingClientRect());
    });
  }
}

function placeMenu({ style, offsetWidth: width, offsetHeight: height }, { right, top, bottom }) {
  style.left = `${clamp(right - width, 8, Math.max(8, innerWidth - width - 8))}px`;
  // Below where there is no room above.
  style.top = top > height + 8 ? `${top - height - 6}px` : `${Math.min(bottom + 6, Math.max(8, innerHeight - height - 8))}px`;
}
