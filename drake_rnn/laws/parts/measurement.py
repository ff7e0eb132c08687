r"""Measurements that a law uses: their quality, their delay, and rates of signals.

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
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from ...arrays.algebra import functions_of, matvec
from ...errors import InvalidInputError
from ...inputs.fields import Array, Delay, NonNegative, validated
from ..law import Signals, State

#: Way of the end effector for each radian of a joint, of an arm of usual size, and that at which an
#: error of the orientation counts like one of the position [m].
REACH, LEVER = 0.5, 0.3
# The error that the rules are stated for [m], and what suits it.
_SIGMA = 1e-5
_WINDOW, _POWER = 10e-3, 0.7
_SOFTNESS = 1e-4
_LONGEST = 500
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
        samples = min(max(round(window / period), 1), _LONGEST)
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
