"""What a law declares and returns, checked, with errors that name the law and the part."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MethodType, NoneType
from typing import Any, Literal, TypeVar

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..inputs.numbers import is_number
from ..inputs.own_code import naming
from ..robot.limits import LIMIT_UNITS
from ..signals import RESERVED
from .called import FLOAT
from .law import ContinuousReading, JointPreview, Law, Reading, SampledReading
from .layout import Layout, Signals

_R = TypeVar("_R", bound=Reading)
_Flaws = Callable[[Any, Reading], Iterator[str]]


def _of_state(state: Layout, reading: Reading) -> Iterator[str]:
    if "v" not in state:
        parts = ", ".join(state.parts) or "no parts"
        yield f": must have the part v, the joint velocities that it commands; it has {parts}"
    elif len(shape := state.parts["v"][1]) != 1:
        yield f": its part v must have the shape (joints,), not {shape}"
    yield from (_TAKEN.format(part) for part in state.parts if part in RESERVED)


def _of_inputs(inputs: Layout, reading: Reading) -> Iterator[str]:
    (joints,) = reading.state.parts["v"][1]
    for part in inputs.parts.keys() & {"J", "J_omega"}:
        (_, shape) = inputs.parts[part]
        if shape[1:] != (joints,):
            yield (
                f": {part} must have one column for each of {joints} joints, shape "
                f"(rows, {joints}), not {shape}"
            )


def _of_observables(observables: Layout, reading: Reading) -> Iterator[str]:
    taken = RESERVED | reading.state.parts.keys()
    return (_TAKEN.format(part) for part in observables.parts if part in taken)


def _of_gains(gains: Mapping[str, Any], law: Reading) -> Iterator[str]:
    said = "[{!r}]: must be a number of at least 0, not {}".format
    return (said(k, short(g)) for k, g in gains.items() if not (is_number(g) and g >= 0.0))


def _of_keeps(names: tuple[object, ...], law: Reading) -> Iterator[str]:
    said = f": may name {', '.join(LIMIT_UNITS)}, not {{}}".format
    return (said(short(name)) for name in names if name not in LIMIT_UNITS)


def _fine(value: object, law: Reading) -> Iterator[str]:
    return iter(())


_TAKEN = ": {!r} is the name of another recorded signal"
#: What laws declare: whether every `Reading` does or a `Law` alone, the member's name, its value of
#: a law, the classes that this may be of, and what tells the ends of messages about what else is
#: wrong with it. Later members may rely on earlier ones.
_DECLARED: tuple[tuple[type, str, Callable[[Any], Any], tuple[type, ...], _Flaws], ...] = (
    (Reading, "state", lambda law: law.state, (Layout,), _of_state),
    (Reading, "inputs", lambda law: law.inputs, (Layout,), _of_inputs),
    (Reading, "observables", lambda law: law.observables, (Layout,), _of_observables),
    (Reading, "takes_many", lambda law: law.takes_many, (bool,), _fine),
    (Reading, "integration_scheme", lambda law: law.integration_scheme, (str,), _fine),
    (Law, "loop_gains", lambda law: law.loop_gains, (Mapping,), _of_gains),
    (Law, "sampled_gains", lambda law: law.sampled_gains, (Mapping,), _of_gains),
    (Law, "joint_preview", lambda law: law.joint_preview, (JointPreview, NoneType), _fine),
    (Law, "keeps", lambda law: law.keeps, (tuple,), _of_keeps),
    (Law, "keeps_distance", lambda law: law.keeps_distance, (float, NoneType), _fine),
    (Law, "stays_on_path", lambda law: law.stays_on_path, (bool,), _fine),
    (Law, "follows_joint_targets", lambda law: law.follows_joint_targets, (bool,), _fine),
    (Law, "levels_are_derivatives", lambda law: law.levels_are_derivatives, (bool,), _fine),
    (Law, "limits_remedy", lambda law: law.limits_remedy, (str,), _fine),
)


def check_declared(reading: Reading) -> None:
    """Raise an InvalidInputError if what a law or a reading declares is not what it may be."""
    for declares, name, read, kinds, flaws in _DECLARED:
        if not isinstance(reading, declares):
            continue
        place = f"{_class(reading)}.{name}"
        with naming(place):
            value = read(reading)
            if isinstance(value, MethodType):
                raise InvalidInputError(f"{place}: is a method; decorate it with @property")
            require_type(place, value, *kinds)
            for complaint in flaws(value, reading):
                raise InvalidInputError(f"{place}{complaint}")


def sampled_reading(law: Law, period: float) -> SampledReading:
    """Return the law's reading at a fixed period, with all that it declares checked.

    Args:
        law: The law.
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or declares what is wrong.
    """
    return _reading(law, "sampled", lambda: law.sampled(period), SampledReading)


def continuous_reading(law: Law) -> ContinuousReading:
    """Return the reading of a law that Drake integrates, with all that it declares checked.

    Args:
        law: The law.

    Raises:
        InvalidInputError: If the law is not a differential equation, or declares what is wrong.
    """
    return _reading(law, "continuous", law.continuous, ContinuousReading)


def _reading(law: Law, part: str, read: Callable[[], _R], kind: type) -> _R:
    check_declared(law)
    with naming(f"{_class(law)}.{part}"):
        reading = read()
    require_type(f"{_class(law)}.{part}()", reading, kind)
    if reading is not law:
        check_declared(reading)
    return reading


def warnings_of(
    reading: Reading, part: Literal["doubts", "caveats"], tell: Callable[[], object]
) -> list[str]:
    """Return the warnings of a law before a run, or of its reading after one.

    Args:
        reading: The law, or its reading.
        part: Its method that tells them.
        tell: Calls this method.

    Raises:
        InvalidInputError: If the law cannot run so, or returns something else.
    """
    place = f"{_class(reading)}.{part}"
    with naming(place):
        value = tell()
    if isinstance(value, list) and all(isinstance(text, str) for text in value):
        return value
    raise InvalidInputError(f"{place}: must return a list of texts, not {short(value)}")


def flaw(value: object, shape: tuple[int, ...]) -> str:
    """Return what a value must be, and what it is; an empty text if it is what it must be.

    Args:
        value: What the law has returned.
        shape: Shape that it must have.
    """
    wanted = f"a NumPy array of floats, shape {shape}"
    if not isinstance(value, np.ndarray):
        return f"{wanted}, not {'None' if value is None else 'a ' + type(value).__name__}"
    if value.shape != shape:
        return f"{wanted}, not {value.shape}"
    if value.dtype != FLOAT:
        return f"{wanted}, not of {value.dtype}"
    return "" if type(value) is np.ndarray else f"{wanted}, not a {type(value).__name__}"


def is_finite(value: Array) -> bool:
    """Return whether all entries of an array are finite, however large their sum."""
    return bool(np.isfinite(value).all())


def observables_of(reading: Reading, t: float | Array, x: Array, u: Signals) -> Signals:
    """Return the law's observables by name, checked, of one instant or of many.

    Args:
        reading: Reading of the law.
        t: Time, a number or shape (k,) [s].
        x: State, shape (size,) or (k, size).
        u: Signals; of many instants with a leading dimension of k.

    Raises:
        InvalidInputError: If the law fails, or returns other names or shapes than it declares.
    """
    place, lead = f"{_class(reading)}.diagnostics", x.shape[:-1]
    many = f" for {lead[0]} instants at once" if lead else ""
    with naming(f"{place}{many}"):
        told = reading.diagnostics(t, x, u)
    if not isinstance(told, Mapping):
        raise InvalidInputError(
            f"{place}: must return a mapping of names to arrays, not {short(told)}"
        )
    declared = reading.observables.parts
    if told.keys() != declared.keys():
        raise InvalidInputError(
            f"{place}: must return its observables, {', '.join(declared) or 'none'}; it returns "
            f"{', '.join(map(str, told)) or 'none'}"
        )
    for name, (_, shape) in declared.items():
        value = told[name]
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            raise InvalidInputError(
                f"{place}: {name} must be an array of numbers, not {short(value)}"
            )
        if value.shape != lead + shape:
            raise InvalidInputError(
                f"{place}: {name} must have the shape {lead + shape}{many}, not {value.shape}"
            )
    return told


def _class(law: object) -> str:
    return type(law).__name__
