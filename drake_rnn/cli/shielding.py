"""A recorded stream of targets behind a shield: what it asks for, and what is commanded."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..experiment import Experiment, make_experiment, read_document
from ..experiment.components import Arms
from ..inputs.documents import construct
from ..inputs.fields import Array, is_vector
from ..inputs.messages import plural
from ..laws.guard import StreamGuard
from ..live.controls import with_speed
from ..live.session import Session
from ..live.shielded import DraggedShield, drawn_document
from ..paths.joint_targets import RecordedTargets
from ..paths.recordings import MOST_ROWS, RecordedCall
from ..robot.arm import Arm, shipped_arms
from ..robot.postures import proposed_home
from ..runs.folder import written_whole
from ..runs.result import Result
from ..runs.simulation import effort_of, require_effort
from ..shield import Shield as PolicyShield
from ..shield import ShieldSettings
from ..shield.chunks import Counts, RecordedSource, WayBehind
from ..shield.report import (
    Sample,
    ShieldRecord,
    StreamReport,
    record_of,
    report_stream,
    rows_of,
    series_of,
    source_motion,
)
from ..signals import DESIRED_POSITION
from .arguments import Shield
from .console import errors, finish, out, print_table, status
from .driving import serve
from .saving import Pictures, changes_of, run_and_write, simulate_or_print

#: File of a run's folder with what the stream asked for and what was commanded.
REPORT = "stream.json"
# Time that is left after the last target [s].
_REST = 1.0
# Period of commands, and of those that are played with [s].
_PERIOD, _PERIOD_LIVE = 1e-3, 5e-3
# Speed of obstacles that are dragged, where they have none [m/s].
_SPEED = 0.1
# Longest chunk by which a run is longer [s].
_LONGEST = 60.0
# Rows between which is more time than this are hardly meant so [s].
_SPARSE = 10.0
# Commands that differ by less are the same [rad].
_SAME = 1e-9
# What begins the names of metrics of the targets that a law follows.
_OF_TARGETS = ("position_error", "velocity_error", "target_error", "joint_error")
# What takes about 2 ms a command, by NumPy.
_FOLLOWING = "following the stream"
# What begins the keys of changes that are of the shield, and not of the document.
_OWN = "shield."


@dataclass(frozen=True)
class _Stream:
    """A stream that is followed, as an experiment.

    Attributes:
        experiment: The experiment.
        calls: What the source gave.
        record: What was made of it.
        leads: Whether the experiment's targets lead the arm, and are not the source's.
        dropped: What of the source was not followed, and why, in words.
        counts: The same in numbers; None of single joint targets.
    """

    experiment: Experiment
    calls: Sequence[RecordedCall]
    record: ShieldRecord
    leads: bool = False
    dropped: Sequence[str] = ()
    counts: Counts | None = None


def shield(args: Shield) -> None:
    """Run the stream behind a guard, and print what would have stopped the robot."""
    if args.file is None:
        _drag(args)
        return
    with errors(), _stream(args) as stream:
        experiment = stream.experiment
        if args.live:
            session = Session(experiment, _SPEED)
            place = "localhost", args.port
            serve(session, session.warnings, args.out_folder, place, lambda: stream.record)
            return
        folder = args.out_folder / experiment.name
        pictures = Pictures(args.figures, args.playback)
        reports = list[StreamReport]()
        result = run_and_write(lambda: _judged(stream, reports), folder, pictures)
        (report,) = reports
        _print(report, stream)
        summary = stream.record.summary.as_data(experiment.arm.joints)
        counts = None if stream.counts is None else asdict(stream.counts)
        promises = [each.contents for each in result.promises]
        told = {**asdict(report), "promises": promises, "shield": summary, "counts": counts}
        with written_whole(folder / REPORT) as file:
            file.write(json.dumps(told, indent=1) + "\n")
        out.print(escape(f"stream    {folder / REPORT}"), soft_wrap=True)
    finish(result.status == "complete", True)


def _drag(args: Shield) -> None:
    """Play with a shield whose source leads the tool to where a hand drags it."""
    with errors():
        if not args.live:
            raise InvalidInputError("FILE: must be given, or --live to drag a target")
        own, changes = _own_changes(args.changes)
        period = _PERIOD_LIVE if args.period is None else args.period
        document = {**drawn_document(args.arm, args.arm, period), "obstacles": []}
        document["arm"] = _arm_section(args)
        contents = read_document(document, changes)
        contents["obstacles"] = with_speed(contents["obstacles"] or [], _SPEED)
        experiment = make_experiment(contents)
        assert experiment.document.period is not None
        make = partial(
            PolicyShield,
            experiment.arm,
            experiment.document.period,
            construct(ShieldSettings, own, "shield"),
            start=experiment.start,
            obstacles=contents["obstacles"],
        )
        with status("building the shield"):
            session = DraggedShield(make, experiment)
        out.print(escape(f"steps     {session.shield.steps}"), soft_wrap=True)
    place = "localhost", args.port
    serve(session, experiment.warnings, args.out_folder, place, lambda: session.record)


def _own_changes(texts: list[str] | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the changes of a shield's settings, and those of the document."""
    every = changes_of(texts)
    own = {key.removeprefix(_OWN): each for key, each in every.items() if key.startswith(_OWN)}
    return own, {key: each for key, each in every.items() if not key.startswith(_OWN)}


@contextmanager
def _stream(args: Shield) -> Iterator[_Stream]:
    """Follow the stream, and yield what came of it as an experiment; until a second after it."""
    assert args.file is not None
    period = _PERIOD if args.period is None else args.period
    if not args.file.is_file():
        raise InvalidInputError(f"FILE: no file {str(args.file)!r}")
    own, changes = _own_changes(args.changes)
    settings = construct(ShieldSettings, {"record": True, "compiled": False, **own}, "shield")
    document: dict[str, Any] = {
        "name": args.file.stem,
        "arm": _arm_section(args),
        "targets": {"file": str(args.file)},
        "law": {"kind": "joint_stream"},
        "period": period,
        "log_period": period,
        "duration": 1.0,
    }
    contents = read_document(document, changes)
    recorded = construct(RecordedTargets, contents["targets"], "targets")
    _require_frame(contents["arm"], args.arm)
    arm = Arms().of(contents["arm"])
    calls, notes = recorded.calls(arm.joints, arm.units, _rest_of(contents, arm))
    _require_seconds(calls, recorded.file)
    if "start" not in contents:
        start = _first_row(calls, arm)
        document |= {} if start is None else {"start": start.tolist()}
    if "duration" not in changes and calls:
        # What begins later is refused when it comes.
        last = max(min(float(call.times[-1]), call.time + _LONGEST) for call in calls)
        document["duration"] = round(max(last, calls[-1].time) + _REST, 3)
    single = all(call.kind == "positions" and len(call.times) == 1 for call in calls)
    if single and not own and not recorded.has_calls:
        experiment = make_experiment(read_document(document, changes))
        assert experiment.document.period is not None
        require_effort(effort_of(experiment.document), experiment.document.duration)
        with status(_FOLLOWING):
            record = _record_of_law(experiment)
        yield _Stream(experiment, calls, record)
        return
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / f"{args.file.stem}_followed.csv"
        yield _shielded(document, changes, (calls, notes), settings, file)


def _arm_section(args: Shield) -> dict[str, Any]:
    """Return the section of the arm of a document."""
    return {"model": args.arm} | ({} if args.frame is None else {"frame": args.frame})


def _require_frame(section: Mapping[str, Any], name: str) -> None:
    """Raise an InvalidInputError that says all that a model file needs, if its frame is missing."""
    if name in shipped_arms() or section.get("frame") is not None:
        return
    try:
        Arms().of(section)
    except InvalidInputError as error:
        if not str(error).startswith("arm.frame: must be given"):
            raise
        raise InvalidInputError(
            f"{error}; give --frame. Joint positions begin at their first row; for other targets "
            "give --set start=[...] as well, the posture that the arm rests in"
        ) from None


def _first_row(calls: Sequence[RecordedCall], arm: Arm) -> Array | None:
    """Return the first joint positions of a stream, where the arm begins, shape (n,) [rad].

    None for the arm's home, of other targets or where limits do not allow them.

    Raises:
        InvalidInputError: If the arm has no home either.
    """
    for call in calls:
        rows = call.values[np.isfinite(call.values).all(axis=1)]
        if call.kind == "positions" and len(rows) and not arm.limits.violation(rows[0]).any():
            return rows[0]
        if len(rows):
            break
    if arm.home is None:
        proposed = np.round(proposed_home(arm), 3).tolist()
        raise InvalidInputError(
            "start: must be given, the posture that the arm rests in: its model has no home, and "
            "the stream does not begin with joint positions within the limits; such as "
            f"--set start={proposed}"
        )
    return None


def _rest_of(contents: Mapping[str, Any], arm: Arm) -> Array:
    """Return the posture at the start, shape (n,) [rad]; if need be any that the limits allow."""
    if is_vector(start := contents.get("start")):
        return np.asarray(start, dtype=np.float64)
    if arm.home is not None:
        return arm.home
    return np.clip(np.zeros(arm.n), arm.limits.position_lower, arm.limits.position_upper)


def _require_seconds(calls: Sequence[RecordedCall], file: str) -> None:
    """Raise an InvalidInputError for times that are hardly in seconds."""
    times = np.unique(np.concatenate([call.times for call in calls] or [np.zeros(0)]))
    between = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if between > _SPARSE:
        raise InvalidInputError(
            f"targets: file {file}: its targets are {between:.4g} s apart, by the median; name the "
            "column of times t_ms if they are milliseconds"
        )


def _require_room(duration: float, period: float) -> None:
    """Raise an InvalidInputError for more commands than the file of an experiment may have rows."""
    if (count := duration / period) > MOST_ROWS - 1:
        raise InvalidInputError(
            f"duration: {duration:g} s are {count:.0f} commands, more than {MOST_ROWS}; give a "
            "longer --period, or targets.begin and duration"
        )


def _record_of_law(experiment: Experiment) -> ShieldRecord:
    """Return what the law of an experiment makes of single joint targets, when they come."""
    document, law, motions = experiment.document, experiment.law, experiment.motions
    assert experiment.targets is not None
    assert document.period is not None
    period, targets = document.period, experiment.targets
    times: Array = period * np.arange(round(document.duration / period) + 1, dtype=np.float64)
    newest, goals = targets.newest(times), targets.goals(times, experiment.start)
    p_WO = None if motions is None else motions.at(0.0)
    guard = StreamGuard(law, period, experiment.start, p_WO)
    samples, past = list[Sample](), WayBehind(experiment.arm.n)
    before = -1
    for t, new, goal in zip(times.tolist(), newest.tolist(), goals, strict=True):
        target = targets.position[new] if new != before else None
        q = guard.command(target, None if motions is None else motions.at(t))
        before, step = new, guard.last_step
        if t - past.newest >= past.step:
            past.add(t, goal)
        samples.append(Sample(t, goal, step.wanted, q, *past.nearest(q, t), step))
        samples[-1].explain()
    return record_of(samples, period, experiment.arm.joints, experiment.clearance)


def _shielded(
    document: dict[str, Any],
    changes: Mapping[str, Any],
    given: tuple[Sequence[RecordedCall], Sequence[str]],
    settings: ShieldSettings,
    file: Path,
) -> _Stream:
    """Return what a shield makes of a stream, as an experiment of the targets that lead its arm.

    Args:
        document: Contents of the document of a stream of single joint targets.
        changes: Changes of these.
        given: What the source gave, and what is told of it.
        settings: Settings of the shield.
        file: Where these targets are written.
    """
    if (laws := [key for key in changes if key.split(".")[0] == "law"]) != []:
        raise InvalidInputError(
            f"{laws[0]}: is the shield's own for such a stream; set {_OWN}lookahead and its like"
        )
    calls, notes = given
    inner = {key: each for key, each in changes.items() if key.split(".")[0] != "targets"}
    arm = Arms().of(read_document(document, inner)["arm"])
    _write(file, arm.joints, np.zeros(1), _rest_of(document, arm)[None])
    source = str(document["targets"]["file"])
    document = {**document, "targets": {"file": str(file)}}
    base = make_experiment(read_document(document, inner))
    assert base.document.period is not None
    _require_room(base.document.duration, base.document.period)
    follower = PolicyShield(
        base.arm,
        base.document.period,
        settings,
        start=base.start,
        obstacles=list(base.document.obstacles or []),
        collisions=base.clearance is not None,
    )
    with status(_FOLLOWING):
        record, leading = _play(follower, RecordedSource(calls, source), base)
    counts, dropped = follower.counts, _dropped(follower.counts, settings.stale)
    if dropped and not np.isfinite(leading).any():
        raise InvalidInputError(f"targets: none can be followed: {'; '.join(dropped)}")
    _write(file, arm.joints, record.time, leading)
    law = {"kind": "joint_stream", "pursues": True, "interval": follower.lookahead}
    law["timeout"] = 2.0 * follower.lookahead
    experiment = make_experiment(read_document({**document, "law": law}, inner))
    told = tuple(each for each in experiment.warnings if not each.startswith("targets: "))
    experiment = replace(experiment, warnings=(*notes, *told))
    return _Stream(experiment, calls, record, leads=True, dropped=dropped, counts=counts)


def _dropped(counts: Counts, stale: float) -> list[str]:
    """Return what of a source was not followed, and why."""
    reasons = {
        f"came more than {stale:g} s after the last target in it (shield.stale)": counts.expired,
        "began before one that had come earlier": counts.overtaken,
        "had no row of numbers": counts.empty,
    }
    messages = plural(counts.chunks, "message")
    return [f"{count} of {messages} {text}" for text, count in reasons.items() if count]


def _play(
    follower: PolicyShield, source: RecordedSource, base: Experiment
) -> tuple[ShieldRecord, Array]:
    """Return the record of a shield that was given a stream, and the targets that led the arm."""
    motions = base.motions
    count = round(base.document.duration / follower.period) + 1
    leading = np.full((count, base.arm.n), np.nan)
    for k in range(count):
        t = k * follower.period
        source.send(follower.follow, t)
        follower.command(t, None if motions is None else motions.at(t))
        if (target := follower.leading) is not None:
            leading[k] = target
    return follower.record, leading


def _write(file: Path, joints: Sequence[str], times: Array, rows: Array) -> None:
    """Write joint positions with their times."""
    lines = [",".join(("t", *joints))]
    for t, row in zip(times.tolist(), rows.tolist(), strict=True):
        lines.append(",".join(map(repr, (t, *row))))
    file.write_text("\n".join(lines) + "\n")


def _judged(stream: _Stream, reports: list[StreamReport]) -> Result:
    """Return the result of a run, headed by what its source would have done to the robot.

    Args:
        stream: The stream.
        reports: Where the report of it is put.
    """
    result = _run(stream)
    reports.append(report := _report(stream, result))
    trips = ", ".join(report.would_trip)
    would = (
        f"would have tripped the robot by {trips}" if trips else "would not have tripped the robot"
    )
    return replace(result, headline=f"the stream {would}")


def _run(stream: _Stream) -> Result:
    """Return the result of a run that has the record among its series."""
    result, record = simulate_or_print(stream.experiment), stream.record
    kinematics = stream.experiment.arm.kinematics()
    series = series_of(record, result.time, kinematics)
    axes = list(stream.experiment.task.axes)
    wanted = np.array([kinematics.p_WE(q)[axes] for q in series["position_wanted"]])
    series[DESIRED_POSITION] = wanted.reshape(-1, len(axes))
    metrics = result.metrics
    if stream.leads:
        # What leads the arm is ahead of what the source wants.
        metrics = {name: each for name, each in metrics.items() if not name.startswith(_OF_TARGETS)}
    return replace(result, series={**result.series, **series}, metrics=metrics)


def _report(stream: _Stream, result: Result) -> StreamReport:
    """Return the report of what the source asked for and of what was commanded."""
    experiment, record = stream.experiment, stream.record
    calls = [call for call in stream.calls if call.time <= result.time[-1]]
    kinematics = experiment.arm.kinematics()
    motion = source_motion(calls, experiment.start, record.period, kinematics)
    commanded = result.series.get("position_commanded", result.series["position"])
    report = report_stream(
        motion,
        (result.time, commanded),
        experiment.start,
        experiment.limits,
        experiment.clearance,
    )
    kind = calls[0].kind if calls else "positions"
    targets = sum(len(call.times) for call in calls)
    invalid = sum(int((~np.isfinite(call.values).all(axis=1)).sum()) for call in calls)
    stopped = record.summary.stopped
    told = replace(report, kind=kind, targets=targets, invalid=invalid, stopped=stopped)
    return replace(told, chunks=len(calls) if targets > len(calls) else 0)


def _print(report: StreamReport, stream: _Stream) -> None:
    table = Table(box=SIMPLE_HEAD)
    for title in ("", "the source's targets", "the shield's commands"):
        table.add_column(title)
    for row in rows_of(report, tuple(stream.experiment.arm.joints)):
        table.add_row(*map(escape, row))
    print_table(table)
    if stream.dropped:
        out.print(escape(f"dropped   {'; '.join(stream.dropped)}"), soft_wrap=True)
    trips = ", ".join(report.would_trip) or "nothing"
    out.print(escape(f"trips     {trips} would have stopped the robot without it"), soft_wrap=True)
    limits = stream.experiment.limits
    bounds = {"acceleration": limits.acceleration, "jerk": limits.jerk}
    unbounded = [name for name, bound in bounds.items() if bound is None]
    if unbounded:
        given = ", ".join(f"{name}: ..." for name in unbounded)
        out.print(
            escape(
                f"unbounded {' and '.join(unbounded)} of the commands: none is known of this arm; "
                f'give --set "limits={{{given}}}"'
            ),
            soft_wrap=True,
        )
    summary = stream.record.summary
    by = list(summary.rows(stream.experiment.arm.joints))
    text = ", ".join(f"{name} {time:.3g} s" for name, time in by[:_TOLD])
    more = f", and {len(by) - _TOLD} more" if len(by) > _TOLD else ""
    out.print(escape(f"limits    {text or 'nothing intervened'}{more}"), soft_wrap=True)
    most, rms, off_path, late = (
        f"{round(each, 6):.3g}"
        for each in (
            summary.largest_deviation,
            summary.rms_deviation,
            summary.largest_off_path,
            summary.largest_delay,
        )
    )
    out.print(
        f"off       by up to {most} rad from where the source wants it, {rms} rad rms; up to "
        f"{off_path} rad off its way and {late} s late",
        soft_wrap=True,
    )


# Limits and pairs that are named.
_TOLD = 5
