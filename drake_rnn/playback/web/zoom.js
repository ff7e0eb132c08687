// The part of the run that the chart shows, and the slider of the time with it.

// Least time that the chart shows [s].
const NEAREST = 0.02;

const zoom = {
  get whole() { return span.from <= 0 && span.to >= data.duration; },

  /** Shows the times from one to another [s], as far as the run has them. */
  to(from, to) {
    const length = clamp(to - from, Math.min(NEAREST, data.duration), data.duration);
    span.from = clamp(from, 0, data.duration - length);
    span.to = span.from + length;
    Object.assign(byId("scrubber"), { min: span.from, max: span.to });
    byId("zoomed").hidden = this.whole;
    byId("zoomed-from").textContent = `${timeText(span.from)} to ${timeText(span.to)} s`;
    chart.changed();
    player.tell();
  },

  /** Shows so much of the time that is shown, about a time that stays where it is. */
  by(factor, about = player.time) {
    const at = clamp(about, span.from, span.to);
    this.to(at - factor * (at - span.from), at + factor * (span.to - at));
  },

  reset() {
    this.to(0, data.duration);
  },

  /** Keeps a time in the chart: what is shown moves on with it. */
  follow(t) {
    if (this.whole || (t >= span.from && t <= span.to)) return;
    const length = span.to - span.from;
    this.to(t - 0.1 * length, t + 0.9 * length);
  },

  listen() {
    chart.canvas.addEventListener("wheel", (event) => {
      if (event.ctrlKey) return;
      event.preventDefault();
      const length = span.to - span.from;
      if (event.deltaX !== 0 && Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        const along = (length * event.deltaX) / chart.frame().width;
        this.to(span.from + along, span.to + along);
      } else {
        this.by(event.deltaY > 0 ? STEP : 1 / STEP, chart.timeAt(event.offsetX));
      }
    }, { passive: false });
    listenToPinch(chart.canvas, ({ along, x }) => { if (along !== null) this.by(along, chart.timeAt(x)); });
    byId("zoom-in").addEventListener("click", () => this.by(1 / STEP));
    byId("zoom-out").addEventListener("click", () => this.by(STEP));
    byId("zoomed").addEventListener("click", () => this.reset());
    byId("zoom-whole").addEventListener("click", showAll);
  },
};

/** Shows the whole run, and the axes that suit its curves. */
function showAll() {
  zoom.reset();
  reach.reset();
}
