"""A discrete MultibodyPlant with an arm, its motors and the surface that its tool touches."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    RoleAssign,
    SceneGraph,
    Sphere,
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
from ..inputs.fields import Array
from ..inputs.own_code import naming
from ..robot.arm import Arm
from ..robot.contact_mesh import require_coarse
from ..robot.tool import Tool, find_tool
from .contact import Contact
from .motor_gains import MotorGains, motor_gains
from .plant_settings import PlantSettings


class AddedPlant(NamedTuple):
    """Parts added by `add_plant`; ``tool`` is None without a contact."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    instance: ModelInstanceIndex
    gains: MotorGains
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
    gains = motor_gains(arm, settings)
    _add_motors(plant, arm, instance, gains, settings.reflected_inertia)
    tool = None
    if contact is not None and isinstance(environment := contact.surface, ContactModel):
        p_WS = contact.place(arm, start)
        tool = find_tool(plant, plant.GetFrameByName(arm.frame, instance))
        known = set(_touchable(scene_graph))
        with naming(f"{type(environment).__name__}.add_to"):
            environment.add_to(plant, p_WS)
        around = [geometry for geometry in _touchable(scene_graph) if geometry not in known]
        _ignore_contact(scene_graph, known.difference(tool.geometries), around)
        _set_material(plant, scene_graph, tool, environment)
        if (mu := environment.friction) is not None:
            friction = {("material", "coulomb_friction"): CoulombFriction(mu, mu)}
            for geometry in (*tool.geometries, *around):
                _update(plant, scene_graph, geometry, friction)
    plant.Finalize()
    plant.SetDefaultPositions(instance, arm.posture(arm.plant(), start))
    return AddedPlant(plant, scene_graph, instance, gains, tool)


def motors_of(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[JointActuator]:
    """Return the actuators of one arm, also of a plant that is not yet finalized."""
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return [motor for motor in every if motor.model_instance() == instance]


def _add_motors(
    plant: MultibodyPlant,
    arm: Arm,
    instance: ModelInstanceIndex,
    gains: MotorGains,
    reflected_inertia: float,
) -> None:
    motors = {motor.joint().name(): motor for motor in motors_of(plant, instance)}
    for name, effort, p, d in zip(arm.joints, arm.effort, *gains, strict=True):
        joint = plant.GetJointByName(name, instance)
        motor = motors.get(name) or plant.AddJointActuator(f"{name}_motor", joint)
        # A file of limits may know better than the model.
        motor.set_effort_limit(effort)
        motor.set_controller_gains(PdControllerGains(p=p, d=d))
        if reflected_inertia > 0.0:
            motor.set_default_gear_ratio(1.0)
            motor.set_default_rotor_inertia(reflected_inertia)


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


def _ignore_contact(
    scene_graph: SceneGraph, parts: Iterable[GeometryId], around: Iterable[GeometryId]
) -> None:
    """Let all parts of the arm but its tool pass through the surroundings.

    Whether a link has collision geometry depends on the maker of its model.
    """
    between = GeometrySet(list(parts)), GeometrySet(list(around))
    filtered = CollisionFilterDeclaration().ExcludeBetween(*between)
    scene_graph.collision_filter_manager().Apply(filtered)


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
        shape = scene_graph.model_inspector().GetShape(geometry)
        if material.mesh_resolution is not None and isinstance(shape, Sphere):
            key = "environment.tip.mesh_resolution"
            require_coarse(key, material.mesh_resolution, shape.radius())
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
