"""The result of a run: its series, metrics and verdicts.

- A metric of a run, and the bound that it is expected to keep.
- Metrics as readers see them: names in words, values and bounds with units that suit them.
"""

from __future__ import annotations

import errno
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any, get_args
from warnings import warn

import numpy as np
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..experiment import COUNTED_LIMITS, Experiment, expected_bounds, make_experiment
from ..experiment.document import Acceptance
from ..experiment.files import written_head
from ..inputs.documents import read_yaml, to_yaml, without_extensions
from ..inputs.fields import Array, checked, instance
from ..inputs.files import heads_of
from ..inputs.kinds import Modules
from ..inputs.messages import fields_of, require_type
from ..inputs.packages import html_table, html_views, versions
from ..inputs.processes import run_uninterrupted
from ..laws.guarantee import Promise
from ..measures import METRICS, format_quantity
from ..paths import Path as MotionPath
from ..signals import DESIRED_POSITION
from .checkpoint import can_go_on, forget, require_ended, size_of
from .enclosure import (
    Enclosure,
    enclosure_of,
    find_files,
    missing_files,
    replace_files,
    stand_ins,
)
from .folder import (
    Status,
    fill_folder,
    graph_of,
    metrics_of,
    read_file,
    read_record,
    room_in,
    series_of,
    told_in,
)
from .series import SECOND, RunOptions, columns_of, frame_of


@dataclass(frozen=True)
class Verdict:
    """A metric beside the bound that it is expected to keep.

    Attributes:
        metric: Name of the metric.
        bound: The bound.
        value: Its value; None if the run does not have it, as when it did not settle.
        judged: Whether the run came to its end; a part of a run keeps no bound.
    """

    metric: str
    bound: Acceptance
    value: float | None
    judged: bool = True

    @property
    def met(self) -> bool:
        """Whether the bound is kept, by a run that came to its end."""
        return self.judged and self.value is not None and self.bound.holds(self.value)

    @property
    def word(self) -> str:
        """The verdict in a word: ``ok``, ``no`` or ``not judged``."""
        return ("ok" if self.met else "no") if self.judged else NOT_JUDGED


#: What is said of a bound where the run did not come to its end.
NOT_JUDGED = "not judged"


def verdicts_of(
    experiment: Experiment, metrics: Mapping[str, float], complete: bool = True
) -> list[Verdict]:
    """Return the metrics of a run that are expected to keep bounds, with their bounds.

    These are the document's ``accept``, and the limits that the law keeps by construction as far as
    the run has metrics of them.

    Args:
        experiment: What was run.
        metrics: Its metrics.
        complete: Whether it came to its end; otherwise no bound is kept.
    """
    accept = experiment.document.accept
    return [
        Verdict(name, bound, metrics.get(name), complete)
        for name, bound in expected_bounds(experiment).items()
        if name in metrics or name in accept
    ]


def criteria_text(verdicts: Sequence[Verdict], met: str = "criteria met") -> str:
    """Return in words how many criteria are met, or that they are not judged.

    Args:
        verdicts: The criteria.
        met: What follows the numbers where they are judged.
    """
    if all(verdict.judged for verdict in verdicts):
        return f"{sum(verdict.met for verdict in verdicts)} of {len(verdicts)} {met}"
    return f"{met.split()[0]} {NOT_JUDGED}"


def ending_text(status: str, until: float = 0.0) -> str:
    """Return how a run ended, in words; empty for one that came to its end.

    Every verdict, table, legend and page that shows a run says so by these words.

    Args:
        status: How it ended.
        until: Time that it reached [s].
    """
    if status == "complete":
        return ""
    return f"{status} at t = {until:.6g} s" if status in get_args(Status) else status


def name_with_ending(name: str, result: Result) -> str:
    """Return the name of a run, with how it ended if that was early."""
    return f"{name}: {result.ending}" if result.ending else name


# Largest size of the texts of a result without a diagram [bytes].
_TEXTS = 64_000


@dataclass(frozen=True, repr=False)
class Result:
    """Series and metrics of a run.

    A notebook shows it as a table of its metrics, the overview figure and the playback.

    Attributes:
        experiment: Experiment that was run.
        time: Times of the stored samples, one per ``log_period`` of the document, or of the last
            step alone, shape (k,) [s].
        series: Arrays with k rows, by name; `drake_rnn.measures.UNITS` holds their units. A series
            ``*_peak`` is the largest magnitude over all steps since the previous sample.
        metrics: Metrics, taken over every step, by name.
        warnings: Warnings about the run.
        graphviz: Diagram that was simulated, as Graphviz text.
        status: Whether the run came to its end.
        failure: Why the run ended early; empty if it did not.
        timings: What the run cost on this machine: ``wall_time_s`` of run and evaluation,
            ``real_time_factor``, simulated time over wall time of the run, and, if a clock samples
            the law, ``control_step_us``, the median time of one of its steps alone. They differ
            from run to run. Of a run that was resumed they are those of what was left from
            ``resumed_at_s`` on.
        options: How the run was made.
        second: The result of a second arm beside the first one; None without one.
        headline: What the run is to be called where no criteria are judged; empty for nothing.
    """

    experiment: Experiment
    time: Array
    series: dict[str, Array]
    metrics: dict[str, float]
    warnings: list[str] = field(default_factory=list)
    graphviz: str = ""
    status: Status = "complete"
    failure: str = ""
    timings: dict[str, float] = field(default_factory=dict)
    options: RunOptions = field(default_factory=RunOptions)
    second: Result | None = None
    headline: str = ""

    def __repr__(self) -> str:
        ending = self.ending or f"complete, {self.until:g} s"
        ending += f" {self.options.words}" if self.options.words else ""
        return (
            f"<Result {self.experiment.name or 'of an experiment'}: {ending}, "
            f"{len(self.metrics)} metrics, {criteria_text(self.verdicts, 'bounds kept')}>"
        )

    def _repr_html_(self) -> str:
        verdicts = {verdict.metric: verdict for verdict in self.verdicts}
        rows = []
        for metric in METRICS:
            value, verdict = self.metrics.get(metric.name), verdicts.get(metric.name)
            if value is None and verdict is None:
                continue
            text, bound = "", None
            if verdict is not None:
                bound = verdict.bound
                text = f"{bound_text(metric.name, bound)} {verdict.word}"
            rows.append((metric.name, *value_and_unit(metric.name, value, bound), text))
        table = html_table(repr(self)[1:-1], ("metric", "value", "unit", "bound"), rows)
        return table + html_views(self)

    @property
    def desired_position(self) -> Array:
        """Desired position of the end effector along the axes of the task, shape (k, m) [m]."""
        return self.series[DESIRED_POSITION]

    @property
    def position_error(self) -> Array:
        """Norm of the position error, shape (k,) [m]; in contact, of its part along the surface."""
        error = self.series["p_WE"] - self.desired_position
        if (contact := self.experiment.contact) is not None:
            n = self.series.get("normal_WE", contact.surface.normal_W[np.newaxis])
            error = error - (error * n).sum(axis=1)[:, np.newaxis] * n
        return np.asarray(np.linalg.norm(error, axis=1))

    @property
    def pixel_error(self) -> Array:
        """Distance of the point that is farthest off in the image, shape (k,) [px]."""
        away = self.series["pixels"] - self.series["pixels_desired"]
        return np.asarray(np.linalg.norm(away.reshape(len(away), -1, 2), axis=-1).max(axis=-1))

    def columns(self, names: Iterable[str] | None = None) -> dict[str, Array]:
        """Return series as arrays of shape (k,), one for each number: ``p_WE_x_m``; times first.

        Args:
            names: The series; all of them if None.

        Raises:
            InvalidInputError: If there is no series of that name.
        """
        return columns_of(self.time, self.series, self.experiment.arm, names)

    def frame(self, *names: str) -> Any:
        """Return series as a pandas frame, a column for each number, the time [s] as its index.

        Columns are named as `drake_rnn.runs.series` says: ``p_WE_x_m``.

        Args:
            names: The series; all of them without any.

        Raises:
            InvalidInputError: If there is no series of that name, or pandas is not installed.
        """
        return frame_of(self.columns(names or None))

    @property
    def verdicts(self) -> list[Verdict]:
        """The metrics that are expected to keep bounds, with their bounds.

        These are the document's ``accept``, and the limits that the law keeps by construction as
        far as the run has metrics of them. A run that did not come to its end keeps none.
        """
        return verdicts_of(self.experiment, self.metrics, self.status == "complete")

    @property
    def keeps_bounds(self) -> bool:
        """Whether all `verdicts` are met, those of a second arm included."""
        arms = [self] if self.second is None else [self, self.second]
        return all(verdict.met for arm in arms for verdict in arm.verdicts)

    @property
    def promises(self) -> list[Promise]:
        """What was promised, what it rests on, and whether the run kept it."""
        return [self._after_run(each) for each in self.experiment.guarantees.promises]

    def _after_run(self, promise: Promise) -> Promise:
        """Return a promise with what the run measured."""
        limit = COUNTED_LIMITS.get(promise.name)
        assumptions = tuple(each.measured(self.metrics) for each in promise.assumptions)
        promise = replace(promise, assumptions=assumptions)
        metric = "" if limit is None else limit.metric_of(self.experiment)
        if limit is None or metric not in self.metrics:
            return promise
        excess, unit = limit.excess(self.experiment, self.metrics)
        holds = limit.judged_by(self.experiment).holds(self.metrics[metric])
        # A part of a run keeps no bound, but may break one.
        met = holds if self.status == "complete" or not holds else None
        return replace(promise, met=met, excess=excess, excess_unit=unit)

    @property
    def until(self) -> float:
        """Time that the run reached [s]."""
        return float(self.time[-1]) if self.time.size else 0.0

    @property
    def ending(self) -> str:
        """How the run ended early, e.g. ``failed at t = 0.5 s``; empty if it did not."""
        return ending_text(self.status, self.until)

    @property
    def record(self) -> dict[str, Any]:
        """What ``run.json`` holds, with status, verdicts, warnings, versions and timings."""
        second = [] if self.second is None else self.second.verdicts
        second_promises = [] if self.second is None else self.second.promises
        return {
            "status": self.status,
            "failure": self.failure,
            "until_s": self.until,
            "duration_s": self.experiment.document.duration,
            "accept": _to_plain(self.verdicts) | _to_plain(second, "second."),
            "promises": [each.contents | {"second": False} for each in self.promises]
            + [each.contents | {"second": True} for each in second_promises],
            "warnings": list(self.warnings),
            "versions": versions(),
            "options": fields_of(self.options),
            "timings": self.timings,
        }

    @checked(folder=instance(str, Path))
    def save(self, folder: str | Path, draw: Callable[[Path], None] | None = None) -> Path:
        """Write the result, in place of another run's.

        The files are ``experiment.yaml``, ``result.npz``, ``metrics.json``, ``diagram.dot`` and
        ``run.json``, which says until the others are written that the folder is incomplete. Files
        that the document names are copied to ``inputs``, and ``experiment.yaml`` names the copies,
        so that the folder can be read elsewhere. If there is no room for them beside the checkpoint
        of the run, that is removed.

        Args:
            folder: The folder, which is created if missing.
            draw: Called with the folder when the result is written, before the folder is marked as
                whole; may add pictures. If it raises an error, the result stays.

        Returns:
            The folder.

        Raises:
            InvalidInputError: If the folder cannot be written to, or another process writes to it.
        """
        folder = Path(folder)
        try:
            try:
                trouble = self._fill(folder, draw)
            except OSError as error:
                if not self._fits_without_checkpoint(folder, error):
                    raise
                forget(folder)
                if self.status == "interrupted":
                    self.warnings.append("checkpoint: removed, to make room for the result")
                trouble = self._fill(folder, draw)
        except OSError as error:
            raise InvalidInputError(
                f"output folder {folder}: {error.strerror}{_going_on(folder)}"
            ) from None
        if self.status != "interrupted":
            forget(folder)
        if trouble is not None:
            raise trouble
        return folder

    def _fill(
        self, folder: Path, draw: Callable[[Path], None] | None = None
    ) -> BaseException | None:
        """Write all files; return what has stopped the pictures.

        Raises:
            OSError: If a file cannot be written.
        """
        # Before the folder is emptied, which may be where they are.
        enclosure = enclosure_of(self.experiment)
        with fill_folder(folder, self.record):
            _, was_interrupted = run_uninterrupted(lambda: self._write(folder, enclosure))
            if was_interrupted:
                return KeyboardInterrupt()
            if draw is not None:
                # What was computed is kept; pictures can be made again.
                try:
                    draw(folder)
                except BaseException as error:
                    return error
        return None

    def _write(self, folder: Path, enclosure: Enclosure) -> None:
        enclosure.write(folder)
        text = written_head("experiment") + to_yaml(enclosure.document)
        (folder / "experiment.yaml").write_text(text)
        with (folder / "result.npz").open("wb") as stream:
            self._write_arrays(stream)
        (folder / "metrics.json").write_text(json.dumps(self.metrics, indent=2) + "\n")
        if self.graphviz:
            (folder / "diagram.dot").write_text(self.graphviz)
        if self.second is not None:
            self.second._fill(folder / SECOND)

    def _write_arrays(self, stream: IO[bytes]) -> None:
        arrays: dict[str, Any] = {"time": self.time, **self.series}
        np.savez_compressed(stream, **arrays)

    def _fits_without_checkpoint(self, folder: Path, error: OSError) -> bool:
        """Return whether the result fits in place of the checkpoint, if an error is of its size."""
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            return False
        counter = _Counter()
        for each in (self, self.second):
            if each is not None:
                each._write_arrays(counter)
                size = enclosure_of(each.experiment).size
                counter.size += len(each.graphviz) + _TEXTS + size
        return counter.size <= room_in(folder) + size_of(folder)

    @classmethod
    def load(
        cls,
        folder: str | Path,
        path: MotionPath | Trajectory | None = None,
        *,
        modules: Modules = False,
        files: Mapping[str, str | Path] | None = None,
    ) -> Result:
        """Return a result that `save` has written, here or elsewhere.

        Series, metrics and verdicts need no model. A law or path of a module that is not known
        here is replaced by what the folder says of it, which a warning tells; it does not run.

        Args:
            folder: The folder.
            path: Path of the run, if it was made in Python, in place of where it has led.
            modules: Modules that may be imported, as the run had a law, path or environment of
                the form ``module:Class``: True for any, False for none, or their names. What has
                been imported already is used without being told to.
            files: Files in place of those that the document names, by dotted key, e.g.
                ``{"arm.model": "cell.urdf"}``, where the folder does not enclose them.

        Raises:
            InvalidInputError: If the folder does not hold a result, or an incomplete one, or the
                run needs a file or an environment that is not known here.
        """
        require_type("folder", folder, str, Path)
        folder = Path(folder)
        if folder.is_file():
            raise InvalidInputError(f"{folder}: holds no result: it is a file, not a folder")
        require_ended(folder)
        status_values = told_in(read_record(folder), folder)
        document = read_file(folder, "experiment.yaml", _document_in)
        read_file(folder, "result.npz", heads_of)
        metrics = read_file(folder, "metrics.json", metrics_of)
        if isinstance(document, dict) and files:
            replace_files(document, files)
        try:
            experiment = _experiment_in(folder, document, path, modules)
        except InvalidInputError as error:
            hint = missing_files(document, folder, str(error))
            raise InvalidInputError(f"{folder}: experiment.yaml: {error}{hint}") from error
        series = read_file(folder, "result.npz", lambda file: series_of(file, experiment))
        second = None
        if experiment.second is not None and (folder / SECOND).is_dir():
            second = cls.load(folder / SECOND, modules=modules, files=_of_second(files or {}))
            second = replace(second, experiment=experiment.second)
        return cls(
            experiment=experiment,
            time=series.pop("time"),
            series=series,
            metrics=metrics,
            graphviz=read_file(folder, "diagram.dot", graph_of),
            second=second,
            **status_values,
        )


def _to_plain(verdicts: list[Verdict], prefix: str = "") -> dict[str, Any]:
    return {
        prefix + verdict.metric: {
            "value": verdict.value,
            "bound": str(verdict.bound),
            "met": verdict.met if verdict.judged else None,
        }
        for verdict in verdicts
    }


def stop(result: Result, status: Status, failure: str) -> Result:
    """Return a result, and that of a second arm, as those of a run that ended early."""
    return replace_in_both(result, status=status, failure=failure)


def replace_in_both(result: Result, **fields: Any) -> Result:
    """Return a result with other values of fields, and that of a second arm likewise."""
    second = None if result.second is None else replace_in_both(result.second, **fields)
    return replace(result, second=second, **fields)


def _experiment_in(
    folder: Path,
    document: Any,
    path: MotionPath | Trajectory | None,
    modules: Modules,
) -> Experiment:
    """Return the experiment of a saved result; arguments are those of `Result.load`."""
    if not isinstance(document, dict):
        return make_experiment(document)
    document = without_extensions(document)
    unlike = find_files(document, folder)
    law, replacements, unknown = stand_ins(document, folder, modules)
    experiment = make_experiment(
        document, replacements if path is None else path, modules=modules, law=law
    )
    if replacements is not None and path is None:
        experiment = replace(
            experiment, document=replace(experiment.document, path=document["path"])
        )
    for text in (*unlike, *unknown):
        warn(f"{folder}: {text}", stacklevel=3)
    return experiment


def _of_second(files: Mapping[str, str | Path]) -> dict[str, str | Path]:
    """Return the files of a second arm, by their keys in its own document."""
    return {k.removeprefix("second."): file for k, file in files.items() if "second." in k}


def _document_in(file: Path) -> Any:
    try:
        return read_yaml(file)
    except InvalidInputError as error:
        if not file.exists():
            raise FileNotFoundError from None
        raise ValueError(str(error).removeprefix(f"{file}: ")) from None


def _going_on(folder: Path) -> str:
    """Return how a result that could not be written can still be had; empty if it cannot."""
    if not can_go_on(folder):
        return ""
    again = f"`drake-rnn run --resume {folder}` makes it from the checkpoint"
    return f"; once it can be written, {again}"


class _Counter(BytesIO):
    """A file that keeps its size [bytes] alone."""

    size = 0

    def write(self, data: Any) -> int:
        """Count what would be written."""
        count = memoryview(data).nbytes
        self.size += count
        return count

    def seekable(self) -> bool:
        """Nothing can be written again."""
        return False


_METRICS = METRICS.by_name
_VIOLATIONS = {metric.name for metric in METRICS if "violation" in metric.name}
# Violation that is a rounding error, in any unit.
_ROUNDING = 1e-9
# Share of a bound below which a number is noise.
_NOISE = 1e-6


def words_of(metric: str) -> str:
    """Return the name of a metric as words, without its unit."""
    return _METRICS[metric].words


def meaning_of(metric: str) -> str:
    """Return what a metric is."""
    return _METRICS[metric].meaning


def value_text(metric: str, value: float | None, bound: Acceptance | None = None) -> str:
    """Return the value of a metric with its unit, without digits of rounding errors.

    Args:
        metric: Its name.
        value: Its value; None for one that a run does not have.
        bound: What it is expected to keep; far below that there is nothing but rounding.
    """
    if value is None:
        return "not reached"
    if not is_noise(metric, value, bound):
        return _format(metric, value)
    none = metric in _VIOLATIONS and abs(value) < _ROUNDING
    return "none" if none else _format(metric, 0.0)


def value_and_unit(
    metric: str, value: float | None, bound: Acceptance | None = None
) -> tuple[str, str]:
    """Return what `value_text` does as two columns, for a terminal."""
    text = hyphened(value_text(metric, value, bound))
    if value is None:
        return text, ""
    number, _, unit = text.partition(" ")
    return number, unit


def is_noise(metric: str, value: float, bound: Acceptance | None = None) -> bool:
    """Return whether a value of a metric is far below its bound, where there is only rounding."""
    if metric in _VIOLATIONS and abs(value) < _ROUNDING:
        return True
    return bound is not None and abs(value) < _NOISE * (bound.at_most or 0.0)


def hyphened(text: str) -> str:
    """Return a text with the minus signs that documents have, from which it can be copied."""
    return text.replace("−", "-")


def bound_text(metric: str, bound: Acceptance) -> str:
    """Return the bound of a metric with its unit."""
    if metric in _VIOLATIONS and bound.at_least is None and (bound.at_most or 0.0) <= _ROUNDING:
        return "none allowed"
    ends = (("≥", bound.at_least), ("≤", bound.at_most))
    return ", ".join(f"{sign} {_format(metric, end)}" for sign, end in ends if end is not None)


def _format(metric: str, value: float) -> str:
    """Return a number with its unit, and with a minus sign for a hyphen."""
    return format_quantity(value, _METRICS[metric].unit).replace("-", "−")
