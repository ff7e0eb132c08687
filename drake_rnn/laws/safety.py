r"""A reading around a law's own: the velocity that it wants becomes one that is safe.

At each sample the law is asked, and one is commanded of the velocities that keep every bound and
are certified to be free, see `drake_rnn.laws.parts.bounded_velocity` and
`drake_rnn.laws.parts.safe_velocity`: near to the one it wants in what the end effector does, if the
law sees J, and then in what the joints do, so that joints make way where the task allows it. The
law goes on with the velocity that it wanted: a network into whose state the other is written loses
its path. Without a bound of the jerk, a velocity that is safe and far from everything stays as it
is, to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays.algebra import Parts, join
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    checked,
    instance,
)
from ..inputs.messages import fields_of
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits, require_resting
from ..robot.rotation import rotation_error
from .call_checks import without_checks
from .law import (
    Layout,
    SampledReading,
    Signals,
)
from .parts.bounded_velocity import Program, limits_within_bounds, reached_limits
from .parts.jacobian import LEVER
from .parts.reach_edge import ReachEdge
from .parts.safe_velocity import (
    SIGNAL_AXES,
    Avoidance,
    Within,
    WithinClear,
    limit_axes,
    per_robot_of,
    require_free,
    within_safe,
)
from .parts.world import seen_signals

# Price of a change of the task's velocity against one of the joints' [m^2].
_SOFTNESS = 1e-6


@checked(
    limits=instance(JointLimits),
    clearance=instance(Clearance, None),
    avoidance=instance(Avoidance),
)
@dataclass(frozen=True, eq=False)
class Safety:
    """What is kept of a velocity, whoever wants it.

    Attributes:
        limits: Limits of the joints: those of position and velocity, and those of acceleration and
            jerk if there are any.
        clearance: What the arm is to stay clear of; None for nothing.
        avoidance: How near it may come.

    Raises:
        InvalidInputError: If limits and clearance are of arms of different numbers of joints.
    """

    limits: JointLimits
    clearance: Clearance | None = None
    avoidance: Avoidance = Avoidance()  # noqa: RUF009  it never changes

    def __post_init__(self) -> None:
        if self.clearance is not None and self.clearance.size != self.limits.size:
            raise InvalidInputError(
                f"clearance: is of an arm of {self.clearance.size} joints; the limits are of "
                f"{self.limits.size}"
            )

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`."""
        return limits_within_bounds(self.limits)

    @property
    def keeps_distance(self) -> float | None:
        """See `Law.keeps_distance`."""
        return None if self.clearance is None else self.avoidance.floor

    @property
    def inputs(self) -> dict[str, tuple[int, ...]]:
        """What it sees besides what the law does, with the shapes."""
        return seen_signals(self.clearance)

    def check_start(self, q: Array, p_WO: Array | None = None) -> None:
        """Raise an InvalidInputError unless joints can rest in a posture, shape (n,), all kept.

        Args:
            q: The posture [rad].
            p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
        """
        require_resting(self.limits, q, "start")
        if self.clearance is not None:
            require_free(self.clearance, self.avoidance.floor, q, p_WO)

    def within(self, period: float, tolerance: float = 0.0) -> Within:
        """Return what chooses a velocity that is safe.

        Args:
            period: Time for which it is held [s].
            tolerance: Time by which samples may come late while a certified stop still holds [s].
        """
        avoids = None if self.clearance is None else (self.clearance, self.avoidance)
        limits = reached_limits(self.limits, period)
        return within_safe(limits, 1.0, avoids, tolerance=tolerance)

    def around(self, reading: SampledReading, period: float) -> SafeReading:
        """Return a reading that commands what is safe of what another one wants.

        Args:
            reading: The other one.
            period: Its period [s].

        Raises:
            InvalidInputError: If its command varies between samples, or it has other joints.
        """
        if not reading.holds_command:
            raise InvalidInputError(
                f"safety: {type(reading).__name__} varies its command between samples; what can be "
                "certified are velocities that are held"
            )
        (n,) = reading.state.parts["v"][1]
        if n != self.limits.size:
            raise InvalidInputError(
                f"safety: has limits of {self.limits.size} joints; the law moves {n}"
            )
        rows = reading.inputs.parts["J"][1][0] if "J" in reading.inputs else 0
        scales = np.where(np.arange(rows) < rows - 3, LEVER, 1.0)
        edge = ReachEdge(reached_limits(self.limits, period), scales, period)
        return SafeReading(reading, self.within(period), self.inputs, edge)


def nearest(v: Array, J: Array | None = None) -> Program:
    """Return the program that wants a velocity.

    Args:
        v: The velocity, shape (n,) [rad/s]; without J, shape (..., n).
        J: Jacobian of a task that counts more than the joints, shape (m, n); None for none.
    """
    b = np.zeros((*v.shape[:-1], 0)) if J is None else J.dot(v)
    J = np.zeros((0, v.shape[-1])) if J is None else J
    return Program(J, b, b, v, _SOFTNESS * np.eye(b.shape[-1]))


@dataclass(frozen=True, eq=False)
class SafeReading(SampledReading):
    """A reading around another one.

    Its state holds that of the other one and, each with the prefix ``safe_``, the positions that
    it has commanded; the velocities that the other one wants; and what its choice is made with.

    Attributes:
        wanting: The reading that wants a velocity.
        within: What chooses the one that is safe.
        seen: What that sees besides ``position``, with the shapes.
        edge: The edge of reach, before which what a law wants is braked if it sees J and
            its error.
    """

    wanting: SampledReading
    within: Within
    seen: dict[str, tuple[int, ...]]
    edge: ReachEdge

    @property
    def takes_many(self) -> bool:  # type: ignore[override]
        """See `Reading.takes_many`."""
        return self.wanting.takes_many

    @property
    def inputs_with_gaps(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Reading.inputs_with_gaps`."""
        return (*self.wanting.inputs_with_gaps, "p_WO")

    @cached_property
    def state(self) -> Layout:
        theirs = {name: shape for name, (_, shape) in self.wanting.state.parts.items()}
        own = {f"safe_{name}": shape for name, (_, shape) in self._own.parts.items()}
        return Layout(**theirs, **own)

    @cached_property
    def _own(self) -> Layout:
        """Its own parts of the state, which follow those of the other one."""
        shape = self.wanting.state.parts["v"][1]
        return Layout(commanded=shape, wanted=shape, **self.within.shapes)

    @cached_property
    def inputs(self) -> Layout:
        signals = {name: shape for name, (_, shape) in self.wanting.inputs.parts.items()}
        return Layout(**{"position": self.wanting.state.parts["v"][1], **signals, **self.seen})

    @property
    def observables(self) -> Layout:
        return self.wanting.observables

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        x, q = self.wanting.initial_state(rng, u), u["position"]
        own = {"commanded": q, "wanted": self.wanting.state.part(x, "v")}
        own |= self.within.init(u, rng)
        # An arm at rest is what a stop is certified for.
        return self._join(self.wanting.state.with_parts(x, v=np.zeros(q.size)), own)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        parts, at = self._own.by_name(x[..., self.wanting.state.size :]), self._v
        demand = self._step(t, self._theirs(x), u, period)
        J, error = u.get("J"), self._error(u)
        wants = demand[..., at]
        shapes = {name: shape for name, (_, shape) in self._own.parts.items()} | {"v": (1,)}
        seen = {name: axes for name, axes in SIGNAL_AXES.items() if name in u}
        task = [each for each in (J, error) if each is not None]
        outputs: list[str] = []

        def step(reading: SafeReading, wants: Array, *operands: Array) -> Parts:
            rows = iter(operands)
            own = {name: next(rows) for name in shapes}
            around = {name: next(rows) for name in seen}
            of_task = tuple(rows)
            if len(of_task) == 2:
                wants = reading.edge.brake(wants, *of_task, own["commanded"])
            program = nearest(wants, of_task[0] if J is not None else None)
            v, after = reading.within.step(own, around, period, program)
            outputs[:] = after
            return v, *after.values()

        state = parts | {"v": x[..., at]}
        operands = [wants, *(state[name] for name in shapes), *(u[name] for name in seen), *task]
        axes = [
            1,
            *map(len, shapes.values()),
            *seen.values(),
            *((2, 1) if len(task) == 2 else (2,)),
        ]
        axes = axes[: len(operands)]
        safe, *after = per_robot_of(self, self._number_axes, step, operands, axes)
        own = {"commanded": parts["commanded"] + period * safe, "wanted": wants}
        own |= dict(zip(outputs, after, strict=True))
        return self._join(self.wanting.state.with_parts(demand, v=safe), own)

    @cached_property
    def _number_axes(self) -> dict[tuple[str, ...], int]:
        """Where its own numbers are, and how many axes each has of one robot."""
        within = self.within
        own = within.number_axes if isinstance(within, WithinClear) else limit_axes(within)
        edge = {("limits", name): 1 for name in fields_of(self.edge.limits)} | {("scales",): 1}
        return {("within", *place): axes for place, axes in own.items()} | {
            ("edge", *place): axes for place, axes in edge.items()
        }

    def _error(self, u: Signals) -> Array | None:
        """Return the error of its task, shape (..., m); None if it does not see all of it."""
        if "J" not in u or "p_WE" not in u or "p_WE_desired" not in u:
            return None
        away = u["p_WE_desired"] - u["p_WE"]
        if self.edge.scales.shape[-1] == away.shape[-1]:
            return away
        if "R_WE" not in u or "R_WE_desired" not in u:
            return None
        return join((rotation_error(u["R_WE"], u["R_WE_desired"]), away))

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        size, motion = self.wanting.state.size, {"commanded": q, "v": v, "a": a}
        parts = self._own.by_name(x[size:]) | {"v": x[self._v]}
        own = parts | {"commanded": q} | self.within.resumed(parts, motion, elapsed)
        return self._join(self.wanting.resumed(x[:size], q, v, a, elapsed), own)

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return self.wanting.diagnostics(t, self._theirs(x), u)

    def _theirs(self, x: Array) -> Array:
        theirs = x[..., : self.wanting.state.size]
        return self.wanting.state.with_parts(theirs, v=self.state.part(x, "safe_wanted"))

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.wanting.caveats(metrics)

    @cached_property
    def _step(self) -> Any:
        return without_checks(self.wanting.step)

    def _join(self, theirs: Array, own: Signals) -> Array:
        return join((theirs, self._own.from_parts(own)))
