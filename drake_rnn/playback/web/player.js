// The clock: time passes while it plays, and is exactly what was asked for when it does not.

// How long the end of the run stays before it begins again [s].
const PAUSE = 1.0;
// Longest time between two frames that counts [s]: a page in the background must not leap.
const LEAP = 1.0;

const player = {
  ready: false,
  playing: false,
  speed: 1,
  time: 0,
  rest: 0,
  before: null,
  // Two times between which it plays again and again; null for the whole run.
  loop: null,

  seek(t) {
    this.pause();
    this.show(t);
  },

  show(t) {
    this.time = clamp(Number.isFinite(+t) ? +t : 0, 0, data.duration);
    this.rest = 0;
    zoom.follow(this.time);
    picture.show(this.time);
    if (image) image.show(this.time);
    chart.show(this.time);
    joints.show(this.time);
    tellHeld((data.held || []).findLast(([from]) => from <= this.time + 1e-6)?.[1] ?? "");
    this.tell();
  },

  /** Goes to the sample of the run before or behind the time that is shown. */
  step(by) {
    const { time } = joints;
    const at = by < 0 ? lastUpTo(time, this.time - 1e-6) : lastUpTo(time, this.time + 1e-6) + 1;
    // Times come as single precision.
    this.seek(+time[clamp(at, 0, time.length - 1)].toFixed(6));
  },

  play() {
    if (this.time >= data.duration) this.show(0);
    this.playing = true;
    this.before = null;
    this.tell();
  },

  pause() {
    this.playing = false;
    this.tell();
  },

  toggle() {
    if (this.playing) this.pause(); else this.play();
  },

  setSpeed(x) {
    if (!(x > 0)) throw new RangeError(`speed: must be positive, not ${x}`);
    this.speed = +x;
    const choice = [...byId("speed").options].find((option) => +option.value === this.speed);
    byId("speed").value = choice ? choice.value : "";
  },

  /** Plays again and again between two times [s]; null for the whole run. */
  setLoop(loop) {
    if (loop !== null && !(loop[0] >= 0 && loop[0] < loop[1] && loop[1] <= data.duration)) {
      throw new RangeError(`loop: must be two times from 0 to ${data.duration} s, not ${loop.join(", ")}`);
    }
    this.loop = loop;
    chart.changed();
  },

  /** Lets time pass until now [ms], the time that an animation frame has. */
  advance(now) {
    const passed = this.before === null ? 0 : Math.min((now - this.before) / 1000, LEAP);
    this.before = now;
    if (!this.playing || data.duration === 0) return;
    const next = this.time + this.rest + this.speed * passed;
    if (this.loop !== null) {
      const [from, to] = this.loop;
      this.show(next < from ? from : from + ((next - from) % (to - from)));
    } else if (next < data.duration) {
      this.show(next);
    } else if (next < data.duration + PAUSE * this.speed) {
      if (this.time < data.duration) this.show(data.duration);
      this.rest = next - data.duration;
    } else {
      this.show(0);
    }
  },

  tell() {
    const { playing, time } = this;
    document.body.classList.toggle("playing", playing);
    byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    const digits = data.duration < 100 ? 2 : 1;
    byId("clock").textContent = `${time.toFixed(digits)} / ${data.duration.toFixed(digits)} s`;
    byId("scrubber").value = time;
    byId("scrubber").setAttribute("aria-valuetext", `${time.toFixed(2)} s`);
  },
};
