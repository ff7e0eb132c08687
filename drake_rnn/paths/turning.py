"""Orientations that vary in time, with angular velocity and acceleration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import pairwise
from math import sqrt

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.trajectories import PiecewiseQuaternionSlerp, Trajectory

from ..inputs.fields import Array
from .path import Motion

# Cosine of half the angle of a turn up to which its direction is not clear.
_HALF_TURN = 1e-6


class Turning(ABC):
    """An orientation as a function of time."""

    @abstractmethod
    def at(self, t: float) -> Motion:
        """Return the orientation at time ``t`` [s].

        Returns:
            Rotation matrix, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2],
            each of shape (3,), in the axes that the orientation refers to.
        """


class SlerpTurning(Turning):
    """Spherical linear interpolation: the angular velocity is constant between quaternions."""

    def __init__(self, trajectory: PiecewiseQuaternionSlerp) -> None:
        self._trajectory = trajectory

    def at(self, t: float) -> Motion:
        R = self._trajectory.orientation(t).rotation()
        w = np.asarray(self._trajectory.angular_velocity(t)).ravel()
        return R, w, np.zeros(3)


class QuaternionTurning(Turning):
    """A trajectory of quaternions w, x, y, z, which need not be of unit length.

    The orientation is that of q / |q|. With the product of quaternions, and v(q) the part
    x, y, z, the angular velocity is w = 2 v(q' q*) / |q|^2, since what changes |q| alone adds
    nothing to v; and w' = 2 v(q'' q*) / |q|^2 - 2 (q . q') / |q|^2 w.

    Args:
        trajectory: Quaternions, 4 rows, which do not vanish.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._q = trajectory
        self._dq, self._ddq = (trajectory.MakeDerivative(order) for order in (1, 2))

    def at(self, t: float) -> Motion:
        q, dq, ddq = (x.value(t).ravel() for x in (self._q, self._dq, self._ddq))
        square = float(q @ q)
        w = (2.0 / square) * _against(dq, q)
        alpha = (2.0 / square) * (_against(ddq, q) - float(q @ dq) * w)
        return Quaternion(q / sqrt(square)).rotation(), w, alpha


def _against(p: Array, q: Array) -> Array:
    """Return the part x, y, z of the product of ``p`` and the conjugate of ``q``, shape (3,)."""
    # Plain floats: this runs at every sample, and NumPy's overhead would take most of its time.
    (pw, px, py, pz), (qw, qx, qy, qz) = p.tolist(), q.tolist()
    return np.array(
        (
            qw * px - pw * qx - py * qz + pz * qy,
            qw * py - pw * qy - pz * qx + px * qz,
            qw * pz - pw * qz - px * qy + py * qx,
        )
    )


def aligned(quaternions: Array) -> Array:
    """Return quaternions with signs such that each turns from the one before by the shorter way.

    Args:
        quaternions: Shape (k, 4).

    Raises:
        ValueError: If two successive ones are half a turn apart, which has no shorter way.
    """
    signs = [1.0]
    for k, (one, other) in enumerate(pairwise(quaternions), 2):
        along = float(one @ other)
        if abs(along) < _HALF_TURN:
            raise ValueError(
                f"orientation {k}: is half a turn from the one before, either way round; give one "
                "between them"
            )
        signs.append(np.copysign(signs[-1], signs[-1] * along))
    return quaternions * np.array(signs)[:, np.newaxis]


def quaternion_rates(R: Array, w: Array, alpha: Array) -> tuple[Array, Array, Array]:
    """Return the unit quaternion of an orientation and its two derivatives, each of shape (4,).

    Args:
        R: Rotation matrix, shape (3, 3).
        w: Angular velocity, shape (3,) [rad/s].
        alpha: Angular acceleration, shape (3,) [rad/s^2].
    """
    q = RotationMatrix.ProjectToRotationMatrix(R).ToQuaternion().wxyz()
    dq = 0.5 * _times(w, q)
    return q, dq, 0.5 * _times(alpha, q) - 0.25 * float(w @ w) * q


def _times(w: Array, q: Array) -> Array:
    """Return the product of the quaternion (0, w) and ``q``, shape (4,)."""
    return np.array([-w @ q[1:], *(q[0] * w + np.cross(w, q[1:]))])
