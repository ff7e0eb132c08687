"""The arm with full dynamics: motors that follow the command, gravity and contact.

- The true contact force on a tool, taken from the simulated contact.
- The force on a tool as measured at its joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ContactResults, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex
from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import MatrixGain, Multiplexer

from ..environments import ContactModel, Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import require_type
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.tool import Tool
from .block import Block
from .body import Body, Feedback
from .plant import PlantSettings, add_plant, motors_of


class ContactForce(Block):
    """Sum of all contact forces on a tool: the true force, to compare sensor readings with.

    The input is ``contact_results`` of a plant, the output ``contact_force``, shape (3,) [N], in
    the world frame.

    Args:
        body: Index of the tool's body.
        geometries: Collision geometries of the tool.
    """

    def __init__(self, body: BodyIndex, geometries: Iterable[GeometryId]) -> None:
        super().__init__()
        # By their numbers: an identifier that a plant has returned keeps that plant alive.
        own = {geometry.get_value() for geometry in geometries}
        results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())

        def contact_force(context: Context, output: Any) -> None:
            contacts = results.Eval(context)
            total = np.zeros(3)
            for k in range(contacts.num_hydroelastic_contacts()):
                patch = contacts.hydroelastic_contact_info(k)
                surface = patch.contact_surface()
                # Drake reports the force on the body of geometry M.
                if surface.id_M().get_value() in own:
                    total += patch.F_Ac_W().translational()
                elif surface.id_N().get_value() in own:
                    total -= patch.F_Ac_W().translational()
            for k in range(contacts.num_point_pair_contacts()):
                pair = contacts.point_pair_contact_info(k)
                if pair.bodyB_index() == body:
                    total += pair.contact_force()
                elif pair.bodyA_index() == body:
                    total -= pair.contact_force()
            output.set_value(total)

        self.DeclareVectorOutputPort("contact_force", 3, contact_force, {results.ticket()})


class ToolForce(Block):
    """Reading of an ideal force-torque sensor between arm and tool, without the tool's weight.

    Inputs are ``reaction_forces`` of a plant's joints, and ``position`` of the arm's joints,
    shape (n,) [rad]. The output ``tool_force``, shape (3,) [N], is the force of the surroundings
    on the tool, in the world frame; it includes the tool's inertial force.

    Args:
        arm: The arm; the tool moves with its frame E.
        joint: Index of the joint that holds the tool, among the reaction forces.
        R_EJ: Orientation in E of that joint's frame J on the tool, shape (3, 3); Drake expresses
            the joint's reaction in J.
        mass: Mass that the joint holds [kg].
        kinematics: Kinematics of the arm, to share with other systems so that each posture is
            computed only once; by default a new instance.
    """

    def __init__(
        self,
        arm: Arm,
        joint: int,
        R_EJ: Array,
        mass: float,
        kinematics: ArmKinematics | None = None,
    ) -> None:
        super().__init__()
        R_WE = (arm.kinematics() if kinematics is None else kinematics).R_WE
        weight: Array = mass * arm.gravity
        forces = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        position = self.DeclareVectorInputPort("position", arm.n)

        def tool_force(context: Context, output: Any) -> None:
            # Force of the joint on the tool, in J.
            reaction = forces.Eval(context)[joint].translational()
            if not reaction.any():
                # Before its first step the plant reports no reaction.
                output.set_value(np.zeros(3))
                return
            output.set_value(-R_WE(position.Eval(context)).dot(R_EJ.dot(reaction)) - weight)

        causes = {forces.ticket(), position.ticket()}
        self.DeclareVectorOutputPort("tool_force", 3, tool_force, causes)


class SurfaceMotion(Block):
    """Source of ``state``, shape (6,): how far a surface is to go, and its velocity [m, m/s].

    Args:
        shift: Returns both at a time [s], shape (3,) each.
    """

    role = "reference"

    def __init__(self, shift: Callable[[float], tuple[Array, Array]]) -> None:
        super().__init__()

        def state(context: Context, output: Any) -> None:
            output.set_value(np.concatenate(shift(context.get_time())))

        self.DeclareVectorOutputPort("state", 6, state, {self.time_ticket()})


class PlantArm(Body):
    """An arm with mass: a discrete MultibodyPlant with motors that follow the command.

    Each motor is a position and velocity loop with the gravity torque fed forward. Torques saturate
    at the effort limits of the model's actuators; a joint without an actuator gets one without a
    limit. Arguments and ports are those of `Body`; all outputs are those of the plant's last step.
    A contact is with a `ContactModel`, e.g. a `Plate` or your own subclass.

    Attributes:
        plant: The plant.
        scene_graph: Geometry of the plant, e.g. for a visualizer.
        gains: Gains of the motors.

    Raises:
        InvalidInputError: In the same cases as `Body`; if the arm has a scaled mass, a joint
            that moves no mass or, for a contact, no tool; or if the environment's model cannot be
            read.
    """

    level = "dynamic"
    default_feedback: ClassVar[Feedback] = "measured"
    surfaces: ClassVar[type[Surface]] = ContactModel
    has_motors = True

    settings: PlantSettings

    def _build(self, builder: DiagramBuilder) -> None:
        arguments = self.arm, self.start, self.contact, self.settings
        parts = add_plant(builder, *arguments, follows=self.follows_command)
        self.plant, self.scene_graph = parts.plant, parts.scene_graph
        if parts.gains is not None:
            self.gains = parts.gains
        if self.takes_force:
            port = self.plant.get_applied_spatial_force_input_port()
            builder.ExportInput(port, "applied_spatial_force")
        self._instance = parts.instance
        self._drive(builder, self.arm, parts.instance)
        if parts.carrier is not None and self.contact is not None:
            motion = builder.AddNamedSystem("surface_motion", SurfaceMotion(self.contact.shift))
            port = self.plant.get_desired_state_input_port(parts.carrier)
            builder.Connect(motion.get_output_port(), port)
        if parts.tool is not None:
            self._feel(builder, self.arm, parts.instance, parts.tool)

    @property
    def tick(self) -> float | None:
        """Time step of the plant [s]."""
        return self.settings.time_step

    def set_motion(self, context: Context, q: Array, v: Array) -> None:
        """See `Body.set_motion`."""
        plant = self.plant
        mine = self.GetMutableSubsystemContext(plant, context)
        velocities = plant.GetVelocities(mine)
        for name, velocity in zip(self.arm.joints, v, strict=True):
            velocities[plant.GetJointByName(name).velocity_start()] = velocity
        positions: Any = self.arm.posture(plant, q)
        plant.SetPositions(mine, positions)
        plant.SetVelocities(mine, velocities)

    def remedy(self, joint: int, off: float) -> str:
        """See `Body.remedy`."""
        settings, most = self.settings, self.arm.effort[joint]
        if settings.stiffness is not None or settings.damping is not None:
            return (
                "leave out plant.stiffness and plant.damping, which then follow from the arm's "
                "inertia"
            )
        if self.gains.stiffness[joint] * off >= most:
            return (
                f"that is more than its motor, of at most {most:g} Nm, can do; a slower path or "
                "lower gains of the law ask for less"
            )
        return "give a higher plant.bandwidth, or lower gains of the law"

    def _drive(self, builder: DiagramBuilder, arm: Arm, instance: ModelInstanceIndex) -> None:
        """Connect the command to the motors, and export the joint state in the arm's order."""
        n = arm.n
        select, to_motors = self._export_joints(builder, arm, instance)
        nothing = np.zeros((n, n))
        command = self._take_command(builder, n)
        order = np.block([[to_motors, nothing], [nothing, to_motors]])
        ordered_command = builder.AddNamedSystem("motor_order", MatrixGain(order))
        builder.Connect(command.get_output_port(), ordered_command.get_input_port())
        self._move(builder, "desired_state", ordered_command.get_output_port())

        # Gravity torques of the arm's own model, without any load from contact.
        model = arm.plant()
        gravity = InverseDynamics(model, InverseDynamics.InverseDynamicsMode.kGravityCompensation)
        self._model = model  # Drake keeps only a pointer to it
        builder.AddNamedSystem("gravity", gravity)
        self._see_state(builder, gravity.get_input_port_estimated_state())
        against = builder.AddNamedSystem("against_gravity", MatrixGain(to_motors @ select.T))
        builder.Connect(gravity.get_output_port(), against.get_input_port())
        self._move(builder, "actuation", against.get_output_port())

    def _export_joints(
        self, builder: DiagramBuilder, arm: Arm, instance: ModelInstanceIndex
    ) -> tuple[Array, Array]:
        """Export position and velocity; return the orders of the plant's state and its motors.

        The plant orders its state by joints and the inputs of its motors by actuators.
        """
        plant, n = self.plant, arm.n
        starts = [plant.GetJointByName(name, instance).velocity_start() for name in arm.joints]
        select = np.eye(n)[np.argsort(starts)]
        motors = [motor.joint().name() for motor in motors_of(plant, instance)]
        to_motors = np.eye(n)[[arm.joints.index(name) for name in motors]]
        nothing = np.zeros((n, n))
        for name, pick in (
            ("position", np.hstack((select.T, nothing))),
            ("velocity", np.hstack((nothing, select.T))),
        ):
            block = builder.AddNamedSystem(name, MatrixGain(pick))
            self._see_state(builder, block.get_input_port())
            builder.ExportOutput(block.get_output_port(), name)
        self._position = builder.GetSubsystemByName("position").get_output_port()
        return select, to_motors

    def _take_command(self, builder: DiagramBuilder, n: int) -> Multiplexer:
        """Add and return what puts the commanded positions and velocities side by side."""
        command = builder.AddNamedSystem("commanded", Multiplexer([n, n]))
        builder.ExportInput(command.get_input_port(0), "position_commanded")
        builder.ExportInput(command.get_input_port(1), "velocity_commanded")
        return command

    def _see_state(self, builder: DiagramBuilder, port: InputPort) -> None:
        """Connect the state of the arm in the plant to a port."""
        builder.Connect(self.plant.get_state_output_port(self._instance), port)

    def _move(self, builder: DiagramBuilder, name: str, port: OutputPort) -> None:
        """Connect the desired state or the actuation to the arm's motors in the plant."""
        plant, instance = self.plant, self._instance
        to = {
            "desired_state": plant.get_desired_state_input_port,
            "actuation": plant.get_actuation_input_port,
        }
        builder.Connect(port, to[name](instance))

    def _feel(
        self, builder: DiagramBuilder, arm: Arm, instance: ModelInstanceIndex, tool: Tool
    ) -> None:
        plant = self.plant
        # Both frames move with the tool: any posture gives the same transform.
        X_EJ = plant.CalcRelativeTransform(
            plant.CreateDefaultContext(),
            plant.GetFrameByName(arm.frame, instance),
            tool.joint.frame_on_child(),
        )
        R_EJ = X_EJ.rotation().matrix()
        # Reactions are those of the plant's joints, in their order.
        joint = [int(index) for index in plant.GetJointIndices()].index(int(tool.joint.index()))
        sensor = ToolForce(arm, joint, R_EJ, tool.mass, self.kinematics)
        builder.AddNamedSystem("tool_force", sensor)
        builder.Connect(
            plant.get_reaction_forces_output_port(), sensor.GetInputPort("reaction_forces")
        )
        builder.Connect(self._position, sensor.GetInputPort("position"))
        builder.ExportOutput(sensor.GetOutputPort("tool_force"), "tool_force")
        contact = ContactForce(tool.body.index(), tool.geometries)
        builder.AddNamedSystem("contact_force", contact)
        builder.Connect(plant.get_contact_results_output_port(), contact.get_input_port())
        builder.ExportOutput(contact.get_output_port(), "contact_force")


class TorqueArm(PlantArm):
    """An arm with mass that a law moves by torques, which are all that acts on its joints.

    The plant is that of a `PlantArm`; its motors follow no position. The further input
    ``torque_commanded``, shape (n,) [Nm], acts for one time step, which is the controller's period.
    What is commanded besides, ``position_commanded`` and ``velocity_commanded``, is where the law
    believes that its torques lead; it moves nothing.
    """

    level = "torque"
    follows_command = False

    def remedy(self, joint: int, off: float) -> str:
        """See `Body.remedy`."""
        return "the law's torques lead elsewhere than it believes; its model of the arm is wrong"

    @classmethod
    def check_plant(cls, settings: PlantSettings | None, period: float | None) -> None:
        """Raise an InvalidInputError for gains of motors, or a step that is not the period.

        Args:
            settings: Settings of the plant; None for the defaults.
            period: Sampling period of the controller [s]; None if it is not known.
        """
        settings = PlantSettings() if settings is None else settings
        gains = {"bandwidth": settings.bandwidth, "stiffness": settings.stiffness}
        for name, gain in {**gains, "damping": settings.damping}.items():
            if gain is not None:
                raise InvalidInputError(
                    f"plant.{name}: must be left out at level: torque, where motors follow no "
                    "position"
                )
        if period is not None and abs(settings.time_step - period) > 1e-9 * period:
            raise InvalidInputError(
                f"plant.time_step: must be the controller's period, {period:g} s, at level: "
                f"torque, not {settings.time_step:g}; a torque acts for one step"
            )

    def _drive(self, builder: DiagramBuilder, arm: Arm, instance: ModelInstanceIndex) -> None:
        _, to_motors = self._export_joints(builder, arm, instance)
        self._take_command(builder, arm.n)
        torques = builder.AddNamedSystem("motor_order", MatrixGain(to_motors))
        builder.ExportInput(torques.get_input_port(), "torque_commanded")
        self._move(builder, "actuation", torques.get_output_port())


# Largest difference of gravity in an arm's description and in a plant [m/s^2].
_GRAVITY = 1e-6


class ArmInPlant(PlantArm):
    """An arm in a plant of your own, for `AddLoop`; the plant may hold more, also further arms.

    The plant stays outside: `connect` joins ``state``, ``desired_state`` and ``actuation`` to it.
    All else is as for a `PlantArm`; the law's kinematics, paths and gravity are in the arm's base
    frame B. ::

        instance = arm.add_to(plant, X_WB)
        add_motors(plant, instance, arm)
        plant.Finalize()
        loop = AddLoop(builder, body := ArmInPlant(arm, plant, instance), controller, path)
        body.connect(builder)

    Args:
        arm: The arm.
        plant: The plant, finalized, in the same diagram.
        instance: What `Arm.add_to` has returned.
        start: Start posture, shape (n,) [rad], which becomes the plant's default; by default the
            arm's home posture.
        outside: How far the start may lie outside the position limits [rad].

    Raises:
        InvalidInputError: If the plant is not finalized or not discrete, the joints have no motors,
            or gravity differs; and as `Body` does.
    """

    def __init__(
        self,
        arm: Arm,
        plant: MultibodyPlant,
        instance: ModelInstanceIndex,
        start: Array | None = None,
        *,
        outside: float = 0.0,
    ) -> None:
        require_type("arm", arm, Arm)
        require_type("plant", plant, MultibodyPlant)
        require_type("instance", instance, ModelInstanceIndex)
        _require_ready(arm, plant, instance)
        self._given, self._instance = plant, instance
        self._state: OutputPort | None = None
        super().__init__(arm, start, outside=outside)

    @property
    def tick(self) -> float | None:
        """Time step of the plant [s]."""
        return float(self.plant.time_step())

    def connect(self, builder: DiagramBuilder) -> None:
        """Connect the arm to its plant, after `AddLoop` has added it.

        Args:
            builder: Builder of the diagram with both.
        """
        plant, instance = self.plant, self._instance
        builder.Connect(plant.get_state_output_port(instance), self.GetInputPort("state"))
        desired, actuation = map(self.GetOutputPort, ("desired_state", "actuation"))
        builder.Connect(desired, plant.get_desired_state_input_port(instance))
        builder.Connect(actuation, plant.get_actuation_input_port(instance))

    def set_motion(self, context: Context, q: Array, v: Array) -> None:
        """See `Body.set_motion`: the plant, which has the motion, is not part of this body."""
        raise InvalidInputError("the motion of an arm in a plant of your own is set in the plant")

    def remedy(self, joint: int, off: float) -> str:
        """See `Body.remedy`."""
        return "give higher gains to add_motors, or lower gains of the law"

    def _build(self, builder: DiagramBuilder) -> None:
        self.plant = self._given
        self._drive(builder, self.arm, self._instance)
        start: Any = self.arm.posture(self._model, self.start)
        self.plant.SetDefaultPositions(self._instance, start)

    def _see_state(self, builder: DiagramBuilder, port: InputPort) -> None:
        if self._state is None:
            state = builder.AddNamedSystem("state_of_plant", _StateOfPlant(port.size()))
            builder.ExportInput(state.get_input_port(), "state")
            self._state = state.get_output_port()
        builder.Connect(self._state, port)

    def _move(self, builder: DiagramBuilder, name: str, port: OutputPort) -> None:
        builder.ExportOutput(port, name)


class _StateOfPlant(Block):
    """The state of an arm as its plant has it, or an error that says how to connect them.

    Args:
        size: Number of positions and velocities.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        state = self.DeclareVectorInputPort("state", size)

        def pass_on(context: Context, output: Any) -> None:
            if not state.HasValue(context):
                raise InvalidInputError(
                    "ArmInPlant: is not connected to its plant; call body.connect(builder) after "
                    "AddLoop"
                )
            output.SetFromVector(state.Eval(context))

        self.DeclareVectorOutputPort("state_of_plant", size, pass_on)


def _require_ready(arm: Arm, plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
    """Raise an InvalidInputError unless a plant has an arm with motors, and its gravity."""
    if not plant.is_finalized():
        raise InvalidInputError("plant: must be finalized, after add_motors")
    if not plant.time_step() > 0.0:
        raise InvalidInputError("plant: must be discrete, as motors that follow a command are")
    if arm.description.mass_scale != 1.0:
        text = f"{arm.description.mass_scale:g}"
        raise InvalidInputError(f"arm.mass_scale: must be 1 in a plant, not {text}")
    own = {plant.get_joint(index).name() for index in plant.GetJointIndices(instance)}
    if missing := [name for name in arm.joints if name not in own]:
        raise InvalidInputError(
            f"instance: {plant.GetModelInstanceName(instance)!r} has no joint {missing[0]!r} of "
            f"{arm.name}; give what {arm.name}'s add_to(plant) has returned"
        )
    motors = {m.joint().name() for m in motors_of(plant, instance) if m.has_controller()}
    if missing := [name for name in arm.joints if name not in motors]:
        raise InvalidInputError(
            f"plant: {missing[0]!r} of {arm.name} has no motor that follows a command; call "
            "add_motors(plant, instance, arm) before the plant is finalized"
        )
    R_WB = _base(arm, plant, instance).rotation().matrix()
    gravity = R_WB.T @ plant.gravity_field().gravity_vector()
    if np.abs(gravity - arm.gravity).max() > _GRAVITY:
        text = f"[{', '.join(f'{number:.6g}' for number in gravity.round(9) + 0.0)}]"
        raise InvalidInputError(
            f"arm.gravity: in the base frame of {arm.name} the plant has {text} m/s^2, and the arm "
            f"{arm.gravity.tolist()}; give arm.replace(gravity={text})"
        )


def _base(arm: Arm, plant: MultibodyPlant, instance: ModelInstanceIndex) -> RigidTransform:
    """Return the pose of an arm's base frame in the world of a plant."""
    own = arm.plant()
    here, there = own.CreateDefaultContext(), plant.CreateDefaultContext()
    plant.SetPositions(there, instance, own.GetPositions(here))
    X_WE = plant.GetFrameByName(arm.frame, instance).CalcPoseInWorld(there)
    return X_WE @ own.GetFrameByName(arm.frame).CalcPoseInWorld(here).inverse()
