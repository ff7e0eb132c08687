"""Errors of an arm's links as a document describes them: drawn from a seed."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from ..inputs.fields import NonNegative, Seed, between, validated
from .link_errors import LinkErrors

# Its stream of random numbers, beside those of runs.
_STREAM = 7
_DEGREE = np.pi / 180.0


@validated
class LinkErrorSettings:
    """Errors in the dimensions of an arm, uniform and independent in each coordinate of each joint.

    The arm that moves has them, and whoever is told of its kinematics is told of that arm. Joint
    frames are displaced in their own axes, with all that comes after them; the task frame stands on
    the last link as the model says.

    Args:
        seed: Seed of what is drawn.
        translation: Largest error of each coordinate of a joint's place [m].
        rotation: Largest error about each axis [rad].
    """

    seed: Seed = 0
    translation: Annotated[NonNegative, between(0.0, 0.2)] = 0.02
    rotation: Annotated[NonNegative, between(0.0, 0.5)] = 2.0 * _DEGREE

    def drawn(self, joints: int) -> LinkErrors:
        """Return the errors of a number of joints, those of the first ones whatever comes after.

        The last row, that of the task frame, is zero.
        """
        drawn = np.random.default_rng([self.seed, _STREAM]).uniform(-1.0, 1.0, (joints, 2, 3))
        rows = np.concatenate((drawn, np.zeros((1, 2, 3))))
        return LinkErrors(self.translation * rows[:, 0], self.rotation * rows[:, 1])
