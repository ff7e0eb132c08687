// A sentence that the page says once: what it has done, or why it has not.

// Time for which it stays [ms].
const READ = 6000;

let unsaid = 0;

/** Says a sentence, also to a screen reader. */
function notice(text) {
  const said = byId("notice");
  said.textContent = text;
  said.hidden = false;
  clearTimeout(unsaid);
  unsaid = setTimeout(() => { said.hidden = true; }, READ);
}

/** Says what holds the arm back; nothing for an empty text. */
function tellHeld(text) {
  const line = byId("held");
  if (line.textContent !== text) line.textContent = text;
  line.hidden = !text;
}
