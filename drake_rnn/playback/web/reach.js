// What the y axes show: the range that suits the curves, or one that was chosen by hand.

// Least range: of a logarithmic axis [decades], of a linear one as a share of its numbers.
const LEAST_DECADES = 0.1, LEAST_SHARE = 1e-4;
// Largest range: of a logarithmic axis [decades], of a linear one in ranges that suit.
const MOST_DECADES = 24, MOST_RANGES = 100;
// How much nearer a step of zooming goes, in values as in time.
const STEP = 1.6;
// Least way between two fingers that counts [pixels].
const APART = 24;

/** The value at a share of a range, from 0 at its lower end to 1 at its upper one. */
const valueIn = ({ log, low, high }, share) => (log ? low * (high / low) ** share : low + share * (high - low));

const reach = {
  // Ranges that were chosen, by the unit of their axis.
  chosen: new Map(),

  get whole() { return !this.chosen.size; },

  /** Shows values from one to another on the axis of a unit; returns whether the axis can. */
  to(unit, low, high) {
    const axis = chart.drawn?.axes.get(unit);
    if (!axis || !canShow(axis, low, high)) return false;
    this.chosen.set(unit, { log: axis.range.log, low, high });
    chart.changed();
    return true;
  },

  /** Shows so much of the axis of a unit, about the value at a share of it. */
  by(unit, factor, share = 0.5) {
    const range = chart.drawn?.axes.get(unit)?.range;
    if (range) this.to(unit, valueIn(range, share * (1 - factor)), valueIn(range, share + factor * (1 - share)));
  },

  /** Shows so much of all axes. */
  allBy(factor, share) {
    for (const unit of unitsOf(chart.chosen)) this.by(unit, factor, share);
  },

  /** Moves the values of an axis upwards by a share of its height. */
  move(unit, share) {
    const range = chart.drawn?.axes.get(unit)?.range;
    if (range) this.to(unit, valueIn(range, -share), valueIn(range, 1 - share));
  },

  /** Shows what suits the curves; without a unit, on all axes. */
  reset(unit = null) {
    if (unit === null) this.chosen.clear(); else this.chosen.delete(unit);
    chart.changed();
  },

  /** The ends of the axes, the left one first. */
  ends() {
    return unitsOf(chart.chosen).map((unit) => chart.drawn.axes.get(unit).range).flatMap(({ low, high }) => [low, high]);
  },

  /** Says what was chosen, on the button that undoes it. */
  tell() {
    byId("reached").hidden = this.whole;
    const texts = [...this.chosen].map(([unit, { low, high }]) => `${plain(low, unit)} to ${plain(high, unit)}`);
    byId("reached-from").textContent = texts.join(", ");
  },

  listen() {
    byId("reached").addEventListener("click", () => this.reset());
    document.querySelectorAll("#plot .axis").forEach(listenToAxis);
    listenToPinch(chart.canvas, ({ up, share }) => { if (up !== null) this.allBy(up, share); });
  },
};

/** Whether an axis can show the values from one to another. */
function canShow({ range, suits }, low, high) {
  if (!range.log) {
    const numbers = Math.max(Math.abs(low), Math.abs(high)), most = MOST_RANGES * (suits.high - suits.low);
    return high - low >= LEAST_SHARE * numbers && high - low <= most && low < high;
  }
  const decades = low > 0 ? Math.log10(high / low) : NaN;
  return decades >= LEAST_DECADES && decades <= MOST_DECADES;
}

/** Shows less of the y axes; with the shift key, more. */
const zoomValues = ({ shiftKey }) => reach.allBy(shiftKey ? STEP : 1 / STEP);

/** The share of the height of the plot at a place of a pointer [pixels]. */
function shareAt(y) {
  const { top, height } = chart.frame();
  return 1 - (y - top) / height;
}

/** Lets a pointer move the left or the right axis, a wheel or two fingers zoom it. */
function listenToAxis(element, number) {
  const unit = () => unitsOf(chart.chosen)[number];
  let at = null;
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture?.(event.pointerId);
    at = event.isPrimary ? event.clientY : null;
  });
  element.addEventListener("pointermove", (event) => {
    if (at === null) return;
    reach.move(unit(), (at - event.clientY) / chart.frame().height);
    at = event.clientY;
  });
  for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => { at = null; });
  element.addEventListener("wheel", (event) => {
    if (event.ctrlKey) return;
    event.preventDefault();
    reach.by(unit(), event.deltaY > 0 ? STEP : 1 / STEP, shareAt(event.offsetY));
  }, { passive: false });
  element.addEventListener("dblclick", () => reach.reset(unit()));
  listenToPinch(element, ({ up, share }) => { if (up !== null) reach.by(unit(), up, share); });
}

/**
 * Lets two fingers zoom: `act` is given how much more is shown along and upwards, of which one is
 * null, as fingers that are beside one another stretch time, and fingers above one another values.
 */
function listenToPinch(element, act) {
  const fingers = new Map();
  let before = null;
  const apart = () => {
    const [one, other] = fingers.values();
    return { x: Math.abs(one.x - other.x), y: Math.abs(one.y - other.y) };
  };
  element.addEventListener("pointerdown", ({ pointerId, pointerType, offsetX: x, offsetY: y }) => {
    if (pointerType === "touch") fingers.set(pointerId, { x, y });
    before = fingers.size === 2 ? apart() : null;
  });
  element.addEventListener("pointermove", ({ pointerId, offsetX: x, offsetY: y }) => {
    if (!fingers.has(pointerId)) return;
    fingers.set(pointerId, { x, y });
    if (before === null || fingers.size !== 2) return;
    const [one, other] = fingers.values(), now = apart(), upwards = before.y > before.x;
    const [was, is] = upwards ? [before.y, now.y] : [before.x, now.x];
    if (is < APART || was < APART) return;
    act({ along: upwards ? null : was / is, up: upwards ? was / is : null,
      x: (one.x + other.x) / 2, share: shareAt((one.y + other.y) / 2) });
    before = now;
  });
  for (const end of ["pointerup", "pointercancel"]) {
    element.addEventListener(end, ({ pointerId }) => { fingers.delete(pointerId); before = null; });
  }
}
