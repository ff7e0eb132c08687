"""Tasks: the part of the end effector's motion that is controlled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array
from .kinematics import ArmKinematics


@dataclass(frozen=True)
class Task:
    """Axes of the position of the task frame E that are controlled, and perhaps its orientation.

    Attributes:
        axes: Axes of the position, each 0 to 2.
        with_orientation: Whether the orientation is controlled; the first three rows of J are then
            those of the angular velocity.
    """

    axes: tuple[int, ...]
    with_orientation: bool = False

    @property
    def size(self) -> int:
        """Number of rows of J."""
        return 3 * self.with_orientation + len(self.axes)

    def position(self, vector: Array) -> Array:
        """Return the rows of ``vector``, shape (3, ...), that belong to the task's axes."""
        return vector if len(self.axes) == 3 else vector[list(self.axes)]

    def J(self, kinematics: ArmKinematics, q: Array) -> Array:
        """Return the task's Jacobian, shape (size, n); rotation comes first, as in Drake."""
        J = self.position(kinematics.J(q))
        return np.vstack((kinematics.J_omega(q), J)) if self.with_orientation else J


#: The tasks an experiment may name.
TASKS = {"xyz": Task((0, 1, 2)), "xy": Task((0, 1)), "pose": Task((0, 1, 2), True)}


def named_task(name: str) -> Task:
    """Return the task of this name.

    Raises:
        InvalidInputError: If there is no such task.
    """
    if not isinstance(name, str) or name not in TASKS:
        raise InvalidInputError(f"task: may be {', '.join(TASKS)}, not {short(name)}")
    return TASKS[name]


def tasks_suiting(shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the names of the tasks of which signals of these shapes may be.

    Args:
        shapes: Shapes by the names of signals; those that depend on the task have their number of
            rows.
    """

    def suits(task: Task) -> bool:
        axes, size = len(task.axes), task.size
        rows = {"p_WE": axes, "v_WE": axes, "Jdot_v": axes, "J": size, "J_hat": size}
        return all(shapes[name][0] == rows[name] for name in rows.keys() & shapes.keys())

    return [name for name, task in TASKS.items() if suits(task)]
