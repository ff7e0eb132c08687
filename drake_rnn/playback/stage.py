"""What surrounds the arm: ground, light, background, and a caption."""

from __future__ import annotations

import math
from html import escape

from pydrake.geometry import Box, Meshcat, Rgba

# Okabe and Ito's colours, which people with colour blindness tell apart.
DESIRED_COLOUR = (0.0, 0.447, 0.698)
TRACED_COLOUR = (0.835, 0.369, 0.0)
FORCE_COLOUR = (0.0, 0.62, 0.451)
GHOST_OPACITY = 0.5


def set_stage(meshcat: Meshcat, floor: float, size: float) -> None:
    """Ground, light and background; Meshcat's own axes and grid would be clutter."""
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.62, 0.73, 0.84])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.93, 0.95, 0.97])
    # Meshcat's grid has 40 cells of half a metre; these are of a tenth for arms of common size.
    scale = 0.2 * math.ceil(size / 1.5)
    meshcat.SetProperty("/Grid", "scale", [scale, scale, scale])
    meshcat.SetProperty("/Grid", "position", [0.0, 0.0, floor + 1e-3])
    meshcat.SetProperty("/Grid", "opacity", 0.3)
    meshcat.SetObject("/ground", Box(20.0 * scale, 20.0 * scale, 0.01), Rgba(0.80, 0.83, 0.86))
    meshcat.SetProperty("/ground", "position", [0.0, 0.0, floor - 0.006])
    for light in ("PointLightNegativeX", "PointLightPositiveX"):
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", 6.0)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    sun = "/Lights/FillLight/<object>"
    meshcat.SetProperty(sun, "position", [3.0, 4.0, 9.0])
    meshcat.SetProperty(sun, "intensity", 2.4)
    meshcat.SetProperty(sun, "castShadow", True)
    meshcat.SetProperty(sun, "shadow.mapSize.width", 4096.0)
    meshcat.SetProperty(sun, "shadow.mapSize.height", 4096.0)
    meshcat.SetProperty(sun, "shadow.normalBias", 0.01)


def with_caption(page: str, title: str, with_ghost: bool, force: str | None = None) -> str:
    """The page with its name, what the colours mean, and the time.

    Args:
        page: As Meshcat makes it.
        title: Of the run.
        with_ghost: Whether there is a target posture to name.
        force: How long an arrow is for which force, if there is one.
    """
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>")
    body, end = page.rsplit("</body>", 1)
    caption = _CAPTION.format(
        title=escape(title),
        ghost=_GHOST if with_ghost else "",
        force="" if force is None else _FORCE.format(escape(force)),
        desired=_css(DESIRED_COLOUR),
        traced=_css(TRACED_COLOUR),
    )
    return f"{body}{caption}</body>{end}"


def _css(colour: tuple[float, float, float]) -> str:
    return "rgb({}, {}, {})".format(*(round(255 * part) for part in colour))


_GHOST = f"""
    <span style="color: {_css(DESIRED_COLOUR)}; opacity: {GHOST_OPACITY}">&#9679;</span> target"""
# The camera is near: the arm may lie behind the words.
_FORCE = f"""
    <style>#caption {{{{ background: rgba(255, 255, 255, 0.8); padding: 0.1em 0.6em; }}}}</style>
    <span style="color: {_css(FORCE_COLOUR)}">&#8593;</span> {{}}"""
_CAPTION = """
  <div id="caption">
    <b>{title}</b>
    <span style="color: {desired}">&#9679;</span> desired{ghost}
    <span style="color: {traced}">&#9679;</span> traced{force}
    <span id="clock"></span>
  </div>
  <style>
    #caption {{
      position: fixed; left: 1.2em; top: 0.9em; color: #223;
      font: 15px/1.5 system-ui, sans-serif; pointer-events: none;
    }}
    #caption span[style] {{ margin-left: 1em; font-size: 1.2em; }}
    .dg.main {{ opacity: 0.4; }}
    .dg.main:hover {{ opacity: 1; }}
    #clock {{ margin-left: 1em; font-variant-numeric: tabular-nums; }}
  </style>
  <script>
    (function tick() {{
      const seconds = viewer.animator.time.toFixed(1);
      document.getElementById("clock").textContent = seconds + " s";
      requestAnimationFrame(tick);
    }})();
  </script>
"""
