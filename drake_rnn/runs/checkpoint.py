"""What a run needs to go on after it was stopped, in its folder: state and recorded steps.

All that varies in a diagram is numbers in its context, but for what a plant remembers of its last
step: the forces that were found in it. They are found anew at the plant's next step, before
anything else at that time reads them, so the state is kept at times of such a step. Recorded steps
are kept as they are, and evaluated again from the first.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument, make_experiment
from ..experiment.fingerprint import surroundings
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array
from .folder import UNREADABLE, read_record
from .stored import Series

#: Subfolder of a run's folder that holds it while the run has not come to its end.
FOLDER = "checkpoint"
#: Its files: what it says of the run, the document, the state and the recorded steps.
RUN, DOCUMENT, STATE, STEPS = "run.json", "experiment.yaml", "state.npz", "steps.bin"


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
        document = construct(ExperimentDocument, read_yaml(place / DOCUMENT), "")
        _require_same(folder, document, told)
        try:
            with np.load(place / STATE) as kept:
                state = State(float(kept["time"]), kept["continuous"], kept["discrete"])
                count, width = (int(number) for number in kept["shape"])
            table = np.fromfile(place / STEPS, count=count * width)
            if table.size != count * width:
                raise ValueError(f"{STEPS} has {table.size} numbers, not {count * width}")
            table = table.reshape(count, width)
        except FileNotFoundError as error:
            if Path(error.filename).name == STEPS:
                raise InvalidInputError(f"{place}: is no checkpoint: {STEPS} is missing") from None
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


def can_go_on(folder: Path) -> bool:
    """Return whether a folder holds the checkpoint of a run that was stopped."""
    return (folder / FOLDER / STATE).is_file()


def forget(folder: Path) -> None:
    """Remove the checkpoint of a run that has come to its end."""
    rmtree(folder / FOLDER, ignore_errors=True)


def _told(folder: Path) -> dict[str, Any]:
    """Return what a checkpoint says of its run, or refuse a folder without one."""
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "there is no such folder"
        raise InvalidInputError(f"{folder}: {what}")
    try:
        told: dict[str, Any] = json.loads((folder / FOLDER / RUN).read_text())
        if not isinstance(told, dict) or not isinstance(told.get("versions"), dict):
            raise ValueError(f"{RUN} does not say by which versions it was made")
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
    written = folder / DOCUMENT
    if os.path.isfile(written) and read_record(folder).get("status") == "interrupted":
        now, then = (read_yaml(each) for each in (written, folder / FOLDER / DOCUMENT))
        # Thin series have a period of their own.
        changed = [k for k in {**now, **then} if k != "log_period" and now.get(k) != then.get(k)]
        if changed:
            raise InvalidInputError(
                f"{folder}: experiment.yaml has another {', '.join(changed)} than the run that was "
                f"stopped; a changed experiment begins anew: drake-rnn run {written}"
            )
