"""Settings of a force that a law keeps along the normal of a surface."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from typing import Annotated

from ...inputs.fields import Gain, Speed, Stiffness, validated
from ...inputs.keys import Meaning
from .contact_loss import ContactLoss
from .stiffness import FixedStiffness, OnlineStiffness
from .surface_task import SurfaceTask


@validated
class ForceControl:
    """How the error of a pressing force becomes a speed along the normal."""

    stiffness: Annotated[
        Stiffness | OnlineStiffness,
        Meaning(
            "Stiffness of the surface [N/m], or an `OnlineStiffness` that learns it.",
            unit="N/m",
        ),
    ]
    gain: Annotated[Gain, Meaning("Gain of the force feedback.", unit="1/s")] = 10.0
    approach_speed: Annotated[
        Speed | None,
        Meaning("Largest speed along the normal; None for no bound.", unit="m/s"),
    ] = None
    contact_loss: Annotated[
        ContactLoss | None,
        Meaning("Reaction to a lost contact; None to ignore it."),
    ] = None

    @property
    def task(self) -> SurfaceTask:
        """The task along the surface and its normal, with a force that is measured."""
        given = self.stiffness
        surface = given if isinstance(given, OnlineStiffness) else FixedStiffness(given)
        return SurfaceTask(self.gain, surface, True, self.approach_speed, self.contact_loss)
