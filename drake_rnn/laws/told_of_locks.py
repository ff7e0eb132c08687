r"""A reading around a law's own, which tells it of joints that have locked.

A joint that stands still causes nothing, whatever a law wants of it: its column of the Jacobian is
zero. In a program whose cost and bounds are those of each joint alone, as

.. math::
    \min_v \tfrac12 v^T W v + c^T v \quad \text{s.t.} \quad J v = w, \quad
    \underline v \le v \le \overline v

with a diagonal W, the other joints then get the velocities of the program whose bounds of the
locked joint are zero; in one that couples joints, such as of their torques, they still follow the
task, but at another cost. What the law goes on to want of the locked joint itself is cut off behind
it, by the brake.

A law that sees J sees that column of it as zero, and the column of a part ``J_hat`` of its state
is set to zero before each step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..inputs.fields import Array
from ..robot.joint_locks import JointLocks
from .called import unchecked
from .law import SampledReading
from .layout import Layout, Signals

# Signals and parts of the state whose last axis is joints, with the effect of each on the task.
_JACOBIANS = ("J", "J_omega")
_LEARNED = "J_hat"


@dataclass(frozen=True, eq=False)
class ToldOfLocks(SampledReading):
    """A reading around another one.

    Attributes:
        told: The other one.
        locks: When joints lock.
    """

    told: SampledReading
    locks: JointLocks

    @property
    def state(self) -> Layout:
        return self.told.state

    @property
    def inputs(self) -> Layout:
        return self.told.inputs

    @property
    def inputs_with_gaps(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Reading.inputs_with_gaps`."""
        return self.told.inputs_with_gaps

    @property
    def observables(self) -> Layout:
        return self.told.observables

    @property
    def holds_command(self) -> bool:
        return self.told.holds_command

    @property
    def integration_scheme(self) -> str:
        return self.told.integration_scheme

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        return self.told.initial_state(rng, u)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        return self.told.commanded_velocity(t, x)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        return np.asarray(self._step(t, self._known(t, x), self._seen(t, u), period))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return self.told.diagnostics(t, x, self._seen(t, u))

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        return self.told.resumed(x, q, v, a, elapsed)

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.told.caveats(metrics)

    @cached_property
    def _step(self) -> Any:
        return unchecked(self.told.step)

    def _seen(self, t: float | Array, u: Signals) -> Signals:
        """Return the signals of a law that is told."""
        free = self.locks.free(t)
        if free.all():
            return u
        return {**u, **{name: free * u[name] for name in _JACOBIANS if name in u}}

    def _known(self, t: float, x: Array) -> Array:
        """Return the state of a law that is told."""
        free = self.locks.free(t)
        if _LEARNED not in self.state or free.all():
            return x
        return self.state.replaced(x, **{_LEARNED: free * self.state.part(x, _LEARNED)})
