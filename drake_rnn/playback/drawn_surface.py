"""The surface in the scene that a tool presses on."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import (
    Box,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from ..environments import ModelSurface, Plate
from ..inputs.fields import Array
from .pressing import Pressing

_PLATE = Rgba(0.94, 0.91, 0.85)
# What has no thickness of its own is seen through.
_SHEET = Rgba(0.94, 0.91, 0.85, 0.6)
_SHEET_THICKNESS = 0.005
_CORNERS = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), axis=-1).reshape(8, 3)


def draw_surface(meshcat: Meshcat, pressing: Pressing) -> Array:
    """Draw it below "/surface".

    Returns:
        Corners of boxes round it, shape (k, 3) [m].
    """
    surface = pressing.surface
    if isinstance(surface, ModelSurface):
        corners = _draw_model(meshcat, surface, pressing.p_WS)
        if len(corners):
            return corners
    plate = surface if isinstance(surface, Plate) else _sheet(pressing)
    box = Box(plate.size, plate.size, plate.thickness)
    pose = plate.pose(pressing.p_WS)
    meshcat.SetObject("/surface/plate", box, _PLATE if plate is surface else _SHEET)
    meshcat.SetTransform("/surface/plate", pose)
    return _corners(pose, box.size() / 2.0)


def _sheet(pressing: Pressing) -> Plate:
    """A thin plate in the place of a surface without an end: wide enough for what is drawn."""
    drawn = np.concatenate((pressing.lap, pressing.trace))
    middle = (drawn.min(axis=0) + drawn.max(axis=0)) / 2.0
    n, offset = pressing.normal, middle - pressing.p_WS
    return Plate(
        normal=n,
        size=2.0 * float(np.linalg.norm(drawn - middle, axis=1).max()) + 0.16,
        thickness=_SHEET_THICKNESS,
        offset=offset - n.dot(offset) * n,
    )


def _draw_model(meshcat: Meshcat, surface: ModelSurface, p_WS: Array) -> Array:
    """The model as its file shows it, or else what of it can be touched."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    surface.add_to(plant, p_WS)
    plant.Finalize()
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


def _corners(X_WB: RigidTransform, half: Array) -> Array:
    return np.asarray(X_WB.multiply((_CORNERS * half).T).T)
