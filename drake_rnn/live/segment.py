"""A simulation of one variant, which goes on from where another one ended.

- What one simulation hands on to the next, as another law or another arm takes over.
- What a page shows of a running experiment: numbers of each moment, and peaks since the last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from ..diagrams import Loop
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..laws import Law, Layout
from ..laws.parts.obstacle_tracks import TRACKS
from ..laws.parts.safe_velocity import NO_STOP
from ..measures import Recorder, Steps
from ..robot.rotation import rotation_error
from ..runs.simulation import recorded_simulator, start_laws
from ..systems import SampledController
from ..systems.block import release

# Prefix of the parts that belong to what keeps a law safe, see `drake_rnn.laws.safety`.
_SAFE = "safe_"
# Parts of the state by which a stop is certified, see `drake_rnn.laws.parts.bounded_velocity` and
# `drake_rnn.laws.parts.safe_velocity`.
_MOTION = ("commanded", "a", "a_path", "v_path", "seen", "gaps", "held_back", "uncertified")


@dataclass(frozen=True)
class CarryOver:
    """The motion of an arm and the state of its law at the end of a simulation.

    Attributes:
        position_commanded: Shape (n,) [rad].
        position, velocity: Those of the arm, shape (n,) each [rad, rad/s].
        kind: Class of the law.
        parts: Parts of the law's state, by name.
        shapes: Their layout, the shapes by name.
    """

    position_commanded: Array
    position: Array
    velocity: Array
    kind: type
    parts: dict[str, Array]
    shapes: dict[str, tuple[int, ...]]

    def into(self, layout: Layout, x: Array, kind: type, *, anew: bool = False) -> Array:
        """Return the first state of a law that takes over.

        It goes on with the velocity, with the positions commanded until now and with what its stop
        was certified by, whether they are a law's own or those of what keeps it safe. A law of the
        same class and state goes on with everything; one that learned its Jacobian otherwise, with
        that.

        Args:
            layout: Layout of its state.
            x: The state that it would begin with, shape (layout.size,).
            kind: Its class.
            anew: Whether it begins anew in all but the motion.
        """
        parts = {**({} if anew else self._of_law(layout, kind)), **self._motion(layout)}
        fitting = {
            name: parts[name]
            for name, (_, shape) in layout.parts.items()
            if name in parts and parts[name].shape == shape
        }
        return layout.with_parts(x, **fitting)

    def _motion(self, layout: Layout) -> dict[str, Array]:
        """Return what belongs to the motion, as a layout names it: a law's own, or its guard's."""
        key = f"{_SAFE}commanded"
        mine = _SAFE if key in self.parts else "" if "commanded" in self.parts else None
        parts = {} if mine is None else {n: self.parts.get(mine + n) for n in (*_MOTION, *TRACKS)}
        motion = {name: value for name, value in parts.items() if value is not None}
        motion.setdefault("commanded", self.position_commanded)
        # What was certified may have been with other bounds, or not at all.
        motion["stop_delay"] = np.full(1, NO_STOP)
        v = self.parts["v"]
        if key in layout:
            return {"v": v, f"{_SAFE}wanted": v, **{_SAFE + n: each for n, each in motion.items()}}
        return {"v": v, **(motion if "commanded" in layout else {})}

    def _of_law(self, layout: Layout, kind: type) -> dict[str, Array]:
        if kind is not self.kind:
            return {}
        shapes = {name: shape for name, (_, shape) in layout.parts.items()}
        if shapes == self.shapes:
            return self.parts
        return {name: self.parts[name] for name in ("J_hat",) if name in self.parts}


@dataclass(frozen=True, eq=False)
class Segment:
    """A simulation that has begun, in a time of its own.

    Attributes:
        experiment: What is simulated.
        begin: Time of the session at which it began [s].
        simulator: The simulator.
        loop: Systems of the loop.
        controller: The controller among them.
        recorder: Recorder of every step.
    """

    experiment: Experiment
    begin: float
    simulator: Simulator
    loop: Loop
    controller: SampledController
    recorder: Recorder

    @property
    def root(self) -> Any:
        """Context of the diagram."""
        return self.simulator.get_mutable_context()

    @property
    def x(self) -> Array:
        """State of the law, shape (size,)."""
        return self.controller.state(self.controller.GetMyContextFromRoot(self.root))

    def release(self) -> None:
        """Let the simulation be freed, see `drake_rnn.systems.block`; it cannot go on."""
        release(self.simulator.get_system())

    def carry_over(self, law: Law) -> CarryOver:
        """Return what is handed on by a law, which may have other gains than at the beginning."""
        loop, root = self.loop, self.root
        body, layout = loop.arm.GetMyContextFromRoot(root), self.controller.reading.state
        integrator = loop.joint_command.GetMyContextFromRoot(root)
        x = self.x
        return CarryOver(
            position_commanded=loop.joint_command.get_output_port().Eval(integrator).copy(),
            position=loop.arm.GetOutputPort("position").Eval(body).copy(),
            velocity=loop.arm.GetOutputPort("velocity").Eval(body).copy(),
            kind=type(law),
            parts={name: part.copy() for name, part in layout.by_name(x).items()},
            shapes={name: shape for name, (_, shape) in layout.parts.items()},
        )

    def set_law(self, law: Law) -> None:
        """Go on with other gains from the next sample on.

        Raises:
            InvalidInputError: If the law cannot take the place of the one that runs.
        """
        context = self.controller.GetMyMutableContextFromRoot(self.root)
        self.controller.set_reading(context, self.controller.read(law))

    def begin_anew(self, law: Law) -> None:
        """Let the law forget all but the motion: what it has learned, and its multipliers."""
        controller, carry = self.controller, self.carry_over(law)
        context = controller.GetMyMutableContextFromRoot(self.root)
        kinematics = self.loop.kinematics
        J = kinematics.GetOutputPort("J").Eval(kinematics.GetMyContextFromRoot(self.root))
        x = controller.initial_state(context, J=J.reshape(-1, kinematics.arm.n))
        layout = controller.reading.state
        controller.set_state(context, carry.into(layout, x, type(law), anew=True))


def begin_segment(experiment: Experiment, begin: float, carry: CarryOver | None = None) -> Segment:
    """Return a simulation that has begun.

    Args:
        experiment: What is simulated, from its start; its time 0 is ``begin``.
        begin: Time of the session [s].
        carry: What it goes on from; None to start at rest.

    Raises:
        InvalidInputError: If the law cannot begin there, as where an obstacle is too near.
    """
    document = experiment.document
    if document.period is None:
        raise InvalidInputError("period: must be given")
    controller = SampledController(
        experiment.law, document.period, document.seed, experiment.safety, tunable=True
    )
    simulator, loops, recorder = recorded_simulator(experiment, controller=controller)
    root, (loop,) = simulator.get_mutable_context(), loops
    segment = Segment(experiment, begin, simulator, loop, controller, recorder)
    try:
        start_laws(loops, root)
        if carry is not None:
            context = controller.GetMyMutableContextFromRoot(root)
            layout, kind = controller.reading.state, type(experiment.law)
            controller.set_state(context, carry.into(layout, controller.state(context), kind))
            arm_context = loop.arm.GetMyMutableContextFromRoot(root)
            loop.arm.set_motion(arm_context, carry.position, carry.velocity)
        recorder.watch(simulator)
        simulator.Initialize()
    except BaseException:
        segment.release()
        raise
    return segment


#: Derivatives of the commanded positions of which shares of the bounds are shown.
DERIVATIVES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class Readout:
    """A number that is shown over time, as the page draws it.

    Attributes:
        key: Name in the page.
        name: Name that the page shows.
        unit: SI unit; "1" for a ratio.
        log: Whether a logarithmic axis suits it.
        bound: Upper bound, or lower bound if ``above``; None without one.
        above: Whether the values must stay above the bound.
    """

    key: str
    name: str
    unit: str
    log: bool = False
    bound: float | None = None
    above: bool = False

    def as_data(self) -> dict[str, Any]:
        """Return it as the page reads it."""
        scale = "log" if self.log else "linear"
        data = {"key": self.key, "name": self.name, "unit": self.unit, "scale": scale}
        return {**data, "bound": self.bound, "above": self.above}


def readouts_of(experiment: Experiment) -> tuple[Readout, ...]:
    """Return the numbers that are shown of an experiment and of its variants, in their order."""
    presses = experiment.contact is not None
    numbers = []
    if presses:
        numbers += [Readout("force", "contact force", "N")]
        numbers += [Readout("force_desired", "desired force", "N")]
    name = "error along the surface" if presses else "position error"
    numbers += [Readout("position_error", name, "m", log=True)]
    if experiment.holds_orientation:
        numbers += [Readout("orientation_error", "orientation error", "rad", log=True)]
    if experiment.clearance is not None:
        numbers += [Readout("distance", "least distance", "m", bound=0.0, above=True)]
    numbers += [Readout("jacobian_error", "error of Ĵ", "m", log=True)]
    for name in DERIVATIVES:
        bound = experiment.limits.bounds[name]
        if bound is not None and np.isfinite(bound).any():
            numbers += [Readout(f"{name}_ratio", f"{name} / bound", "1", bound=1.0)]
    numbers += [Readout("margin", "to nearest joint limit", "rad", bound=0.0, above=True)]
    return tuple(numbers)


class Peaks:
    """The largest shares of bounds that the command has used since they were last asked for.

    Args:
        experiment: The experiment, with the limits of the joints.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._limits = experiment.limits
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._ratios, self._margin = dict.fromkeys(DERIVATIVES, 0.0), np.inf
        self._before: tuple[Array, Array] | None = None

    def add(self, steps: Steps, v: Array) -> None:
        """Add steps, the first of which ended the steps before.

        Args:
            steps: Recorded steps.
            v: Velocity that the law commanded at each, shape (k, n) [rad/s].
        """
        durations = np.diff(steps.time)[:, None]
        if not durations.size:
            return
        a = np.diff(v, axis=0) / durations
        first = a[:1] if self._before is None else self._before[0]
        jerk = np.diff(np.concatenate((first, a)), axis=0) / durations
        self._before = a[-1:], v[-1:]
        values = {"velocity": v, "acceleration": a, "jerk": jerk}
        for name, each in values.items():
            if (bound := self._limits.toward(name, each)) is not None:
                share = float((np.abs(each) / bound).max())
                self._ratios[name] = max(self._ratios[name], share)
        has_commands = "position_commanded" in steps.layout
        q = steps.series("position_commanded" if has_commands else "position")
        limits = self._limits
        room = np.minimum(q - limits.position_lower, limits.position_upper - q)
        self._margin = min(self._margin, float(room.min()))

    def take(self) -> dict[str, float]:
        """Return the shares and the least distance to a joint limit, and begin anew."""
        shares = {f"{name}_ratio": share for name, share in self._ratios.items()}
        shares["margin"] = self._margin
        before = self._before
        self.clear()
        self._before = before
        return shares


def numbers_now(segment: Segment, t: float) -> dict[str, float]:
    """Return the numbers of this moment, by key.

    Args:
        segment: The simulation that runs.
        t: Time of the segment [s].
    """
    experiment, loop, root = segment.experiment, segment.loop, segment.root
    body = loop.arm.GetMyContextFromRoot(root)
    q = loop.arm.GetOutputPort("position").Eval(body)
    kinematics = loop.arm.kinematics
    p_WE, away = kinematics.p_WE(q), np.zeros(3)
    axes = list(experiment.task.axes)
    away[axes] = (p_WE - experiment.desired.position(t)[0])[axes]
    numbers: dict[str, float] = {}
    if experiment.contact is not None:
        n = experiment.contact.surface.normal_W
        away = away - n.dot(away) * n
        force = loop.arm.GetOutputPort("contact_force").Eval(body)
        numbers["force"] = float(n.dot(force))
        numbers["force_desired"] = experiment.contact.force.at(t)
    numbers["position_error"] = float(np.linalg.norm(away))
    if experiment.holds_orientation:
        rotation = rotation_error(kinematics.R_WE(q), experiment.desired.orientation(t)[0])
        numbers["orientation_error"] = float(np.linalg.norm(rotation))
    if experiment.clearance is not None:
        motions = experiment.motions
        gaps = experiment.clearance.gaps(q, None if motions is None else motions.at(t))
        numbers["distance"] = float(gaps.min(initial=np.inf))
    layout = loop.controller.reading.state
    if "J_hat" in layout:
        J_hat = layout.part(segment.x, "J_hat")
        numbers["jacobian_error"] = float(np.linalg.norm(J_hat - experiment.task.J(kinematics, q)))
    return numbers
