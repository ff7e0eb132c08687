"""Names of a package that are imported when they are first asked for.

A large package answers at once, and a user pays for what is used: no figure, no Matplotlib. The
stub ``__init__.pyi`` of such a package is the one list of its names; type checkers read the same.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lent(place: str) -> Any:
    """Return what ``module:name`` names, whose module is imported now."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def lent_names(
    package: str, file: str
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__all__``, ``__getattr__`` and ``__dir__`` of a package with a stub.

    Args:
        package: Name of the package.
        file: Its ``__init__.py``, beside which is ``__init__.pyi`` with lines such as
            ``from .module import name as name``.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [line for line in stub.body if isinstance(line, ast.ImportFrom) and line.level]
    places = {
        alias.name: f"{package}.{line.module}:{alias.name}"
        for line in imports
        for alias in line.names
    }

    def lend(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        # The next time Python finds it by itself.
        found = vars(sys.modules[package])[name] = lent(places[name])
        return found

    public = sorted(name for name in places if not name.startswith("_"))
    return public, lend, lambda: sorted({*vars(sys.modules[package]), *places})
