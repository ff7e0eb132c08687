r"""What is asked of an end effector along its path: a feed-forward, and a feedback that can brake.

The feed-forward is the secant to the next sample of the path. The feedback is that of
`drake_rnn.laws.parts.approach`, of the position and, with the orientation held, of the rotation
vector.

Where it presses on a surface with the outward normal n, both of the position are those along the
surface alone, and along the normal the tip retreats as the force asks, which can be braked too:

.. math:: b = P_t \left(\frac{p_d(t + h) - p_d(t)}{h}\right) + s(P_t (p_d - p)) + s_n(d - d_d)\, n,
    \qquad P_t = I - n n^T,

with d - d_d how much too deep the tip is for the force that is desired
(`drake_rnn.laws.parts.stiffness`), and s_n the same function s with the gain of the force and the
largest speed along the normal. The row along the normal has a thousandth of the softness of the
others: a wall that leaves no way to follow the path costs the path, not the force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.algebra import dot, joined, outer
from ...inputs.fields import Array
from ...robot.rotation import rotation_error
from ..layout import Signals
from .approach import approach
from .surface_task import Kept, SurfaceTask

# Softness along the normal of a surface that is pressed on, as a share of that along the surface.
_FIRM = 1e-3


@dataclass(frozen=True)
class PathTask:
    """A path that an end effector follows, and a surface that it may press on.

    Attributes:
        kappa: Gain of the feedback [1/s].
        braking: Its deceleration [m/s^2].
        limit: Its largest speed [m/s].
        turn_braking: Its deceleration for the orientation [rad/s^2].
        turn_limit: Its largest speed for the orientation [rad/s].
        turns: Whether the task includes the orientation.
        surface: The surface; None where it does not press.
    """

    kappa: Any
    braking: Any
    limit: Any
    turn_braking: Any
    turn_limit: Any
    turns: bool
    surface: SurfaceTask | None

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {} if self.surface is None else self.surface.parts()

    def start(self) -> Kept:
        """Return its parts of the initial state, by name."""
        return {} if self.surface is None else self.surface.start()

    def felt(self, kept: Signals, u: Signals, period: float) -> Kept:
        """Return its parts of the state after one more sample of the force, by name."""
        return {} if self.surface is None else self.surface.felt(kept, u, period)

    def asked(self, u: Signals, since: Array | None, period: float) -> tuple[Array, Array]:
        """Return the task velocity of the path and the error, shape (..., m).

        Where it presses, both of the position are those along the surface.

        Args:
            u: Signals at the sample.
            since: Motion of the end effector since it was measured, shape (..., m); None if it is
                measured at once.
            period: Time until the next sample [s].
        """
        desired = u["p_WE_desired"]
        along, away = (u["p_preview"] - desired) / period, desired - u["p_WE"]
        if since is not None:
            away = away - since[..., -away.shape[-1] :]
        if self.surface is not None:
            along, away = self.sliding(along, u), self.sliding(away, u)
        if not self.turns:
            return along, away
        R_desired = u["R_WE_desired"]
        turning = rotation_error(R_desired, u["R_preview"]) / period
        turned = rotation_error(u["R_WE"], R_desired)
        if since is not None:
            turned = turned - since[..., :3]
        return joined((turning, along)), joined((turned, away))

    def back(self, error: Array) -> Array:
        """Return the task velocity of the feedback of an error, both of shape (..., m)."""
        if not self.turns:
            return approach(error, self.kappa, self.braking, self.limit)
        turned, away = error[..., :3], error[..., 3:]
        back = approach(away, self.kappa, self.braking, self.limit)
        return joined((approach(turned, self.kappa, self.turn_braking, self.turn_limit), back))

    def sliding(self, velocity: Array, u: Signals) -> Array:
        """Return a task velocity without the part along the normal of the surface it presses on.

        Args:
            velocity: The velocity, or an error, shape (..., m).
            u: Signals at the sample.
        """
        if self.surface is None:
            return velocity
        n = u["normal_WE"]
        if velocity.shape[-1] == 3:
            return velocity - dot(n, velocity) * n
        away = velocity[..., 3:]
        return joined((velocity[..., :3], away - dot(n, away) * n))

    def weighed(self, softness: Array, u: Signals) -> Array:
        """Return the softness of the rows, that along the normal much smaller, shape (..., m, m).

        Where bounds and what is in the way leave no velocity that does the whole task, the force is
        kept first.

        Args:
            softness: Softness of the rows, with one number for the position, shape (..., m, m).
            u: Signals at the sample.
        """
        if self.surface is None:
            return softness
        n = u["normal_WE"]
        along = joined((0.0 * n, n)) if self.turns else n
        return softness - (1.0 - _FIRM) * softness[..., -1:, -1:] * outer(along, along)

    def pressing(self, kept: Signals, u: Signals, along: Array, back: Array) -> tuple[Array, Array]:
        """Return the velocities of path and feedback, with what the force asks for.

        Args:
            kept: Parts of the law's state, by name, with what is known of the surface.
            u: Signals at the sample.
            along: Task velocity of the path, shape (..., m).
            back: That of the feedback, likewise.
        """
        surface = self.surface
        if surface is None:
            return along, back
        n = u["normal_WE"]
        fastest = math.inf if surface.approach_speed is None else surface.approach_speed
        too_deep = surface.depth_error(kept, u)
        if isinstance(too_deep, float):
            too_deep = np.array([too_deep])
        rise = approach(too_deep, surface.gain, self.braking, fastest)
        # Without contact nothing of the path is followed.
        slide = surface.unless_lost(kept, along[..., -3:], 0.0 * n)
        tip = surface.unless_lost(kept, back[..., -3:] + rise * n, n)
        if not self.turns:
            return slide, tip
        return joined((along[..., :3], slide)), joined((back[..., :3], tip))
