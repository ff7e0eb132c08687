"""Another arm beside the one that a law moves, as far as the law knows it."""

from __future__ import annotations

from dataclasses import dataclass

from ..limits import JointLimits

#: What the names of the signals begin with by which a law sees another arm.
OTHER = "other_"


@dataclass(frozen=True, eq=False)
class Neighbour:
    """Another arm beside the one that a law moves, which keeps a stop of its own.

    Attributes:
        limits: Limits of its joints; what it may brake with.
        has_chosen: Whether it has chosen for the next sample already: what is seen of it is then
            where it is, and how fast, at the end of that sample.
    """

    limits: JointLimits
    has_chosen: bool

    @property
    def parts(self) -> dict[str, str]:
        """What is seen of it, by signal: the part of its own law's state that this is.

        Its commanded positions, velocities and, if the jerk is bounded, accelerations.
        """
        names = ("commanded", "v") if self.limits.jerk is None else ("commanded", "v", "a")
        return {OTHER + name: name for name in names}
