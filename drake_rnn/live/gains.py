"""The gains of a law that a page may change while it runs, and between which ends."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from numbers import Real

from ..errors import InvalidInputError
from ..inputs.dataclass_fields import fields_of
from ..laws import Law
from ..systems import TunableController
from .controls import Slider

# Factor from a gain to its ends, unless the law allows less, and how often the way there is halved.
_FACTOR, _HALVES = 30.0, 6
_PREFIX = "law."


def gains_of(law: Law, controller: TunableController) -> dict[str, Slider]:
    """Return a slider for each gain of a law: its numbers greater than 0, as far as it allows them.

    Args:
        law: The law.
        controller: Controller that runs it, or one with other gains.
    """
    found = {}
    values = {**fields_of(law), **{k: v for k, v in law.loop_gains.items() if k in fields_of(law)}}
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, Real) or isinstance(value, int):
            continue
        if (start := float(value)) > 0.0:
            low, high = (
                _farthest(law, controller, name, start, start * factor)
                for factor in (1.0 / _FACTOR, _FACTOR)
            )
            if low < high:
                label = name.replace("_", " ")
                found[_PREFIX + name] = Slider(label, low=low, high=high, value=start)
    return found


def with_gain(law: Law, control: str, value: float) -> Law:
    """Return a law with another value of a gain, by the name of its slider.

    Raises:
        InvalidInputError: If the law does not allow it.
    """
    changes: dict[str, object] = {control.removeprefix(_PREFIX): value}
    found: Law = replace(law, **changes)  # type: ignore[type-var]
    return found


def _farthest(
    law: Law, controller: TunableController, name: str, start: float, end: float
) -> float:
    """Return the value farthest on the way from a start to an end that the law allows."""

    def allows(value: float) -> bool:
        try:
            controller.read(with_gain(law, name, value))
        except (InvalidInputError, ValueError):
            return False
        return True

    if allows(end):
        return end
    good, bad = start, end
    for _ in range(_HALVES):
        middle = sqrt(good * bad)
        if allows(middle):
            good = middle
        else:
            bad = middle
    return good
