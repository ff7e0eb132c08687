"""The parts of a run that a page replays: the motion, and the contact with a surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RotationMatrix

from ..environments import Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..runs.result import Result
from .surface import clipped_to_edges, projected

# Extent below which a path is a point [m].
_STILL = 1e-6
# Heights of the desired and of the traced line above the surface [m]: far enough apart for a
# browser to draw one over the other.
_DESIRED_ABOVE = 4e-4
_TRACED_ABOVE = 8e-4


@dataclass(frozen=True)
class ReplayedMotion:
    """The motion of a run in the world frame: k samples, n joints, j points of a path.

    Attributes:
        result: The run.
        time: Time since the first sample, shape (k,) [s].
        position: Joint positions, shape (k, n) [rad].
        traced: Position of the end effector, shape (k, 3) [m].
        desired: Desired position of the end effector, shape (k, 3) [m].
        course: The desired path passed once, shape (j, 3) [m].
        ends: Whether the course shows an open path to its end.
    """

    result: Result
    time: Array
    position: Array
    traced: Array
    desired: Array
    course: Array
    ends: bool

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.time[-1])

    @property
    def rests(self) -> bool:
        """Whether the desired path is a single point."""
        return bool(np.ptp(self.course, axis=0).max() < _STILL)

    @property
    def turns(self) -> bool:
        """Whether the desired path turns the end effector."""
        return self.result.experiment.desired.turns

    def pen_is_down(self, points: Array) -> NDArray[np.bool_]:
        """Return which points of the desired path a pen draws, see `Path.pen_is_down`."""
        return self.result.experiment.path.pen_is_down(points)

    def path_time(self, time: float) -> float:
        """Return the time along the path, ``time`` [s] after the first sample [s]."""
        return float(self.result.time[0]) + time - self.result.experiment.path_delay

    def at(self, time: Array, values: Array) -> Array:
        """Return ``values``, shape (k, m), linearly interpolated at ``time``, shape (f,) [s]."""
        return np.column_stack([np.interp(time, self.time, column) for column in values.T])


@dataclass(frozen=True)
class ReplayedContact:
    """The contact of a run in the world frame: k samples, j points of a path.

    Attributes:
        surface: Surface that the tool presses against.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        desired_force: Desired force once it has risen [N].
        force: Force on the tool, shape (k, 3) [N].
        contact: Point of the surface closest to the tool, shape (k, 3) [m].
        course: The desired path passed once, as a line on the surface, shape (j, 3) [m].
        desired: Desired point on the surface, shape (k, 3) [m].
        trace: Line that a pen in place of the tool would draw, shape (k, 3) [m].
    """

    surface: Surface
    p_WS: Array
    desired_force: float
    force: Array
    contact: Array
    course: Array
    desired: Array
    trace: Array

    @property
    def normal(self) -> Array:
        """Unit normal out of the surface, shape (3,)."""
        return self.surface.normal_W

    @property
    def R_WS(self) -> RotationMatrix:
        """Axes of the surface, z along the normal."""
        return RotationMatrix.MakeFromOneVector(self.normal, 2)

    def strokes(self) -> Iterator[slice]:
        """Yield each interval of samples in which the surface pushes against the tool."""
        yield from stretches(self.force @ self.normal > 0.0)


def stretches(where: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield each interval of samples at which something holds."""
    changes = np.diff(where.astype(int), prepend=0, append=0)
    begins, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
    yield from map(slice, begins.tolist(), ends.tolist())


def name_of(result: Result) -> str:
    """Return the name of a run; of a run without a name, the name of its arm."""
    return result.experiment.name or result.experiment.arm.name


def replayed_motion(result: Result) -> ReplayedMotion:
    """Return the motion of a run, up to its last finite posture.

    Raises:
        InvalidInputError: If the run contains no finite posture.
    """
    experiment = result.experiment
    # A run that diverged is shown up to where it did.
    finite = np.isfinite(result.series["position"]).all(axis=1)
    count = finite.size if finite.all() else int(np.argmin(finite))
    if count == 0:
        raise InvalidInputError("playback: the run holds no posture")
    time = result.time[:count] - result.time[0]
    position = result.series["position"][:count]
    kinematics = experiment.arm.kinematics()
    # A planar task leaves the height as it is at the start.
    desired = np.tile(experiment.desired.position(0.0)[0], (count, 1))
    desired[:, list(experiment.task.axes)] = result.desired_position[:count]
    passed = experiment.desired.traversal + experiment.path_delay
    return ReplayedMotion(
        result=result,
        time=time,
        position=position,
        traced=np.array([kinematics.p_WE(q) for q in position]),
        desired=desired,
        course=desired[time <= passed * (1.0 + 1e-9)],
        ends=not experiment.desired.closed and bool(time[-1] >= passed * (1.0 - 1e-9)),
    )


def replayed_contact(motion: ReplayedMotion) -> ReplayedContact | None:
    """Return the contact of a motion; None for an experiment without one."""
    experiment = motion.result.experiment
    if experiment.contact is None:
        return None
    surface = experiment.contact.surface
    n = surface.normal_W
    p_WS = experiment.contact.place(experiment.arm, experiment.start)
    # Distance from the end effector to the tool's end, which touches the surface.
    standoff = float(n @ (experiment.p_WE_start - p_WS)) - surface.gap

    below = projected(motion.traced - standoff * n, surface, p_WS)
    touched = clipped_to_edges(below, surface, p_WS)
    desired = projected(motion.desired, surface, p_WS) + _DESIRED_ABOVE * n
    return ReplayedContact(
        surface=surface,
        p_WS=p_WS,
        desired_force=experiment.contact.force.value,
        # A run that diverged may have postures without a finite force.
        force=np.nan_to_num(motion.result.series["contact_force"][: len(motion.time)]),
        contact=touched,
        course=desired[: len(motion.course)],
        desired=desired,
        trace=touched + _TRACED_ABOVE * n,
    )
