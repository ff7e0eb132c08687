r"""How a law treats measurements of a given quality.

Positions of the end effector with independent errors of standard deviation sigma, over m samples of
length h, give a velocity with the variance 2 (sigma / (m h))^2. Successive values share all but one
of their samples, so each counts for little: a hundred times this variance is assumed. The larger
the errors, the longer the secant, the softer the task, the slower the feedback and the slower what
was learned is given up: a program that believes a wrong J_hat to a millionth asks for velocities of
no use.

A law that knows its Jacobian believes it, whatever the errors are; only its feedback is slower, as
the root of the errors: a joint moves by the average of the errors over a time of 1 / kappa, and not
by each. The rules fit what trials with errors of 1 to 100 um found best.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from ...inputs.fields import Delay, NonNegative, validated

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
_SHARED = 100.0


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


def suited(measurement: Measurement, period: float) -> Learning:
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
        variance=max(EXACT.variance, _SHARED * 2.0 * (error / (samples * period)) ** 2),
        wander=0.1,
        softness=max(EXACT.softness, _SOFTNESS * error / _SIGMA),
        still=noise / REACH,
    )


def feedback_gain(measurement: Measurement, learned: bool) -> float:
    """Return the gain of the feedback that suits a measurement [1/s].

    Args:
        measurement: Its quality.
        learned: Whether the Jacobian is learned.
    """
    error = measurement.error
    if error == 0.0:
        return KAPPA
    if learned:
        return _KAPPA_LEARNED
    return min(max(_KAPPA_KNOWN * (_SIGMA / error) ** 0.5, _KAPPA_LEAST), KAPPA)
