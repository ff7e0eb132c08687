"""How a measure gets the runs that it looks at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from ..runs.result import Result


class Run(Protocol):
    """A function that returns the result of a shipped experiment with changes by dotted key."""

    def __call__(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result; it is made once, whatever asks for it."""
