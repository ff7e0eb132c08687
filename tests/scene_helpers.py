"""An arm's plant with its geometry, for tests that look at shapes."""

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant


def in_scene(arm, look):
    """Return what ``look`` sees of the arm's plant and of what inspects its geometry."""
    scene_graph = SceneGraph()
    plant = MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_to(plant)
    plant.Finalize()
    try:
        return look(plant, scene_graph.model_inspector())
    finally:
        del plant  # it points to the scene graph


def extents(arm, role):
    """Half the extents, along the axes of its body, of the box round each geometry [m]."""

    def look(_, inspector):
        found = []
        for geometry in inspector.GetAllGeometryIds(role):
            box = inspector.GetObbInGeometryFrame(geometry)
            pose = inspector.GetPoseInFrame(geometry) @ box.pose()
            found.append(np.abs(pose.rotation().matrix()) @ box.half_width())
        return found

    return in_scene(arm, look)
