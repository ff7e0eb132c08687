"""Points brought onto a surface."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from ..environments import ModelSurface, Plate, Surface
from ..inputs.fields import Array

# A model is looked for as far as this below and above the plane that it is taken for [m].
_REACH = 0.3
_NEAR_ENOUGH = 1e-6
_MOST_STEPS = 60


def within_edges(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Points of a plane, shape (k, 3) [m], moved to a plate's edges if they are beyond them.

    There a ball touches that rolls over an edge.
    """
    if not isinstance(surface, Plate):
        return points
    pose = surface.pose(p_WS)
    p_P = (points - pose.translation()) @ pose.rotation().matrix()
    p_P[:, :2] = np.clip(p_P[:, :2], -surface.size / 2.0, surface.size / 2.0)
    return np.asarray(p_P @ pose.rotation().matrix().T + pose.translation())


def on_surface(points: Array, surface: Surface, p_WS: Array) -> Array:
    """Points moved along the normal onto the surface.

    Args:
        points: Shape (k, 3) [m].
        surface: A plane, or a model that may be curved; beyond the model its plane is meant.
        p_WS: The point of it below the tool at the start, shape (3,) [m].

    Returns:
        Shape (k, 3) [m].
    """
    n = surface.normal_W
    plane = points - np.outer((points - p_WS) @ n, n)
    if not isinstance(surface, ModelSurface):
        return plane
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    surface.add_to(plant, p_WS)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))

    def height(point: Array) -> float:
        """Of the model over its plane: no nearer than its distance can it be."""
        above = 0.0
        for _ in range(_MOST_STEPS):
            found = query.ComputeSignedDistanceToPoint(point + above * n)
            distance = min((each.distance for each in found), default=np.inf)
            above -= distance
            if abs(distance) < _NEAR_ENOUGH:
                return above
            if abs(above) > _REACH:
                break
        return 0.0

    return plane + np.outer([height(point) for point in plane], n)
