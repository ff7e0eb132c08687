"""A desired force that is set while it is pressed with."""

from __future__ import annotations

import numpy as np

from ..systems import ForceProfile
from .shaping import ShapedPoint

# Bounds of the rate of the force and of its change, as shares of the force at the start a second.
_RATE, _CHANGE = 2.0, 20.0


class HandledForce(ForceProfile):
    """A pressing force that follows a document's profile, and then what it is set to.

    Args:
        own: The document's profile.
    """

    def __init__(self, own: ForceProfile) -> None:
        # Where there is a time in which it rises, blocks read it at every time.
        super().__init__(value=own.value, rise_time=own.rise_time or 1.0, initial=own.initial)
        scale = max(own.value, own.initial)
        more = ShapedPoint(np.zeros(1), _RATE * scale, _CHANGE * scale)
        object.__setattr__(self, "_own", own)
        object.__setattr__(self, "_more", more)

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        return self._profile.at(t) + float(self._point.course.at(t)[0][0])

    def set(self, value: float) -> None:
        """Lead the force to a value [N], at a bounded rate."""
        self._point.wish = np.array([value - self._profile.value])

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a time [s]."""
        self._point.go_on(until)

    def forget(self, before: float) -> None:
        """Forget what was before a time [s]."""
        self._point.course.forget(before)

    @property
    def _profile(self) -> ForceProfile:
        found: ForceProfile = vars(self)["_own"]
        return found

    @property
    def _point(self) -> ShapedPoint:
        found: ShapedPoint = vars(self)["_more"]
        return found


class LaterForce(ForceProfile):
    """A force, of which time 0 is a later time of another one.

    Args:
        whole: The other force.
        begin: That time [s].
    """

    def __init__(self, whole: HandledForce, begin: float) -> None:
        super().__init__(value=whole.value, rise_time=whole.rise_time, initial=whole.initial)
        object.__setattr__(self, "_at", lambda t: whole.at(begin + t))

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        return float(vars(self)["_at"](t))
