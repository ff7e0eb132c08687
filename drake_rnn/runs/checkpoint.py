"""What a run needs to go on after it was stopped, in its folder: state and recorded steps.

All that varies in a diagram is numbers in its context, but for what a plant remembers of its last
step: the forces that were found in it. They are found anew at the plant's next step, before
anything else at that time reads them, so the state is kept at times of such a step. Recorded steps
are kept as they are, and evaluated again from the first.

What keeps a checkpoint of a run while it runs.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from math import floor, prod
from pathlib import Path
from shutil import rmtree
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument, document_class, make_experiment
from ..experiment.files import surroundings
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array
from ..inputs.files import arrays_of, content_of, json_of, open_regular
from ..inputs.messages import fields_of
from ..inputs.packages import versions
from ..inputs.processes import signals_held
from ..measures import Recorder, Steps
from ..measures.run_metrics import Take
from .enclosure import name_sources
from .folder import (
    claim_folder,
    make_folder,
    read_record,
    replacing,
    require_fillable,
    room_in,
    written_whole,
)
from .series import RunOptions

#: Subfolder of a run's folder that holds it while the run has not come to its end.
FOLDER = "checkpoint"
#: Its files: what it says of the run, the document, the state and the recorded steps.
RUN, DOCUMENT, STATE, STEPS = "run.json", "experiment.yaml", "state.npz", "steps.bin"
#: Largest size of recorded steps, those of half an hour at 1 kHz, and of one number [bytes].
MOST_BYTES, NUMBER = 1_000_000_000, 8
# Largest size of the other files, and unit of the sizes that the system tells [bytes].
_MOST_TEXT, _BLOCK = 64_000_000, 512

_T = TypeVar("_T")


class State(NamedTuple):
    """The numbers of a context.

    Attributes:
        time: Time [s].
        continuous: Continuous state, shape (k,).
        discrete: All groups of the discrete state, one after the other, shape (m,).
    """

    time: float
    continuous: Array
    discrete: Array

    @classmethod
    def of(cls, root: Context) -> State:
        """Return a copy of the numbers of a diagram's context."""
        groups = root.get_discrete_state()
        values = [groups.value(k) for k in range(groups.num_groups())]
        discrete = np.concatenate([np.zeros(0), *values])
        return cls(root.get_time(), root.get_continuous_state_vector().CopyToVector(), discrete)

    def write_to(self, root: Context) -> None:
        """Set the numbers of a context of the same diagram."""
        root.SetTime(self.time)
        if self.continuous.size:
            root.SetContinuousState(self.continuous)
        groups, begin = root.get_mutable_discrete_state(), 0
        for k in range(groups.num_groups()):
            end = begin + groups.value(k).size
            groups.set_value(k, self.discrete[begin:end])
            begin = end


@dataclass(frozen=True)
class Checkpoint:
    """A run as it was at the end of a step.

    Attributes:
        folder: Folder of the run.
        experiment: The experiment.
        options: How the run is made.
        state: State at the end of the step.
        times: Times of all steps until then, shape (k,) [s].
        rows: What was recorded at these, shape (k, size).
    """

    folder: Path
    experiment: Experiment
    options: RunOptions
    state: State
    times: Array
    rows: Array

    @classmethod
    def load(cls, folder: str | Path) -> Checkpoint:
        """Return the checkpoint of a run that was stopped.

        Args:
            folder: Folder of the run.

        Raises:
            InvalidInputError: If there is none, or the run cannot go on as it would have.
        """
        folder = Path(folder)
        contents = _contents(folder)
        record, document = contents.told, contents.document
        if record.get("why_not"):
            raise InvalidInputError(f"{folder}: cannot go on: {record['why_not']}")
        _require_same(folder, document, record)
        experiment = make_experiment(document)
        state, table = contents.state, contents.table
        options = _read(folder / FOLDER, RUN, lambda _: _options_in(record))
        return cls(folder, experiment, options, state, table[:, 0], table[:, 1:])

    def restore(self, simulator: Simulator) -> None:
        """Bring a simulator of the run's diagram to the end of the step."""
        root = simulator.get_mutable_context()
        if [part.size for part in self.state[1:]] != [part.size for part in State.of(root)[1:]]:
            raise InvalidInputError(
                f"{self.folder / FOLDER}: is no checkpoint of this run: its state has other sizes"
            )
        self.state.write_to(root)
        simulator.Initialize()
        # Some systems begin anew when they are initialized.
        self.state.write_to(root)


def can_go_on(folder: Path) -> bool:
    """Return whether a folder holds the checkpoint of a run that was stopped."""
    return (folder / FOLDER / STATE).is_file()


def require_ended(folder: Path) -> None:
    """Refuse a folder of a run that was stopped and has left a checkpoint, but no result.

    Raises:
        InvalidInputError: If it is one; it says how to go on with the run.
    """
    if can_go_on(folder) and not (folder / "experiment.yaml").is_file():
        raise InvalidInputError(
            f"{folder}: its run was stopped, or is not at its end; `drake-rnn run --resume "
            f"{folder}` goes on with a run that was stopped"
        )


def forget(folder: Path) -> None:
    """Remove the checkpoint of a run that has come to its end."""
    rmtree(folder / FOLDER, ignore_errors=True)


def size_of(folder: Path) -> int:
    """Return the size of the checkpoint in a folder [bytes]; 0 without one."""
    with suppress(OSError):
        return sum(file.lstat().st_blocks * _BLOCK for file in (folder / FOLDER).iterdir())
    return 0


class Digest:
    """Digest of all files of a checkpoint, by which a change of any of them is found.

    Args:
        folder: Folder of the checkpoint, which holds what is said of the run, and its document.

    Raises:
        OSError: If one of these files cannot be read.
        ValueError: If one is no regular file, or too large.
    """

    def __init__(self, folder: Path) -> None:
        self._begun = sha256()
        for name in (RUN, DOCUMENT):
            content = content_of(folder / name, _MOST_TEXT)
            self._begun.update(f"{name} {len(content)} ".encode() + content)

    def add(self, table: Array) -> None:
        """Add recorded steps, shape (k, width), which follow those added before."""
        self._begun.update(table.tobytes())

    def at(self, state: State, shape: Sequence[int]) -> Array:
        """Return the digest with a state and the shape of all recorded steps, 32 bytes."""
        whole = self._begun.copy()
        for part in (np.array(shape, dtype=float), *map(np.asarray, state)):
            whole.update(f" {part.shape} ".encode() + part.astype(float).tobytes())
        return np.frombuffer(whole.digest(), np.uint8)


class _Contents(NamedTuple):
    """What the files of a checkpoint hold: told of the run, document, state and recorded steps."""

    told: dict[str, Any]
    document: ExperimentDocument
    state: State
    table: Array


def _contents(folder: Path) -> _Contents:
    """Return what the files of a checkpoint hold, or refuse what no run has left as it is."""
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "there is no such folder"
        raise InvalidInputError(f"{folder}: {what}")
    place = folder / FOLDER
    if not os.path.lexists(place / RUN):
        raise InvalidInputError(f"{folder}: {_without(folder)}")
    contents = _read(place, RUN, json_of)
    if not isinstance(contents, dict) or not isinstance(contents.get("versions"), dict):
        raise _damage_error(place, RUN, "does not say by which versions it was made")
    document = _read(place, DOCUMENT, _document_in)
    if contents.get("why_not"):
        return _Contents(contents, document, State(0.0, np.zeros(0), np.zeros(0)), np.zeros((0, 1)))
    if not os.path.lexists(place / STATE):
        raise InvalidInputError(
            f"{folder}: was stopped before the first whole second; run it again"
        )
    state, shape, shape_expected = _read(place, STATE, _state_in)
    table = _read(place, STEPS, lambda file: _table_in(file, shape))
    digest = Digest(place)
    digest.add(table)
    if not np.array_equal(digest.at(state, shape), shape_expected):
        raise _damage_error(place, STATE, "its files are not those that the run has written")
    if not _is_consistent(state, table[:, 0], document.duration):
        raise _damage_error(place, STATE, "its times are not those of a run")
    return _Contents(contents, document, state, table)


def _read(place: Path, name: str, read: Callable[[Path], _T]) -> _T:
    """Return what a function reads from a file of a checkpoint, or refuse it."""
    try:
        return read(place / name)
    except FileNotFoundError:
        raise _damage_error(place, name, "is missing") from None
    except OSError as error:
        raise _damage_error(place, name, error.strerror or str(error)) from None
    except (ValueError, InvalidInputError) as error:
        raise _damage_error(place, name, str(error).removeprefix(f"{place / name}: ")) from None


def _damage_error(place: Path, name: str, why: str) -> InvalidInputError:
    return InvalidInputError(
        f"{place}: is no checkpoint of a run: {name}: {why}; run the experiment again"
    )


def _document_in(file: Path) -> ExperimentDocument:
    if not os.path.lexists(file):
        raise FileNotFoundError
    contents = read_yaml(file)
    return construct(document_class(contents), contents, "")


def _options_in(record: Mapping[str, Any]) -> RunOptions:
    return construct(RunOptions, record.get("options"), "options")


def _state_in(file: Path) -> tuple[State, tuple[int, ...], Array]:
    """Return the state in a file, the shape of the recorded steps, and the digest of all files."""
    if file.stat().st_size > _MOST_TEXT:
        raise ValueError("is too large")
    arrays = arrays_of(file)
    if missing := {*State._fields, "shape", "digest"} - arrays.keys():
        raise ValueError(f"has no {', '.join(sorted(missing))}")
    time, shape = arrays["time"], arrays["shape"]
    if time.shape or shape.shape != (2,) or shape.dtype.kind != "i" or (shape < 1).any():
        raise ValueError("has no time and shape of recorded steps")
    state = State(float(time), arrays["continuous"], arrays["discrete"])
    return state, tuple(shape.tolist()), arrays["digest"]


def _table_in(file: Path, shape: tuple[int, ...]) -> Array:
    """Return recorded steps of a shape from a file, which may hold more."""
    with open_regular(file, 2 * MOST_BYTES) as stream:
        size = os.fstat(stream.fileno()).st_size
        if prod(shape) * NUMBER > size:
            raise ValueError(f"has {size} bytes, not {shape[0]} steps of {shape[1]} numbers")
        return np.fromfile(stream, count=prod(shape)).reshape(shape)


def _is_consistent(state: State, times: Array, duration: float) -> bool:
    """Return whether steps are in their order, from the start to the time of the state."""
    is_ordered = times[0] == 0.0 and bool((np.diff(times) >= 0.0).all())
    return is_ordered and bool(times[-1] == state.time) and 0.0 < state.time <= duration


def _without(folder: Path) -> str:
    """Return why a folder has no checkpoint."""
    record = read_record(folder)
    if record.get("status") == "complete":
        return "the run is complete; there is nothing left to resume"
    if record.get("status") == "failed":
        return f"the run failed, and would fail again: {record.get('failure', '')}"
    return "holds no run that was stopped"


def _require_same(folder: Path, document: ExperimentDocument, record: Mapping[str, Any]) -> None:
    """Refuse to go on with other code, or with another document."""
    if record.get("made_by") != surroundings(document.contents()):
        before = ", ".join(f"{name} {number}" for name, number in record["versions"].items())
        raise InvalidInputError(
            f"{folder}: was begun by other code, of {before}, or a file that its document names "
            "has changed; it would not go on as it began: run it again"
        )
    document_file = folder / DOCUMENT
    if os.path.isfile(document_file) and read_record(folder).get("status") == "interrupted":
        now, then = (read_yaml(each) for each in (document_file, folder / FOLDER / DOCUMENT))
        name_sources(now, then)
        # Thin series have a period of their own.
        keys = [k for k in {**now, **then} if k != "log_period" and now.get(k) != then.get(k)]
        if keys:
            raise InvalidInputError(
                f"{folder}: experiment.yaml has another {', '.join(keys)} than the run that was "
                f"stopped; a changed experiment begins anew: drake-rnn run {document_file}"
            )


# Time of the run, and wall time, between two checkpoints [s].
_EVERY, _PAUSE = 1.0, 1.0
# Room that is left on the disk besides that for a result as large as the recorded steps [bytes].
_ROOM = 16_000_000
# Rounding of a time that is a sum of steps, relative to the plant's step.
_ROUNDING = 1e-6
#: Drake's schemes whose next step depends on the present state alone, if steps have a fixed length.
_WITHOUT_MEMORY = (
    *("explicit_euler", "semi_explicit_euler", "runge_kutta2", "runge_kutta3"),
    *("bogacki_shampine3", "runge_kutta5"),
)


class Keeper:
    """What keeps a checkpoint of a run while it runs, at whole seconds of its time.

    Args:
        folder: Folder of the run, which is created if missing.
        experiment: The experiment.
        options: How the run is made.
        recorder: Recorder of the run.
        tick: Time step of the arm's plant [s]; None without one.
        since: Checkpoint from which the run goes on, and which stays until the next one; None for a
            run that begins.

    Attributes:
        trouble: Why nothing is kept any more; empty if it is.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """

    trouble: str = ""

    def __init__(
        self,
        folder: str | Path,
        experiment: Experiment,
        options: RunOptions,
        recorder: Recorder,
        tick: float | None,
        since: Checkpoint | None = None,
    ) -> None:
        self._folder = Path(folder) / FOLDER
        self._recorder, self._tick = recorder, tick
        # Number of the next whole second to keep what there is at.
        self._whole, self._due = 1, perf_counter() + _PAUSE
        # Number of recorded steps in the file, and of those at the time of the state.
        self._written = self._kept = 0
        self._able = not why_not(experiment.document)
        if since is None:
            self._begin(folder, experiment, options)
        self._digest = Digest(self._folder)
        if since is not None:
            self._written = self._kept = len(since.times)
            self._width = since.rows.shape[1] + 1
            self._digest.add(np.column_stack((since.times, since.rows)))
            self._whole = _whole(since.state.time) + 1

    def _begin(self, folder: str | Path, experiment: Experiment, options: RunOptions) -> None:
        contents = experiment.document.contents()
        record = {
            "made_by": surroundings(contents),
            "options": fields_of(options),
            "why_not": why_not(experiment.document),
            "versions": versions(),
        }
        try:
            rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            (self._folder / DOCUMENT).write_text(experiment.document.to_yaml())
            with written_whole(self._folder / RUN) as stream:
                stream.write(json.dumps(record, indent=2) + "\n")
        except OSError as error:
            raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None

    def taking(self, take: Take) -> Take:
        """Return what evaluates parts, which the recorder then drops, after they were written."""

        def taken(steps: Steps) -> int:
            if self._able:
                self._keep(self._append)
            return take(steps)

        return taken

    def __call__(self, root: Context) -> None:
        """Keep what there is at the end of a step, if it is time."""
        if _whole(t := root.get_time()) < self._whole or not self._able:
            return
        # The plant's next step, which finds forces, is to begin now.
        ticks = t / self._tick if self._tick else 0.0
        if abs(ticks - round(ticks)) < _ROUNDING:
            self._whole = _whole(t) + 1
            if perf_counter() >= self._due:
                self._keep(lambda: self._checkpoint(State.of(root)))
                self._due = perf_counter() + _PAUSE

    def _checkpoint(self, state: State) -> None:
        self._append()
        shape = [self._written, self._width]
        digest = self._digest.at(state, shape)
        record: dict[str, Any] = {**state._asdict(), "shape": shape, "digest": digest}
        with replacing(self._folder / STATE) as new, new.open("wb") as stream:
            np.savez(stream, **record)
        self._kept = self._written

    def _keep(self, write: Callable[[], None]) -> None:
        # A run does not fail for want of what it needs only if it is stopped.
        try:
            with signals_held():
                write()
        except OSError as error:
            self._able = False
            until = self._recorder.steps.time[-1]
            self.trouble = f"none after t = {until:.6g} s: {error.strerror}"
            self._drop_unused()

    def _drop_unused(self) -> None:
        """Make room: remove the steps since the last checkpoint."""
        with suppress(OSError):
            if self._kept:
                os.truncate(self._folder / STEPS, self._kept * self._width * NUMBER)
            else:
                (self._folder / STEPS).unlink()

    def _append(self) -> None:
        """Write the steps that have been recorded since the last call."""
        times, rows = self._recorder.since(self._written)
        table = np.column_stack((times, rows))
        size = (self._written + len(table)) * table.shape[1] * NUMBER
        if size > MOST_BYTES:
            raise OSError(errno.EFBIG, f"its steps take more than {MOST_BYTES / 1e9:g} GB")
        if room_in(self._folder) < table.nbytes + size + _ROOM:
            raise OSError(errno.ENOSPC, "the disk has too little room for it and the result")
        mode = "r+b" if self._written else "wb"
        with (self._folder / STEPS).open(mode) as stream:
            # Beyond the last checkpoint there may be steps of a run that was stopped.
            stream.seek(self._written * table.shape[1] * NUMBER)
            stream.write(table.tobytes())
        self._digest.add(table)
        self._width = table.shape[1]
        self._written += len(table)


@contextmanager
def begun_in(folder: Path) -> Iterator[None]:
    """Make the folder of a run that begins, and keep other processes from writing to it.

    Raises:
        InvalidInputError: If it cannot be written to, or another process writes to it.
    """
    try:
        make_folder(folder)
    except OSError as error:
        raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None
    with claim_folder(folder, within=True):
        require_fillable(folder)
        yield


def _whole(t: float) -> int:
    return floor(t / _EVERY + _ROUNDING)


def why_not(document: ExperimentDocument) -> str:
    """Return why a run of a document cannot go on after it was stopped; empty if it can."""
    settings = document.integrator
    if settings is None:
        return ""
    if settings.accuracy is not None:
        return (
            "integrator.accuracy: with error control Drake's integrator remembers the length of "
            "its last step, which it does not tell; a run with integrator.step or a period can go "
            "on"
        )
    if settings.scheme not in _WITHOUT_MEMORY:
        return (
            f"integrator.scheme: {settings.scheme} remembers derivatives of earlier steps, which "
            f"it does not tell; a run with {', '.join(_WITHOUT_MEMORY)} or a period can go on"
        )
    return ""
