"""What a feature is: an optional section of a document, with all that the package does about it.

A `Feature` says what it warns of, what is left of the guarantees, what is measured of a run, and
what is drawn. What its section becomes may be a `LoopPart`, which adds systems to a loop. What it
draws in a playback is a `SceneItem`. Hosts loop over `drake_rnn.features.FEATURES`.

Features lie below experiments, runs and playbacks. Where a method is given one of their objects,
its type is `Any`, and the docstring names its class.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..laws.guarantee import Assumption as Assumption
from ..laws.guarantee import Guarantee as Guarantee
from ..laws.guarantee import Promise
from ..laws.law import Layout
from ..measures import Metric, Motion, RunMetrics, Steps
from ..robot.arm import Arm
from ..robot.task import TaskSection
from ..systems.body import Body
from ..systems.controllers import Controller

#: Output ports by name.
Ports = dict[str, OutputPort]

S = TypeVar("S")

#: Prefix of the series of a second arm.
SECOND_PREFIX = "second_"


class Wiring:
    """A part of a diagram under construction.

    Args:
        builder: Diagram builder that the systems are added to.
        prefix: Prefix of the systems' names in ``builder``.

    Attributes:
        systems: Systems added so far, by name without the prefix.
    """

    def __init__(self, builder: DiagramBuilder, prefix: str) -> None:
        self._builder = builder
        self._prefix = prefix
        self.systems: dict[str, System] = {}

    def add(self, name: str, system: S) -> S:
        """Add a system and return it.

        Raises:
            InvalidInputError: If the diagram has it already, or another one of this name.
        """
        # Drake would end the process over either.
        if any(system is each for each in self._builder.GetSystems()):
            raise InvalidInputError(f"{name}: is in this diagram already; make another one")
        full = self._prefix + name
        if self._builder.HasSubsystemNamed(full):
            raise InvalidInputError(
                f"prefix: there is a system {full!r} in this diagram already; give each loop a "
                f"prefix of its own, not {self._prefix!r}"
            )
        self._builder.AddNamedSystem(full, system)
        self.systems[name] = system
        return system

    def connect(self, output: OutputPort, port: InputPort) -> None:
        """Connect two ports.

        Raises:
            InvalidInputError: If the ports differ in size.
        """
        if output.size() != port.size():
            raise InvalidInputError(
                f"{_place(output)}: must have {port.size()} entries, like {_place(port)}, not "
                f"{output.size()}; was it made for another task or arm?"
            )
        self._builder.Connect(output, port)


def ports_of(system: System) -> Ports:
    """Return the output ports of a system, by name."""
    ports = [system.get_output_port(index) for index in range(system.num_output_ports())]
    return {port.get_name(): port for port in ports}


def _place(port: InputPort | OutputPort) -> str:
    return f"{port.get_system().get_name()}.{port.get_name()}"


class JointVelocity(NamedTuple):
    """Joint velocities in the loop, shape (n,) [rad/s].

    Attributes:
        moved: Velocity that moves the arm.
        measured: Velocity that ``v_WE`` is computed from.
        shown: Velocity that the law sees.
    """

    moved: OutputPort
    measured: OutputPort
    shown: OutputPort


@dataclass
class LoopBuild:
    """A loop while it is built: what parts of it find, and what they change.

    Attributes:
        wiring: Adds and connects systems.
        body: The arm.
        task: Task of the loop.
        period: Sampling period of the controller [s]; None if Drake integrates it.
        seed: Seed of the loop's random numbers.
        parts: All parts of the loop.
        given: Output ports in place of those that the loop offers, by name.
        reference: Output ports of the reference, by name.
        virtual: Whether the law sees a virtual arm ahead of a filter.
        velocity: Velocities that the law commands, as far as parts have changed them.
        joints: What sensors say of joints, by the names of signals; without them the law sees the
            true ones.
        outside: What sensors say of the tool from outside, likewise.
        offered: Further signals that the law may see, by name.
        forces: Forces on the tool, by name.
        recorded: Further ports that a run records, by name.
    """

    wiring: Wiring
    body: Body
    task: TaskSection
    period: float | None
    seed: int
    parts: Sequence[LoopPart]
    given: Mapping[str, OutputPort]
    velocity: JointVelocity
    reference: Ports = field(default_factory=dict)
    virtual: bool = False
    joints: Ports = field(default_factory=dict)
    outside: Ports = field(default_factory=dict)
    offered: Ports = field(default_factory=dict)
    forces: Ports = field(default_factory=dict)
    recorded: Ports = field(default_factory=dict)


class LoopPart:
    """What a feature adds to a loop; each method does nothing by default.

    Those of `drake_rnn.AddLoop` are asked in this order: first all for the command, then, when the
    arm is connected, all for sensors.
    """

    # A system may be a part: see `Block` about dictionaries of instances.
    __slots__ = ()

    def traits(self) -> Mapping[str, Any]:
        """Return fields of a `drake_rnn.features.pairs.Combination` that it has."""
        return {}

    def check(self, controller: Controller) -> None:
        """Raise an InvalidInputError if it does not fit the controller of its loop."""

    def change_command(self, loop: LoopBuild) -> None:
        """Add what changes the command on its way to the arm: ``loop.velocity``."""

    def add_sensors(self, loop: LoopBuild) -> None:
        """Add what sees the arm or acts on it: ports of ``loop``."""


#: Limits that hold of the arm only if its positions are those that the law counts with; a stop
#: keeps them only if the command left it room.
OF_POSITIONS = ("position", "envelope")


@dataclass(frozen=True)
class Guarantees:
    """What an experiment's command and its arm keep by construction.

    Attributes:
        command: What the command keeps: that of the law, or what `Safety` makes of it.
        arm: What the arm keeps. It keeps nothing if it does not move as commanded, because of its
            motors, of an actuated dither or of a disturbance. Where commanded torques alone act on
            its joints, it keeps those, if none may be larger than the limit of its joint.
        assumptions: What each promise rests on, by the names of `Guarantee.names`.
        stated: Bounds that the document states and that nothing need keep, by the same names.
    """

    command: Guarantee
    arm: Guarantee
    assumptions: Mapping[str, tuple[Assumption, ...]] = field(default_factory=dict)
    stated: Mapping[str, float] = field(default_factory=dict)

    @property
    def command_only(self) -> tuple[str, ...]:
        """Names of the limits that the command keeps, but nothing keeps of the arm."""
        return tuple(name for name in self.command.limits if name not in self.arm.limits)

    @property
    def promises(self) -> tuple[Promise, ...]:
        """What is promised, of the arm or else of its command, and bounds that are stated alone."""
        return tuple(
            self._promise(name)
            for name in dict.fromkeys((*self.command.names, *self.arm.names, *self.stated))
        )

    def _promise(self, name: str) -> Promise:
        of = "arm" if self.arm.has(name) else "command" if self.command.has(name) else "stated"
        keeps = self.arm if of == "arm" else self.command
        bounds = {"distance": keeps.distance, "force": self.stated.get("force", keeps.force)}
        unit = {"distance": "m", "force": "N"}.get(name, "")
        return Promise(name, of, bounds.get(name), unit, self.assumptions.get(name, ()))


class Moment(NamedTuple):
    """A time at which something happens.

    Attributes:
        time: The time [s].
        name: What happens, for figures and pages.
        of_arm: Whether it happens to the arm: figures of the arm's motion mark it.
    """

    time: float
    name: str
    of_arm: bool = True


class Span(NamedTuple):
    """A time for which something goes on.

    Attributes:
        begin: Time at which it begins [s].
        end: Time at which it ends [s].
        name: What goes on, for figures.
    """

    begin: float
    end: float
    name: str


class EvaluationSteps(NamedTuple):
    """Steps of a run that are being evaluated.

    Attributes:
        steps: The recorded steps.
        position: Joint positions, shape (k, n) [rad].
        J: Jacobian of the end effector's position, shape (k, m, n) [m].
        virtual: Whether the arm is the virtual one ahead of a filter.
    """

    steps: Steps
    position: Array
    J: Array
    virtual: bool


class DrawnRobot(Protocol):
    """An arm in a playback's scene, a `drake_rnn.playback.arm_drawing.DrawnArm`."""

    arm: Arm
    plant: Any

    def place(self, body: Any) -> str:
        """Return the scene path of a body."""

    def carrier(self, name: str) -> Any:
        """Return a body that is seen and moves as the named one does; or None."""

    def set_posture(self, q: Array) -> None:
        """Set the joint positions, shape (n,) [rad], without drawing."""

    def X_WB(self, body: Any) -> RigidTransform:
        """Return the pose of a body in the posture that is set."""

    def draw(self, q: Array, time: float) -> None:
        """Draw a posture; record it at ``time`` [s] if the scene records."""


@dataclass(frozen=True, eq=False)
class Stage:
    """Where a feature draws: the scene of a playback.

    Attributes:
        meshcat: Meshcat with the scene.
        motion: The motion that is replayed, a `drake_rnn.playback.replay.ReplayedMotion`.
        arm: Its arm.
        draw_arm: Draws another arm below a scene path.
        replay: Returns the motion of another `drake_rnn.Result`.
        corners: Returns corners of boxes round an arm in several postures of a motion, shape
            (k, 3) [m].
    """

    meshcat: Meshcat
    motion: Any
    arm: DrawnRobot
    draw_arm: Callable[[Arm, str], DrawnRobot]
    replay: Callable[[Any], Any]
    corners: Callable[[Any, DrawnRobot], Array]

    @property
    def experiment(self) -> Any:
        """The `drake_rnn.Experiment` that was run."""
        return self.motion.result.experiment

    @property
    def begin(self) -> float:
        """Time of the first sample [s]."""
        return float(self.motion.result.time[0])


class Frames(NamedTuple):
    """The frames of a playback.

    Attributes:
        recording: The animation.
        time: Time of each since the first sample, shape (f,) [s].
        rate: Frame rate [1/s].
    """

    recording: MeshcatAnimation
    time: Array
    rate: int

    def move(self, place: str, points: Array) -> None:
        """Record positions of an object in the frames, shape (f, 3) [m]."""
        for frame, point in enumerate(points.tolist()):
            self.recording.SetProperty(frame, place, "position", point)

    def show(self, place: str, begin: float | None, end: float | None = None) -> None:
        """Record when an object is seen.

        Args:
            place: Scene path of the object.
            begin: Time from which on it is seen, since the first sample [s]; None for all along.
            end: Time at which it vanishes [s]; None if it stays.
        """
        first = 0 if begin is None else self._frame(begin)
        last = self.time.size if end is None else self._frame(end)
        self.recording.SetProperty(0, place, "visible", first == 0)
        if 0 < first < self.time.size:
            self.recording.SetProperty(first, place, "visible", True)
        if last < self.time.size:
            self.recording.SetProperty(last, place, "visible", False)

    def _frame(self, time: float) -> int:
        return int(np.searchsorted(self.time, time - 1e-9))


class LegendEntry(NamedTuple):
    """An entry of a playback's legend.

    Attributes:
        look: Class of its sign in the page's style sheet, e.g. ``ball``.
        text: What it says.
        sign, colour: Its sign in the caption of a film, and the colour of that.
    """

    look: str
    text: str
    sign: str = "●"
    colour: str = ""


class SceneItem:
    """Something that a feature draws in a playback; it draws nothing by default.

    Attributes:
        legend: Entries of the playback's legend, beside those of its feature.
        motions: Further motions whose paths are drawn.
    """

    legend: Sequence[LegendEntry] = ()
    motions: Sequence[Any] = ()

    @property
    def corners(self) -> Array:
        """Corners of boxes round it, which must be in the frame, shape (k, 3) [m]."""
        return np.zeros((0, 3))

    def draw(self) -> list[str]:
        """Draw it, once the ground is there; return scene paths of capsules, hidden at first."""
        return []

    def record(self, frames: Frames) -> None:
        """Record how it moves."""


class Feature:
    """An optional section of a document; each method does nothing by default.

    Methods are asked of every feature, whether a document has its section or not.

    Attributes:
        key: Key of its section.
        section: Annotation of the section's value, with its `Meaning`; None for a section that
            `drake_rnn.ExperimentDocument` declares itself.
        hosts: Where an experiment with it may run, if the table of pairs does not say it.
        metrics: Metrics that it adds, beside those of `drake_rnn.METRICS`. Their functions find in
            ``motion.features`` what `observe` returns.
        pairs: Rows that it adds to the table of pairs; its own trait has the name of its key.
    """

    key: ClassVar[str]
    section: ClassVar[Any] = None
    hosts: ClassVar[frozenset[str]] = frozenset({"diagram", "simulate"})
    metrics: ClassVar[tuple[Metric, ...]] = ()
    pairs: ClassVar[tuple[Any, ...]] = ()

    def make(self, section: Any, parts: Any) -> Any:
        """Return what its section becomes, of the experiment's ``features``; a `LoopPart` joins it.

        Args:
            section: The section's value.
            parts: What other sections describe, a `drake_rnn.experiment.Sections`.

        Raises:
            InvalidInputError: If it does not fit them.
        """
        return section

    def body_arguments(self, experiment: Any) -> Mapping[str, Any]:
        """Return arguments of `drake_rnn.Body` for an experiment, by name."""
        return {}

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        """Return arguments of `drake_rnn.AddLoop` for an experiment, by name."""
        return {}

    def path_source(self, experiment: Any, period: float | None) -> System | None:
        """Return the source of the path in place of a `PathSource`; None for that.

        Args:
            experiment: The `drake_rnn.Experiment`.
            period: Sampling period of the controller [s].
        """
        return None

    def signal_sources(
        self, experiment: Any, inputs: Layout
    ) -> Mapping[str, tuple[System, Sequence[str]]]:
        """Return sources of signals in place of those that the loop offers.

        Args:
            experiment: The `drake_rnn.Experiment`.
            inputs: Inputs of its law.

        Returns:
            Each source by its name in the diagram, with the output ports that are used.
        """
        return {}

    def doubts(self, experiment: Any) -> list[str]:
        """Return warnings before a run.

        Args:
            experiment: The `drake_rnn.Experiment`.

        Raises:
            InvalidInputError: If the experiment cannot have it.
        """
        return []

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        """Return what the arm still keeps with it, of what it kept without it.

        Args:
            arm: What the arm keeps without it.
            experiment: The `drake_rnn.Experiment`.
        """
        return arm

    def assumptions(self, experiment: Any) -> Mapping[str, Sequence[Assumption]]:
        """Return what promises rest on, by the names of `Guarantee.names`.

        A promise of which an assumption is known not to hold is not made of the arm.

        Args:
            experiment: The `drake_rnn.Experiment`.
        """
        return {}

    def stated(self, experiment: Any) -> Mapping[str, float]:
        """Return bounds that the section states, which need not be promised, by the same names."""
        return {}

    def moments(self, experiment: Any) -> Iterable[Moment]:
        """Return when something happens in a run."""
        return ()

    def spans(self, series: Mapping[str, Array], time: Array) -> Iterable[Span]:
        """Return what goes on for a while in a run; figures shade it.

        Args:
            series: Series of the result, by name.
            time: Their times, shape (k,) [s].
        """
        return ()

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        """Return fields of a `Motion` that are measured of steps, or series of shape (k, ...).

        Series, which have other names than the fields, are in ``motion.features``, and among the
        series of the result.
        """
        return {}

    def series(self, motion: Motion, steps: Steps) -> Mapping[str, Array]:
        """Return the series of the result that follow from fields of its own of a motion."""
        return {}

    def caveats(
        self, experiment: Any, metrics: Mapping[str, float], run: RunMetrics
    ) -> Iterable[str]:
        """Return warnings after a run.

        Args:
            experiment: The `drake_rnn.Experiment`.
            metrics: Its metrics, by name.
            run: What they were taken from.
        """
        return ()

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        """Return what it draws in a playback."""
        return ()

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        """Return what a playback and a film say of what it draws."""
        return ()
