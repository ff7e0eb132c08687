"use strict";
const buttons = document.querySelectorAll("[data-show]");
function show(verdict) {
  for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.show === verdict));
  for (const row of document.querySelectorAll("[data-claim]")) row.hidden = verdict !== "" && row.dataset.claim !== verdict;
}
for (const button of buttons) button.addEventListener("click", () => show(button.dataset.show));
// A link to a row shows it, whatever is filtered.
addEventListener("hashchange", () => {
  const row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (row !== null && row.hidden) { show(""); row.scrollIntoView(); }
});
function copied(text) {
  const area = document.createElement("textarea");
  area.value = text;
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}
document.addEventListener("click", (event) => {
  const button = event.target.closest(".copy");
  if (button === null) return;
  const done = copied(button.previousElementSibling.textContent);
  button.textContent = done ? "copied" : "select it";
  setTimeout(() => { button.textContent = "copy"; }, 1500);
});
