"""The capsules of an arm, from which its distances are measured: translucent, and hidden at first.

Each moves with a body that is drawn, because it is below that body in the scene: the animation has
no more tracks than without them.
"""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform

from .. import colours
from ..robot.clearance import Clearance
from .drawn_arm import DrawnArm
from .obstacles import capsule_between

_OPACITY = 0.45
# A first layer fills the depth buffer and leaves no colour: where capsules overlap, only the
# nearest one is seen.
_LAYERS = (
    ("depth", 1.0, {"material.colorWrite": False, "renderOrder": 2.0}),
    ("tint", _OPACITY, {"renderOrder": 3.0}),
)


def draw_capsules(
    meshcat: Meshcat,
    drawn: DrawnArm,
    clearance: Clearance | None,
    X_WB: RigidTransform | None = None,
) -> list[str]:
    """Draw the capsules of an arm, hidden.

    Args:
        meshcat: Meshcat with the scene.
        drawn: The arm in the scene.
        clearance: What the arm is to stay clear of, with its capsules; None if nothing is.
        X_WB: Pose of the arm's base among the capsules; by default it stands at the origin.

    Returns:
        Scene paths of the capsules. Those of links of which nothing is drawn are left out.
    """
    if clearance is None:
        return []
    arm, places = clearance.arm, list[str]()
    drawn.set_posture(np.zeros(drawn.arm.n))
    X_BW = RigidTransform() if X_WB is None else X_WB.inverse()
    # Those of an arm beside it come behind its own.
    own = list(zip(arm.bodies, arm.ends, arm.radii, strict=True))[: clearance.alone]
    for k, (name, ends, radius) in enumerate(own):
        if (carrier := drawn.carrier(name)) is None:
            continue
        place = f"{drawn.place(carrier)}/capsules/{k}"
        shape, X_WC = capsule_between(ends[0], ends[1], float(radius))
        meshcat.SetTransform(place, drawn.X_WB(carrier).inverse() @ X_BW @ X_WC)
        for layer, opacity, look in _LAYERS:
            rgba = Rgba(*colours.components(colours.CAPSULE), opacity)
            meshcat.SetObject(f"{place}/{layer}", shape, rgba)
            for key, value in {"castShadow": False, **look}.items():
                meshcat.SetProperty(f"{place}/{layer}/<object>", key, value)
        meshcat.SetProperty(place, "visible", False)
        places.append(place)
    return places
