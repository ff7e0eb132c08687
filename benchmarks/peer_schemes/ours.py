"""Our laws on the same tasks: their motion by `simulate`, their cost in a plain loop and in C."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np

from bench import unit
from drake_rnn import (
    Array,
    CompiledStep,
    Experiment,
    InvalidInputError,
    load_experiment,
    simulate,
)
from drake_rnn.robot.task import named_task
from drake_rnn.runs.series import RunOptions
from drake_rnn.runs.simulation import recorded_simulator
from peer_schemes.scheme import Motion, Scheme
from peer_schemes.tasks import Task

# Simulated time over which a diagram is timed [s].
_TIMED = 2.0


@dataclass(frozen=True)
class Ours:
    """A shipped experiment, perhaps with other settings, as a row of the table.

    Attributes:
        name: Name in the table.
        setting: What is set.
        experiment: Name of the experiment.
        tasks: Names of the tasks that it does.
        changes: Changes to its document.
    """

    name: str
    setting: str
    experiment: str
    tasks: tuple[str, ...] = ("position",)
    changes: Mapping[str, Any] = field(default_factory=dict)

    def on(self, task: Task) -> Experiment:
        """Return the experiment on the path of a task; every step of it is stored.

        Raises:
            InvalidInputError: If its arm, limits, start, period or path are not those of the task.
        """
        changes = {"accept": None, **self.changes, "log_period": task.period}
        if task.oriented:
            changes["task"] = "pose"
        found = load_experiment(self.experiment, changes)
        if task.path is not None:
            found = found.with_path(task.path)
        _require_same(found, task)
        return found


def _require_same(experiment: Experiment, task: Task) -> None:
    """Raise an InvalidInputError unless an experiment is about the same task."""
    document, bounds = experiment.document, task.limits.bounds
    if (document.period, document.duration) != (task.period, task.period * task.steps):
        raise InvalidInputError(f"{experiment.name}: another period or duration than {task.name}")
    if experiment.arm.name != task.arm.name or not np.array_equal(experiment.start, task.start):
        raise InvalidInputError(f"{experiment.name}: another arm or start than {task.name}")
    for name in ("position_lower", "position_upper", "velocity", "acceleration"):
        if not np.array_equal(experiment.limits.bounds[name], bounds[name]):
            raise InvalidInputError(f"{experiment.name}: another limit of {name} than {task.name}")
    for k in range(0, task.steps, 500):
        p_WE = experiment.desired.position(k * task.period)[0]
        if not np.allclose(p_WE, task.p_WE[k], rtol=0.0, atol=1e-12):
            raise InvalidInputError(f"{experiment.name}: another path than {task.name}")


class PlainLoop(Scheme):
    """A sampled law called in a loop as in `examples/plain_loop.py`: no diagram, all checks.

    Raises:
        InvalidInputError: If the law sees a signal that is none of the arm's and the path's.
    """

    name, setting = "ours", ""

    def __init__(self, task: Task, experiment: Experiment) -> None:
        super().__init__(task)
        self._kinematics, self._about = task.arm.kinematics(), named_task(experiment.document.task)
        self._reading = experiment.law.sampled(task.period)
        names = list(self._reading.inputs.parts)
        self._desired = _desired(task, experiment)
        moving = self._of_arm()
        if unknown := set(names) - set(self._desired) - set(moving):
            raise InvalidInputError(f"{experiment.name}: sees {', '.join(sorted(unknown))}")
        self._rows = [name for name in names if name in self._desired]
        self._moving = [(name, moving[name]) for name in names if name not in self._desired]
        rng = np.random.default_rng([experiment.document.seed, 0])
        # The velocity at the end of the last sample, which a ramp has and its mean has not.
        self._v = np.zeros(task.arm.n)
        self._x = self._reading.initial_state(rng, self._signals(0, task.start))

    def _of_arm(self) -> dict[str, Callable[[Array, Array], Array]]:
        arm, about = self._kinematics, self._about
        return {
            "position": lambda q, v: q,
            "velocity": lambda q, v: v,
            "p_WE": lambda q, v: about.position(arm.p_WE(q)),
            "v_WE": lambda q, v: about.position(arm.J(q)) @ v,
            "R_WE": lambda q, v: arm.R_WE(q),
            "J": lambda q, v: about.J(arm, q),
            "J_omega": lambda q, v: arm.J_omega(q),
            "Jdot_v": lambda q, v: about.position(arm.Jdot_v(q, v)),
        }

    def _signals(self, k: int, q: Array) -> dict[str, Array]:
        u = {name: read(q, self._v) for name, read in self._moving}
        for name in self._rows:
            u[name] = self._desired[name][k]
        return u

    def pose(self, q: Array) -> tuple[Array, Array]:
        return self._kinematics.p_WE(q), self._kinematics.R_WE(q)

    def velocity(self, k: int, q: Array, v: Array) -> Array:
        t, h, reading = k * self.task.period, self.task.period, self._reading
        self._x = reading.step(t, self._x, self._signals(k, q), h)
        now = reading.commanded_velocity(t, self._x)
        if reading.holds_command:
            self._v = now
            return now
        self._v = reading.commanded_velocity(t + h, self._x)
        # The mean of a ramp over the sample.
        return 0.5 * (now + self._v)


class CompiledLoop(Scheme):
    """A sampled law in C with the kinematics of its arm, called from Python.

    Raises:
        InvalidInputError: If the law cannot be compiled, or there is no C compiler.
    """

    name, setting = "ours, in C", ""

    def __init__(self, task: Task, experiment: Experiment) -> None:
        super().__init__(task)
        self._kinematics = task.arm.kinematics()
        self._robot = CompiledStep(experiment, backend="c").start()

    def pose(self, q: Array) -> tuple[Array, Array]:
        return self._kinematics.p_WE(q), self._kinematics.R_WE(q)

    def velocity(self, k: int, q: Array, v: Array) -> Array:
        return self._robot.step(q)


def _desired(task: Task, experiment: Experiment) -> dict[str, Array]:
    """Return the desired motion at every sample, by the names of signals."""
    times = task.period * np.arange(task.steps + 2)
    motions = {
        "pva": [experiment.desired.position(t) for t in times],
        "Rw": [experiment.desired.orientation(t) for t in times],
    }
    letters = {"p": ("pva", 0), "v": ("pva", 1), "a": ("pva", 2), "R": ("Rw", 0), "w": ("Rw", 1)}
    letters["alpha"] = ("Rw", 2)
    about, found = named_task(experiment.document.task), {}
    for letter, (which, order) in letters.items():
        values = np.array([motion[order] for motion in motions[which]])
        if which == "pva":
            values = values[:, list(about.axes)]
        found[f"{letter}_WE_desired"], found[f"{letter}_preview"] = values[:-1], values[1:]
    return found


def motion_of(experiment: Experiment) -> Motion:
    """Return the motion of an experiment, simulated with everything that belongs to it."""
    series = simulate(experiment).series
    return Motion(series["position"], series["velocity"])


def diagram_cost(experiment: Experiment, *, compiled: bool = False) -> float:
    """Return the cost of a sample of the whole diagram, which records nothing, in units as `run`'s.

    Two seconds of it are run, several times, each beside the unit.

    Args:
        experiment: The experiment.
        compiled: Whether the steps of its law are compiled.
    """
    period = experiment.document.period
    costs = []
    for _ in range(5):
        one = unit(experiment)
        options = RunOptions(compiled=compiled)
        simulator, *_ = recorded_simulator(experiment, options=options)
        simulator.Initialize()
        began = time.process_time()
        simulator.AdvanceTo(_TIMED)
        costs.append((time.process_time() - began) / (_TIMED / period) * 1e6 / one)
    return median(costs)
