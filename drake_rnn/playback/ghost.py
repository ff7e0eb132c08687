"""The posture that the arm is to reach, as a still image of the arm."""

from __future__ import annotations

from pydrake.geometry import Convex, Mesh, Meshcat, Rgba, Shape

from ..inputs.fields import Array
from .drawn_arm import DrawnArm, scene_name
from .stage import DESIRED_COLOUR, GHOST_OPACITY

# Where the arm has come to the target only the arm is seen, free of specks: the ghost counts as
# farther away by some millimetres, in steps of the depth buffer.
_BEHIND = {
    "castShadow": False,
    "material.polygonOffset": True,
    "material.polygonOffsetFactor": 4.0,
    "material.polygonOffsetUnits": 100.0,
}
# Drawn after the arm and before the tint: it takes the place in the depth buffer and leaves no
# colour, so that of the ghost only the near side is seen, not all that is inside it.
_UNSEEN = {**_BEHIND, "material.colorWrite": False, "renderOrder": 1.0}


def draw_ghost(meshcat: Meshcat, drawn: DrawnArm, target: Array) -> None:
    """Draw what of the arm moves, as it is in the posture ``target``, shape (n,) [rad]."""
    drawn.take(target)
    beyond = [scene_name(body) for body in drawn.beyond]
    for number, (body, geometry) in enumerate(drawn.geometries()):
        if drawn.plant.IsAnchored(body) or scene_name(body) in beyond:
            continue
        place = f"/target/{scene_name(body)}"
        path = f"{place}/{number:03d}"
        shape = _plain(drawn.inspector.GetShape(geometry))
        meshcat.SetTransform(place, drawn.X_WB(body))
        meshcat.SetTransform(path, drawn.inspector.GetPoseInFrame(geometry))
        for layer, opacity, look in (("depth", 1.0, _UNSEEN), ("tint", GHOST_OPACITY, _BEHIND)):
            meshcat.SetObject(f"{path}/{layer}", shape, Rgba(*DESIRED_COLOUR, opacity))
            for name, value in look.items():
                meshcat.SetProperty(f"{path}/{layer}/<object>", name, value)


def _plain(shape: Shape) -> Shape:
    """A shape that takes the ghost's colour: a mesh has its own, its hull has not."""
    return Convex(shape.source(), shape.scale3()) if isinstance(shape, Mesh) else shape
