"""Past desired motion of the end effector as signals."""

from __future__ import annotations

from typing import Any

from ..inputs.fields import Array
from .path_source import PathSource


class DelayedPathSource(PathSource):
    """A `PathSource` with delayed signals; until t = delay they rest at the path's start.

    Args:
        delay: Delay of the signals [s].
        arguments: Arguments of `PathSource`.
    """

    def __init__(self, delay: float, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.delay = delay

    def _at(self, t: float) -> list[Array]:
        return super()._at(t - self.delay)
