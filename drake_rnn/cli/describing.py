"""What is known of an arm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ..experiment import parse_change, set_key
from ..figures.arm_picture import write_arm_picture
from ..inputs.documents import parse_yaml
from ..robot.load_arm import load_arm
from ..robot.report import arm_report
from .console import err, errors, out
from .options import require_writable
from .tables import arm_joints_table, arm_table


def describe_arm(
    model: Annotated[
        str, typer.Argument(help="Name of a shipped arm, or a model file: URDF, SDF or MJCF.")
    ],
    frame: Annotated[
        str | None, typer.Option(help="Task frame E, or the frame that carries --tool.")
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(metavar="YAML", help="Tool to add, e.g. '{ball: 0.012, length: 0.1}'."),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Another key of the arm, e.g. mass_scale=1.1."
        ),
    ] = None,
    out_folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the picture.")
    ] = Path("out"),
    picture: Annotated[bool, typer.Option(help="Write a picture of the arm.")] = True,
) -> None:
    """Print an arm's joints, limits, reach, inertia and weight, and what is missing."""
    with errors():
        fields = {} if frame is None else {"frame": frame}
        for change in changes or []:
            set_key(fields, *parse_change(change))
        if tool is not None:
            fields["tool"] = parse_yaml(tool, "--tool")
        report = arm_report(load_arm(model, **fields))
        out.print(arm_joints_table(report))
        out.print(arm_table(report))
        for warning in report.warnings:
            err.print(f"[yellow]warning[/] {escape(warning)}")
        if picture:
            file = out_folder / f"{report.arm.name}.png"
            require_writable(out_folder)
            out.print(f"picture  {write_arm_picture(report.arm, report.home, file)}", markup=False)
