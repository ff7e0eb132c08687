"""Motion of the joints while the target rests: what goes to and fro, and how fast it is in the end.

A target rests from the last step on at which it moves. The first seconds after that are those in
which an arm may arrive.
"""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ..motion import Motion
from .group import Found

#: Time after which an arm should have arrived at a target at rest, and that for which it is looked
#: at from then on, at least [s].
ARRIVING, LOOKING = 2.0, 2.0
# Time over which the last speeds are averaged [s], and rounding of times.
_AVERAGED, _ROUNDING = 0.5, 1e-9


class RestMetrics:
    """Speeds of joints whose target rests until the run ends."""

    def __init__(self) -> None:
        self._target: AnyArray | None = None
        # Time since which the target rests, shape (...).
        self._since: AnyArray = np.nan
        # Ways of the joints since the arm should have arrived, in all and from there to here, and
        # squares of their speeds, shape (..., n); how long that is, and the weight of the squares,
        # shape (...).
        self._travel: AnyArray = 0.0
        self._net: AnyArray = 0.0
        self._squares: AnyArray = 0.0
        self._time: AnyArray = 0.0
        self._weight: AnyArray = 0.0

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        time, q = motion.time, motion.position
        self._find_rest(motion)
        if time.size < 2:
            return
        steps = np.diff(time).reshape(-1, *(1,) * (q.ndim - 2))
        before = time[:-1].reshape(steps.shape)
        counts = 1.0 * (before >= self._since + ARRIVING - _ROUNDING)
        ways = np.diff(q, axis=0) * counts[..., None]
        faded = np.exp((before - time[-1]) / _AVERAGED) * counts
        fading = np.exp((time[0] - time[-1]) / _AVERAGED)
        speeds = ways / np.maximum(steps, _ROUNDING)[..., None]
        self._travel = self._travel + abs(ways).sum(axis=0)
        self._net = self._net + ways.sum(axis=0)
        self._time = self._time + (steps * counts).sum(axis=0)
        weights = faded * steps
        self._squares = self._squares * fading + (speeds**2 * weights[..., None]).sum(axis=0)
        self._weight = self._weight * fading + weights.sum(axis=0)

    def _find_rest(self, motion: Motion) -> None:
        """Find since when the target rests; what was gathered before it moved does not count."""
        time, desired = motion.time, motion.p_WE_desired
        goal = motion.target
        if goal is not None and goal.ndim == motion.position.ndim:
            desired = np.concatenate((desired, goal), axis=-1)
        before = desired[:1] if self._target is None else self._target[None]
        changed = np.concatenate((before, desired))
        moves = (changed[1:] != changed[:-1]).any(axis=-1)
        self._target = desired[-1].copy()
        last = np.where(moves, time.reshape(-1, *(1,) * (moves.ndim - 1)), -np.inf).max(axis=0)
        moved = last > -np.inf
        begun = np.where(np.isnan(self._since), time[0], self._since)
        self._since = np.where(moved, last, begun)
        stays = 1.0 * ~moved
        self._travel, self._net, self._squares = (
            part * stays[..., None] for part in (self._travel, self._net, self._squares)
        )
        self._time, self._weight = self._time * stays, self._weight * stays

    def found(self) -> Found:
        """Return the metrics, by name."""
        time, weight = np.asarray(self._time), np.asarray(self._weight)
        long = time >= LOOKING - _ROUNDING
        swing = (self._travel - abs(self._net)) / np.where(long, time, np.nan)[..., None]
        square = self._squares / np.where(long, weight, np.nan)[..., None]
        return {
            "rest_swing_max_rad_s": swing.max(axis=-1),
            "rest_velocity_max_rad_s": np.sqrt(square.max(axis=-1)),
        }
