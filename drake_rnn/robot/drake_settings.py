"""Settings of Drake: its log, and the resolution of contact meshes.

- Control of Drake's log.
- The meshes of balls in contact: how fine they may be.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from xml.etree.ElementTree import Element

from ..errors import InvalidInputError


@contextmanager
def quiet_drake(least: int) -> Iterator[None]:
    """Suppress Drake's messages below the `logging` level ``least`` within a with-block."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(level, least))
    try:
        yield
    finally:
        log.setLevel(level)


@contextmanager
def drake_warnings() -> Iterator[list[str]]:
    """Collect Drake's warnings within a with-block instead of logging them.

    They are collected even where the program has silenced Drake's log.
    """
    log = logging.getLogger("drake")
    level, disabled = log.level, log.disabled
    told: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            told.append(record.getMessage())
        return record.levelno != logging.WARNING

    log.setLevel(min(log.getEffectiveLevel(), logging.WARNING))
    log.disabled = False
    log.addFilter(collect)
    try:
        yield told
    finally:
        log.removeFilter(collect)
        log.setLevel(level)
        log.disabled = disabled


#: Least edge length of a ball's mesh, in radii of the ball: it takes seconds to make, and a finer
#: one minutes.
FINEST = 0.04


def require_coarse(key: str, edge: float, radius: float) -> None:
    """Raise an InvalidInputError for a mesh that cannot be made in a reasonable time.

    Args:
        key: What gives the edge length, for the message.
        edge: Edge length of the mesh [m].
        radius: Radius of the ball [m].
    """
    if edge < FINEST * radius:
        raise InvalidInputError(
            f"{key}: must be at least {FINEST:g} of the ball's radius, {FINEST * radius:g} m, "
            f"not {edge:g}"
        )


def require_coarse_balls(key: str, root: Element) -> None:
    """Raise an InvalidInputError as `require_coarse` does, for the balls of a model file.

    Args:
        key: What names the file, for the message.
        root: The model, as URDF or SDF; MJCF has no such meshes.
    """
    for collision in root.iter("collision"):
        balls = [*collision.iter("sphere"), *collision.iterfind("geometry/sphere/radius")]
        radii = list(_numbers(balls, "radius"))
        for edge in _numbers(collision.iter("drake:mesh_resolution_hint"), "value"):
            for radius in radii:
                require_coarse(f"{key}: drake:mesh_resolution_hint", edge, radius)


def _numbers(elements: Iterable[Element], attribute: str) -> Iterator[float]:
    """Yield the numbers that elements have as an attribute or as text; Drake tells of others."""
    for element in elements:
        with suppress(TypeError, ValueError):
            yield float(element.get(attribute) or element.text or "")
