"""The surroundings of the arm: ground and lights. Their colours are the page's, light or dark."""

from __future__ import annotations

import math

from pydrake.geometry import Box, Meshcat, Rgba

_GROUND = Rgba(0.80, 0.83, 0.86)
# Lights: a little from everywhere, most from one that throws shadows.
_INTENSITIES = {"PointLightNegativeX": 5.0, "PointLightPositiveX": 5.0, "AmbientLight": 0.9}
_SUN, _SUN_INTENSITY = [3.0, 4.0, 9.0], 2.1


def set_stage(meshcat: Meshcat, floor: float, size: float) -> None:
    """Set ground and lights.

    Args:
        meshcat: Meshcat with the scene.
        floor: Height of the ground [m].
        size: Largest extent of the scene, which sets the size of the grid [m].
    """
    meshcat.SetProperty("/Axes", "visible", False)
    # Meshcat's grid has 40 cells of 0.5 m: for an arm of common size, they become 0.1 m.
    scale = 0.2 * math.ceil(size / 1.5)
    meshcat.SetProperty("/Grid", "scale", [scale, scale, scale])
    meshcat.SetProperty("/Grid", "position", [0.0, 0.0, floor + 1e-3])
    meshcat.SetObject("/ground", Box(20.0 * scale, 20.0 * scale, 0.01), _GROUND)
    meshcat.SetProperty("/ground", "position", [0.0, 0.0, floor - 0.006])
    for light, intensity in _INTENSITIES.items():
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)
    sun = "/Lights/FillLight/<object>"
    meshcat.SetProperty(sun, "position", _SUN)
    meshcat.SetProperty(sun, "intensity", _SUN_INTENSITY)
    meshcat.SetProperty(sun, "castShadow", True)
    meshcat.SetProperty(sun, "shadow.normalBias", 0.01)
