"""How far beyond their limits joints get that hold their acceleration for some samples.

An FR3 does so where it loses cycles. Its joints are driven through the box of their accelerations,
to wherever it lets them. From the states that they pass they hold their acceleration, and go on in
the box as if they still wanted to where they were going: that is the worst a law can want::

    python benchmarks/fr3_held.py

First with the robot's own limits, then with those that a drive keeps: 0.05 rad and 0.3 rad/s
inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_rnn import FR3, Array, JointLimits
from drake_rnn.laws.parts.bounded_velocity import reached_limits
from markdown_table import head, row

H = FR3.period
#: Arms side by side, samples that they are driven, and every which of them is looked at.
ARMS, DRIVEN, EVERY = 24, 2000, 100
#: Samples for which an acceleration is held, and those in which joints come back.
HELD, BACK = (1, 2, 5, 10, 19), 700
#: What rounding may be beyond a limit [rad or rad/s].
ROUNDING = 1e-9


class Moving(NamedTuple):
    """Joints, with an array of shape (..., 7) each [rad, rad/s, rad/s^2].

    Attributes:
        q, v, a: Their motion.
    """

    q: Array
    v: Array
    a: Array

    def held(self) -> Moving:
        """Return the joints a sample later, with the acceleration that they have."""
        return self.advanced(self.a)

    def advanced(self, a: Array) -> Moving:
        """Return the joints a sample later, with another acceleration."""
        v = self.v + H * a
        return Moving(self.q + H * v, v, a)


@dataclass(frozen=True)
class Beyond:
    """How far joints are beyond their limits, shape (..., 7) each; none is zero or below.

    Attributes:
        position: Of their positions [rad].
        velocity: Of their velocities, without the envelope [rad/s].
        envelope: Of their velocities, under the envelope [rad/s].
    """

    position: Array
    velocity: Array
    envelope: Array

    @property
    def any(self) -> Array:
        """Whether any limit is broken, shape (..., 7)."""
        worst: Array = np.maximum.reduce([self.position, self.velocity, self.envelope]) > ROUNDING
        return worst


def beyond(now: Moving, limits: JointLimits) -> Beyond:
    """Return how far joints are beyond limits."""
    position = np.maximum(limits.position_lower - now.q, now.q - limits.position_upper)
    envelope = limits.envelope
    assert envelope is not None
    # The velocity has been held until this position, and is judged at it.
    lowest, highest = envelope.velocities(now.q, (limits.position_lower, limits.position_upper))
    off = np.maximum(now.v - np.maximum(highest, 0.0), np.minimum(lowest, 0.0) - now.v)
    return Beyond(position, np.abs(now.v) - limits.velocity, off)


def wishes(rng: np.random.Generator, shape: tuple[int, ...]) -> Iterator[Array]:
    """Yield the accelerations that joints want, up, down or none, each for a while of its own."""
    turns, wanted = rng.uniform(0.002, 0.03, shape), np.zeros(shape)
    while True:
        anew = rng.random(shape) < turns
        drawn = rng.choice([-np.inf, np.inf, 0.0], shape, p=[0.45, 0.45, 0.1])
        wanted = np.where(anew, drawn, wanted)
        yield wanted


def boxed(now: Moving, wanted: Array, limits: JointLimits) -> Moving:
    """Return joints a sample later in their box."""
    lower, upper = limits.held_acceleration_box(*now, H)
    assert (lower <= upper).all()
    return now.advanced(np.clip(wanted, lower, upper))


def reached(limits: JointLimits, rng: np.random.Generator) -> tuple[Moving, Array]:
    """Return joints on their ways, shape (k, 7) each, and where they want to, shape (k, 7)."""
    lowest, highest = limits.resting
    q = rng.uniform(lowest, highest, (ARMS, lowest.size))
    now, passed = Moving(q, np.zeros_like(q), np.zeros_like(q)), []
    for k, wanted in zip(range(DRIVEN), wishes(rng, q.shape), strict=False):
        now = boxed(now, wanted, limits)
        assert not beyond(now, limits).any.any()
        if k % EVERY == EVERY - 1:
            passed.append((*now, wanted))
    q, v, a, wanted = (np.concatenate(part) for part in zip(*passed, strict=True))
    return Moving(q, v, a), wanted


@dataclass(frozen=True)
class Found:
    """What came of joints that held their acceleration.

    Attributes:
        breaks: Share of them that get beyond a limit.
        position, velocity, envelope: How far beyond the limits they get at most [rad, rad/s].
        back: Samples until those are within their limits again, or at rest, in the median and at
            most.
        outside: Share of all that get beyond the robot's own limits.
        farthest: How far beyond its own velocities or their envelope they get at most [rad/s].
    """

    breaks: float
    position: float
    velocity: float
    envelope: float
    back: tuple[int, int]
    outside: float
    farthest: float


def found(limits: JointLimits, start: Moving, wanted: Array, held: int) -> Found:
    """Return what comes of joints that hold their acceleration for some samples."""
    now, own = start, FR3.limits
    worst = dict.fromkeys(("position", "velocity", "envelope"), 0.0)
    outside, last = np.zeros(now.q.shape, bool), np.full(now.q.shape, -1)
    farthest = 0.0
    for k in range(1 - held, BACK + 1):
        now = now.held() if k < 1 else boxed(now, wanted, limits)
        here, there = beyond(now, limits), beyond(now, own)
        for name in worst:
            worst[name] = max(worst[name], float(getattr(here, name).max()))
        last = np.where(here.any & (np.abs(now.v) > ROUNDING), max(k, 0), last)
        outside |= there.any
        farthest = max(farthest, float(np.maximum(there.velocity, there.envelope).max()))
    broken = last[last >= 0] if (last >= 0).any() else np.zeros(1)
    back = int(np.median(broken)), int(broken.max())
    share = float((last >= 0).mean())
    return Found(share, **worst, back=back, outside=float(outside.mean()), farthest=farthest)


def main() -> None:
    head(
        *(
            "limits",
            "samples held",
            "joints that get beyond",
            "position [mrad]",
            "velocity [rad/s]",
        ),
        *(
            "envelope [rad/s]",
            "back or at rest after [ms]: median / most",
            "beyond the robot's own, by [rad/s]",
        ),
        made_by="python benchmarks/fr3_held.py",
    )
    for name, given in (("the robot's own", FR3.limits), ("of a drive", FR3.command_limits)):
        limits = reached_limits(given, H)
        start, wanted = reached(limits, np.random.default_rng(0))
        for held in HELD:
            each = found(limits, start, wanted, held)
            row(
                name,
                held,
                f"{100 * each.breaks:.1f} %",
                f"{1e3 * each.position:.2f}",
                f"{each.velocity:.3f}",
                f"{each.envelope:.3f}",
                f"{each.back[0]} / {each.back[1]}",
                f"{100 * each.outside:.2f} %, {each.farthest:.3f}",
            )


if __name__ == "__main__":
    main()
