// The search of the site: pages that say most of what is searched come first, with excerpts.

// Letters of an excerpt before and behind what was found.
const BEFORE = 80, BEHIND = 160;
const asked = (new URLSearchParams(location.search).get("q") || "").toLowerCase().trim();
const askedWords = asked.split(/\s+/).filter((word) => word && !word.startsWith("-"));

// Words that tell no page from another, unless all are.
const COMMON = new Set("a an and are as at by for from how i in is it its my of on or the to what with".split(" "));
const telling = askedWords.filter((word) => !COMMON.has(word));
const keyWords = telling.length ? telling : askedWords;
// Without an ending, so that `press` finds pressing, and `tuning` tune.
const stemOf = (word) => (word.length > 4 ? word.replace(/(?:ing|ed|es|s|e)$/, "") : word);

const countOf = (text, word) => text.split(word).length - 1;
const textsOf = (page) => (typeof SEARCH_TEXTS === "undefined" ? [] : SEARCH_TEXTS[page] || []);

/** Texts of all pages in lower case, and how much each word that is searched tells. */
let collected = null;
function collection() {
  if (collected) return collected;
  const pages = typeof SEARCH_TEXTS === "undefined" ? {} : SEARCH_TEXTS;
  const texts = new Map(Object.entries(pages).map(
    ([page, all]) => [page, all.map(([, text]) => text).join(" ").toLowerCase()]));
  const all = [...texts.values()];
  const length = all.reduce((sum, text) => sum + text.length, 1) / Math.max(1, all.length);
  const weights = keyWords.map((word) => {
    const having = all.filter((text) => text.includes(stemOf(word))).length;
    return Math.log(1 + all.length / (having + 1));
  });
  return (collected = { texts, length, weights });
}

/** From 0 to 1: how much a page says of the words, for its length; rare words tell more. */
function saidOf(page) {
  const { texts, length, weights } = collection();
  const text = texts.get(page) || "";
  const often = 1.5 * (0.25 + 0.75 * text.length / length);
  let said = 0, most = 0;
  keyWords.forEach((word, k) => {
    const count = countOf(text, stemOf(word));
    said += weights[k] * count / (count + often);
    most += weights[k];
  });
  return most ? said / most : 0;
}

/** From 0 to 1: how many of the words a title has, which counts squared: half a title is none. */
function titledBy(title) {
  const words = title.toLowerCase().split(/[^\p{L}\p{N}]+/u);
  const { weights } = collection();
  let has = 0, most = 0;
  keyWords.forEach((word, k) => {
    if (words.some((each) => each.startsWith(stemOf(word)))) has += weights[k];
    most += weights[k];
  });
  return most ? has / most : 0;
}

// A list of changes, of classes or of all pages has all words; the page of a scheme says most of it.
const PRIORS = [["CHANGELOG", -6], ["reference/", -2], ["README", -3], ["schemes/", 1.5]];

// Numbers of Sphinx, which this file stands for.
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,

  /** More for a page that says more of the words, and most if they are its title. */
  score([page, title, anchor, , score, , kind]) {
    if (kind !== "text" && kind !== "title") return score;
    const phrase = Math.min(4, Math.log2(1 + countOf(collection().texts.get(page) || "", asked)));
    const named = title.toLowerCase().includes(asked) ? (anchor ? 3 : 10) : 0;
    const prior = PRIORS.find(([place]) => page.includes(place))?.[1] ?? 0;
    return Math.min(score, 7) + 8 * saidOf(page) + phrase + (anchor ? 3 : 8) * titledBy(title) ** 2 + named + prior;
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
