r"""Projection networks: dual, and primal-dual of a linear variational inequality.

Sources:
    Zhang, Wang, Xia, "A dual neural network for redundancy resolution of kinematically redundant
    manipulators subject to joint limits and joint velocity limits", IEEE Transactions on Neural
    Networks 14 (2003). The LVI-based primal-dual network: Zhang, "On the LVI-based primal-dual
    neural network for solving online linear and quadratic programming problems", American Control
    Conference (2005), and its simplified form, in which public code integrates them. The
    projection network: Xia, Leung, Wang, "A projection neural network and its application to
    constrained optimization problems", IEEE Transactions on Circuits and Systems I 49 (2002).
    Equations were read in public code, see `drake_rnn.laws.projection_network`; the
    papers themselves were not read.

The optimum of the program of a scheme (`drake_rnn.laws.scheme`) is where a projection leaves the
network as it is. Elsewhere it moves there, with P the clip to the bounds, at the rate gamma: the
primal-dual one by

.. math::
    \dot y = \gamma (I + H^T) \left( P(y - (H y + p)) - y \right), \qquad y = (x, \lambda),

and the dual one by

.. math::
    \dot u = \gamma \left( P(E x - u) - E x \right), \qquad x = W^{-1} (E^T u - c) .

=========  ===========  =====================================================
paper      here         meaning
=========  ===========  =====================================================
theta      position     joint positions q
x          optimum      joint velocities of the network (state)
lambda, u  multipliers  multipliers of the task, and of the dual ones (state)
gamma      gain         gain of the network [1/s]
k          return_gain  gain of the way back [1/s]
K          feedback     gain of the position feedback [1/s]
=========  ===========  =====================================================

Not in the papers:
    The papers integrate in continuous time, by stiff methods. Here a step is implicit, and found
    exactly, at any gain and period; or it is printed, and refused where it is unstable; or it is a
    counted number of iterations. What is commanded is held for a sample, see
    `drake_rnn.laws.program_law`. A damping keeps the multipliers of the task bounded where the
    bounds leave no velocity that does it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.fields import Array, Gain, Weight, validated
from ..inputs.keys import Meaning
from .law import (
    Circumstances,
    ContinuousReading,
    Layout,
    SampledReading,
    Signals,
)
from .parts.programs import Program
from .program_law import LearningProgramLaw
from .projection_network import (
    PRIMAL,
    Network,
    ProjectionNetwork,
    Steps,
    project,
)

# Gain where steps are implicit, and where they are explicit or Drake's [1/s].
_GAIN, _GAIN_EXPLICIT = 1e8, 100.0
_ITERATIONS = 20


@validated
class Projection(LearningProgramLaw):
    """A dual or primal-dual network around the program of a scheme."""

    kind: Literal["projection"] = "projection"
    follows_objectives = True
    summary = "Projection networks: dual, and primal-dual of a linear variational inequality."
    network: Annotated[
        Network,
        Meaning(
            "``lvi``, the LVI-based primal-dual one, ``dual``, or either ``simplified_lvi`` or "
            "``simplified_dual``.",
        ),
    ] = "lvi"
    gain: Annotated[
        Gain | None,
        Meaning(
            "Gain gamma of the network; by default 1e8 of ``implicit`` steps and 100 of others. "
            "``iterated`` has none.",
            unit="1/s",
        ),
    ] = None
    discretization: Annotated[
        Steps,
        Meaning("``implicit``, ``euler`` or, of ``lvi``, ``iterated``."),
    ] = "implicit"
    iterations: Annotated[
        Annotated[int, Field(strict=True, ge=1, le=1000)] | None,
        Meaning("Number of iterations per sample; only of ``iterated``, by default 20."),
    ] = None
    damping: Annotated[
        Weight,
        Meaning(
            "Damping of the optimum where J loses rank, or where bounds leave no velocity that "
            "does the task.",
            unit="m",
        ),
    ] = 1e-3

    takes_many = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.network == "simplified_dual" and self.bounds == "none":
            raise ValueError(
                "network: simplified_dual has a neuron for each bound; give bounds: velocity, or "
                "network: dual"
            )
        if self.cost != "velocity" and (
            self.discretization == "euler" or self.network not in ("lvi", "simplified_lvi")
        ):
            raise ValueError(
                f"cost: {self.cost} needs network: lvi or simplified_lvi and discretization: "
                "implicit or iterated; or give cost: velocity"
            )
        is_iterated = self.discretization == "iterated"
        if is_iterated and self.network != "lvi":
            raise ValueError(
                f"discretization: iterated is of network: lvi, not of {self.network}; give "
                "discretization: implicit"
            )
        if is_iterated and self.gain is not None:
            raise ValueError("gain: discretization: iterated has none; leave it out")
        if self.iterations is not None and not is_iterated:
            raise ValueError(
                "iterations: belongs to discretization: iterated, not to "
                f"{self.discretization}; leave it out"
            )

    @cached_property
    def dynamics(self) -> ProjectionNetwork:
        """The network that the law runs."""
        gain = _GAIN if self.discretization == "implicit" else _GAIN_EXPLICIT
        k, m, count = self.scheme.sizes(self.limits.size)
        return ProjectionNetwork(
            self.network,
            k,
            m,
            self.scheme.bounds is not None,
            count - (0 if self.scheme.bounds is None else 2 * k),
            gain if self.gain is None else self.gain,
            self.discretization,
            _ITERATIONS if self.iterations is None else self.iterations,
            self.damping**2,
        )

    def sampled(self, period: float) -> SampledReading:
        """Return a `LearningReading`.

        Raises:
            InvalidInputError: If ``euler`` is unstable at this period, whatever the Jacobian is.
        """
        if self.discretization == "euler":
            self._require_stable(np.zeros((self.task_size, self.limits.size)), period)
        return self._reading(period)

    def continuous(self) -> ContinuousReading:
        """Return a `ContinuousProjection`.

        Raises:
            InvalidInputError: If the network's velocities are no state of it, or it is stepped.
        """
        if self.network not in PRIMAL:
            raise InvalidInputError(
                f"integrator: the velocities of network: {self.network} follow from its signals at "
                "once, which would close a loop without a state; give a period, or network: lvi"
            )
        if self.cost != "velocity":
            raise InvalidInputError(
                f"integrator: Drake integrates the joint velocities alone; with cost: {self.cost} "
                "give a period instead"
            )
        if self.discretization != "implicit" or self.learns_jacobian:
            learned_text, exact = "jacobian: learned", f"discretization: {self.discretization}"
            text = learned_text if self.learns_jacobian else exact
            raise InvalidInputError(f"integrator: {text} is of samples; give a period instead")
        return ContinuousProjection(self)

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """See `Law.doubts`.

        Raises:
            InvalidInputError: If ``euler`` is unstable at this period in the posture of the start.
        """
        J, task_J, period = circumstances.J, circumstances.task_J, circumstances.period
        if self.discretization == "euler" and period is not None:
            if self.task_size == 6:
                J = None if task_J is None else task_J(self.home)
            if J is not None:
                self._require_stable(J, period)
        return self._learning_doubts("a noise")

    def _require_stable(self, J: Array, period: float) -> None:
        n, m = self.limits.size, self.task_size
        box = None if self.scheme.bounds is None else (-np.ones(n), np.ones(n))
        program = Program(np.eye(n), np.zeros(n), J, np.zeros(m), box)
        most = project(self.network, program, self.damping**2).stable_below() / period
        if self.dynamics.gain >= most:
            raise InvalidInputError(
                f"law.gain: must be below {most:.4g} /s at a period of {period:g} s with "
                f"discretization: euler, network: {self.network} and the Jacobian at the start, "
                f"not {self.dynamics.gain:g}; or give discretization: implicit"
            )


@dataclass(frozen=True, eq=False)
class ContinuousProjection(ContinuousReading):
    """A `Projection` law that Drake integrates, of a network that begins with x.

    Attributes:
        law: The law.
    """

    law: Projection

    takes_many = True

    @cached_property
    def state(self) -> Layout:
        shapes = self.law.dynamics.shapes
        return Layout(v=shapes["optimum"], multipliers=shapes["multipliers"])

    @property
    def inputs(self) -> Layout:
        return self.law.inputs

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        v, multipliers = self.state.split(x)
        parts = {"optimum": v, "multipliers": multipliers}
        return self.law.dynamics.rate(parts, self.law.scheme.program(u))
