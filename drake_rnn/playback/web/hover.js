// The values under the pointer, and the time that a press on the chart goes to.

const hover = {
  show(event) {
    const t = chart.timeAt(event.offsetX);
    chart.hovered = t;
    chart.draw();
    const box = byId("hover"), rows = [rowOf(`${t.toFixed(3)} s`)];
    const paint = painter();
    for (const line of chart.lines()) {
      const { curve, name } = line;
      const desired = curve.desired ? ` of ${toldAt(curve, t, curve.desired)}` : "";
      rows.push(rowOf(`${name}: ${toldAt(curve, t)}${desired}`, colourOf(line, paint), dashOf(line)));
    }
    box.replaceChildren(...rows);
    box.hidden = false;
    // At the side of the pointer that has room.
    const { clientWidth: width } = chart.canvas, left = event.offsetX > 0.5 * width;
    box.style.left = left ? "auto" : `${event.offsetX + 12}px`;
    box.style.right = left ? `${width - event.offsetX + 12}px` : "auto";
  },

  hide() {
    if (chart.hovered === null) return;
    chart.hovered = null;
    byId("hover").hidden = true;
    chart.draw();
  },
};

function rowOf(text, colour = null, dash = []) {
  const row = document.createElement("p");
  if (colour !== null) row.append(sampleOf(colour, dash));
  row.append(text);
  return row;
}

/** Lets a pointer go to a time, and read values; `seek` is null where time cannot be chosen. */
function listenToChart(seek) {
  const { canvas } = chart;
  let held = false;
  canvas.addEventListener("pointerdown", (event) => {
    // A second finger zooms.
    held = seek !== null && event.isPrimary;
    if (!held) return;
    hover.hide();
    canvas.setPointerCapture(event.pointerId);
    seek(chart.timeAt(event.offsetX));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (held) seek(chart.timeAt(event.offsetX));
    else if (event.pointerType !== "touch") hover.show(event);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, () => { held = false; });
  }
  canvas.addEventListener("pointerleave", () => hover.hide());
}
