"""What a robot is to do: the way to the start of a run, the law as its task, and the way to rest.

- The way of the joints to the start, within bounds and clear of the arm itself; for a robot that
  waits for nobody, worked out while it rests.
- The law of an experiment as a diagram with a `RobotArm`, advanced by the robot's clock, and its
  record as a result.
- The way to rest from whatever was commanded last, within bounds.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from time import monotonic

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, InitializeParams, Simulator
from pydrake.systems.framework import Diagram

from ..diagrams import Loop
from ..errors import DrakeRnnError, InvalidInputError, SimulationError
from ..experiment import Experiment, forecasts
from ..inputs.fields import Array, checked, instance, number
from ..laws.law import SampledReading, Signals
from ..measures import Steps
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import clearance_of
from ..robot.jerk_stop import HeldStop
from ..robot.joint_stop import stop_step
from ..robot.limits import JointLimits
from ..runs.evaluation import Evaluations
from ..runs.folder import Status
from ..runs.limit_use import conclusion_of
from ..runs.result import Result, stop
from ..runs.simulation import recorded_simulator, simulator_config, start_laws
from ..systems import RobotArm
from .guard import Guard
from .law_in_c import DrivenController, GuardedStep, LawInC, LawSteps, require_same
from .robots import DriveSettings, LawSample, Motion
from .shared_cycles import AHEAD

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
            acceleration = self._mean_acceleration(speed, since)
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

    #: Its law as a paced connection runs it; None for one that it does not run.
    law_in_c: LawInC | None = None

    #: Whether it goes on from what was commanded without it.
    resumes = False

    def resume(self, time: float, motion: Motion) -> None:
        """Go on from what was commanded without it, at a time of the diagram.

        Args:
            time: The time [s], a whole number of periods, not before that of the diagram.
            motion: The motion.
        """
        raise NotImplementedError("this diagram goes on from its own commands alone")

    def _mean_acceleration(self, velocity: Array, since: float) -> Array:
        """Return the acceleration that has led to a velocity: the mean over a time [s]."""
        return np.asarray((velocity - self._motion[1]) / since)


# No part of a run is evaluated before its end: that would take longer than a cycle.
_ALL = 2**62
# Steps that room is made for at most, before which it is not known how many there will be.
_ROOM = 2**22
# Samples that are made on a copy before the first one.
_MOST_TRIES = 3


class DrivenLaw(RobotTask):
    """A law in its diagram, at the start of its experiment.

    Args:
        experiment: An experiment at ``level: robot``.
        compiled: Whether the steps of the law are compiled to C; None for where they can be.
        paced: Whether they are made by a paced connection then, and not in the diagram.

    Attributes:
        way: How its steps are made, in a sentence.
        law_in_c: The law for a paced connection, if its steps are made there.

    Raises:
        InvalidInputError: If the path is out of reach, the law fails when it is tried, or it cannot
            be compiled and is to be.
    """

    def __init__(
        self, experiment: Experiment, compiled: bool | None = False, *, paced: bool = False
    ) -> None:
        self.experiment = experiment
        document = experiment.document
        self._found = forecasts(experiment)
        self._steps = LawSteps()
        controller = DrivenController(experiment, self._steps)
        simulator, loops, self._recorder = recorded_simulator(experiment, controller=controller)
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
        states = self._try_steps()
        self.way = self._compile(states, compiled, paced=paced)
        self._began = time.perf_counter()

    @property
    def steps_in_c(self) -> int:
        """Number of steps that were made in C."""
        return self._steps.count

    def _compile(self, states: Sequence[Array], compiled: bool | None, *, paced: bool) -> str:
        """Have the steps made in C, if they are to be and can be; return how they are made."""
        where = "in a process beside the robot's" if paced else "in NumPy"
        if compiled is False:
            return f"its steps are made {where}"
        try:
            if paced:
                root = self._simulator.get_context()
                diagram = self._simulator.get_system()
                self.law_in_c = LawInC(self.experiment, diagram, self._loop, root)
                self.law_in_c.require_same(states)
            else:
                self._steps.step = GuardedStep(self._loop)
                self._require_same(states)
        except DrakeRnnError as error:
            self.law_in_c, self._steps.step = None, None
            if compiled:
                raise
            return f"its steps are made {where}, not in C: {error}"
        return "its steps are made in C" + (", in the robot's own cycle" if paced else "")

    def _require_same(self, states: Sequence[Array]) -> None:
        """Raise an InvalidInputError unless the first steps are those of NumPy."""
        require_same(self._try_steps(), states)
        self._steps.count = 0

    def _try_steps(self) -> list[Array]:
        """Make the first steps on a copy, and return the states of the law after them.

        What is done for the first time may outlast a cycle.
        """
        simulator = self._simulator
        before = self._motion, self._advanced
        trial = Simulator(simulator.get_system(), simulator.get_context().Clone())
        ApplySimulatorConfig(simulator_config(self.experiment, self._loop), trial)
        trial.Initialize()
        self._simulator = trial
        controller, states = self._loop.controller, []
        try:
            for k in range(1, _MOST_TRIES + 1):
                until = min(k * self.period, self.duration)
                self.advance(until, self.start, np.zeros_like(self.start))
                context = controller.GetMyContextFromRoot(trial.get_context())
                states.append(controller.state(context))
        finally:
            self._simulator = simulator
            self._motion, self._advanced = before
        return states

    def _mean_acceleration(self, velocity: Array, since: float) -> Array:
        """See `RobotTask._mean_acceleration`; the last sample's if the law bounds the jerk."""
        controller = self._loop.controller
        if not controller.reading.knows_acceleration or self._loop.filter is not None:
            return super()._mean_acceleration(velocity, since)
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
        time_since = max(time - begin, 0.0)
        loop.controller.set_state(context, reading.resumed(x, *motion, time_since))
        at = loop.joint_command.GetMyMutableContextFromRoot(root)
        loop.joint_command.set_integral_value(at, motion.position)
        if late:
            params = InitializeParams(suppress_initialization_events=True)
            self._simulator.Initialize(params)
        self._motion, self._advanced = motion, time

    def follow(self, samples: Sequence[LawSample]) -> None:
        """Record samples that a connection has made, in place of making them."""
        for sample in samples:
            state = sample.state
            self._steps.step = lambda t, x, u, period, state=state: state
            self.resume(sample.time, sample.before)
            self.advance(sample.time + self.period, sample.position, sample.velocity)

    def result(
        self, columns: Signals, status: Status, failure: str, commanded: Signals | None = None
    ) -> Result:
        """Return the result of the run.

        Args:
            columns: ``time`` of the run at which the robot told something, shape (k,) [s], and its
                ``position`` and ``velocity`` then, shape (k, n) [rad, rad/s].
            status: Whether the run came to its end.
            failure: Why it did not.
            commanded: ``time`` of the run, shape (k,) [s], and ``position`` that the robot was
                commanded to be at then, shape (k, n) [rad]; by default those of the law's samples.
        """
        took = time.perf_counter() - self._began
        steps = _with_measured(self._recorder.steps, columns)
        diagram = self._simulator.get_system()
        result, fault = self._evaluation.finish(steps, [self._found], diagram)
        if status == "complete" and fault is None:
            result.warnings.extend(self._caveats(result, diagram, commanded))
        at = np.searchsorted(steps.time, result.time - 1e-9)
        series = {"position_commanded": steps.series("position_commanded")[at]}
        result = replace(result, series=result.series | series)
        result.timings["wall_time_s"] = took
        if fault is not None and status == "complete":
            status, failure = "failed", str(SimulationError(str(fault), self.time))
        return result if status == "complete" else stop(result, status, failure)

    def _caveats(self, measured: Result, diagram: Diagram, commanded: Signals | None) -> list[str]:
        """Return what of a judgement is due to the robot's motors and sensors, as a warning."""
        steps = self._recorder.steps
        if commanded is None:
            commanded = {"time": steps.time, "position": steps.series("position_commanded")}
        else:
            # Of each of its cycles, those included that it has lost: from one sample to the next
            # after them it is not commanded one velocity.
            steps = _at_cycles(steps, commanded["time"], self.period)
        evaluation = Evaluations(self.experiment, (self._loop,), np.inf)
        t, q = commanded["time"], commanded["position"]
        signals = {"time": t, "position": q, "velocity": _held(t, q, self.period)}
        result, _ = evaluation.finish(_with_measured(steps, signals), [self._found], diagram)
        judged, of_commands = conclusion_of(measured), conclusion_of(result)
        if str(judged) == str(of_commands):
            return []
        return [
            "measured: criteria and limits are judged of what the robot has measured, with what "
            "its motors and the noise of its sensors add; of what it was commanded: "
            f"{of_commands}"
        ]


def _held(time: Array, position: Array, period: float) -> Array:
    """Return the velocities that lead from each position to the next, shape (k, n) [rad/s]."""
    step = np.diff(time)
    # Times are rounded more coarsely than velocities of a millisecond can be told.
    whole = period * np.round(step / period)
    step = np.where(np.abs(step - whole) < 1e-9, whole, step)
    moved = step > 1e-9
    velocity = np.zeros_like(position)
    velocity[:-1][moved] = np.diff(position, axis=0)[moved] / step[moved, None]
    for k in np.flatnonzero(np.append(~moved, True)):
        velocity[k] = velocity[k - 1]
    return velocity


def _at_cycles(steps: Steps, time: Array, period: float) -> Steps:
    """Return steps as they were at the times of cycles [s]."""
    known, rows = np.unique(steps.time, return_index=True)
    times = period * np.round(time / period)
    times = times[(times > known[0] - 0.5 * period) & (times < known[-1] + 0.5 * period)]
    columns = [np.interp(times, known, column) for column in steps.rows[rows].T]
    return replace(steps, time=times, rows=np.transpose(columns))


def _with_measured(steps: Steps, signals: Signals) -> Steps:
    """Return steps with the measured joints as they were between two messages.

    The law saw the last message, held until the next one.
    """
    if not signals["time"].size:
        return steps
    rows = steps.rows.copy()
    for name in ("position", "velocity"):
        at, _ = steps.layout.parts[name]
        columns = [np.interp(steps.time, signals["time"], joint) for joint in signals[name].T]
        rows[:, at] = np.transpose(columns)
    return replace(steps, rows=rows)


#: Distance from the start at which the joints are there [rad].
ARRIVAL_TOLERANCE = 1e-9


class Approach:
    """The way from a posture to the start of a task.

    Args:
        task: The task. Its obstacles are avoided, where it has any, and the arm's own bodies in
            any case.
        settings: Bounds of the way.
        begin: Posture in which the robot stands, shape (n,) [rad].
        period: Time of a cycle [s].

    Attributes:
        doubts: What of the arm's own bodies is not kept clear; that of a task with obstacles is in
            the warnings of its experiment.

    Raises:
        InvalidInputError: If that posture is beyond the limits, or the arm touches something.
    """

    def __init__(
        self, task: RobotTask, settings: DriveSettings, begin: Array, period: float
    ) -> None:
        clearance, self.doubts = task.clearance, tuple[str, ...]()
        if clearance is None:
            clearance, self.doubts = clearance_of(task.body.arm, (), task.start)
        self.limits = _slow(task.limits, settings)
        # Obstacles begin to move with the task.
        self._p_WO = np.zeros((len(clearance.solids.moving), 3))
        self._guard = Guard.within(self.limits, begin, period, clearance, self._p_WO)
        self._start, self.period = task.start, period

    held = 0.0
    #: Whether the way is worked out while the robot rests.
    is_working = False

    @property
    def has_arrived(self) -> bool:
        """Whether the joints are commanded to rest at the start."""
        off = np.abs(self._guard.position - self._start).max()
        return bool(
            off <= ARRIVAL_TOLERANCE and not np.abs(self._guard.velocity).max() > ARRIVAL_TOLERANCE
        )

    def advance(self, time: float) -> Array:
        """Return the positions to command some time later [s], shape (n,) [rad]."""
        for _ in range(max(round(time / self.period), 1)):
            self._guard.command(self._start, self._p_WO)
        return self._guard.position

    def motion(self) -> Motion:
        """Return what is commanded."""
        return Motion(self._guard.position, self._guard.velocity, self._guard.part("a"))

    def then(self) -> Sequence[Motion]:
        """Return the motions after that, as far as they are known."""
        return ()

    def resume(self, motion: Motion, cycles: int) -> None:
        """Go on from what was commanded, by it or without it, some cycles later."""
        if not motion.equals(self.motion()):
            self._guard.resume(*motion)


def _slow(limits: JointLimits, settings: DriveSettings) -> JointLimits:
    """Return limits that are no wider than those of the approach."""
    bounds_of_approach = {
        "velocity": settings.approach_velocity,
        "acceleration": settings.approach_acceleration,
        "jerk": settings.approach_jerk,
    }
    bounds = limits.bounds
    return limits.replace(
        **{
            name: most if (own := bounds[name]) is None else np.minimum(own, most)
            for name, most in bounds_of_approach.items()
        }
    )


# Time for which it is worked on at a stretch; in between this side looks after the robot [s].
_STRETCH = 4e-3


class PlannedApproach(Approach):
    """The way from a posture to the start of a task, of which every cycle is known beforehand.

    A step that stays clear of everything takes about as long as a cycle of a fast robot, so the
    next cycles are told ahead. If one is answered without it all the same, the robot comes to rest,
    and the way from there is worked out anew.

    Args:
        task, settings, begin, period: As those of `Approach`.
    """

    def __init__(
        self, task: RobotTask, settings: DriveSettings, begin: Array, period: float
    ) -> None:
        super().__init__(task, settings, begin, period)
        self._commanded = super().motion()
        self._plan = [self._commanded]
        self._at, self._is_known = 0, super().has_arrived
        # Nothing moves yet, and nobody waits.
        while not self._is_known and len(self._plan) * period < settings.approach_time:
            self._work()

    @property
    def has_arrived(self) -> bool:
        """Whether the joints are commanded to rest at the start."""
        return self._is_known and self._at == len(self._plan) - 1

    @property
    def is_working(self) -> bool:  # type: ignore[override]
        """Whether the way is worked out while the robot rests."""
        return not self._is_known and self._commanded.rests

    def then(self) -> Sequence[Motion]:
        """See `Approach.then`."""
        return self._plan[self._at + 2 : self._at + AHEAD] if self._is_known else ()

    def resume(self, motion: Motion, cycles: int) -> None:
        """See `Approach.resume`."""
        self._commanded = motion
        index = min(self._at + cycles, len(self._plan) - 1) if self._is_known else self._at
        for at in (index, self._at):
            if motion.equals(self._plan[at]):
                self._at = at
                return
        self._is_known = False
        if motion.rests:
            self._guard.resume(*motion)
            self._plan, self._at = [motion], 0
            self._is_known = super().has_arrived

    def advance(self, time: float) -> Array:
        """Return the positions to command in the next cycle, shape (n,) [rad]."""
        if self.is_working:
            self._work()
        return self.motion().position

    def motion(self) -> Motion:
        """Return what is commanded: the next of the way, or what is commanded already.

        The latter keeps a robot at rest there. One that moves is not to stop at once: a paced
        connection does not take this, and makes a step of its stop.
        """
        if self._is_known and not self.has_arrived:
            return self._plan[self._at + 1]
        return self._commanded

    def _work(self) -> None:
        """Work for a while on the way from where the robot rests."""
        until = monotonic() + _STRETCH
        while not super().has_arrived:
            if monotonic() > until:
                return
            super().advance(self.period)
            self._plan.append(super().motion())
        self._is_known = True


class RampDown:
    """The fastest stop of all joints within limits of acceleration and, if there is one, of jerk.

    Steps are those of the law, whose bounds rest on this very stop. If a law has not kept its
    bounds, so that a joint would run into a position limit, the joint brakes as hard as it needs
    to, up to what the robot may be told.

    Args:
        position, velocity, acceleration: What was commanded last, shape (n,) each
            [rad, rad/s, rad/s^2].
        limits: Limits to stop within.
        hardest: Largest accelerations that the robot may be told, shape (n,) [rad/s^2].
        period: Time of a step of the law [s].
        hold_time: Time for which the law still holds its velocity [s].
    """

    def __init__(
        self,
        position: Array,
        velocity: Array,
        acceleration: Array,
        limits: JointLimits,
        hardest: Array,
        period: float,
        *,
        hold_time: float = 0.0,
    ) -> None:
        self._q, self._v, self._period = position + hold_time * velocity, velocity, period
        self._jerk = limits.jerk
        self._most = _braking(position, velocity, limits, hardest, period)
        self._a = np.clip(acceleration, -self._most, self._most)
        # Time by which the last step is ahead of what was asked for.
        self._ahead = hold_time

    @property
    def rests(self) -> bool:
        """Whether all joints rest."""
        return not self._v.any()

    def advance(self, time: float) -> Array:
        """Return the commanded positions some time later [s], shape (n,) [rad]."""
        self._ahead -= time
        # Times that are sums of periods are compared with some room.
        while self._ahead < -1e-6 * self._period:
            self._step()
            self._ahead += self._period
        return np.asarray(self._q - max(self._ahead, 0.0) * self._v)

    def _step(self) -> None:
        jerk = None if self._jerk is None else self._jerk.tolist()
        moving = self._v.tolist(), self._a.tolist(), self._most.tolist()
        self._v, self._a = np.array(stop_step(*moving, jerk, self._period))
        self._q = self._q + self._period * self._v


def _braking(q: Array, v: Array, limits: JointLimits, hardest: Array, period: float) -> Array:
    """Return each joint's deceleration: its limit, or more where its way would be too long."""
    most = limits.require("acceleration", "coming to rest")
    ahead = np.where(v > 0.0, limits.position_upper - q, q - limits.position_lower)
    way = HeldStop(most, period).way(HeldStop(most, period).after(v))
    room = np.maximum(ahead - np.abs(v) * period, 1e-9)
    deceleration = np.where(way > ahead, v**2 / (2.0 * room), most)
    return np.asarray(np.clip(deceleration, most, np.maximum(hardest, most)))
