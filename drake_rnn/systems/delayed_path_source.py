"""Past desired motion of the end effector as signals."""

from __future__ import annotations

from typing import Any

from .path_source import PathSource


class DelayedPathSource(PathSource):
    """A `PathSource` with delayed signals; until t = delay they rest at the path's start.

    Args:
        delay: Delay of the signals [s].
        arguments: Arguments of `PathSource`, in its order.
    """

    def __init__(self, delay: float, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.delay = delay

    def _path_time(self, t: float) -> float:
        return t - self.delay
