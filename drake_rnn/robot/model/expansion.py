"""Expansion of xacro, the macro language of ROS models."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ...errors import InvalidInputError
from ...inputs.extras import packages_of
from .late_import import late_import
from .packages import Packages

xacro = late_import("xacro")
substitution: Any = None if xacro is None else late_import("xacro.substitution_args")


def is_xacro(root: Element) -> bool:
    """Return whether a document contains macros."""
    return any(element.tag.startswith("xacro:") for element in root.iter())


def expand_xacro(file: Path, packages: Packages) -> bytes:
    """Return a document with its macros expanded; their arguments have their default values.

    Args:
        file: The document.
        packages: The packages that its ``$(find ...)`` name.

    Raises:
        InvalidInputError: If xacro is not installed, or cannot expand the document.
    """
    stem = file.name.removesuffix(".xacro").removesuffix(".urdf")
    by_hand = f"expand it with `xacro {file.name} > {stem}.urdf`"
    if xacro is None:
        raise InvalidInputError(
            f"arm.model: {file} is a xacro file; {by_hand}, or pip install {packages_of('xacro')}"
        )
    with _finding(packages) as lost:
        try:
            return bytes(xacro.process_file(str(file)).toxml(encoding="utf-8"))
        # What macros raise is not known: they may contain Python.
        except Exception as error:
            if lost:
                raise InvalidInputError(
                    f"arm.model: {file} names the unknown package {lost[0]!r}; give its folder in "
                    "arm.packages"
                ) from None
            raise InvalidInputError(
                f"arm.model: {file} cannot be expanded: {' '.join(str(error).split())}; {by_hand}, "
                "with the arguments that it needs"
            ) from None


@contextmanager
def _finding(packages: Packages) -> Iterator[list[str]]:
    """Have xacro find packages as we do; by itself it needs an installed ROS.

    Yields:
        The packages that were not found.
    """
    lost: list[str] = []

    def find(package: str) -> str:
        folder = packages.find(package)
        if folder is None:
            lost.append(package)
            raise LookupError(package)
        return str(folder)

    of_ros = substitution._eval_find
    substitution._eval_find = find
    try:
        yield lost
    finally:
        substitution._eval_find = of_ros
