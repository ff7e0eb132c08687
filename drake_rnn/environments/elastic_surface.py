"""A surface that gives way like a spring."""

# No postponed annotations: see `surface`.
from typing import Literal

from ..inputs.fields import Positive, validated
from .surface import Surface


@validated
class ElasticSurface(Surface):
    """At the kinematic level: E's origin is met by a force proportional to how deep it is.

    Args:
        normal, gap, believed_normal: See `Surface`.
        stiffness: Force over depth [N/m].
    """

    kind: Literal["elastic_surface"] = "elastic_surface"
    stiffness: Positive
