"""The task of an end effector: axes of its position, its pose, or a list of objectives.

The objectives are in `drake_rnn.robot.task_objectives`, the frames that they are about in
`drake_rnn.robot.task_frame`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import is_not
from typing import Any

import numpy as np

from ..arrays.algebra import functions_of
from ..errors import InvalidInputError
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array
from ..inputs.kinds import Modules
from ..inputs.messages import plain, short
from .task_frame import Place, Pose, ToolFrame, pose_of, stack
from .task_objectives import TASK_OBJECTIVES, RowBlock, TaskObjective


@dataclass(frozen=True)
class Task:
    """Axes of the position of the task frame E that are controlled, and perhaps its orientation.

    Attributes:
        axes: Axes of the position, each 0 to 2.
        with_orientation: Whether the orientation is controlled; the first three rows of J are then
            those of the angular velocity.
        objectives: What is asked in place of these, in order; then the above are what errors are
            measured along: the axes that objectives follow the path with, or all if there are none.
        start: Orientation of E at the start, row by row, to which objectives refer; None if it is
            not known yet.
        key: Text that tells tasks of objectives apart.
        places: Of an arm with two tools, the poses at the start of frames that objectives are
            about, each a name and the twelve numbers of position and orientation, row by row.
    """

    axes: tuple[int, ...]
    with_orientation: bool = False
    objectives: tuple[TaskObjective, ...] = field(default=(), compare=False)
    start: tuple[float, ...] | None = None
    key: str = ""
    places: tuple[tuple[str, tuple[float, ...]], ...] = ()

    @classmethod
    def of(cls, section: Sequence[Any], modules: Modules = True) -> Task:
        """Return the task of a list of objectives, as a document has it.

        Args:
            section: The entries, each with its ``kind`` and its keys.
            modules: Modules that may be imported for a class.

        Raises:
            InvalidInputError: If the list is empty, or an entry is wrong.
        """
        if not section:
            raise InvalidInputError("task: must have one objective or more, not []")
        objectives = tuple(
            _objective(entry, f"task[{number}]", modules) for number, entry in enumerate(section)
        )
        own = [each for each in objectives if each.of is None]
        axes = [axis for each in own for axis in each.path_axes]
        if len(set(axes)) < len(axes):
            raise InvalidInputError("task: two objectives follow the path along the same axis")
        frames = [each.of for each in objectives if each.with_orientation]
        if frame_twice := [each for each in frames if frames.count(each) > 1]:
            of = f" of {frame_twice[0]}" if frame_twice[0] else ""
            raise InvalidInputError(f"task: must have one orientation{of} at most")
        if all(each.bounds is not None for each in objectives):
            raise InvalidInputError(
                "task: must have an objective with a value besides ranges, which leave all free"
            )
        turns = any(each.with_orientation for each in own)
        key = json.dumps(plain(list(section)), sort_keys=True, default=repr)
        return cls(tuple(sorted(axes)) or (0, 1, 2), turns, objectives, None, key)

    def at(self, R_WE: Array, kinematics: Any = None, q: Array | None = None) -> Task:
        """Return the task of an arm that starts with an orientation of E, shape (3, 3).

        Args:
            R_WE: The orientation, shape (3, 3).
            kinematics: Kinematics of the arm, for objectives that refer to more of its start.
            q: Its start, shape (n,) [rad].

        Raises:
            InvalidInputError: If an objective is not one from there.
        """
        if not self.objectives:
            return self
        R_WE, p_WE = np.asarray(R_WE, dtype=float), None
        places: dict[str, Place] = {}
        if kinematics is not None:
            p_WE = np.array(kinematics.p_WE(q))
            for frame in self.frames:
                pose = pose_of(kinematics, np.asarray(q), frame)
                places[frame] = Place(np.array(pose.p_WE), np.array(pose.R))
        placed = []
        for number, each in enumerate(self.objectives):
            place = places.get(each.of or "")
            p, R = (p_WE, R_WE) if place is None else place
            placed.append(each.at(f"task[{number}]", R, p))
        key = self.key
        if p_WE is not None and any(map(is_not, placed, self.objectives)):
            key = json.dumps([key, p_WE.tolist()])
        return replace(
            self,
            objectives=tuple(placed),
            start=tuple(R_WE.ravel().tolist()),
            key=key,
            places=tuple(
                (name, (*p.tolist(), *R.ravel().tolist())) for name, (p, R) in places.items()
            ),
        )

    @property
    def frames(self) -> tuple[ToolFrame, ...]:
        """Frames of two tools that objectives are about, each once."""
        return tuple(dict.fromkeys(each.of for each in self.objectives if each.of is not None))

    def place(self, frame: ToolFrame | None) -> Place:
        """Return the pose of a frame at the start; of E, None, the orientation alone is known."""
        if frame is None:
            return Place(np.full(3, np.nan), self.start_orientation)
        return self._places[frame]

    @cached_property
    def _places(self) -> dict[str, Place]:
        each = {name: np.array(numbers) for name, numbers in self.places}
        return {name: Place(x[:3], x[3:].reshape(3, 3)) for name, x in each.items()}

    def _each(self, kinematics: Any, q: Array) -> list[tuple[TaskObjective, Pose, Array]]:
        """Return each objective with the pose of its frame, and its orientation at the start."""
        frames = dict.fromkeys(each.of for each in self.objectives)
        poses = {frame: pose_of(kinematics, q, frame) for frame in frames}
        return [(each, poses[each.of], self.place(each.of).R) for each in self.objectives]

    @property
    def measured(self) -> Task:
        """Axes and orientation along which errors are measured."""
        return Task(self.axes, self.with_orientation) if self.objectives else self

    @property
    def valued(self) -> Task:
        """The task without the objectives that have a range in place of a value."""
        return replace(self, objectives=tuple(o for o in self.objectives if o.bounds is None))

    @property
    def size(self) -> int:
        """Number of rows of J."""
        if self.objectives:
            return sum(each.size for each in self.objectives)
        return 3 * self.with_orientation + len(self.axes)

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the axes of signals that depend on the task, by their names."""
        return {"axes": self.size if self.objectives else len(self.axes), "rows": self.size}

    @property
    def blocks(self) -> tuple[RowBlock, ...]:
        """What laws know of the rows of its objectives."""
        return tuple(each.block for each in self.objectives)

    @property
    def has_ranges(self) -> bool:
        """Whether an objective has a range in place of a value."""
        return any(block.is_range for block in self.blocks)

    @property
    def has_weights(self) -> bool:
        """Whether an objective has a weight other than 1."""
        return any(block.weight != 1.0 for block in self.blocks)

    @property
    def sees_turning(self) -> bool:
        """Whether an objective follows the orientation of a path."""
        return any(each.sees_turning for each in self.objectives if each.of is None)

    def position(self, vector: Array) -> Array:
        """Return the rows of ``vector``, shape (3, ...), that belong to the task's axes."""
        return vector if len(self.axes) == 3 else vector[list(self.axes)]

    def J(self, kinematics: Any, q: Array) -> Array:
        """Return the task's Jacobian, shape (size, n); rotation comes first, as in Drake."""
        if self.objectives:
            rows = [
                row
                for each, pose, start in self._each(kinematics, q)
                for row in each.rows(pose, start)
            ]
            return functions_of(*rows).stack(rows, axis=-2)
        J = self.position(kinematics.J(q))
        return np.vstack((kinematics.J_omega(q), J)) if self.with_orientation else J

    def coordinates(self, kinematics: Any, q: Array) -> Array:
        """Return the position along the axes, or the coordinates of objectives, shape (..., m)."""
        if not self.objectives:
            return self.position(kinematics.p_WE(q))
        each_one = self._each(kinematics, q)
        return stack([x for each, pose, start in each_one for x in each.coordinates(pose, start)])

    def velocity(self, kinematics: Any, q: Array, v: Array) -> Array:
        """Return their derivative, shape (m,)."""
        if not self.objectives:
            velocity: Array = self.position(kinematics.J(q)).dot(v)
            return velocity
        return self.J(kinematics, q).dot(v)

    def bias(self, kinematics: Any, q: Array, v: Array) -> Array:
        """Return their acceleration at constant joint velocities, shape (..., m)."""
        if not self.objectives:
            return self.position(kinematics.Jdot_v(q, v))
        each_one = self._each(kinematics, q)
        return stack([a for each, pose, start in each_one for a in each.bias(pose, start, v)])

    def desired(self, path: Any, t: Any) -> tuple[Array, Array, Array]:
        """Return what they should be along a path, with two derivatives, shape (..., m) each."""
        if not self.objectives:
            p, v, a = path.position(t)
            return self.position(p), self.position(v), self.position(a)
        each = []
        for objective in self.objectives:
            place = self.place(objective.of)
            way = path if objective.of is None else place.along(path)
            each.append(objective.desired(way, t, place.R))
        p, v, a = (stack([x for one in each for x in one[order]]) for order in range(3))
        return p, v, a

    def errors(
        self,
        p: Array,
        R: Array,
        R_desired: Array,
        time: Any = 0.0,
        frames: Mapping[str, tuple[Array, Array]] | None = None,
    ) -> dict[str, Any]:
        """Return errors and margins of objectives, by the names of `TASK_MEASURES`.

        Args:
            p: Positions of E, shape (k, 3) [m].
            R: Its orientations, shape (k, 3, 3).
            R_desired: Those of the path, likewise.
            time: The time, shape (k,) or a number [s].
            frames: Positions and orientations of each of `frames`, likewise, by their names.
        """
        xp, E = functions_of(p), (p, R, R_desired)
        errors: dict[str, Any] = {}
        for each in self.objectives:
            place = self.place(each.of)
            start, (p, R, R_desired) = place.R, E
            if each.of is not None:
                p, R = (frames or {})[each.of]
                R_desired = 0.0 * R + place.R
                if (away := each.frame_error(p, R, place)) is not None:
                    name = "frame_orientation_error" if each.turns else "frame_position_error"
                    errors[name] = xp.maximum(errors.get(name, 0.0), away)
            margin, angle = each.margin(p, R, start), None
            if margin is None:
                angle = each.angle(p, R, R_desired, start)
            name = "angle_margin" if each.turns else "position_margin"
            if margin is not None:
                errors[name] = xp.minimum(errors.get(name, np.inf), margin)
            if angle is not None:
                errors["axis_error"] = xp.maximum(errors.get("axis_error", 0.0), angle)
            if (distances := each.distances(p, R, time)) is not None:
                away, depth = distances
                errors["shaft_distance"] = xp.maximum(errors.get("shaft_distance", 0.0), away)
                errors["insertion_depth"] = xp.minimum(errors.get("insertion_depth", np.inf), depth)
        return errors

    @cached_property
    def start_orientation(self) -> Array:
        """Orientation of E at the start, shape (3, 3), to which objectives refer."""
        if self.start is None:
            raise InvalidInputError("task: objectives need the start; call Task.at first")
        return np.array(self.start).reshape(3, 3)


def _objective(section: Any, key: str, modules: Modules) -> TaskObjective:
    if not isinstance(section, Mapping):
        raise InvalidInputError(f"{key}: must be a mapping of keys to values, not {short(section)}")
    kind = TASK_OBJECTIVES.named_by(section, modules, key)
    return construct(kind, without_kind(section), key)


#: The tasks an experiment may name.
TASKS = {"xyz": Task((0, 1, 2)), "xy": Task((0, 1)), "pose": Task((0, 1, 2), True)}
#: What an experiment may ask for: the name of a task, or a list of objectives.
TaskSection = str | Sequence[Any] | Task


def named_task(name: TaskSection, modules: Modules = True) -> Task:
    """Return the task of this name, or of a list of objectives; a task itself is returned.

    Args:
        name: The name, the list, or the task.
        modules: Modules that may be imported for objectives.

    Raises:
        InvalidInputError: If there is no such task.
    """
    if isinstance(name, Task):
        return name
    if isinstance(name, (list, tuple)):
        return Task.of(name, modules)
    if not isinstance(name, str) or name not in TASKS:
        raise InvalidInputError(
            f"task: may be {', '.join(TASKS)}, or a list of objectives, not {short(name)}"
        )
    return TASKS[name]


def tasks_suiting(shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the names of the tasks of which signals of these shapes may be.

    Args:
        shapes: Shapes by the names of signals; those that depend on the task have their number of
            rows.
    """
    return [name for name, task in TASKS.items() if suits(task, shapes)]


def suits(task: Task, shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Return whether signals of these shapes may be of a task, see `tasks_suiting`."""
    axes, size = task.lengths["axes"], task.size
    rows = {"p_WE": axes, "v_WE": axes, "Jdot_v": axes, "J": size, "J_hat": size}
    return all(shapes[name][0] == rows[name] for name in rows.keys() & shapes.keys())
