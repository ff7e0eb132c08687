"""Packages: what is imported when it is first asked for, optional extras, programs, and versions.

A large package answers at once, and a user pays for what is used: no figure, no Matplotlib. The
stub ``__init__.pyi`` of such a package is the one list of its names; type checkers read the same.

- Names of a package, and modules, that are imported when they are first asked for.
- Packages and programs that only some features need.
- Versions of what the numbers of a run may depend on.
- What a notebook shows: tables, and views that higher rooms draw.
"""

from __future__ import annotations

import ast
import os
import shlex
import shutil
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..errors import InvalidInputError


def import_name(place: str) -> Any:
    """Return what ``module:name`` names, whose module is imported now."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def lent_names(
    package: str, file: str, old_names: Mapping[str, str] | None = None
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__all__``, ``__getattr__`` and ``__dir__`` of a package with a stub.

    Args:
        package: Name of the package.
        file: Its ``__init__.py``, beside which is ``__init__.pyi`` with lines such as
            ``from .module import name as name``.
        old_names: Names that it had before, see `moved_name`.
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
            return moved_name(package, name, old_names or {})
        # The next time Python finds it by itself.
        value = vars(sys.modules[package])[name] = import_name(places[name])
        return value

    public = sorted(name for name in places if not name.startswith("_"))
    return public, lend, lambda: sorted({*vars(sys.modules[package]), *places})


def moved_name(package: str, name: str, places: Mapping[str, str]) -> Any:
    """Return a name that a package had before, with a warning.

    Args:
        package: The package.
        name: The name.
        places: Modules of `drake_rnn` that such names are in now; ``module:new_name`` where the
            name has changed as well.

    Raises:
        AttributeError: If the package never had it.
    """
    if name not in places:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    root = __name__.partition(".")[0]
    module, _, new = places[name].partition(":")
    warnings.warn(
        f"{package}.{name} is now {root}.{module}.{new or name}; its old name works until the next "
        "release",
        DeprecationWarning,
        stacklevel=3,
    )
    return import_name(f"{root}.{module}:{new or name}")


class _LateModule:
    """Stands for a module that is imported when one of its names is first used.

    Unlike one of `importlib.util.LazyLoader` it is not in `sys.modules`, where `inspect`, of which
    pydrake's templates make use, asks every module for its file, which would import it.
    """

    def __init__(self, name: str) -> None:
        vars(self)["name"] = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self.name), attribute)

    def __setattr__(self, attribute: str, value: Any) -> None:
        setattr(import_module(self.name), attribute, value)


def late_import(name: str) -> Any:
    """Return what stands for a module until one of its names is first used.

    For large modules that few runs need.

    Args:
        name: Full name of the module.

    Returns:
        The module, or None if it is not installed.
    """
    return None if find_spec(name) is None else _LateModule(name)


_DISTRIBUTION = "drake-rnn"


def import_extra(what: str, extra: str, *modules: str) -> list[Any]:
    """Return modules of packages that need not be installed.

    Args:
        what: What needs them, for messages.
        extra: The optional dependencies of this package that they belong to.
        modules: Names of the modules.

    Raises:
        InvalidInputError: If one is missing; the message says how to install it.
    """
    try:
        return [import_module(module) for module in modules]
    except ImportError:
        package = modules[0].partition(".")[0]
        raise InvalidInputError(not_installed(what, extra, package)) from None


def not_installed(what: str, extra: str, package: str) -> str:
    """Return what is said where a package is missing.

    Args:
        what: What needs it.
        extra: The optional dependencies of this package that it belongs to.
        package: Its name.
    """
    return f"{what}: needs {package}, which is not installed: pip install {packages_of(extra)}"


def packages_of(extra: str) -> str:
    """Return what pip is to install for an extra.

    These are the packages themselves, not ``drake-rnn[extra]``: pip would look for that name on
    PyPI, where others could have taken it.
    """
    try:
        requirements = requires(_DISTRIBUTION) or []
    except PackageNotFoundError:
        requirements = []
    packages = [
        f"'{requirement.partition(';')[0].strip()}'"
        for requirement in requirements
        if requirement.replace("'", '"').endswith(f'extra == "{extra}"')
    ]
    return " ".join(packages or [extra])


#: Names under which a program goes, the first that is found is taken.
PROGRAMS: dict[str, tuple[str, ...]] = {
    "chromium": ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    "chromedriver": ("chromedriver",),
    "C compiler": ("cc", "gcc", "clang"),
    "dot": ("dot",),
    "ffmpeg": ("ffmpeg",),
}


def find_program(name: str) -> str | None:
    """Return the file of a program of `PROGRAMS`, or None."""
    return next(filter(None, map(shutil.which, PROGRAMS[name])), None)


def c_compiler() -> tuple[str, ...] | None:
    """Return the command of the C compiler, ``$CC`` or the first that is found; None without any.

    The package ``ziglang`` comes last.

    Raises:
        InvalidInputError: If ``$CC`` names no program that can be run.
    """
    text = os.environ.get("CC", "").strip()
    if not text:
        if (file := find_program("C compiler")) is not None:
            return (file,)
        # A wheel that brings one.
        return (sys.executable, "-m", "ziglang", "cc") if find_spec("ziglang") else None
    try:
        program, *options = shlex.split(text)
    except ValueError:
        # A quote is not closed.
        program, options = text, []
    if (file := shutil.which(program)) is None:
        raise InvalidInputError(
            f"CC: must name a C compiler that can be run, not {text!r}; set it to gcc or clang, or "
            "unset it"
        )
    return (file, *options)


__version__ = version("drake-rnn")


def versions() -> dict[str, str]:
    """Return the versions of the packages that the numbers of a run may depend on."""
    return {"drake-rnn": __version__} | {each: version(each) for each in ("drake", "numpy")}


def versions_text() -> str:
    """Return these versions as the command line prints them, a line each."""
    return "".join(f"{name} {number}\n" for name, number in versions().items())


#: What a notebook shows of a result below its metrics: functions from a result to HTML, by the name
#: ``module:function``, whose module is imported when a notebook asks.
VIEWS: dict[str, str] = {}


def html_views(result: object) -> str:
    """Return all views of a result as HTML."""
    return "".join(import_name(view)(result) for view in VIEWS.values())


def html_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML; all but the first column to the right.

    Args:
        title: What stands above it.
        head: Names of the columns.
        rows: Texts of the cells.
    """
    lines = [_row("th", head), *(_row("td", row) for row in rows)]
    return f"<table><caption>{escape(title)}</caption>{''.join(lines)}</table>"


def _row(cell: str, texts: Sequence[str]) -> str:
    sides = ("left", *("right" for _ in texts[1:]))
    cells = (
        f'<{cell} style="text-align: {side}">{escape(text)}</{cell}>'
        for side, text in zip(sides, texts, strict=True)
    )
    return f"<tr>{''.join(cells)}</tr>"
