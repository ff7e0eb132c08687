"""The surface that a tool presses against: drawn in the scene, and points brought onto it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from .. import colours
from ..environments import ModelSurface, Plate, Surface
from ..inputs.fields import Array
from ..systems.block import release

_PLATE = Rgba(*colours.components(colours.SURFACE))
_STAND = Rgba(*colours.components(colours.ARM_DARK))
# Radius of a post below a plate, relative to the plate's edge.
_POST = 0.06
# A surface without a thickness is drawn as a transparent sheet: its thickness, and how much wider
# than the drawing it is [m].
_SHEET = Rgba(*colours.components(colours.SURFACE), 0.6)
_SHEET_THICKNESS, _SHEET_MARGIN = 0.005, 0.16
_CORNERS = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)

# The surface of a model is searched for up to this distance from the model's plane [m].
_REACH = 0.3
_TOLERANCE = 1e-6
_MOST_STEPS = 60


def draw_surface(meshcat: Meshcat, surface: Surface, p_WS: Array, drawing: Array) -> Array:
    """Draw a surface below "/surface".

    Args:
        meshcat: Meshcat with the scene.
        surface: The surface.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        drawing: Points of what is drawn on it, shape (k, 3) [m]: a surface without edges is shown
            as far as they reach.

    Returns:
        Corners of boxes round the surface, shape (k, 3) [m].
    """
    if isinstance(surface, ModelSurface):
        corners = _draw_model(meshcat, surface, p_WS)
        if len(corners):
            return corners
    plate = surface if isinstance(surface, Plate) else _sheet(surface.normal_W, p_WS, drawing)
    box = Box(plate.size, plate.size, plate.thickness)
    pose = plate.pose(p_WS)
    meshcat.SetObject("/surface/plate", box, _PLATE if plate is surface else _SHEET)
    meshcat.SetTransform("/surface/plate", pose)
    return _corners(pose, box.size() / 2.0)


def draw_stand(meshcat: Meshcat, surface: Surface, p_WS: Array, floor: float) -> None:
    """Draw a post from the ground to the middle of a plate, which shows how the plate is inclined.

    Args:
        meshcat: Meshcat with the scene.
        surface: The surface; only a plate gets a post.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        floor: Height of the ground [m].
    """
    if not isinstance(surface, Plate):
        return
    x, y, z = surface.pose(p_WS).translation()
    if (height := float(z) - floor) > surface.thickness:
        radius = _POST * surface.size
        meshcat.SetObject("/stand", Cylinder(radius, height), _STAND)
        meshcat.SetTransform("/stand", RigidTransform([x, y, floor + height / 2.0]))


def clipped_to_edges(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Move points of a surface that lie beyond a plate's edges to the edges.

    A ball that rolls over an edge touches the plate there.

    Args:
        points: Points in the plane of the surface, shape (k, 3) [m].
        surface: The surface; only a plate has edges.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Returns:
        Shape (k, 3) [m].
    """
    if not isinstance(surface, Plate):
        return points
    pose = surface.pose(p_WS)
    p_P = (points - pose.translation()) @ pose.rotation().matrix()
    p_P[:, :2] = np.clip(p_P[:, :2], -surface.size / 2.0, surface.size / 2.0)
    return np.asarray(p_P @ pose.rotation().matrix().T + pose.translation())


def projected(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Move points along the normal onto a surface.

    Args:
        points: Shape (k, 3) [m].
        surface: A plane, or a model that may be curved; beyond the model, the model's plane.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Returns:
        Shape (k, 3) [m].
    """
    n = surface.normal_W
    plane = points - np.outer((points - p_WS) @ n, n)
    if not isinstance(surface, ModelSurface):
        return plane
    builder, _, scene_graph = _model_scene(surface, p_WS)
    diagram = builder.Build()
    release(diagram)
    root = diagram.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))

    def height(point: Array) -> float:
        """Return the height of the model above its plane [m]; 0 where there is no model."""
        above = 0.0
        for _ in range(_MOST_STEPS):
            # Sphere tracing: a step as long as the distance never passes the surface.
            found = query.ComputeSignedDistanceToPoint(point + above * n)
            distance = min((each.distance for each in found), default=np.inf)
            above -= distance
            if abs(distance) < _TOLERANCE:
                return above
            if abs(above) > _REACH:
                break
        return 0.0

    return plane + np.outer([height(point) for point in plane], n)


def _sheet(n: Array, p_WS: Array, drawing: Array) -> Plate:
    """Return a thin plate with normal ``n``, wide enough for the drawing on it."""
    middle = (drawing.min(axis=0) + drawing.max(axis=0)) / 2.0
    offset = middle - p_WS
    return Plate(
        normal=n,
        size=2.0 * float(np.linalg.norm(drawing - middle, axis=1).max()) + _SHEET_MARGIN,
        thickness=_SHEET_THICKNESS,
        offset=offset - n.dot(offset) * n,
    )


def _draw_model(meshcat: Meshcat, surface: ModelSurface, p_WS: Array) -> Array:
    """Draw a model's illustration geometry, or its collision geometry if it has no other.

    Returns:
        Corners of boxes round its parts, shape (k, 3) [m]; none if it has no geometry.
    """
    builder, plant, scene_graph = _model_scene(surface, p_WS)
    inspector = scene_graph.model_inspector()
    parameters = MeshcatVisualizerParams()
    parameters.prefix = "/surface"
    parameters.default_color = _PLATE
    for role in (Role.kIllustration, Role.kProximity):
        shown = [
            (frame, geometry)
            for frame in inspector.GetAllFrameIds()
            for geometry in inspector.GetGeometries(frame, role)
        ]
        if shown:
            parameters.role = role
            break
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    diagram = builder.Build()
    release(diagram)
    context = diagram.CreateDefaultContext()
    diagram.ForcedPublish(context)
    plant_context = plant.GetMyContextFromRoot(context)
    corners = [np.zeros((0, 3))]
    for frame, geometry in shown:
        if (box := inspector.GetObbInGeometryFrame(geometry)) is not None:
            X_WB = plant.GetBodyFromFrameId(frame).EvalPoseInWorld(plant_context)
            X_BG = inspector.GetPoseInFrame(geometry)
            corners.append(_corners(X_WB @ X_BG @ box.pose(), box.half_width()))
    return np.concatenate(corners)


def _model_scene(surface: ModelSurface, p_WS: Array) -> tuple[DiagramBuilder, Any, SceneGraph]:
    """Return a builder, the plant and the scene graph that contain the model alone."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
    surface.add_to(plant, p_WS)
    plant.Finalize()
    return builder, plant, scene_graph


def _corners(X_WB: RigidTransform, half: Array) -> Array:
    """Return the corners of a box from its pose and half its extents, shape (8, 3) [m]."""
    return np.asarray(X_WB.multiply((_CORNERS * half).T).T)
