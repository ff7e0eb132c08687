"""A run of a pen: curves passed without a stop, from rest to rest by a time law."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array
from .arc_length import Arc, line
from .path import Motion
from .pieces import Pieces, joined
from .timing import TimeLaw

# Equal steps of time, and points of each piece of a curve, at which a motion is looked at.
_STEPS, _POINTS = 500, 4
# Highest local maxima that are looked at closely, how often, and in how many steps each time.
_PEAKS, _TIMES, _CLOSER = 6, 3, 21


@dataclass(frozen=True, eq=False)
class Run:
    """Curves one after another.

    Attributes:
        arcs: The curves; each begins where the one before it ends, with the same tangent.
    """

    arcs: tuple[Arc, ...]

    @cached_property
    def length(self) -> float:
        """Length of all curves [m]."""
        return self._begins[-1]

    @property
    def straight(self) -> bool:
        """Whether all of it is one straight line."""
        return all(arc.straight for arc in self.arcs)

    @cached_property
    def _begins(self) -> list[float]:
        return list(accumulate((arc.length for arc in self.arcs), initial=0.0))

    def at(self, s: float) -> Motion:
        """Return point [m], tangent and its derivative [1/m] at an arc length [m]."""
        number = max(bisect_right(self._begins, s, hi=len(self.arcs)) - 1, 0)
        curve = _trajectories(self.arcs[number], self._begins[number])
        p, tangent, curvature = (each.value(s).ravel() for each in curve)
        return p, tangent, curvature

    def motion(self, law: TimeLaw, time: float, t: float) -> Motion:
        """Return position [m], velocity [m/s] and acceleration [m/s^2].

        Args:
            law: The time law.
            time: Duration of the run [s].
            t: Time since its start [s].
        """
        s, ds, dds = law(t / time)
        p, tangent, curvature = self.at(s * self.length)
        rate, gain = ds * self.length / time, dds * self.length / time**2
        return p, rate * tangent, rate**2 * curvature + gain * tangent

    def largest(self, law: TimeLaw) -> tuple[float, float]:
        """Return the largest speed [m/s] and acceleration [m/s^2] if the run lasts 1 s."""
        begins = zip(self.arcs, self._begins, strict=False)
        curve = joined([arc.pieces(begin) for arc, begin in begins])
        steps, ways = _even(law)
        passed = self._passed(curve.times, steps, ways[:, 0])
        taus, order = np.unique(np.concatenate((steps, passed)), return_index=True)
        motions = np.concatenate((ways, _motions(law, passed)))[order]
        values = self._magnitudes(curve, motions)
        speed, gain = (self._peak(curve, law, taus, values, which) for which in range(2))
        return speed, gain

    def _passed(self, breaks: Array, steps: Array, ways: Array) -> Array:
        """Return times at which several points of each piece are passed."""
        shares = np.arange(_POINTS) / _POINTS
        s = (breaks[:-1, None] + np.diff(breaks)[:, None] * shares).ravel() / self.length
        return np.interp(s, ways, steps)

    def _magnitudes(self, curve: Pieces, motions: Array) -> tuple[Array, Array]:
        """Return speeds and magnitudes of the acceleration by phase, rate and gain of a time law.

        Args:
            curve: The curve by its arc length.
            motions: What the law gives for times of a run of 1 s, shape (n, 3).
        """
        s, ds, dds = (self.length * motions).T
        tangent, curvature = curve.values(np.clip(s, 0.0, self.length), (1, 2))
        speeds = np.abs(ds) * np.linalg.norm(tangent, axis=1)
        ds, dds = ds[:, None], dds[:, None]
        return speeds, np.linalg.norm(ds**2 * curvature + dds * tangent, axis=1)

    def _peak(
        self, curve: Pieces, law: TimeLaw, taus: Array, magnitudes: tuple[Array, Array], which: int
    ) -> float:
        """Return the largest of values, and of those between the highest and their neighbours."""
        values = magnitudes[which]
        framed = np.concatenate(([-1.0], values, [-1.0]))
        tops = np.flatnonzero((values >= framed[:-2]) & (values >= framed[2:]))
        tops = tops[np.argsort(values[tops])[-_PEAKS:]]
        best = float(values.max())
        low, high = taus[np.maximum(tops - 1, 0)], taus[np.minimum(tops + 1, taus.size - 1)]
        for _ in range(_TIMES):
            # A row for each of them.
            near = np.arange(_CLOSER) * ((high - low) / (_CLOSER - 1))[:, None] + low[:, None]
            near[:, -1] = high
            found = self._magnitudes(curve, _motions(law, near.ravel()))[which].reshape(near.shape)
            best = max(best, float(found.max()))
            place, row = found.argmax(axis=1), np.arange(len(near))
            low = near[row, np.maximum(place - 1, 0)]
            high = near[row, np.minimum(place + 1, _CLOSER - 1)]
        return best


@lru_cache(maxsize=100)
def _trajectories(arc: Arc, begin: float) -> tuple[PiecewisePolynomial, ...]:
    """Return points by arc length, and their two derivatives.

    They take some 0.2 MB, and a drawing may have thousands of curves.
    """
    curve = arc.pieces(begin).trajectory
    return curve, curve.MakeDerivative(1), curve.MakeDerivative(2)


@lru_cache(maxsize=10)
def _even(law: TimeLaw) -> tuple[Array, Array]:
    """Return equal steps of time, and what a time law gives for them."""
    steps = np.linspace(0.0, 1.0, _STEPS + 1)
    return steps, _motions(law, steps)


def _motions(law: TimeLaw, taus: Array) -> Array:
    """Return what a time law gives for some times, shape (n, 3)."""
    return np.array([law(tau) for tau in taus.tolist()])


def times_of(
    runs: list[Run],
    law: TimeLaw,
    period: float | None,
    speed: float | None,
    acceleration: float | None,
) -> Array:
    """Return the time of each run [s].

    Args:
        runs: The runs.
        law: The time law of each.
        period: Time of all runs [s], shared so that the largest acceleration is the same in all.
        speed: Largest speed [m/s], without a period.
        acceleration: Largest acceleration [m/s^2], without a period; this, ``speed`` or both.
    """
    # That of one straight line says that of all.
    unit = np.array(Run((line(np.zeros(3), np.array([1.0, 0.0, 0.0])),)).largest(law))
    speeds, gains = np.array(
        [run.length * unit if run.straight else run.largest(law) for run in runs]
    ).T
    if period is not None:
        shares = np.sqrt(gains)
        return np.asarray(period * shares / shares.sum())
    times = np.zeros(len(runs))
    if speed is not None:
        times = np.maximum(times, speeds / speed)
    if acceleration is not None:
        times = np.maximum(times, np.sqrt(gains / acceleration))
    return times
