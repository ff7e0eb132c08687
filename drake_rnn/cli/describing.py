"""What is known of an arm."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment.files import (
    checked_changes,
    set_key,
)
from ..figures.arm_picture import rendering_fault, write_arm_picture
from ..inputs.documents import parse_yaml
from ..robot.load_arm import arm_report, load_arm
from .arguments import Arm
from .changing import changes_of, require_writable
from .console import err, errors, out, print_table
from .tables import arm_joints_sheet, arm_table, print_sheet


def describe_arm(asked: Arm) -> None:
    """Print what is known of the arm, and write its picture."""
    with errors():
        fields: dict[str, Any] = {}
        for key, value in checked_changes(_changes(asked)).items():
            set_key(fields, key, value)
        report = arm_report(load_arm(asked.model, **fields))
        print_sheet(arm_joints_sheet(report))
        print_table(arm_table(report))
        for warning in report.warnings:
            err.print(f"[yellow]warning[/] {escape(warning)}")
        if asked.picture and (why := rendering_fault()):
            err.print(f"[yellow]warning[/] no picture: {escape(why)}")
        elif asked.picture:
            file = asked.out_folder / f"{report.arm.name}.png"
            require_writable(asked.out_folder)
            out.print(f"picture  {write_arm_picture(report.arm, report.home, file)}", markup=False)


def _changes(asked: Arm) -> dict[str, Any]:
    """Return the keys of the arm that options give, by dotted key."""
    given: dict[str, Any] = {} if asked.frame is None else {"frame": asked.frame}
    if asked.tool is not None:
        given["tool"] = parse_yaml(asked.tool, "--tool")
    changes = changes_of(asked.changes)
    for key in given.keys() & changes.keys():
        raise InvalidInputError(f"--set: {key} is given twice, as --{key} gives it too")
    return given | changes
