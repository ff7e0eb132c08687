"""A trial of a law at its start, so that what it returns is checked before it moves an arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

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
# What a controller calls: its name, the shape of the result, and the function.
_Part = tuple[str, tuple[int, ...], _Call]
# Largest relative difference between a robot's result alone and among others: sums are added in
# another order, and a network's equations enlarge rounding by a million.
_ROUNDING = 1e-6
# Period of a trial before the law is to run [s].
_PERIOD = 1e-3


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
    for part in _calls(reading, period):
        value = _checked(part, t, *one)
        if reading.takes_many:
            _require_both(part[0], [value, value], part[2], t, two)
    observables_of(reading, t, *one)
    # Recorded runs are computed in one call for all instants.
    observables_of(reading, np.array([t, t]), *two)


def try_pair(pair: Sequence[Reading], together: Reading) -> None:
    """Try two readings side by side with made-up signals, before a batch begins.

    Args:
        pair: Both readings, each of one robot.
        together: One reading with the numbers of both.

    Raises:
        InvalidInputError: If the robots do not get side by side what each gets alone; the message
            names the law, the part and the shapes. An error of a robot alone, with signals that no
            arm has, is left to the run.
    """
    rng = np.random.default_rng(0)
    try:
        with np.errstate(all="ignore"):
            each = [_made_up(reading, rng) for reading in pair]
            parts = zip(*(_calls(reading, _PERIOD) for reading in pair), strict=True)
            alone = [
                [_checked(part, 0.0, *seen) for part, seen in zip(both, each, strict=True)]
                for both in parts
            ]
    except InvalidInputError:
        return
    x = np.stack([state for state, _ in each])
    u = {name: np.stack([signals[name] for _, signals in each]) for name in together.inputs.parts}
    two = _shown(x, u)
    for (place, _, call), values in zip(_calls(together, _PERIOD), alone, strict=True):
        with np.errstate(all="ignore"):
            _require_both(place, values, call, 0.0, two)


def _made_up(reading: Reading, rng: np.random.Generator) -> tuple[Array, Signals]:
    """Return a state and signals of the size of an arm's; rotations and inertias are identities."""

    def likely(name: str, shape: tuple[int, ...]) -> Array:
        return np.eye(shape[0]) if name == "M" or name[:2] == "R_" else rng.uniform(0.1, 0.5, shape)

    u = {name: likely(name, shape) for name, (_, shape) in reading.inputs.parts.items()}
    # The initial state may depend on a J that the law cannot see.
    J = likely("J", (3, *reading.state.parts["v"][1]))
    return _shown(started(reading, rng, {"J": J, **u}, 0.0), u)


def _calls(reading: Reading, period: float | None) -> Iterator[_Part]:
    """Yield what a controller calls: name, shape of the result, and function."""
    name, size = type(reading).__name__, reading.state.size
    (_, v_shape) = reading.state.parts["v"]
    yield f"{name}.commanded_velocity", v_shape, lambda t, x, u: reading.commanded_velocity(t, x)
    if isinstance(reading, SampledReading) and period is not None:
        step = unchecked(reading.step)
        yield f"{name}.step", (size,), lambda t, x, u: step(t, x, u, period)
    elif isinstance(reading, ContinuousReading):
        yield f"{name}.derivatives", (size,), unchecked(reading.derivatives)


def _checked(part: _Part, t: float, x: Array, u: Signals) -> Array:
    """Return what a part of a law returns to one robot, checked."""
    place, shape, call = part
    with naming(place, t):
        value = call(t, x, u)
    _require_array(place, value, shape, t)
    return value


def _require_array(place: str, value: Array, shape: tuple[int, ...], t: float) -> None:
    if complaint := flaw(value, shape):
        raise InvalidInputError(f"{place}: must return {complaint}{at(t)}")
    if not is_finite(value):
        raise InvalidInputError(
            f"{place}: must return finite numbers, not {np.round(value, 4).tolist()}{at(t)}"
        )


def _require_both(
    place: str, alone: Sequence[Array], call: _Call, t: float, two: tuple[Array, Signals]
) -> None:
    """Raise an InvalidInputError unless each of two robots gets what it gets alone."""
    x, u = two
    cause, wanted = None, np.stack(alone)
    try:
        both = call(t, x, u)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        cause, complaint = error, f"raised {described(error)}"
    else:
        scale = _ROUNDING * (1.0 + np.abs(wanted).max(initial=0.0))
        if complaint := flaw(both, wanted.shape):
            complaint = f"must return {complaint}"
        elif not np.allclose(both, wanted, rtol=0.0, atol=scale):
            complaint = f"must return {short(wanted)}, what each gets alone, not {short(both)}"
    if complaint:
        given = ", ".join(f"{name} {value.shape}" for name, value in {"x": x, **u}.items())
        raise InvalidInputError(
            f"{place}: called with two robots, as takes_many allows, {complaint}{at(t)}; arguments "
            f"were {given}"
        ) from cause


class _Seen(dict[str, Array]):
    """Signals that a law sees; asking for another one is told in full."""

    def __missing__(self, name: str) -> Array:
        raise KeyError(f"{name} is not among its inputs, {', '.join(self) or 'none'}")


def _shown(x: Array, u: Signals, *robots: int) -> tuple[Array, Signals]:
    """Return a state and signals that cannot be modified, the same for a number of robots."""
    seen = {name: np.broadcast_to(value, (*robots, *value.shape)) for name, value in u.items()}
    return np.broadcast_to(x, (*robots, *x.shape)), MappingProxyType(_Seen(seen))
