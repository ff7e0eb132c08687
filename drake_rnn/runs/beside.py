"""Steps of two arms that are recorded together."""

from __future__ import annotations

from dataclasses import replace

from ..laws.layout import Layout
from ..measures import Steps

#: What the names of a second arm's systems and recorded ports begin with.
PREFIX = "second_"
#: Name of the folder with a second arm's result, in that of the run.
SECOND = "second"


def of_second(steps: Steps) -> Steps:
    """Return steps as the second arm has them: its own ports first, the first arm's as second."""
    parts = steps.layout.parts
    layout = Layout(**{_swapped(name): shape for name, (_, shape) in parts.items()})
    return replace(steps, layout=layout)


def _swapped(name: str) -> str:
    return name.removeprefix(PREFIX) if name.startswith(PREFIX) else PREFIX + name
