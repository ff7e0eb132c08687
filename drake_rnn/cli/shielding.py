"""A recorded stream of targets behind a shield: what it asks for, and what is commanded."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any
from warnings import catch_warnings, filterwarnings

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError, UnprotectedWarning
from ..experiment import Experiment, make_experiment, read_document
from ..experiment.components import Arms
from ..experiment.files import set_key
from ..inputs.documents import construct
from ..inputs.fields import Array, is_vector
from ..inputs.messages import plural
from ..laws.guard import StreamGuard
from ..live.controls import with_speed
from ..live.session import Session
from ..live.shielded import DraggedShield, drawn_document
from ..paths.joint_targets import RecordedTargets
from ..paths.recordings import MOST_ROWS, RecordedCall
from ..robot.arm import Arm
from ..robot.load_arm import FrameMissingError
from ..robot.postures import proposed_home
from ..runs.folder import make_folder, require_fillable, written_whole
from ..runs.result import Result
from ..runs.simulation import effort_of, require_effort
from ..shield import Shield as PolicyShield
from ..shield import ShieldSettings
from ..shield.arms import checked_names
from ..shield.chunks import Counts, RecordedSource, WayBehind
from ..shield.report import (
    Sample,
    ShieldRecord,
    ShieldSummary,
    StreamReport,
    distance_text,
    record_of,
    report_stream,
    rows_of,
    series_of,
    source_motion,
)
from ..signals import DESIRED_POSITION
from .arguments import Shield
from .console import err, errors, finish, out, print_table, status
from .driving import serve
from .saving import Pictures, changes_of, run_and_write, simulate_or_print
from .shielding_arms import (
    NAMES,
    ArmCalls,
    DualArmStream,
    calls_by_arm,
    follow_by_arm,
    with_counts,
)

#: File of a run's folder with what the stream asked for and what was commanded.
REPORT = "stream.json"
#: File with the commands of two arms.
COMMANDS = "commands.csv"
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
    with catch_warnings(action="ignore", category=UnprotectedWarning):
        # Warnings of the experiment tell it.
        _shield(args)


def _shield(args: Shield) -> None:
    if args.file is None:
        _drag(args)
        return
    with errors():
        source = _source(args)
        if by_arm := source.by_arm:
            _follow_arms(args, source, by_arm)
            return
    with errors(), _stream(source) as stream:
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
        told["dropped_poses"] = [
            {**pose._asdict(), "X_WE": pose.X_WE.tolist()} for pose in stream.record.dropped
        ]
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
        document = {**drawn_document(Path(args.arm).stem, args.arm, period), "obstacles": []}
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
    own = dict[str, Any]()
    for key, each in every.items():
        if key.startswith(_OWN):
            set_key(own, key.removeprefix(_OWN), each)
    return own, {key: each for key, each in every.items() if not key.startswith(_OWN)}


@dataclass(frozen=True)
class _Source:
    """A file of targets, and the arm that they are for.

    Attributes:
        document: Contents of the document of a stream of single joint targets.
        changes: Changes of these.
        own: Changes of the shield's settings.
        contents: Contents of the document with the changes.
        recorded: The targets.
        arm: The arm.
    """

    document: dict[str, Any]
    changes: dict[str, Any]
    own: dict[str, Any]
    contents: dict[str, Any]
    recorded: RecordedTargets
    arm: Arm

    @cached_property
    def by_arm(self) -> dict[str, ArmCalls]:
        """What is for each of two arms; empty if columns name no arms."""
        if self.arm.description.pair is None:
            return {}
        names = self.own.get("names", NAMES)
        rest = _rest_of(self.contents, self.arm)
        return calls_by_arm(self.recorded, self.arm, checked_names(names), rest)

    def settings(self, own: Mapping[str, Any]) -> ShieldSettings:
        """Return the settings of its shield, with changes of these."""
        return construct(ShieldSettings, {"record": True, "compiled": False, **own}, "shield")

    def begin(self, start: Array | None, calls: Sequence[RecordedCall]) -> None:
        """Complete the document: where the arm begins, and until when it is followed."""
        if "start" not in self.contents and start is not None:
            self.document["start"] = start.tolist()
        if "duration" not in self.changes and calls:
            # What begins later is refused when it comes.
            last = max(min(float(call.times[-1]), call.time + _LONGEST) for call in calls)
            last = max(last, *(call.time for call in calls))
            self.document["duration"] = round(last + _REST, 3)


def _source(args: Shield) -> _Source:
    """Return the stream of a file."""
    assert args.file is not None
    period = _PERIOD if args.period is None else args.period
    if not args.file.is_file():
        raise InvalidInputError(f"FILE: no file {str(args.file)!r}")
    own, changes = _own_changes(args.changes)
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
    return _Source(document, changes, own, contents, recorded, _arm_of(contents["arm"]))


@contextmanager
def _stream(source: _Source) -> Iterator[_Stream]:
    """Follow the stream, and yield what came of it as an experiment; until a second after it."""
    document, changes, arm, own = source.document, source.changes, source.arm, source.own
    settings, recorded = source.settings(own), source.recorded
    try:
        calls, notes = recorded.calls(arm.joints, arm.units, _rest_of(source.contents, arm))
    except InvalidInputError as error:
        if arm.description.pair is None:
            raise
        by_arm = " and ".join(f"{name}/q1 ..." for name in NAMES)
        raise InvalidInputError(f"{error}; or columns by arm, {by_arm}") from None
    _require_seconds(calls, recorded.file)
    source.begin(_first_row(calls, arm) if "start" not in source.contents else None, calls)
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
        file = Path(place) / f"{document['name']}_followed.csv"
        yield _shielded(document, changes, (calls, notes), settings, file)


def _follow_arms(args: Shield, source: _Source, by_arm: Mapping[str, ArmCalls]) -> None:
    """Put a stream of two arms behind a shield of both, and print and keep what came of it."""
    if args.live:
        raise InvalidInputError("--live: must be left out; a stream of two arms is not played")
    own = {key: each for key, each in source.own.items() if key not in ("names", "yields")}
    settings, yields = source.settings(own), source.own.get("yields")
    for each in by_arm.values():
        _require_seconds(each.calls, source.recorded.file)
    source.begin(
        _start_of_arms(source, by_arm), [c for each in by_arm.values() for c in each.calls]
    )
    with tempfile.TemporaryDirectory() as place:
        base, _, _ = _base(source.document, source.changes, Path(place) / "start.csv")
    stream = follow_by_arm(base, by_arm, settings, yields, source.recorded.file)
    notes = (note for each in by_arm.values() for note in each.notes)
    for text in (*notes, *base.warnings):
        err.print(escape(f"warning {text}"), soft_wrap=True)
    folder, joints = args.out_folder / source.document["name"], base.arm.joints
    require_fillable(folder)
    make_folder(folder)
    with written_whole(folder / REPORT) as file:
        file.write(json.dumps(stream.as_data(joints), indent=1) + "\n")
    _write(folder / COMMANDS, joints, stream.record.time, stream.record.command)
    _print_arms(stream, by_arm, settings.stale)
    out.print(escape(f"stream    {folder / REPORT}"), soft_wrap=True)
    out.print(escape(f"commands  {folder / COMMANDS}"), soft_wrap=True)


def _start_of_arms(source: _Source, by_arm: Mapping[str, ArmCalls]) -> Array | None:
    """Return where two arms begin: each at its first joint positions, else at home."""
    if "start" in source.contents:
        return None
    home, rows = source.arm.home, {}
    for name, each in by_arm.items():
        limits = source.arm.limits.select(range(source.arm.n)[each.block])
        first = _first_positions(each.calls)
        if first is None or limits.violation(first).any():
            first = None if home is None else home[each.block]
        rows[name] = first
    if missing := [name for name, row in rows.items() if row is None]:
        raise InvalidInputError(
            f"start: must be given, the posture that both arms rest in: the model has no home, and "
            f"what {missing[0]} is sent does not begin with joint positions within the limits"
        )
    return np.concatenate([row for row in rows.values() if row is not None])


def _arm_section(args: Shield) -> dict[str, Any]:
    """Return the section of the arm of a document."""
    return {"model": args.arm} | ({} if args.frame is None else {"frame": args.frame})


def _arm_of(section: Mapping[str, Any]) -> Arm:
    """Return the arm of a section, or raise an InvalidInputError that says all that it needs."""
    try:
        return Arms().of(section)
    except FrameMissingError as error:
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
    first = _first_positions(calls)
    beyond = np.zeros(0) if first is None else arm.limits.violation(first)
    if first is not None and not beyond.any():
        return first
    if arm.home is None:
        begins = ""
        if first is not None:
            joint = int(beyond.argmax())
            bounds = arm.limits.position_lower[joint], arm.limits.position_upper[joint]
            begins = (
                f"targets: begin with {arm.joints[joint]} at {first[joint]:.4g}, which may be "
                f"{bounds[0]:.4g} to {bounds[1]:.4g}; for degrees give targets.angles: degrees, or "
                "[deg] in columns' names; otherwise "
            )
        proposed = np.round(proposed_home(arm), 3).tolist()
        raise InvalidInputError(
            f"{begins}start: must be given, the posture that the arm rests in: its model has no "
            "home, and the stream does not begin with joint positions within the limits; such as "
            f"--set start={proposed}"
        )
    return None


def _first_positions(calls: Sequence[RecordedCall]) -> Array | None:
    """Return the joint positions that calls begin with, shape (n,) [rad]; None of other targets."""
    for call in calls:
        rows = call.values[np.isfinite(call.values).all(axis=1)]
        if len(rows):
            return rows[0] if call.kind == "positions" else None
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


def _base(
    document: Mapping[str, Any], changes: Mapping[str, Any], file: Path
) -> tuple[Experiment, dict[str, Any], dict[str, Any]]:
    """Return an experiment of an arm at rest, its document, and the changes of that.

    Args:
        document: Contents of the document of a stream of single joint targets.
        changes: Changes of these.
        file: Where the posture is written that the arm rests in.
    """
    inner = {key: each for key, each in changes.items() if key.split(".")[0] != "targets"}
    arm = Arms().of(read_document(document, inner)["arm"])
    _write(file, arm.joints, np.zeros(1), _rest_of(document, arm)[None])
    document = {**document, "targets": {"file": str(file)}}
    base = make_experiment(read_document(document, inner))
    assert base.document.period is not None
    _require_room(base.document.duration, base.document.period)
    return base, document, inner


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
    source = str(document["targets"]["file"])
    base, document, inner = _base(document, changes, file)
    assert base.document.period is not None
    follower = PolicyShield(
        base.arm,
        base.document.period,
        settings,
        start=base.start,
        obstacles=list(base.document.obstacles or []),
        collisions=base.clearance is not None,
    )
    with status(_FOLLOWING), catch_warnings():
        # They are told below, all together.
        filterwarnings("ignore", "X_WE: ")
        record, leading = _play(follower, RecordedSource(calls, source), base)
    counts = follower.counts
    dropped = [*_dropped(counts, settings.stale), *_dropped_poses(record, counts)]
    if dropped and not np.isfinite(leading).any():
        raise InvalidInputError(f"targets: none can be followed: {'; '.join(dropped)}")
    _write(file, base.arm.joints, record.time, leading)
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


def _dropped_poses(record: ShieldRecord, counts: Counts) -> list[str]:
    """Return what a filter has dropped of poses, and why."""
    texts, reasons = list[str](), Counter(pose.reason for pose in record.dropped)
    for reason, count in reasons.items():
        first = next(pose for pose in record.dropped if pose.reason == reason)
        name = reason.replace("_", " ")
        texts.append(
            f"{plural(count, 'pose')} {name}, the first at {first.time:.4g} s: {first.text}"
        )
    if counts.losses:
        texts.append(f"tracking was lost {plural(counts.losses, 'time')}")
    return texts


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
    return replace(with_counts(report, calls), stopped=record.summary.stopped)


def _print(report: StreamReport, stream: _Stream) -> None:
    _print_report(report, stream.experiment.arm.joints, stream.dropped)
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
    _print_summary(stream.record.summary, stream.experiment.arm.joints)


def _print_arms(stream: DualArmStream, by_arm: Mapping[str, ArmCalls], stale: float) -> None:
    """Print a table of each arm, and what both have in common."""
    for name, report in stream.reports.items():
        title = (f"{name}: the source's targets", "the shield's commands")
        dropped = _dropped(stream.counts[name], stale)
        _print_report(report, by_arm[name].arm.joints, dropped, title)
    asked = stream.asked_nearest
    of_source = "" if asked is None else f"; of the targets alone {distance_text(asked)}"
    out.print(escape(f"distance  {distance_text(stream.nearest)}{of_source}"), soft_wrap=True)
    joints = [joint for each in by_arm.values() for joint in each.arm.joints]
    _print_summary(stream.record.summary, joints)


def _print_report(
    report: StreamReport,
    joints: Sequence[str],
    dropped: Sequence[str],
    titles: tuple[str, str] = ("the source's targets", "the shield's commands"),
) -> None:
    """Print what was asked for and commanded, what was dropped, and what would have tripped."""
    table = Table(box=SIMPLE_HEAD)
    for title in ("", *titles):
        table.add_column(title)
    for row in rows_of(report, tuple(joints)):
        table.add_row(*map(escape, row))
    print_table(table)
    if dropped:
        out.print(escape(f"dropped   {'; '.join(dropped)}"), soft_wrap=True)
    trips = ", ".join(report.would_trip) or "nothing"
    out.print(escape(f"trips     {trips} would have stopped the robot without it"), soft_wrap=True)


def _print_summary(summary: ShieldSummary, joints: Sequence[str]) -> None:
    """Print what intervened, and how far the arm was off."""
    by = list(summary.rows(joints))
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
