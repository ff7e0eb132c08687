"""What surrounds the robots of a batch: noise, surfaces, and the times of updates.

- Noise of robots side by side, with the same numbers as the blocks of a diagram.
- Elastic surfaces that many robots press on, and the forces between them.
- The times of the updates in a run: the steps that Drake's simulator would make.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays.algebra import AnyArray, functions_of
from ..environments import ElasticSurface
from ..experiment import Experiment, ExperimentDocument
from ..features.contact import WATCH_WINDOW
from ..features.joint_noise import Samples
from ..features.sensing import BLOCK, pose_noise, sample_number
from ..inputs.fields import Array
from ..measures import Pressing
from ..measures.motion import tick_ends
from .grouping import contents


class _Rows:
    """Samples of several noises, of which the next one asked for is usually in the same block.

    Args:
        noises: The noises.
    """

    def __init__(self, noises: Sequence[Samples]) -> None:
        self._noises = noises
        # A memo of a pure function.
        self._block, self._values = -1, np.empty(0)

    def row(self, number: int) -> Array:
        """Return the sample of that number of each noise, shape (size, noises)."""
        block, row = divmod(number, BLOCK)
        if block != self._block:
            self._values = np.stack([noise.block(block) for noise in self._noises], axis=-1)
            self._block = block
        values: Array = self._values[row]
        return values


class Noises:
    """Held noise on the joint velocities of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with dither or a disturbance of one hold.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        settings = [noise for each in documents if (noise := each.joint_noise) is not None]
        # Those that differ in size alone share their samples.
        kinds = [
            (each.section, each.course, document.seed)
            for each, document in zip(settings, documents, strict=True)
        ]
        distinct = list(dict.fromkeys(kinds))
        n = experiments[0].arm.n
        self._rows = _Rows([settings[kinds.index(kind)].samples(n, kind[-1]) for kind in distinct])
        self._which = np.array([distinct.index(kind) for kind in kinds])
        self._scale = np.array([each.scale for each in settings])
        self._hold = settings[0].hold

    def row(self, t: float) -> Array:
        """Return the noise of each seed from a time on, of standard deviation 1, (n, seeds)."""
        return self._rows.row(round(t / self._hold))

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, n) [rad/s], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T


class PoseNoise:
    """Noise of positions that are measured from outside, of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with a measured position and one period.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        seeds = [document.seed for document in documents]
        distinct = list(dict.fromkeys(seeds))
        self._rows = _Rows([pose_noise(seed) for seed in distinct])
        self._which = np.array([distinct.index(seed) for seed in seeds])
        sizes = [each.sensing and each.sensing.p_WE_noise for each in documents]
        self._scale = np.array([size or 0.0 for size in sizes])
        self._period = documents[0].period or 1.0

    def row(self, t: float) -> Array:
        """Return the noise of each seed of the sample at a time, or after it, (3, seeds)."""
        return self._rows.row(sample_number(t, self._period))[:3]

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, 3) [m], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T


class Surfaces:
    """The surface of each robot, a spring as in `drake_rnn.systems.body`.

    Args:
        experiments: The robots' experiments, each with an `ElasticSurface`.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        contacts = [each.contact for each in experiments if each.contact is not None]
        surfaces = [each.surface for each in contacts if isinstance(each.surface, ElasticSurface)]
        self._normal = np.stack([surface.normal_W for surface in surfaces], axis=-1)
        self._believed = np.stack([surface.believed_normal_W for surface in surfaces], axis=-1)
        self._stiffness = np.array([surface.stiffness for surface in surfaces])
        places = zip(contacts, experiments, strict=True)
        p_WS = [contact.place(each.arm, each.start) for contact, each in places]
        self._height = _add(self._normal * np.stack(p_WS, axis=-1))
        keys = [contents(contact.force) for contact in contacts]
        distinct = list(dict.fromkeys(keys))
        self._profiles = [contacts[keys.index(key)].force for key in distinct]
        self._which = np.array([distinct.index(key) for key in keys])
        ends = [each.document.duration for each in experiments]
        self._desired_end = np.array(
            [contact.force.at(end) for contact, end in zip(contacts, ends, strict=True)]
        )

    def row(self, t: float) -> Array:
        """Return the desired force of each profile at a time [s], shape (profiles,) [N]."""
        return np.array([profile.at(t) for profile in self._profiles])

    def press(self, row: AnyArray, p_WE: AnyArray) -> Pressing:
        """Return the forces, in NumPy or in JAX.

        Args:
            row: The desired force of each profile, shape (profiles,) [N].
            p_WE: Positions of the end effectors, shape (robots, 3) [m].
        """
        depth = self._height - _add(self._normal * p_WE.T)
        pushes = functions_of(depth).where(depth > 0.0, self._stiffness * depth, 0.0)
        force = _add(pushes * self._normal * self._normal)
        return Pressing(self._normal.T, force, row[self._which], self._desired_end)

    def signals(self, pressing: Pressing) -> dict[str, Array]:
        """Return what the laws are told of the contact, by name.

        Args:
            pressing: The forces, along the true normals.
        """
        force = pressing.force * self._normal
        return {
            "normal_WE": self._believed.T,
            "normal_force": _add(self._believed * force)[:, np.newaxis],
            "normal_force_desired": pressing.desired[:, np.newaxis],
        }


def _add(rows: AnyArray) -> AnyArray:
    """Return the sum of three rows, shape (robots,)."""
    return rows[0] + rows[1] + rows[2]


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
        ends.append(_multiples(WATCH_WINDOW * period, duration))
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
