"""Pictures of a diagram's wiring, by Graphviz."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from ..errors import InvalidInputError
from ..runs.folder import (
    replacing,
    require_output,
    written_whole,
)

#: What Graphviz can write of what is of use here.
_FORMATS = (".svg", ".png", ".pdf")


def draw_beside(dot: Path) -> None:
    """Write the picture of a file of Graphviz beside it, if Graphviz is installed."""
    if program := shutil.which("dot"):
        command = [program, "-Tsvg", str(dot), "-o", str(dot.with_suffix(".svg"))]
        subprocess.run(command, check=False, capture_output=True)


def write_graph(graph: str, file: Path) -> None:
    """Write a graph: its text, or a picture, as the file's name says.

    Raises:
        InvalidInputError: If the file has another ending, Graphviz is needed and not installed, or
            the file cannot be written.
    """
    if file.suffix not in (".dot", *_FORMATS):
        endings = ", ".join((".dot", *_FORMATS))
        raise InvalidInputError(f"--diagram: must end with one of {endings}, not {file.name!r}")
    program = shutil.which("dot")
    if file.suffix != ".dot" and program is None:
        raise InvalidInputError(
            f"--diagram: {file.suffix} needs Graphviz, whose program dot is not installed; "
            "install the package graphviz, or write a .dot file"
        )
    require_output(file, "--diagram")
    try:
        if file.suffix == ".dot" or program is None:
            with written_whole(file) as stream:
                stream.write(graph)
            return
        drawn = subprocess.run(
            [program, f"-T{file.suffix[1:]}"],
            input=graph.encode(),
            capture_output=True,
            check=True,
        )
        with replacing(file) as new:
            new.write_bytes(drawn.stdout)
    except OSError as error:
        raise InvalidInputError(f"--diagram: {file}: {error.strerror}") from None
