"""Which part of the end effector's motion a task is about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .kinematics import ArmKinematics


@dataclass(frozen=True)
class Task:
    """Axes of the position, and perhaps the orientation, of the task frame E.

    Attributes:
        axes: Of the position, 0 to 2.
        with_orientation: Whether the rows of J begin with those of the angular velocity.
    """

    axes: tuple[int, ...]
    with_orientation: bool = False

    @property
    def size(self) -> int:
        """Rows of J."""
        return 3 * self.with_orientation + len(self.axes)

    def position(self, vector: Array) -> Array:
        """The task's axes of a vector, shape (3,)."""
        return vector if len(self.axes) == 3 else vector[list(self.axes)]

    def J(self, kinematics: ArmKinematics, q: Array) -> Array:
        """The task's Jacobian, shape (size, n); as in Drake, rotation comes first."""
        J = self.position(kinematics.J(q))
        return np.vstack((kinematics.J_omega(q), J)) if self.with_orientation else J


#: The tasks an experiment may name.
TASKS = {"xyz": Task((0, 1, 2)), "xy": Task((0, 1)), "pose": Task((0, 1, 2), True)}


def named_task(name: str) -> Task:
    """The task of this name.

    Raises:
        InvalidInputError: If there is none.
    """
    if name not in TASKS:
        raise InvalidInputError(f"task: may be {', '.join(TASKS)}, not {name!r}")
    return TASKS[name]
