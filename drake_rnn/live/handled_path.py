"""The path of a point that a hand leads away from the path that it follows by itself."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from ..paths import PlacedPath
from ..paths.path import Motion, PathOfAnother
from .course import Course
from .shaping import ShapedPoint

# How fast the point's own path is left and joined: of the rate at which time passes on it [1/s].
_LETTING_GO = 2.0


class HandledPath(PathOfAnother):
    r"""A path as it is followed by itself, and displaced by hand.

    The desired point is p(s(t)) + d(t) with the path p, its clock s, and a displacement d of
    bounded speed and acceleration. While it is held s comes to rest, and d leads to the hand; once
    it follows its path again, d returns to zero. It is written up to a time, see `Course`; as long
    as nobody touches it, s = t and d = 0, to the last bit.

    Args:
        own: The path.
        fastest: Bound of the speed of d [m/s].
        most: Bound of its acceleration [m/s^2].
        by_turns: Whether d changes only while s rests, so that the point is never faster than the
            path and the hand are each by themselves.
    """

    def __init__(
        self, own: PlacedPath, fastest: float, most: float, *, by_turns: bool = False
    ) -> None:
        self.own = own
        self._clock = Course(np.zeros(1), np.ones(1))
        self._away = ShapedPoint(np.zeros(3), fastest, most)
        self._by_turns = by_turns
        self.held: Array | None = None
        self.moves = True

    @property
    def until(self) -> float:
        """Time up to which it is written [s]."""
        return self._clock.until

    def hold(self, point: Array) -> None:
        """Lead the point to a place, shape (3,) [m], and keep it there."""
        self.held, self.moves = np.array(point, dtype=float), False

    def stay(self) -> None:
        """Bring the point to rest where it is."""
        self._away.stay()
        p, _, _ = self.own.position(self._s(self.until))
        self.hold(p + self._away.wish)

    def follow(self) -> None:
        """Lead the point back to its path, and along it."""
        self.held, self.moves = None, True

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a later time [s]."""
        step = until - self.until
        rate = float(self._clock.at(self.until)[1][0])
        waits = self._by_turns and not self._is_back
        aim = 1.0 if self.moves and not waits else 0.0
        change = float(np.clip(aim - rate, -_LETTING_GO * step, _LETTING_GO * step))
        self._clock.go_on(until, np.array([change / step]))
        if self._by_turns and rate > 0.0:
            self._away.wish = np.array(self._away.course.at(self.until)[0])
        elif self.held is None:
            self._away.wish = np.zeros(3)
        else:
            self._away.wish = self.held - self.own.position(self._s(until))[0]
        self._away.go_on(until)

    def forget(self, before: float) -> None:
        """Forget what was before a time [s]."""
        self._clock.forget(before)
        self._away.course.forget(before)

    @property
    def _is_back(self) -> bool:
        d, v, _ = self._away.course.at(self.until)
        return self.held is None and not d.any() and not v.any()

    def _s(self, t: float) -> float:
        return float(self._clock.at(t)[0][0])

    @property
    def duration(self) -> float:
        """Infinite; see `Passage.duration`."""
        return np.inf

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        s, rate, change = (float(value[0]) for value in self._clock.at(t))
        p, v, a = self.own.position(s)
        d, d_v, d_a = self._away.course.at(t)
        return p + d, rate * v + d_v, rate**2 * a + change * v + d_a

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        s, rate, change = (float(value[0]) for value in self._clock.at(t))
        R, w, alpha = self.own.orientation(s)
        return R, rate * w, rate**2 * alpha + change * w


class Later(PathOfAnother):
    """A path, of which time 0 is a later time of another one.

    Args:
        own: The other path.
        begin: That time [s].
    """

    def __init__(self, own: PlacedPath, begin: float) -> None:
        self.own, self.begin = own, begin

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return self.own.duration - self.begin

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        return self.own.position(self.begin + t)

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        return self.own.orientation(self.begin + t)
