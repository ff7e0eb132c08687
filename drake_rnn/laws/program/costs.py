r"""Costs of a scheme at the velocity level: what is minimised of the joint velocities v.

====================  =====================================================  =======================
``cost``              minimised                                              known as
====================  =====================================================  =======================
``velocity``          v^T v / 2 + k (q - q_0)^T v - g dw(q)/dq v             least velocity (MVN);
                                                                             with k repetitive
                                                                             motion (RMP); with g
                                                                             manipulability
``kinetic_energy``    v^T M v / 2 + k (q - q_0)^T M v                        inertia-weighted
                                                                             pseudoinverse
``largest_velocity``  alpha (v^T v / 2 + k (q - q_0)^T v) + (1 - alpha) s,   bi-criteria with the
                      -s <= v_i <= s                                         infinity norm
====================  =====================================================  =======================

q_0 is the posture at the start: a closed path then ends near it, as in the null space of the task
the joints move towards q_0 at the rate k. w is the logarithm of the manipulability,
w = ln sqrt(det J J^T), M the joints' inertia. s is a variable of its own. `BarrierOfVelocity` is
the cost of a zeroing network with ``prescribed``.

Sources:
    Least velocity and repetitive motion are standard; the latter was read in the public code of a
    varying-parameter network (``vp-rnn``). The others are from memory: Whitney, "Resolved motion
    rate control of manipulators and human prostheses" (1969), weighs velocities by the inertia;
    Yoshikawa, "Manipulability of robotic mechanisms" (1985), has its gradient in the null space;
    Zhang, Cai et al., Advanced Robotics 22 (2008), have the bi-criteria cost, of which an abstract
    was read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...arrays.algebra import acts, joined, matvec, scaled
from ...inputs.fields import Array
from ..layout import Signals
from ..parts.secondary import manipulability_gradient

Shapes = dict[str, tuple[int, ...]]

# Time over which the rate of a gradient is a difference, along the rates of the Jacobians [s].
_SHORT = 1e-4


class Cost(Protocol):
    """What a scheme minimises, 1/2 x^T W x + c^T x, where x begins with the joint velocities."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that it sees, by name."""

    @property
    def slacks(self) -> int:
        """Number of variables besides the joint velocities; each is bounded by `rows`."""

    def rows(self) -> tuple[Array, Array] | None:
        """Return constant rows C and right-hand sides d of its inequalities; None for none."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """Return W and c, shapes (..., k, k) and (..., k)."""

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """Return the time derivatives of W and c; None for what is constant.

        Args:
            u: Signals.
            u_dot: Time derivatives of those of them that no other signal tells.
            x: Joint velocities, shape (..., n) [rad/s].
        """


@dataclass(frozen=True, eq=False)
class ReturningVelocity:
    """The velocity's square, a way back and a way to postures of more manipulability.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s]; 0 for the least velocity.
        manipulability: Gain g of the gradient of the manipulability [rad/s]; 0 for none.
        task_size: Number of rows of J, 3 or 6; needed with that gain.
    """

    home: Array
    return_gain: Any
    manipulability: Any = 0.0
    task_size: int = 3

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        n = self.home.shape[-1]
        shapes: Shapes = {"position": (n,)}
        if acts(self.manipulability):
            shapes |= {"J": (self.task_size, n), "J_omega": (3, n)}
        return shapes

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        c = self.return_gain * (u["position"] - self.home)
        if acts(self.manipulability):
            c = c - self.manipulability * manipulability_gradient(u["J"], u["J_omega"])
        return np.eye(self.home.shape[-1]), c

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        rate = self.return_gain * x if acts(self.return_gain) else None
        if not acts(self.manipulability):
            return None, rate
        now, later = (
            manipulability_gradient(*(u[name] + ahead * u_dot[name] for name in ("J", "J_omega")))
            for ahead in (0.0, _SHORT)
        )
        turning = self.manipulability / _SHORT * (now - later)
        return None, turning if rate is None else rate + turning


@dataclass(frozen=True, eq=False)
class KineticEnergy:
    """The kinetic energy, and a way back of the same rate in all directions.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s].
    """

    home: Array
    return_gain: Any

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        n = self.home.shape[-1]
        return {"position": (n,), "M": (n, n)}

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        return u["M"], self.return_gain * matvec(u["M"], u["position"] - self.home)

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        away = u["position"] - self.home
        return u_dot["M"], self.return_gain * (matvec(u_dot["M"], away) + matvec(u["M"], x))


@dataclass(frozen=True, eq=False)
class BarrierOfVelocity:
    """The barrier of `drake_rnn.laws.networks.barriers`, and a way back of that rate near rest.

    Near rest it weighs each velocity by 4 over the square of its limit, which is W.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s].
        fastest: Limits of the joint velocities, shape (n,) [rad/s].
    """

    home: Array
    return_gain: Any
    fastest: Array

    slacks = 0

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        return {"position": (self.home.shape[-1],)}

    def rows(self) -> None:
        """See `Cost.rows`."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        weights = 4.0 / (self.fastest * self.fastest)
        pull = self.return_gain * weights * (u["position"] - self.home)
        return weights[..., None] * np.eye(self.home.shape[-1]), pull

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        return None, self.return_gain * 4.0 / (self.fastest * self.fastest) * x


@dataclass(frozen=True, eq=False)
class LargestVelocity:
    """The largest joint velocity s, blended with the square of all.

    Attributes:
        square: The cost that it is blended with, without slacks.
        blend: The weight alpha of that cost, above 0 and below 1: at 1 nothing determines s.
    """

    square: ReturningVelocity
    blend: Any

    slacks = 1

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        return self.square.inputs

    def rows(self) -> tuple[Array, Array]:
        """See `Cost.rows`."""
        n = self.square.home.shape[-1]
        eye, one = np.eye(n), np.ones((n, 1))
        return np.block([[eye, -one], [-eye, -one]]), np.zeros(2 * n)

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        W, c = self.square.terms(u)
        weights = np.pad(W, (0, 1))
        linear = joined((self.blend * c, 0.0 * c[..., :1] + (1.0 - self.blend)))
        return scaled(self.blend, weights), linear

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        _, c = self.square.rates(u, u_dot, x)
        return None, None if c is None else joined((self.blend * c, 0.0 * c[..., :1]))
