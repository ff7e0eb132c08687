"""The motion of an arm and its law, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array


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
        lap_start: Time at which the lap began that the last step ends, or the last whole one after
            which the arm has stood still [s]; None without one.
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

    def aside(self, vectors: Array) -> Array:
        """Return ``vectors``, shape (k, m); in contact, only their part along the surface."""
        if self.pressing is None:
            return vectors
        n = self.pressing.normal
        return vectors - np.outer(vectors @ n, n)

    def joint_acceleration(self) -> Array:
        """Return the secant of the arm's velocity over each step's tick, (k - 1, n) [rad/s^2]."""
        return _secant(self.time, self.velocity, self.tick)

    def network_acceleration(self) -> Array:
        """Return the secant of the law's velocity over each step's tick, (k - 1, n) [rad/s^2]."""
        return _secant(self.time, self.network_velocity, self.network_tick)


def _secant(time: Array, values: Array, tick: float | None) -> Array:
    """Return difference quotients over ticks, shape (k - 1, n), for the tick each step ends in.

    Without a tick they are taken over the steps themselves; steps that events split a rounding
    error apart are merged.
    """
    if time.size < 2:
        return np.zeros((0, values.shape[1]))
    if tick is None:
        step = np.diff(time)
        apart = step >= 1e-9 * step.max()
        # A change at the start counts as one over the first step.
        apart[: np.argmax(apart) + 1] = False
        number = np.concatenate(([0], 1 + np.cumsum(apart)))
    else:
        # A tick includes its end, where its value still holds; a step that ends a rounding error
        # later belongs to the next tick.
        ticks = (time - time[0]) / tick
        number = np.ceil(ticks - 1e-6).astype(int)
        ended = number - ticks < 1e-6
        number[1:] += ended[:-1] & (number[1:] == number[:-1])
    last = np.flatnonzero(np.diff(number, append=number[-1] + 1))
    ends = time[last] if tick is None else number[last] * tick
    secant = np.diff(values[last], axis=0) / np.diff(ends)[:, np.newaxis]
    return np.asarray(secant[np.searchsorted(last, np.arange(1, time.size)) - 1])
