"""What an arm and its law did, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array


@dataclass(frozen=True)
class Pressing:
    """What a tool and a surface did to each other, step by step; k steps.

    Attributes:
        normal: Of the surface, outwards, of length 1, shape (3,).
        force: That presses, along the normal, shape (k,) [N].
        desired: What was asked, shape (k,) [N].
    """

    normal: Array
    force: Array
    desired: Array


@dataclass(frozen=True)
class Motion:
    """What an arm and its law did, step by step; k steps, n joints, m task rows.

    Attributes:
        time: Shape (k,) [s].
        position, velocity: Of the arm's joints, shape (k, n) [rad, rad/s].
        network_velocity: The law's own joint velocities, shape (k, n) [rad/s].
        p_WE, v_WE: Of the end effector, shape (k, m) [m, m/s].
        p_WE_desired, v_WE_desired: What was asked, shape (k, m) [m, m/s].
        J: Shape (k, m, n); for a pose with three more rows, of rotation, first.
        J_hat: What was learned, shape (k, m, n); None if nothing was.
        target: Posture that was to be reached, shape (n,) [rad]; None if there was none.
        orientation_error: Angle off the orientation that was to be held, shape (k,) [rad];
            None if none was.
        pressing: The contact with a surface; None without one. Then errors of the position are
            those along the surface.
        tick, network_tick: Time for which the arm's and the law's velocities are held [s];
            None where they change at every step.
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
    tick: float | None = None
    network_tick: float | None = None

    def aside(self, vectors: Array) -> Array:
        """What of ``vectors``, shape (k, m), counts as an error: on a surface, what lies in it."""
        if self.pressing is None:
            return vectors
        n = self.pressing.normal
        return vectors - np.outer(vectors @ n, n)

    def joint_acceleration(self) -> Array:
        """Secant of the arm's velocity over the tick of each step, shape (k - 1, n) [rad/s^2]."""
        return _secant(self.time, self.velocity, self.tick)

    def network_acceleration(self) -> Array:
        """The same of the law's own velocity, shape (k - 1, n) [rad/s^2]."""
        return _secant(self.time, self.network_velocity, self.network_tick)


def _secant(time: Array, values: Array, tick: float | None) -> Array:
    """Differences over ticks, shape (k - 1, n): each step has that of the tick it ends in.

    Without a tick, over the steps' own lengths; steps that events cut a rounding error apart
    are taken together.
    """
    if time.size < 2:
        return np.zeros((0, values.shape[1]))
    if tick is None:
        step = np.diff(time)
        apart = step >= 1e-9 * step.max()
        # What changes at the start changes over the first step.
        apart[: np.argmax(apart) + 1] = False
        number = np.concatenate(([0], 1 + np.cumsum(apart)))
    else:
        # A tick holds its end, at which its value still stands; what lies a rounding error
        # behind that end is of the next one.
        ticks = (time - time[0]) / tick
        number = np.ceil(ticks - 1e-6).astype(int)
        ended = number - ticks < 1e-6
        number[1:] += ended[:-1] & (number[1:] == number[:-1])
    last = np.flatnonzero(np.diff(number, append=number[-1] + 1))
    ends = time[last] if tick is None else number[last] * tick
    secant = np.diff(values[last], axis=0) / np.diff(ends)[:, np.newaxis]
    return np.asarray(secant[np.searchsorted(last, np.arange(1, time.size)) - 1])
