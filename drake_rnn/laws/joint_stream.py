r"""Joint targets of any source, followed within every bound and without collisions.

Targets come when they come: ten or fifty times a second, with gaps, jumps, or numbers that are
none. At each sample, joint by joint, the law wants

.. math::
    v = s(q_t - q), \qquad
    s(e) = \operatorname{sign}(e) \min(|e| / \tau, \kappa |e|, \sqrt{2 a |e|}),

with tau the time in which the newest target q_t is to be reached, counted down from ``interval``
when it came; kappa and a are what a joint can brake with. Of the velocities that are safe, see
`drake_rnn.laws.safety`, the nearest is commanded. A target that is not a number is not looked at;
after ``timeout`` without one the joints come to rest within their bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydantic import Field

from ..inputs.fields import Array, NonNegative, Positive, Vector, validated
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from .law import Law, SampledReading
from .layout import Layout, Signals
from .parts.held_clear import Avoidance, WithinClear
from .parts.held_within import Kept, WithinAcceleration, WithinJerk
from .parts.reached_limits import reached_limits
from .safety import Safety, nearest

# Shares of acceleration and jerk that are planned with; the rest is for what is not foreseen.
_BRAKING, _JERK = 0.9, 0.5


@validated
class JointStream(Law):
    """A law that follows joint targets within every bound up to the jerk, without collisions.

    Its inputs are ``position``, which it reads once, at the start, and ``target``, shape (n,)
    [rad], NaN where there is none.

    Args:
        limits: Limits of the joints; acceleration and jerk are bounded if their limits are given.
        home: Posture at the start, shape (n,) [rad].
        interval: Time in which a new target is to be reached [s], such as that between two; 0 for
            as soon as the bounds allow.
        timeout: Time without a target after which the joints come to rest [s].
        clearance: What the arm is to stay clear of; None for nothing.
        avoidance: How near it may come.
    """

    limits: JointLimits
    home: Vector
    interval: NonNegative = 0.0
    timeout: Positive = 0.2
    clearance: Clearance | None = None
    avoidance: Avoidance = Field(default_factory=Avoidance)

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        self.safety.check_start(self.home)

    @cached_property
    def safety(self) -> Safety:
        """What is kept of the velocities that it wants."""
        return Safety(self.limits, self.clearance, self.avoidance)

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; all limits that are known, up to the jerk."""
        return self.safety.keeps

    @property
    def keeps_distance(self) -> float | None:
        """See `Law.keeps_distance`."""
        return self.safety.keeps_distance

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        return Layout(position=(n,), target=(n,))

    def sampled(self, period: float) -> JointStreamReading:
        """Return a `JointStreamReading`."""
        return JointStreamReading(self, period)


@dataclass(frozen=True, eq=False)
class JointStreamReading(SampledReading):
    """The law at a period.

    The state holds v; the positions ``commanded``; the ``goal``, the last target; the times
    ``left`` to reach it and ``since`` a target was there [s]; how many samples had none, ``missed``;
    and what the choice of a velocity is made with.

    Attributes:
        law: The law.
        period: Its period [s].
    """

    law: JointStream
    period: float

    inputs_with_gaps = ("target",)

    @cached_property
    def _within(self) -> WithinAcceleration | WithinJerk | WithinClear:
        return self.law.safety.within(self.period)

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        own = {"v": (n,), "commanded": (n,), "goal": (n,)}
        times = {"left": (1,), "since": (1,), "missed": (1,)}
        return Layout(**own, **times, **self._within.shapes)

    @property
    def inputs(self) -> Layout:
        return self.law.inputs

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        q, none = u["position"], np.zeros(1)
        times = {"left": none, "since": none, "missed": none}
        own = {"v": np.zeros(q.size), "commanded": q, "goal": q, **times}
        return self._joined(own | self._within.start(q))

    def _joined(self, parts: Kept) -> Array:
        return self.state.join(*(parts[name] for name in self.state.parts))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        kept = dict(zip(self.state.parts, self.state.split(x), strict=True))
        q, goal, target = kept["commanded"], kept["goal"], u["target"]
        left = np.maximum(kept["left"] - period, 0.0)
        since, missed = kept["since"] + period, kept["missed"]
        if np.isfinite(target).all():
            if (target != goal).any():
                goal, left = target, np.full(1, self.law.interval)
            since = np.zeros(1)
        else:
            missed = missed + 1.0
        # Times that are sums of periods are compared half a period off.
        ended = since[0] > self.law.timeout + 0.5 * period
        wanted = np.zeros_like(q) if ended else self._towards(goal - q, left[0])
        v, held = self._within.chosen(nearest(wanted), q, kept["v"], kept, period)
        own = {"v": v, "commanded": q + period * v, "goal": goal, "left": left}
        return self._joined({**own, "since": since, "missed": missed, **held})

    def _towards(self, way: Array, left: float) -> Array:
        """Return the velocities that are wanted on the way to the goal, shape (n,) [rad/s].

        Args:
            way: How far the joints are from it, shape (n,) [rad].
            left: Time left to reach it [s].
        """
        gain, braking = self._pace
        size = np.abs(way)
        speed = np.minimum(
            size * np.minimum(1.0 / max(left, self.period), gain), braking * size**0.5
        )
        return np.asarray(np.copysign(np.minimum(speed, self.law.limits.velocity), way))

    @cached_property
    def _pace(self) -> tuple[Array, Array]:
        """Gain of the last of the way [1/s], and the root of twice the deceleration before."""
        limits = reached_limits(self.law.limits, self.period)
        most = _BRAKING * limits.require("acceleration", "braking in time")
        gain = np.full(most.size, 1.0 / self.period)
        if limits.jerk is not None:
            gain = np.minimum(gain, _JERK * limits.jerk / (2.0 * most))
        return gain, np.sqrt(2.0 * most)
