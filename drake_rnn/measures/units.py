"""Numbers as they are read: few digits, superscripts, and units with the prefix that suits."""

from __future__ import annotations

import math

from ..signals import SERIES_UNITS

#: Units of the series of a run, by name; a series that is not listed has none.
UNITS = SERIES_UNITS
#: Prefixes and the factors to them, the coarsest first.
PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))
#: Units that take a prefix.
PREFIXED_UNITS = (
    *("m", "rad", "N", "s", "N m", "m/s", "m/s^2"),
    *("rad/s", "rad/s^2", "rad/s^3", "rad/s^4", "rad/s^5"),
)
#: Least number for which a coarser prefix is taken: 0.1, up to rounding.
LEAST = 0.1 * (1 - 1e-9)
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def raised(unit: str) -> str:
    """Return a unit with its powers as superscripts, such as ``rad/s²``."""
    head, *powers = unit.split("^")
    return head + "".join(power[:1].translate(_SUPERSCRIPTS) + power[1:] for power in powers)


def prefixed(size: float, unit: str) -> tuple[str, float]:
    """Return a unit as it is written, with the prefix that suits a size, and the factor to it.

    The coarsest prefix is taken that leaves at least 0.1. Units that nobody says with a prefix, and
    sizes that are zero or no numbers, have none.
    """
    written = raised(unit)
    if unit not in PREFIXED_UNITS or not math.isfinite(size) or size == 0.0:
        return written, 1.0
    suiting = (each for each in PREFIXES if abs(size) * each[1] >= LEAST)
    prefix, factor = next(suiting, PREFIXES[-1])
    return prefix + written, factor


def rounded(number: float) -> str:
    """Return a number as tables have it, with four significant digits."""
    return f"{number:.4g}"


def told(value: float, unit: str, digits: int = 4) -> str:
    """Return a number and its unit, such as ``0.37 µm``."""
    # Rounded before the prefix is chosen: 0.1 m rather than 1e+02 mm.
    value = float(f"{value:.{digits}g}") + 0.0
    written, factor = ("", 1.0) if unit == "1" else prefixed(value, unit)
    return f"{factor * value:.{max(digits, 4)}g} {written}".rstrip()
