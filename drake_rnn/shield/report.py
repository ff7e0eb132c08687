"""What a source asks for, what would have stopped the robot, and what a shield made of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..laws.guard import Causes
from ..laws.parts.bounded_velocity import BOUNDING
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from .chunks import Chunk

# Share of a limit at which it counts as reached, and beyond which it is broken.
_AT, _BEYOND = 1.0 - 1e-6, 1.0 + 1e-6
# A joint that is this far behind wants to move [rad]; one that is slower than this stands [rad/s].
_WANTS, _SLOW = 0.02, 1e-3
_ORDERS = ("velocity", "acceleration", "jerk")


class LimitAtWork(NamedTuple):
    """A limit that keeps a joint from what is wanted of it.

    Attributes:
        joint: Name of the joint.
        limit: ``position``, ``velocity``, ``acceleration`` or ``jerk``.
        side: ``upper`` if it keeps the joint from a larger velocity, else ``lower``.
    """

    joint: str
    limit: str
    side: str

    def __str__(self) -> str:
        return f"{self.joint} {self.limit}"


class PairInTheWay(NamedTuple):
    """Two bodies of which one is in the way of the other."""

    one: str
    other: str

    def __str__(self) -> str:
        return f"{self.one} and {self.other}"


#: What keeps an arm from what is wanted.
Intervention = LimitAtWork | PairInTheWay


def interventions_of(
    causes: Causes, joints: Sequence[str], pairs: Sequence[tuple[str, str]]
) -> tuple[Intervention, ...]:
    """Return what kept a step from what was wanted, by name.

    Args:
        causes: What the law says of it.
        joints: Names of the joints.
        pairs: Names of the pairs.
    """
    limits = [
        LimitAtWork(joints[k], BOUNDING[abs(number) - 1], "upper" if number > 0 else "lower")
        for k, number in enumerate(causes.limits.tolist())
        if number
    ]
    # Bodies of several shapes have several pairs of one name.
    return (*limits, *dict.fromkeys(PairInTheWay(*pairs[k]) for k in causes.pairs.tolist()))


@dataclass(frozen=True, eq=False)
class ShieldRecord:
    """What a source wanted, what a shield commanded and what intervened, command by command.

    Attributes:
        time: Times of the commands, shape (k,) [s].
        period: Time between two of them [s].
        wanted: Where the source wants the joints at these times, shape (k, n) [rad]. Of velocities,
            poses and twists: where the joints would be if they had the velocity that is wanted of
            them for the time by which the shield looks ahead.
        command: Commanded positions, shape (k, n) [rad].
        off_path: How far the joints are off the way that was wanted lately, shape (k,) [rad].
        delay: By how much later than wanted the arm is at that point, shape (k,) [s].
        limits: What keeps each joint, shape (k, n): 1 + the number of the limit in `LIMITS` where
            it keeps the joint from a larger velocity, -1 - that where from a smaller one; else 0.
        pairs: Which pairs of bodies are in the way, shape (k, p).
        joints: Names of the joints.
        pair_names: Names of these pairs, of which no two are the same.
        ways: Times at which the way that is followed has changed [s], and the way from then on.
    """

    time: Array
    period: float
    wanted: Array
    command: Array
    off_path: Array
    delay: Array
    limits: NDArray[np.intp]
    pairs: NDArray[np.bool_]
    joints: tuple[str, ...]
    pair_names: tuple[tuple[str, str], ...]
    ways: tuple[tuple[float, Chunk], ...] = ()

    @property
    def deviation(self) -> Array:
        """Largest difference of a joint from where it is wanted, shape (k,) [rad]."""
        return np.asarray(np.abs(self.wanted - self.command).max(axis=1, initial=0.0))

    def at(self, k: int) -> tuple[Intervention, ...]:
        """Return what intervened in the command of number ``k``."""
        causes = Causes(self.limits[k], np.flatnonzero(self.pairs[k]))
        return interventions_of(causes, self.joints, self.pair_names)

    @property
    def stands(self) -> NDArray[np.bool_]:
        """In which commands the arm stood although it was behind, shape (k,)."""
        return _stands(self.deviation, self.command, np.full(len(self.time), self.period))

    @cached_property
    def summary(self) -> ShieldSummary:
        """What happened in all commands together."""
        n, h, deviation = len(self.joints), self.period, self.deviation
        limit_time = {}
        for number, name in enumerate(BOUNDING, start=1):
            sides = [(self.limits == sign * number).sum(axis=0) for sign in (-1, 1)]
            limit_time[name] = h * np.array(sides, dtype=float).reshape(2, n)
        by_pair = h * self.pairs.sum(axis=0)
        intervened = (self.limits != 0).any(axis=1) | self.pairs.any(axis=1)
        return ShieldSummary(
            duration=h * len(self.time),
            intervened=h * float(intervened.sum()),
            limit_time=limit_time,
            pair_time={self.pair_names[k]: float(by_pair[k]) for k in np.flatnonzero(by_pair)},
            stopped=h * float(self.stands.sum()),
            largest_deviation=float(deviation.max(initial=0.0)),
            rms_deviation=float(np.sqrt(np.square(deviation).mean())) if len(deviation) else 0.0,
            largest_off_path=float(self.off_path.max(initial=0.0)),
            largest_delay=float(self.delay.max(initial=0.0)),
        )


#: Limits that may intervene, in the order of their numbers in a `ShieldRecord`.
LIMITS = BOUNDING


@dataclass(frozen=True)
class ShieldSummary:
    """What happened in the commands of a `ShieldRecord` together.

    Attributes:
        duration: Time of all commands [s].
        intervened: Time in which something intervened [s].
        limit_time: Time for which each limit kept each joint from smaller and from larger
            velocities, shape (2, n) [s], by the name of the limit.
        pair_time: Time for which each pair was in the way [s], of those that were.
        stopped: Time for which the arm stood although it was behind [s].
        largest_deviation, rms_deviation: Of the largest difference of a joint from where it is
            wanted [rad].
        largest_off_path: Farthest that joints were off the way [rad].
        largest_delay: Longest that the arm was behind on its way [s].
    """

    duration: float
    intervened: float
    limit_time: dict[str, Array]
    pair_time: dict[tuple[str, str], float]
    stopped: float
    largest_deviation: float
    rms_deviation: float
    largest_off_path: float
    largest_delay: float

    def rows(self, joints: Sequence[str]) -> Iterator[tuple[str, float]]:
        """Yield what intervened and for how long [s], the longest first.

        Args:
            joints: Names of the joints.
        """
        times = {" and ".join(pair): time for pair, time in self.pair_time.items()}
        for name, by_joint in self.limit_time.items():
            for joint, time in zip(joints, by_joint.sum(axis=0).tolist(), strict=True):
                times[f"{joint} {name}"] = time
        yield from sorted(((n, t) for n, t in times.items() if t), key=lambda row: -row[1])


def _stands(deviation: Array, command: Array, step: Array) -> NDArray[np.bool_]:
    """Return when an arm stands although it is behind, shape (k,).

    Args:
        deviation: How far it is behind, shape (k,) [rad].
        command: Where it is, shape (k, n) [rad].
        step: Time since the sample before, shape (k,) [s].
    """
    speed = np.abs(np.diff(command, axis=0, prepend=command[:1])).max(axis=1, initial=0.0)
    stands: NDArray[np.bool_] = (deviation > _WANTS) & (speed <= _SLOW * step)
    return stands


@dataclass(frozen=True)
class LimitUse:
    """What a motion needs of a limit.

    Attributes:
        name: The limit: ``position``, ``velocity``, ``acceleration`` or ``jerk``.
        joint: The joint that needs most of it, or is farthest beyond it, by its number from 0.
        largest: The largest value, as a share of the limit; of the position the largest way beyond
            it [rad].
        at: When that is [s].
        share: Share of the time in which some joint is at its limit or beyond it.
        is_broken: Whether it is broken.
    """

    name: str
    joint: int
    largest: float
    at: float
    share: float
    is_broken: bool


def limit_uses(t: Array, q: Array, limits: JointLimits) -> tuple[LimitUse, ...]:
    """Return what a motion needs of each limit that is known; it is straight between its points.

    Args:
        t: Times, increasing, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad].
        limits: The limits.
    """
    beyond = np.maximum(limits.position_lower - q, q - limits.position_upper)
    k, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    outside = (beyond > 1e-9).any(axis=1).mean()
    largest = float(beyond[k, joint])
    uses = [LimitUse("position", int(joint), largest, float(t[k]), float(outside), largest > 1e-9)]
    x, times = q, t
    for name in _ORDERS:
        if len(x) < 2:
            break
        # Each difference stands between two of what it is of.
        x = np.diff(x, axis=0) / np.diff(times)[:, None]
        times = 0.5 * (times[1:] + times[:-1])
        bound = limits.bounds[name]
        if bound is None:
            continue
        ratio = np.abs(x) / bound
        k, joint = np.unravel_index(int(ratio.argmax()), ratio.shape)
        share, largest = float((ratio >= _AT).any(axis=1).mean()), float(ratio[k, joint])
        uses.append(LimitUse(name, int(joint), largest, float(times[k]), share, largest > _BEYOND))
    return tuple(uses)


@dataclass(frozen=True)
class ClosestApproach:
    """The least distance on a motion.

    Attributes:
        distance: The distance [m]; negative where two overlap.
        pair: Names of the two.
        at: When that is [s].
    """

    distance: float
    pair: tuple[str, str]
    at: float


def closest_approach(t: Array, q: Array, clearance: Clearance) -> ClosestApproach:
    """Return the least distance on a motion that is straight between its points.

    Args:
        t: Times, increasing, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad].
        clearance: The pairs.
    """
    least = clearance.least_along(q)
    k = int(least.argmin())
    pair = int(clearance.gaps(q[k]).argmin())
    return ClosestApproach(float(least[k]), clearance.names[pair], float(t[k]))


@dataclass(frozen=True)
class StreamReport:
    """A stream of joint targets, and the commands that followed them.

    Attributes:
        targets: Targets that came.
        invalid: Targets that had an entry that is no number.
        rate: Targets a second, by the median time between two.
        gap: Longest time without one [s].
        jump: Largest way of a joint between two targets [rad].
        source: What the targets need of each limit, if they are commanded as they come.
        source_nearest: The least distance on the way through the targets; None for none.
        command: What the commands need of each limit.
        command_nearest: The least distance on their way.
        stopped: Time for which the arm stood although it was behind [s].
    """

    targets: int
    invalid: int
    rate: float
    gap: float
    jump: float
    source: tuple[LimitUse, ...]
    source_nearest: ClosestApproach | None
    command: tuple[LimitUse, ...]
    command_nearest: ClosestApproach | None
    stopped: float

    @property
    def would_trip(self) -> tuple[str, ...]:
        """What would have stopped the robot: the limits that the targets break, and a contact."""
        names = tuple(use.name for use in self.source if use.is_broken)
        touches = self.source_nearest is not None and self.source_nearest.distance <= 0.0
        return (*names, *(("contact",) if touches else ()))


def report_stream(
    targets: tuple[Array, Array],
    commands: tuple[Array, Array],
    start: Array,
    limits: JointLimits,
    clearance: Clearance | None = None,
) -> StreamReport:
    """Return what a source asks for and what was commanded.

    Args:
        targets: Times, shape (k,) [s], and targets, shape (k, n) [rad], NaN where there is none.
        commands: Times, shape (s,) [s], and joint positions, shape (s, n) [rad].
        start: Posture before any target, shape (n,) [rad].
        limits: Limits of the joints.
        clearance: Pairs whose distance is looked at; None for none.
    """
    t, q = targets
    whole = np.isfinite(q).all(axis=1)
    t_whole, q_whole = t[whole], q[whole]
    spacing = np.diff(t_whole)
    times, positions = commands
    newest = np.vstack((start, q_whole))[np.searchsorted(t_whole, times + 1e-9, side="right")]
    error = np.abs(newest - positions).max(axis=1)
    step = np.diff(times, prepend=times[0])
    stands = _stands(error, positions, step)
    way = np.vstack((start, q_whole))
    source_nearest = command_nearest = None
    if clearance is not None:
        command_nearest = closest_approach(times, positions, clearance)
        if len(t_whole):
            source_nearest = closest_approach(t_whole, q_whole, clearance)
    return StreamReport(
        targets=len(t),
        invalid=int((~whole).sum()),
        rate=float(1.0 / np.median(spacing)) if spacing.size else 0.0,
        gap=float(spacing.max(initial=0.0)),
        jump=float(np.abs(np.diff(way, axis=0)).max(initial=0.0)),
        source=limit_uses(t_whole, q_whole, limits) if len(t_whole) else (),
        source_nearest=source_nearest,
        command=limit_uses(times, positions, limits),
        command_nearest=command_nearest,
        stopped=float(step[stands].sum()),
    )


def rows_of(report: StreamReport, joints: tuple[str, ...]) -> list[tuple[str, str, str]]:
    """Return rows of a table: what is told, of the targets and of the commands.

    Args:
        report: The report.
        joints: Names of the joints.
    """
    rows = [
        ("targets", f"{report.targets}, {report.invalid} no numbers", ""),
        ("rate, longest gap", f"{report.rate:.3g} Hz, {report.gap:.3g} s", ""),
        ("largest jump", f"{report.jump:.3g} rad", ""),
    ]
    source = {use.name: use for use in report.source}
    done = {use.name: use for use in report.command}
    for name in ("position", *_ORDERS):
        if name in done:
            rows.append((name, _cell(source.get(name), joints), _cell(done[name], joints)))
    approaches = (report.source_nearest, report.command_nearest)
    if any(approaches):
        source_text, command_text = ("" if each is None else _distance(each) for each in approaches)
        rows.append(("least distance", source_text, command_text))
    rows.append(("stood though behind", "", f"{report.stopped:.3g} s"))
    return rows


def _cell(use: LimitUse | None, joints: tuple[str, ...]) -> str:
    if use is None:
        return ""
    if use.name == "position":
        text = f"{max(use.largest, 0.0):.3g} rad beyond" if use.is_broken else "kept"
    else:
        text = f"{use.largest:.3g} of the limit"
    where = f", {joints[use.joint]} at {use.at:.3g} s" if use.is_broken else ""
    time = f", {100.0 * use.share:.3g} % of the time" if use.share else ""
    return text + where + time


def _distance(nearest: ClosestApproach) -> str:
    return f"{1e3 * nearest.distance:.3g} mm, {' and '.join(nearest.pair)} at {nearest.at:.3g} s"
