"""A trial of a law at its start, so that what it returns is checked before it moves an arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from weakref import WeakValueDictionary

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array
from ..inputs.own_code import at, described, naming
from .called import unchecked
from .checks import flaw, is_finite, observables_of
from .law import ContinuousReading, Reading, SampledReading
from .layout import Signals

_Call = Callable[[float, Array, Signals], Array]
# What two robots at once get and one alone gets may differ by this share: sums are added in another
# order, and a network's equations enlarge rounding by a million.
_ROUNDING = 1e-6
# Of a trial before the law is to run [s].
_PERIOD = 1e-3
# Readings that `try_two` has tried, by their identity.
_TRIED: WeakValueDictionary[int, Reading] = WeakValueDictionary()


def started(reading: Reading, rng: np.random.Generator, u: Signals, t: float) -> Array:
    """Return the law's initial state, shape (state.size,), checked.

    Args:
        reading: Reading of the law.
        rng: Random generator with the experiment's seed.
        u: Signals at the start.
        t: Time of the start [s].

    Raises:
        InvalidInputError: If the law fails, or returns something else than a finite state.
    """
    place = f"{type(reading).__name__}.initial_state"
    with naming(place, t):
        x = reading.initial_state(rng, u)
    _require_array(place, x, (reading.state.size,), t)
    return x


def try_reading(
    reading: Reading, t: float, x: Array, u: Mapping[str, Array], period: float | None
) -> None:
    """Call each part of a law, with arrays that it cannot modify, and check the results.

    A law that `takes_many` robots is called with two as well, alike, which must get what one gets.
    Without finite signals there is nothing to try: the run itself will name the one that is not.

    Args:
        reading: Reading of the law.
        t: Time [s].
        x: State, shape (state.size,).
        u: Signals by name.
        period: Sampling period [s]; None for a law that Drake integrates.

    Raises:
        InvalidInputError: If the law fails, modifies its arguments, or returns what is wrong; the
            message names the law, the part and the time.
    """
    if not all(np.isfinite(value).all() for value in (x, *u.values())):
        return
    one, two = _shown(x, u), _shown(x, u, 2)
    for place, shape, call in _calls(reading, period):
        with naming(place, t):
            value = call(t, *one)
        _require_array(place, value, shape, t)
        if reading.takes_many:
            _require_both(place, value, call, t, two)
    observables_of(reading, t, *one)
    # Recorded runs are computed in one call for all instants.
    observables_of(reading, np.array([t, t]), *two)


def try_two(reading: Reading) -> None:
    """Try a reading that takes many robots with two, of signals made up, before a batch begins.

    Args:
        reading: The reading; it is tried once.

    Raises:
        InvalidInputError: If two robots do not get what one gets; the message names the law, the
            part and the shapes. What fails for one, of signals that no arm has, is left to the run.
    """
    if _TRIED.get(id(reading)) is reading:
        return
    _TRIED[id(reading)] = reading
    rng = np.random.default_rng(0)
    (_, (n,)), inputs = reading.state.parts["v"], reading.inputs.parts
    u = {name: _likely(name, shape, rng) for name, (_, shape) in inputs.items()}
    try:
        with np.errstate(all="ignore"):
            # The initial state may depend on a J that the law cannot see.
            x = started(reading, rng, {"J": _likely("J", (3, n), rng), **u}, 0.0)
            try_reading(reading, 0.0, x, u, _PERIOD)
    except _NotOfManyError:
        raise
    except InvalidInputError:
        return


class _NotOfManyError(InvalidInputError):
    """Two robots do not get what one gets."""


def _likely(name: str, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Return a signal of the size of an arm's; rotations and inertias are the identity."""
    return np.eye(shape[0]) if name == "M" or name[:2] == "R_" else rng.uniform(0.1, 0.5, shape)


def _calls(reading: Reading, period: float | None) -> Iterator[tuple[str, tuple[int, ...], _Call]]:
    """Yield what a controller calls: name, shape of the result, and function."""
    name, size = type(reading).__name__, reading.state.size
    (_, v_shape) = reading.state.parts["v"]
    yield f"{name}.commanded_velocity", v_shape, lambda t, x, u: reading.commanded_velocity(t, x)
    if isinstance(reading, SampledReading) and period is not None:
        step = unchecked(reading.step)
        yield f"{name}.step", (size,), lambda t, x, u: step(t, x, u, period)
    elif isinstance(reading, ContinuousReading):
        yield f"{name}.derivatives", (size,), unchecked(reading.derivatives)


def _require_array(place: str, value: Array, shape: tuple[int, ...], t: float) -> None:
    if complaint := flaw(value, shape):
        raise InvalidInputError(f"{place}: must return {complaint}{at(t)}")
    if not is_finite(value):
        raise InvalidInputError(
            f"{place}: must return finite numbers, not {np.round(value, 4).tolist()}{at(t)}"
        )


def _require_both(
    place: str, alone: Array, call: _Call, t: float, two: tuple[Array, Signals]
) -> None:
    """Raise an InvalidInputError unless each of two robots gets what one alone gets."""
    x, u = two
    cause = None
    try:
        both = call(t, x, u)
    except Exception as error:
        cause, complaint = error, f"raised {described(error)}"
    else:
        scale = _ROUNDING * (1.0 + np.abs(alone).max(initial=0.0))
        if complaint := flaw(both, (2, *alone.shape)):
            complaint = f"must return {complaint}"
        elif not np.allclose(both, alone, rtol=0.0, atol=scale):
            complaint = f"must return for each {short(alone)}, as for one, not {short(both)}"
    if complaint:
        given = ", ".join(f"{name} {value.shape}" for name, value in {"x": x, **u}.items())
        raise _NotOfManyError(
            f"{place}: with takes_many it must take robots along leading axes; of two, with "
            f"{given}: {complaint}{at(t)}"
        ) from cause


class _Seen(dict[str, Array]):
    """Signals that a law sees; asking for another one is told in full."""

    def __missing__(self, name: str) -> Array:
        raise KeyError(f"{name} is not among its inputs, {', '.join(self) or 'none'}")


def _shown(x: Array, u: Signals, *robots: int) -> tuple[Array, Signals]:
    """Return a state and signals that cannot be modified, the same for a number of robots."""
    seen = {name: np.broadcast_to(value, (*robots, *value.shape)) for name, value in u.items()}
    return np.broadcast_to(x, (*robots, *x.shape)), MappingProxyType(_Seen(seen))
