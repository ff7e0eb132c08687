"""Packages that only some formats need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InvalidInputError


def needed(extra: str, *modules: str) -> list[Any]:
    """Return modules of the packages of an extra.

    Raises:
        InvalidInputError: If they are not installed; the message says how to install them.
    """
    try:
        return [import_module(module) for module in modules]
    except ImportError:
        package = modules[0].partition(".")[0]
        raise InvalidInputError(
            f"form: {extra} needs {package}, which is not installed: "
            f"pip install 'drake-rnn[{extra}]'"
        ) from None
