// What is taken out of the page: the curves as CSV, the chart and the picture as PNG.

// Pixels of a saved chart, and how many of them stand for one of the page.
const SAVED = { width: 1200, height: 420, ratio: 2 };

/** The curves that are drawn, a column each behind the time; a field is empty without a sample. */
function csv() {
  const lines = chart.lines(), rows = new Map();
  lines.forEach(({ curve }, k) => {
    curve.time.forEach((t, i) => {
      const time = +t.toFixed(6);
      if (!rows.has(time)) rows.set(time, new Array(lines.length).fill(""));
      rows.get(time)[k] = isFinite(curve.values[i]) ? String(+curve.values[i].toPrecision(8)) : "";
    });
  });
  const names = lines.map(({ curve, run }) => (beside.length ? `${run}:` : "") + curve.key + ending(curve.unit));
  const times = [...rows.keys()].sort((one, other) => one - other);
  const table = [["time_s", ...names].map(quoted), ...times.map((t) => [t, ...rows.get(t)])];
  return table.map((row) => `${row.join(",")}\n`).join("");
}

/** A unit in the form in which it ends the name of a metric: rad/s^2 as _rad_s2. */
const ending = (unit) => (unit === "1" ? "" : `_${unit.replace("/s^", "_s").replace(/[/ ]/g, "_")}`);

const quoted = (name) => (/[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name);

/** The chart on a canvas of its own, with its title and what its lines mean. */
function chartPicture() {
  const { width, height, ratio } = SAVED, paint = painter();
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: ratio * width, height: ratio * height });
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.fillStyle = paint("panel");
  context.fillRect(0, 0, width, height);
  context.fillStyle = paint("ink");
  context.font = "600 15px system-ui, sans-serif";
  const title = chart.chosen.map(({ name }) => name).join(", ");
  context.fillText(`${document.title}: ${title}`, MARGINS.left, 24);
  const top = 34 + drawLegend(context, legend.entries(), width - 2 * MARGINS.right, paint);
  const frame = chart.frame(width, height - top);
  drawCurves(context, chart.lines(), { ...frame, top: frame.top + top }, paint);
  return canvas;
}

/** Writes the entries of a legend in as many rows as they need; returns their height [pixels]. */
function drawLegend(context, entries, width, paint) {
  context.font = FONT;
  let [x, y] = [MARGINS.left, 44];
  for (const { text, line, dash, look } of entries) {
    const taken = 26 + context.measureText(text).width + 18;
    if (x + taken > width && x > MARGINS.left) [x, y] = [MARGINS.left, y + 18];
    if (line) drawLevel(context, x, x + 20, y - 4, line, dash);
    else { context.fillStyle = paint(look === "loop" ? "focus" : "shade"); context.fillRect(x, y - 10, 20, 12); }
    context.fillStyle = paint("ink");
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillText(text, x + 26, y);
    x += taken;
  }
  return entries.length ? y - 26 : 0;
}

function save(blob, suffix) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${document.title.replace(/[^\w.-]+/g, "_")}_${suffix}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  notice(`Saved as ${link.download}`);
}

function listenToSaving() {
  byId("save-csv").addEventListener("click", () => save(new Blob([csv()], { type: "text/csv" }), "curves.csv"));
  byId("save-chart").addEventListener("click", () => chartPicture().toBlob((blob) => save(blob, "chart.png")));
  byId("save-picture")?.addEventListener("click", () => {
    // What is drawn is kept only until the browser shows it.
    viewer.render();
    viewer.renderer.domElement.toBlob((blob) => save(blob, `${player.time.toFixed(2)}s.png`));
  });
}
