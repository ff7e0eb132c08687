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

Measurements that a law uses: their quality, their delay, and rates of signals.

How a law treats measurements of a given quality.

Positions of the end effector with independent errors of standard deviation sigma, over m samples of
length h, give a velocity with the variance 2 (sigma / (m h))^2. Successive values share all but one
of their samples, so each counts for little: a hundred times this variance is assumed. The larger
the errors, the longer the secant, the softer the task, the slower the feedback and the slower what
was learned is given up: a program that believes a wrong J_hat to a millionth asks for velocities of
no use.

A law that knows its Jacobian believes it, whatever the errors are; only its feedback is slower, as
the root of the errors: a joint moves by the average of the errors over a time of 1 / kappa, and not
by each. The rules fit what trials with errors of 1 to 100 um found best.

The last values of something, and what an arm has moved since a measurement that comes late.

Time derivatives of signals by differences over the last samples.

Of the second order in the period h once there are three samples,
:math:`\dot s \approx (3 s_k - 4 s_{k-1} + s_{k-2}) / 2h`, of the first before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import expm1
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ...arrays.algebra import dot, functions_of, is_one, join, matvec, outer, root, scale
from ...errors import InvalidInputError
from ...inputs.fields import Array, Delay, NonNegative, Weight, validated
from ...inputs.keys import Meaning, Only
from ...robot.rotation import rotation_error
from ..law import Law, Signals, State

#: Way of the end effector for each radian of a joint, of an arm of usual size, and that at which an
#: error of the orientation counts like one of the position [m].
REACH, LEVER = 0.5, 0.3
# The error that the rules are stated for [m], and what suits it.
_SIGMA = 1e-5
_WINDOW, _POWER = 10e-3, 0.7
_SOFTNESS = 1e-4
_LONGEST_SECANT = 500
#: Gain of the feedback for exact measurements [1/s].
KAPPA = 100.0
# The gain for that error, and the slowest that still brings an arm to its path within seconds.
_KAPPA_LEARNED, _KAPPA_KNOWN, _KAPPA_LEAST = 30.0, 6.0, 2.0
# Ratio of the variance assumed to that of one secant.
_SHARE = 100.0


@validated
class Measurement:
    """Quality of what a law sees of its arm.

    Args:
        error: Standard deviation of the error of the measured end effector position, whatever
            its origin is [m].
        delay: Time by which measurements are late [s].
        secant_samples: Number of samples over which velocities are difference quotients; None for
            as many as suit the error.
    """

    error: NonNegative = 0.0
    delay: Delay = 0.0
    secant_samples: Annotated[int, Field(strict=True, ge=1, le=1000)] | None = None


class Learning(NamedTuple):
    """Numbers of a law that suit a measurement.

    Attributes:
        samples: Number of samples over which velocities are difference quotients.
        variance: Variance R of such a velocity [m^2/s^2].
        wander: Growth q_n of the variance of J_hat's entries [1/s].
        softness: Softness mu of the task.
        still: Joint speed below which nothing is learned, because the end effector then moves by
            less than its measurement errs [rad/s].
    """

    samples: int
    variance: float
    wander: float
    softness: float
    still: float


#: What suits exact measurements, or a Jacobian that is known.
EXACT = Learning(samples=1, variance=1e-5, wander=1.0, softness=1e-6, still=0.0)


def learning_for(measurement: Measurement, period: float) -> Learning:
    """Return the numbers that suit a measurement, for a Jacobian that is learned.

    Args:
        measurement: Its quality.
        period: Sampling period [s].
    """
    error, samples = measurement.error, measurement.secant_samples
    if error == 0.0:
        return EXACT._replace(samples=samples or 1)
    if samples is None:
        window = _WINDOW * (error / _SIGMA) ** _POWER
        samples = min(max(round(window / period), 1), _LONGEST_SECANT)
    noise = 2.0**0.5 * error / (samples * period)
    return Learning(
        samples=samples,
        variance=max(EXACT.variance, _SHARE * 2.0 * (error / (samples * period)) ** 2),
        wander=0.1,
        softness=max(EXACT.softness, _SOFTNESS * error / _SIGMA),
        still=noise / REACH,
    )


def feedback_gain(measurement: Measurement, learns: bool) -> float:
    """Return the gain of the feedback that suits a measurement [1/s].

    Args:
        measurement: Its quality.
        learns: Whether the Jacobian is learned.
    """
    error = measurement.error
    if error == 0.0:
        return KAPPA
    if learns:
        return _KAPPA_LEARNED
    return min(max(_KAPPA_KNOWN * (_SIGMA / error) ** 0.5, _KAPPA_LEAST), KAPPA)


def push(rows: Array, newest: Array, axis: int) -> Array:
    """Return the last values with one more, of which the oldest is dropped.

    Args:
        rows: The values along an axis, newest first, shape (..., k, ...).
        newest: The one more, without that axis.
        axis: The axis, counted from the end: -2 for vectors, -3 for matrices.
    """
    if rows.shape[axis] == 1:
        return newest[..., None, :] if axis == -2 else newest[..., None, :, :]
    others = rows[..., :-1, :] if axis == -2 else rows[..., :-1, :, :]
    xp = functions_of(newest)
    return xp.concatenate((xp.expand_dims(newest, axis), others), axis=axis)


# Share of a delay by which it may be off a multiple of the period.
_ROUNDING = 1e-9


def samples_late(delay: float, period: float) -> int:
    """Return the number of samples by which measurements are late.

    Args:
        delay: Delay of the measurements [s].
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the delay is no multiple of the period.
    """
    late = delay / period
    if abs(late - round(late)) > _ROUNDING * max(late, 1.0):
        raise InvalidInputError(
            f"law.measurement.delay, in a document sensing.delay: must be a multiple of the "
            f"period, {period:g} s, not {delay:g}"
        )
    return round(late)


@dataclass(frozen=True)
class Late:
    """The last commanded positions, as far back as the measurement.

    Attributes:
        samples: Number of samples by which measurements are late; 0 keeps nothing.
        size: Number n of joints.
    """

    samples: int
    size: int

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"q_late": (self.samples, self.size)} if self.samples else {}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {name: np.broadcast_to(u["position"], s) for name, s in self.shapes.items()}

    def step(self, state: State, u: Signals, period: float, J: Array) -> tuple[Array | None, State]:
        """Return the motion of the end effector since it was measured, shape (..., m).

        None if nothing is late. See `Component.step`; it reads the part ``commanded`` as well.

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            J: Jacobian of the task, shape (..., m, n).
        """
        if not self.samples:
            return None, {}
        q, rows = state["commanded"], state["q_late"]
        return matvec(J, q - rows[..., -1, :]), {"q_late": push(rows, q, -2)}


_SUFFIX = "_before"


@dataclass(frozen=True, eq=False)
class SignalRates:
    """What is kept of matrices that a law sees, and how fast they change.

    Attributes:
        signals: Shapes of the matrices, by name.
    """

    signals: Mapping[str, tuple[int, ...]]

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {f"{name}{_SUFFIX}": (2, *shape) for name, shape in self.signals.items()}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        shapes = self.shapes
        return {
            f"{name}{_SUFFIX}": np.broadcast_to(u[name], shapes[f"{name}{_SUFFIX}"])
            for name in self.signals
        }

    def step(self, state: State, u: Signals, period: float) -> tuple[State, State]:
        """Return the rates by name; see `Component.step`.

        It reads the part ``samples`` as well, the number of samples before, shape (..., 1).
        """
        rates, after, count = {}, {}, state["samples"]
        where = functions_of(count).where
        # At the first sample both differences vanish.
        second = where(count >= 2.0, 0.5, 0.0)[..., None]
        for name in self.signals:
            now, before = u[name], state[f"{name}{_SUFFIX}"]
            last = now - before[..., 0, :, :]
            earlier = before[..., 0, :, :] - before[..., 1, :, :]
            rates[name] = (last + second * (last - earlier)) / period
            after[f"{name}{_SUFFIX}"] = push(before, now, -3)
        return rates, after


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
        q, p, y = u["position"], u["p_WE"], self.task_velocity(state, u, period)
        w = (q - state["q_before"][..., -1, :]) / (self.samples * period)
        parts = {
            "q_before": push(state["q_before"], q, -2),
            "p_before": push(state["p_before"], p, -2),
        }
        if self.turns:
            parts["R_before"] = push(state["R_before"], u["R_WE"], -3)
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

    def task_velocity(self, state: State, u: Signals, period: float) -> Array:
        """Return the task velocity that is measured, shape (..., m); see `Component.step`."""
        over = self.samples * period
        y = (u["p_WE"] - state["p_before"][..., -1, :]) / over
        if not self.turns:
            return y
        rotation = rotation_error(state["R_before"][..., -1, :, :], u["R_WE"]) / over
        return join((rotation, y))

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
