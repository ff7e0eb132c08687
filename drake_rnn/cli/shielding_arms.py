"""A recorded stream of targets of two arms behind a shield of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..paths.joint_targets import RecordedTargets
from ..paths.recordings import RecordedCall
from ..robot.arm import SECOND, Arm
from ..shield import ShieldSettings
from ..shield.arms import DualArmShield
from ..shield.chunks import Counts, RecordedSource
from ..shield.report import (
    ClosestApproach,
    ShieldRecord,
    StreamReport,
    closest_approach,
    report_stream,
    source_motion,
)

#: Names of the arms of a stream, if no others are given.
NAMES = ("left", "right")


@dataclass(frozen=True)
class ArmCalls:
    """What a source gave one of two arms.

    Attributes:
        arm: The arm.
        block: Its joints among those of both.
        calls: What it was given, in order; empty for an arm that was given nothing.
        notes: What is told of its columns.
    """

    arm: Arm
    block: slice
    calls: Sequence[RecordedCall]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class DualArmStream:
    """What a shield made of a stream of two arms.

    Attributes:
        record: What was wanted and commanded.
        reports: What was asked for and commanded, by the arms' names.
        counts: What of the chunks was not followed, likewise.
        asked_nearest: How near bodies would have come, of what was asked for; None for none.
        nearest: How near they came.
    """

    record: ShieldRecord
    reports: Mapping[str, StreamReport]
    counts: Mapping[str, Counts]
    asked_nearest: ClosestApproach | None
    nearest: ClosestApproach

    def as_data(self, joints: Sequence[str]) -> dict[str, Any]:
        """Return what is kept of it, as plain data."""
        return {
            "arms": {name: asdict(report) for name, report in self.reports.items()},
            "counts": {name: asdict(counts) for name, counts in self.counts.items()},
            "source_nearest": None if self.asked_nearest is None else asdict(self.asked_nearest),
            "command_nearest": asdict(self.nearest),
            "shield": self.record.summary.as_data(tuple(joints)),
        }


def calls_by_arm(
    recorded: RecordedTargets, pair: Arm, names: Sequence[str], rest: Array
) -> dict[str, ArmCalls]:
    """Return what a source gave each of two arms; empty if its columns name no arms.

    The joints of the second arm may have their names in the pair or those in its own model.

    Args:
        recorded: The stream.
        pair: Both arms.
        names: Their names.
        rest: Posture at the start, shape (n,) [rad].

    Raises:
        InvalidInputError: If columns are not those of the arms, or unclear.
    """
    own = [tuple(j.removeprefix(SECOND) for j in part.joints) for part in pair.parts]
    found = recorded.by_arm(dict(zip(names, own, strict=True)))
    blocks = slice(0, pair.begins[1]), slice(pair.begins[1], pair.n)
    by_arm = {}
    for name, part, block, joints in zip(names, pair.parts, blocks, own, strict=True):
        if name not in found:
            by_arm[name] = ArmCalls(part, block, [])
            continue
        targets, units = found[name], pair.units[block]
        joints = part.joints if targets.names & set(part.joints) else joints
        try:
            calls, notes = targets.calls(joints, units, rest[block])
        except InvalidInputError as error:
            raise InvalidInputError(f"{name}: {error}") from None
        by_arm[name] = ArmCalls(part, block, calls, notes)
    return by_arm if found else {}


def with_counts(report: StreamReport, calls: Sequence[RecordedCall]) -> StreamReport:
    """Return a report with what kind of targets a source gave, and how many."""
    count = sum(len(call.times) for call in calls)
    return replace(
        report,
        kind=calls[0].kind if calls else "positions",
        targets=count,
        invalid=sum(int((~np.isfinite(call.values).all(axis=1)).sum()) for call in calls),
        chunks=len(calls) if count > len(calls) else 0,
    )


def follow_by_arm(
    base: Experiment,
    by_arm: Mapping[str, ArmCalls],
    settings: ShieldSettings,
    yields: str | None,
    file: str,
) -> DualArmStream:
    """Return what a shield of two arms makes of a stream.

    Args:
        base: An experiment of both arms, with their limits, start and obstacles.
        by_arm: What the source gave, by the arms' names.
        settings: How the shield follows it.
        yields: See `DualArmShield`.
        file: Where the stream is from, for messages.

    Raises:
        InvalidInputError: If targets cannot be meant as they stand.
    """
    period, motions = base.document.period, base.motions
    assert period is not None
    first, second = by_arm
    shield = DualArmShield(
        base.arm,
        period,
        settings,
        names=(first, second),
        yields=yields,
        start=base.start,
        obstacles=list(base.document.obstacles or []),
    )
    sources = {name: RecordedSource(each.calls, file) for name, each in by_arm.items()}
    for t in (period * np.arange(round(base.document.duration / period) + 1)).tolist():
        for name, source in sources.items():
            source.send(shield[name].follow, t)
        shield.command(t, None if motions is None else motions.at(t))
    record, reports, motion = shield.record, dict[str, StreamReport](), {}
    for name, each in by_arm.items():
        start, limits = base.start[each.block], base.limits.select(range(base.arm.n)[each.block])
        motion[name] = source_motion(each.calls, start, period, each.arm.kinematics())
        commands = record.time, record.command[:, each.block]
        reports[name] = with_counts(
            report_stream(motion[name], commands, start, limits), each.calls
        )
    asked = _together([motion[name] for name in by_arm], base.start, by_arm)
    clearance = shield.clearance
    return DualArmStream(
        record,
        reports,
        {name: shield[name].counts for name in by_arm},
        closest_approach(*asked, clearance) if len(asked[0]) else None,
        closest_approach(record.time, record.command, clearance),
    )


def _together(
    motions: Sequence[tuple[Array, Array]], start: Array, by_arm: Mapping[str, ArmCalls]
) -> tuple[Array, Array]:
    """Return where both arms were wanted whenever one of them was: times, and positions."""
    whole = [(t[ok], q[ok]) for t, q in motions for ok in [np.isfinite(q).all(axis=1)]]
    times = np.unique(np.concatenate([t for t, _ in whole]))
    blocks = [each.block for each in by_arm.values()]
    return times, np.hstack(
        [
            np.vstack((start[block], q))[np.searchsorted(t, times, side="right")]
            for (t, q), block in zip(whole, blocks, strict=True)
        ]
    )
