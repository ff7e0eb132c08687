"""What the end effector was asked to do a while ago."""

from __future__ import annotations

from typing import Any

from ..inputs.fields import Array
from .path_source import PathSource


class DelayedPathSource(PathSource):
    """A `PathSource` whose signals are those of ``delay`` ago; before that, the path's start.

    Args:
        delay: How late they are [s].
        arguments: Those of a `PathSource`.
    """

    def __init__(self, delay: float, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.delay = delay

    def _at(self, t: float) -> list[Array]:
        return super()._at(t - self.delay)
