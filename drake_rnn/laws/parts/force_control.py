"""Settings of a force that a law keeps along the normal of a surface."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from ...inputs.fields import Gain, Speed, Stiffness, validated
from .contact_loss import ContactLoss
from .stiffness import FixedStiffness, OnlineStiffness
from .surface_task import SurfaceTask


@validated
class ForceControl:
    """How the error of a pressing force becomes a speed along the normal.

    Args:
        stiffness: Stiffness of the surface [N/m], or an `OnlineStiffness` that learns it.
        gain: Gain of the force feedback [1/s].
        approach_speed: Largest speed along the normal [m/s]; None for no bound.
        contact_loss: Reaction to a lost contact; None to ignore it.
    """

    stiffness: Stiffness | OnlineStiffness
    gain: Gain = 10.0
    approach_speed: Speed | None = None
    contact_loss: ContactLoss | None = None

    @property
    def task(self) -> SurfaceTask:
        """The task along the surface and its normal, with a force that is measured."""
        given = self.stiffness
        surface = given if isinstance(given, OnlineStiffness) else FixedStiffness(given)
        return SurfaceTask(self.gain, surface, True, self.approach_speed, self.contact_loss)
