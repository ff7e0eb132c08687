"""The tool of an arm: the body that makes contact, and the joint that carries it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId, Role, SceneGraph, SceneGraphInspector, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Body, Frame, Joint
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .arm import Arm
from .kinematics import holders


@dataclass(frozen=True)
class Tool:
    """The tool of an arm in a plant.

    Attributes:
        body: Body that makes contact.
        joint: Joint by which the arm holds the body, usually a weld; a force-torque sensor would
            sit there.
        mass: Mass of everything that the joint carries [kg].
        geometries: Collision geometries of the body.
    """

    body: Body
    joint: Joint
    mass: float
    geometries: tuple[GeometryId, ...]


def find_tool(plant: MultibodyPlant, frame: Frame) -> Tool:
    """Return the tool: the first body from ``frame`` towards the base with collision geometry.

    Args:
        plant: Plant, registered with a SceneGraph.
        frame: Task frame E of an arm.

    Raises:
        InvalidInputError: If no such body moves with the frame, or no joint holds it.
    """
    held_by, body = holders(plant), frame.body()
    while not (geometries := plant.GetCollisionGeometriesForBody(body)):
        holder = held_by.get(body.index())
        if holder is None or holder.num_positions():
            raise InvalidInputError(
                f"arm.frame: nothing that moves with {frame.name()!r} has collision geometry; "
                "contact needs a tool's frame, e.g. tip, or a tool to be added: arm.tool"
            )
        body = holder.parent_body()
    if body.index() not in held_by:
        raise InvalidInputError(f"arm.frame: {body.name()!r} is not held by any joint")
    joint = held_by[body.index()]
    mass, queue = 0.0, [body]
    while queue:
        part = queue.pop()
        mass += part.default_mass()
        queue += [j.child_body() for j in held_by.values() if j.parent_body() == part]
    return Tool(body, joint, mass, tuple(geometries))


def bodies_at_tip(arm: Arm) -> frozenset[str]:
    """Return the names of the bodies from E's to the tool, which alone touch what is pressed on.

    Of an arm without a tool they are those from E's to the last joint.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_to(plant)
    plant.Finalize()
    held_by, body = holders(plant), plant.GetFrameByName(arm.frame).body()
    names = [body.name()]
    while not plant.GetCollisionGeometriesForBody(body):
        holder = held_by.get(body.index())
        if holder is None or holder.num_positions():
            break
        body = holder.parent_body()
        names.append(body.name())
    del plant, body, held_by  # they point to the scene graph, which must outlive them
    return frozenset(names)


def standoff(arm: Arm, q: Array, normal: Array) -> float:
    """Return the distance from E's origin to the tool's outermost point against ``normal`` [m].

    Args:
        arm: The arm.
        q: Joint positions, shape (n,) [rad].
        normal: Unit normal of a surface, towards the tool, in the base frame, shape (3,).

    Raises:
        InvalidInputError: If the arm has no tool, or the tool does not consist of balls only.
    """
    with _scene(arm, q) as scene:
        return float(np.max(_reaches(scene, normal)))


def beyond_tool(arm: Arm, q: Array, normal: Array) -> dict[str, float]:
    """Return bodies next to the tool that reach farther against ``normal`` than it does.

    Only bodies that move with the tool count, by the boxes round what is drawn of them.

    Args:
        arm: The arm.
        q: Joint positions, shape (n,) [rad].
        normal: Unit normal of a surface, towards the tool, in the base frame, shape (3,).

    Returns:
        How much farther, by the body's name [m].

    Raises:
        InvalidInputError: If the arm has no tool.
    """
    with _scene(arm, q) as scene:
        plant, tool = scene.plant, scene.tool
        outermost = max(_extents(scene, tool.body, tool.geometries, normal))
        entries = {}
        for body in plant.GetBodiesWeldedTo(tool.body):
            frame = plant.GetBodyFrameIdOrThrow(body.index())
            geometries = scene.inspector.GetGeometries(frame, Role.kIllustration)
            extents = _extents(scene, body, geometries, normal)
            if body.index() != tool.body.index() and max(extents, default=-np.inf) > outermost:
                entries[body.name()] = max(extents) - outermost
        return entries


@dataclass(frozen=True)
class _Scene:
    """An arm with its geometry in a posture, its tool, and the origin of E, shape (3,) [m]."""

    plant: MultibodyPlant
    inspector: SceneGraphInspector
    context: Context
    tool: Tool
    p_WE: Array


@contextmanager
def _scene(arm: Arm, q: Array) -> Iterator[_Scene]:
    """Yield what the functions of this file see of an arm in a posture."""
    scene_graph = SceneGraph()
    plant = MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_to(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, q))
    E = plant.GetFrameByName(arm.frame)
    p_WE, inspector = E.CalcPoseInWorld(context).translation(), scene_graph.model_inspector()
    yield _Scene(plant, inspector, context, find_tool(plant, E), p_WE)
    del plant, E  # they point to the scene graph, which must outlive them


def _reaches(scene: _Scene, normal: Array) -> list[float]:
    """Return how far each ball of the tool reaches from E's origin against ``normal`` [m]."""
    tool, X_WB = scene.tool, scene.tool.body.EvalPoseInWorld(scene.context)
    reach = []
    for geometry in tool.geometries:
        shape = scene.inspector.GetShape(geometry)
        if not isinstance(shape, Sphere):
            raise InvalidInputError(
                f"environment.standoff: must be given for the tool {tool.body.name()!r}, which is "
                "not made of balls only"
            )
        centre = X_WB.multiply(scene.inspector.GetPoseInFrame(geometry).translation())
        reach.append(shape.radius() - float(normal.dot(centre - scene.p_WE)))
    return reach


def _extents(
    scene: _Scene, body: Body, geometries: Iterable[GeometryId], normal: Array
) -> list[float]:
    """Return how far the boxes round geometries reach from E's origin against ``normal`` [m]."""
    X_WB, inspector = body.EvalPoseInWorld(scene.context), scene.inspector
    extents = []
    for geometry in geometries:
        if (box := inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_WG = X_WB.multiply(inspector.GetPoseInFrame(geometry)).multiply(box.pose())
            half = np.abs(normal @ X_WG.rotation().matrix()) @ box.half_width()
            extents.append(float(half - normal.dot(X_WG.translation() - scene.p_WE)))
    return extents
