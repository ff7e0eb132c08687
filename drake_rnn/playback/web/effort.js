// Where frames are slow, as without a graphics card, shadows are left out, then resolution.

// A frame that takes longer than this is slow [ms]; how many of them are waited for, and for how many
// of these one stands that is much slower.
const SLOW = 120, PATIENCE = 6, MUCH = 3;

const effort = {
  before: null,
  slow: 0,
  // Whether pictures are as they are whatever they take, as those of a film.
  full: false,
  done: 0,
  steps: [
    {
      said: "No shadows: slow graphics.",
      spare() { objectAt("Lights/FillLight").castShadow = false; },
      restore() { objectAt("Lights/FillLight").castShadow = true; },
    },
    {
      said: "Reduced quality: slow graphics.",
      spare() { this.ratio = viewer.renderer.getPixelRatio(); setRatio(0.5); },
      restore() { setRatio(this.ratio); },
    },
  ],

  /** Notes that a frame is drawn at a time [ms], the time that an animation frame has. */
  note(now) {
    const took = this.before === null ? 0 : now - this.before;
    this.before = now;
    const worse = took > SLOW && !document.hidden;
    this.slow = worse ? this.slow + Math.min(took / SLOW, MUCH) : Math.max(0, this.slow - 1);
    if (this.slow < PATIENCE || viewer === null || this.full || this.done === this.steps.length) return;
    this.slow = 0;
    const step = this.steps[this.done];
    this.done += 1;
    step.spare();
    viewer.set_dirty();
    notice(step.said);
  },

  /** Draws whole pictures from now on, or spares what must be spared again. */
  setFull(full) {
    this.full = full;
    if (!full) return;
    while (this.done > 0) {
      this.done -= 1;
      this.steps[this.done].restore();
    }
  },
};

function setRatio(ratio) {
  viewer.renderer.setPixelRatio(ratio);
  resize();
}
