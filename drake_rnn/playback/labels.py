"""Labels of things in the scene: text of the page that stays beside its point as the view turns."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from ..inputs.fields import Array


class Label(NamedTuple):
    """A name and a line below it, centred below a point of the scene.

    Attributes:
        text: The name, and what is told of it.
        point: The point, shape (3,) [m].
    """

    text: tuple[str, str]
    point: Array


def with_labels(page: str, labels: Sequence[Label]) -> str:
    """Return a page with labels in its scene; without any, the page as it is."""
    if not labels:
        return page
    body, end = page.rsplit("</body>", 1)
    texts = "".join(
        f'\n  <div class="label"><b>{escape(name)}</b><br>{escape(told)}</div>'
        for (name, told), _ in labels
    )
    # The viewer's y axis is up.
    points = [[x, z, -y] for x, y, z in (label.point.tolist() for label in labels)]
    return f"{body}{texts}{_SCRIPT.replace('POINTS', json.dumps(points))}</body>{end}"


_SCRIPT = """
  <style>
    .label {
      position: fixed; left: 0; top: 0; max-width: 24vw; text-align: center; color: #223;
      font: clamp(10px, 2.1vw, 15px)/1.4 system-ui, sans-serif; pointer-events: none;
      background: rgba(255, 255, 255, 0.7); border-radius: 0.3em; padding: 0.1em 0.5em;
    }
  </style>
  <script>
    (function follow() {
      const labels = document.querySelectorAll(".label");
      const canvas = viewer.renderer.domElement.getBoundingClientRect();
      const multiply = (m, v) =>
        [0, 1, 2, 3].map(row => v.reduce((sum, x, column) => sum + m[4 * column + row] * x, 0));
      POINTS.forEach((point, k) => {
        const seen = multiply(viewer.camera.matrixWorldInverse.elements, [...point, 1]);
        const [x, y, , w] = multiply(viewer.camera.projectionMatrix.elements, seen);
        const left = canvas.left + (0.5 + x / w / 2) * canvas.width;
        const top = canvas.top + (0.5 - y / w / 2) * canvas.height;
        labels[k].style.visibility = w > 0 ? "visible" : "hidden";
        labels[k].style.transform = `translate(${left}px, ${top + 12}px) translateX(-50%)`;
      });
      requestAnimationFrame(follow);
    })();
  </script>
"""
