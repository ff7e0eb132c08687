"""What is a number, in Python and in a text."""

from __future__ import annotations

import re
from math import isfinite
from numbers import Integral, Real
from typing import Any

# As files of any program have them: Python would also take 1_000 and the digits of any script.
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def is_number(value: Any) -> bool:
    """Return whether a value is a finite number; true and false are none."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        # A whole number that is larger than any other.
        return False


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number, of Python or NumPy; true and false are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def decimal(text: str) -> float:
    """Return the number that a text is.

    Raises:
        ValueError: If it is none, or none that is finite.
    """
    stripped = text.strip()
    if not _DECIMAL.fullmatch(stripped) or not isfinite(number := float(stripped)):
        raise ValueError(f"must be a finite decimal number, not {text!r}")
    return number
