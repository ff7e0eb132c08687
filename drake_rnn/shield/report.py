"""What a source asks for, what would have stopped the robot, and what a shield made of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..laws.guard import Causes, LastStep
from ..laws.parts.bounded_velocity import BOUNDING
from ..paths.recordings import RecordedCall
from ..robot.clearance import Clearance
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .chunks import Chunk, Kind

# Share of a limit at which it counts as reached, and beyond which it is broken.
_AT, _BEYOND = 1.0 - 1e-6, 1.0 + 1e-6
# A joint that is this far behind wants to move [rad]; one that is slower than this stands [rad/s].
_WANTS, _SLOW = 0.02, 1e-3
#: Damping of the joints' way to a pose [m^2]; in the rounds in which they are brought there.
DAMPING, _ROUND_DAMPING, _ROUNDS = 1e-4, 1e-6, 8
# A way that comes nearer by less does not [rad]; times that differ by less are one [s].
_REST = 1e-6
_INSTANT = 1e-9
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


class DroppedPose(NamedTuple):
    """A pose that a filter has dropped, see `drake_rnn.shield.pose_filter.PoseFilter`.

    Attributes:
        time: Its time [s].
        reason: The number of `drake_rnn.shield.chunks.Counts` that it counts as.
        text: The reason in words.
        X_WE: The pose, shape (7,).
    """

    time: float
    reason: str
    text: str
    X_WE: Array


@dataclass(frozen=True, eq=False)
class ShieldRecord:
    """What a source wanted, what a shield commanded and what intervened, command by command.

    Attributes:
        time: Times of the commands, shape (k,) [s].
        period: Time between two of them [s].
        wanted: Where the source wants the joints at these times, shape (k, n) [rad]. Of velocities
            and twists: where the joints would be if they had the velocity that is wanted of them
            for the time by which the shield looks ahead. Of poses: a step of least squares from
            where they are towards the pose.
        wanted_velocity: Joint velocities that are wanted, shape (k, n) [rad/s].
        command: Commanded positions, shape (k, n) [rad].
        off_path: How far the joints are off the way that was wanted lately, shape (k,) [rad].
        delay: By how much later than wanted the arm is at that point, shape (k,) [s].
        limits: What keeps each joint, shape (k, n): 1 + the number of the limit in `LIMITS` where
            it keeps the joint from a larger velocity, -1 - that where from a smaller one; else 0.
        pairs: Which pairs of bodies are in the way, shape (k, p).
        joints: Names of the joints.
        pair_names: Names of these pairs, of which no two are the same.
        ways: Times at which the way that is followed has changed [s], what its targets are, and the
            way from then on.
        dropped: Poses that a filter has dropped.
    """

    time: Array
    period: float
    wanted: Array
    wanted_velocity: Array
    command: Array
    off_path: Array
    delay: Array
    limits: NDArray[np.intp]
    pairs: NDArray[np.bool_]
    joints: tuple[str, ...]
    pair_names: tuple[tuple[str, str], ...]
    ways: tuple[tuple[float, Kind, Chunk], ...] = ()
    dropped: tuple[DroppedPose, ...] = ()

    @property
    def deviation(self) -> Array:
        """Largest difference of a joint from where it is wanted, shape (k,) [rad]."""
        return np.asarray(np.abs(self.wanted - self.command).max(axis=1, initial=0.0))

    def wanted_at(self, t: float) -> Array:
        """Return where the source wants the joints at a time [s], shape (n,) [rad]."""
        k = int(np.searchsorted(self.time, t + 0.5 * self.period)) - 1
        return np.asarray(self.wanted[min(max(k, 0), len(self.time) - 1)])

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


@dataclass(eq=False)
class Sample:
    """A command that is recorded.

    Attributes:
        time, wanted, wanted_velocity, command, off_path, delay: Those of a `ShieldRecord`, of this
            command.
        step: The step of the law that has led to it; None once it is explained.
    """

    time: float
    wanted: Array
    wanted_velocity: Array
    command: Array
    off_path: float
    delay: float
    step: LastStep | None

    @cached_property
    def causes(self) -> Causes:
        """What kept it from what was wanted."""
        assert self.step is not None
        return self.step.causes

    def explain(self) -> None:
        """Find what kept it from what was wanted, and forget the step, which takes room."""
        _ = self.causes
        self.step = None


def record_of(
    samples: Sequence[Sample],
    period: float,
    joints: Sequence[str],
    clearance: Clearance | None = None,
    ways: Sequence[tuple[float, Kind, Chunk]] = (),
) -> ShieldRecord:
    """Return the record of commands.

    Args:
        samples: The commands.
        period: Time between two of them [s].
        joints: Names of the joints.
        clearance: Pairs that the law stays clear of; None for none.
        ways: See `ShieldRecord.ways`; those that ended before the first command are left out.
    """
    n, every = len(joints), () if clearance is None else clearance.names
    names = tuple(dict.fromkeys(every))
    causes = [sample.causes for sample in samples]
    pairs = np.zeros((len(samples), len(names)), dtype=bool)
    for row, cause in zip(pairs, causes, strict=True):
        row[[names.index(every[k]) for k in cause.pairs]] = True
    first = samples[0].time if samples else 0.0
    return ShieldRecord(
        time=np.array([sample.time for sample in samples]),
        period=period,
        wanted=np.array([sample.wanted for sample in samples]).reshape(-1, n),
        wanted_velocity=np.array([each.wanted_velocity for each in samples]).reshape(-1, n),
        command=np.array([sample.command for sample in samples]).reshape(-1, n),
        off_path=np.array([sample.off_path for sample in samples]),
        delay=np.array([sample.delay for sample in samples]),
        limits=np.array([cause.limits for cause in causes], dtype=np.intp).reshape(-1, n),
        pairs=pairs,
        joints=tuple(joints),
        pair_names=names,
        ways=tuple(way for way in ways if way[2].times[-1] >= first - period),
    )


#: Series of a run by which a playback shows what a shield did: where the source wanted the joints,
#: numbers of limits and pairs as in a `ShieldRecord`, and points of the tool on the way ahead.
WANTED, AT_WORK, IN_THE_WAY = "position_wanted", "limit_at_work", "pair_in_the_way"
AHEAD = "p_WE_ahead"
# Points of the way ahead.
_POINTS = 8


def series_of(
    record: ShieldRecord, times: Array, kinematics: ArmKinematics | None = None
) -> dict[str, Array]:
    """Return the series of a record at the times of a run.

    Args:
        record: The record.
        times: Times at or after the first command, shape (s,) [s].
        kinematics: Kinematics of the arm, for the way ahead; None to leave it out.
    """
    now = np.searchsorted(record.time, times + 0.5 * record.period) - 1
    series = {
        WANTED: record.wanted[now],
        AT_WORK: record.limits[now].astype(float),
        IN_THE_WAY: record.pairs[now].astype(float),
    }
    if kinematics is not None and len(record.ways):
        series[AHEAD] = points_ahead(record, times, kinematics)
    return series


def points_ahead(record: ShieldRecord, times: Array, kinematics: ArmKinematics) -> Array:
    """Return points of the tool on what is left of the way, shape (s, p, 3) [m]; NaN without one.

    Args:
        record: The record, of positions or poses.
        times: Times, shape (s,) [s].
        kinematics: Kinematics of the arm.
    """
    points = np.full((len(times), _POINTS, 3), np.nan)
    begins = np.array([begin for begin, _, _ in record.ways])
    newest = np.searchsorted(begins, times + _INSTANT, side="right") - 1
    for number in np.unique(newest[newest >= 0]).tolist():
        _, kind, way = record.ways[number]
        if kind not in ("positions", "poses"):
            continue
        tool = (
            way.values[:, :3]
            if kind == "poses"
            else np.array(list(map(kinematics.p_WE, way.values)))
        )
        (rows,) = np.nonzero((newest == number) & (times < way.times[-1]))
        shares = np.linspace(0.0, 1.0, _POINTS)
        at = times[rows, None] + shares * (way.times[-1] - times[rows, None])
        points[rows] = Chunk(way.times, tool).at(at)
    return points


class Ahead(NamedTuple):
    """What is left of a way.

    Attributes:
        p_WE: Points of the tool, shape (p, 3) [m]; NaN without a way.
        broken: At which points the way breaks a position limit or goes through something, (p,).
        first: What the first of these is, in words; empty without one.
    """

    p_WE: Array
    broken: NDArray[np.bool_]
    first: str


def look_ahead(
    record: ShieldRecord,
    t: float,
    arm: tuple[ArmKinematics, JointLimits],
    clearance: Clearance | None = None,
    p_WO: Array | None = None,
) -> Ahead:
    """Return what is left of the way at a time, and what it breaks; of poses no posture is known.

    Args:
        record: The record.
        t: The time [s].
        arm: Kinematics of the arm, and limits of its joints.
        clearance: Pairs whose distance is looked at; None for none.
        p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
    """
    kinematics, limits = arm
    p_WE = points_ahead(record, np.array([t]), kinematics)[0]
    broken, first = np.zeros(_POINTS, dtype=bool), ""
    begins = [begin for begin, _, _ in record.ways]
    newest = int(np.searchsorted(begins, t + _INSTANT, side="right")) - 1
    if newest < 0 or record.ways[newest][1] != "positions" or not np.isfinite(p_WE).all():
        return Ahead(p_WE, broken, first)
    way = record.ways[newest][2]
    times = np.linspace(t, way.times[-1], _POINTS)
    for k, (at, q) in enumerate(zip(times.tolist(), way.at(times), strict=True)):
        text = _breaks(q, limits, clearance, p_WO, record.joints)
        broken[k] = bool(text)
        first = first or (f"in {at - t:.1f} s {text}" if text else "")
    return Ahead(p_WE, broken, first)


def _breaks(
    q: Array,
    limits: JointLimits,
    clearance: Clearance | None,
    p_WO: Array | None,
    joints: Sequence[str],
) -> str:
    """Return what a posture, shape (n,) [rad], breaks, in words; empty for nothing."""
    beyond = limits.violation(q)
    if beyond.any():
        return f"{joints[int(beyond.argmax())]} beyond its position limit"
    if clearance is None:
        return ""
    gaps = clearance.gaps(q, p_WO)
    if not gaps.min(initial=np.inf) < 0.0:
        return ""
    one, other = clearance.names[int(gaps.argmin())]
    return f"{one} in {other}"


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
        largest_deviation: The largest difference of a joint from where it is wanted [rad].
        rms_deviation: The rms over the commands of that of each [rad].
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

    def as_data(self, joints: Sequence[str]) -> dict[str, Any]:
        """Return it as plain data; of what intervened, the names and for how long [s].

        Args:
            joints: Names of the joints.
        """
        numbers = {name: each for name, each in vars(self).items() if isinstance(each, float)}
        return {**numbers, "by": dict(self.rows(joints))}

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
        first: When it is broken first [s]; None if it is not.
        first_joint: The joint that breaks it first, by its number from 0.
    """

    name: str
    joint: int
    largest: float
    at: float
    share: float
    is_broken: bool
    first: float | None = None
    first_joint: int | None = None


def limit_uses(
    t: Array, q: Array, limits: JointLimits, start: Array | None = None
) -> tuple[LimitUse, ...]:
    """Return what a motion needs of each limit that is known; it is straight between its points.

    Args:
        t: Times, increasing, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad].
        limits: The limits.
        start: Posture before, shape (n,) [rad]. If it is outside the position limits, only what
            goes farther outside than the motion has been before is beyond them. None for inside.
    """
    beyond = np.maximum(limits.position_lower - q, q - limits.position_upper)
    if start is not None:
        before = np.vstack((limits.violation(start), limits.violation(q)[:-1]))
        beyond = beyond - np.minimum.accumulate(before)
    k, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    outside = (beyond > 1e-9).any(axis=1).mean()
    largest = float(beyond[k, joint])
    place = int(joint), largest, float(t[k]), float(outside), largest > 1e-9
    uses = [LimitUse("position", *place, *_first(t, beyond > 1e-9))]
    x, times = q, t
    for name in _ORDERS:
        if len(x) < 2:
            break
        # Each difference stands between two of what it is of.
        x = np.diff(x, axis=0) / np.diff(times)[:, None]
        times = 0.5 * (times[1:] + times[:-1])
        bound = limits.toward(name, x)
        if bound is None:
            continue
        ratio = np.abs(x) / bound
        k, joint = np.unravel_index(int(ratio.argmax()), ratio.shape)
        share, largest = float((ratio >= _AT).any(axis=1).mean()), float(ratio[k, joint])
        place = int(joint), largest, float(times[k]), share, largest > _BEYOND
        uses.append(LimitUse(name, *place, *_first(times, ratio > _BEYOND)))
    return tuple(uses)


def _first(times: Array, is_broken: NDArray[np.bool_]) -> tuple[float | None, int | None]:
    """Return when a limit is broken first, and by which joint; None if it is not."""
    if not is_broken.any():
        return None, None
    k = int(is_broken.any(axis=1).argmax())
    return float(times[k]), int(is_broken[k].argmax())


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
        outside: How far the arm stood outside its position limits at the start [rad]. That it is
            brought back is no violation.
        kind: What the targets are; for ``source`` see `source_motion`.
        chunks: Chunks that came; 0 for single targets.
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
    outside: float = 0.0
    kind: str = "positions"
    chunks: int = 0

    @property
    def would_trip(self) -> tuple[str, ...]:
        """What would have stopped the robot: the limits that the targets break, and a contact."""
        names = tuple(use.name for use in self.source if use.is_broken)
        touches = self.source_nearest is not None and self.source_nearest.distance <= 0.0
        return (*names, *(("contact",) if touches else ()))


def source_motion(
    calls: Sequence[RecordedCall], start: Array, period: float, kinematics: ArmKinematics
) -> tuple[Array, Array]:
    """Return what a source asks for, if it is commanded as it comes: times, and joint positions.

    Of a chunk the rows count until another comes. Velocities and twists are integrated from the
    start on, and of poses and twists the joints make what damped least squares make of them.

    Args:
        calls: What the source gave, in order, all of one kind.
        start: Posture before, shape (n,) [rad].
        period: Time for which the last velocity is held [s].
        kinematics: Kinematics of the arm.

    Returns:
        Times, increasing, shape (k,) [s], and positions, shape (k, n) [rad]; NaN where a target
        was no number.
    """
    times, rows = list[float](), list[Array]()
    ends = [*(call.time for call in calls[1:]), np.inf]
    for call, end in zip(calls, ends, strict=True):
        # What is late already is commanded at once.
        for t, row in zip(np.maximum(call.times, call.time).tolist(), call.values, strict=True):
            if t > end - _INSTANT:
                break
            if times and t < times[-1] + _INSTANT:
                rows[-1] = row
            else:
                times.append(t)
                rows.append(row)
    kind = calls[0].kind if calls else "positions"
    time, values = np.array(times), np.array(rows).reshape(len(rows), -1)
    if kind == "positions" or not len(time):
        return time, values.reshape(-1, start.size)
    if kind == "poses":
        return time, _postures(values, start, kinematics)
    postures = [start]
    for held, row in zip(np.diff(time, append=time[-1] + period).tolist(), values, strict=True):
        way = np.nan_to_num(held * row)
        step = way if kind == "velocities" else joint_step(kinematics, postures[-1], way)
        postures.append(postures[-1] + step)
    return np.append(time, time[-1] + period), np.array(postures)


def _postures(poses: Array, start: Array, kinematics: ArmKinematics) -> Array:
    """Return postures in which the tool is in poses, shape (k, n) [rad]; NaN where one has it."""
    q, postures = start, np.full((len(poses), start.size), np.nan)
    for number, pose in enumerate(poses):
        if not np.isfinite(pose).all():
            continue
        R_WE, p_WE = pose_of(pose)
        for _ in range(_ROUNDS):
            turn = rotation_error(kinematics.R_WE(q), R_WE)
            q = q + joint_step(
                kinematics, q, np.concatenate((turn, p_WE - kinematics.p_WE(q))), _ROUND_DAMPING
            )
        postures[number] = q
    return postures


def joint_step(kinematics: ArmKinematics, q: Array, way: Array, damping: float = DAMPING) -> Array:
    """Return a step of the joints that moves the tool, by damped least squares, shape (n,) [rad].

    Args:
        kinematics: Kinematics of the arm.
        q: Joint positions, shape (n,) [rad].
        way: Rotation vector and way of E in W, shape (6,) [rad, m].
        damping: Damping [m^2].
    """
    J = np.vstack((kinematics.J_omega(q), kinematics.J(q)))
    return np.asarray(J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), way))


def pose_of(X_WE: Array) -> tuple[Array, Array]:
    """Return orientation and position of a pose of `Shield.follow_poses`, whose length may be off.

    Args:
        X_WE: Position and quaternion, shape (7,).
    """
    # By hand: it is made every period, and Drake's classes cost four times as much.
    w, x, y, z = (X_WE[3:] / np.sqrt(X_WE[3:] @ X_WE[3:])).tolist()
    R_WE = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.array(R_WE), X_WE[:3]


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
        command=limit_uses(times, positions, limits, start),
        command_nearest=command_nearest,
        stopped=float(step[stands].sum()),
        outside=float(limits.violation(start).max()),
    )


def rows_of(report: StreamReport, joints: tuple[str, ...]) -> list[tuple[str, str, str]]:
    """Return rows of a table: what is told, of the targets and of the commands.

    Args:
        report: The report.
        joints: Names of the joints.
    """
    chunks = f" in {report.chunks} chunks" if report.chunks else ""
    rows = [
        (report.kind, f"{report.targets}{chunks}, {report.invalid} no numbers", ""),
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
        source_text, command_text = (
            "" if each is None else distance_text(each) for each in approaches
        )
        rows.append(("least distance", source_text, command_text))
    if report.outside:
        rows.append(("outside at the start", "", f"{report.outside:.3g} rad, re-entered"))
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
    if use.first is not None and use.first_joint is not None and use.first < use.at:
        where += f", first {joints[use.first_joint]} at {use.first:.3g} s"
    time = f", {100.0 * use.share:.3g} % of the time" if use.share else ""
    return text + where + time


def distance_text(nearest: ClosestApproach) -> str:
    """Return a least distance in words."""
    return f"{1e3 * nearest.distance:.3g} mm, {' and '.join(nearest.pair)} at {nearest.at:.3g} s"
