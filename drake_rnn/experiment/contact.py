"""The contact of an experiment's tool with a surface, checked together with its path."""

from __future__ import annotations

import numpy as np

from ..environments import ContactModel, Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.own_code import naming
from ..paths import PlacedPath
from ..robot.arm import Arm
from ..robot.tool import beyond_tool
from ..systems import Contact
from .sections import Sections

# Largest extent of a path along the normal, where only the force is controlled [m].
_OFF = 1e-3
# Speed of the tool along the normal, with joints at 1 rad/s, below which it cannot press [m/s].
_STUCK = 1e-3


def contact_doubts(parts: Sections, desired: PlacedPath) -> list[str]:
    """Return warnings about the contact of an experiment, checked together with its path.

    Args:
        parts: What the sections of the experiment's document describe.
        desired: Path of the experiment, placed at the start.

    Raises:
        InvalidInputError: If arm or path do not fit the surface.
    """
    document, arm, start, contact = parts.document, parts.arm, parts.start, parts.contact
    if contact is None:
        return []
    _require_mobility(contact.surface, arm, start)
    _require_along(contact.surface, desired)
    doubts = _doubts(contact, desired, arm, start)
    fails_at = None if document.sensor is None else document.sensor.fails_at
    if fails_at is not None and fails_at >= document.duration:
        doubts.append(
            f"sensor.fails_at: {fails_at:g} s is not before the run's end, {document.duration:g} s"
        )
    return doubts


def _require_mobility(surface: Surface, arm: Arm, start: Array) -> None:
    """Raise an InvalidInputError if no joint moves the tool along the surface's normal."""
    n = surface.believed_normal_W
    speed = float(np.linalg.norm(n @ arm.kinematics().J(start)))
    if speed < _STUCK:
        raise InvalidInputError(
            f"environment.normal: the arm cannot move its tool along {np.round(n, 4).tolist()} "
            f"from its start ({speed:.2g} m/s at 1 rad/s), so it cannot press there"
        )


def _require_along(surface: Surface, desired: PlacedPath) -> None:
    """Raise an InvalidInputError for a path off the plane, which would be ignored silently."""
    if not surface.is_plane:
        return
    extent = float(np.ptp(desired.sample(100) @ surface.normal_W))
    if extent > _OFF:
        raise InvalidInputError(
            f"path: leaves the surface by {extent:.3g} m along the normal, where the force is "
            "controlled; give a path in the plane with the normal "
            f"{np.round(surface.normal_W, 4).tolist()}"
        )


def _doubts(contact: Contact, desired: PlacedPath, arm: Arm, start: Array) -> list[str]:
    surface = contact.surface
    p_WS = contact.place(arm, start)
    doubts = []
    if isinstance(surface, ContactModel) and surface.gap < 0.0:
        doubts.append(
            f"environment.gap: the tool starts {-surface.gap:.3g} m inside the surface, which "
            "pushes it out at once"
        )
    if isinstance(surface, ContactModel) and surface.is_plane:
        for name, excess in beyond_tool(arm, start, surface.normal_W).items():
            doubts.append(
                f"arm.tool: {name} reaches up to {excess:.2g} m farther towards the surface than "
                "the tool; only the tool makes contact, so it passes through: give a longer tool"
            )
    with naming(f"{type(surface).__name__}.overhang"):
        beyond = float(surface.overhang(desired.sample(200), p_WS))
    if beyond > 0.0:
        doubts.append(f"path: extends {beyond:.3g} m beyond the edges of the surface")
    return doubts
