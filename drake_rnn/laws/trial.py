"""A trial of a law at its start, so that what it returns is checked before it moves an arm."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.own_code import at, naming
from .called import unchecked
from .checks import flaw, is_finite, observables_of
from .law import ContinuousReading, Reading, SampledReading
from .layout import Signals


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
    """Call each part of a law once, with arrays that it cannot modify, and check the results.

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
    name, size = type(reading).__name__, reading.state.size
    (_, v_shape) = reading.state.parts["v"]
    x, seen = _fixed(x), _shown(u)
    with naming(f"{name}.commanded_velocity", t):
        v = reading.commanded_velocity(t, x)
    _require_array(f"{name}.commanded_velocity", v, v_shape, t)
    if isinstance(reading, SampledReading) and period is not None:
        with naming(f"{name}.step", t):
            after = unchecked(reading.step)(t, x, seen, period)
        _require_array(f"{name}.step", after, (size,), t)
    elif isinstance(reading, ContinuousReading):
        with naming(f"{name}.derivatives", t):
            rates = unchecked(reading.derivatives)(t, x, seen)
        _require_array(f"{name}.derivatives", rates, (size,), t)
    observables_of(reading, t, x, seen)
    # Recorded runs are computed in one call for all instants.
    twice = _shown({key: np.stack((value, value)) for key, value in u.items()})
    observables_of(reading, np.array([t, t]), _fixed(np.stack((x, x))), twice)


def _require_array(place: str, value: Array, shape: tuple[int, ...], t: float) -> None:
    if complaint := flaw(value, shape):
        raise InvalidInputError(f"{place}: must return {complaint}{at(t)}")
    if not is_finite(value):
        raise InvalidInputError(
            f"{place}: must return finite numbers, not {np.round(value, 4).tolist()}{at(t)}"
        )


class _Seen(dict[str, Array]):
    """Signals that a law sees; asking for another one is told in full."""

    def __missing__(self, name: str) -> Array:
        raise KeyError(f"{name} is not among its inputs, {', '.join(self) or 'none'}")


def _shown(u: Mapping[str, Array]) -> Signals:
    """Return signals that cannot be modified."""
    return MappingProxyType(_Seen({name: _fixed(value) for name, value in u.items()}))


def _fixed(value: Array) -> Array:
    """Return a copy that cannot be modified."""
    value = value.copy()
    value.setflags(write=False)
    return value
