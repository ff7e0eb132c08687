// The colours of the traced path: one for all of it, or of the quantity that the chart draws first.

// Ratio of the ends of a scale from which on it is logarithmic, where the chart is.
const WIDE = 30;

const trace = {
  // Whether it is coloured by a quantity; several runs have a colour each.
  coloured: false,
  // Each mesh of the path with the times of its vertices and the look that it had.
  parts: null,

  get offered() { return viewer !== null && !beside.length && growing.length > 0; },

  set(coloured) {
    if (!this.offered) return;
    this.coloured = coloured;
    byId("coloured").checked = coloured;
    this.parts ??= growing.flatMap(partsOf);
    this.paint();
  },

  paint() {
    const curve = chart.chosen[0];
    const scale = this.coloured && curve ? scaleOf(curve) : null;
    byId("trace-scale").hidden = scale === null;
    for (const entry of document.querySelectorAll("#legend .of-trace")) entry.hidden = scale !== null;
    for (const { mesh, times, look } of this.parts ?? []) {
      mesh.material = look;
      if (scale === null) continue;
      const values = times.map((t) => valueAt(curve, t));
      mesh.geometry.setAttribute("color", new THREE.BufferAttribute(coloursOf(values, scale), 3));
      mesh.material = new THREE.MeshBasicMaterial({ vertexColors: true, toneMapped: false, side: look.side });
    }
    if (scale !== null) tellScale(curve, scale);
    viewer.set_dirty();
  },

  listen() {
    byId("coloured-row").hidden = !this.offered;
    if (!this.offered) return;
    byId("coloured").addEventListener("change", (event) => this.set(event.target.checked));
    chart.canvas.addEventListener("chosen", () => { if (this.coloured) this.paint(); });
  },
};

/** The meshes of a path that grows, with the times at which the path comes to their vertices [s]. */
function partsOf({ meshes, time, faces }) {
  return meshes.filter(({ geometry }) => geometry).map((mesh) => {
    const { index, attributes } = mesh.geometry, times = new Float32Array(attributes.position.count).fill(NaN);
    for (let k = 0, face = 0; k < faces.length; k++) {
      for (; face < faces[k]; face++) {
        for (let corner = 3 * face; corner < 3 * face + 3; corner++) {
          const vertex = index ? index.array[corner] : corner;
          if (isNaN(times[vertex])) times[vertex] = time[k];
        }
      }
    }
    return { mesh, times, look: mesh.material };
  });
}

/** The range of a curve in the time in which errors are evaluated: what is beyond has its end's colour. */
function scaleOf(curve) {
  const [from, to] = data.window ?? [0, data.duration];
  const counts = (t) => t >= from - 1e-6 && t <= to + 1e-6;
  const finite = [...curve.values].filter((value, k) => isFinite(value) && counts(curve.time[k]));
  if (!finite.length) return null;
  const least = (values, start) => values.reduce((a, b) => Math.min(a, b), start);
  let [low, high] = [least(finite, Infinity), -least(finite.map((value) => -value), Infinity)];
  // The share of a bound has the bound as its end.
  if (curve.bound > 0 && !curve.above) return { log: false, low: Math.min(0, low), high: Math.max(high, curve.bound) };
  const positive = Math.max(least(finite.filter((value) => value > 0), high), Math.min(high, NOISE * leastBound(curve)));
  const log = Boolean(chart.drawn?.axes.get(curve.unit)?.range.log) && high > WIDE * positive;
  return { log, low: log ? positive : low, high };
}

/** The colours of values, three numbers each; what is no number has that of the least. */
function coloursOf(values, { log, low, high }) {
  const stops = data.scale.map((colour) => new THREE.Color(colour)), found = new Float32Array(3 * values.length);
  const colour = new THREE.Color();
  values.forEach((value, k) => {
    const share = log ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low || 1);
    const at = clamp(isFinite(share) ? share : 0, 0, 1) * (stops.length - 1), first = Math.min(Math.floor(at), stops.length - 2);
    colour.copy(stops[first]).lerp(stops[first + 1], at - first).toArray(found, 3 * k);
  });
  return found;
}

/** Says in the legend which colours are which values. */
function tellScale({ name, unit, values }, { low, high }) {
  const [what, ends] = byId("trace-scale").children, [from, bar, to] = ends.children;
  const below = values.some((value) => value < low) ? "≤ " : "", above = values.some((value) => value > high) ? "≥ " : "";
  what.textContent = `traced, ${name}:`;
  from.textContent = below + plain(low, unit);
  bar.style.background = `linear-gradient(to right, ${data.scale.join(", ")})`;
  to.textContent = above + plain(high, unit);
}
