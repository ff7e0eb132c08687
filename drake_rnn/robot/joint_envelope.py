"""How near one joint comes to its envelope of the velocity, in plain numbers.

The algebra is that of `drake_rnn.robot.velocity_envelope`, in the same order, so that each result
has the same bits; for the few joints of one robot it takes a fraction of the time.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from . import joint_stop

#: Times that an interval of samples is halved; each takes as long as a tenth of all the rest.
HALVINGS = 8
#: More than one, by more than rounding.
ROUNDED = 1.0 + 1e-12


class JointEnvelope(NamedTuple):
    """The envelope of a joint.

    Attributes:
        offset: o [rad/s].
        deceleration: D [rad/s^2]; infinite for none.
    """

    offset: float
    deceleration: float

    def room(self, v: float) -> float:
        """Return the way to the limit that a velocity towards it needs [rad]."""
        speed = max(v, 0.0) + self.offset
        return speed * speed * (0.5 / self.deceleration)


class _Falling(NamedTuple):
    """The steps down of a stop, as if mirrored where it is; see `joint_stop.course`."""

    v: float
    x: float
    steps: float
    step: float
    period: float

    def velocity(self, k: float) -> float:
        return self.v + self.period * self.step * k * (self.x - 0.5 * (k + 1.0))

    def way(self, k: float) -> float:
        return joint_stop.way(self.v, self.x * self.step, -self.step, k, self.period)


def farthest(
    w: float, b: float, envelope: JointEnvelope, most: float, jerk: float, period: float
) -> float:
    """Return the largest H, less q, of a joint that accelerates at b and then stops [rad].

    Args:
        w: Velocity after the acceleration [rad/s].
        b: The acceleration [rad/s^2].
        envelope: The envelope.
        most: Largest acceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        period: Time for which a velocity is held [s].
    """
    d, v = jerk * period, w
    if w > 0.0:
        sign = 1.0 if b > 0.0 else -1.0 if b < 0.0 else 0.0
        v = max(w, -ROUNDED * period * d * sign * joint_stop.gained(abs(b) / d - 1.0))
    mirror, v, x, steps, longest, last = joint_stop.course(v, b, most, d, period)
    beyond = -inf
    if mirror > 0.0:
        falling = _Falling(v, x, steps, d, period)
        end = joint_stop.end(v, x, (steps, longest, last), most, d, period)
        beyond = max(
            _falling(falling, envelope),
            _held(falling, longest, envelope, most),
            end + _rising(last, envelope, d, period),
        )
    return period * w + max(envelope.room(w), beyond)


def _falling(of: _Falling, envelope: JointEnvelope) -> float:
    """Return a bound of H where the acceleration falls by steps."""
    offset, D = envelope
    x, d, h, steps = of.x, of.step, of.period, of.steps
    share = d / D
    low = min(max(x // 1.0, 0.0), steps)
    high = min(max(-(-(x + D / d) // 1.0), low), steps) if isfinite(D) else steps
    for _ in range(HALVINGS):
        if not low < high:
            break
        middle = -(-0.5 * (low + high) // 1.0)
        v, a = of.velocity(middle), x - middle
        if 2.0 * v + share * a * (2.0 * v - h * d * a + 2.0 * offset) > 0.0:
            low = middle
        else:
            high = middle - 1.0
    return of.way(high) + envelope.room(of.velocity(low))


def _held(of: _Falling, longest: float, envelope: JointEnvelope, most: float) -> float:
    """Return the largest H at the largest deceleration, from its beginning on."""
    offset, D = envelope
    h, count = of.period, 0.0
    excess, begun = 1.0 - most / D, of.velocity(of.steps)
    if excess > 0.0:
        mean = most * (offset / D + 0.5 * h) / excess
        count = min(max(((begun - mean) / (h * most) + 0.5) // 1.0, 0.0), longest)
    way = h * count * (begun - 0.5 * h * most * (count + 1.0))
    return of.way(of.steps) + way + envelope.room(begun - h * most * count)


def _rising(last: float, envelope: JointEnvelope, d: float, h: float) -> float:
    """Return a bound of H beyond the end, where the acceleration rises by steps to zero."""
    share = 1.0 / envelope.deceleration
    needed = 1.0 + 2.0 * envelope.offset * share / h
    square = 1.0 - 4.0 * d * share * needed
    steps = first = last // 1.0
    if square > 0.0:
        first = min(steps, 2.0 * needed / (1.0 + sqrt(square)) // 1.0)

    def beyond(z: float) -> float:
        left = h * h * d * (z**3 - z) / 6.0
        return envelope.room(0.5 * h * d * z * (z + 1.0)) - left

    return max(beyond(first), beyond(steps))
