"""What a run needs to go on after it was stopped, in its folder: state and recorded steps.

All that varies in a diagram is numbers in its context, but for what a plant remembers of its last
step: the forces that were found in it. They are found anew at the plant's next step, before
anything else at that time reads them, so the state is kept at times of such a step. Recorded steps
are kept as they are, and evaluated again from the first.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import floor
from pathlib import Path
from shutil import rmtree
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument, make_experiment
from ..experiment.fingerprint import surroundings
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array
from ..inputs.signals_held import signals_held
from ..inputs.versions import versions
from ..measures import Recorder, Steps
from ..measures.recorder import Take
from .folder import UNREADABLE, read_record
from .stored import Series
from .whole_file import replacing, written_whole

#: Subfolder of a run's folder that holds it while the run has not come to its end.
FOLDER = "checkpoint"
_RUN, _DOCUMENT, _STATE, _STEPS = "run.json", "experiment.yaml", "state.npz", "steps.bin"
# Time of the run, and wall time, between two checkpoints [s].
_EVERY, _PAUSE = 1.0, 1.0
# Largest size of recorded steps, those of half an hour at 1 kHz [bytes].
_MOST_BYTES = 1_000_000_000
# Rounding of a time that is a sum of steps, relative to the plant's step.
_ROUNDING = 1e-6
#: Drake's schemes whose next step depends on the present state alone, if steps have a fixed length.
_WITHOUT_MEMORY = (
    *("explicit_euler", "semi_explicit_euler", "runge_kutta2", "runge_kutta3"),
    *("bogacki_shampine3", "runge_kutta5"),
)


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
        series: What of the series is stored.
        state: State at the end of the step.
        times: Times of all steps until then, shape (k,) [s].
        rows: What was recorded at these, shape (k, size).
    """

    folder: Path
    experiment: Experiment
    series: Series
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
        place = folder / FOLDER
        told = _told(folder)
        document = construct(ExperimentDocument, read_yaml(place / _DOCUMENT), "")
        _require_same(folder, document, told)
        try:
            with np.load(place / _STATE) as kept:
                state = State(float(kept["time"]), kept["continuous"], kept["discrete"])
                count, width = (int(number) for number in kept["shape"])
            table = np.fromfile(place / _STEPS, count=count * width)
            if table.size != count * width:
                raise ValueError(f"{_STEPS} has {table.size} numbers, not {count * width}")
            table = table.reshape(count, width)
        except FileNotFoundError as error:
            if Path(error.filename).name == _STEPS:
                raise InvalidInputError(f"{place}: is no checkpoint: {_STEPS} is missing") from None
            raise InvalidInputError(
                f"{folder}: was stopped before the first whole second; run it again"
            ) from None
        except UNREADABLE as error:
            raise InvalidInputError(f"{place}: is no checkpoint of a run: {error}") from None
        experiment = make_experiment(document)
        return cls(folder, experiment, told["series"], state, table[:, 0], table[:, 1:])

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


class Keeper:
    """What keeps a checkpoint of a run while it runs, at whole seconds of its time.

    Args:
        folder: Folder of the run, which is created if missing.
        experiment: The experiment.
        series: What of its series is stored.
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
        series: Series,
        recorder: Recorder,
        tick: float | None,
        since: Checkpoint | None = None,
    ) -> None:
        self._folder = Path(folder) / FOLDER
        self._recorder, self._tick = recorder, tick
        # Number of the next whole second to keep what there is at.
        self._whole, self._due = 1, perf_counter() + _PAUSE
        # Number of recorded steps in the file.
        self._written = 0
        self._able = not why_not(experiment.document)
        if since is None:
            self._begin(folder, experiment, series)
        else:
            self._written, self._whole = len(since.times), _whole(since.state.time) + 1

    def _begin(self, folder: str | Path, experiment: Experiment, series: Series) -> None:
        contents = experiment.document.contents()
        told = {
            "made_by": surroundings(contents),
            "series": series,
            "why_not": why_not(experiment.document),
            "versions": versions(),
        }
        try:
            rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            (self._folder / _DOCUMENT).write_text(experiment.document.to_yaml())
            with written_whole(self._folder / _RUN) as stream:
                stream.write(json.dumps(told, indent=2) + "\n")
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
        kept: dict[str, Any] = {**state._asdict(), "shape": [self._written, self._width]}
        with replacing(self._folder / _STATE) as new, new.open("wb") as stream:
            np.savez(stream, **kept)

    def _keep(self, write: Callable[[], None]) -> None:
        # A run does not fail for want of what it needs only if it is stopped.
        try:
            with signals_held():
                write()
        except OSError as error:
            self._able = False
            until = self._recorder.steps.time[-1]
            self.trouble = f"none after t = {until:.6g} s: {error.strerror}"

    def _append(self) -> None:
        """Write the steps that have been recorded since the last call."""
        times, rows = self._recorder.since(self._written)
        table = np.column_stack((times, rows))
        if (self._written + len(table)) * table.shape[1] * table.itemsize > _MOST_BYTES:
            raise OSError(errno.EFBIG, f"its steps take more than {_MOST_BYTES / 1e9:g} GB")
        mode = "r+b" if self._written else "wb"
        with (self._folder / _STEPS).open(mode) as stream:
            # Beyond the last checkpoint there may be steps of a run that was stopped.
            stream.seek(self._written * table.shape[1] * table.itemsize)
            stream.write(table.tobytes())
        self._width = table.shape[1]
        self._written += len(table)


def _whole(t: float) -> int:
    return floor(t / _EVERY + _ROUNDING)


def can_go_on(folder: Path) -> bool:
    """Return whether a folder holds the checkpoint of a run that was stopped."""
    return (folder / FOLDER / _STATE).is_file()


def forget(folder: Path) -> None:
    """Remove the checkpoint of a run that has come to its end."""
    rmtree(folder / FOLDER, ignore_errors=True)


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


def _told(folder: Path) -> dict[str, Any]:
    """Return what a checkpoint says of its run, or refuse a folder without one."""
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "there is no such folder"
        raise InvalidInputError(f"{folder}: {what}")
    try:
        told: dict[str, Any] = json.loads((folder / FOLDER / _RUN).read_text())
        if not isinstance(told, dict) or not isinstance(told.get("versions"), dict):
            raise ValueError(f"{_RUN} does not say by which versions it was made")
    except FileNotFoundError:
        raise InvalidInputError(f"{folder}: {_without(folder)}") from None
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"{folder / FOLDER}: is no checkpoint of a run: {error}") from None
    if told.get("why_not"):
        raise InvalidInputError(f"{folder}: cannot go on: {told['why_not']}")
    return told


def _without(folder: Path) -> str:
    """Return why a folder has no checkpoint."""
    record = read_record(folder)
    if record.get("status") == "complete":
        return "the run is complete; there is nothing left to resume"
    if record.get("status") == "failed":
        return f"the run failed, and would fail again: {record.get('failure', '')}"
    return "holds no run that was stopped"


def _require_same(folder: Path, document: ExperimentDocument, told: Mapping[str, Any]) -> None:
    """Refuse to go on with other code, or with another document."""
    if told.get("made_by") != surroundings(document.contents()):
        before = ", ".join(f"{name} {number}" for name, number in told["versions"].items())
        raise InvalidInputError(
            f"{folder}: was begun by other code, of {before}, or a file that its document names "
            "has changed; it would not go on as it began: run it again"
        )
    written = folder / _DOCUMENT
    if os.path.isfile(written) and read_record(folder).get("status") == "interrupted":
        now, then = (read_yaml(each) for each in (written, folder / FOLDER / _DOCUMENT))
        # Thin series have a period of their own.
        changed = [k for k in {**now, **then} if k != "log_period" and now.get(k) != then.get(k)]
        if changed:
            raise InvalidInputError(
                f"{folder}: experiment.yaml has another {', '.join(changed)} than the run that was "
                f"stopped; a changed experiment begins anew: drake-rnn run {written}"
            )
