"""Errors of an arm's links, drawn from a seed, as a document describes them."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from ..inputs.fields import NonNegative, Seed, between, validated
from ..inputs.keys import Meaning
from .link_errors import LinkErrors

# Stream of the random numbers, different from the streams of runs.
_STREAM = 7
_DEGREE = np.pi / 180.0


@validated
class LinkErrorSettings:
    """Errors in the dimensions of an arm, uniform and independent in each coordinate of each joint.

    The arm that moves has these errors, and all kinematics are those of that arm. Each joint frame
    is displaced in its own axes, together with all links after it; the task frame keeps its place
    on the last link.
    """

    seed: Annotated[Seed, Meaning("Seed of the errors.")] = 0
    translation: Annotated[
        NonNegative,
        between(0.0, 0.2),
        Meaning("Largest error of each coordinate of a joint's position.", unit="m"),
    ] = 0.02
    rotation: Annotated[
        NonNegative,
        between(0.0, 0.5),
        Meaning("Largest error about each axis.", unit="rad"),
    ] = 2.0 * _DEGREE

    def drawn(self, joints: int) -> LinkErrors:
        """Return the errors of a number of joints and, in a last row of zeros, of the task frame.

        The errors of a joint do not depend on the number of joints.
        """
        drawn = np.random.default_rng([self.seed, _STREAM]).uniform(-1.0, 1.0, (joints, 2, 3))
        rows = np.concatenate((drawn, np.zeros((1, 2, 3))))
        return LinkErrors(self.translation * rows[:, 0], self.rotation * rows[:, 1])
