"""What a shield tells of its commands, whether it is of one arm or of two."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from ..compiled.builds import Steps
from ..drive.call_times import CallTimes
from ..inputs.fields import Array
from ..laws.guarantee import Assumption
from ..laws.guard import StreamGuard
from ..laws.guard_command import GuardCommand
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits


class GuardedCommands:
    """Commands that a guard has chosen.

    Attributes:
        clearance: Pairs of bodies that are kept apart; None if none are.
    """

    clearance: Clearance | None
    # What commands, how its steps are made, and how long calls of `command` took.
    _guard: StreamGuard
    _steps: Steps
    _times: CallTimes

    @property
    @abstractmethod
    def streams(self) -> Sequence[Any]:
        """What each of its arms follows, a `StreamShield` each."""

    @property
    def _whole(self) -> StreamGuard:
        """The guard of all joints that are commanded together."""
        return self._guard

    @property
    def limits(self) -> JointLimits:
        """Limits in force, which no command is beyond."""
        return self._guard.limits

    @property
    def position(self) -> Array:
        """Positions commanded last, shape (n,) [rad]."""
        return self._guard.position

    @property
    def velocity(self) -> Array:
        """Velocities commanded last, shape (n,) [rad/s]."""
        return self._guard.velocity

    @property
    def newest(self) -> GuardCommand:
        """The last command, with the certified stop that follows it.

        Raises:
            InvalidInputError: If there was no command yet.
        """
        return self._guard.newest

    @property
    def uncertified(self) -> int:
        """In how many samples joints moved and no stop was certified; see `drake_rnn.Guard`."""
        return 0 if self.clearance is None else int(self._guard.part("uncertified").item())

    @property
    def late_stops(self) -> int:
        """How many commands came so late that joints on their way had to stop at the last one."""
        return self._whole.late_stops

    @property
    def late_samples(self) -> int:
        """How many samples of certified stops joints went along, see `drake_rnn.Guard`."""
        return self._whole.late_samples

    @property
    def overruns(self) -> int:
        """How many calls of `command` took longer than the period."""
        return self._times.overruns

    @property
    def moving_obstacles(self) -> tuple[str, ...]:
        """Names of the obstacles that may move, in the order of the rows of `p_WO`."""
        return self._whole.moving_obstacles

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """What the limits and the distance rest on that its commands keep."""
        return self._whole.assumptions

    @property
    def steps(self) -> str:
        """How the steps of its laws are made, in a line, such as ``C (gcc), from the cache``."""
        return self._steps.text
