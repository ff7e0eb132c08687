"""Packages that only some features need."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from typing import Any

from ..errors import InvalidInputError

_DISTRIBUTION = "drake-rnn"


def needed(what: str, extra: str, *modules: str) -> list[Any]:
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
        stated = requires(_DISTRIBUTION) or []
    except PackageNotFoundError:
        stated = []
    packages = [
        f"'{requirement.partition(';')[0].strip()}'"
        for requirement in stated
        if requirement.replace("'", '"').endswith(f'extra == "{extra}"')
    ]
    return " ".join(packages or [extra])
