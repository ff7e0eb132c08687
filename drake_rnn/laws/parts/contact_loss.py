"""What to do when the tool has lost what it was pressed against."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ...inputs.fields import Array, NonNegative, Positive, validated

APPROACHING, IN_CONTACT, LOST = 0.0, 1.0, 2.0


@validated
class ContactLoss:
    """A contact once made counts as lost when hardly any force is left for a while.

    Args:
        reaction: ``hold``: the end effector stays where it is; ``retreat``: it moves off the
            surface first.
        threshold: Share of the desired force below which there is no contact.
        floor: Force that counts as none, however little is desired [N]; above a sensor's noise.
        patience: Time without one after which it is lost [s].
        retreat_speed: Along the normal [m/s].
        retreat_distance: How far [m].
    """

    reaction: Literal["hold", "retreat"] = "hold"
    threshold: Annotated[float, Field(strict=True, gt=0, lt=1)] = 0.05
    floor: NonNegative = 0.05
    patience: NonNegative = 0.05
    retreat_speed: Positive = 0.02
    retreat_distance: NonNegative = 0.02

    #: Entries of its state: phase, time without contact [s], distance of the retreat [m].
    size = 3

    def start(self) -> Array:
        """Its first state, shape (3,): not yet in contact."""
        return np.array([APPROACHING, 0.0, 0.0])

    def update(self, state: Array, force: float, desired: float, period: float) -> Array:
        """The state one period later, shape (3,)."""
        phase, missing, retreated = state.tolist()
        touching = force > max(self.threshold * desired, self.floor)
        if phase == LOST:
            return np.array([LOST, missing, retreated + period * self.retreat(state)])
        if touching:
            return np.array([IN_CONTACT, 0.0, 0.0])
        missing += period
        lost = phase == IN_CONTACT and missing > self.patience
        return np.array([LOST if lost else phase, missing, 0.0])

    def retreat(self, state: Array) -> float:
        """Speed off the surface once contact is lost [m/s]; then 0, to stay."""
        if self.reaction == "hold" or state[2] >= self.retreat_distance:
            return 0.0
        return self.retreat_speed
