// The search of the site: pages that say most of what is searched come first, with excerpts.

// Letters of an excerpt before and behind what was found.
const BEFORE = 80, BEHIND = 160;
const asked = (new URLSearchParams(location.search).get("q") || "").toLowerCase().trim();
const askedWords = asked.split(/\s+/).filter((word) => word && !word.startsWith("-"));

const countOf = (text, word) => text.split(word).length - 1;
const textsOf = (page) => (typeof SEARCH_TEXTS === "undefined" ? [] : SEARCH_TEXTS[page] || []);

// Numbers of Sphinx, which this file stands for.
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,

  /** More for a page the more often it has the words, and most if they are its title. */
  score([page, title, anchor, , score, , kind]) {
    if (kind !== "text" && kind !== "title") return score;
    const text = textsOf(page).map(([, each]) => each).join(" ").toLowerCase();
    const least = Math.min(...askedWords.map((word) => countOf(text, word)));
    const often = Math.min(4, Math.log2(1 + countOf(text, asked))) + Math.min(2, Math.log2(1 + least) / 2);
    const named = title.toLowerCase().includes(asked) ? (anchor ? 3 : 10) : 0;
    return score + often + named - (page === "CHANGELOG" ? 6 : 0);
  },
};

/** The place in a text where most of the words are near one another, and how many; -1 for none. */
function placeIn(text) {
  const lower = text.toLowerCase(), whole = lower.indexOf(asked);
  if (whole >= 0) return [whole, askedWords.length + 1];
  let best = [-1, 0];
  for (const word of askedWords) {
    for (let at = lower.indexOf(word); at >= 0; at = lower.indexOf(word, at + 1)) {
      const near = lower.slice(at, at + BEHIND);
      const found = askedWords.filter((each) => near.includes(each)).length;
      if (found > best[1]) best = [at, found];
    }
  }
  return best;
}

/** The excerpt of a page, of one of its sections if there is an anchor; null for none. */
function excerptOf(page, anchor) {
  const all = textsOf(page).filter(([id]) => !anchor || id === anchor);
  let best = [-1, 0], chosen = anchor && all.length ? all[0][1] : "";
  for (const [, text] of all) {
    const place = placeIn(text);
    if (place[1] > best[1]) [best, chosen] = [place, text];
  }
  if (!chosen) return null;
  const from = Math.max(0, best[0] - BEFORE), to = Math.max(0, best[0]) + BEHIND;
  // It begins and ends between words.
  const begin = from && chosen.indexOf(" ", from) + 1, end = to < chosen.length ? chosen.lastIndexOf(" ", to) : chosen.length;
  return `${begin ? "… " : ""}${chosen.slice(begin, end)}${end < chosen.length ? " …" : ""}`;
}

/** A paragraph in which the words are marked. */
function paragraphOf(text) {
  const paragraph = document.createElement("p");
  paragraph.className = "context";
  const escaped = askedWords.map((word) => word.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
  for (const [k, part] of text.split(new RegExp(`(${escaped.join("|")})`, "i")).entries()) {
    const piece = document.createElement(k % 2 ? "mark" : "span");
    piece.textContent = part;
    paragraph.append(piece);
  }
  return paragraph;
}

function addExcerpt(item) {
  const link = item.querySelector("a");
  // A name of the code has its kind beside it.
  if (!link || !askedWords.length || !/kind-(text|title)/.test(item.className)) return;
  const [page, anchor] = link.getAttribute("href").split("#");
  const text = excerptOf(page.replace(/\.html$/, ""), anchor);
  if (text) item.append(paragraphOf(text));
}

/** Adds excerpts to the results that there are, and to each that comes. */
function addExcerpts() {
  const results = document.getElementById("search-results");
  if (!results) return;
  const done = new WeakSet();
  const add = () => results.querySelectorAll("li").forEach((item) => {
    if (!done.has(item)) addExcerpt(item);
    done.add(item);
  });
  new MutationObserver(add).observe(results, { childList: true, subtree: true });
  add();
}

document.addEventListener("DOMContentLoaded", addExcerpts);
