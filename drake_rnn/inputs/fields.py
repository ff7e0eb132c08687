"""Validated arguments, the same in Python and in a YAML file.

- Checks of arguments where no `validated` class makes them: each refused by its name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass as plain_dataclass
from functools import wraps
from math import pi
from types import NoneType
from typing import Annotated, Any, TypeVar, dataclass_transform, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    WithJsonSchema,
)
from pydantic.dataclasses import dataclass

from ..errors import InvalidInputError
from .keys import with_arguments
from .messages import field_names, is_number, is_whole, nearest, require_type, sentence, short

Array = NDArray[np.float64]


# Entry of a point or direction, whose square is still far from the largest number.
_FARTHEST = 1e9


def _vector(value: Any) -> Array:
    """Return a read-only copy of ``value`` as floats, so that it cannot change later."""
    if not isinstance(value, (list, tuple, np.ndarray)):
        raise ValueError("must be a list of numbers")
    try:
        array = np.array(value)
    except ValueError:
        raise ValueError("must be one list of numbers") from None
    # Neither true nor "4" is a number.
    if (array.size and array.dtype.kind not in "iuf") or _has_flags(value):
        raise ValueError("must be a list of numbers")
    vector = array.astype(float)
    if vector.ndim != 1 or np.isnan(vector).any():
        raise ValueError("must be one list of numbers, none of them NaN")
    vector.setflags(write=False)
    return vector


def _has_flags(value: Any) -> bool:
    """Return whether true or false is among numbers, where NumPy would take it for one."""
    if isinstance(value, np.ndarray):
        return False
    if isinstance(value, (list, tuple)):
        return any(map(_has_flags, value))
    return isinstance(value, (bool, np.bool_))


def rows_of_numbers(value: Any, width: int) -> Array | None:
    """Return rows of finite numbers, read-only, shape (k, width); None if a value is no such."""
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in "iuf" or array.ndim != 2 or array.shape[1] != width:
        return None
    if _has_flags(value) or not np.isfinite(array).all():
        return None
    array = array.astype(float)
    array.setflags(write=False)
    return array


def _finite_vector(value: Any) -> Array:
    vector = _vector(value)
    if not np.isfinite(vector).all():
        raise ValueError("must be finite")
    return vector


def _point(value: Any) -> Array:
    vector = _finite_vector(value)
    if vector.size != 3:
        raise ValueError(f"must have 3 entries, not {vector.size}")
    if (np.abs(vector) > _FARTHEST).any():
        raise ValueError(f"may have entries up to {_FARTHEST:g}")
    return vector


@plain_dataclass(frozen=True)
class _Between(AfterValidator):
    """A validator of numbers between two bounds, which a JSON schema tells too."""

    low: float
    high: float

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {**handler(schema), "minimum": self.low, "maximum": self.high}


def between(low: float, high: float) -> AfterValidator:
    """Return a validator of numbers from ``low`` to ``high``."""

    def between(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"may be {low:g} to {high:g}" if low else f"may be at most {high:g}")
        return value

    return _Between(between, low, high)


def _angle(value: float) -> float:
    if abs(value) > 2 * pi:
        raise ValueError("must be at most one turn, 2 pi, in radians")
    return value


def _angles(value: Any) -> Array:
    angles = _point(value)
    if (np.abs(angles) > 2 * pi).any():
        raise ValueError("must be angles of at most one turn, 2 pi, in radians")
    return angles


def zeros() -> Array:
    """Return a read-only zero vector, shape (3,), the default of a `Point`."""
    return _point([0.0, 0.0, 0.0])


def _number_or_vector(value: Any) -> float | Array:
    if isinstance(value, (list, tuple, np.ndarray)):
        vector = _finite_vector(value)
        if not vector.size:
            raise ValueError("must be a number or a list of numbers, one or more")
        return vector
    if not is_number(value):
        raise ValueError("must be a number or a list of numbers")
    return float(value)


def _positive(value: Any) -> float | Array:
    number_or_array = _number_or_vector(value)
    if not (np.asarray(number_or_array) > 0).all():
        raise ValueError("must be greater than 0")
    return number_or_array


def _non_negative(value: Any) -> float | Array:
    number_or_array = _number_or_vector(value)
    if not (np.asarray(number_or_array) >= 0).all():
        raise ValueError("must be greater than or equal to 0")
    return number_or_array


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_THREE = WithJsonSchema({**_NUMBERS, "minItems": 3, "maxItems": 3})
Bounds = Annotated[Array, BeforeValidator(_vector), WithJsonSchema(_NUMBERS)]
Vector = Annotated[Array, BeforeValidator(_finite_vector), WithJsonSchema(_NUMBERS)]
Point = Annotated[Array, BeforeValidator(_point), _THREE]
# Strict: 4 is a number; true and "4" are not.
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
# Of signals that are stored until they are due [s].
Delay = Annotated[float, Field(strict=True, ge=0, le=5, allow_inf_nan=False)]
# Of two bodies in contact; rubber on rubber has hardly more than 2.
Friction = Annotated[float, Field(strict=True, ge=0, le=10, allow_inf_nan=False)]
# What follows is wide for any robot; what lies outside is a slip, of a unit or of an exponent.
# Of a network, a feedback or a pull [1/s], and of what weighs one aim against another.
Gain = Annotated[Positive, between(1e-6, 1e9)]
GainOrZero = Annotated[NonNegative, between(0.0, 1e9)]
# Of what keeps a matrix regular or a solution small; the less, the fainter.
Weight = Annotated[Positive, between(0.0, 1e6)]
# Of a motion, from a microsecond to eleven days [s].
Time = Annotated[Positive, between(1e-6, 1e6)]
# Of what a loop of a robot waits for [s]: neither less than its period nor longer than an hour.
Wait = Annotated[Positive, between(1e-4, 3600.0)]
# Of a network [s].
TimeConstant = Annotated[Positive, between(1e-9, 1e3)]
# Of an end effector; the fastest robots reach 15 [m/s].
Speed = Annotated[Positive, between(1e-6, 20.0)]
# Of a surface, from foam to steel [N/m].
Stiffness = Annotated[Positive, between(1.0, 1e9)]
# Hydroelastic modulus, from foam to diamond [Pa].
Modulus = Annotated[Positive, between(1e3, 1e13)]
# Of a tool [kg].
Mass = Annotated[Positive, between(1e-6, 1e3)]
# At most one turn [rad]; more are degrees.
Angle = Annotated[Finite, AfterValidator(_angle)]
Angles = Annotated[Array, BeforeValidator(_angles), _THREE]
# Neither 1 nor "yes".
Flag = Annotated[bool, Field(strict=True)]
# Of what a robot traces or touches: from a micrometre to a kilometre [m].
Length = Annotated[float, Field(strict=True, ge=1e-6, le=1e3, allow_inf_nan=False)]
# One number for all joints, or one for each.
FiniteEach = Annotated[float | Array, BeforeValidator(_number_or_vector)]
PositiveEach = Annotated[float | Array, BeforeValidator(_positive)]
NonNegativeEach = Annotated[float | Array, BeforeValidator(_non_negative)]
# Any whole number.
Whole = Annotated[int, Field(strict=True)]
Count = Annotated[int, Field(strict=True, ge=1)]
Seed = Annotated[int, Field(strict=True, ge=0)]


@dataclass_transform(frozen_default=True, kw_only_default=True)
def validated(cls: type) -> type:
    """Make ``cls`` a frozen, keyword-only dataclass that checks its fields and refuses others.

    Its constructor raises an `InvalidInputError` of one sentence for invalid arguments.
    """
    require_type("cls", cls, type)
    config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
    # pydantic 2.11 copies annotations of inherited fields to a class whose module need not know the
    # names in them. One that refers to a later name stays a text.
    with suppress(NameError):
        hints = get_type_hints(cls, include_extras=True)
        cls.__annotations__ = {name: hints[name] for name in vars(cls).get("__annotations__", {})}
    dataclass_type = dataclass(frozen=True, eq=False, kw_only=True, config=config)(cls)
    construct = dataclass_type.__init__

    @wraps(construct)
    def init(self: Any, *args: Any, **fields: Any) -> None:
        if args:
            first = next(name for name in field_names(dataclass_type) if name != "kind")
            raise InvalidInputError(
                f"{cls.__name__}: takes keyword arguments only, e.g. {cls.__name__}({first}=...)"
            )
        try:
            construct(self, **fields)
        except ValidationError as error:
            raise InvalidInputError(
                sentence(dataclass_type, error.errors(include_url=False), cls.__name__)
            ) from None
        for name, value in fields.items():
            # Some versions of NumPy make a number of an array that holds one.
            if isinstance(value, np.ndarray) and value.ndim and isinstance(vars(self)[name], float):
                raise InvalidInputError(
                    f"{cls.__name__}.{name}: must be a number, not {short(value)}"
                )

    setattr(dataclass_type, "__init__", init)  # noqa: B010  mypy forbids the assignment
    dataclass_type.__doc__ = with_arguments(dataclass_type)
    return dataclass_type


F = TypeVar("F", bound=Callable[..., Any])
#: Function of an argument's name and value that raises an `InvalidInputError` if it is wrong.
Check = Callable[[str, Any], None]


def checked(**checks: Check) -> Callable[[F], F]:
    """Return a decorator of a function, or of a class, whose arguments are checked before it runs.

    Defaults are not checked. An argument that is missing, unknown or too many is an
    InvalidInputError.

    Args:
        checks: For each argument, by its name, what checks it; in this order.
    """

    def decorate(made: F) -> F:
        function = made.__init__ if isinstance(made, type) else made  # type: ignore[misc]
        signature = inspect.signature(function)
        if strange := checks.keys() - signature.parameters.keys():
            raise TypeError(f"{function.__qualname__} has no argument {min(strange)!r} to check")

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            try:
                arguments = signature.bind(*args, **kwargs).arguments
            except TypeError as error:
                raise _wrong_call(function, signature, error) from None
            for name, check in checks.items():
                if name in arguments:
                    check(name, arguments[name])
            return function(*args, **kwargs)

        if not isinstance(made, type):
            return call  # type: ignore[return-value]
        setattr(made, "__init__", call)  # noqa: B010  mypy forbids the assignment
        return made

    return decorate


def _wrong_call(
    function: Callable[..., Any], signature: inspect.Signature, error: TypeError
) -> InvalidInputError:
    """Return the error of a call whose arguments a function does not have."""
    names = [each for each in signature.parameters if each not in ("self", "cls")]
    name = function.__qualname__.removesuffix(".__init__")
    return InvalidInputError(f"{name}: {error}; its arguments are {', '.join(names) or 'none'}")


T = TypeVar("T", bound=type)


def with_own_errors(cls: T) -> T:
    """Have calls of a class and its public methods with wrong arguments raise an InvalidInputError.

    A decorator, which costs a call that is right a tenth of a microsecond.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        signature = inspect.signature(function)

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            try:
                return function(*args, **kwargs)
            except TypeError:
                try:
                    signature.bind(*args, **kwargs)
                except TypeError as error:
                    raise _wrong_call(function, signature, error) from None
                raise

        return call

    for name, member in list(vars(cls).items()):
        if inspect.isfunction(member) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, decorate(member))
    return cls


def instance(*kinds: type | None) -> Check:
    """Return a check that a value is of one of these classes, or None if that is among them."""
    classes = tuple(NoneType if kind is None else kind for kind in kinds)
    return lambda key, value: require_type(key, value, *classes)


def optional(check: Check) -> Check:
    """Return a check that a value is None or passes another one."""

    def check_given(key: str, value: Any) -> None:
        if value is not None:
            check(key, value)

    return check_given


def is_name(text: str) -> bool:
    """Return whether a text may name something: it is not blank, and can be printed in a line."""
    return bool(text.strip()) and text.isprintable()


def number(least: float = -np.inf, *, above: float = -np.inf, most: float = np.inf) -> Check:
    """Return a check that a value is finite, from ``least`` to ``most`` and above ``above``."""
    bounds = [f" of at least {least:g}"] if least > -np.inf else []
    bounds += [f" above {above:g}"] if above > -np.inf else []

    def check(key: str, value: Any) -> None:
        if above == 0.0 and isinstance(value, float) and not 0.0 < value < np.inf:
            what = "positive" if value <= 0.0 else "positive and finite"
            raise InvalidInputError(f"{key}: must be {what}, not {short(value)}")
        if not is_number(value) or value < least or value <= above:
            raise InvalidInputError(
                f"{key}: must be a finite number{''.join(bounds)}, not {short(value)}"
            )
        if value > most:
            raise InvalidInputError(f"{key}: may be at most {most:g}, not {short(value)}")

    return check


def whole(least: int = 0, most: int = 2**63 - 1) -> Check:
    """Return a check that a value is a whole number between two bounds."""

    def check(key: str, value: Any) -> None:
        if not is_whole(value) or value < least:
            raise InvalidInputError(
                f"{key}: must be a whole number of at least {least}, not {short(value)}"
            )
        if value > most:
            raise InvalidInputError(f"{key}: may be at most {most}, not {short(value)}")

    return check


def choice(names: Collection[str]) -> Check:
    """Return a check that a value is one of several names."""

    def check(key: str, value: Any) -> None:
        if not isinstance(value, str):
            raise InvalidInputError(f"{key}: may be {', '.join(names)}, not {short(value)}")
        if value not in names:
            raise InvalidInputError(f"{key}: no {value!r}; {nearest(value, list(names))}")

    return check


def each(*kinds: type) -> Check:
    """Return a check that a value is a list or tuple of objects of these classes."""

    def check(key: str, value: Any) -> None:
        if not isinstance(value, (list, tuple)):
            raise InvalidInputError(f"{key}: must be a list, not {short(value)}")
        for number, entry in enumerate(value):
            require_type(f"{key}[{number}]", entry, *kinds)

    return check


def function(of: str = "") -> Check:
    """Return a check that a value can be called, as a function ``of`` something."""

    def check(key: str, value: Any) -> None:
        if not callable(value):
            what = f"a function of {of}" if of else "a function"
            raise InvalidInputError(f"{key}: must be {what}, not {short(value)}")

    return check


def offering(*methods: str) -> Check:
    """Return a check that an object has methods of these names, of whatever class it is."""

    def check(key: str, value: Any) -> None:
        if not all(callable(getattr(value, name, None)) for name in methods):
            raise InvalidInputError(
                f"{key}: must have the methods {' and '.join(methods)}, not {short(value)}"
            )

    return check


def flag(key: str, value: Any) -> None:
    """Raise an InvalidInputError unless a value is true or false."""
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidInputError(f"{key}: must be true or false, not {short(value)}")


def vector(key: str, value: Any) -> None:
    """Raise an InvalidInputError unless a value is one list of finite numbers."""
    if not is_vector(value) or not np.isfinite(np.asarray(value, dtype=float)).all():
        raise InvalidInputError(f"{key}: must be one list of finite numbers, not {short(value)}")


def real_array(key: str, value: Any) -> Array:
    """Return a value as an array of floats; NaN and infinity are such.

    Raises:
        InvalidInputError: If it is no array of real numbers.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0, dtype=object)
    if array.dtype.kind not in "iuf" and array.size:
        raise InvalidInputError(f"{key}: must be real numbers, not {short(value)}")
    if array.dtype.kind == "O":
        raise InvalidInputError(f"{key}: must be real numbers, not {short(value)}")
    return np.asarray(array, dtype=float)


def is_flags(value: Any) -> bool:
    """Return whether a value is one list of true and false."""
    try:
        array = np.asarray(value)
    except ValueError:
        return False
    return array.ndim == 1 and array.dtype.kind == "b"


def is_vector(value: Any) -> bool:
    """Return whether a value is one list of real numbers; NaN and infinity are such."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return array.ndim == 1 and array.size > 0 and array.dtype.kind in "iuf"


def require_seed(seed: object) -> None:
    """Raise an InvalidInputError unless a seed is a whole number of at least 0."""
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or seed < 0:
        raise InvalidInputError(f"seed: must be a whole number of at least 0, not {short(seed)}")
