r"""The Jacobian of a sampled law: known from the robot's model, or learned.

Where a sampled law takes its Jacobian from, if it learns it: from what its motions cause.

It is learned by a Kalman filter, whose one covariance serves all rows.

The rows of J are taken to wander, each entry with the variance q_n per second, and the velocity y
that joint velocities w cause to be measured with the variance R:

.. math::
    C \leftarrow C + q_n h I, \quad K = \frac{C w}{R + w^T C w}, \quad
    \hat J \leftarrow \hat J + (y - \hat J w) K^T, \quad C \leftarrow C - K w^T C.

What has not been moved for a while is uncertain, so the first motion along it teaches at once: no
noise needs to be injected. For the same reason an arm at rest must not learn from measurements that
err: its covariance would grow, and each error would count as a motion's effect.

Pixels, which a camera measures, may leap when another camera comes in its place. A change from one
sample to the next that is ten times as far from what J_hat says as C, R and the errors of
measurement explain is such a leap. Nothing is learned from it; C begins anew, so that the next
motions teach at once.

Where a sampled law takes its Jacobian from, if it is told: the middle of the coming sample.

The keys of a document by which a law is told which of the two it does: `JacobianKeys`.

Learning a Jacobian from the joint velocities v and the end effector's velocity v_WE.

.. math:: \rho \dot{\hat J} = (v_{WE} - \hat J v) v^T

is gradient descent on :math:`\tfrac12 |v_{WE} - \hat J v|^2`. It learns only along v, at the rate
|v|^2 / rho, and nothing about directions in which the arm does not move: over time, the joint
velocities must cover all directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import expm1
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...arrays.algebra import dot, functions_of, is_one, join, matvec, outer, root, scale
from ...errors import InvalidInputError
from ...inputs.fields import Array, Weight, validated
from ...inputs.keys import Meaning, Only
from ...robot.rotation import rotation_error
from ..law import Law, Signals, State
from .measurement import EXACT, Learning, Measurement, learning_for, push


def first_J_hat(
    initial: str, shape: tuple[int, ...], rng: np.random.Generator, u: Signals
) -> Array:
    """Return the first J_hat: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own J.

    Raises:
        InvalidInputError: If ``initial`` is ``exact`` and there is no J among the signals.
    """
    if initial == "uniform":
        return rng.uniform(size=shape)
    if initial == "zero":
        return np.zeros(shape)
    if "J" not in u:
        raise InvalidInputError(
            "law.J_hat_initial: exact needs the arm's J, which this law does not see; "
            "set the initial state yourself"
        )
    return np.asarray(u["J"])


def gradient(J_hat: Array, v: Array, v_WE: Array, rho: Any) -> Array:
    """Return the time derivative of ``J_hat``, shape (..., m, n) [m/s]; ``rho`` is in rad^2/s."""
    return outer((v_WE - matvec(J_hat, v)) / rho, v)


def rank_one_update(J_hat: Array, v: Array, v_WE: Array, rho: Any, period: float) -> Array:
    """Return ``J_hat`` one period later, shape (..., m, n), with ``v`` and ``v_WE`` held.

    The result is exact: the residual along v decays as exp(-|v|^2 t / rho), so the differential
    equation, which is stiff for a small rho, never has to be integrated.
    """
    square = dot(v, v)
    still = square * period < 1e-16 * rho
    if is_one(v):
        if still:
            return J_hat
        share = -expm1(-square * period / rho) / square
        return J_hat + ((v_WE - J_hat.dot(v)) * share)[:, np.newaxis] * v
    xp = functions_of(v)
    moving = xp.where(still, 1.0, square)
    share = xp.where(still, 0.0, -xp.expm1(-moving * period / rho) / moving)
    return J_hat + outer((v_WE - matvec(J_hat, v)) * share, v)


# Ratio of a leap to what explains a motion.
_LEAP = 10.0


def kalman_update(
    J_hat: Array, C: Array, w: Array, y: Array, wander: Any, variance: Any
) -> tuple[Array, Array]:
    """Return J_hat, shape (..., m, n), and its covariance, shape (..., n, n), one sample later.

    Args:
        J_hat: The learned Jacobian, shape (..., m, n).
        C: Covariance of each of its rows, shape (..., n, n), symmetric.
        w: Measured joint velocities, shape (..., n) [rad/s].
        y: Task velocity that they caused, shape (..., m).
        wander: Growth of the variances in this sample, q_n h.
        variance: Variance R of y.
    """
    C = C + scale(wander, np.eye(w.shape[-1]))
    spread = matvec(C, w)
    K = spread / (variance + dot(w, spread))
    return J_hat + outer(y - matvec(J_hat, w), K), C - outer(K, spread)


@dataclass(frozen=True)
class LearnedJacobian:
    """A Jacobian learned from measured joint positions and end effector positions.

    Both velocities are difference quotients over the last samples. The arm has moved so for all of
    that time, whatever was commanded.

    Attributes:
        task_size: Number m of rows; of 6 rows the first three are rotation, if the task turns.
        size: Number n of joints.
        samples: Number of samples over which the quotients are taken.
        wander: Growth q_n of the variance of each entry [1/s].
        variance: Variance R of the measured task velocity [m^2/s^2].
        still: Joint speed below which J_hat and its covariance stay as they are [rad/s].
        initial: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own.
        turns: Whether the first three rows are those of a rotation.
        leaps: Whether what is measured may leap, because a camera is swapped.
        error: Standard deviation of a measured position [m], by which a leap is told.
    """

    task_size: int
    size: int
    samples: int
    wander: Any
    variance: Any
    still: float
    initial: Literal["uniform", "zero", "exact"]
    turns: bool = False
    leaps: bool = False
    error: float = 0.0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        n, m, k = self.size, self.task_size, self.samples
        parts = {"J_hat": (m, n), "covariance": (n, n), "q_before": (k, n)}
        parts["p_before"] = (k, m - 3 * self.turns)
        return parts | ({"R_before": (k, 3, 3)} if self.turns else {})

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`.

        Raises:
            InvalidInputError: If ``initial`` is ``exact`` and there is no J among the signals.
        """
        shapes = self.shapes
        J_hat = first_J_hat(self.initial, shapes["J_hat"], rng, u)
        parts = {"J_hat": J_hat, "covariance": np.eye(self.size)}
        signal_of = {"q_before": "position", "p_before": "p_WE", "R_before": "R_WE"}
        for part in shapes.keys() & signal_of.keys():
            parts[part] = np.broadcast_to(u[signal_of[part]], shapes[part])
        return parts

    def step(self, state: State, u: Signals, period: float) -> tuple[Array, State]:
        """Return the Jacobian, shape (..., m, n); see `Component.step`."""
        over = self.samples * period
        q, p = u["position"], u["p_WE"]
        w = (q - state["q_before"][..., -1, :]) / over
        y = (p - state["p_before"][..., -1, :]) / over
        parts = {
            "q_before": push(state["q_before"], q, -2),
            "p_before": push(state["p_before"], p, -2),
        }
        if self.turns:
            R = u["R_WE"]
            rotation = rotation_error(state["R_before"][..., -1, :, :], R) / over
            y = join((rotation, y))
            parts["R_before"] = push(state["R_before"], R, -3)
        before = state["J_hat"], state["covariance"]
        after = kalman_update(*before, w, y, self.wander * period, self.variance)
        if self.still > 0.0:
            moves = (w * w).sum(axis=-1)[..., None, None] > self.still**2
            xp = functions_of(w)
            after = tuple(xp.where(moves, new, old) for new, old in zip(after, before, strict=True))
        parts["J_hat"], parts["covariance"] = after
        if self.leaps:
            parts = self._unless_leapt(state, parts, q, p, period)
        return parts["J_hat"], parts

    def _unless_leapt(self, state: State, parts: State, q: Array, p: Array, period: float) -> State:
        """Return the parts of the next state, which after a leap know of no motion before it."""
        step_of_joints = q - state["q_before"][..., 0, :]
        way = p - state["p_before"][..., 0, :] - matvec(state["J_hat"], step_of_joints)
        doubt = (
            dot(step_of_joints, matvec(state["covariance"], step_of_joints))
            + (EXACT.variance**0.5 * period) ** 2
        )
        bound = 2.0**0.5 * self.error + root(doubt)
        leapt = (abs(way) > _LEAP * bound).any(axis=-1)
        xp = functions_of(p)
        if type(leapt) is np.bool_ and not leapt:
            return parts
        anew = {
            "J_hat": state["J_hat"],
            "covariance": np.eye(self.size),
            "q_before": q[..., None, :],
            "p_before": p[..., None, :],
        }
        leapt = leapt[..., None, None]
        return {name: xp.where(leapt, anew[name], part) for name, part in parts.items()}


# Samples of J that are kept, of however late a measurement.
_LONGEST = 10


@dataclass(frozen=True)
class MiddleJacobian:
    """The Jacobian half a sample ahead, from the last ones.

    A velocity held for a period moves the arm along a chord, which the Jacobian at its middle
    gives to the third order of the period, that at its beginning to the second only. That is the
    error where the task is nearly an equality; the adaptive law's price of the task leaves more, in
    proportion to the period, and most of what is left as it is shipped. The change over the last
    sample stands for that over the next. Of a measurement that is late, the change
    over as many samples stands for that since then: over one alone, its errors would be multiplied.

    Attributes:
        task_size: Number m of rows.
        size: Number n of joints.
        late: Number of samples by which the posture that J is of is late.
    """

    task_size: int
    size: int
    late: int = 0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"J_before": (self._span, self.task_size, self.size)}

    @cached_property
    def _span(self) -> int:
        """Number of samples over which the change is taken."""
        return min(max(self.late, 1), _LONGEST)

    @cached_property
    def _ahead(self) -> float:
        """Share of that change that is to come until the middle of the sample."""
        return (self.late + 0.5) / self._span

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {"J_before": np.broadcast_to(u["J"], self.shapes["J_before"])}

    def step(self, state: State, u: Signals, period: float) -> tuple[Array, State]:
        """Return the Jacobian, shape (..., m, n); see `Component.step`."""
        J = u["J"]
        before = state["J_before"]
        return J + self._ahead * (J - before[..., -1, :, :]), {"J_before": push(before, J, -3)}


_ONLY_LEARNED = Only("jacobian", "learned")


@validated
class JacobianKeys(Law):
    """A law whose Jacobian is known, or learned from positions."""

    jacobian: Annotated[
        Literal["known", "learned"],
        Meaning("``known`` reads J; ``learned`` learns it from ``position`` and ``p_WE``."),
    ] = "known"
    J_hat_initial: Annotated[
        Literal["uniform", "zero", "exact"],
        Meaning(
            "Initial J_hat: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own.",
            only=(_ONLY_LEARNED,),
        ),
    ] = "uniform"
    variance: Annotated[
        Weight | None,
        Meaning(
            "Variance R of the measured velocity; by default as suits the measurement.",
            only=(_ONLY_LEARNED,),
        ),
    ] = None
    wander: Annotated[
        Weight | None,
        Meaning(
            "Growth q_n of the variance of J_hat's entries; likewise.",
            unit="1/s",
            only=(_ONLY_LEARNED,),
        ),
    ] = None
    measurement: Annotated[
        Measurement,
        Meaning("Quality of what the law sees."),
    ] = Field(default_factory=Measurement)

    @property
    def learns_jacobian(self) -> bool:
        """See `Law.learns_jacobian`."""
        return self.jacobian == "learned"

    def _learning_for(self, period: float) -> Learning:
        """Return the numbers that suit the measurement at a period [s], but those that are given.

        Args:
            period: Sampling period [s].
        """
        suits = learning_for(self.measurement, period) if self.learns_jacobian else EXACT
        return suits._replace(
            variance=suits.variance if self.variance is None else self.variance,
            wander=suits.wander if self.wander is None else self.wander,
        )

    def learned_jacobian(
        self, shape: tuple[int, int], samples: int, still: float, turns: bool, leaps: bool = False
    ) -> LearnedJacobian:
        """Return where the Jacobian comes from that a law with all of its numbers learns.

        Args:
            shape: Numbers of rows and of joints.
            samples: Number of samples over which velocities are difference quotients.
            still: Joint speed below which nothing is learned [rad/s].
            turns: Whether the first three rows are those of a rotation.
            leaps: Whether what is measured may leap, because a camera is swapped.
        """
        return LearnedJacobian(
            *shape,
            samples=samples,
            wander=self.wander,
            variance=self.variance,
            still=still,
            initial=self.J_hat_initial,
            turns=turns,
            leaps=leaps,
            error=self.measurement.error,
        )

    def _learning_doubts(self, movers: str) -> list[str]:
        """Return a warning about a first J_hat by which nothing moves.

        Args:
            movers: What else may move the arm.
        """
        if not self.learns_jacobian or self.J_hat_initial != "zero":
            return []
        return [
            "law.J_hat_initial: zero moves no joint, so nothing is learned unless "
            f"{movers} moves the arm; consider uniform"
        ]
