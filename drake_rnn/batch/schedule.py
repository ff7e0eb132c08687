"""The times of the updates in a run: the steps that Drake's simulator would make."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..diagrams.loop import WATCHED
from ..experiment import ExperimentDocument
from ..inputs.fields import Array
from ..measures.ticks import tick_ends

# Robots times steps of a part of the motion: more would not fit a processor's cache, fewer would
# cost more calls; and the least and the largest number of steps.
_PART, _LEAST, _MOST = 8192, 8, 64


@dataclass(frozen=True, eq=False)
class Schedule:
    """The steps of a run, which end where a law samples, a noise changes, or the run ends.

    Attributes:
        times: Time of each step, shape (k + 1,) [s]; the last is the duration.
        samples: Whether the law makes a sample at each, shape (k + 1,).
        noises: Whether the noise changes at each, shape (k + 1,).
        period: Sampling period [s].
        tick: Time for which the arm's velocity is held [s].
        window: Start and end of the time in which errors are evaluated [s]; None for all of it.
    """

    times: Array
    samples: NDArray[np.bool_]
    noises: NDArray[np.bool_]
    period: float
    tick: float
    window: tuple[float, float] | None

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """Whether each step lies in the window, shape (k + 1,)."""
        if self.window is None:
            return np.ones(self.times.size, dtype=bool)
        # Step times carry rounding errors.
        begin, end = self.window
        within = (self.times >= begin - 1e-9) & (self.times <= end + 1e-9)
        return np.asarray(within)

    def part_ends(self, robots: int) -> frozenset[int]:
        """Return the numbers of the steps that end parts of the motion, for metrics.

        A tick of the arm and of the law ends with each part. Parts of few robots have more steps.

        Args:
            robots: Number of robots.
        """
        count = min(max(_PART // robots, _LEAST), _MOST)
        tick, network_tick = (
            set(tick_ends(self.times, each, 0.0)[0].tolist()) for each in (self.tick, self.period)
        )
        ends, least = [], count
        for number in sorted(tick & network_tick):
            if number >= least:
                ends.append(number)
                least = number + count
        return frozenset((*ends, self.times.size - 1))


def schedule_of(document: ExperimentDocument) -> Schedule:
    """Return the steps of a sampled run.

    Args:
        document: Document of an experiment with a period.
    """
    assert document.period is not None
    period, noise, duration = document.period, document.joint_noise, document.duration
    samples = _multiples(period, duration)
    noises = np.empty(0) if noise is None else _multiples(noise.hold, duration)
    # Times a rounding error apart are two steps, as in Drake; a law sees the noise of the first.
    ends = [samples, noises]
    if document.environment is not None:
        # The diagram's watch of the force sensor.
        ends.append(_multiples(WATCHED * period, duration))
    times = np.append(np.unique(np.concatenate(ends)), duration)
    tick = period
    if noise is not None and noise.moves_arm and document.filter is None:
        tick = min(noise.hold, period)
    return Schedule(
        times, np.isin(times, samples), np.isin(times, noises), period, tick, document.window
    )


def _multiples(period: float, duration: float) -> Array:
    times = np.arange(int(duration / period) + 2) * period
    return np.asarray(times[times < duration], dtype=float)
