"""Joint targets of any source, followed within every bound and without collisions.

Targets come when they come: ten or fifty times a second, with gaps, jumps, or numbers that are
none. At each sample each joint wants the largest velocity from which, within all of its bounds, it
can still stop at the newest target: the target counts as a position limit. That is the fastest way
there, and no way beyond it. With an ``interval`` between targets it wants to be at the newest by
the end of it, and need not be able to stop there: smoother, and sooner, where targets come
regularly. Of the velocities that are safe, see `drake_rnn.laws.safety`, one near that is commanded.
A target that is not a number is not looked at; after ``timeout`` without one the joints come to
rest within their bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..inputs.dataclass_fields import unchecked
from ..inputs.fields import Array, NonNegative, Positive, Vector, validated
from ..inputs.keys import Meaning, Only
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from .law import Law, SampledReading
from .layout import Layout, Signals
from .parts.held_clear import Avoidance, Within
from .parts.held_within import Kept
from .parts.reached_limits import reached_limits
from .safety import Safety, nearest


@validated
class JointStream(Law):
    """A law that follows joint targets within every bound up to the jerk, without collisions.

    Its inputs are ``position``, which it reads once, at the start, and ``target``, shape (n,)
    [rad], NaN where there is none.
    """

    limits: Annotated[
        JointLimits,
        Meaning(
            "Limits of the joints; acceleration and jerk are bounded if their limits are given.",
        ),
    ]
    home: Annotated[Vector, Meaning("Posture at the start, shape (n,).", unit="rad")]
    kind: Literal["joint_stream"] = "joint_stream"
    summary = "Joint targets of any source, followed within every bound and without collisions."
    interval: Annotated[
        NonNegative,
        Meaning(
            "Time between two targets [s], in which a new one is to be reached; 0 where they "
            "come irregularly, to reach each as soon as the bounds allow.",
            unit="s",
        ),
    ] = 0.0
    timeout: Annotated[
        Positive,
        Meaning(
            "Time without a target after which the joints come to rest, wherever they are; a "
            "source repeats a target until it is reached.",
            unit="s",
        ),
    ] = 0.2
    clearance: Annotated[
        Clearance | None,
        Meaning("What the arm is to stay clear of; None for nothing."),
    ] = None
    avoidance: Annotated[
        Avoidance,
        Meaning("How near it may come.", only=(Only("obstacles"),)),
    ] = Field(default_factory=Avoidance)

    follows_joint_targets = True

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        if not self.timeout > self.interval:
            raise ValueError(
                f"timeout: must be longer than interval, {self.interval:g} s, not {self.timeout:g}"
            )
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
        return Layout(position=(n,), target=(n,), **self.safety.inputs)

    def sampled(self, period: float) -> JointStreamReading:
        """Return a `JointStreamReading`."""
        return JointStreamReading(self, period)


@dataclass(frozen=True, eq=False)
class JointStreamReading(SampledReading):
    """The law at a period.

    The state holds v; the positions ``commanded``; the ``goal``, the last target; the ``pace``
    at which it is reached in the time ``left``; the time ``since`` a target was there [s];
    ``missed``, how many samples had none; and what the choice of a velocity is made with.

    Attributes:
        law: The law.
        period: Its period [s].
        tolerance: Time by which samples may come late while a certified stop still holds [s].
    """

    law: JointStream
    period: float
    tolerance: float = 0.0

    inputs_with_gaps = ("target", "p_WO")

    @cached_property
    def _within(self) -> Within:
        return self.law.safety.within(self.period, self.tolerance)

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        own = {"v": (n,), "commanded": (n,), "goal": (n,), "pace": (n,)}
        times = {"left": (1,), "since": (1,), "missed": (1,)}
        return Layout(**own, **times, **self._within.shapes)

    @property
    def inputs(self) -> Layout:
        return self.law.inputs

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        q, none = u["position"], np.zeros(1)
        times = {"left": none, "since": none, "missed": none}
        none_yet = np.zeros(q.size)
        own = {"v": none_yet, "commanded": q, "goal": q, "pace": none_yet, **times}
        return self.state.joined(own | self._within.start(q, u))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        kept = self.state.named(x)
        q, goal, target = kept["commanded"], kept["goal"], u["target"]
        left, pace = np.maximum(kept["left"] - period, 0.0), kept["pace"]
        since, missed = kept["since"] + period, kept["missed"]
        if np.isfinite(target).all():
            if self.law.interval and (target != goal).any():
                left = np.full(1, self.law.interval)
                # At most the fastest, which the quotient may be far beyond.
                most = self.law.limits.velocity * self.law.interval
                pace = np.clip(target - q, -most, most) / self.law.interval
            goal, since = target, np.zeros(1)
        else:
            missed = missed + 1.0
        # Times that are sums of periods are compared half a period off.
        if since[0] > self.law.timeout + 0.5 * period:
            wanted = np.zeros_like(q)
        elif left[0] > 0.5 * period:
            wanted = pace
        else:
            inside = np.clip(goal, self._limits.position_lower, self._limits.position_upper)
            wanted = self._towards(inside, q, kept)
        v, held = self._within.chosen(nearest(wanted), q, kept["v"], kept, period, u)
        own = {"v": v, "commanded": q + period * v, "goal": goal, "left": left, "pace": pace}
        return self.state.joined({**own, "since": since, "missed": missed, **held})

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        kept, motion = self.state.named(x), {"commanded": q, "v": v, "a": a}
        own = {"commanded": q, "v": v, **self._within.resumed(kept, motion, elapsed)}
        if elapsed is not None:
            own["left"] = np.maximum(kept["left"] - elapsed, 0.0)
            own["since"] = kept["since"] + elapsed
        return self.state.replaced(x, **own)

    def _towards(self, goal: Array, q: Array, kept: Kept) -> Array:
        """Return the velocities that are wanted on the way to the goal, shape (n,) [rad/s].

        The fastest that can still be stopped there: the goal counts as a position limit, to which
        no envelope belongs.

        Args:
            goal: Where the joints are to rest, shape (n,) [rad].
            q: Where they are, shape (n,) [rad].
            kept: The parts of the state.
        """
        limits, h, v = self._limits, self.period, kept["v"]
        back = goal < q
        lower = np.where(back, goal, limits.position_lower)
        upper = np.where(back, limits.position_upper, goal)
        free = {"envelope_offset": None, "envelope_deceleration": None}
        ended = unchecked(limits, position_lower=lower, position_upper=upper, **free)
        if limits.jerk is None:
            down, up = ended.held_velocity_box(q, v, h)
        else:
            down, up = (v + h * a for a in ended.held_acceleration_box(q, v, kept["a"], h))
        return np.asarray(np.where(back, down, up))

    @cached_property
    def _limits(self) -> JointLimits:
        return reached_limits(self.law.limits, self.period)
