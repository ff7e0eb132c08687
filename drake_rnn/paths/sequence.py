"""Paths one after another: several in turn, or a change of path while one is followed.

- Transitions from one path to the next: whether they meet, and a move between them if not.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array, NonNegative, Positive, validated
from ..inputs.keys import Meaning
from ..inputs.messages import short
from ..robot.rotation import rotation_error
from .path import Motion, Path, PlacedPath
from .pieces import quintic_pieces
from .trajectory import TrajectoryPath, as_path, quaternion_rates

# Differences in position [m], velocity [m/s], angle [rad] and angular velocity [rad/s] up to which
# the end of a path meets the start of another.
_MEET = 1e-6
# Time before the end of a path at which its velocity is looked up [s]: at the end it rests.
_BEFORE = 1e-9


@dataclass(frozen=True, eq=False)
class State:
    """The motion that is desired at an instant.

    Attributes:
        position: Position, velocity and acceleration, each of shape (3,) [m, m/s, m/s^2].
        orientation: Orientation, shape (3, 3), angular velocity and acceleration, each of shape
            (3,) [rad/s, rad/s^2]; None if it is not known.
    """

    position: Motion
    orientation: Motion | None

    @classmethod
    def at_rest(cls, p_WE: Array, R_WE: Array | None) -> State:
        """Return the state of an end effector that rests at a pose."""
        still = np.zeros(3)
        return cls((p_WE, still, still), None if R_WE is None else (R_WE, still, still))

    @classmethod
    def at_start(cls, path: PlacedPath) -> State:
        """Return the state in which a path starts."""
        return cls(path.position(0.0), path.orientation(0.0) if path.oriented else None)

    @classmethod
    def at_end(cls, path: PlacedPath, t: float) -> State:
        """Return the state in which a path that is left at time ``t`` [s] ends."""
        before = max(t - _BEFORE, 0.0)
        position = (path.position(t)[0], *path.position(before)[1:])
        if not path.oriented:
            return cls(position, None)
        return cls(position, (path.orientation(t)[0], *path.orientation(before)[1:]))

    @property
    def pose(self) -> tuple[Array, Array | None]:
        """Position, shape (3,) [m], and orientation, shape (3, 3), or None."""
        return self.position[0], None if self.orientation is None else self.orientation[0]

    def gaps(self, other: State) -> list[tuple[float, str]]:
        """Return the differences from another state that exceed rounding, with their units."""
        (p, v, _), (p_other, v_other, _) = self.position, other.position
        gaps = [
            (float(np.linalg.norm(p_other - p)), "m"),
            (float(np.linalg.norm(v_other - v)), "m/s"),
        ]
        if self.orientation is not None and other.orientation is not None:
            (R, w, _), (R_other, w_other, _) = self.orientation, other.orientation
            gaps.append((float(np.linalg.norm(rotation_error(R, R_other))), "rad"))
            gaps.append((float(np.linalg.norm(w_other - w)), "rad/s"))
        return [gap for gap in gaps if gap[0] > _MEET]


def require_meeting(before: State, after: State, where: str) -> None:
    """Raise an InvalidInputError unless two states meet.

    Args:
        before: State in which a path ends.
        after: State in which the next one starts.
        where: Key of the next one, for the message.
    """
    if gaps := before.gaps(after):
        jumps = " and ".join(f"{size:.3g} {unit}" for size, unit in gaps)
        raise InvalidInputError(
            f"{where}: begins {jumps} from what is desired just before; give the part a bridge, "
            "a time in which to get there"
        )


def bridge(before: State, after: State, duration: float) -> PlacedPath:
    """Return a move from one state to another: polynomials of degree 5 in time.

    Those of the position have the position, velocity and acceleration of both states at its ends;
    those of the orientation are a quaternion's, to the same effect.

    Args:
        before: State in which it begins.
        after: State in which it ends.
        duration: Its duration [s].
    """
    times = np.array([0.0, duration])
    ends = zip(before.position, after.position, strict=True)
    trajectory = quintic_pieces(times, *(np.stack(pair) for pair in ends))
    orientation = None
    if before.orientation is not None and after.orientation is not None and _turns(before, after):
        one, other = quaternion_rates(*before.orientation), quaternion_rates(*after.orientation)
        # Of the two quaternions of an orientation, the nearer one.
        sign = np.copysign(1.0, one[0] @ other[0])
        ends = zip(one, (sign * value for value in other), strict=True)
        orientation = quintic_pieces(times, *(np.stack(pair) for pair in ends))
    return TrajectoryPath(trajectory=trajectory, orientation=orientation).placed(*before.pose)


def _turns(before: State, after: State) -> bool:
    rates = [value for state in (before, after) for value in (state.orientation or ())[1:]]
    return any(value.any() for value in rates) or any(
        unit == "rad" for _, unit in before.gaps(after)
    )


# Distance up to which a sequence ends where it began [m].
_CLOSURE = 1e-6


def _path(value: Any) -> Any:
    path = as_path(value)
    if not isinstance(path, Path):
        raise ValueError(f"must be a path, not {short(value)}")
    return path


@validated
class Part:
    """A part of a `Sequence`."""

    path: Annotated[Path, BeforeValidator(_path), Meaning("The path.")]
    lasts: Annotated[
        Positive | None,
        Meaning(
            "Time after which the next part begins; by default the path's duration, which must "
            "be finite unless the part is the last one. A shorter time changes the path while it "
            "is followed, a longer one waits where it ends.",
            unit="s",
        ),
    ] = None
    bridge: Annotated[
        NonNegative,
        Meaning("Time of a move that leads to the part's start; 0 for none.", unit="s"),
    ] = 0.0


def _parts(value: Any) -> Any:
    """Return parts; a path alone becomes a part that lasts as long as the path."""
    if not isinstance(value, (list, tuple)) or not value:
        raise ValueError("must be a list of one part or more")
    entries = [as_path(entry) for entry in value]
    return tuple(Part(path=entry) if isinstance(entry, Path) else entry for entry in entries)


@validated
class Sequence(Path):
    """Paths one after another.

    Each part begins with the pose that is desired then: a part without a place of its own begins
    there, and one in the frame of the tool is given in that pose. Where the end of a part does not
    meet the start of the next one, in position and velocity, orientation and angular velocity, a
    bridge is needed: it begins with the motion of the one and ends with that of the other, up to
    the acceleration. With a bridge of time b from velocity v to the first velocity w of a part
    without a place of its own, that part begins b (v + w) / 2 further on.

    The first part may begin away from the arm and at speed, like any path; with a bridge it is
    approached from rest.
    """

    kind: Literal["sequence"] = "sequence"
    summary = "Paths one after another."
    parts: Annotated[
        tuple[Part, ...],
        BeforeValidator(_parts),
        Meaning("The parts; a path alone is a part of its own duration."),
    ]

    @property
    def has_place(self) -> bool:
        """Whether the first part lies where it is given."""
        return self.parts[0].path.has_place and not self.parts[0].bridge

    @property
    def frames(self) -> frozenset[str]:
        return frozenset(name for part in self.parts for name in part.path.frames)

    @property
    def notes(self) -> list[str]:
        """See `Path.notes`."""
        return [note for part in self.parts for note in part.path.notes]

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        first, *others = self.parts
        pieces: list[_Piece] = []
        if first.bridge:
            if p_WE is None:
                raise InvalidInputError("p_WE: must be given, for a bridge that begins there")
            pieces += _bridge(first, State.at_rest(p_WE, R_WE), 0.0, frames)
        else:
            pieces.append(_Piece.of(first, first.path.placed(p_WE, R_WE, frames), 0.0))
        for number, part in enumerate(others, 1):
            last = pieces[-1]
            if not np.isfinite(last.end):
                raise InvalidInputError(
                    f"path.parts.{number - 1}: has no end; give it lasts, or laps to its path"
                )
            before = State.at_end(last.path, last.end - last.begin)
            if part.bridge:
                pieces += _bridge(part, before, last.end, frames)
                continue
            placed_path = part.path.placed(*before.pose, frames)
            require_meeting(before, State.at_start(placed_path), f"path.parts.{number}")
            pieces.append(_Piece.of(part, placed_path, last.end))
        return _PlacedSequence(tuple(pieces))


@dataclass(frozen=True, eq=False)
class _Piece:
    """A path that is followed from one time to another.

    Attributes:
        begin, end: These times [s]; the end may be infinite.
        path: The path, whose time begins at 0 when the piece begins.
    """

    begin: float
    end: float
    path: PlacedPath

    @classmethod
    def of(cls, part: Part, path: PlacedPath, begin: float) -> _Piece:
        lasts = path.duration if part.lasts is None else part.lasts
        return cls(begin, begin + lasts, path)


def _bridge(
    part: Part, before: State, begin: float, frames: Mapping[str, RigidTransform] | None
) -> list[_Piece]:
    """Return the bridge to a part, and the part."""
    p, R = before.pose
    placed_path = part.path.placed(p, R, frames)
    if not part.path.has_place:
        v = before.position[1] + placed_path.position(0.0)[1]
        placed_path = part.path.placed(p + part.bridge / 2.0 * v, R, frames)
    way = bridge(before, State.at_start(placed_path), part.bridge)
    end = begin + part.bridge
    return [_Piece(begin, end, way), _Piece.of(part, placed_path, end)]


@dataclass(frozen=True, eq=False)
class _PlacedSequence(PlacedPath):
    """Pieces in the world frame; each begins when the piece before it ends."""

    pieces: tuple[_Piece, ...]

    @property
    def duration(self) -> float:
        return self.pieces[-1].end

    @property
    def traversal(self) -> float:
        last = self.pieces[-1]
        return min(last.begin + last.path.traversal, last.end)

    @property
    def closed(self) -> bool:
        if not np.isfinite(self.duration):
            return False
        way = self.position(self.duration)[0] - self.position(0.0)[0]
        return bool(np.linalg.norm(way) < _CLOSURE)

    @property
    def turns(self) -> bool:
        return any(piece.path.turns for piece in self.pieces)

    @property
    def oriented(self) -> bool:
        return all(piece.path.oriented for piece in self.pieces)

    def _piece(self, t: float) -> _Piece:
        if not np.isfinite(t):
            raise InvalidInputError(f"t: must be finite, not {t}")
        number = bisect_right(self.pieces, t, key=lambda piece: piece.begin)
        return self.pieces[max(number - 1, 0)]

    def position(self, t: float) -> Motion:
        piece = self._piece(t)
        if t < piece.end:
            return piece.path.position(t - piece.begin)
        return piece.path.position(piece.end - piece.begin)[0], np.zeros(3), np.zeros(3)

    def orientation(self, t: float) -> Motion:
        piece = self._piece(t)
        if t < piece.end:
            return piece.path.orientation(t - piece.begin)
        return piece.path.orientation(piece.end - piece.begin)[0], np.zeros(3), np.zeros(3)

    def _breaks(self, until: float) -> list[Array | float]:
        pieces = [piece for piece in self.pieces if piece.begin <= until]
        ends = [piece.end for piece in pieces]
        return [
            *ends,
            *(one.begin + one.path.knots(min(until, one.end) - one.begin) for one in pieces),
        ]
