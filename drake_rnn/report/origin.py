"""What a report was made with."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path

from ..experiment.fingerprint import stamp
from ..inputs.versions import versions

_PACKAGE = Path(__file__).parents[1]


def origin() -> dict[str, str | None]:
    """Return the versions of what the numbers depend on, with the commit, None if not known."""
    return {
        **versions(),
        "python": platform.python_version(),
        "code": stamp().rpartition(" ")[2],
        "commit": _commit(),
    }


def _commit() -> str | None:
    """Return the commit of this package's files, marked if they have changed since."""
    if _git("ls-files", "--error-unmatch", "__init__.py") is None:
        # Not under version control, though a folder above it may be.
        return None
    commit = _git("rev-parse", "HEAD")
    return f"{commit}, changed since" if commit and _git("status", "--porcelain", ".") else commit


def _git(*arguments: str) -> str | None:
    try:
        told = subprocess.run(
            ["git", "-C", str(_PACKAGE), *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return told.stdout.strip()
