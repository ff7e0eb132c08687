"""The base class of surfaces made of bodies, for arms with full dynamics."""

# No postponed annotations: see `surface`.
from abc import ABC, abstractmethod

from pydrake.multibody.plant import MultibodyPlant

from ..inputs.fields import Array, Friction, NonNegative, Positive, validated
from .surface import Surface


@validated
class TipMaterial:
    """Material of the tool's compliant ball; None keeps the value of the arm's model.

    Args:
        hydroelastic_modulus: Pressure at full depth [Pa]. It is not a stiffness, which depends on
            radius, depth and mesh as well and has to be measured.
        mesh_resolution: Edge length of the ball's mesh [m].
        dissipation: Hunt-Crossley dissipation [s/m].
    """

    hydroelastic_modulus: Positive | None = None
    mesh_resolution: Positive | None = None
    dissipation: NonNegative | None = None


@validated
class ContactModel(Surface, ABC):
    """A surface made of bodies.

    Args:
        normal, gap, believed_normal: See `Surface`.
        standoff: Distance from E's origin to the tool's outermost point towards the surface [m];
            by default that of the ball in the arm's model.
        tip: Material of the tool's ball.
        friction: Friction coefficient of ball and surface; None keeps the values of their models.
    """

    standoff: NonNegative | None = None
    tip: TipMaterial | None = None
    friction: Friction | None = None

    @abstractmethod
    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """Add the surface's bodies and geometry to a plant that is not yet finalized.

        Args:
            plant: Plant, registered with a SceneGraph.
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """
