"""What a source asked for, what would have stopped the robot, and what a shield made of it."""

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
    uses = [_use("position", joint, beyond[k, joint], t[k], outside, beyond[k, joint] > 1e-9)]
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
        share = (ratio >= _AT).any(axis=1).mean()
        uses.append(_use(name, joint, ratio[k, joint], times[k], share, ratio[k, joint] > _BEYOND))
    return tuple(uses)


def _use(name: str, *values: object) -> LimitUse:
    joint, largest, at, share, is_broken = values
    return LimitUse(
        name,
        int(joint),  # type: ignore[call-overload]
        float(largest),  # type: ignore[arg-type]
        float(at),  # type: ignore[arg-type]
        float(share),  # type: ignore[arg-type]
        bool(is_broken),
    )


@dataclass(frozen=True)
class Nearest:
    """The least distance on a motion.

    Attributes:
        distance: The distance [m]; negative where two overlap.
        pair: Names of the two.
        at: When that is [s].
    """

    distance: float
    pair: tuple[str, str]
    at: float


def nearest_on(t: Array, q: Array, clearance: Clearance) -> Nearest:
    """Return the least distance on a motion that is straight between its points.

    Args:
        t: Times, increasing, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad].
        clearance: The pairs.
    """
    least = clearance.least_along(q)
    k = int(least.argmin())
    pair = int(clearance.gaps(q[k]).argmin())
    return Nearest(float(least[k]), clearance.names[pair], float(t[k]))


@dataclass(frozen=True)
class StreamReport:
    """A stream of joint targets, and what was commanded of it.

    Attributes:
        targets: Targets that came.
        invalid: Targets that had an entry that is no number.
        rate: Targets a second, by the median time between two.
        gap: Longest time without one [s].
        jump: Largest way of a joint between two targets [rad].
        asked: What the targets need of each limit, if they are commanded as they come.
        asked_nearest: The least distance on the way through the targets; None if none is looked at.
        commanded: What the commands need of each limit.
        commanded_nearest: The least distance on their way.
        error_rms: Root mean square of the largest difference of a joint from the newest target
            [rad].
        error_max: The largest such difference [rad].
        stopped: Time for which the arm stood although it was behind [s].
    """

    targets: int
    invalid: int
    rate: float
    gap: float
    jump: float
    asked: tuple[LimitUse, ...]
    asked_nearest: Nearest | None
    commanded: tuple[LimitUse, ...]
    commanded_nearest: Nearest | None
    error_rms: float
    error_max: float
    stopped: float

    @property
    def would_trip(self) -> tuple[str, ...]:
        """What would have stopped the robot: the limits that the targets break, and a contact."""
        names = tuple(use.name for use in self.asked if use.is_broken)
        touches = self.asked_nearest is not None and self.asked_nearest.distance <= 0.0
        return (*names, *(("contact",) if touches else ()))


def report_stream(
    targets: tuple[Array, Array],
    commands: tuple[Array, Array],
    start: Array,
    limits: JointLimits,
    clearance: Clearance | None = None,
) -> StreamReport:
    """Return what a source asked for and what was commanded.

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
    return StreamReport(
        targets=len(t),
        invalid=int((~whole).sum()),
        rate=float(1.0 / np.median(spacing)) if spacing.size else 0.0,
        gap=float(spacing.max(initial=0.0)),
        jump=float(np.abs(np.diff(way, axis=0)).max(initial=0.0)),
        asked=limit_uses(t_whole, q_whole, limits) if len(t_whole) else (),
        asked_nearest=None
        if clearance is None or not len(t_whole)
        else nearest_on(t_whole, q_whole, clearance),
        commanded=limit_uses(times, positions, limits),
        commanded_nearest=None if clearance is None else nearest_on(times, positions, clearance),
        error_rms=float(np.sqrt(np.mean(error**2))),
        error_max=float(error.max()),
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
    asked = {use.name: use for use in report.asked}
    done = {use.name: use for use in report.commanded}
    for name in ("position", *_ORDERS):
        if name in done:
            rows.append((name, _told(asked.get(name), joints), _told(done[name], joints)))
    for nearest, column in ((report.asked_nearest, 1), (report.commanded_nearest, 2)):
        if nearest is not None and column == 1:
            other = report.commanded_nearest
            rows.append(("least distance", _distance(nearest), (other and _distance(other)) or ""))
    rows.append(
        ("difference", "", f"{report.error_rms:.3g} rad rms, {report.error_max:.3g} at most")
    )
    rows.append(("stood though behind", "", f"{report.stopped:.3g} s"))
    return rows


def _told(use: LimitUse | None, joints: tuple[str, ...]) -> str:
    if use is None:
        return ""
    if use.name == "position":
        text = f"{max(use.largest, 0.0):.3g} rad beyond" if use.is_broken else "kept"
    else:
        text = f"{use.largest:.3g} of the limit"
    where = f", {joints[use.joint]} at {use.at:.3g} s" if use.is_broken else ""
    time = f", {100.0 * use.share:.3g} % of the time" if use.share else ""
    return text + where + time


def _distance(nearest: Nearest) -> str:
    return f"{1e3 * nearest.distance:.3g} mm, {' and '.join(nearest.pair)} at {nearest.at:.3g} s"
