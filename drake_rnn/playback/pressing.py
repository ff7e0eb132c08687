"""What is replayed of a tool that presses on a surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.math import RotationMatrix

from ..environments import Surface
from ..inputs.fields import Array
from .on_surface import on_surface, within_edges
from .replayed_motion import ReplayedMotion

# A pen's line lies this far above the surface, the trace above what was desired [m]: enough
# for a browser to tell them apart.
_DESIRED_ABOVE = 4e-4
_TRACED_ABOVE = 8e-4


@dataclass(frozen=True)
class Pressing:
    """The contact of a run, in the world frame; k samples, one lap of j points.

    Attributes:
        surface: What is pressed on.
        p_WS: The point of it below the tool at the start, shape (3,) [m].
        desired_force: To press with once it has risen [N].
        force: On the tool, shape (k, 3) [N].
        contact: Where the tool is nearest to the surface, shape (k, 3) [m].
        lap: The path to follow, as a line on the surface, shape (j, 3) [m].
        desired: The point to be at, on the surface, shape (k, 3) [m].
        trace: What a pen would have drawn, shape (k, 3) [m].
    """

    surface: Surface
    p_WS: Array
    desired_force: float
    force: Array
    contact: Array
    lap: Array
    desired: Array
    trace: Array

    @property
    def normal(self) -> Array:
        """Out of the surface, of length 1, shape (3,)."""
        return self.surface.normal_W

    @property
    def R_WS(self) -> RotationMatrix:
        """The surface's axes, z along the normal."""
        return RotationMatrix.MakeFromOneVector(self.normal, 2)

    def strokes(self) -> Iterator[slice]:
        """The stretches of samples, one after another, in which the surface pushes back."""
        touches = (self.force @ self.normal > 0.0).astype(int)
        changes = np.diff(touches, prepend=0, append=0)
        begins, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
        yield from map(slice, begins.tolist(), ends.tolist())


def pressing_of(motion: ReplayedMotion) -> Pressing | None:
    """The contact of a motion, if its experiment has any."""
    setup = motion.result.experiment
    if setup.contact is None:
        return None
    surface = setup.contact.surface
    n = surface.normal_W
    p_WS = setup.contact.place(setup.arm, setup.start)
    standoff = float(n @ (setup.p_WE_start - p_WS)) - surface.gap

    below = on_surface(motion.traced - standoff * n, surface, p_WS)
    touched = within_edges(below, surface, p_WS)
    desired = on_surface(motion.desired, surface, p_WS) + _DESIRED_ABOVE * n
    return Pressing(
        surface=surface,
        p_WS=p_WS,
        desired_force=setup.contact.force.value,
        # A run that diverged may have postures without a force.
        force=np.nan_to_num(motion.result.series["contact_force"][: len(motion.time)]),
        contact=touched,
        lap=desired[: len(motion.lap)],
        desired=desired,
        trace=touched + _TRACED_ABOVE * n,
    )
