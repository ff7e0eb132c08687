"""The motion of an arm and its law, step by step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from .ticks import secant


@dataclass(frozen=True)
class Pressing:
    """The contact of a tool with a surface over k steps.

    Attributes:
        normal: Outward unit normal of the surface, shape (3,).
        force: Pressing force along the normal, shape (k,) [N].
        desired: Desired pressing force, shape (k,) [N].
    """

    normal: Array
    force: Array
    desired: Array


@dataclass(frozen=True)
class Motion:
    """The motion of an arm with n joints and of its law over k steps, for m position axes.

    The steps are those of a run, or of a part of it. A part that does not begin the run begins with
    the last step of the part before, at which ticks of the arm and of the law end.

    Attributes:
        time: Time of each step, shape (k,) [s].
        position, velocity: Joint positions and velocities of the arm, shape (k, n) [rad, rad/s].
        network_velocity: The law's own joint velocities, shape (k, n) [rad/s].
        p_WE, v_WE: Position and velocity of the end effector, shape (k, m) [m, m/s].
        p_WE_desired, v_WE_desired: Their desired values, shape (k, m) [m, m/s].
        J: Jacobian, shape (k, m, n); for a pose task, three rotation rows come first.
        J_hat: Learned Jacobian, shape (k, m, n); None without learning.
        target: Target posture, shape (n,) [rad]; None without one.
        orientation_error: Angle between the orientation of the end effector and the desired one,
            shape (k,) [rad]; None if the orientation is left free.
        pressing: Contact with a surface; None without one. With a contact, position errors are
            those along the surface.
        returns: Whether the desired path ends where it began, so that the joints should as well.
        lap_start: Time at which the lap began that the run's last step ends, or the last whole one
            after which the arm has stood still [s]; None without one.
        position_commanded: Joint positions that motors are told to follow, shape (k, n) [rad];
            None for an arm that is where it is commanded to be.
        p_WE_commanded: Position of the end effector at these, shape (k, m) [m]; None as well.
        tick, network_tick: Time for which the arm's and the law's velocities are held [s];
            None if they change at every step.
    """

    time: Array
    position: Array
    velocity: Array
    network_velocity: Array
    p_WE: Array
    v_WE: Array
    p_WE_desired: Array
    v_WE_desired: Array
    J: Array
    J_hat: Array | None
    target: Array | None = None
    orientation_error: Array | None = None
    pressing: Pressing | None = None
    returns: bool = True
    lap_start: float | None = None
    position_commanded: Array | None = None
    p_WE_commanded: Array | None = None
    tick: float | None = None
    network_tick: float | None = None
    origin: float | None = None

    def aside(self, vectors: Array) -> Array:
        """Return ``vectors``, shape (k, m); in contact, only their part along the surface."""
        if self.pressing is None:
            return vectors
        n = self.pressing.normal
        return vectors - np.outer(vectors @ n, n)

    @cached_property
    def joint_acceleration(self) -> Array:
        """Secant of the arm's velocity over each step's tick, shape (k - 1, n) [rad/s^2]."""
        return secant(self.time, self.velocity, self.tick, self._origin)

    @cached_property
    def network_acceleration(self) -> Array:
        """Secant of the law's velocity over each step's tick, shape (k - 1, n) [rad/s^2]."""
        return secant(self.time, self.network_velocity, self.network_tick, self._origin)

    @property
    def fresh(self) -> slice:
        """The steps that the part of the run before this one does not have."""
        return slice(0 if self.origin is None else 1, None)

    def within(self, window: tuple[float, float] | None) -> NDArray[np.bool_]:
        """Return which steps are fresh and in the window, shape (k,); None for the whole run."""
        within = np.ones(self.time.size, dtype=bool)
        if window is not None:
            # Step times carry rounding errors.
            within = (self.time >= window[0] - 1e-9) & (self.time <= window[1] + 1e-9)
        within[: self.fresh.start] = False
        return within

    @property
    def _origin(self) -> float:
        if self.origin is not None:
            return self.origin
        return float(self.time[0]) if self.time.size else 0.0
