"""Pictures that commands draw.

- Figures, drawn by two processes at a time, as drawing is most of what a short run takes; the paper
  that options describe.
- What is known of an arm, with a picture of it.
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
from typing import Any

from rich.markup import escape

from .. import figures
from ..errors import DrakeRnnError, InvalidInputError
from ..experiment.files import checked_changes, set_key
from ..figures.arm_picture import NoPictureError, write_arm_picture
from ..inputs.documents import parse_yaml
from ..robot import arm as robot
from ..robot.clearance.arm_clearance import fit_arm
from ..robot.load_arm import arm_report, load_arm
from ..robot.postures import proposed_home
from ..runs.result import Result
from .arguments import Arm
from .changing import changes_of, require_writable
from .command import PrintOptions
from .console import err, errors, out, print_table
from .tables import arm_joints_sheet, arm_table, fits_table, print_sheet

# Time by which a helper that began with us may be later [s].
_PATIENCE = 60.0


def draw_figures(
    result: Result,
    folder: Path,
    names: Sequence[str] | None = None,
    in_helper: bool | None = None,
    paper: figures.Paper | None = None,
) -> list[Path]:
    """Write figures of a result, as `write_figures`, with a second process if there is room.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply.
        in_helper: Whether a second process draws half of them; by default if there is a processor
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
    if not theirs or not (_has_room() if in_helper is None else in_helper):
        return figures.write_figures(result, folder, names, paper)
    with _helper(result, folder, theirs, paper) as helper:
        figures.write_figures(result, folder, ours, paper)
        helper.join(_PATIENCE)
        is_drawn = helper.exitcode == 0
    if not is_drawn:
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


def paper_of(args: PrintOptions) -> figures.Paper:
    """Return what the options say that figures are drawn for.

    Raises:
        InvalidInputError: If the width is none.
    """
    width = None if args.width is None else figures.parse_width(args.width)
    return figures.Paper(args.form, width, args.look)


def describe_arm(args: Arm) -> None:
    """Print what is known of the arm, and write its picture."""
    with errors():
        fields: dict[str, Any] = {}
        for key, value in checked_changes(_changes(args)).items():
            set_key(fields, key, value)
        if args.fit is not None:
            return _fit_arm(load_arm(args.model, **fields), args)
        report = arm_report(load_arm(args.model, **fields))
        print_sheet(arm_joints_sheet(report))
        print_table(arm_table(report))
        for warning in report.warnings:
            err.print(f"[yellow]warning[/] {escape(warning)}")
        if args.picture:
            file = args.out_folder / f"{report.arm.name}.png"
            require_writable(args.out_folder)
            try:
                write_arm_picture(report.arm, report.home, file)
            except NoPictureError as error:
                err.print(f"[yellow]warning[/] no {escape(str(error))}")
            else:
                out.print(f"picture  {file}", markup=False)
    return None


def _fit_arm(arm: robot.Arm, args: Arm) -> None:
    """Fit capsules to what an arm's model has, one for each body and fine ones, and write them."""
    file = Path(str(args.fit))
    require_writable(file.parent)
    home = proposed_home(arm) if arm.home is None else arm.home
    frame = "" if args.frame is None else f" --frame {args.frame}"
    made_by = f"drake-rnn arm {arm.model.name}{frame} --fit {file.name} --most {args.most}"
    text, fits = fit_arm(arm, home, args.most, made_by)
    print_table(fits_table(fits))
    file.write_text(text)
    out.print(f"capsules  {file}", markup=False)


def _changes(args: Arm) -> dict[str, Any]:
    """Return the keys of the arm that options give, by dotted key."""
    overrides: dict[str, Any] = {} if args.frame is None else {"frame": args.frame}
    if args.tool is not None:
        overrides["tool"] = parse_yaml(args.tool, "--tool")
    changes = changes_of(args.changes)
    for key in overrides.keys() & changes.keys():
        raise InvalidInputError(f"--set: {key} is given twice, as --{key} gives it too")
    return overrides | changes
