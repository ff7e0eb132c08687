r"""A discrete MultibodyPlant with an arm, its motors and the surface that its tool touches.

Settings of an arm with full dynamics: its simulation and its motors.

Gains of motors, computed from the inertia that the motors move.

With the diagonal matrix R of the joints' largest inertias (`largest_inertia`) they are

.. math:: K = \omega^2 R, \qquad D = 2 \omega R.

The deviation e from a command at constant velocity then obeys M e'' + D e' + K e = 0. Where R - M
is positive semidefinite, as at all postures that R was taken from (at others but for a few per
cent), every mode of it has an M of mu <= 1 times its R, thus the decay rates
omega (1 +- sqrt(1 - mu)) / mu: none oscillates, and none is slower than omega / 2. Motors of equal
gains, in contrast, are too weak for the joints at the base of a large arm: slower than the feedback
of a law that measures the arm, they make the loop unstable.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import NoneType
from typing import Annotated, Any, Literal, NamedTuple

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
from pydrake.multibody.tree import (
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import DiagramBuilder

from ..environments import ContactModel, TouchedSurface
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    NonNegative,
    NonNegativeEach,
    Positive,
    PositiveEach,
    between,
    validated,
)
from ..inputs.keys import Meaning
from ..inputs.kinds import naming
from ..inputs.messages import require_type
from ..robot.arm import Arm
from ..robot.model.model import require_coarse
from ..robot.postures import largest_inertia
from ..robot.tool import Tool, find_tool

_Bandwidth = Annotated[Positive, between(1e-2, 1e5)]
# Least and largest gain of a motor: [Nm/rad] or [Nm s/rad].
_SOFTEST, _STIFFEST = 1e-3, 1e9


@validated
class PlantSettings:
    """Simulation and motor settings of an arm with full dynamics.

    Gains of the motors that are not given follow from the arm's inertia, see
    `drake_rnn.systems.plant`.
    """

    time_step: Annotated[Positive, Meaning("Time step of Drake's discrete plant.", unit="s")] = 1e-3
    contact_approximation: Annotated[
        Literal["lagged", "similar", "sap"],
        Meaning(
            "Drake's approximation of discrete contact; ``sap`` pushes sliding bodies apart "
            "because of its default relaxation time.",
        ),
    ] = "lagged"
    bandwidth: Annotated[
        _Bandwidth | None,
        Meaning("Rate at which the motors correct a deviation from their command.", unit="rad/s"),
    ] = None
    stiffness: Annotated[
        PositiveEach | None,
        Meaning(
            "Gain of each motor's position loop, one number for all or shape (n,); by default "
            "``bandwidth`` squared times the joint's largest inertia.",
            unit="Nm/rad",
        ),
    ] = None
    damping: Annotated[
        NonNegativeEach | None,
        Meaning(
            "Gain of each motor's velocity loop, one number for all or shape (n,); by default "
            "critical for ``stiffness`` and the joint's largest inertia.",
            unit="Nm s/rad",
        ),
    ] = None
    reflected_inertia: Annotated[
        NonNegative,
        between(0.0, 1e3),
        Meaning("Inertia of each motor's rotor as seen from the joint.", unit="kg m^2"),
    ] = 0.0

    def __post_init__(self) -> None:
        for name, gain in (("stiffness", self.stiffness), ("damping", self.damping)):
            if gain is not None and np.max(gain) > _STIFFEST:
                raise ValueError(f"{name}: may be at most {_STIFFEST:g}, not {np.max(gain):g}")
        if self.stiffness is not None and np.min(self.stiffness) < _SOFTEST:
            raise ValueError(
                f"stiffness: may be {_SOFTEST:g} or more, not {np.min(self.stiffness):g}"
            )
        if self.bandwidth is not None and self.stiffness is not None:
            raise ValueError(
                "bandwidth: cannot be combined with stiffness, which sets it; give one of them"
            )

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


#: Default of `PlantSettings.bandwidth` [rad/s].
BANDWIDTH = 100.0


class MotorGains(NamedTuple):
    """Gains of the n motors of an arm.

    Attributes:
        stiffness: Gains of the position loops, shape (n,) [Nm/rad].
        damping: Gains of the velocity loops, shape (n,) [Nm s/rad].
    """

    stiffness: Array
    damping: Array


def motor_gains(arm: Arm, settings: PlantSettings) -> MotorGains:
    """Return the gains of an arm's motors; those not given follow from its inertia.

    Args:
        arm: The arm.
        settings: Settings, with a number for all motors, one for each or None.

    Raises:
        InvalidInputError: If a gain is given for another number of joints.
    """
    stiffness, damping = (
        None if gain is None else arm.each(f"plant.{name}", gain)
        for name, gain in (("stiffness", settings.stiffness), ("damping", settings.damping))
    )
    if stiffness is not None and damping is not None:
        return MotorGains(stiffness, damping)
    inertia = largest_inertia(arm) + settings.reflected_inertia
    if stiffness is None:
        bandwidth = BANDWIDTH if settings.bandwidth is None else settings.bandwidth
        stiffness = bandwidth**2 * inertia
    if damping is None:
        damping = 2.0 * np.sqrt(stiffness * inertia)
    return MotorGains(stiffness, damping)


class AddedPlant(NamedTuple):
    """Parts added by `add_plant`.

    Attributes:
        plant, scene_graph, instance: The plant, its geometry, and the arm in it.
        gains: Gains of motors that follow a command; None of motors that do not.
        tool: The tool; None without a contact.
        carrier: Joints that carry a surface that moves; None for one that stands still.
    """

    plant: MultibodyPlant
    scene_graph: SceneGraph
    instance: ModelInstanceIndex
    gains: MotorGains | None
    tool: Tool | None
    carrier: ModelInstanceIndex | None = None


def add_plant(
    builder: DiagramBuilder,
    arm: Arm,
    start: Array,
    contact: TouchedSurface | None = None,
    settings: PlantSettings | None = None,
    *,
    follows: bool = True,
) -> AddedPlant:
    """Add a finalized plant, and leave the inputs of its motors unconnected.

    Args:
        builder: Diagram builder that the plant and its SceneGraph are added to.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
        contact: Contact of the tool with a `ContactModel`; None for an arm in free space.
        settings: Simulation and motor settings.
        follows: Whether the motors follow a command; else they exert the torques they are given.

    Raises:
        InvalidInputError: If the arm has a scaled mass, a joint that moves no mass or, for a
            contact, no tool; or if the environment's model cannot be read.
    """
    settings = PlantSettings() if settings is None else settings
    if arm.description.mass_scale != 1.0:
        level = "dynamic" if follows else "torque"
        raise InvalidInputError(
            f"arm.mass_scale: must be 1 at level: {level}, not {arm.description.mass_scale:g}"
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
    gains = None
    if follows:
        gains = add_motors(plant, instance, arm, settings)
    else:
        _add_actuators(plant, instance, arm, settings)
    tool = carrier = None
    if contact is not None and isinstance(contact.surface, ContactModel):
        tool = find_tool(plant, plant.GetFrameByName(arm.frame, instance))
        carrier = _add_surface(plant, scene_graph, contact, contact.surface, arm, start, tool)
    plant.Finalize()
    plant.SetDefaultPositions(instance, arm.posture(arm.plant(), start))
    return AddedPlant(plant, scene_graph, instance, gains, tool, carrier)


def _add_surface(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    contact: TouchedSurface,
    environment: ContactModel,
    arm: Arm,
    start: Array,
    tool: Tool,
) -> ModelInstanceIndex | None:
    """Add what the tool touches, and return the joints that carry it, if it moves."""
    p_WS, carrier = contact.place(arm, start), None
    before = set(_touchable(scene_graph))
    with naming(f"{type(environment).__name__}.add_to"):
        if contact.motion is None:
            environment.add_to(plant, p_WS)
        else:
            carrier, moving_body = _add_carrier(plant)
            carried: Any = environment
            carried.add_to(plant, p_WS, moving_body)
    around = [geometry for geometry in _touchable(scene_graph) if geometry not in before]
    _ignore_contact(scene_graph, before.difference(tool.geometries), around)
    _set_material(plant, scene_graph, tool, environment)
    if (mu := environment.friction) is not None:
        friction = {("material", "coulomb_friction"): CoulombFriction(mu, mu)}
        for geometry in (*tool.geometries, *around):
            _update(plant, scene_graph, geometry, friction)
    return carrier


# Mass of each body of a carrier [kg], and rate of its motors [rad/s]: 5 N move it by 2 nm.
_CARRIED, _HELD = 1e3, 1e3


def _add_carrier(plant: MultibodyPlant) -> tuple[ModelInstanceIndex, RigidBody]:
    """Add a body that motors move along the axes of the world, whatever presses on it."""
    instance = plant.AddModelInstance("surface_carrier")
    inertia = SpatialInertia.SolidSphereWithMass(_CARRIED, 0.1)
    parent = plant.world_body()
    for name, axis in zip("xyz", np.eye(3), strict=True):
        body = plant.AddRigidBody(f"surface_{name}", instance, inertia)
        joint = plant.AddJoint(
            PrismaticJoint(f"surface_{name}", parent.body_frame(), body.body_frame(), axis)
        )
        motor = plant.AddJointActuator(f"surface_{name}", joint)
        gain = 3.0 * _CARRIED
        motor.set_controller_gains(PdControllerGains(p=gain * _HELD**2, d=2.0 * gain * _HELD))
        parent = body
    plant.set_gravity_enabled(instance, False)
    return instance, parent


def motors_of(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[JointActuator]:
    """Return the actuators of one arm, also of a plant that is not yet finalized."""
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return [motor for motor in every if motor.model_instance() == instance]


def add_motors(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    arm: Arm,
    settings: PlantSettings | None = None,
) -> MotorGains:
    """Add motors that follow a command to an arm in a plant, before it is finalized.

    Each is a loop of position and velocity, within the effort limit of its joint.

    Args:
        plant: The plant.
        instance: What `Arm.add_to` has returned.
        arm: The arm.
        settings: Gains, or the bandwidth from which they follow.

    Returns:
        The gains.

    Raises:
        InvalidInputError: If the plant is finalized, or as `motor_gains` does.
    """
    require_type("plant", plant, MultibodyPlant)
    require_type("instance", instance, ModelInstanceIndex)
    require_type("arm", arm, Arm)
    require_type("settings", settings, PlantSettings, NoneType)
    if plant.is_finalized():
        raise InvalidInputError("plant: is finalized; add motors before")
    settings = PlantSettings() if settings is None else settings
    gains = motor_gains(arm, settings)
    motors = _add_actuators(plant, instance, arm, settings)
    for motor, p, d in zip(motors, *gains, strict=True):
        motor.set_controller_gains(PdControllerGains(p=p, d=d))
    return gains


def _add_actuators(
    plant: MultibodyPlant, instance: ModelInstanceIndex, arm: Arm, settings: PlantSettings
) -> list[JointActuator]:
    """Give each joint an actuator with its effort limit; return them in the order of joints."""
    own = {motor.joint().name(): motor for motor in motors_of(plant, instance)}
    motors = []
    for name, effort in zip(arm.joints, arm.effort, strict=True):
        joint = plant.GetJointByName(name, instance)
        motor = own.get(name) or plant.AddJointActuator(f"{name}_motor", joint)
        # A file of limits may know better than the model.
        motor.set_effort_limit(effort)
        if settings.reflected_inertia > 0.0:
            motor.set_default_gear_ratio(1.0)
            motor.set_default_rotor_inertia(settings.reflected_inertia)
        motors.append(motor)
    return motors


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
    exclusion = CollisionFilterDeclaration().ExcludeBetween(*between)
    scene_graph.collision_filter_manager().Apply(exclusion)


def _set_material(
    plant: MultibodyPlant, scene_graph: SceneGraph, tool: Tool, environment: ContactModel
) -> None:
    """Set those material properties of the tool that the environment specifies."""
    material = environment.tip
    if material is None:
        return
    properties = {
        ("hydroelastic", "hydroelastic_modulus"): material.hydroelastic_modulus,
        ("hydroelastic", "resolution_hint"): material.mesh_resolution,
        ("material", "hunt_crossley_dissipation"): material.dissipation,
    }
    changes = {place: value for place, value in properties.items() if value is not None}
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
