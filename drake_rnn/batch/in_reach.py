"""Whether the paths of many robots are in reach: what can be said of most at little cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..experiment import MISS, Experiment
from ..experiment.reach import reach_times
from ..inputs.fields import Array
from ..paths.relative import displacement_of
from .desired import Tables
from .grouping import BLOCK, Robot, arm_of_all, contents
from .signals import Sight

# Steps of Newton's method at the path's first point, which may be far, and at each of the others.
_FIRST, _NEXT = 50, 2
_LONGEST, _DAMPING = 0.2, 1e-6
# Share of the largest miss up to which a path is in reach without doubt.
_SURELY = 0.1


def surely_in_reach(robots: Sequence[Robot]) -> NDArray[np.bool_]:
    """Return for each robot whether its path is in reach beyond doubt, shape (robots,).

    All follow their paths at once by a few steps of damped least squares, at the points at which
    the check before a single run does. Who comes within a tenth of the miss that this check
    allows passes it. Of others, and of planar tasks and of those with an orientation, nothing is
    said: ask `drake_rnn.experiment.check_reach`. What is said of a robot does not depend on the
    others.

    Args:
        robots: The robots.
    """
    # Those with a target posture have nothing to follow; some need not be able to.
    sure = np.array([_need_not(robot.experiment) for robot in robots], dtype=bool)
    times: dict[object, Array] = {}
    groups: dict[object, tuple[Array, list[int]]] = {}
    for number, robot in enumerate(robots):
        if sure[number] or not _can_tell(robot.experiment):
            continue
        path = _path(robot.experiment)
        if path not in times:
            times[path] = reach_times(robot.experiment)
        at, arm = times[path], robot.arm
        key = at.tobytes(), robot.experiment.document.task, arm.slides, arm.columns, arm.n
        groups.setdefault(key, (at, []))[1].append(number)
    for at, numbers in groups.values():
        for begin in range(0, len(numbers), BLOCK):
            some = numbers[begin : begin + BLOCK]
            sure[some] = _followed([robots[number] for number in some], at)
    return sure


def _need_not(experiment: Experiment) -> bool:
    return experiment.target is not None or experiment.document.on_unreachable == "follow"


def _can_tell(experiment: Experiment) -> bool:
    return not experiment.holds_orientation and len(experiment.task.axes) == 3


def _path(experiment: Experiment) -> object:
    """Return what identifies the shape of a path and the time in which it is passed."""
    shared, duration = displacement_of(experiment.desired), experiment.document.duration
    shape = id(experiment.desired) if shared is None else contents(shared[0])
    return shape, duration


def _followed(robots: Sequence[Robot], times: Array) -> NDArray[np.bool_]:
    """Return whether robots with the same task and the same times come close to their paths."""
    experiments = [robot.experiment for robot in robots]
    arm, task = arm_of_all(robots), experiments[0].task
    tables, rows = Tables(experiments, times, rotates=False), list(task.axes)
    shift = np.array([_shift(experiment) for experiment in experiments])
    q: Array = np.array([experiment.start for experiment in experiments])
    sure = np.ones(len(robots), dtype=bool)
    with np.errstate(all="ignore"):
        for number in range(times.size):
            target = (tables.position(tables.row(number))[0] - shift)[:, rows]
            for _ in range(_FIRST if number == 0 else _NEXT):
                sight = Sight(task, arm.at(q), q)
                q = q + _step(np.ascontiguousarray(sight.J), target - sight.p_WE)
            miss = target - Sight(task, arm.at(q), q).p_WE
            # A number that is none is not less than any.
            sure &= (miss * miss).sum(axis=-1) < (_SURELY * MISS) ** 2
    return sure


def _shift(experiment: Experiment) -> Array:
    """Return by how much a path lies off the surface that the tool is to touch [m]."""
    if (contact := experiment.contact) is None:
        return np.zeros(3)
    return contact.surface.gap * np.asarray(contact.surface.normal_W)


def _step(J: Array, error: Array) -> Array:
    """Return steps of damped least squares, shape (robots, n), none longer than 0.2 rad."""
    A = J @ J.swapaxes(-1, -2) + _DAMPING * np.eye(J.shape[-2])
    step = (J.swapaxes(-1, -2) @ np.linalg.solve(A, error[..., None]))[..., 0]
    longest = np.abs(step).max(axis=-1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, _LONGEST / np.maximum(longest, _LONGEST)))
