"""Detection of a lost contact, and the reaction to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...arrays.algebra import functions_of, is_one, joined
from ...errors import InvalidInputError
from ...inputs.fields import Array, NonNegative, Speed, validated
from ...inputs.keys import Meaning, Only

APPROACHING, IN_CONTACT, LOST = 0.0, 1.0, 2.0


@validated
class ContactLoss:
    """Settings for the loss of a contact: hardly any force for a while, once contact was made."""

    reaction: Annotated[
        Literal["hold", "retreat"],
        Meaning(
            "``hold`` keeps the end effector where it is; ``retreat`` first moves it off the "
            "surface.",
        ),
    ] = "hold"
    threshold: Annotated[
        float,
        Field(strict=True, gt=0, lt=1),
        Meaning("Fraction of the desired force below which there is no contact."),
    ] = 0.05
    floor: Annotated[
        NonNegative,
        Meaning(
            "Force below which there is no contact, whatever force is desired; above the noise "
            "of the sensor.",
            unit="N",
        ),
    ] = 0.05
    patience: Annotated[
        NonNegative,
        Meaning("Time without contact after which it counts as lost.", unit="s"),
    ] = 0.05
    retreat_speed: Annotated[
        Speed,
        Meaning(
            "Speed of the retreat along the normal.",
            unit="m/s",
            only=(Only("reaction", "retreat"),),
        ),
    ] = 0.02
    retreat_distance: Annotated[
        NonNegative,
        Meaning("Length of the retreat.", unit="m", only=(Only("reaction", "retreat"),)),
    ] = 0.02

    #: Size of the state: phase, time without contact [s], distance retreated [m].
    size = 3

    def start(self) -> Array:
        """Return the initial state, shape (3,): not yet in contact."""
        return np.array([APPROACHING, 0.0, 0.0])

    def update(self, state: Array, force: Any, desired: Any, period: float) -> Array:
        """Return the state one period later, shape (..., 3).

        Args:
            state: State, shape (..., 3).
            force: Measured force [N], a float, or one for each robot, shape (..., 1).
            desired: Desired force [N], likewise.
            period: Sampling period [s].
        """
        if not is_one(state):
            return self._update(state, force, desired, period)
        phase, missing, retreated = state.tolist()
        touching = force > max(self.threshold * desired, self.floor)
        if phase == LOST:
            return np.array([LOST, missing, retreated + period * self.retreat(state)])
        if touching:
            return np.array([IN_CONTACT, 0.0, 0.0])
        missing += period
        lost = phase == IN_CONTACT and missing > self.patience
        return np.array([LOST if lost else phase, missing, 0.0])

    def _update(self, state: Array, force: Any, desired: Any, period: float) -> Array:
        """Return what `update` does, of many robots."""
        xp = functions_of(state, force)
        phase, missing, retreated = (state[..., k, None] for k in range(3))
        touching = force > xp.maximum(self.threshold * desired, self.floor)
        gone = phase == LOST
        away = retreated + period * self.retreat(state)
        longer = missing + period
        lost = (phase == IN_CONTACT) & (longer > self.patience)
        phase = xp.where(gone | lost & ~touching, LOST, xp.where(touching, IN_CONTACT, phase))
        missing = xp.where(gone, missing, xp.where(touching, 0.0, longer))
        return joined((phase, missing, xp.where(gone, away, 0.0)))

    def retreat(self, state: Array) -> Any:
        """Return the speed off the surface after a loss of contact [m/s]; 0 to stay in place.

        It is a float, or an array of shape (..., 1) of many robots.
        """
        if self.reaction == "hold":
            return 0.0
        if not is_one(state):
            arrived = state[..., 2, None] >= self.retreat_distance
            return functions_of(state).where(arrived, 0.0, self.retreat_speed)
        return 0.0 if state[2] >= self.retreat_distance else self.retreat_speed

    def check(self, key: str, pressing_force: float | None) -> None:
        """Raise an InvalidInputError if the desired force would count as no contact.

        Args:
            key: Key of these settings, for the message.
            pressing_force: Desired pressing force [N]; None without a contact.
        """
        if pressing_force is not None and self.floor >= pressing_force:
            raise InvalidInputError(
                f"{key}.floor: must be below force.value, {pressing_force:g} N, not {self.floor:g}"
            )

    def caveats(self, key: str, metrics: Mapping[str, float]) -> list[str]:
        """Return a sentence on what is done, after a run with these metrics that lost its contact.

        Args:
            key: Key of these settings, for the message.
            metrics: Metrics of the run, by name.
        """
        if "contact_lost_time_s" not in metrics:
            return []
        does = {"hold": "holds still", "retreat": "retreats"}[self.reaction]
        return [f"{key}: without contact the end effector {does}"]
