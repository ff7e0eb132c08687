"""Playing with an experiment while it runs."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import load_experiment
from ..live.play import Play
from ..live.requests import LOCAL
from ..live.session import Session
from ..runs.result import Result
from .asked import Live
from .changing import changes_of, require_writable
from .console import err, errors, out, status
from .saving import Pictures, write_result


def play_live(asked: Live) -> None:
    """Play with an experiment until Ctrl-C."""
    with errors():
        experiment = load_experiment(asked.experiment, changes_of(asked.changes, asked.seed))
        session = Session(experiment, asked.obstacle_speed)
        require_writable(asked.out_folder)
        with status(f"{experiment.name}: making the page"):
            play = Play(session, asked.host, asked.port, _Saving(asked.out_folder))
    for warning in session.warnings:
        err.print(f"[yellow]warning[/] {escape(warning)}")
    if asked.host not in LOCAL:
        err.print(
            f"[yellow]warning[/] anyone who reaches {escape(asked.host)} sees the page and, while "
            "no other page is open, has its controls; nothing is encrypted"
        )
    out.print(f"live      {escape(play.url)}  (Ctrl-C ends it)", soft_wrap=True)
    try:
        play.run()
    except KeyboardInterrupt:
        out.print(f"ended     after {session.time:.1f} s, at {play.rate:.2f} times real time")
    finally:
        play.close()
    if (left := play.unsaved) > 0.0:
        err.print(f"[yellow]warning[/] {left:.1f} s were recorded and not saved")


class _Saving:
    """Writes each recording to a folder of its own, and returns that.

    Args:
        out_folder: Folder that they are in.
    """

    def __init__(self, out_folder: Path) -> None:
        self._out = out_folder

    def __call__(self, result: Result) -> str:
        name, number = f"{result.experiment.name}_live", 1
        while not _is_made(folder := self._out / f"{name}_{number}"):
            number += 1
        write_result(result, folder, Pictures(figures=False))
        return str(folder)


def _is_made(folder: Path) -> bool:
    """Make a folder, unless something of that name is there, maybe another process's."""
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    except OSError as error:
        raise InvalidInputError(f"--out: {folder}: {error.strerror}") from None
    return True
