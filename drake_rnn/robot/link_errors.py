"""Errors in the dimensions of an arm: each robot's links a little other than the model's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from .screws import Screws


@dataclass(frozen=True, eq=False)
class LinkErrors:
    """Displacements of an arm's joints and of its task frame E, each seen from the link before.

    Row i displaces the i-th joint between base and E, and all that comes after it, and is given in
    the axes of that joint's own frame, as the model states it: in URDF, that of its ``origin``.
    The last row displaces E, in its own axes: the error of a tool. Leading axes are robots.

    Attributes:
        translation: Displacement of the frame's origin, shape (..., k + 1, 3) [m].
        rotation: Rotation about that origin, as a rotation vector, shape (..., k + 1, 3) [rad].

    Raises:
        InvalidInputError: If an array has another shape, or is not finite.
    """

    translation: Array
    rotation: Array

    def __post_init__(self) -> None:
        for name in ("translation", "rotation"):
            given = self.__dict__[name]
            require_type(name, given, np.ndarray)
            if given.ndim < 2 or given.shape[-1] != 3 or not np.isfinite(given).all():
                raise InvalidInputError(
                    f"{name}: must be finite, of shape (..., joints + 1, 3), not {given.shape}"
                )


def random_link_errors(
    screws: Screws,
    rng: np.random.Generator,
    robots: int,
    translation: float = 0.02,
    rotation: float = float(np.deg2rad(2.0)),
) -> LinkErrors:
    """Return errors for each of a number of robots, uniform and independent in each coordinate.

    A robot's errors do not depend on how many come after it.

    Args:
        screws: The arm without errors.
        rng: Generator of the errors.
        robots: Number of robots.
        translation: Largest error of each coordinate [m].
        rotation: Largest error about each axis [rad].

    Raises:
        InvalidInputError: If a number is negative.
    """
    for name, value in (("robots", robots), ("translation", translation), ("rotation", rotation)):
        if not 0 <= value < np.inf:
            raise InvalidInputError(f"{name}: must be at least 0, not {value}")
    drawn = rng.uniform(-1.0, 1.0, (robots, len(screws.slides) + 1, 2, 3))
    return LinkErrors(translation * drawn[:, :, 0], rotation * drawn[:, :, 1])


def with_link_errors(screws: Screws, errors: LinkErrors) -> Screws:
    """Return an arm whose links have errors, or several of them.

    Args:
        screws: The arm without them; its leading axes and those of the errors are broadcast.
        errors: The errors.

    Raises:
        InvalidInputError: If the errors are for another number of joints.
    """
    k = len(screws.slides)
    translation, turn = np.broadcast_arrays(errors.translation, errors.rotation)
    if translation.shape[-2] != k + 1:
        raise InvalidInputError(
            f"errors: must have {k + 1} rows, one for each joint that moves E and one for E, not "
            f"{translation.shape[-2]}"
        )
    # How far all that comes next is turned against the arm without errors.
    R: Array = np.eye(3)
    axes, offsets, frames = [], [], []
    for i in range(k + 1):
        last = i == k
        frame = screws.R_WE if last else screws.R_WF[..., i, :, :]
        shift = screws.offsets[..., i, :] + _times(frame, translation[..., i, :])
        offsets.append(_times(R, shift))
        R = _product(R, _rotation(_times(frame, turn[..., i, :])))
        frames.append(_product(R, frame))
        if not last:
            axes.append(_times(R, screws.axes[..., i, :]))
    *R_WF, R_WE = np.broadcast_arrays(*frames)
    return replace(
        screws,
        axes=np.stack(np.broadcast_arrays(*axes), axis=-2),
        offsets=np.stack(np.broadcast_arrays(*offsets), axis=-2),
        R_WE=R_WE,
        R_WF=np.stack(R_WF, axis=-3),
    )


# Sums of three products in a fixed order: a robot's arm does not depend on the others'.


def _times(R: Array, a: Array) -> Array:
    return np.asarray((R * a[..., None, :]).sum(axis=-1))


def _product(A: Array, B: Array) -> Array:
    return np.asarray((A[..., :, :, None] * B[..., None, :, :]).sum(axis=-2))


def _rotation(vector: Array) -> Array:
    """Return the rotations by rotation vectors, shape (..., 3, 3) (O. Rodrigues)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    none = np.zeros_like(x)
    K = np.stack((none, -z, y, z, none, -x, -y, x, none), axis=-1).reshape(*x.shape, 3, 3)
    angle = np.sqrt(x * x + y * y + z * z)[..., None, None]
    # NumPy's sinc is sin(pi x) / (pi x), and 1 at 0.
    half = np.sinc(0.5 * angle / np.pi)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half * half * _product(K, K))
