"""The arm in the scene, and where its parts are in a posture."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

from pydrake.geometry import (
    GeometryId,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Role,
    SceneGraphInspector,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import DiagramBuilder

from ..inputs.fields import Array
from ..robot.arm import Arm


class DrawnArm:
    """An arm below "/arm" in the scene.

    Args:
        arm: The arm.
        meshcat: Holds the scene.
    """

    def __init__(self, arm: Arm, meshcat: Meshcat) -> None:
        self.arm = arm
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        arm.add_to(self.plant)
        self.plant.Finalize()
        parameters = MeshcatVisualizerParams()
        parameters.role = Role.kIllustration
        parameters.prefix = "/arm"
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self._context)
        self.inspector: SceneGraphInspector = scene_graph.model_inspector()
        for body in self.beyond:
            # A tool past the task frame would look like what is to be on the path.
            meshcat.SetProperty(f"/arm/{scene_name(body)}", "visible", False)

    @property
    def bodies(self) -> list[Any]:
        """All, the world first."""
        return [self.plant.get_body(BodyIndex(k)) for k in range(self.plant.num_bodies())]

    def geometries(self) -> Iterator[tuple[Any, GeometryId]]:
        """What is drawn, and on which body."""
        for frame in self.inspector.GetAllFrameIds():
            for geometry in self.inspector.GetGeometries(frame, Role.kIllustration):
                yield self.plant.GetBodyFromFrameId(frame), geometry

    def take(self, q: Array) -> None:
        """Let it have this posture, shape (n,) [rad]."""
        posture: Any = self.arm.posture(self.plant, q)
        self.plant.SetPositions(self._plant_context, posture)

    def X_WB(self, body: Any) -> RigidTransform:
        """Where a body is in the posture taken."""
        return self.plant.EvalBodyPoseInWorld(self._plant_context, body)

    def show(self, q: Array, time: float) -> None:
        """Take a posture and publish it, or record it if the scene records."""
        self._context.SetTime(time)
        self.take(q)
        self._diagram.ForcedPublish(self._context)

    @cached_property
    def beyond(self) -> list[Any]:
        """The bodies between the task frame and the tool's tip, which are not shown."""
        if self.arm.tip is None:
            return []
        task_body = self.plant.GetFrameByName(self.arm.frame).body().index()
        parents = {
            joint.child_body().index(): joint.parent_body()
            for joint in map(self.plant.get_joint, self.plant.GetJointIndices())
        }
        body, found = self.plant.GetFrameByName(self.arm.tip).body(), []
        while body.index() != task_body:
            found.append(body)
            if body.index() not in parents:
                return []  # the tip is not beyond the task frame
            body = parents[body.index()]
        return found


def scene_name(body: Any) -> str:
    """A body's path below the arm's."""
    return str(body.scoped_name().get_full()).replace("::", "/")
