"""Formulas without a network: one file of MathJax is copied to the site.

MathJax comes with the package sphinx-mathjax-offline; of its files, which are 20 MB, one does. It
draws formulas as SVG, which needs no fonts.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

_PACKAGE = "sphinx-mathjax-offline"
NAME = "tex-svg.js"


def bundled() -> Path:
    """Return the file of MathJax.

    Raises:
        FileNotFoundError: If the package is not installed, or does not have the file.
    """
    try:
        found = [file for file in files(_PACKAGE) or () if file.name == NAME]
    except PackageNotFoundError:
        found = []
    if not found:
        raise FileNotFoundError(f"{_PACKAGE}: {NAME} is not there; install the extra `docs`")
    return Path(str(found[0].locate()))
