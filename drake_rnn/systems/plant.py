"""A discrete MultibodyPlant with an arm, its motors and the surface that its tool touches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    RoleAssign,
    SceneGraph,
)
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import JointActuator, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import DiagramBuilder

from ..environments import ContactModel
from ..errors import InvalidInputError
from ..inputs.fields import Array, NonNegative, Positive, validated
from ..robot.arm import Arm
from ..robot.tool import Tool, find_tool
from .contact import Contact


@validated
class PlantSettings:
    """Simulation and motor settings of an arm with full dynamics.

    Args:
        time_step: Time step of Drake's discrete plant [s].
        contact_approximation: Drake's approximation of discrete contact; ``sap`` pushes sliding
            bodies apart because of its default relaxation time.
        stiffness: Gain of each motor's position loop [Nm/rad].
        damping: Gain of each motor's velocity loop [Nm s/rad].
        reflected_inertia: Inertia of each motor's rotor as seen from the joint [kg m^2].
    """

    time_step: Positive = 1e-3
    contact_approximation: Literal["lagged", "similar", "sap"] = "lagged"
    stiffness: Positive = 2000.0
    damping: NonNegative = 60.0
    reflected_inertia: NonNegative = 0.0

    def check_period(self, period: float | None) -> None:
        """Raise an InvalidInputError if the time step is longer than the controller's period.

        Args:
            period: Sampling period of the controller [s]; None if Drake integrates it.
        """
        if period is not None and self.time_step > period:
            raise InvalidInputError(
                f"plant.time_step: may be at most the controller's period, {period:g} s, "
                f"not {self.time_step:g}"
            )


class AddedPlant(NamedTuple):
    """Parts added by `add_plant`; ``tool`` is None without a contact."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    instance: ModelInstanceIndex
    tool: Tool | None


def add_plant(
    builder: DiagramBuilder,
    arm: Arm,
    start: Array,
    contact: Contact | None = None,
    settings: PlantSettings | None = None,
) -> AddedPlant:
    """Add a finalized plant, and leave the inputs of its motors unconnected.

    Args:
        builder: Diagram builder that the plant and its SceneGraph are added to.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
        contact: Contact of the tool with a `ContactModel`; None for an arm in free space.
        settings: Simulation and motor settings.

    Raises:
        InvalidInputError: If the arm has a scaled mass, a joint that moves no mass or, for a
            contact, no tool; or if the environment's model cannot be read.
    """
    settings = PlantSettings() if settings is None else settings
    if arm.description.mass_scale != 1.0:
        raise InvalidInputError(
            f"arm.mass_scale: must be 1 at level: dynamic, not {arm.description.mass_scale:g}"
        )
    _require_inertia(arm, start)
    config = MultibodyPlantConfig(
        time_step=settings.time_step,
        discrete_contact_approximation=settings.contact_approximation,
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    instance = arm.add_to(plant)
    _ignore_self_contact(scene_graph)
    plant.mutable_gravity_field().set_gravity_vector(arm.gravity)
    _add_motors(plant, arm, instance, settings)
    tool = None
    if contact is not None and isinstance(environment := contact.surface, ContactModel):
        p_WS = contact.place(arm, start)
        tool = find_tool(plant, plant.GetFrameByName(arm.frame, instance))
        known = set(_touchable(scene_graph))
        environment.add_to(plant, p_WS)
        around = [geometry for geometry in _touchable(scene_graph) if geometry not in known]
        _set_material(plant, scene_graph, tool, environment)
        if environment.friction is not None:
            for geometry in (*tool.geometries, *around):
                _set_friction(plant, scene_graph, geometry, environment.friction)
    plant.Finalize()
    plant.SetDefaultPositions(instance, arm.posture(arm.plant(), start))
    return AddedPlant(plant, scene_graph, instance, tool)


def motors_of(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[JointActuator]:
    """Return the actuators of one arm, also of a plant that is not yet finalized."""
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return [motor for motor in every if motor.model_instance() == instance]


def _add_motors(
    plant: MultibodyPlant, arm: Arm, instance: ModelInstanceIndex, settings: PlantSettings
) -> None:
    motors = {motor.joint().name(): motor for motor in motors_of(plant, instance)}
    for name in arm.joints:
        joint = plant.GetJointByName(name, instance)
        motor = motors.get(name) or plant.AddJointActuator(f"{name}_motor", joint)
        motor.set_controller_gains(PdControllerGains(p=settings.stiffness, d=settings.damping))
        if settings.reflected_inertia > 0.0:
            motor.set_default_gear_ratio(1.0)
            motor.set_default_rotor_inertia(settings.reflected_inertia)


def _require_inertia(arm: Arm, start: Array) -> None:
    """Raise an InvalidInputError if a joint moves links without inertia, as some models have."""
    inertia = np.diag(arm.kinematics().M(start))
    least = int(np.argmin(inertia))
    if inertia[least] <= 0.0:
        raise InvalidInputError(
            f"arm.model: no link that {arm.joints[least]!r} of {arm.name} moves has any inertia, "
            "which level: dynamic needs; give the model's links their inertial data"
        )


def _ignore_self_contact(scene_graph: SceneGraph) -> None:
    """Let an arm's parts pass through each other: simplified shapes of neighbours overlap."""
    parts = GeometrySet(_touchable(scene_graph))
    scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(parts))


def _set_material(
    plant: MultibodyPlant, scene_graph: SceneGraph, tool: Tool, environment: ContactModel
) -> None:
    """Set those material properties of the tool that the environment specifies."""
    material = environment.tip
    if material is None:
        return
    given = {
        ("hydroelastic", "hydroelastic_modulus"): material.hydroelastic_modulus,
        ("hydroelastic", "resolution_hint"): material.mesh_resolution,
        ("material", "hunt_crossley_dissipation"): material.dissipation,
    }
    changes = {place: value for place, value in given.items() if value is not None}
    for geometry in tool.geometries:
        _update(plant, scene_graph, geometry, changes)


def _set_friction(
    plant: MultibodyPlant, scene_graph: SceneGraph, geometry: GeometryId, friction: float
) -> None:
    changes = {("material", "coulomb_friction"): CoulombFriction(friction, friction)}
    _update(plant, scene_graph, geometry, changes)


def _update(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    geometry: GeometryId,
    changes: Mapping[tuple[str, str], Any],
) -> None:
    present = scene_graph.model_inspector().GetProximityProperties(geometry)
    properties = ProximityProperties(present)
    for (group, name), value in changes.items():
        properties.UpdateProperty(group, name, value)
    scene_graph.AssignRole(plant.get_source_id(), geometry, properties, RoleAssign.kReplace)


def _touchable(scene_graph: SceneGraph) -> list[GeometryId]:
    """Return all geometries that can be in contact."""
    every = GeometrySet(scene_graph.model_inspector().GetAllGeometryIds())
    return list(scene_graph.model_inspector().GetGeometryIds(every, Role.kProximity))
