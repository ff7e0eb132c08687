"""Figures drawn by two processes at a time, as drawing is most of what a short run takes.

- Also the paper that options describe.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path

from .. import figures
from ..errors import DrakeRnnError
from ..runs.result import Result
from .command import Printed

# Time by which a helper that began with us may be later [s].
_PATIENCE = 60.0


def draw_figures(
    result: Result,
    folder: Path,
    names: Sequence[str] | None = None,
    helped: bool | None = None,
    paper: figures.Paper | None = None,
) -> list[Path]:
    """Write figures of a result, as `write_figures`, with a second process if there is room.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply.
        helped: Whether a second process draws half of them; by default if there is a processor
            for it.
        paper: What they are drawn for; by default a screen.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """
    paper = figures.Paper() if paper is None else paper
    names = list(names or figures.fitting(figures.drawable(result), paper))
    ours, theirs = names[::2], names[1::2]
    if not theirs or not (_has_room() if helped is None else helped):
        return figures.write_figures(result, folder, names, paper)
    with _helper(result, folder, theirs, paper) as helper:
        figures.write_figures(result, folder, ours, paper)
        helper.join(_PATIENCE)
        done = helper.exitcode == 0
    if not done:
        # Where it failed, this tells why.
        figures.write_figures(result, folder, theirs, paper)
    return [folder / f"{name}.{paper.form}" for name in names]


def _has_room() -> bool:
    """Return whether a second process may draw."""
    # Elsewhere a fork is not safe. A process of a queue has its share of the processors.
    if sys.platform != "linux" or parent_process() is not None:
        return False
    return len(os.sched_getaffinity(0)) > 1


@contextmanager
def _helper(
    result: Result, folder: Path, names: Sequence[str], paper: figures.Paper
) -> Iterator[BaseProcess]:
    """Let a process draw figures meanwhile; afterwards it is gone, whatever happened."""
    # A fork has the result and all modules at once. It draws without Drake's threads.
    arguments = (result, folder, names, os.getpid(), paper)
    helper = get_context("fork").Process(target=_draw_for, args=arguments, daemon=True)
    helper.start()
    try:
        yield helper
    finally:
        helper.kill()
        helper.join()


def _draw_for(
    result: Result, folder: Path, names: Sequence[str], parent: int, paper: figures.Paper
) -> None:
    """Draw figures for a process, as long as that lives: a later run may use the folder."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for name in names:
        if os.getppid() != parent:
            return
        try:
            figures.write_figures(result, folder, [name], paper)
        except DrakeRnnError:
            # That process will try again, and tell why it fails.
            sys.exit(1)


def paper_of(asked: Printed) -> figures.Paper:
    """Return what the options say that figures are drawn for.

    Raises:
        InvalidInputError: If the width is none.
    """
    width = None if asked.width is None else figures.parse_width(asked.width)
    return figures.Paper(asked.form, width, asked.look)
