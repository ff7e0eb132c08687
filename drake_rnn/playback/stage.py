"""The surroundings of the arm: ground, lights and background, the caption, and the colours."""

from __future__ import annotations

import math
from html import escape

from pydrake.geometry import Box, Meshcat, Rgba

# Colours of Okabe and Ito, which colour-blind people can tell apart.
DESIRED_COLOUR = (0.0, 0.447, 0.698)
TRACED_COLOUR = (0.835, 0.369, 0.0)
FORCE_COLOUR = (0.0, 0.62, 0.451)
TARGET_OPACITY = 0.5
# Vertical field of view [rad], and width of the view over its height.
FIELD_OF_VIEW = math.radians(30.0)
ASPECT = 1.5


def set_stage(meshcat: Meshcat, floor: float, size: float) -> None:
    """Set ground, lights and background.

    Args:
        meshcat: Meshcat with the scene.
        floor: Height of the ground [m].
        size: Largest extent of the scene, which sets the size of the grid [m].
    """
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.62, 0.73, 0.84])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.93, 0.95, 0.97])
    # Meshcat's grid has 40 cells of 0.5 m: for an arm of common size, they become 0.1 m.
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


def with_caption(
    page: str,
    title: str,
    with_target: bool,
    force: str | None = None,
    with_end: bool = False,
    close: bool = False,
) -> str:
    """Return a page with a title, a legend of the colours, and a clock.

    Args:
        page: The page that Meshcat made.
        title: Title of the run.
        with_target: Whether the legend explains the target posture.
        force: Legend of the force arrow; None without one.
        with_end: Whether the legend explains the end of an open path.
        close: Whether the camera is close, so that the arm may be behind the text.
    """
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>")
    body, end = page.rsplit("</body>", 1)
    caption = _CAPTION.format(
        title=escape(title),
        target=_TARGET if with_target else "",
        end=_END if with_end else "",
        force="" if force is None else _FORCE.format(escape(force)),
        backdrop=_BACKDROP if close else "",
        desired=_css(DESIRED_COLOUR),
        traced=_css(TRACED_COLOUR),
        aspect=ASPECT,
        slope=math.tan(FIELD_OF_VIEW / 2.0),
    )
    return f"{body}{caption}</body>{end}"


def _css(colour: tuple[float, float, float]) -> str:
    """Return a colour in the notation of style sheets."""
    return "rgb({}, {}, {})".format(*(round(255 * part) for part in colour))


_TARGET = f"""
    <span style="color: {_css(DESIRED_COLOUR)}; opacity: {TARGET_OPACITY}">&#9679;</span> target"""
_END = f"""
    <span style="color: {_css(DESIRED_COLOUR)}">&#9632;</span> end"""
_BACKDROP = """
    <style>#caption { background: rgba(255, 255, 255, 0.8); padding: 0.1em 0.6em; }</style>"""
_FORCE = f"""
    <span style="color: {_css(FORCE_COLOUR)}">&#8593;</span> {{}}"""
_CAPTION = """
  <div id="caption">
    <b>{title}</b>
    <span style="color: {desired}">&#9679;</span> desired{end}{target}
    <span style="color: {traced}">&#9679;</span> traced{force}{backdrop}
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
    #clock {{ margin-left: 1em; white-space: nowrap; font-variant-numeric: tabular-nums; }}
  </style>
  <script>
    (function tick() {{
      const seconds = viewer.animator.time.toFixed(1);
      document.getElementById("clock").textContent = seconds + " s";
      // A window that is narrower than the view shows its whole width.
      const narrow = Math.max(1, {aspect} / viewer.camera.aspect);
      viewer.camera.fov = 2 * Math.atan({slope} * narrow) * 180 / Math.PI;
      requestAnimationFrame(tick);
    }})();
  </script>
"""
