"""Check what a release would upload: python docs/check_release.py [FOLDER].

The wheel and the source distribution in FOLDER, by default built now: their metadata, size and
contents; that the files of version control are in the source distribution or left out on purpose;
that what is installed fits together; and the licences of all files, those of the models among them.
"""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZipFile

ROOT = Path(__file__).parents[1]
#: Largest size of the wheel [bytes].
MOST = 3_000_000
#: Rooms of the package that a wheel has, and what must not be in it.
ROOMS = ("diagrams/experiments", "models/panda", "playback/web", "live/web", "report/templates")
FOREIGN = ("tests/", "docs/", "benchmarks/", "examples/")


def carry_out(*command: str, quietly: bool = False) -> None:
    """Carry out a command of this environment, and end if it fails.

    Args:
        *command: The command.
        quietly: Whether only its errors are shown.

    Raises:
        SystemExit: If it fails.
    """
    print("$", *command, flush=True)
    done = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=ROOT,
        stdout=subprocess.DEVNULL if quietly else None,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"release: {command[0]} fails, see above")


def check_wheel(file: Path) -> None:
    """Refuse a wheel that is large, or has not what it should have.

    Raises:
        SystemExit: If it is.
    """
    size = file.stat().st_size
    with ZipFile(file) as wheel:
        names = wheel.namelist()
        sizes: dict[str, int] = {}
        for info in wheel.infolist():
            room = "/".join(info.filename.split("/")[:2])
            room = room if room.count("/") and not room.endswith(".py") else "other"
            sizes[room] = sizes.get(room, 0) + info.compress_size
    for room, part in sorted(sizes.items(), key=lambda each: -each[1])[:8]:
        print(f"{part / 1000:8.0f} kB  {room}")
    print(f"{size / 1000:8.0f} kB  {file.name}, {len(names)} files")
    if size > MOST:
        raise SystemExit(f"release: {file.name} has {size} B, more than {MOST}")
    for room in ROOMS:
        if not any(name.startswith(f"drake_rnn/{room}/") for name in names):
            raise SystemExit(f"release: {file.name} has no drake_rnn/{room}/")
    if wrong := [name for name in names if name.startswith(FOREIGN)]:
        raise SystemExit(f"release: {file.name} has {wrong[0]}")


def check_source(file: Path) -> None:
    """Refuse a source distribution without what builds, cites and tests the package.

    Raises:
        SystemExit: If it is.
    """
    with tarfile.open(file) as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    print(f"{file.stat().st_size / 1000:8.0f} kB  {file.name}, {len(names)} files")
    needed = ("pyproject.toml", "setup.py", "LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff")
    tested = (
        "Makefile",
        "requirements.lock",
        "tests/conftest.py",
        "diagrams/schemas",
        "docs/conf.py",
    )
    cited = ("COMPATIBILITY.md", "SECURITY.md", "REUSE.toml", "LICENSES/MIT.txt")
    for name in (*needed, *cited, *tested):
        if name not in names:
            raise SystemExit(f"release: {file.name} has no {name}")


def main() -> None:
    """Carry out all checks."""
    with TemporaryDirectory() as scratch:
        if len(sys.argv) > 1:
            folder = Path(sys.argv[1])
        else:
            folder = Path(scratch)
            carry_out("build", "--outdir", str(folder), str(ROOT), quietly=True)
        (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
        carry_out("twine", "check", "--strict", str(wheel), str(source))
        check_wheel(wheel)
        check_source(source)
    carry_out("check_manifest")
    carry_out("reuse", "lint", "--quiet")
    carry_out("pip", "check")


if __name__ == "__main__":
    main()
