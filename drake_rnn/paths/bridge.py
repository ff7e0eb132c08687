"""Transitions from one path to the next: whether they meet, and a move between them if not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.rotation import rotation_error
from .path import Motion, PlacedPath
from .pieces import quintic_pieces
from .trajectory import TrajectoryPath
from .turning import quaternion_rates

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
