"""The base class of laws whose network follows the optimum of a scheme's program.

- The base class of laws of programs whose Jacobian may be learned.
- The sampled reading of laws whose network follows the optimum of a scheme's program.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, Literal, Protocol

import numpy as np

from ..inputs.fields import Array, Gain, GainOrZero, Positive, Vector, between, validated
from ..inputs.keys import Meaning, Only
from ..robot.clearance.clearance import CriticalPoints
from ..robot.limits import JointLimits
from ..robot.task import RowBlock
from .law import Component, Law, Layout, SampledReading, Signals
from .parts.jacobian import JacobianKeys, LearnedJacobian, SignalRates
from .parts.programs import Program, Rates
from .scheme import (
    Cost,
    EndEffectorVelocity,
    KineticEnergy,
    LargestVelocity,
    MutualRows,
    QPScheme,
    ReturningVelocity,
    VelocityBox,
)

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.


@validated
class ProgramLaw(Law):
    """A law with a scheme: a cost along a path, within bounds if they are asked for."""

    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joints; with ``bounds: velocity`` those of position and velocity."),
    ]
    home: Annotated[
        Vector,
        Meaning("Posture at the start, which the joints return to, shape (n,).", unit="rad"),
    ]
    task_size: Annotated[
        Literal[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
        Meaning("Number of rows of J; of 6 rows the first three are rotation, but of objectives."),
    ] = 3
    objectives: Annotated[
        tuple[RowBlock, ...] | None,
        Meaning("What is known of the rows of objectives; None for a position or a pose."),
    ] = None
    cost: Annotated[
        Literal["velocity", "kinetic_energy", "largest_velocity"],
        Meaning(
            "What is minimised: ``velocity``, ``kinetic_energy`` or ``largest_velocity``, see "
            "`drake_rnn.laws.scheme`.",
        ),
    ] = "velocity"
    return_gain: Annotated[
        GainOrZero,
        Meaning(
            "Gain k of the way back to that posture; 0 for the least velocity alone.",
            unit="1/s",
        ),
    ] = 1.0
    manipulability: Annotated[
        GainOrZero,
        Meaning(
            "Gain of the gradient of the manipulability [rad/s], with ``cost: velocity``.",
            unit="rad/s",
        ),
    ] = 0.0
    blend: Annotated[
        Positive,
        between(1e-3, 0.99),
        Meaning(
            "Weight of the velocity's square beside the largest velocity; nearly 1 has the "
            "square alone.",
            unit="1",
            only=(Only("cost", "largest_velocity"),),
        ),
    ] = 0.1
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain K of the feedback of position and orientation.", unit="1/s"),
    ] = 10.0
    bounds: Annotated[
        Literal["none", "velocity"],
        Meaning(
            "``velocity`` has the limits of position and velocity as inequalities of the "
            "program, which the network fulfils as well as it follows its optimum; ``none`` has "
            "none.",
        ),
    ] = "none"
    limit_stiffness: Annotated[
        Gain,
        Meaning(
            "Velocity allowed per radian left to a position limit [1/s], where the program has "
            "bounds.",
            unit="1/s",
        ),
    ] = 10.0

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        has_no_bound = ~np.isfinite(self.limits.velocity)
        if self._has_bounds and has_no_bound.any():
            raise ValueError(
                f"{self._bounding} needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(has_no_bound)) + 1} has none; give limits.velocity"
            )

        if self.objectives is None and self.task_size > 6:
            raise ValueError(f"task_size: may be 1 to 6 without objectives, not {self.task_size}")
        if self.manipulability and (self.cost != "velocity" or self.task_size not in (3, 6)):
            raise ValueError(
                "manipulability: needs cost: velocity and task: xyz or pose; leave it out"
            )

    @property
    def _bounding(self) -> str:
        """What has bounds in the program, as a document says it; empty without bounds."""
        return "" if self.bounds == "none" else f"bounds: {self.bounds}"

    @property
    def _has_bounds(self) -> bool:
        return bool(self._bounding)

    @property
    def turns(self) -> bool:
        """Whether the task is a pose."""
        return self.task_size == 6 and self.objectives is None

    @property
    def mutual_rows(self) -> MutualRows | None:
        """Rows of the program that slow links of two arms down; None for none."""
        return None

    def critical_points(self, q: Array) -> CriticalPoints:
        """Return where links of two arms are nearest the other arm; only with `mutual_rows`."""
        raise NotImplementedError

    @property
    def _cost(self) -> Cost:
        if self.cost == "kinetic_energy":
            return KineticEnergy(self.home, self.return_gain)
        square = ReturningVelocity(self.home, self.return_gain, self.manipulability, self.task_size)
        return square if self.cost == "velocity" else LargestVelocity(square, self.blend)

    @cached_property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""
        return QPScheme(
            self._cost,
            EndEffectorVelocity(self.limits.size, self.task_size, self.feedback, self.turns),
            VelocityBox(self.limits, self.limit_stiffness) if self._has_bounds else None,
        )

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        stiffness = {"limit_stiffness": self.limit_stiffness} if self._has_bounds else {}
        return {"feedback": self.feedback, "return_gain": self.return_gain, **stiffness}

    @property
    def limits_remedy(self) -> str:
        return "safety: {bounds: true} does"


# Parts of a network's state that are recorded, by the names of observables.
_METRIC_NAMES = {"residual": "residual_largest", "funnel_share": "funnel_used"}


#: A network that follows the optimum of a program: of the time, the program and how fast it changes
#: it finds the optimum x at the next sample. Among its parts of the state are ``optimum``, these
#: variables, and ``residual_largest``; it reads ``samples`` too, the number of samples before.
FollowingNetwork = Component[[float, Program, Rates], Array]


class FollowingLaw(Protocol):
    """What the reading needs of a law."""

    @property
    def limits(self) -> JointLimits:
        """Limits of the joints; only their number is used."""

    @property
    def inputs(self) -> Layout:
        """Signals that it sees."""

    @property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""

    @property
    def dynamics(self) -> FollowingNetwork:
        """The network."""

    @property
    def mutual_rows(self) -> MutualRows | None:
        """See `ProgramLaw.mutual_rows`."""

    def critical_points(self, q: Array) -> CriticalPoints:
        """See `ProgramLaw.critical_points`."""


@dataclass(frozen=True, eq=False)
class ProgramReading(SampledReading):
    """The network of a law, sampled.

    What is commanded is held for a sample: the mean of the network's velocities at its two ends,
    which moves the joints as the ramp between them does. How J changes is told by the last samples;
    of one that is learned it is not known.

    Attributes:
        law: The law.
    """

    law: FollowingLaw

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        parts = {name: shape for part in self._components for name, shape in part.shapes.items()}
        return Layout(v=(n,), **parts, samples=(1,))

    @property
    def _components(self) -> tuple[Component[..., Any], ...]:
        further = (self.learned_jacobian, self.law.mutual_rows)
        return (self.law.dynamics, self._rates, *(part for part in further if part is not None))

    @cached_property
    def inputs(self) -> Layout:
        return self.law.inputs

    @cached_property
    def observables(self) -> Layout:
        parts = self.state.parts
        return Layout(**{name: (1,) for name, part in _METRIC_NAMES.items() if part in parts})

    @property
    def learned_jacobian(self) -> LearnedJacobian | None:
        """Where its Jacobian comes from if it is learned; None if it is told."""
        return None

    @cached_property
    def _rates(self) -> SignalRates:
        signals = self.law.scheme.differentiated_signals
        return SignalRates(
            {k: s for k, s in signals.items() if k != "J" or self.learned_jacobian is None}
        )

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        start = {"v": np.zeros(self.law.limits.size), "samples": np.zeros(1)}
        for part in self._components:
            start |= part.init(u, rng)
        return self.state.from_parts(start)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        state, scheme = self.state.by_name(x), self.law.scheme
        count, before = state["samples"], state["optimum"]
        u_dot, rate_state = self._rates.step(state, u, period)
        if self.learned_jacobian is not None:
            J, learned = self.learned_jacobian.step(state, u, period)
            u, rate_state = {**u, "J": J}, {**rate_state, **learned}
            u_dot = {**u_dot, "J": 0.0 * J}
        further, rows = None, self.law.mutual_rows
        if rows is not None:
            near, v = self.law.critical_points(u["position"]), before[..., : self.law.limits.size]
            further, mutual = rows.step(state, u, period, near, v)
            rate_state = {**rate_state, **mutual}
        program, rates = scheme.program(u, further), scheme.rates(u, u_dot, before)
        optimum, network = self.law.dynamics.step(state, u, period, t, program, rates)
        # The joint velocities come before what else the program has.
        v = 0.5 * (before + optimum)[..., : self.law.limits.size]
        return self.state.from_parts({"v": v, **network, **rate_state, "samples": count + 1.0})

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {name: self.state.part(x, _METRIC_NAMES[name]) for name in self.observables.parts}


@validated
class LearningProgramLaw(JacobianKeys, ProgramLaw):
    """A law of a program whose Jacobian is known, or learned from positions."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.manipulability and self.learns_jacobian:
            raise ValueError("manipulability: needs jacobian: known; leave it out")

    @property
    @abstractmethod
    def dynamics(self) -> FollowingNetwork:
        """The network that the law runs."""

    def _reading(self, period: float) -> LearningReading:
        """Return the reading with the numbers that suit its measurement, at a period [s]."""
        suits = self._learning_for(period)
        law = replace(self, variance=suits.variance, wander=suits.wander)
        return LearningReading(law, suits.samples, suits.still)

    @property
    def inputs(self) -> Layout:
        shapes = self.scheme.inputs
        if self.learns_jacobian:
            del shapes["J"]
            shapes |= {"position": (self.limits.size,)}
        return Layout(**shapes)

    @property
    def state(self) -> Layout:
        n, m = self.limits.size, self.task_size
        jacobian_part = {"J_hat": (m, n)} if self.learns_jacobian else {}
        return Layout(v=(n,), **self.dynamics.shapes, **jacobian_part)


@dataclass(frozen=True, eq=False)
class LearningReading(ProgramReading):
    """The sampled reading of a `LearningProgramLaw`.

    Attributes:
        law: The law, with the numbers that suit its measurement.
        samples: Number of samples over which velocities are difference quotients.
        still: Joint speed below which nothing is learned [rad/s].
    """

    law: LearningProgramLaw
    samples: int
    still: float

    @cached_property
    def learned_jacobian(self) -> LearnedJacobian | None:
        """See `ProgramReading.learned_jacobian`."""
        law = self.law
        if law.jacobian == "known":
            return None
        shape = (law.task_size, law.limits.size)
        return law.learned_jacobian(shape, self.samples, self.still, turns=law.turns)
