"""What keeps a checkpoint of a run while it runs."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import floor
from pathlib import Path
from shutil import rmtree
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument
from ..experiment.fingerprint import surroundings
from ..inputs.signals_held import signals_held
from ..inputs.versions import versions
from ..measures import Recorder, Steps
from ..measures.recorder import Take
from .checkpoint import (
    DOCUMENT,
    FOLDER,
    MOST_BYTES,
    NUMBER,
    RUN,
    STATE,
    STEPS,
    Checkpoint,
    Digest,
    State,
)
from .folder import claimed, make_folder, require_fillable
from .stored import Series
from .whole_file import replacing, room_in, written_whole

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
        # Number of recorded steps in the file, and of those at the time of the state.
        self._written = self._kept = 0
        self._able = not why_not(experiment.document)
        if since is None:
            self._begin(folder, experiment, series)
        self._digest = Digest(self._folder)
        if since is not None:
            self._written = self._kept = len(since.times)
            self._width = since.rows.shape[1] + 1
            self._digest.add(np.column_stack((since.times, since.rows)))
            self._whole = _whole(since.state.time) + 1

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
            (self._folder / DOCUMENT).write_text(experiment.document.to_yaml())
            with written_whole(self._folder / RUN) as stream:
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
        shape = [self._written, self._width]
        digest = self._digest.at(state, shape)
        kept: dict[str, Any] = {**state._asdict(), "shape": shape, "digest": digest}
        with replacing(self._folder / STATE) as new, new.open("wb") as stream:
            np.savez(stream, **kept)
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
    with claimed(folder, within=True):
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
