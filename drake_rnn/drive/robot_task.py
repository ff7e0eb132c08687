"""What a robot is to do: a diagram with a `RobotArm`, advanced by the robot's clock.

The law of an experiment as a robot's task, and its record as a result.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, InitializeParams, Simulator

from ..diagrams import Loop
from ..errors import InvalidInputError, SimulationError
from ..experiment import Experiment, forecasts
from ..inputs.fields import Array, checked, instance, number
from ..laws.law import SampledReading, Signals
from ..measures import Steps
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from ..runs.diagram import recorded_simulator, simulator_config, start_laws
from ..runs.evaluation import Evaluations
from ..runs.folder import Status
from ..runs.result import Result, stopped
from ..systems import RobotArm
from .robots import Motion

# Times that differ by less are one [s].
_SAME = 1e-9


class RobotTask:
    """A diagram that moves a robot.

    Args:
        simulator: Simulator of the diagram, at time zero; it is initialized here.
        arm: The arm in it. Its limits are those that the robot is brought to its start and to
            rest within.
        duration: Time after which the robot is brought to rest [s].
        period: Time for which the diagram holds a commanded velocity [s].
        clearance: What the arm is to stay clear of on its way to the start; by default itself.

    Raises:
        InvalidInputError: If the arm's limits have no acceleration, or an argument is of another
            class.
    """

    @checked(
        simulator=instance(Simulator),
        arm=instance(RobotArm),
        duration=number(above=0.0),
        period=number(above=0.0),
        clearance=instance(Clearance, None),
    )
    def __init__(
        self,
        simulator: Simulator,
        arm: RobotArm,
        duration: float,
        period: float,
        clearance: Clearance | None = None,
    ) -> None:
        if not (duration > 0.0 and period > 0.0):
            raise InvalidInputError(
                f"duration, period: must be positive times [s], not {duration} and {period}"
            )
        arm.arm.limits.require("acceleration", "coming to rest")
        self._simulator, self._body = simulator, arm
        self.duration, self.period, self.clearance = duration, period, clearance
        at_rest = np.zeros(arm.arm.n)
        self._motion = Motion(arm.start, at_rest, at_rest)
        self._advanced = 0.0
        simulator.Initialize()

    @property
    def body(self) -> RobotArm:
        """The arm."""
        return self._body

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self._body.arm.joints

    @property
    def limits(self) -> JointLimits:
        """Limits of the arm."""
        return self._body.arm.limits

    @property
    def start(self) -> Array:
        """Posture in which it begins, shape (n,) [rad]."""
        return self._body.start

    @property
    def time(self) -> float:
        """Time of the diagram [s]."""
        return float(self._simulator.get_context().get_time())

    def advance(self, until: float, position: Array, velocity: Array) -> Array:
        """Return the positions to command at a time of the diagram, shape (n,) [rad].

        Args:
            until: The time [s].
            position: Joint positions measured last, shape (n,) [rad].
            velocity: Joint velocities measured last, shape (n,) [rad/s].

        Raises:
            SimulationError: If a law in the diagram fails.
        """
        # A time that ends a sample does so exactly, or Drake would begin the next one.
        samples = round(until / self.period)
        if abs(until - samples * self.period) < _SAME:
            until = samples * self.period
        root = self._simulator.get_mutable_context()
        self._body.measure(root, position, velocity)
        self._simulator.AdvanceTo(until)
        command, speed = self._body.command(root)
        if (since := until - self._advanced) > 0.0:
            acceleration = self._accelerated(speed, since)
            self._motion, self._advanced = Motion(command, speed, acceleration), until
        return command

    @property
    def held(self) -> float:
        """Time for which the velocity is still held [s]."""
        samples = self._advanced / self.period
        return float((np.ceil(samples - 1e-9) - samples) * self.period)

    def motion(self) -> Motion:
        """Return what `advance` has led to."""
        return self._motion

    def then(self) -> Sequence[Motion]:
        """Return the motions after that, of which none is known."""
        return ()

    #: Whether it goes on from what was commanded without it.
    resumes = False

    def resume(self, time: float, motion: Motion) -> None:
        """Go on from what was commanded without it, at a time of the diagram.

        Args:
            time: The time [s], a whole number of periods, not before that of the diagram.
            motion: The motion.
        """
        raise NotImplementedError("this diagram goes on from its own commands alone")

    def _accelerated(self, velocity: Array, since: float) -> Array:
        """Return the acceleration that has led to a velocity: the mean over a time [s]."""
        return np.asarray((velocity - self._motion[1]) / since)


# No part of a run is evaluated before its end: that would take longer than a cycle.
_ALL = 2**62
# Steps that room is made for at most, before which it is not known how many there will be.
_ROOM = 2**22
# Samples that are made on a copy before the first one.
_TRIED = 3


class DrivenLaw(RobotTask):
    """A law in its diagram, at the start of its experiment.

    Args:
        experiment: An experiment at ``level: robot``.

    Raises:
        InvalidInputError: If the path is out of reach, or the law fails when it is tried.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        document = experiment.document
        self._found = forecasts(experiment)
        simulator, loops, self._recorder = recorded_simulator(experiment)
        self._loop: Loop = loops[0]
        start_laws(loops, simulator.get_mutable_context())
        self._evaluation = Evaluations(experiment, loops, document.log_period)
        self._recorder.watch(simulator, part=_ALL)
        arm, period = self._loop.arm, document.period
        assert isinstance(arm, RobotArm)
        assert period is not None
        super().__init__(simulator, arm, document.duration, period, experiment.clearance)
        # Each sample is a step, and each status may end one besides.
        self._recorder.reserve(min(2 * round(document.duration / period) + 2, _ROOM))
        self._try_steps()
        self._began = time.perf_counter()

    def _try_steps(self) -> None:
        """Make the first steps on a copy: what is done for the first time may outlast a cycle."""
        simulator = self._simulator
        kept = self._motion, self._advanced
        trial = Simulator(simulator.get_system(), simulator.get_context().Clone())
        ApplySimulatorConfig(simulator_config(self.experiment, self._loop), trial)
        trial.Initialize()
        self._simulator = trial
        try:
            for k in range(1, _TRIED + 1):
                until = min(k * self.period, self.duration)
                self.advance(until, self.start, np.zeros_like(self.start))
        finally:
            self._simulator = simulator
            self._motion, self._advanced = kept

    def _accelerated(self, velocity: Array, since: float) -> Array:
        """See `RobotTask._accelerated`; the last sample's if the law bounds the jerk."""
        controller = self._loop.controller
        if not controller.reading.knows_acceleration or self._loop.filter is not None:
            return super()._accelerated(velocity, since)
        context = controller.GetMyContextFromRoot(self._simulator.get_context())
        return controller.reading.state.part(controller.state(context), "a")

    resumes = True

    def resume(self, time: float, motion: Motion) -> None:
        """See `RobotTask.resume`; samples in between are left out."""
        time = round(time / self.period) * self.period
        late = time - self.time > 0.5 * self.period
        if not late and motion.equals(self._motion):
            return
        root, loop = self._simulator.get_mutable_context(), self._loop
        context = loop.controller.GetMyMutableContextFromRoot(root)
        reading, x = loop.controller.reading, loop.controller.state(context)
        assert isinstance(reading, SampledReading)
        begin = self.time
        if late:
            root.SetTime(time)
        elapsed = max(time - begin, 0.0)
        loop.controller.set_state(context, reading.resumed(x, *motion, elapsed))
        at = loop.joint_command.GetMyMutableContextFromRoot(root)
        loop.joint_command.set_integral_value(at, motion.position)
        if late:
            params = InitializeParams(suppress_initialization_events=True)
            self._simulator.Initialize(params)
        self._motion, self._advanced = motion, time

    def result(self, told: Signals, status: Status, failure: str) -> Result:
        """Return the result of the run.

        Args:
            told: ``time`` of the run at which the robot told something, shape (k,) [s], and its
                ``position`` and ``velocity`` then, shape (k, n) [rad, rad/s].
            status: Whether the run came to its end.
            failure: Why it did not.
        """
        took = time.perf_counter() - self._began
        steps = _with_measured(self._recorder.steps, told)
        diagram = self._simulator.get_system()
        result, fault = self._evaluation.finish(steps, [self._found], diagram)
        at = np.searchsorted(steps.time, result.time - 1e-9)
        commanded = {"position_commanded": steps.series("position_commanded")[at]}
        result = replace(result, series=result.series | commanded)
        result.timings["wall_time_s"] = took
        if fault is not None and status == "complete":
            status, failure = "failed", str(SimulationError(str(fault), self.time))
        return result if status == "complete" else stopped(result, status, failure)


def _with_measured(steps: Steps, told: Signals) -> Steps:
    """Return steps with the measured joints as they were between two messages.

    The law saw the last message, held until the next one.
    """
    if not told["time"].size:
        return steps
    rows = steps.rows.copy()
    for name in ("position", "velocity"):
        at, _ = steps.layout.parts[name]
        columns = [np.interp(steps.time, told["time"], joint) for joint in told[name].T]
        rows[:, at] = np.transpose(columns)
    return replace(steps, rows=rows)
