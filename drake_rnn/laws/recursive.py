r"""The recursive network: bounds on the derivatives of the joints up to the fifth, by levels.

Source:
    Li, Li, "Recursive recurrent neural network: a novel model for manipulator control with
    different levels of physical constraints", CAAI Transactions on Intelligence Technology (2022).
    The conventional RNN is (2), the recursive one (8) with (10).

With the levels x_1 = v, x_2, ... and the targets

.. math::
    w_1 = P_1(-k_1 J^T (p - p_d)), \qquad w_{i+1} = P_{i+1}(-k_{i+1} (x_i - w_i)),

``printed`` integrates the chain x_1' = x_2, ..., x_{n-1}' = w_n, with the n-th derivative of the
joint positions at its top. In ``filters`` every level follows its own target,
:math:`\epsilon_i \dot x_i = w_i - x_i`, and the first level moves the arm.

=========  =================  ================================================
paper      here               meaning
=========  =================  ================================================
theta      position           joint positions q
x_1        v                  joint velocities (state)
x_2 ..     levels             levels of the chain, or filtered signals (state)
r, r_d     p_WE, .._desired   end effector's position, actual and desired
k_i        gains              gains of the levels [1/(m^2 s), 1/s, ...]
epsilon_i  time_constants     time constants of the filters [s]
kappa      limit_stiffness    velocity per radian to a position limit [1/s]
=========  =================  ================================================

Corrected: the paper lists a constant epsilon for each level among its parameters but uses it in no
equation. It has a meaning in the reading ``filters``, which matches the paper's figures.

Not in the paper: in the printed law only the bound of the top level is structural. The others
bound the targets w_i, not the levels x_i, and each level is a high-gain relay: from n = 3 on the
chain oscillates in a limit cycle. In ``filters`` the signals x_2 .. x_n stay within their bounds
because they are filtered from clipped targets, but they are not derivatives of the joint angles.
"""

from __future__ import annotations

from functools import cached_property
from math import factorial
from typing import Annotated, Literal

import numpy as np

from ..arrays.algebra import clip, functions_of, is_one, matmul, vecmat
from ..inputs.fields import Array, Gain, Vector, validated
from ..inputs.keys import Meaning
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .law import (
    Layout,
    SampledLaw,
    Signals,
)
from .parts.bounded_velocity import kept_with_lag

_ORDERS = tuple(DERIVATIVE_UNITS)


@validated
class Recursive(SampledLaw):
    """The recursive network of n = 1 to 5 levels, as printed or as filters."""

    kind: Literal["recursive"] = "recursive"
    follows_objectives = True
    summary = (
        "The recursive network: bounds on the derivatives of the joints up to the fifth, by levels."
    )
    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joint positions and of their derivatives up to the n-th."),
    ]
    gains: Annotated[Vector, Meaning("Gains of the n levels, shape (n,).")]
    reading: Annotated[
        Literal["printed", "filters"],
        Meaning("``printed`` or ``filters``."),
    ] = "printed"
    time_constants: Annotated[
        Vector | None,
        Meaning("Time constants of the n filters, shape (n,); only for ``filters``.", unit="s"),
    ] = None
    limit_stiffness: Annotated[
        Gain,
        Meaning("Velocity allowed per radian left to a position limit.", unit="1/s"),
    ] = 1.0
    task_size: Annotated[Literal[1, 2, 3, 4, 5], Meaning("Number of rows of J.")] = 3

    stays_on_path = True
    takes_many = True

    def __post_init__(self) -> None:
        n = self.gains.size
        if not 1 <= n <= len(_ORDERS):
            raise ValueError(f"gains: must have 1 to {len(_ORDERS)} entries, not {n}")
        if not (self.gains > 0).all():
            raise ValueError(f"gains: must be positive, not {self.gains.tolist()}")
        if (self.reading == "filters") != (self.time_constants is not None):
            raise ValueError(
                "time_constants: must be given with reading: filters, one per level, and only then"
            )
        if self.time_constants is not None and (
            self.time_constants.size != n or not (self.time_constants > 0).all()
        ):
            raise ValueError(
                f"time_constants: must be {n} positive numbers, not {self.time_constants.tolist()}"
            )
        for name in _ORDERS[:n]:
            self.limits.require(name, f"{n} gains")

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; in a printed chain only the bound of the top level is structural."""
        if self.time_constants is not None:
            return kept_with_lag(self.limit_stiffness, float(self.time_constants[0]))
        n = self.gains.size
        return ("position", "velocity") if n == 1 else (_ORDERS[n - 1],)

    @property
    def levels_are_derivatives(self) -> bool:
        return self.reading == "printed"

    @cached_property
    def state(self) -> Layout:
        joints, n = self.limits.size, self.gains.shape[-1]
        levels = max(1, n - 1) if self.reading == "printed" else n
        return Layout(v=(joints,), **({"levels": (levels - 1, joints)} if levels > 1 else {}))

    @cached_property
    def inputs(self) -> Layout:
        joints, m = self.limits.size, self.task_size
        return Layout(position=(joints,), p_WE=(m,), p_WE_desired=(m,), J=(m, joints))

    @cached_property
    def observables(self) -> Layout:
        return Layout(saturated=(1,))

    @cached_property
    def _bounds(self) -> list[Array]:
        return [self.limits.require(name, "its level") for name in _ORDERS[: self.gains.shape[-1]]]

    def targets(self, x: Array, u: Signals) -> Array:
        """Return the targets w_1 to w_n of (8), shape (..., n, joints)."""
        levels = x.reshape(*x.shape[:-1], -1, self.limits.size)
        error = u["p_WE"] - u["p_WE_desired"]
        lower, upper = self.limits.velocity_box(u["position"], self.limit_stiffness)
        descent = _descent(u["J"], error)
        clipped_targets = [clip(-self.gains[..., :1] * descent, lower, upper)]
        for i in range(1, self.gains.shape[-1]):
            sought = -self.gains[..., i : i + 1] * (levels[..., i - 1, :] - clipped_targets[-1])
            clipped_targets.append(clip(sought, -self._bounds[i], self._bounds[i]))
        return functions_of(*clipped_targets).stack(clipped_targets, axis=-2)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Integrate the chain or the filters exactly, with the targets held over the period."""
        targets = self.targets(x, u)
        if self.time_constants is not None:
            exp = functions_of(self.time_constants).exp
            left = exp(-period / self.time_constants)[..., np.newaxis]
            return (targets + left * (x.reshape(targets.shape) - targets)).reshape(x.shape)
        if self.gains.shape[-1] == 1:
            return targets[..., 0, :]
        levels = x.reshape(*x.shape[:-1], -1, self.limits.size)
        chain = functions_of(x, targets).concatenate((levels, targets[..., -1:, :]), axis=-2)
        powers = self._powers(period, chain.shape[-2])
        return matmul(powers, chain)[..., :-1, :].reshape(x.shape)

    @staticmethod
    def _powers(period: float, size: int) -> Array:
        """Return the transition matrix of a chain of integrators, shape (size, size)."""
        return np.array(
            [
                [period ** (k - i) / factorial(k - i) if k >= i else 0.0 for k in range(size)]
                for i in range(size)
            ]
        )

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        targets = self.targets(x, u)
        top = functions_of(targets).abs(targets[..., -1, :])
        bound = self._bounds[-1]
        return {"saturated": (top >= bound * (1 - 1e-9)).any(axis=-1, keepdims=True).astype(float)}


def _descent(J: Array, error: Array) -> Array:
    """Return J^T e, shape (..., n)."""
    if is_one(error):
        # Its bits are older than the other function.
        return np.einsum("...mn,...m->...n", J, error)
    return vecmat(error, J)
