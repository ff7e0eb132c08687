"""What a surface is to the bodies of an arm that do not press on it: solids that are in the way."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.geometry import GeometryId, Role, SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.clearance.model_obstacle import solid_round
from ..robot.clearance.obstacles import MOST, Obstacle
from .contact_model import ContactModel

#: What they are called.
NAME = "environment"


def solids_of(surface: ContactModel, p_WS: Array) -> tuple[Obstacle, ...]:
    """Return a solid round each collision geometry of a surface, as the surface adds it to a plant.

    They are those of `drake_rnn.robot.clearance.model_obstacle.ModelObstacle`: of a mesh, a box or
    a capsule that holds its convex hull.

    Args:
        surface: The surface.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Raises:
        InvalidInputError: If it has a shape without bounds, or too many.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(1e-3)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    surface.add_to(plant, p_WS)
    plant.Finalize()
    try:
        return _solids(plant, scene_graph)
    except ValueError as error:
        raise InvalidInputError(f"environment: with obstacles, {error}") from None
    finally:
        del plant  # it points to the scene graph, which must outlive it


def _solids(plant: MultibodyPlant, scene_graph: SceneGraph) -> tuple[Obstacle, ...]:
    inspector, context = scene_graph.model_inspector(), plant.CreateDefaultContext()
    ids: Sequence[GeometryId] = inspector.GetAllGeometryIds(Role.kProximity)
    if len(ids) > MOST:
        raise ValueError(f"the surface may have up to {MOST} geometries, not {len(ids)}")
    found = []
    for k, geometry in enumerate(ids):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        X_WG = body.EvalPoseInWorld(context) @ inspector.GetPoseInFrame(geometry)
        name = NAME if len(ids) == 1 else f"{NAME} {k + 1}"
        found.append(solid_round(inspector.GetShape(geometry), X_WG, name))
    return tuple(found)
