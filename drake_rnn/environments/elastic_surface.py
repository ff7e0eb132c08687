"""A surface that acts like a spring."""

# No postponed annotations: see `surface`.
from typing import Literal

from ..inputs.fields import Stiffness, validated
from .surface import Surface


@validated
class ElasticSurface(Surface):
    """A spring for the kinematic level: the force on E's origin is proportional to its depth.

    Args:
        normal, gap, believed_normal: See `Surface`.
        stiffness: Force per depth [N/m].
    """

    kind: Literal["elastic_surface"] = "elastic_surface"
    stiffness: Stiffness
