"""Packages that only some features need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InvalidInputError


def needed(what: str, install: str, *modules: str) -> list[Any]:
    """Return modules of packages that need not be installed.

    Args:
        what: What needs them, for messages.
        install: What pip is to install where they are missing.
        modules: Names of the modules.

    Raises:
        InvalidInputError: If one is missing; the message says how to install it.
    """
    try:
        return [import_module(module) for module in modules]
    except ImportError:
        package = modules[0].partition(".")[0]
        raise InvalidInputError(not_installed(what, install, package)) from None


def not_installed(what: str, install: str, package: str) -> str:
    """Return what is said where a package is missing.

    Args:
        what: What needs it.
        install: What pip is to install.
        package: Its name.
    """
    return f"{what}: needs {package}, which is not installed: pip install {install}"
