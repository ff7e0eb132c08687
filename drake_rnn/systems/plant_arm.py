"""The arm with full dynamics: motors that are told where to be, gravity, and contact."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydrake.geometry import ProximityProperties, RoleAssign, SceneGraph
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import JointActuator, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer

from ..arms import Arm
from ..environments.contact_model import ContactModel
from ..errors import InvalidInputError
from ..fields import Array, NonNegative, Positive, validated
from ..tool import Tool, find_tool
from .contact_force import ContactForce
from .dynamics import Dynamics
from .tool_force import ToolForce


@validated
class PlantSettings:
    """How an arm with full dynamics is simulated and driven.

    Args:
        time_step: Of Drake's discrete plant [s].
        contact_approximation: Drake's; ``sap`` pushes sliding bodies apart by its default
            relaxation time.
        stiffness: Of each motor's position loop [Nm/rad].
        damping: Of each motor's velocity loop [Nm s/rad].
        reflected_inertia: Of each motor's rotor, seen from the joint [kg m^2].
    """

    time_step: Positive = 1e-3
    contact_approximation: Literal["lagged", "similar", "sap"] = "lagged"
    stiffness: Positive = 2000.0
    damping: NonNegative = 60.0
    reflected_inertia: NonNegative = 0.0


class PlantArm(Diagram):
    """A `Mirror` with mass: a discrete MultibodyPlant whose motors follow what is commanded.

    Each motor is a position and velocity loop, with the torque that gravity asks for fed
    forward; torques end at the effort limits of the model's actuators, and a joint to which it
    gives none gets one without a limit. Inputs are ``position_commanded`` and
    ``velocity_commanded``, outputs ``position`` and ``velocity``, of shape (n,)
    [rad, rad/s]; and with an environment ``tool_force`` and ``contact_force``, of shape (3,)
    [N] in the world frame: what the surroundings exert on the tool, as a force-torque sensor
    feels it, and as the contact knows it. All are those of the plant's last step.

    Args:
        arm: The arm; all joints of its model that move must be controlled.
        start: Posture to start from, shape (n,) [rad].
        environment: What the tool touches.
        p_WS: The point of its surface below the tool at the start, shape (3,) [m].
        settings: How it is simulated.

    Attributes:
        plant: The plant.
        scene_graph: Its geometry, e.g. for a visualizer.

    Raises:
        InvalidInputError: If the arm has other joints that move, a scaled mass or, for an
            environment, no tool; or the environment's model cannot be read.
    """

    def __init__(
        self,
        arm: Arm,
        start: Array,
        environment: ContactModel | None = None,
        p_WS: Array | None = None,
        settings: PlantSettings | None = None,
    ) -> None:
        super().__init__()
        settings = PlantSettings() if settings is None else settings
        if arm.description.mass_scale != 1.0:
            raise InvalidInputError(
                "arm.mass_scale: only for an arm at the kinematic level, not "
                f"{arm.description.mass_scale:g}"
            )
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=settings.time_step,
            discrete_contact_approximation=settings.contact_approximation,
        )
        self.plant, self.scene_graph = AddMultibodyPlant(config, builder)
        plant = self.plant
        instance = arm.add_to(plant)
        plant.mutable_gravity_field().set_gravity_vector(arm.gravity)
        _add_motors(plant, arm, instance, settings)
        tool = None
        if environment is not None:
            if p_WS is None:
                raise InvalidInputError("p_WS: must be given with an environment")
            tool = find_tool(plant, plant.GetFrameByName(arm.frame, instance))
            _set_material(plant, self.scene_graph, tool, environment)
            environment.add_to(plant, p_WS)
        plant.Finalize()
        moving = plant.num_positions(instance)
        if moving != arm.n or plant.num_velocities(instance) != arm.n:
            raise InvalidInputError(
                f"arm: {moving} joints of {arm.name} move and {arm.n} are controlled; at the "
                "dynamic level fix the others in the model"
            )
        plant.SetDefaultPositions(instance, arm.posture(arm.plant(), start))
        self._drive(builder, arm, instance)
        if tool is not None:
            self._feel(builder, arm, tool)
        builder.BuildInto(self)

    def _drive(self, builder: DiagramBuilder, arm: Arm, instance: ModelInstanceIndex) -> None:
        """Motors, in the model's order of actuators, and what they do, in the arm's of joints."""
        plant, n = self.plant, arm.n
        starts = [plant.GetJointByName(name, instance).velocity_start() for name in arm.joints]
        # The plant's state is ordered by joints, what drives it by actuators.
        select = np.eye(n)[np.argsort(starts)]
        motors = [motor.joint().name() for motor in _motors(plant, instance)]
        to_motors = np.eye(n)[[arm.joints.index(name) for name in motors]]
        nothing = np.zeros((n, n))

        state = plant.get_state_output_port(instance)
        for name, pick in (
            ("position", np.hstack((select.T, nothing))),
            ("velocity", np.hstack((nothing, select.T))),
        ):
            block = builder.AddNamedSystem(name, MatrixGain(pick))
            builder.Connect(state, block.get_input_port())
            builder.ExportOutput(block.get_output_port(), name)
        joined = builder.AddNamedSystem("commanded", Multiplexer([n, n]))
        order = np.block([[to_motors, nothing], [nothing, to_motors]])
        commanded = builder.AddNamedSystem("motor_order", MatrixGain(order))
        builder.ExportInput(joined.get_input_port(0), "position_commanded")
        builder.ExportInput(joined.get_input_port(1), "velocity_commanded")
        builder.Connect(joined.get_output_port(), commanded.get_input_port())
        builder.Connect(commanded.get_output_port(), plant.get_desired_state_input_port(instance))

        dynamics = builder.AddNamedSystem("gravity", Dynamics(arm))
        self._position = builder.GetSubsystemByName("position").get_output_port()
        builder.Connect(self._position, dynamics.GetInputPort("position"))
        builder.Connect(
            builder.GetSubsystemByName("velocity").get_output_port(),
            dynamics.GetInputPort("velocity"),
        )
        against = builder.AddNamedSystem("against_gravity", MatrixGain(-to_motors))
        builder.Connect(dynamics.GetOutputPort("gravity"), against.get_input_port())
        builder.Connect(against.get_output_port(), plant.get_actuation_input_port(instance))

    def _feel(self, builder: DiagramBuilder, arm: Arm, tool: Tool) -> None:
        plant = self.plant
        sensor = ToolForce(arm, tool.body.name(), _reaction_index(plant, tool), tool.mass)
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


def _motors(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[JointActuator]:
    """Of one arm; before a plant is finalized it does not know them by instance."""
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return [motor for motor in every if motor.model_instance() == instance]


def _add_motors(
    plant: MultibodyPlant, arm: Arm, instance: ModelInstanceIndex, settings: PlantSettings
) -> None:
    motors = {motor.joint().name(): motor for motor in _motors(plant, instance)}
    for name in arm.joints:
        joint = plant.GetJointByName(name, instance)
        motor = motors.get(name) or plant.AddJointActuator(f"{name}_motor", joint)
        motor.set_controller_gains(PdControllerGains(p=settings.stiffness, d=settings.damping))
        if settings.reflected_inertia > 0.0:
            motor.set_default_gear_ratio(1.0)
            motor.set_default_rotor_inertia(settings.reflected_inertia)


def _set_material(
    plant: MultibodyPlant, scene_graph: SceneGraph, tool: Tool, environment: ContactModel
) -> None:
    """The tool's material, but for what the environment leaves as it is."""
    material = environment.tip
    changes: dict[tuple[str, str], Any] = {}
    if material is not None:
        changes = {
            ("hydroelastic", "hydroelastic_modulus"): material.hydroelastic_modulus,
            ("hydroelastic", "resolution_hint"): material.mesh_resolution,
            ("material", "hunt_crossley_dissipation"): material.dissipation,
        }
    if environment.friction is not None:
        friction = CoulombFriction(environment.friction, environment.friction)
        changes["material", "coulomb_friction"] = friction
    inspector = scene_graph.model_inspector()
    for geometry in tool.geometries:
        properties = ProximityProperties(inspector.GetProximityProperties(geometry))
        for (group, name), value in changes.items():
            if value is not None:
                properties.UpdateProperty(group, name, value)
        scene_graph.AssignRole(plant.get_source_id(), geometry, properties, RoleAssign.kReplace)


def _reaction_index(plant: MultibodyPlant, tool: Tool) -> int:
    """Where the reaction at the tool's joint stands among those of all joints."""
    return [int(index) for index in plant.GetJointIndices()].index(int(tool.joint.index()))
