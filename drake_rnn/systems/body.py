"""What a controller moves: the arm as a system, at one level of detail or another."""

from __future__ import annotations

from types import NoneType
from typing import ClassVar, Literal, get_args

import numpy as np
from pydrake.systems.framework import Diagram

from ..environments import ENVIRONMENTS, Surface
from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..robot.arm import Arm
from .contact import Contact

#: Which arm a law sees: the one that the filtered command moves; the true one, as measured; or a
#: virtual one that its own, unfiltered command moves.
Feedback = Literal["commanded", "measured", "unfiltered"]


class Body(Diagram):
    """An arm that is told where to be; its kind is the level of detail of a simulation.

    Inputs are ``position_commanded`` and ``velocity_commanded``, outputs ``position`` and
    ``velocity``, shape (n,) [rad, rad/s]; and with a contact ``contact_force`` and ``tool_force``,
    shape (3,) [N] in the world frame: what the surroundings exert on the tool, as the contact knows
    it, and as a sensor between arm and tool feels it.

    Args:
        arm: The arm.
        start: Posture to start from, shape (n,) [rad]; by default the arm's home posture.
        contact: What the tool presses against; None for an arm in free space.
        outside: How far the start may lie outside the position limits [rad].

    Attributes:
        kinematics: Kinematics of the arm, for all who ask at the same posture to share.

    Raises:
        InvalidInputError: If the start is missing, of the wrong size or outside the position
            limits, or this level has no such surface.
    """

    #: Name of the level, as in an experiment's document.
    level: ClassVar[str]
    #: What a law sees unless it is told otherwise.
    default_feedback: ClassVar[Feedback]
    #: Surfaces that the tool can press against at this level.
    surfaces: ClassVar[type[Surface]]
    #: Whether motors of limited torque move it.
    has_motors: ClassVar[bool]

    def __init__(
        self,
        arm: Arm,
        start: Array | None = None,
        contact: Contact | None = None,
        *,
        outside: float = 0.0,
    ) -> None:
        super().__init__()
        self.arm = arm
        self.start = start_posture(arm, start, outside)
        require_type("contact", contact, Contact, NoneType)
        if contact is not None:
            self.check_surface(type(contact.surface))
        self.contact = contact
        self.kinematics = arm.kinematics()

    @property
    def tick(self) -> float | None:
        """Time for which its velocity is held [s]; None if it moves just as it is commanded."""
        return None

    def check_task(self, size: int) -> None:
        """Raise an InvalidInputError if the task has not the axes it takes; ``size`` of them."""

    @classmethod
    def check_loop(cls, period: float | None, feedback: Feedback) -> None:
        """Raise an InvalidInputError if no such loop can be closed at this level.

        Args:
            period: Of the controller [s]; None for one that Drake integrates.
            feedback: Which arm the law sees.
        """
        if feedback not in get_args(Feedback):
            may_be = ", ".join(get_args(Feedback))
            raise InvalidInputError(f"feedback: may be {may_be}, not {feedback!r}")

    @classmethod
    def check_surface(cls, kind: type[Surface]) -> None:
        """Raise an InvalidInputError if the tool cannot press against such surfaces here."""
        if issubclass(kind, cls.surfaces):
            return
        able = [name for name, known in ENVIRONMENTS.items() if issubclass(known, cls.surfaces)]
        given = next((name for name, known in ENVIRONMENTS.items() if known is kind), kind.__name__)
        raise InvalidInputError(
            f"environment.kind: may be {', '.join(able)} at level: {cls.level}, not {given}"
        )


def start_posture(arm: Arm, start: Array | None, outside: float = 0.0) -> Array:
    """Return the posture to start from, shape (n,) [rad]: ``start``, else the arm's home posture.

    Raises:
        InvalidInputError: If there is none, or it is not one of this arm's, or lies outside
            its position limits by more than ``outside`` [rad]; or ``arm`` is no arm.
    """
    require_type("arm", arm, Arm)
    if start is None:
        start = arm.home
    if start is None:
        raise InvalidInputError(f"start: must be given; {arm.name} has no home posture")
    try:
        start = np.asarray(start, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"start: must be {arm.n} numbers, not {start!r}") from None
    if start.shape != (arm.n,):
        raise InvalidInputError(f"start: has {start.size} entries for {arm.n} joints")
    if not np.isfinite(start).all() or (arm.limits.violation(start) > outside).any():
        raise InvalidInputError(f"start: {arm.limits.complaint(start, outside, arm.joints)}")
    return start
