"""From where a drawing on a surface is read."""

from __future__ import annotations

import math

import numpy as np

from ..inputs.fields import Array
from .camera import Boxes, towards
from .pressing import Pressing

# Sine of the best angle to look down at, and along, a surface.
_STEEPNESS = 0.6
# What is seen round a drawing, and above it: the tool with its arrow [m].
_ROUND, _ABOVE = 0.03, 0.2


def view_onto(pressing: Pressing, boxes: Boxes) -> Array:
    """From where to look at a surface: steeply enough to read what is drawn on it.

    The arm may hide some of it, at the end least, when all is drawn.

    Returns:
        A unit vector from the scene to the camera, shape (3,).
    """
    drawn = pressing.lap[:: max(1, len(pressing.lap) // 50)]
    centre = drawn.mean(axis=0)
    ahead = math.atan2(centre[1], centre[0])
    last = boxes.posture(boxes.postures - 1)

    def cost(direction: Array) -> float:
        steep = float(direction @ pressing.normal)
        level = abs(float(direction[2]) - _STEEPNESS)
        hidden = 2.0 * boxes.hidden(drawn, direction) + last.hidden(drawn, direction)
        return hidden + abs(steep - _STEEPNESS) + 0.5 * level

    directions = (
        towards(ahead + math.radians(aside), math.radians(elevation))
        for aside in (40, -40, 55, -55, 70, -70, 90, -90, 110, -110, 135, -135, 180, 0)
        for elevation in (36, 28, 20, 44, 52)
    )
    return min(directions, key=cost)


def framed(pressing: Pressing) -> Array:
    """What the camera has in view, shape (k, 3) [m]: near enough to read the drawing.

    Of the arm that is the tool and what is next to it.
    """
    drawn = pressing.lap[:: max(1, len(pressing.lap) // 50)]
    middle = (drawn.min(axis=0) + drawn.max(axis=0)) / 2.0
    extent = 2.0 * float(np.linalg.norm(drawn - middle, axis=1).max())
    axes = pressing.R_WS.matrix().T
    aside = (extent / 2.0 + _ROUND) * np.array([axes[0], axes[1], -axes[0], -axes[1]])
    above = max(_ABOVE, extent) * pressing.normal
    return np.concatenate((middle + aside, middle + above + aside))
