"""What a source asks for, what would have stopped the robot, and what a shield made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits

# Share of a limit at which it counts as reached, and beyond which it is broken.
_AT, _BEYOND = 1.0 - 1e-6, 1.0 + 1e-6
# A joint that is this far behind wants to move [rad]; one that is slower than this stands [rad/s].
_WANTS, _SLOW = 0.02, 1e-3
_ORDERS = ("velocity", "acceleration", "jerk")


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
        outside: How far the arm stood outside its position limits at the start [rad]. That it is
            brought back is no violation.
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
    speed = np.abs(np.diff(positions, axis=0, prepend=positions[:1])).max(axis=1)
    stands = (error > _WANTS) & (speed <= _SLOW * step)
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
    time = f", {100.0 * use.share:.3g} % of the time" if use.share else ""
    return text + where + time


def _distance(nearest: ClosestApproach) -> str:
    return f"{1e3 * nearest.distance:.3g} mm, {' and '.join(nearest.pair)} at {nearest.at:.3g} s"
