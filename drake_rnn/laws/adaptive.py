r"""Every bound to the jerk, by construction, with a Jacobian that is known or learned.

At each sample the law chooses the joint velocity v to hold for the next period h,

.. math::
    \min_v \tfrac12 |v - g|^2 + \frac{1}{2 \mu} |W^{1/2} (J v - b)|^2 \quad \text{s.t.} \quad
    \underline v \le v \le \overline v,

    b = \frac{p_d(t + h) - p_d(t)}{h} + s(p_d - p), \qquad
    s(e) = \min(\kappa |e|, \sqrt{2 a |e|}, s_{max}) \frac{e}{|e|}.

The feed-forward is the secant to the next sample, and the feedback is one that can be braked. With
the orientation held, the rotation vector from R_d(t) to R_d(t + h) and that from R to R_d do the
same for the rows of the rotation, which W weighs by the square of a lever. With a force that it
keeps on a surface, b along the normal is what the force asks for
(`drake_rnn.laws.parts.path_task`); the box is the same.

============  ======================  =================================================
symbol        here                    meaning
============  ======================  =================================================
h             period                  time for which a velocity is held [s]
kappa         kappa                   gain of the feedback [1/s]
a             braking                 deceleration at the end of the way [m/s^2]
s_max         feedback_limit          largest speed of the feedback [m/s]
mu            softness                price of the task's error against v - g [m^2]
W             lever                   1 for positions, lever^2 for rotations
g             secondary               velocities preferred among those that do the task
J             J or J_hat              Jacobian, at the middle of the sample if it is known
C, R, q_n     covariance, variance,   of the learned rows; see `laws.parts.learned_jacobian`
              wander
============  ======================  =================================================

**Why the box is never empty.** It holds the velocities from which a joint can still stop within its
position limits, if it brakes as hard as acceleration, and jerk if that is bounded, allow. The first
step of the stop that was possible a sample ago is one of them, for what is left of a stop after its
first step is a stop again. At rest within the limits, standing still is one. So by induction the
box has a point at every sample, whatever J, the target or a measurement are, up to rounding; tests
find 1e-13 of a bound. With an envelope of the velocity the same holds of a stop that keeps it, see
`drake_rnn.robot.velocity_envelope`. The joints' own commands are integrated for this, from the
first position that is measured: what is measured later does not enter the box, but an error of that
first one stays in it.

**What is not guaranteed.** That the path is tracked. The program is soft, so where box and path
disagree the bounds win. A local law does not plan: an arm may run into a position limit or a
singular posture that another posture would avoid; near a singular one the task is softer, so that
it comes to rest there. A learned Jacobian is right along the directions
that the arm has moved in, and need not be elsewhere. With motors the commands keep the bounds, the
arm itself does not.

The idea of pricing the task in a program with bounds on velocities is common to inverse kinematics
by quadratic programming (Kanoun, Lamiraux, Wieber, "Kinematic control of redundant manipulators:
generalizing the task-priority framework to inequality task", IEEE Transactions on Robotics 27,
2011); bounds that anticipate braking are those of Del Prete, "Joint position and velocity bounds in
discrete-time acceleration/torque control of robot manipulators", IEEE Robotics and Automation
Letters 3 (2018), here for velocities that are held, and with the jerk. Ranges of the acceleration,
for bounds of position, velocity, acceleration and jerk, in which there always is a safe one, are
those of Kiemel and Kroeger, "Learning robot trajectories subject to kinematic joint constraints",
ICRA 2021 (arXiv 2011.00563; the package ``klimits``), for accelerations that are ramped over a
sample. The box here is the same idea for velocities that are held, in the program, not behind it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..arrays.algebra import join
from ..errors import InvalidInputError
from ..inputs.fields import Array, Gain, Length, Speed, Vector, Weight, validated
from ..inputs.keys import LISTED, Meaning, Only
from ..robot.clearance import Clearance
from ..robot.clearance.clearance import Neighbour
from ..robot.limits import JointLimits, require_resting
from ..robot.task_objectives import RowBlock
from .law import (
    Circumstances,
    Component,
    Law,
    Layout,
    SampledReading,
    Signals,
    State,
)
from .parts.bounded_velocity import Program, limits_within_bounds, reached_limits
from .parts.jacobian import (
    EXACT,
    LEVER,
    REACH,
    JacobianKeys,
    Late,
    LearnedJacobian,
    MiddleJacobian,
    feedback_gain,
    samples_late,
)
from .parts.path_task import (
    FIRMER,
    PIXELS,
    PathTask,
    RowRanges,
    gain_within_jerk,
    in_metres,
)
from .parts.progress import Look, ShareOfSpeed
from .parts.reach_edge import (
    AT_REST,
    EDGE,
    OF_PIXELS,
    Change,
    ReachEdge,
    RestPosture,
    row_softness,
    soften,
)
from .parts.safe_velocity import (
    Avoidance,
    Within,
    is_led,
    lead,
    require_free,
    within_safe,
)
from .parts.secondary import Moment, Preference, Secondary
from .parts.surface_task import ForceControl, SurfaceTask
from .parts.world import seen_signals

_ROUNDING = 1e-9
_LOSS_KEY = "law.force_control.contact_loss"
# Share of the gain that suits a bounded jerk which a law has that presses. With all of it, a tool
# swings on its surface, by 0.5 N of 5 in `adaptive_contact_circle` with 20 rad/s^3.
_PRESSING = 0.5
# Share of the newest value in the reference of the acceleration, if J is learned.
_SMOOTHING = 0.05


@validated
class Adaptive(JacobianKeys):
    """A sampled law within all bounds up to the acceleration, or to the jerk if it is limited."""

    kind: Literal["adaptive"] = "adaptive"
    follows_objectives = True
    keeps_each_direction = True
    keeps_ranges = True
    makes_detours = True
    summary = "Every bound to the jerk, by construction, with a Jacobian that is known or learned."
    limits: Annotated[
        JointLimits,
        Meaning(
            "Limits of the joints. Where no limit of the acceleration is known, it is unbounded. "
            "The jerk is bounded if its limits are given and can be reached within a period. An "
            "envelope of the velocity is kept with and without them.",
        ),
    ]
    home: Annotated[Vector, Meaning("Posture at the start, shape (n,).", unit="rad")]
    task_size: Annotated[
        Literal[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
        Meaning(
            "Number of rows of J; of 6 rows the first three are rotation, but of pixels and of "
            "objectives."
        ),
    ] = 3
    objectives: Annotated[
        tuple[RowBlock, ...] | None,
        Meaning("What is known of the rows of objectives; None for a position or a pose."),
    ] = None
    kappa: Annotated[
        Gain | None,
        Meaning(
            "Gain of the feedback, at most one over the period; 100 by default, or that one, and "
            "less where measurements have errors or the jerk is bounded low.",
            unit="1/s",
        ),
    ] = None
    braking: Annotated[Gain, Meaning("Deceleration of the feedback.", unit="m/s^2")] = 0.05
    feedback_limit: Annotated[Speed, Meaning("Largest speed of the feedback.", unit="m/s")] = 0.1
    turn_braking: Annotated[
        Gain,
        Meaning(
            "Deceleration of the feedback of the orientation.",
            unit="rad/s^2",
            only=(Only("task", "pose", LISTED),),
        ),
    ] = 0.25
    turn_limit: Annotated[
        Gain,
        Meaning(
            "Largest speed of that feedback.", unit="rad/s", only=(Only("task", "pose", LISTED),)
        ),
    ] = 0.5
    lever: Annotated[
        Length,
        Meaning(
            "Length that makes an error of the orientation count like one of the position.",
            unit="m",
            only=(Only("task", "pose", LISTED),),
        ),
    ] = LEVER
    softness: Annotated[
        Weight | None,
        Meaning(
            "Price mu of the task's error; 1e-6 by default, more where measurements have errors.",
        ),
    ] = None
    secondary: Annotated[
        Secondary,
        Meaning("What the joints do besides."),
    ] = Field(default_factory=Secondary)
    force_control: Annotated[
        ForceControl | None,
        Meaning("How it keeps a force along the normal of a surface; None to press on nothing."),
    ] = None
    clearance: Annotated[
        Clearance | None,
        Meaning("What the arm is to stay clear of; None for nothing."),
    ] = None
    avoidance: Annotated[
        Avoidance | Literal["none"],
        Meaning("How near it may come; ``none`` not to avoid anything.", only=(Only("obstacles"),)),
    ] = Field(default_factory=Avoidance)
    detours: Annotated[
        bool,
        Meaning("Whether it may be led round what it is stuck before, by the input ``detour``."),
    ] = False
    sees_axes: Annotated[
        bool,
        Meaning(
            "Whether it sees the joints' axes with a position that it follows with a known J, by "
            "the input ``J_omega``. They tell where an arm rests whose target is out of reach."
        ),
    ] = False
    other: Annotated[
        Neighbour | None,
        Meaning("Another arm beside it, which ``clearance`` counts; None without one."),
    ] = None
    points: Annotated[
        Literal[1, 2, 3] | None,
        Meaning(
            "Number of points of the tool whose pixels it sees in place of ``p_WE``; None where "
            "it sees ``p_WE``.",
        ),
    ] = None
    pixel_size: Annotated[
        Length,
        Meaning(
            "What a pixel is taken to be at the tool [m]: the way between two points that a "
            "camera sees a pixel apart. It makes pixels lengths, for which all gains are.",
            unit="m",
        ),
    ] = 1e-3

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        require_resting(self.limits, self.home, "home")
        # What stands where beside another arm, only those who place both know.
        if self.avoids is not None and self.other is None:
            require_free(self.avoids[0], self.avoids[1].floor, self.home)
        n, target = self.limits.size, self.secondary.target
        if target is not None and target.size != n:
            raise ValueError(
                f"secondary: target must have {n} entries, one per joint, not {target.size}"
            )
        self._check_points()
        self._check_objectives()
        if self.force_control is not None and self.task_size == 2:
            raise ValueError("force_control: needs task: xyz or pose; leave it out")
        if self.secondary.seeks_manipulability and (
            self.jacobian == "learned" or self.task_size == 2
        ):
            raise ValueError(
                "secondary: manipulability needs jacobian: known and task: xyz or pose; leave it "
                "out"
            )

    def _check_points(self) -> None:
        if self.points is None:
            if self.objectives is None and self.task_size not in (2, 3, 6):
                if self.task_size == 4:
                    raise ValueError(
                        "task_size: 4 is that of two points; give points, or objectives"
                    )
                raise ValueError(
                    f"task_size: may be 2, 3 or 6 without objectives, not {self.task_size}"
                )
            return
        if self.task_size != 2 * self.points:
            raise ValueError(
                f"task_size: must be {2 * self.points}, two for each point, not {self.task_size}"
            )
        if self.jacobian == "known":
            raise ValueError("jacobian: must be learned with pixels; no J of them is known")
        if self.J_hat_initial == "exact":
            raise InvalidInputError(
                "law.J_hat_initial: may be uniform or zero with pixels, not exact"
            )
        if self.force_control is not None:
            raise ValueError("force_control: must be left out with pixels")

    def _check_objectives(self) -> None:
        if self.objectives is None:
            return
        size = sum(block.size for block in self.objectives)
        if self.task_size != size:
            raise ValueError(
                f"task_size: must be {size}, the rows of objectives, not {self.task_size}"
            )
        for name, value in (("points", self.points), ("force_control", self.force_control)):
            if value is not None:
                raise ValueError(f"{name}: must be left out with objectives")
        if self.secondary.seeks_manipulability:
            raise ValueError("secondary: manipulability must be left out with objectives")

    @cached_property
    def valued(self) -> tuple[RowBlock, ...]:
        """What is known of the objectives that have values."""
        return tuple(block for block in self.objectives or () if not block.is_range)

    @cached_property
    def scales(self) -> Array | None:
        """Lengths that make the rows of values count alike; None but of objectives."""
        if self.objectives is None:
            return None
        scales = [
            # A lever of each robot's own gives all its leading axis.
            block.weight**0.5 * (self.lever if block.turns else 0.0 * self.lever + 1.0)
            for block in self.valued
            for _ in range(block.size)
        ]
        if isinstance(self.lever, float):
            return np.array(scales)
        return join(scales)

    @property
    def avoids(self) -> tuple[Clearance, Avoidance] | None:
        """What it stays clear of, and how near it may come; None if it avoids nothing."""
        if self.clearance is None or isinstance(self.avoidance, str):
            return None
        return self.clearance, self.avoidance

    @property
    def takes_many(self) -> bool:  # type: ignore[override]
        """See `Reading`."""
        return self.secondary.takes_many

    @property
    def sees_pixels(self) -> bool:
        """See `Law.sees_pixels`."""
        return self.points is not None

    @property
    def presses(self) -> bool:
        """See `Law.presses`."""
        return self.force_control is not None

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; all limits that are known, up to the jerk."""
        return limits_within_bounds(self.limits)

    @property
    def keeps_distance(self) -> float | None:
        """See `Law.keeps_distance`."""
        return None if self.avoids is None else self.avoids[1].floor

    @property
    def neighbour(self) -> Neighbour | None:
        """See `Law.neighbour`."""
        return self.other

    def beside(self, clearance: Clearance, neighbour: Neighbour) -> Law | None:
        """See `Law.beside`."""
        return self.avoids and replace(self, clearance=clearance, other=neighbour)

    @property
    def limits_remedy(self) -> str:
        return "a filter behind it, which keeps snap and crackle as well"

    @property
    def loop_gains(self) -> Mapping[str, float]:
        # Measurements that are known to be late are made up for.
        return {} if self.measurement.delay else {"kappa": self._gain}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        """None; `sampled` checks kappa itself, which may take back all of an error in a sample."""
        return {}

    @property
    def _gain(self) -> float:
        """Gain of the feedback, the one given or the one that suits the measurement [1/s]."""
        if self.kappa is not None:
            return self.kappa
        gain = feedback_gain(self.measurement, self.learns_jacobian)
        if self.limits.jerk is None:
            return gain
        jerk = float(np.min(self.limits.jerk))
        gain = min(gain, gain_within_jerk(REACH * jerk, self.braking))
        if self.turns or any(block.turns for block in self.objectives or ()):
            gain = min(gain, gain_within_jerk(jerk, self.turn_braking))
        return gain if self.surface is None else _PRESSING * gain

    def sampled(self, period: float) -> AdaptiveReading:
        """Return an `AdaptiveReading`, with the numbers that suit measurement and period.

        Raises:
            InvalidInputError: If ``kappa`` would overshoot at this period, or the delay of the
                measurements is no multiple of it.
        """
        suits = self._learning_for(period)
        if self.points is not None:
            suits = suits._replace(softness=max(EXACT.softness, FIRMER * suits.softness))
        # One that is not given takes back at most the whole error.
        kappa = min(self._gain, 1.0 / period) if self.kappa is None else self.kappa
        if kappa * period > 1.0 + _ROUNDING:
            raise InvalidInputError(
                f"law.kappa: may be at most {1.0 / period:.6g} /s at a period of {period:g} s, "
                f"where it corrects the whole error in one sample, not {kappa:g}"
            )
        law = replace(
            self,
            kappa=kappa,
            softness=suits.softness if self.softness is None else self.softness,
            variance=suits.variance,
            wander=suits.wander,
            limits=reached_limits(self.limits, period),
        )
        late = samples_late(self.measurement.delay, period)
        return AdaptiveReading(law, suits.samples, suits.still, late, (late + 1) * period)

    @cached_property
    def state(self) -> Layout:
        m, n = self.task_size, self.limits.size
        return Layout(v=(n,), **({"J_hat": (m, n)} if self.learns_jacobian else {}))

    @cached_property
    def inputs(self) -> Layout:
        m, n = self.task_size, self.limits.size
        if self.points is not None:
            pixels = {"position": (n,), **self._around, **dict.fromkeys(PIXELS, (m,))}
            return Layout(**self.preference.inputs(pixels))
        shapes: dict[str, tuple[int, ...]] = {"p": (m if self.objectives else min(m, 3),)}
        if self.turns:
            shapes["R"] = (3, 3)
        names = ("WE", "WE_desired", "preview")
        parts = {f"{letter}_{name}": shape for letter, shape in shapes.items() for name in names}
        jacobian: dict[str, tuple[int, ...]] = {"J": (m, n)} if self.jacobian == "known" else {}
        if self.rests_by_axes:
            jacobian["J_omega"] = (3, n)
        contact = {} if self.surface is None else self.surface.inputs
        leads: dict[str, tuple[int, ...]] = (
            dict.fromkeys(("detour", "posture"), (n,)) if self.detours else {}
        )
        own = {"position": (n,), **jacobian, **self._around, **parts, **contact, **leads}
        return Layout(**self.preference.inputs(own))

    @property
    def _around(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the signals by which it sees what moves in its way, by name."""
        return seen_signals(None if self.avoids is None else self.avoids[0], self.other)

    @cached_property
    def preference(self) -> Preference:
        """What the joints prefer besides their task."""
        return self.secondary.preference(self.limits, self.home)

    @cached_property
    def surface(self) -> SurfaceTask | None:
        """What it does on the surface that it presses on; None if it presses on nothing."""
        return None if self.force_control is None else self.force_control.task

    @property
    def turns(self) -> bool:
        """Whether the task is a pose."""
        return self.task_size == 6 and self.points is None and self.objectives is None

    @property
    def rests_by_axes(self) -> bool:
        """Whether the axes of the joints tell where it rests, in place of a J of a pose."""
        is_position = self.task_size == 3 and self.objectives is None and self.points is None
        is_known = self.jacobian == "known" and self.surface is None
        return self.sees_axes and is_position and is_known

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """See `Law.doubts`; of the first J_hat, and of the posture that joints are pulled to.

        Raises:
            InvalidInputError: If the pressing force would count as no contact.
        """
        sentences = self._learning_doubts("law.secondary or a noise")
        sentences += self.preference.doubts(circumstances)
        if self.surface is not None:
            self.surface.check(_LOSS_KEY, circumstances.pressing_force)
        return sentences


@dataclass(frozen=True, eq=False)
class AdaptiveReading(SampledReading):
    """The law at a period.

    The state holds v; ``commanded``, the joint positions that it has commanded; if the jerk is
    bounded the acceleration ``a``, and that of the path with the velocities it comes from; what
    its Jacobian comes from; and with a known one where it is to rest. Each but the first two
    belongs to a `Component`.

    Attributes:
        law: The law, with all of its numbers.
        samples: Number of samples over which velocities are difference quotients.
        still: Joint speed below which nothing is learned [rad/s].
        late: Number of samples by which measurements are late.
        seen_after: Time after which the effect of a command is seen [s].
    """

    law: Adaptive
    samples: int
    still: float
    late: int
    seen_after: float

    inputs_with_gaps = ("p_WO", "detour")

    @property
    def takes_many(self) -> bool:  # type: ignore[override]
        """See `Adaptive.takes_many`."""
        return self.law.takes_many

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        own = {"v": (n,), "commanded": (n,)}
        return Layout(
            **own, **{name: s for part in self._components for name, s in part.shapes.items()}
        )

    @property
    def _components(self) -> tuple[Component[..., Any], ...]:
        """Its parts with memory, in the order of their parts of the state."""
        return self._within, self._source, self._late, self._task, self._rest, self._progress

    @property
    def inputs(self) -> Layout:
        return self.law.inputs

    @cached_property
    def observables(self) -> Layout:
        surface = self.law.surface
        return Layout(**({} if surface is None else surface.observables))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        surface = self.law.surface
        return {} if surface is None else surface.diagnostics(self.state.by_name(x))

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        surface = self.law.surface
        return [] if surface is None else surface.caveats(_LOSS_KEY, metrics)

    @cached_property
    def _source(self) -> MiddleJacobian | LearnedJacobian:
        law = self.law
        m, n = law.task_size, law.limits.size
        if law.jacobian == "known":
            return MiddleJacobian(m, n, self.late)
        leaps = law.points is not None
        return law.learned_jacobian((m, n), self.samples, self.still, law.turns, leaps)

    @cached_property
    def _within(self) -> Within:
        smoothing = 1.0 if self.law.jacobian == "known" else _SMOOTHING
        law, repulsion = self.law, self.law.secondary.repulsion
        return within_safe(law.limits, smoothing, law.avoids, law.other, repulsion)

    @cached_property
    def _task(self) -> PathTask:
        law = self.law
        feedback = (law.braking, law.feedback_limit, law.turn_braking, law.turn_limit)
        rows = None if law.objectives is None else law.valued
        return PathTask(law.kappa, *feedback, law.turns, law.surface, rows)

    @cached_property
    def _ranges(self) -> RowRanges | None:
        law, objectives = self.law, self.law.objectives or ()
        if not any(block.is_range for block in objectives):
            return None
        has_jerk = law.limits.jerk is not None
        return RowRanges(objectives, self._task, law.softness, law.lever, has_jerk)

    @cached_property
    def _edge(self) -> ReachEdge:
        law = self.law
        scales = np.ones(law.task_size) if law.scales is None else law.scales
        if law.turns:
            # A lever of each robot's own gives all its leading axis.
            turning = np.ones(3) * law.lever
            scales = join((turning, 0.0 * turning + 1.0))
        # While J is learned, singular values are small that are not: without a bound of the jerk
        # it is early enough to brake where the task is softer.
        begin = EDGE * law.lever if law.turns else EDGE
        is_early = law.jacobian == "known" or law.limits.jerk is not None
        return ReachEdge(law.limits, scales, self.seen_after, begin=inf if is_early else begin)

    @property
    def _knows_edge(self) -> bool:
        """Whether a small singular value tells of the edge of reach.

        Directions that are not learned yet, or of which a camera sees little, look like it.
        """
        law = self.law
        if law.jacobian == "known":
            return True
        return law.points is None and law.J_hat_initial != "zero"

    @cached_property
    def _rest(self) -> RestPosture:
        law = self.law
        is_pose = law.turns and law.jacobian == "known" and law.surface is None
        size = law.limits.size if is_pose or law.rests_by_axes else 0
        # What is measured with errors or late moves this posture to and fro.
        return RestPosture(self._edge, size, law.turns, self._is_exact)

    @cached_property
    def _progress(self) -> ShareOfSpeed:
        """What lets an arm rest that learns where the edge of reach is."""
        law = self.law
        is_plain = law.points is None and law.surface is None and law.objectives is None
        return ShareOfSpeed(law.limits, is_plain and law.learns_jacobian, self._is_exact)

    @property
    def _is_exact(self) -> Any:
        """1 where measurements are exact and in time, else 0, a number or shape (..., 1)."""
        measurement = self.law.measurement
        return 1.0 * (measurement.error == 0.0 and measurement.delay == 0.0)

    @property
    def _share(self) -> float:
        """Share of the edge of singular postures, see `drake_rnn.laws.parts.reach_edge`."""
        return 1.0 if self.law.points is None else OF_PIXELS

    @cached_property
    def _late(self) -> Late:
        return Late(self.late, self.law.limits.size)

    @cached_property
    def _softness(self) -> Array:
        """Softness of the rows, shape (..., m, m)."""
        law, softness = self.law, self.law.softness
        if law.scales is not None and softness is not None:
            rows = softness * law.scales**-2
            return rows[..., None] * np.eye(rows.shape[-1])
        return row_softness(softness, law.lever, law.task_size, law.turns)

    def _view(self, u: Signals) -> Signals:
        """Return the signals, in which pixels, if it sees any, are positions [m]."""
        return u if self.law.points is None else in_metres(u, self.law.pixel_size)

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        u = self._view(u)
        start = {"v": np.zeros(self.law.limits.size), "commanded": u["position"]}
        for part in self._components:
            start |= part.init(u, rng)
        return self.state.from_parts(start)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        law = self.law
        state, u = self.state.by_name(x), self._view(u)
        v, q = state["v"], state["commanded"]
        J, learned = self._source.step(state, u, period)
        since, late = self._late.step(state, u, period, J)
        parts, ranges = state, self._ranges
        if ranges is not None:
            # The rest is about the rows of values alone; those of ranges join at the end.
            every = J, u["p_WE"], since
            J, u, parts, since = ranges.leave_out(J, u, state, since)
        (along, error), task_state = self._task.step(state, u, period, since)
        g = self.law.preference.velocity(Moment(t, q, v, J, u, period))
        g = self._edge.slow(g)
        rest = None
        if ranges is None and self._rest.leads_one(parts, v):
            # While it is led, what its task wants does not count, and costs as much as the rest.
            back, softness = 0.0 * along, self._softness
            rest, rest_state = self._rest.step(parts, u, period, along, True)
        if rest is None or not is_led(rest).all():
            back, g, softness, near = self._within_reach(J, error, g, parts, u, period)
            rest, rest_state = self._rest.step(parts, u, period, along, near)
        if self._progress.acts:
            share, progress = self._share_of_speed(state, u, period, J, (along, error, back))
            back, g, rest_state = share * back, share * g, rest_state | progress
        along, back = self._task.pressing({**state, **task_state}, u, along, back)
        program = Program(J, along + back, along, g, softness)
        if ranges is not None:
            program = ranges.beside(
                program, *every, lambda each: self._within.choice(state, period, each).box
            )
        if rest is not None:
            program = lead(rest, program)
        if law.detours:
            program = lead(u["detour"], program)
        v, within = self._within.step(state, u, period, program)
        own = {"v": v, "commanded": q + period * v} | rest_state
        return self.state.from_parts({**own, **within, **learned, **late, **task_state})

    def _share_of_speed(
        self, state: State, u: Signals, period: float, J: Array, seen: tuple[Array, ...]
    ) -> tuple[Any, State]:
        """Return the share of its speed that the task may want; see `ShareOfSpeed.step`.

        Args:
            state: Parts of the state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            J: Jacobian of the task, shape (..., m, n).
            seen: Task velocity of the path, error and what `_within_reach` makes of its feedback,
                shape (..., m) each.
        """
        along, error, back = seen

        def look() -> Look:
            scales, source = self._edge.scales, self._source
            assert isinstance(source, LearnedJacobian)
            wanted, V_tool = self._task.back(error), source.task_velocity(state, u, period)
            return Look(scales * wanted, scales * back, scales * V_tool, scales[..., None] * J)

        rests = abs(along).max(axis=-1, keepdims=True) <= AT_REST
        return self._progress.step(state, u, period, rests, look)

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        motion = {"commanded": q, "v": v, "a": a}
        state = self.state.by_name(x)
        parts = self._within.resumed(state, motion, elapsed) | self._rest.resumed(state)
        parts |= self._progress.resumed(state)
        return self.state.with_parts(x, **{"commanded": q, "v": v, **parts})

    def _within_reach(
        self,
        J: Array,
        error: Array,
        g: Array,
        parts: Signals,
        u: Signals,
        period: float,
    ) -> tuple[Array, Array, Array, Any]:
        """Return the feedback, the preferred velocities and the softness, see `ReachEdge`.

        The last one is whether an arm is near the edge, a truth value or shape (..., 1).

        Args:
            J: Jacobian of the task, shape (..., m, n).
            error: Error of the task, shape (..., m).
            g: Preferred joint velocities, shape (..., n) [rad/s].
            parts: Parts of the state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
        """
        task, edge = self._task, self._edge
        whole = task.back(error)
        softness = soften(J, task.weigh(self._softness, u), self._share, self.law.scales)
        if not self._knows_edge:
            return whole, g, softness, False
        softness = edge.softness(softness, whole, parts["v"])
        at = edge.at(
            edge.free(J, error, parts["commanded"]),
            *(error, whole, lambda: self._change(J, parts, u, period)),
        )
        if at is None:
            return whole, g, softness, False
        back, share = edge.feedback(
            at, whole, error, task.back, lambda v: task.sliding(v, u), softness
        )
        g = edge.brake_preferred(g, self.law.secondary.posture, share)
        return back, g, softness, at.near

    def _change(self, J: Array, parts: Signals, u: Signals, period: float) -> Change | None:
        """Return the last change of the Jacobian; None if measurements are too rough to tell."""
        if self.law.jacobian == "known":
            return Change(J - u["J"], (self.late + 0.5) * period * parts["v"])
        if self.still > 0.0:
            return None
        return Change(J - parts["J_hat"], period * parts["v"], learned=True)
