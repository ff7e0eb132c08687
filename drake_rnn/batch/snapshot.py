"""Robots side by side at one step, and the motion that steps make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays.algebra import functions_of
from ..arrays.namespace import AnyArray, in_front
from ..laws import Signals
from ..measures import Motion, Pressing


@dataclass(frozen=True)
class Snapshot:
    """Robots at the end of a step, before the updates at its time.

    Attributes:
        time: Time of the step [s].
        values: Fields of a `Motion` by name, each of shape (robots, ...).
        pressing: Contact with surfaces, without an axis of steps; None without surfaces.
        virtual: Fields of the motion of the arms that the laws see, where these are virtual.
        observed: Observables of the laws, each of shape (robots, size).
    """

    time: AnyArray
    values: dict[str, AnyArray]
    pressing: Pressing | None
    virtual: dict[str, AnyArray] | None
    observed: Signals


def motion_of(steps: Sequence[Snapshot], **fixed: Any) -> Motion:
    """Return the motion of robots over steps, shape (k, robots, ...).

    Args:
        steps: The steps.
        fixed: Fields of the motion that do not vary from step to step.
    """
    first = steps[0]
    fields = _together([step.values for step in steps])
    # A law whose velocity is the arm's has it once.
    fields.setdefault("network_velocity", fields["velocity"])
    xp = functions_of(fields["position"], first.time)
    time = xp.asarray([step.time for step in steps])
    pressing = None
    if first.pressing is not None:
        each = [step.pressing for step in steps if step.pressing is not None]
        force, desired = _stacked([p.force for p in each]), _stacked([p.desired for p in each])
        pressing = replace(first.pressing, force=force, desired=desired)
    virtual = None
    if first.virtual is not None:
        seen = _together([step.virtual for step in steps if step.virtual is not None])
        virtual = Motion(time=time, **{**fields, **seen})
    return Motion(
        time=time,
        **fields,
        pressing=pressing,
        virtual=virtual,
        observed=_together([step.observed for step in steps]),
        **fixed,
    )


def _together(steps: Sequence[Mapping[str, AnyArray]]) -> dict[str, AnyArray]:
    return {name: _stacked([step[name] for step in steps]) for name in steps[0]}


def _stacked(arrays: Sequence[AnyArray]) -> AnyArray:
    """Return arrays of steps, shape (robots, ...), as one, with robots side by side in memory."""
    xp = functions_of(*arrays)
    if xp is not np:
        return xp.stack(arrays)
    parts = np.stack([in_front(array, array.ndim - 1) for array in arrays])
    return parts.transpose(0, -1, *range(1, parts.ndim - 1))
