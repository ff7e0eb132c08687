"""What every environment has that is in contact with the tool of an arm with full dynamics."""

# No postponed annotations: see `surface`.
from abc import ABC, abstractmethod

from pydrake.multibody.plant import MultibodyPlant

from ..inputs.fields import Array, NonNegative, Positive, validated
from .surface import Surface


@validated
class TipMaterial:
    """The compliant ball of the tool; what is None stays as the arm's model says.

    Args:
        hydroelastic_modulus: Pressure at full depth [Pa]. Not a stiffness: that depends on
            radius, depth and mesh; measure it.
        mesh_resolution: Edge of the ball's mesh [m].
        dissipation: Hunt and Crossley's [s/m].
    """

    hydroelastic_modulus: Positive | None = None
    mesh_resolution: Positive | None = None
    dissipation: NonNegative | None = None


@validated
class ContactModel(Surface, ABC):
    """A surface made of bodies.

    Args:
        normal, gap, believed_normal: See `Surface`.
        standoff: From E's origin to the tool's outermost point towards the surface [m]; by
            default that of the ball in the arm's model.
        tip: Material of the tool's ball.
        friction: Of ball and surface; None keeps what their models say.
    """

    standoff: NonNegative | None = None
    tip: TipMaterial | None = None
    friction: NonNegative | None = None

    @abstractmethod
    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """Add its bodies and geometry to a plant that is not yet finalized.

        Args:
            plant: Registered with a SceneGraph.
            p_WS: The point of the surface below the tool at the start, shape (3,) [m].
        """
