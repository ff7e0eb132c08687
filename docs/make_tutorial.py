"""Do what the tutorial says, and put the table and the picture of the printed page into it.

    python docs/make_tutorial.py

needs pdflatex (texlive-latex-recommended) and pdftoppm (poppler-utils) for the picture; without
them only the table is made. It prints how long each command takes. A test carries out the same
commands.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from PIL import Image, ImageChops

PAGE = Path(__file__).with_name("tutorial.md")
PICTURE = PAGE.with_suffix(".png")
_FILE = re.compile(r"^Save this as `([\w.]+)`:\n\n```\w+\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_COMMANDS = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_TABLE = re.compile(r"(?<= -->\n).*?(?=\n† marks)", re.DOTALL)
#: Resolution of the picture [dots/inch], and room round what is printed [px].
_DOTS, _ROOM = 110, 16


def files() -> dict[str, str]:
    """Return the files that the tutorial has its reader save, by name."""
    return dict(_FILE.findall(PAGE.read_text()))


def commands() -> list[str]:
    """Return the commands of the tutorial, in order."""
    return [line for block in _COMMANDS.findall(PAGE.read_text()) for line in block.splitlines()]


def carry_out(folder: Path) -> Iterator[tuple[str, subprocess.CompletedProcess[str]]]:
    """Save the files to a folder and carry out the commands there; those of TeX only where it is.

    Yields:
        Each command with what came of it.
    """
    for name, contents in files().items():
        (folder / name).write_text(contents)
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    for command in commands():
        if shutil.which(command.split()[0], path=path) is None:
            continue
        yield (
            command,
            subprocess.run(
                command,
                shell=True,
                cwd=folder,
                env={**os.environ, "PATH": path},
                capture_output=True,
                text=True,
            ),
        )


def main() -> None:
    """Carry out the tutorial, and write what came out into its page."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        began = before = perf_counter()
        for command, done in carry_out(folder):
            print(f"{perf_counter() - before:6.1f} s  {command}", file=sys.stderr)
            if done.returncode:
                sys.exit(f"{done.stdout}{done.stderr}")
            before = perf_counter()
        print(f"{before - began:6.1f} s  in all", file=sys.stderr)
        (printed,) = (each for each in commands() if "--table" in each)
        again = printed.replace("table.tex", "table.md")
        subprocess.run(
            [Path(sys.executable).with_name(again.split()[0]), *_arguments(again)],
            cwd=folder,
            check=True,
            capture_output=True,
        )
        table = (folder / "table.md").read_text()
        PAGE.write_text(_TABLE.sub(lambda _: table, PAGE.read_text()))
        if (folder / "paper.pdf").exists() and shutil.which("pdftoppm"):
            form = ["pdftoppm", "-png", "-singlefile", "-r", str(_DOTS)]
            subprocess.run([*form, "paper.pdf", "paper"], cwd=folder, check=True)
            _cut(folder / "paper.png")


def _arguments(command: str) -> list[str]:
    """Return the words behind the first one of a command."""
    return command.replace('"', "").split()[1:]


def _cut(page: Path) -> None:
    """Write the picture of a page without its empty margins and its number."""
    with Image.open(page) as image:
        picture = image.convert("L").crop((0, 0, image.width, int(0.93 * image.height)))
        left, top, right, bottom = ImageChops.invert(picture).getbbox() or (0, 0, *picture.size)
        box = (left - _ROOM, top - _ROOM, right + _ROOM, bottom + _ROOM)
        image.convert("RGB").crop(box).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
