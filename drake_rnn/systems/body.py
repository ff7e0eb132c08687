"""The arm as a system that a controller moves, at any level of simulation detail.

- The arm at the kinematic level, which follows its command exactly.
- A real arm, or one behind the same messages: whoever holds the connection tells where it is.
- The contact force at the kinematic level.
- The arm's kinematics as signals.
- The arm's dynamics as signals.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from types import NoneType
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from ..environments import ENVIRONMENTS, ElasticSurface, Surface, TouchedSurface
from ..errors import InvalidInputError, old_arguments
from ..inputs.fields import Array, flag
from ..inputs.messages import is_number, plural, require_type, short, wrong_class
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics, AutoDiffKinematics
from ..robot.limits import require_resting
from ..robot.task import TASKS, TaskSection, named_task
from ..signals import View, names_of
from .block import (
    AutoDiffFunctions,
    Block,
    Calc,
    Collectable,
    autodiff_signals,
    declare_signals,
)
from .plant import PlantSettings

#: Arm that a law sees: ``commanded``, the arm that the filtered command moves; ``measured``, the
#: true arm; ``unfiltered``, a virtual arm that the law's unfiltered command moves.
Feedback = Literal["commanded", "measured", "unfiltered"]


class Body(Diagram, metaclass=Collectable):
    """An arm that follows a joint command; each subclass is one level of simulation detail.

    Inputs are ``position_commanded`` and ``velocity_commanded``, outputs ``position`` and
    ``velocity``, shape (n,) [rad, rad/s]. With a contact there are two more outputs, shape (3,)
    [N], in the world frame: the force of the surroundings on the tool, as computed by the simulated
    contact, ``contact_force``, and as measured by a sensor between arm and tool, ``tool_force``.

    Args:
        arm: The arm.
        start: Start posture, shape (n,) [rad]; by default the arm's home posture.
        contact: Contact of the tool with a surface; None for an arm in free space.
        settings: Simulation and motor settings, only of an arm with motors; None for the defaults.
        outside: How far the start may lie outside the position limits [rad].
        takes_force: Whether further forces act on it, only of an arm with a plant: it then has the
            input ``applied_spatial_force`` of the plant.

    Attributes:
        kinematics: Kinematics of the arm; systems that share it compute each posture only once.

    Raises:
        InvalidInputError: If the start is missing, of the wrong size or outside the position
            limits; if the tool cannot press against such a surface at this level; or if there are
            settings for an arm without motors.
    """

    #: Name of the level in an experiment's document.
    level: ClassVar[str]
    #: Arm that a law sees by default.
    default_feedback: ClassVar[Feedback]
    #: Base class of the surfaces that the tool can press against at this level.
    surfaces: ClassVar[type[Surface]]
    #: Whether motors with limited torque move the arm.
    has_motors: ClassVar[bool]
    #: Whether a simulator alone can move the arm.
    is_simulated: ClassVar[bool] = True
    #: Whether it goes where it is commanded to be; else the torques of its input
    #: ``torque_commanded`` move it.
    follows_command: ClassVar[bool] = True

    @old_arguments(pushed="takes_force")
    def __init__(
        self,
        arm: Arm,
        start: Array | None = None,
        contact: TouchedSurface | None = None,
        settings: PlantSettings | None = None,
        *,
        outside: float = 0.0,
        takes_force: bool = False,
    ) -> None:
        super().__init__()
        self.arm = arm
        self.start = start_posture(arm, start, outside)
        if contact is not None:
            # `drake_rnn.Contact` lies above: it has a force and its sensor besides.
            if not isinstance(contact, TouchedSurface):
                raise wrong_class("contact", contact, "Contact", "None")
            self.check_surface(type(contact.surface))
        self.contact = contact
        require_type("settings", settings, PlantSettings, NoneType)
        self.check_plant(settings, None)
        has_plant = self.has_motors and self.is_simulated
        flag("takes_force", takes_force)
        if takes_force and not has_plant:
            raise InvalidInputError("takes_force: only at level: dynamic")
        self.takes_force = takes_force
        self.settings = PlantSettings() if settings is None and has_plant else settings
        self.kinematics = arm.kinematics()
        builder = DiagramBuilder()
        self._build(builder)
        builder.BuildInto(self)

    @abstractmethod
    def _build(self, builder: DiagramBuilder) -> None:
        """Add the systems that move the arm, and export the ports of a body."""

    @property
    def tick(self) -> float | None:
        """Time for which the joint velocity is held [s]; None if it is the commanded one."""
        return None

    def set_motion(self, context: Context, q: Array, v: Array) -> None:
        """Set positions and velocities of the joints, shape (n,) each, of an arm that has its own.

        An arm that is always where it is commanded to be has none.

        Args:
            context: Context of this body.
            q: Positions [rad].
            v: Velocities [rad/s].
        """

    def remedy(self, joint: int, off: float) -> str:
        """Return a remedy for a joint that is far from its command, as a part of a sentence.

        Args:
            joint: Index of the joint.
            off: Its distance from its command [rad].
        """
        return "see the settings of its motors"

    @classmethod
    def check_plant(cls, settings: PlantSettings | None, period: float | None) -> None:
        """Raise an InvalidInputError if the level has no plant, or one slower than the controller.

        Args:
            settings: Settings of the plant; None for the defaults.
            period: Sampling period of the controller [s]; None if Drake integrates it.
        """
        if cls.has_motors:
            (settings or PlantSettings()).check_period(period)
        elif settings is not None:
            raise InvalidInputError("plant: only at level: dynamic or torque")

    def check_task(self, task: TaskSection) -> None:
        """Raise an InvalidInputError for an unknown task, or a planar one with a contact.

        Args:
            task: A key of `drake_rnn.robot.task.TASKS`, or a `drake_rnn.robot.task.Task`.
        """
        axes = named_task(task).axes
        if self.contact is not None and len(axes) != 3:
            able = ", ".join(name for name, size in TASKS.items() if len(size.axes) == 3)
            raise InvalidInputError(f"task: may be {able} with a contact, not {task}")

    @classmethod
    @old_arguments(sensed="has_sensing")
    def chosen_feedback(cls, feedback: Feedback | None, *, has_sensing: bool) -> Feedback:
        """Return the arm that a law sees.

        Args:
            feedback: Requested arm; None for the default, which is the measured arm if sensors
                measure the joints.
            has_sensing: Whether sensors measure the joints.
        """
        if feedback is not None:
            return feedback
        return "measured" if has_sensing else cls.default_feedback

    @staticmethod
    def check_feedback(feedback: Feedback) -> None:
        """Raise an InvalidInputError for what is no name of an arm that a law may see."""
        if feedback not in get_args(Feedback):
            may_be = ", ".join(get_args(Feedback))
            raise InvalidInputError(f"feedback: may be {may_be}, not {feedback!r}")

    @classmethod
    def check_surface(cls, kind: type[Surface]) -> None:
        """Raise an InvalidInputError if the tool cannot press against this kind of surface."""
        if issubclass(kind, cls.surfaces):
            return
        able = [
            name
            for name, kind_of_surface in ENVIRONMENTS.items()
            if issubclass(kind_of_surface, cls.surfaces)
        ]
        name_of_kind = next(
            (name for name, kind_of_surface in ENVIRONMENTS.items() if kind_of_surface is kind),
            kind.__name__,
        )
        raise InvalidInputError(
            f"environment.kind: may be {', '.join(able)} at level: {cls.level}, not {name_of_kind}"
        )


def start_posture(arm: Arm, start: Array | None, outside: float = 0.0) -> Array:
    """Return the start posture, shape (n,) [rad]: ``start``, or else the arm's home posture.

    Raises:
        InvalidInputError: If there is neither; if ``start`` has the wrong shape or lies outside
            the position limits by more than ``outside`` [rad]; if joints cannot rest there under
            the envelope of the velocity, where nothing outside is allowed; if ``outside`` is
            negative or NaN; or if ``arm`` is not an `Arm`.
    """
    require_type("arm", arm, Arm)
    if not (is_number(outside) and outside >= 0.0):
        raise InvalidInputError(
            f"outside: must be an angle of at least 0 rad, not {short(outside)}"
        )
    if start is None:
        start = arm.home
    if start is None:
        raise InvalidInputError(
            f"start: must be given; {arm.name} has no home posture, and `drake-rnn arm` or "
            "proposed_home(arm) proposes one"
        )
    start = _one_per_joint(arm, start)
    if not np.isfinite(start).all() or (arm.limits.violation(start) > outside).any():
        raise InvalidInputError(
            f"start: {arm.limits.complaint(start, outside, arm.joints, arm.units)}"
        )
    if not outside:
        require_resting(arm.limits, start, "start", arm.joints, arm.units)
    return start


def _one_per_joint(arm: Arm, start: Array) -> Array:
    """Return a start posture as an array, shape (n,); an InvalidInputError unless it is one."""
    try:
        start = np.asarray(start, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInputError(f"start: must be {arm.n} numbers, not {short(start)}") from None
    if start.ndim != 1:
        raise InvalidInputError(f"start: must have the shape ({arm.n},), not {start.shape}")
    if start.size != arm.n:
        raise InvalidInputError(
            f"start: has {plural(start.size, 'entry', 'entries')} for {plural(arm.n, 'joint')}"
        )
    return start


class SpringContact(Block):
    """Force on E's origin from a surface that acts as a spring, proportional to the depth.

    The input is ``position`` of the joints, shape (n,) [rad], the output ``contact_force``, shape
    (3,) [N], in the world frame.

    Args:
        surface: Surface with its normal and stiffness.
        p_WS: A point of the surface, shape (3,) [m].
        n: Number of joints.
        kinematics: Kinematics of the arm.
        shift: Returns at a time [s] how far the surface has gone, shape (3,) [m], and its velocity;
            None for one that stands still.
    """

    def __init__(
        self,
        surface: ElasticSurface,
        p_WS: Array,
        n: int,
        kinematics: ArmKinematics,
        shift: Callable[[float], tuple[Array, Array]] | None = None,
    ) -> None:
        super().__init__()
        normal, stiffness = surface.normal_W, surface.stiffness
        height = float(normal.dot(p_WS))
        position = self.DeclareVectorInputPort("position", n)

        def contact_force(context: Context, output: Any) -> None:
            p_WE = kinematics.p_WE(position.Eval(context))
            depth = height - float(normal.dot(p_WE))
            if shift is not None:
                depth += float(normal.dot(shift(context.get_time())[0]))
            output.set_value(stiffness * depth * normal if depth > 0.0 else np.zeros(3))

        causes = {position.ticket()} if shift is None else {position.ticket(), self.time_ticket()}
        self.DeclareVectorOutputPort("contact_force", 3, contact_force, causes)
        self._moves = shift is not None
        self._kinematics, self._normal = kinematics, normal
        self._height, self._stiffness = height, stiffness

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        if self._moves:
            raise InvalidInputError(self._no_autodiff("its surface moves"))
        normal, height, stiffness = self._normal, self._height, self._stiffness
        kinematics, position = AutoDiffKinematics(self._kinematics), inputs["position"]

        def contact_force(context: Context) -> Any:
            depth = height - normal.dot(kinematics.p_WE(position(context)))
            return stiffness * depth * normal if depth > 0.0 else np.zeros(3)

        return AutoDiffFunctions({"contact_force": contact_force})


class IdealArm(Body):
    """An arm without mass that follows its command exactly; surfaces act on it as springs.

    Arguments, errors and ports are those of `Body`; the outputs ``position`` and ``velocity`` are
    the commanded ones. A contact is with an `ElasticSurface`.
    """

    level = "kinematic"
    default_feedback: ClassVar[Feedback] = "commanded"
    surfaces: ClassVar[type[Surface]] = ElasticSurface
    has_motors = False

    def _build(self, builder: DiagramBuilder) -> None:
        arm, contact = self.arm, self.contact
        for name in ("position", "velocity"):
            block = builder.AddNamedSystem(name, PassThrough(arm.n))
            builder.ExportInput(block.get_input_port(), f"{name}_commanded")
            builder.ExportOutput(block.get_output_port(), name)
        if contact is not None and isinstance(contact.surface, ElasticSurface):
            p_WS = contact.place(arm, self.start)
            shift = None if contact.motion is None else contact.shift
            spring = SpringContact(contact.surface, p_WS, arm.n, self.kinematics, shift)
            builder.AddNamedSystem("contact", spring)
            position = builder.GetSubsystemByName("position").get_output_port()
            builder.Connect(position, spring.get_input_port())
            for name in ("contact_force", "tool_force"):
                builder.ExportOutput(spring.get_output_port(), name)


#: Why such an arm presses on nothing.
NO_FORCE = "environment: must be left out at level: robot, where no force is measured"


class RobotArm(Body):
    """An arm that another program moves: a robot's own controller, behind its messages.

    Arguments and ports are those of `Body`. Between two steps of a simulator the holder of the
    connection writes what the robot has measured (`measure`), advances the simulator to the
    robot's time, and sends what is then commanded (`command`); `drake_rnn.drive_experiment` does
    so for experiments, and `drake_rnn.drive_diagram` for a diagram of your own. Until it is told
    something else, the arm rests at its start.
    """

    level = "robot"
    default_feedback: ClassVar[Feedback] = "commanded"
    surfaces: ClassVar[type[Surface]] = Surface
    has_motors = True
    is_simulated = False

    def _build(self, builder: DiagramBuilder) -> None:
        n = self.arm.n
        self._measured_joints = builder.AddNamedSystem(
            "measured_joints", _MeasuredJoints(self.start)
        )
        for name in ("position", "velocity"):
            block = builder.AddNamedSystem(f"{name}_commanded", PassThrough(n))
            builder.ExportInput(block.get_input_port(), f"{name}_commanded")
            builder.ExportOutput(self._measured_joints.GetOutputPort(name), name)

    @property
    def tick(self) -> float | None:
        """Time between two messages, for which the measured velocity holds [s]; None if unknown."""
        return self.arm.description.message_period

    def remedy(self, joint: int, off: float) -> str:
        """See `Body.remedy`."""
        return "give the law lower limits or lower gains, or the robot a stiffer controller"

    @classmethod
    def check_plant(cls, settings: PlantSettings | None, period: float | None) -> None:
        """Raise an InvalidInputError if there are settings of a plant: nothing is simulated."""
        if settings is not None:
            raise InvalidInputError("plant: only at level: dynamic or torque")

    @classmethod
    def check_surface(cls, kind: type[Surface]) -> None:
        """Raise an InvalidInputError: no force is measured of a robot yet."""
        raise InvalidInputError(NO_FORCE)

    def measure(self, root: Context, position: Array, velocity: Array) -> None:
        """Write what the robot has measured.

        Args:
            root: Context of the whole diagram.
            position: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s].
        """
        state = self._measured_joints.GetMyMutableContextFromRoot(root).get_mutable_discrete_state()
        state.set_value(0, position)
        state.set_value(1, velocity)

    def command(self, root: Context) -> tuple[Array, Array]:
        """Return the commanded positions and velocities, shape (n,) each [rad, rad/s].

        Args:
            root: Context of the whole diagram.
        """
        context = self.GetMyContextFromRoot(root)
        position, velocity = (
            self.GetInputPort(f"{name}_commanded").Eval(context).copy()
            for name in ("position", "velocity")
        )
        return position, velocity


class _MeasuredJoints(Block):
    """Joint positions and velocities as a state that no event changes."""

    def __init__(self, start: Array) -> None:
        super().__init__()
        for name, value in (("position", start), ("velocity", 0.0 * start)):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(value))


class Kinematics(Block):
    """Pose, velocity and Jacobians of E, the arm's task frame, in the world frame W.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs along
    the m position axes of the task are ``p_WE`` and ``v_WE``, shape (m,) [m, m/s], and ``Jdot_v``,
    shape (m,) [m/s^2]. ``J`` has shape (size of the task, n); for a pose its first rows are those
    of ``J_omega``. ``R_WE``, shape (3, 3), and ``J_omega``, shape (3, n), do not depend on the
    task. Matrices are flattened.

    Args:
        arm: The arm.
        task: A key of `drake_rnn.robot.task.TASKS`.
        kinematics: Kinematics of the arm, to share with other systems so that each posture is
            computed only once; by default a new instance.

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`, or there is no such task.
    """

    role = "model"

    def __init__(
        self, arm: Arm, task: TaskSection = "xyz", kinematics: ArmKinematics | None = None
    ) -> None:
        super().__init__()
        require_type("arm", arm, Arm)
        require_type("kinematics", kinematics, ArmKinematics, NoneType)
        self.arm = arm
        about, n = named_task(task), arm.n
        self._position = self.DeclareVectorInputPort("position", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        view = View(about, arm.kinematics() if kinematics is None else kinematics)
        lengths = {"n": n, **about.lengths}
        ports = (self._position, self._velocity)
        declare_signals(self, view, names_of("kinematics"), ports, lengths)
        self._view = view

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        view = View(self._view.task, AutoDiffKinematics(self._view.kinematics))
        return autodiff_signals(view, names_of("kinematics"), inputs)


#: Outputs of `Dynamics`, which is added only for a law that needs one of them.
DYNAMICS_SIGNALS = names_of("dynamics")


class Dynamics(Block):
    """Inertia, Coriolis terms and gravity of the arm: torque = M v_dot + bias - gravity.

    If the arm's description gives a ``believed_mass_scale``, masses are scaled by it.

    Inputs are ``position`` and ``velocity`` of the joints, shape (n,) [rad, rad/s]. Outputs are
    ``M``, shape (n, n) flattened [kg m^2], ``bias`` and ``gravity``, shape (n,) [Nm].

    Args:
        arm: The arm.

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`.
    """

    role = "model"

    def __init__(self, arm: Arm) -> None:
        super().__init__()
        require_type("arm", arm, Arm)
        self._position = self.DeclareVectorInputPort("position", arm.n)
        self._velocity = self.DeclareVectorInputPort("velocity", arm.n)
        view = View(named_task("xyz"), dynamics=arm.believed_dynamics())
        ports = (self._position, self._velocity)
        declare_signals(self, view, DYNAMICS_SIGNALS, ports, {"n": arm.n})
        self._view = view

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        view = View(self._view.task, dynamics=AutoDiffKinematics(self._view.dynamics))
        return autodiff_signals(view, DYNAMICS_SIGNALS, inputs)
