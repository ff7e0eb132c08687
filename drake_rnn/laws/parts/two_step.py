r"""A sampled reading of acceleration laws with linear fast terms, by an implicit two-step method.

The second-order backward differentiation formula,

.. math::
    (3 x_{k+1} - 4 x_k + x_{k-1}) / 2h = f(x_{k+1}),

gives v and omega at the next sample from one linear system: f is linear in them once J and Jdot_v
are extrapolated from this sample and the previous one, and the desired signals are known ahead.
The commanded velocity is the ramp from one v to the next, which makes the joint positions exact.
Its slope is the acceleration, which the bounds clip.

With the velocity held over a sample instead, the position error of NALJDF is 200 times as large;
with a one-step formula it is twice as large; without the change of J the step is unstable.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ...inputs.fields import Array
from ..law import SampledReading
from ..layout import Layout, Signals

_AHEAD = {"p_preview": "p_WE_desired", "v_preview": "v_WE_desired", "a_preview": "a_WE_desired"}

# Value of ``since`` before the first ramp [s].
_NEVER = -1.0


@dataclass(frozen=True)
class LinearForm:
    """Rates that are linear in the state, at one posture and time.

    Before clipping, v_dot = a_v v + a_omega omega + a_0; omega_dot is the same with b.
    """

    a_v: Array
    a_omega: Array
    a_0: Array
    b_v: Array
    b_omega: Array
    b_0: Array


class AccelerationLaw(Protocol):
    """The interface that `TwoStep` needs of a law with the state v and omega."""

    @property
    def home(self) -> Array:
        """Home posture, shape (n,) [rad]; only its size is used."""

    @property
    def task_size(self) -> int:
        """Number m of rows of J."""

    @property
    def measured(self) -> Mapping[str, tuple[int, ...]]:
        """Shapes of the input signals that come from the arm, by name."""

    @property
    def observables(self) -> Layout:
        """Layout of the signals that `observed` returns."""

    def linear_form(self, u: Signals, q: Array, p_WE: Array, ahead: float = 0.0) -> LinearForm:
        """Return the rates at posture q + ahead v and end-effector position p_WE + ahead J v."""

    def broken_assumptions(self, metrics: Mapping[str, float]) -> list[str]:
        """Return warnings to show after a run with these metrics."""

    def bounded(self, demand: Array, q: Array, v: Array, period: float) -> Array:
        """Return the allowed accelerations nearest to ``demand``, shape (n,) [rad/s^2]."""

    def observed(self, demand: Array, v_dot: Array, v: Array, u: Signals) -> Signals:
        """Return the observables from the demanded and the allowed accelerations."""


class TwoStep(SampledReading):
    """The sampled reading of an acceleration law.

    It reads the desired signals one period ahead. The state holds v at the end of the present
    ramp and omega; the ramp's start ``v_from`` at time ``since``, its ``slope``, and the ``demand``
    before clipping; and signals of the previous sample. A law that measures the joint
    velocity ramps its own by what the measured one demands.

    Args:
        law: The law to run.
    """

    def __init__(self, law: AccelerationLaw) -> None:
        self.law = law

    @cached_property
    def state(self) -> Layout:
        n, m = self.law.home.size, self.law.task_size
        return Layout(
            v=(n,),
            omega=(m,),
            v_from=(n,),
            slope=(n,),
            demand=(n,),
            since=(1,),
            omega_before=(m,),
            J_before=(m, n),
            Jdot_v_before=(m,),
        )

    @cached_property
    def inputs(self) -> Layout:
        ahead = {name: (self.law.task_size,) for name in _AHEAD}
        return Layout(**self.law.measured, **ahead)

    @cached_property
    def observables(self) -> Layout:
        return self.law.observables

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        x = np.zeros(self.state.size)
        x[self._places["since"]] = _NEVER
        return x

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.law.broken_assumptions(metrics)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        law, h = self.law, period
        n = law.home.size
        at = self._places
        v, omega = x[at["v"]], x[at["omega"]]
        q, J, Jdot_v = u["position"], u["J"], u["Jdot_v"]
        # With a measured velocity only the one-step formula: its previous one is no longer known.
        present = u.get("velocity", v)
        if x[at["since"].start] != _NEVER and present is v:
            J_next = 2.0 * J - x[at["J_before"]].reshape(J.shape)
            Jdot_v_next = 2.0 * Jdot_v - x[at["Jdot_v_before"]]
            lead = 1.5 / h
            known_v = (4.0 * v - x[at["v_from"]]) / (2.0 * h)
            known_omega = (4.0 * omega - x[at["omega_before"]]) / (2.0 * h)
        else:
            # At the first sample there is no previous one: use the one-step formula.
            J_next, Jdot_v_next = J, Jdot_v
            lead, known_v, known_omega = 1.0 / h, present / h, omega / h
        next_u = {**u, "J": J_next, "Jdot_v": Jdot_v_next}
        for preview, desired in _AHEAD.items():
            next_u[desired] = u[preview]
        half = h / 2.0
        p_WE = u["p_WE"] + half * J.dot(present)
        form = law.linear_form(next_u, q + half * present, p_WE, half)

        size = n + law.task_size
        A = np.empty((size, size))
        A[:n, :n], A[:n, n:] = form.a_v, form.a_omega
        A[n:, :n], A[n:, n:] = form.b_v, form.b_omega
        A.flat[:: size + 1] -= lead
        known = np.concatenate((form.a_0 + known_v, form.b_0 + known_omega))
        sought = np.linalg.solve(A, -known)
        demand = (sought[:n] - present) / h
        slope = law.bounded(demand, q, v, h)
        ramp = (v + h * slope, sought[n:], v, slope, demand, (t,))
        return np.concatenate((*ramp, omega, J.ravel(), Jdot_v))

    def commanded_velocity(self, t: float, x: Array) -> Array:
        v_from, since, slope = self._ramp
        ramp: Array = x[v_from] + (t - x[since]) * x[slope]
        return ramp

    @cached_property
    def _places(self) -> dict[str, slice]:
        return {name: place for name, (place, _) in self.state.parts.items()}

    @cached_property
    def _ramp(self) -> tuple[slice, int, slice]:
        at = self._places
        return at["v_from"], at["since"].start, at["slope"]

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        v, demand, slope = (self.state.part(x, name) for name in ("v", "demand", "slope"))
        # In a diagram it sees the desired signals one period ahead alone, like its v.
        ahead = {desired: u[name] for name, desired in _AHEAD.items() if name in u}
        return self.law.observed(demand, slope, v, {**ahead, **u})
