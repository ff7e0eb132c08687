r"""Choosing the velocity of the next sample within bounds to the acceleration, or to the jerk.

With the acceleration bounded, the program's box is that of `JointLimits.held_velocity_box`. With
the jerk bounded, the box of the next acceleration, `JointLimits.held_acceleration_box`, is so
narrow that a law which aims at the velocity alone swings about it: by the time the velocity is
reached, the acceleration is not the path's. So the same program is solved for z, the velocity once
the acceleration has been brought to a reference a_r,

.. math::
    z = v + h a_r + \tau(b - a_r), \qquad \tau(x) = \operatorname{sign}(x) h d T(|x| / d),

over the box that this makes of that of the next acceleration b; T and d = J h are those of
`drake_rnn.robot.jerk_stop`. The reference is the acceleration of the velocities that the program
wants for the path alone, without feedback and without a box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import clipped, functions_of
from ...inputs.fields import Array
from ...robot.jerk_stop import gained, gaining
from ...robot.limits import JointLimits
from .box_program import wanted, within_box

Kept = dict[str, Array]


class Program(NamedTuple):
    """What the law wants of the next velocity, see `drake_rnn.laws.parts.box_program`.

    Attributes:
        J: Jacobian, shape (..., m, n).
        b: Task velocity, shape (..., m).
        along: Task velocity of the path alone, without feedback, shape (..., m).
        g: Preferred joint velocities, shape (..., n) [rad/s].
        softness: Softness of the rows, a diagonal matrix, shape (..., m, m).
    """

    J: Array
    b: Array
    along: Array
    g: Array
    softness: Array


@dataclass(frozen=True)
class WithinAcceleration:
    """Limits of position, velocity and, if there are any, of acceleration.

    Attributes:
        limits: Limits of the joints.
    """

    limits: JointLimits

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {}

    def start(self, q: Array) -> Kept:
        """Return its parts of the state in a posture, shape (n,) [rad]."""
        return {}

    def chosen(
        self, program: Program, q: Array, v: Array, kept: Kept, period: float
    ) -> tuple[Array, Kept]:
        """Return the next velocity, shape (..., n) [rad/s], and its parts of the next state.

        Args:
            program: What is wanted.
            q: Joint positions, shape (..., n) [rad].
            v: Velocities until now, shape (..., n) [rad/s].
            kept: Its parts of the state, by name.
            period: Time for which a velocity is held [s].
        """
        J, b, _, g, softness = program
        box = self.limits.held_velocity_box(q, v, period)
        return within_box(J, b, g, softness, *box), {}


@dataclass(frozen=True)
class WithinJerk:
    """Limits of position, velocity, acceleration and jerk.

    Attributes:
        limits: Limits of the joints.
        smoothing: Share of the newest value in the reference of the acceleration.
    """

    limits: JointLimits
    smoothing: Any

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        n = self.limits.size
        return {"a": (n,), "a_path": (n,), "v_path": (n,)}

    def start(self, q: Array) -> Kept:
        """Return its parts of the state in a posture, as `WithinAcceleration.start` does."""
        return {name: np.zeros(shape) for name, shape in self.shapes.items()}

    def chosen(
        self, program: Program, q: Array, v: Array, kept: Kept, period: float
    ) -> tuple[Array, Kept]:
        """Return the next velocity, as `WithinAcceleration.chosen` does."""
        J, b, along, g, softness = program
        lower, upper = self.limits.held_acceleration_box(q, v, kept["a"], period)
        x = wanted(J, along, g, softness)
        largest = self.limits.require("acceleration", "its bound")
        newest = clipped((x - kept["v_path"]) / period, -largest, largest)
        a_r = kept["a_path"] + self.smoothing * (newest - kept["a_path"])
        d = self.limits.require("jerk", "its bound") * period
        base = v + period * a_r
        least, most = (base + period * d * _signed(gained, (a - a_r) / d) for a in (lower, upper))
        z = within_box(J, b, g, softness, least, most)
        a = a_r + d * _signed(gaining, (z - base) / (period * d))
        a = clipped(a, lower, upper)
        return v + period * a, {"a": a, "a_path": a_r, "v_path": x}


def _signed(of: Any, x: Array) -> Any:
    """Return an odd function, which is given for what is positive."""
    xp = functions_of(x)
    return xp.sign(x) * of(xp.abs(x))
