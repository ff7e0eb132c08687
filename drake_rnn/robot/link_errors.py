"""Errors in the dimensions of an arm: links that differ a little from the model's, per robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    checked,
    instance,
    number,
    whole,
)
from ..inputs.messages import require_type
from .rotation import product, rotation_by, times
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
        InvalidInputError: If an array has another shape, or is not finite, or they differ in shape.
    """

    translation: Array
    rotation: Array

    def __post_init__(self) -> None:
        for name in ("translation", "rotation"):
            value = self.__dict__[name]
            require_type(name, value, np.ndarray)
            if value.ndim < 2 or value.shape[-1] != 3 or not np.isfinite(value).all():
                raise InvalidInputError(
                    f"{name}: must be finite, of shape (..., joints + 1, 3), not {value.shape}"
                )
        if self.rotation.shape != self.translation.shape:
            raise InvalidInputError(
                f"rotation: must have the shape of translation, {self.translation.shape}, not "
                f"{self.rotation.shape}"
            )


@checked(
    screws=instance(Screws),
    rng=instance(np.random.Generator),
    robots=whole(0, 10**7),
    translation=number(0.0),
    rotation=number(0.0),
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
        InvalidInputError: If a number is negative, or an argument of another class.
    """
    draws = rng.uniform(-1.0, 1.0, (robots, len(screws.slides) + 1, 2, 3))
    return LinkErrors(translation * draws[:, :, 0], rotation * draws[:, :, 1])


def with_link_errors(screws: Screws, errors: LinkErrors) -> Screws:
    """Return an arm whose links have errors, or several of them.

    Args:
        screws: The arm without them; its leading axes and those of the errors are broadcast.
        errors: The errors.

    Raises:
        InvalidInputError: If the errors are for another number of joints, or of robots.
    """
    require_type("screws", screws, Screws)
    require_type("errors", errors, LinkErrors)
    k, translation, turn = len(screws.slides), errors.translation, errors.rotation
    if translation.shape[-2] != k + 1:
        raise InvalidInputError(
            f"errors: must have {k + 1} rows, one for each joint that moves E and one for E, not "
            f"{translation.shape[-2]}"
        )
    try:
        np.broadcast_shapes(screws.robots, translation.shape[:-2])
    except ValueError:
        raise InvalidInputError(
            f"errors: are for robots of shape {translation.shape[:-2]}, but the arms are of "
            f"{screws.robots}"
        ) from None
    # Rotation of the next links relative to the arm without errors.
    R: Array = np.eye(3)
    axes, offsets, frames = [], [], []
    for i in range(k + 1):
        last = i == k
        frame = screws.R_WE if last else screws.R_WF[..., i, :, :]
        shift = screws.offsets[..., i, :] + times(frame, translation[..., i, :])
        offsets.append(times(R, shift))
        R = product(R, rotation_by(times(frame, turn[..., i, :])))
        frames.append(product(R, frame))
        if not last:
            axes.append(times(R, screws.axes[..., i, :]))
    *R_WF, R_WE = np.broadcast_arrays(*frames)
    return replace(
        screws,
        axes=np.stack(np.broadcast_arrays(*axes), axis=-2),
        offsets=np.stack(np.broadcast_arrays(*offsets), axis=-2),
        R_WE=R_WE,
        R_WF=np.stack(R_WF, axis=-3),
    )
