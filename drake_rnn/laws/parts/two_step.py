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
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...arrays.algebra import flat, functions_of, is_one, joined, matvec, scaled, solved_for
from ...inputs.fields import Array
from ...signals import POSITION_OF_PATH, SIGNALS
from ..law import SampledReading
from ..layout import Layout, Signals

# Signals one period ahead, and those that they are then.
_AHEAD = {SIGNALS[name].ahead: name for name in POSITION_OF_PATH}

#: J and Jdot_v at the next sample, and c, b_v and b_omega with which v_dot there is c v - b_v, and
#: omega_dot likewise.
Formula = tuple[Array, Array, Any, Array, Array]

# Value of ``since`` before the first ramp [s].
_NEVER = -1.0


class LinearForm(NamedTuple):
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
        """Home posture, shape (..., n) [rad]; only its size is used."""

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
        """Return the allowed accelerations nearest to ``demand``, shape (..., n) [rad/s^2]."""

    def observed(self, demand: Array, v_dot: Array, v: Array, u: Signals) -> Signals:
        """Return the observables from the demanded and the allowed accelerations."""


@dataclass(frozen=True, eq=False)
class TwoStep(SampledReading):
    """The sampled reading of an acceleration law.

    It reads the desired signals one period ahead. The state holds v at the end of the present
    ramp and omega; the ramp's start ``v_from`` at time ``since``, its ``slope``, and the ``demand``
    before clipping; and signals of the previous sample. A law that measures the joint
    velocity ramps its own by what the measured one demands.

    Args:
        law: The law to run.
    """

    law: AccelerationLaw

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        n, m = self.law.home.shape[-1], self.law.task_size
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
        x[self._ramp[1]] = _NEVER
        return x

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.law.broken_assumptions(metrics)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        law, h = self.law, period
        v, omega, *before = self.state.split(x)
        q, J = u["position"], u["J"]
        present = u.get("velocity", v)
        if present is v:
            J_next, Jdot_v_next, lead, known_v, known_omega = _formula(v, omega, before, u, h)
        else:
            # The measured velocity of the previous sample is no longer known.
            J_next, Jdot_v_next, lead, known_v, known_omega = _of_one_step(present, omega, u, h)
        next_u = {**u, "J": J_next, "Jdot_v": Jdot_v_next}
        for preview, desired in _AHEAD.items():
            next_u[desired] = u[preview]
        half = h / 2.0
        p_WE = u["p_WE"] + half * matvec(J, present)
        form = law.linear_form(next_u, q + half * present, p_WE, half)
        v_next, omega_next = _solution(form, lead, known_v, known_omega)
        demand = (v_next - present) / h
        slope = law.bounded(demand, q, v, h)
        ramp = (v + h * slope, omega_next, v, slope, demand, _of_each(t, v))
        return joined((*ramp, omega, flat(J), u["Jdot_v"]))

    def commanded_velocity(self, t: float, x: Array) -> Array:
        v_from, since, slope = self._ramp
        if x.ndim == 1:
            return x[v_from] + (t - x[since.start]) * x[slope]
        return x[..., v_from] + (t - x[..., since]) * x[..., slope]

    @cached_property
    def _ramp(self) -> tuple[slice, slice, slice]:
        v_from, since, slope = (self.state.parts[name][0] for name in ("v_from", "since", "slope"))
        return v_from, since, slope

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        v, demand, slope = (self.state.part(x, name) for name in ("v", "demand", "slope"))
        # In a diagram it sees the desired signals one period ahead alone, like its v.
        ahead = {desired: u[name] for name, desired in _AHEAD.items() if name in u}
        return self.law.observed(demand, slope, v, {**ahead, **u})


def _formula(v: Array, omega: Array, before: list[Array], u: Signals, h: float) -> Formula:
    """Return the two-step formula; where there is no previous sample, at the first, the other."""
    v_from, _, _, since, omega_before, J_before, Jdot_v_before = before
    one = is_one(v)
    if one and since[0] == _NEVER:
        return _of_one_step(v, omega, u, h)
    of_two: Formula = (
        2.0 * u["J"] - J_before,
        2.0 * u["Jdot_v"] - Jdot_v_before,
        1.5 / h,
        (4.0 * v - v_from) / (2.0 * h),
        (4.0 * omega - omega_before) / (2.0 * h),
    )
    if one:
        return of_two
    J_next, *others = zip(of_two, _of_one_step(v, omega, u, h), strict=True)
    where, begun = functions_of(v, u["J"]).where, since != _NEVER
    return where(begun[..., np.newaxis], *J_next), *(where(begun, *each) for each in others)


def _of_one_step(v: Array, omega: Array, u: Signals, h: float) -> Formula:
    return u["J"], u["Jdot_v"], 1.0 / h, v / h, omega / h


def _solution(
    form: LinearForm, lead: Any, known_v: Array, known_omega: Array
) -> tuple[Array, Array]:
    """Return v and omega at the next sample, shapes (..., n) and (..., m)."""
    known = joined((form.a_0 + known_v, form.b_0 + known_omega))
    n, size = known_v.shape[-1], known.shape[-1]
    if is_one(known):
        A = np.empty((size, size))
        A[:n, :n], A[:n, n:] = form.a_v, form.a_omega
        A[n:, :n], A[n:, n:] = form.b_v, form.b_omega
        A.reshape(-1)[:: size + 1] -= lead
        sought = solved_for(A, -known)
        return sought[:n], sought[n:]
    rows = joined((form.a_v, form.a_omega)), joined((form.b_v, form.b_omega))
    A = functions_of(*rows).concatenate(rows, axis=-2) - scaled(lead, np.eye(size))
    sought = solved_for(A, -known)
    return sought[..., :n], sought[..., n:]


def _of_each(t: Any, v: Array) -> Any:
    """Return a time as a vector of one entry, for each robot."""
    return (t,) if is_one(v) else functions_of(v, t).broadcast_to(t, (*v.shape[:-1], 1))
