"""A surface that acts like a spring."""

# No postponed annotations: see `surface`.
from typing import Annotated, Literal

from ..inputs.fields import Stiffness, validated
from ..inputs.keys import Meaning
from .surface import Surface


@validated
class ElasticSurface(Surface):
    """A spring for the kinematic level: the force on E's origin is proportional to its depth."""

    kind: Literal["elastic_surface"] = "elastic_surface"
    stiffness: Annotated[Stiffness, Meaning("Force per depth.", unit="N/m")]
