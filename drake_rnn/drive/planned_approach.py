"""An approach that is worked out while the robot rests, for a robot that waits for nobody."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from ..inputs.fields import Array
from .approach import Approach
from .connection import Motion
from .robot_task import RobotTask
from .settings import DriveSettings
from .shared_cycles import AHEAD

# Time for which it is worked on at a stretch; in between this side looks after the robot [s].
_STRETCH = 4e-3


class PlannedApproach(Approach):
    """The way from a posture to the start of a task, of which every cycle is known beforehand.

    A step that stays clear of everything takes about as long as a cycle of a fast robot, so the
    next cycles are told ahead. If one is answered without it all the same, the robot comes to rest,
    and the way from there is worked out anew.

    Args:
        task, settings, begin, period: As those of `Approach`.
    """

    def __init__(
        self, task: RobotTask, settings: DriveSettings, begin: Array, period: float
    ) -> None:
        super().__init__(task, settings, begin, period)
        self._commanded = super().motion()
        self._plan = [self._commanded]
        self._at, self._is_known = 0, super().arrived
        # Nothing moves yet, and nobody waits.
        while not self._is_known and len(self._plan) * period < settings.approach_time:
            self._work()

    @property
    def arrived(self) -> bool:
        """Whether the joints are commanded to rest at the start."""
        return self._is_known and self._at == len(self._plan) - 1

    @property
    def is_working(self) -> bool:  # type: ignore[override]
        """Whether the way is worked out while the robot rests."""
        return not self._is_known and self._commanded.rests

    def then(self) -> Sequence[Motion]:
        """See `Approach.then`."""
        return self._plan[self._at + 2 : self._at + AHEAD] if self._is_known else ()

    def resume(self, motion: Motion, cycles: int) -> None:
        """See `Approach.resume`."""
        self._commanded = motion
        reached = min(self._at + cycles, len(self._plan) - 1) if self._is_known else self._at
        for at in (reached, self._at):
            if motion.equals(self._plan[at]):
                self._at = at
                return
        self._is_known = False
        if motion.rests:
            self._guard.resume(*motion)
            self._plan, self._at = [motion], 0
            self._is_known = super().arrived

    def advance(self, time: float) -> Array:
        """Return the positions to command in the next cycle, shape (n,) [rad]."""
        if self.is_working:
            self._work()
        return self.motion().position

    def motion(self) -> Motion:
        """Return what is commanded: the next of the way, or what is commanded already.

        The latter keeps a robot at rest there. One that moves is not to stop at once: a paced
        connection does not take this, and makes a step of its stop.
        """
        if self._is_known and not self.arrived:
            return self._plan[self._at + 1]
        return self._commanded

    def _work(self) -> None:
        """Work for a while on the way from where the robot rests."""
        until = monotonic() + _STRETCH
        while not super().arrived:
            if monotonic() > until:
                return
            super().advance(self.period)
            self._plan.append(super().motion())
        self._is_known = True
