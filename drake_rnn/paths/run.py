"""A run of a pen: curves passed without a stop, from rest to rest by a time law."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array
from .arc_length import Arc, line
from .path import Motion
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

    @cached_property
    def _curve(self) -> tuple[PiecewisePolynomial, PiecewisePolynomial, PiecewisePolynomial]:
        """Points by arc length, and their two derivatives."""
        curve, *others = (
            arc.trajectory(begin) for arc, begin in zip(self.arcs, self._begins, strict=False)
        )
        for other in others:
            curve.ConcatenateInTime(other)
        return curve, curve.MakeDerivative(1), curve.MakeDerivative(2)

    def at(self, s: float) -> Motion:
        """Return point [m], tangent and its derivative [1/m] at an arc length [m]."""
        p, tangent, curvature = (each.value(s).ravel() for each in self._curve)
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
        taus = np.unique(np.concatenate((np.linspace(0.0, 1.0, _STEPS + 1), self._taus(law))))
        speeds, gains = self._magnitudes(law, taus)
        return self._peak(law, taus, speeds, 0), self._peak(law, taus, gains, 1)

    def _taus(self, law: TimeLaw) -> Array:
        """Return times at which several points of each piece are passed."""
        breaks = np.array(self._curve[0].get_segment_times())
        shares = np.arange(_POINTS) / _POINTS
        s = (breaks[:-1, None] + np.diff(breaks)[:, None] * shares).ravel() / self.length
        taus = np.linspace(0.0, 1.0, _STEPS + 1)
        return np.interp(s, [law(tau)[0] for tau in taus.tolist()], taus)

    def _magnitudes(self, law: TimeLaw, taus: Array) -> tuple[Array, Array]:
        """Return speeds and magnitudes of the acceleration at these times of a run of 1 s."""
        s, ds, dds = (self.length * np.array([law(tau) for tau in taus.tolist()])).T
        at = np.clip(s, 0.0, self.length)
        tangent, curvature = (each.vector_values(at) for each in self._curve[1:])
        speeds = np.abs(ds) * np.linalg.norm(tangent, axis=0)
        return speeds, np.linalg.norm(ds**2 * curvature + dds * tangent, axis=0)

    def _peak(self, law: TimeLaw, taus: Array, values: Array, which: int) -> float:
        """Return the largest of values, and of those between the highest and their neighbours."""
        framed = np.concatenate(([-1.0], values, [-1.0]))
        tops = np.flatnonzero((values >= framed[:-2]) & (values >= framed[2:]))
        best = float(values.max())
        for top in tops[np.argsort(values[tops])[-_PEAKS:]].tolist():
            low, high = taus[max(top - 1, 0)], taus[min(top + 1, taus.size - 1)]
            for _ in range(_TIMES):
                near = np.linspace(low, high, _CLOSER)
                found = self._magnitudes(law, near)[which]
                place = int(found.argmax())
                best = max(best, float(found[place]))
                low, high = near[max(place - 1, 0)], near[min(place + 1, _CLOSER - 1)]
        return best


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
