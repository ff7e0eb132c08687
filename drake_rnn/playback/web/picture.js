// The picture of the arm, as the page uses it; where the browser draws none, a sentence says so, and
// what the run has come to is in its place.

/** What is done with a picture that there is. */
const drawn = {
  load() {
    drawWith(viewer);
    return loadScene().then(prepareScene);
  },
  paint: paintStage,
  show: showTime,
  showCapsules,
  setView: (name) => camera.setView(name),
  resize() {
    viewer.set_3d_pane_size(pane.clientWidth, pane.clientHeight);
    camera.fit();
  },
  draw() { if (viewer.needs_render) viewer.render(); },
  listen() {
    viewer.controls.addEventListener("start", () => { camera.followed = false; });
  },
};

/** What is done with one that there is not. */
const undrawn = {
  async load() {
    document.body.classList.add("undrawn");
    byId("undrawn").hidden = false;
  },
  paint() {},
  show() {},
  showCapsules() {},
  setView() {},
  resize() {},
  draw() {},
  listen() {},
};

// Width of the image of a camera as it is drawn, twice as fine as it is shown [pixels], and room round
// what is seen in it, over the extent of that.
const FINE = 480, ROUND = 1.3;

/** The image that a camera has of the tool: points, where they should be, and where they were. */
const image = data.image && {
  ...data.image,
  time: unpacked(data.image.time),
  seen: unpacked(data.image.seen),
  desired: unpacked(data.image.desired),

  /** The part of the image that is shown, as large as what is seen: its corner and width [px]. */
  part() {
    const [width, height] = this.size, both = [...this.seen, ...this.desired].filter(isFinite);
    const axis = (k) => both.filter((_, i) => i % 2 === k);
    const ends = [axis(0), axis(1)].map((all) => all.reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]));
    const [[left, right], [top, bottom]] = ends;
    const wide = Math.min(width, ROUND * Math.max(right - left, ((bottom - top) * width) / height, width / 50));
    const high = (wide * height) / width;
    return [(left + right - wide) / 2, (top + bottom - high) / 2, wide];
  },

  show(t) {
    const canvas = document.querySelector("#camera-image canvas"), paint = painter();
    if (!this.shown) {
      this.shown = this.part();
      const times = this.size[0] / this.shown[2];
      byId("camera-name").textContent = `image of the camera, ${times > 1.05 ? `${Math.round(this.shown[2])} of ` : ""}${this.size[0]} px wide`;
    }
    const [left, top, wide] = this.shown, scale = FINE / wide, points = this.points;
    Object.assign(canvas, { width: FINE, height: Math.round((FINE * this.size[1]) / this.size[0]) });
    const context = canvas.getContext("2d");
    context.scale(scale, scale);
    context.translate(-left, -top);
    const last = nearest(this.time, t);
    for (let point = 0; point < points; point++) {
      const at = (all, k) => [all[2 * (points * k + point)], all[2 * (points * k + point) + 1]];
      const line = (all, to, colour, width) => {
        context.beginPath();
        for (let k = 0; k <= to; k++) context.lineTo(...at(all, k));
        Object.assign(context, { strokeStyle: paint(colour), lineWidth: width / scale, lineJoin: "round" });
        context.stroke();
      };
      const disc = (all, radius, colour) => {
        context.beginPath();
        context.arc(...at(all, last), radius / scale, 0, 2 * Math.PI);
        context.globalAlpha = colour === "desired" ? 0.6 : 1;
        context.fillStyle = paint(colour);
        context.fill();
        context.globalAlpha = 1;
      };
      line(this.desired, this.time.length - 1, "desired", 6);
      line(this.seen, last, "traced", 3);
      disc(this.desired, 14, "desired");
      disc(this.seen, 7, "traced");
    }
  },
};

const picture = viewer === null ? undrawn : drawn;
