"""The base class of surfaces made of bodies, for arms with full dynamics."""

# No postponed annotations: see `surface`.
from abc import ABC, abstractmethod
from typing import Annotated

from pydrake.multibody.plant import MultibodyPlant

from ..inputs.fields import Array, Friction, NonNegative, Positive, validated
from ..inputs.keys import Meaning
from .surface import Surface


@validated
class TipMaterial:
    """Material of the tool's compliant ball; None keeps the value of the arm's model."""

    hydroelastic_modulus: Annotated[
        Positive | None,
        Meaning(
            "Pressure at full depth [Pa]. It is not a stiffness, which depends on radius, depth "
            "and mesh as well and has to be measured.",
        ),
    ] = None
    mesh_resolution: Annotated[
        Positive | None,
        Meaning("Edge length of the ball's mesh.", unit="m"),
    ] = None
    dissipation: Annotated[
        NonNegative | None,
        Meaning("Hunt-Crossley dissipation.", unit="s/m"),
    ] = None


@validated
class ContactModel(Surface, ABC):
    """A surface made of bodies."""

    standoff: Annotated[
        NonNegative | None,
        Meaning(
            "Distance from E's origin to the tool's outermost point towards the surface; by "
            "default that of the ball in the arm's model.",
            unit="m",
        ),
    ] = None
    tip: Annotated[TipMaterial | None, Meaning("Material of the tool's ball.")] = None
    friction: Annotated[
        Friction | None,
        Meaning("Friction coefficient of ball and surface; None keeps the values of their models."),
    ] = None

    @abstractmethod
    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """Add the surface's bodies and geometry to a plant that is not yet finalized.

        Args:
            plant: Plant, registered with a SceneGraph.
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """
