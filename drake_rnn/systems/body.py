"""The arm as a system that a controller moves, at any level of simulation detail."""

from __future__ import annotations

from abc import abstractmethod
from types import NoneType
from typing import ClassVar, Literal, get_args

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from ..environments import ENVIRONMENTS, Surface
from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..inputs.numbers import is_number
from ..robot.arm import Arm
from ..robot.resting import require_resting
from ..robot.task import TASKS, named_task
from .block import Collectable
from .contact import Contact
from .plant_settings import PlantSettings

#: Arm that a law sees: ``commanded``, the arm that the filtered command moves; ``measured``, the
#: true arm; ``unfiltered``, a virtual arm that the law's unfiltered command moves.
Feedback = Literal["commanded", "measured", "unfiltered"]


class Body(Diagram, metaclass=Collectable):
    """An arm that follows a joint command; each subclass is one level of simulation detail.

    Inputs are ``position_commanded`` and ``velocity_commanded``, outputs ``position`` and
    ``velocity``, shape (n,) [rad, rad/s]. With a contact there are two more outputs, shape (3,)
    [N], in the world frame: the force of the surroundings on the tool, as computed by the simulated
    contact, ``contact_force``, and as measured by a sensor between arm and tool, ``tool_force``.

    Args:
        arm: The arm.
        start: Start posture, shape (n,) [rad]; by default the arm's home posture.
        contact: Contact of the tool with a surface; None for an arm in free space.
        settings: Simulation and motor settings, only of an arm with motors; None for the defaults.
        outside: How far the start may lie outside the position limits [rad].

    Attributes:
        kinematics: Kinematics of the arm; systems that share it compute each posture only once.

    Raises:
        InvalidInputError: If the start is missing, of the wrong size or outside the position
            limits; if the tool cannot press against such a surface at this level; or if there are
            settings for an arm without motors.
    """

    #: Name of the level in an experiment's document.
    level: ClassVar[str]
    #: Arm that a law sees by default.
    default_feedback: ClassVar[Feedback]
    #: Base class of the surfaces that the tool can press against at this level.
    surfaces: ClassVar[type[Surface]]
    #: Whether motors with limited torque move the arm.
    has_motors: ClassVar[bool]
    #: Whether a simulator alone can move the arm.
    is_simulated: ClassVar[bool] = True

    def __init__(
        self,
        arm: Arm,
        start: Array | None = None,
        contact: Contact | None = None,
        settings: PlantSettings | None = None,
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
        require_type("settings", settings, PlantSettings, NoneType)
        self.check_plant(settings, None)
        has_plant = self.has_motors and self.is_simulated
        self.settings = PlantSettings() if settings is None and has_plant else settings
        self.kinematics = arm.kinematics()
        builder = DiagramBuilder()
        self._build(builder)
        builder.BuildInto(self)

    @abstractmethod
    def _build(self, builder: DiagramBuilder) -> None:
        """Add the systems that move the arm, and export the ports of a body."""

    @property
    def tick(self) -> float | None:
        """Time for which the joint velocity is held [s]; None if it is the commanded one."""
        return None

    def set_motion(self, context: Context, q: Array, v: Array) -> None:
        """Set positions and velocities of the joints, shape (n,) each, of an arm that has its own.

        An arm that is always where it is commanded to be has none.

        Args:
            context: Context of this body.
            q: Positions [rad].
            v: Velocities [rad/s].
        """

    def remedy(self, joint: int, off: float) -> str:
        """Return a remedy for a joint that is far from its command, as a part of a sentence.

        Args:
            joint: Index of the joint.
            off: Its distance from its command [rad].
        """
        return "see the settings of its motors"

    @classmethod
    def check_plant(cls, settings: PlantSettings | None, period: float | None) -> None:
        """Raise an InvalidInputError if the level has no plant, or one slower than the controller.

        Args:
            settings: Settings of the plant; None for the defaults.
            period: Sampling period of the controller [s]; None if Drake integrates it.
        """
        if cls.has_motors:
            (settings or PlantSettings()).check_period(period)
        elif settings is not None:
            raise InvalidInputError("plant: only at level: dynamic")

    def check_task(self, task: str) -> None:
        """Raise an InvalidInputError for an unknown task, or a planar one with a contact.

        Args:
            task: Key of `drake_rnn.robot.task.TASKS`.
        """
        axes = named_task(task).axes
        if self.contact is not None and len(axes) != 3:
            able = ", ".join(name for name, known in TASKS.items() if len(known.axes) == 3)
            raise InvalidInputError(f"task: may be {able} with a contact, not {task}")

    @classmethod
    def chosen_feedback(cls, feedback: Feedback | None, *, sensed: bool) -> Feedback:
        """Return the arm that a law sees.

        Args:
            feedback: Requested arm; None for the default, which is the measured arm if sensors
                measure the joints.
            sensed: Whether sensors measure the joints.
        """
        if feedback is not None:
            return feedback
        return "measured" if sensed else cls.default_feedback

    @classmethod
    def check_loop(cls, period: float | None, feedback: Feedback, *, sensed: bool = False) -> None:
        """Raise an InvalidInputError if such a loop cannot be closed at this level.

        Args:
            period: Sampling period of the controller [s]; None if Drake integrates the law.
            feedback: Arm that the law sees.
            sensed: Whether sensors measure the joints.
        """
        if feedback not in get_args(Feedback):
            may_be = ", ".join(get_args(Feedback))
            raise InvalidInputError(f"feedback: may be {may_be}, not {feedback!r}")

    @classmethod
    def check_surface(cls, kind: type[Surface]) -> None:
        """Raise an InvalidInputError if the tool cannot press against this kind of surface."""
        if issubclass(kind, cls.surfaces):
            return
        able = [name for name, known in ENVIRONMENTS.items() if issubclass(known, cls.surfaces)]
        given = next((name for name, known in ENVIRONMENTS.items() if known is kind), kind.__name__)
        raise InvalidInputError(
            f"environment.kind: may be {', '.join(able)} at level: {cls.level}, not {given}"
        )


def start_posture(arm: Arm, start: Array | None, outside: float = 0.0) -> Array:
    """Return the start posture, shape (n,) [rad]: ``start``, or else the arm's home posture.

    Raises:
        InvalidInputError: If there is neither; if ``start`` has the wrong shape or lies outside
            the position limits by more than ``outside`` [rad]; if joints cannot rest there under
            the envelope of the velocity, where nothing outside is allowed; if ``outside`` is
            negative or NaN; or if ``arm`` is not an `Arm`.
    """
    require_type("arm", arm, Arm)
    if not (is_number(outside) and outside >= 0.0):
        raise InvalidInputError(
            f"outside: must be an angle of at least 0 rad, not {short(outside)}"
        )
    if start is None:
        start = arm.home
    if start is None:
        raise InvalidInputError(
            f"start: must be given; {arm.name} has no home posture, and `drake-rnn arm` or "
            "proposed_home(arm) proposes one"
        )
    start = _one_per_joint(arm, start)
    if not np.isfinite(start).all() or (arm.limits.violation(start) > outside).any():
        raise InvalidInputError(
            f"start: {arm.limits.complaint(start, outside, arm.joints, arm.units)}"
        )
    if not outside:
        require_resting(arm.limits, start, "start", arm.joints, arm.units)
    return start


def _one_per_joint(arm: Arm, start: Array) -> Array:
    """Return a start posture as an array, shape (n,); an InvalidInputError unless it is one."""
    try:
        start = np.asarray(start, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInputError(f"start: must be {arm.n} numbers, not {short(start)}") from None
    if start.ndim != 1:
        raise InvalidInputError(f"start: must have the shape ({arm.n},), not {start.shape}")
    if start.size != arm.n:
        raise InvalidInputError(f"start: has {start.size} entries for {arm.n} joints")
    return start
