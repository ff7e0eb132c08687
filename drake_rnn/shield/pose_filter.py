"""Which of the poses that something measures are followed, and whether it still sees the tool.

A tag before a camera, a headset or motion capture gives poses of which some are wrong: single ones
far off, the same numbers again and again, zeros, another place after the tool was hidden. A pose is
believed if it can be reached from the last one at the speeds of a `PoseFilter`. Another place is
believed once poses have agreed on it for a while. Each pose that is dropped has a reason; of the
others nothing is changed, smoothed or delayed.
"""

from __future__ import annotations

from collections import deque
from typing import Annotated, NamedTuple
from warnings import warn

import numpy as np

from ..inputs.fields import Array, Positive, Speed, Wait, between, validated
from ..inputs.keys import Meaning
from .chunks import Chunk, Counts
from .report import DroppedPose

#: Why a pose is dropped, and whose number of `Counts` tells how many were: it is too far from the
#: last one, tracking was lost and poses do not agree for long enough yet, it has been the same for
#: too long, its quaternion is not of length 1, or it is no place of the tool.
REASONS = ("jumped", "unconfirmed", "frozen", "not_unit", "far")
#: What `ShieldStatus.tracking` says besides.
STATES = ("", "tracked", "lost", *REASONS)

# Speeds are not told over less time than this [s]: messages come in bursts.
_SHORTEST = 0.03
# Poses that must agree on another place at least.
_AGREE = 3
# A quaternion this far from length 1 is dropped.
_UNIT = 1e-3
# What is farther from the tool than that is no place of it [m].
_FARTHEST = 5.0
# What numbers are clipped to before they are squared; rounding of times [s].
_HUGE, _INSTANT = 1e100, 1e-9


@validated
class PoseFilter:
    """Which measured poses are followed."""

    speed: Annotated[
        Speed,
        Meaning("Speed from the last pose above which one is an outlier.", unit="m/s"),
    ] = 2.0
    turn_speed: Annotated[
        Annotated[Positive, between(1e-3, 100.0)],
        Meaning("Angular velocity above which it is one.", unit="rad/s"),
    ] = 10.0
    believed_after: Annotated[
        Wait,
        Meaning(
            "Time for which poses, three or more, must agree on another place before it is "
            "followed, and on any place once tracking was lost.",
            unit="s",
        ),
    ] = 0.1
    lost_after: Annotated[
        Wait,
        Meaning(
            "Time after the last pose that is believed after which tracking is lost and the arm "
            "comes to rest; more than two periods of the source.",
            unit="s",
        ),
    ] = 0.2
    frozen_after: Annotated[
        Wait | None,
        Meaning(
            "Time for which poses that come singly may be the same to the last digit; None where "
            "they have no noise.",
            unit="s",
        ),
    ] = 0.5


class _Place(NamedTuple):
    """A pose that came.

    Attributes:
        t: Its time [s].
        X_WE: The pose, shape (7,).
        row: Its row in the chunk that is read; None if it came before.
    """

    t: float
    X_WE: Array
    row: int | None = None


class _Belief(NamedTuple):
    """What is known of the poses until now.

    Attributes:
        chunk: Those that are followed; None before any.
        came: When they came [s].
        others: Poses that agree with each other on another place.
        same: The single pose that came last, of the time since which it is the same.
        was_lost: Whether tracking was lost since the last one that is followed.
    """

    chunk: Chunk | None = None
    came: float = -np.inf
    others: tuple[_Place, ...] = ()
    same: _Place | None = None
    was_lost: bool = False

    @property
    def end(self) -> float:
        """Time of the last pose that is followed, or when it came [s]."""
        return -np.inf if self.chunk is None else max(self.came, float(self.chunk.times[-1]))


class Tracking:
    """The poses that are believed, and those that were dropped.

    Args:
        settings: What is believed.
        counts: Where it is counted what was dropped.
        kept: How many dropped poses are remembered; None for all.

    Attributes:
        dropped: Those that were dropped.
        state: One of `STATES`.
    """

    def __init__(self, settings: PoseFilter, counts: Counts, kept: int | None) -> None:
        self._settings, self._counts = settings, counts
        self.dropped: deque[DroppedPose] = deque(maxlen=kept)
        # What has been told.
        self._told: set[str] = set()
        self.clear()

    def clear(self) -> None:
        """Begin anew, with poses near the tool."""
        self._belief = self._next = _Belief()
        self.state = ""

    @property
    def has_begun(self) -> bool:
        """Whether a pose has been believed."""
        return self._belief.chunk is not None

    def believed(self, chunk: Chunk, now: float, p_WE: Array, refusal: str) -> Chunk:
        """Return what of a chunk is believed, without rows that are no numbers; see `take`.

        Args:
            chunk: Poses with times.
            now: Time at which they come [s].
            p_WE: Where the tool is, shape (3,) [m].
            refusal: Why poses can hardly be meant as they stand; empty if they can, and once a pose
                has been believed.
        """
        belief, reasons = self._belief, dict[int, tuple[str, str]]()
        last, others, was_lost = None, belief.others, belief.was_lost
        for row in np.flatnonzero(np.isfinite(chunk.values).all(axis=1)).tolist():
            place = _Place(float(chunk.times[row]), chunk.values[row].clip(-_HUGE, _HUGE), row)
            if len(chunk.times) == 1:
                belief = belief._replace(same=_same(place, belief.same))
            fault = self._fault(place, belief.same, p_WE, refusal)
            if fault is not None:
                reasons[row] = fault
                continue
            jump = self._jump(place, *self._before(place, last, now))
            if jump or was_lost:
                others = self._with(others, place)
                if not self._agree(others):
                    reasons[row] = ("unconfirmed", _LOST) if was_lost else ("jumped", jump)
                    continue
                reasons = {k: each for k, each in reasons.items() if k not in _rows(others)}
            last, others, was_lost = place, (), False
        for row, (reason, text) in reasons.items():
            self._drop(DroppedPose(float(chunk.times[row]), reason, text, chunk.values[row]))
        self._next = belief._replace(
            others=tuple(each._replace(row=None) for each in others), was_lost=was_lost
        )
        rows = [row for row in range(len(chunk.times)) if row not in reasons]
        if len(chunk.times) - 1 in reasons and not was_lost:
            self.state = reasons[len(chunk.times) - 1][0]
        return Chunk(chunk.times[rows], chunk.values[rows])

    def take(self, chunk: Chunk | None, now: float) -> None:
        """Go on from what was believed last.

        Args:
            chunk: What of it is followed; None for nothing.
            now: Time now [s].
        """
        self._belief = self._next
        if chunk is None:
            return
        rows = np.isfinite(chunk.values).all(axis=1)
        self._belief = self._belief._replace(
            chunk=Chunk(chunk.times[rows], chunk.values[rows]), came=now
        )
        self.state = "tracked"

    def is_lost(self, now: float) -> bool:
        """Return whether tracking is lost from now on [s], which is counted and told."""
        belief = self._belief
        if belief.was_lost or belief.chunk is None:
            return False
        if now <= belief.end + self._settings.lost_after + _INSTANT:
            return False
        self._belief, self.state = belief._replace(was_lost=True, others=()), "lost"
        self._counts.losses += 1
        self._tell(
            "lost",
            f"at {now:.9g} s no pose has been believed for {now - belief.end:.3g} s; {_RESTS}",
        )
        return True

    def _fault(
        self, place: _Place, same: _Place | None, p_WE: Array, refusal: str
    ) -> tuple[str, str] | None:
        """Return why a pose is dropped whatever came before, and that in words; None if not."""
        length, frozen = float(np.linalg.norm(place.X_WE[3:])), self._settings.frozen_after
        if abs(length - 1.0) > _UNIT:
            return "not_unit", f"its quaternion has the length {length:.6g}, and must have 1"
        if refusal:
            return "far", refusal
        away = float(np.linalg.norm(place.X_WE[:3] - p_WE))
        if away > _FARTHEST:
            return "far", f"{away:.3g} m from the tool are more than {_FARTHEST:g} m"
        if frozen is not None and same is not None and place.t - same.t > frozen + _INSTANT:
            return "frozen", f"it has been the same for {place.t - same.t:.3g} s"
        return None

    def _before(self, place: _Place, last: _Place | None, now: float) -> tuple[Array | None, float]:
        """Return the pose before one, None without one, and how much later it is [s].

        Args:
            place: The one.
            last: The last one of the same chunk that is believed; None for none.
            now: When that came [s].
        """
        chunk, came = self._belief.chunk, self._belief.came
        if last is not None:
            return _since(last, place)
        if chunk is None:
            return None, 0.0
        after = place.t - float(chunk.times[-1])
        # A chunk that begins before the last one ends is a change of mind since that came.
        return chunk.at(np.array(place.t)), after if after >= 0.0 else now - came

    def _jump(self, place: _Place, before: Array | None, time: float) -> str:
        """Return how a pose is too far from one before, in words; empty if it is not."""
        if before is None:
            return ""
        speed, turn_speed = self._settings.speed, self._settings.turn_speed
        way = float(np.linalg.norm(place.X_WE[:3] - before[:3]))
        q, q_before = place.X_WE[3:], before[3:]
        cosine = abs(float(q @ q_before)) / float(np.linalg.norm(q) * np.linalg.norm(q_before))
        turn, span = 2.0 * float(np.arccos(min(cosine, 1.0))), max(time, _SHORTEST)
        if way > speed * span:
            return f"{way:.3g} m in {span:.3g} s are more than {speed:g} m/s"
        if turn > turn_speed * span:
            return f"{turn:.3g} rad in {span:.3g} s are more than {turn_speed:g} rad/s"
        return ""

    def _with(self, others: tuple[_Place, ...], place: _Place) -> tuple[_Place, ...]:
        """Return poses that agree on another place, with one more or with that alone."""
        if others and not self._jump(place, *_since(others[-1], place)):
            return (*others, place)
        return (place,)

    def _agree(self, others: tuple[_Place, ...]) -> bool:
        """Return whether poses that agree with each other are believed."""
        long = others[-1].t - others[0].t >= self._settings.believed_after - _INSTANT
        return long and len(others) >= _AGREE

    def _drop(self, pose: DroppedPose) -> None:
        """Count a pose, and tell of the first one of its reason."""
        setattr(self._counts, pose.reason, vars(self._counts)[pose.reason] + 1)
        self.dropped.append(pose)
        self._tell(pose.reason, f"the pose of {pose.time:.9g} s is dropped: {pose.text}")

    def _tell(self, what: str, text: str) -> None:
        if what not in self._told:
            self._told.add(what)
            warn(f"X_WE: {text}. Others like it are only counted, see counts", stacklevel=6)


_LOST = "tracking was lost, and poses have not agreed for long enough since"
_RESTS = "tracking is lost, and the arm comes to rest"


def unit_poses(values: Array) -> Array:
    """Return the rows of numbers whose quaternions are of length 1, shape (m, 7).

    Args:
        values: Poses, shape (k, 7).
    """
    rows = values[np.isfinite(values).all(axis=1)].clip(-_HUGE, _HUGE)
    return np.asarray(rows[np.abs(np.linalg.norm(rows[:, 3:], axis=1) - 1.0) <= _UNIT])


def _since(before: _Place, place: _Place) -> tuple[Array, float]:
    """Return a pose, shape (7,), and how much later another one is [s]."""
    return before.X_WE, place.t - before.t


def _rows(places: tuple[_Place, ...]) -> set[int | None]:
    """Return the rows of poses in the chunk that is read."""
    return {place.row for place in places}


def _same(place: _Place, before: _Place | None) -> _Place:
    """Return a pose, of the time since which it has been the same."""
    is_same = before is not None and bool((place.X_WE == before.X_WE).all())
    return before if is_same and before is not None else place
