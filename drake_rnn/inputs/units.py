"""Units and times of columns, which their names state: ``q1 [deg]``, ``time_ms``.

A column has a kind, such as an angle or a time. Only units of its kind are read; others are
refused, so that no current or velocity is followed as a position.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .messages import decimal

#: What the numbers of a column may be.
ColumnKind = Literal["time", "angle", "length", "angular velocity", "velocity", "number"]

_TURN = 2.0 * np.pi
_TIMES = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "usecs", "µs", "μs", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanos", "nanoseconds"), 1e-9),
}
_ANGLES = {
    **dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0),
    **dict.fromkeys(("mrad", "mrads", "milliradian", "milliradians"), 1e-3),
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), float(np.deg2rad(1.0))),
    **dict.fromkeys(("rev", "revs", "revolution", "revolutions", "turn", "turns"), _TURN),
}
_LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    "cm": 1e-2,
    "mm": 1e-3,
    **dict.fromkeys(("um", "µm", "μm"), 1e-6),
}


def _rates(units: Mapping[str, float]) -> dict[str, float]:
    """Return the units of what changes by some units in a second or a minute."""
    return {
        f"{unit}/{time}": factor / duration
        for unit, factor in units.items()
        for time, duration in (("s", 1.0), ("sec", 1.0), ("second", 1.0), ("min", 60.0))
    }


#: Units by the kind of the column, each in s, rad, m, rad/s, m/s or 1; the first of equals is named
#: in messages.
UNITS: Mapping[ColumnKind, Mapping[str, float]] = {
    "time": _TIMES,
    "angle": _ANGLES,
    "length": _LENGTHS,
    "angular velocity": {**_rates(_ANGLES), "rpm": _TURN / 60.0, "rps": _TURN},
    "velocity": _rates(_LENGTHS),
    "number": {"1": 1.0, "-": 1.0},
}
# Units of what is read nowhere, as they end a name; in brackets every text is a unit.
_FOREIGN = {
    *("A", "mA", "amp", "amps", "ampere", "amperes", "V", "mV", "volt", "volts", "W", "watts"),
    *("N", "kN", "newton", "newtons", "Nm", "N_m", "N*m", "mNm", "kNm", "Pa", "kPa", "MPa", "bar"),
    *("degC", "celsius", "kelvin", "counts", "ticks", "pulses", "pct", "percent", "inch", "inches"),
    *("ft", "feet", "px", "pixels"),
    *(f"{u}{by}s{k}" for u in ("rad", "deg", "m") for by in "/_" for k in (2, 3, "^2", "^3")),
}


def _alternatives(names: Collection[str]) -> str:
    return "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))


# In the end of a name a rate is q1_rad_s or q1_rad_per_s as well. A unit of one letter is small.
_RATES = [*UNITS["angular velocity"], *UNITS["velocity"]]
_WRITTEN = {each for unit in _RATES for each in (unit, unit.replace("/", "_per_"))}
_WRITTEN |= {unit.replace("/", "_") for unit in _RATES if not unit.endswith("/min")}
_WORDS = {name for kind in ("time", "angle", "length") for name in UNITS[kind] if name != "°"}
_KNOWN = _alternatives({name for name in _WORDS | _WRITTEN if len(name) > 1})
_SUFFIX = re.compile(rf"(.*?)[_ .]((?i:{_KNOWN})|[sm])")
_FOREIGN_SUFFIX = re.compile(rf"(.*?)[_ .]({_alternatives(_FOREIGN)})")
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")
# A second to the power of -1.
_INVERSE = re.compile(r"[ ·*._]?\(?(s|sec|min)\)?\s?(?:\^?\(?-1\)?|⁻¹)")


def split_unit(name: str, joints: Collection[str] = ()) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit; empty if it states none.

    Units are in brackets, ``q1 [deg]``, or at the end, ``time_ms``. Digits in brackets count, as in
    ``position[0]``, and are no unit.

    Args:
        name: Name of the column.
        joints: Names of joints, which are names also where they end like a unit.
    """
    name = name.strip()
    word = name.rstrip("]) ")
    if any(word.endswith(joint) and not word[: -len(joint)][-1:].isalnum() for joint in joints):
        return name, ""
    match = _BRACKETS.fullmatch(name)
    if match and match[1] and not match[2].isdigit():
        return match[1], match[2]
    match = None if match else _SUFFIX.fullmatch(name) or _FOREIGN_SUFFIX.fullmatch(name)
    return (match[1], match[2]) if match and match[1] else (name, "")


def factor_of(unit: str, kind: ColumnKind) -> float | None:
    """Return a unit in s, rad, m, rad/s, m/s or 1; None if it is no unit of the kind."""
    text = _INVERSE.sub(r"/\1", re.sub(r"\s*(?:/|_per_| per )\s*", "/", unit.strip()))
    units = UNITS[kind]
    if text in _FOREIGN:
        return None
    for each in (text, text.lower(), text.lower().replace("_", "/")):
        if each in units:
            return units[each]
    return None


def scale_of(
    name: str, kind: ColumnKind, joints: Collection[str] = (), otherwise: float = 1.0
) -> float:
    """Return the unit of a column in s, rad, m, rad/s, m/s or 1.

    Args:
        name: Name of the column.
        kind: What its numbers are.
        joints: See `split_unit`.
        otherwise: The unit of a column whose name states none.

    Raises:
        ValueError: If the unit is none of this kind; the message names the column.
    """
    _, unit = split_unit(name, joints)
    if not unit:
        return otherwise
    if (factor := factor_of(unit, kind)) is None:
        raise ValueError(
            f"column {name}: {unit!r} is no unit of {_article(kind)} {kind}; it may be "
            f"{_allowed(kind)}"
        )
    return factor


def _article(kind: ColumnKind) -> str:
    return "an" if kind[0] == "a" else "a"


def _allowed(kind: ColumnKind) -> str:
    """Return the units of a kind in words, one for each size."""
    by_size = {factor: unit for unit, factor in [*UNITS[kind].items()][::-1]}
    names = [by_size[f] for f in dict.fromkeys(UNITS[kind].values()) if "/min" not in by_size[f]]
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]


# Times since 1970, from 1979 to 2128 [s]; in no two units the same numbers are such times.
_EPOCH = (3e8, 5e9)
_TIME_NAMES = {"t", "time", "times", "timestamp", "stamp", "seconds", "elapsed", "elapsedtime"}
_TIME_NAMES |= {"rosbagtimestamp", "logtime", "datetime", "date", "timefromstart"}
# Of a number; a date has its hyphens elsewhere.
_EXPONENT = re.compile(r"[eE]-")


def is_time(name: str) -> bool:
    """Return whether a column is called as times are."""
    bare, unit = split_unit(name)
    bare = (name if unit in _FOREIGN and not name.endswith(("]", ")")) else bare).lower()
    last = bare.rsplit("/", 1)[-1].rsplit(".", 1)[-1]
    return re.sub(r"[%_ ]", "", bare) in _TIME_NAMES or last in ("stamp", "timestamp")


def time_columns(names: Sequence[str]) -> tuple[str, ...]:
    """Return the column of times, or the two of a stamp in seconds and nanoseconds; none without.

    Of several, one that is called ``t`` or ``time`` counts, and a date only if it is alone.

    Raises:
        ValueError: If two are called so.
    """
    names_by_lower = {name.lower(): name for name in names}
    for low, name in names_by_lower.items():
        for ending, other in (("secs", "nsecs"), ("sec", "nanosec"), ("sec", "nsec")):
            rest = low.removesuffix(ending) + other
            if low.endswith(ending) and rest in names_by_lower:
                return name, names_by_lower[rest]
    every = [name for name in names if is_time(name)]
    plain = [name for name in every if split_unit(name)[0].lower() in ("t", "time")]
    if len(plain) > 1:
        raise ValueError(f"column t is given twice, as {plain[0]} and as {plain[1]}; leave one out")
    dates = [name for name in every if name.lower() == "date"]
    return tuple((plain or [name for name in every if name not in dates] or dates)[:1])


def seconds(time: NDArray[Any], unit: float | None) -> tuple[NDArray[Any], bool]:
    """Return times from 0 on, if they are since 1970, and whether they are.

    Args:
        time: Times, shape (k,).
        unit: Their unit [s]; None if it is not known, and s unless they are since 1970.
    """
    first = float(time[0]) if len(time) else 0.0
    for scale in (1.0, 1e-3, 1e-6, 1e-9) if unit is None else (unit,):
        if _EPOCH[0] <= first * scale <= _EPOCH[1]:
            return (time - first) * scale, True
    return time * (1.0 if unit is None else unit), False


def time_unit(name: str) -> float | None:
    """Return the unit of a column of times [s]; None if its name states none.

    Raises:
        ValueError: If it states a unit of something else.
    """
    return scale_of(name, "time") if split_unit(name)[1] else None


def time_in(cell: str) -> float:
    """Return the time in a cell, a number, or a date in s since 1970.

    Raises:
        ValueError: If it is neither.
    """
    if "-" in cell[1:] and not _EXPONENT.search(cell):
        return datetime.fromisoformat(cell).timestamp()
    return decimal(cell)
