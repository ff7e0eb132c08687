"""An experiment that is stepped in slices, and set by named controls between them.

- A recording of what was played, and the result that it is saved as.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np
from pydrake.math import RotationMatrix

from ..errors import InvalidInputError, SimulationError
from ..experiment import Experiment, make_experiment
from ..experiment.components import ORIGINS
from ..experiment.document import ExperimentDocument
from ..inputs.fields import Array
from ..inputs.messages import fields_of
from ..laws import Law
from ..laws.guard import JointStreamReading, LastStep
from ..laws.parts.jacobian import LEVER
from ..laws.parts.reach_edge import bend, out_of_reach
from ..measures import Steps
from ..paths import Waypoints
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from ..runs.evaluation import Evaluation
from ..runs.result import Result
from .controls import (
    OBSTACLE_SPEED,
    Button,
    Choice,
    Control,
    Handle,
    Setup,
    Slider,
    Switch,
    Variants,
    gains_of,
    read_message,
    with_gain,
)
from .hands import Hands
from .segment import Peaks, Readout, Segment, begin_segment, numbers_now, readouts_of

#: Longest recording [s]: a minute takes some 50 MB and a few seconds to evaluate.
LONGEST = 120.0
# Time between two waypoints of the path that the document of a recording names [s].
_SPACING = 0.02
# Room above the largest speed that was looked for.
_ROOM = 1.02


@dataclass(eq=False)
class Recording:
    """Steps that are recorded while one variant runs.

    Attributes:
        segment: The simulation.
        law: Law at the beginning.
        begin: Time of the session at which it begins [s].
        gains: What was changed, as sentences.
        ended: Whether no more steps come.
    """

    segment: Segment
    law: Law
    begin: float
    gains: list[str] = field(default_factory=list)
    ended: bool = False
    _parts: list[Steps] = field(default_factory=list)
    _until: float = 0.0

    def add(self, steps: Steps) -> None:
        """Add steps, which begin with the last one added before."""
        at = slice(1 if self._parts else 0, None)
        self._parts.append(replace(steps, time=steps.time[at], rows=steps.rows[at].copy()))
        self._until = float(steps.time[-1])
        self.ended = self.ended or self.duration >= LONGEST

    def note(self, what: str) -> None:
        """Note that something was set, at the time reached."""
        self.gains.append(f"{what} from t = {self.duration:.3f} s")

    @property
    def duration(self) -> float:
        """What has been recorded [s]."""
        return max(0.0, self._until - (self.begin - self.segment.begin))

    def result(self, hands: Hands) -> Result:
        """Return what was recorded as the result of a run.

        Its document names the path that was dragged as waypoints, and so begins where the arm was,
        but at rest; series and metrics are of what was played.

        Args:
            hands: What led the experiment.

        Raises:
            InvalidInputError: If nothing was recorded, or it cannot be described by a document.
        """
        if self.duration <= 0.0:
            raise InvalidInputError("recording: is empty; play, and record again")
        steps = self._steps()
        experiment = self._experiment(steps, hands)
        loop = self.segment.loop
        evaluation = Evaluation(experiment, loop, experiment.document.log_period)
        result, fault = evaluation.finish(steps, (), self.segment.simulator.get_system())
        if fault is not None:
            raise fault
        if not self.gains:
            return result
        # What a law says of itself follows from its gains, and those have changed.
        observables = {*loop.controller.reading.observables.parts}
        series = {name: each for name, each in result.series.items() if name not in observables}
        return replace(result, series=series, warnings=[*result.warnings, *self.gains])

    def _steps(self) -> Steps:
        begin = self.begin - self.segment.begin
        time = np.concatenate([part.time for part in self._parts])
        rows = np.concatenate([part.rows for part in self._parts])
        return Steps(np.maximum(time - begin, 0.0), rows, self._parts[0].layout)

    def _experiment(self, steps: Steps, hands: Hands) -> Experiment:
        """Return the experiment of the result: what its document says, as it was played."""
        base, start = self.segment.experiment, steps.series("position")[0]
        document = base.document.contents()
        for key in ("window", "accept", "over", "paper"):
            document.pop(key, None)
        document |= {
            "expect": "played live",
            "start": np.clip(start, base.limits.position_lower, base.limits.position_upper),
            "duration": float(steps.time[-1]),
            "law": _describe(document["law"], self.law),
        }
        if base.law.follows_position:
            document["path"] = _waypoints(base, hands, self.begin, float(steps.time[-1]))
        if base.document.obstacles is not None:
            document["obstacles"] = self._obstacles(hands, float(steps.time[-1]))
        experiment = make_experiment(document)
        experiment_by_hand = hands.lead(replace(base, document=experiment.document), self.begin)
        return replace(
            experiment_by_hand, law=self.law, start=experiment.start, warnings=experiment.warnings
        )

    def _obstacles(self, hands: Hands, duration: float) -> list[Any]:
        """Return the obstacles of the document, those that moved with the way that they went."""
        section = list(self.segment.experiment.document.obstacles or [])
        times = _times(duration)
        for k in hands.moved_obstacles:
            way = np.array([hands.p_WO(k, self.begin + t) for t in times])
            obstacle = dict(section[k])
            obstacle.pop("moves", None)
            obstacle |= _displace(obstacle, way[0])
            if np.ptp(way, axis=0).max() > 0.0:
                points = {"positions": (way - way[0]).tolist(), "times": times.tolist()}
                moves = Waypoints(**points, through="cubic").placed(np.zeros(3))
                obstacle["moves"] = {"kind": "waypoints", "through": "cubic", **points}
                # As waypoints it begins and ends at rest, and is faster there for a moment.
                fastest = max(float(np.linalg.norm(moves.position(t)[1])) for t in _dense(times))
                obstacle["speed"] = max(obstacle["speed"], _ROOM * fastest)
            section[k] = obstacle
        return section


def _dense(times: Array) -> list[float]:
    times_list: list[float] = np.linspace(0.0, times[-1], 8 * times.size).tolist()
    return times_list


def _times(duration: float) -> Array:
    return np.linspace(0.0, duration, max(2, round(duration / _SPACING) + 1))


def _waypoints(base: Experiment, hands: Hands, begin: float, duration: float) -> dict[str, Any]:
    """Return the path that was followed, as waypoints of a document."""
    times = _times(duration)
    target = hands.target
    points = [target.position(begin + t)[0].tolist() for t in times]
    path: dict[str, Any] = {"kind": "waypoints", "through": "cubic", "absolute": True}
    path |= {"positions": points, "times": times.tolist()}
    if base.holds_orientation and target.oriented:
        rotations = [RotationMatrix(target.orientation(begin + t)[0]) for t in times]
        path["quaternions"] = [R.ToQuaternion().wxyz().tolist() for R in rotations]
    return path


def _displace(obstacle: dict[str, Any], by: Array) -> dict[str, Any]:
    """Return the keys that say where an obstacle is, after it has been moved."""
    places = [key for key in ("center", "ends") if key in obstacle]
    return {key: (np.array(obstacle[key]) + by).tolist() for key in places}


def _describe(section: dict[str, Any], law: Law) -> dict[str, Any]:
    """Return the section of a law with the gains that it had."""
    gains = fields_of(law)
    numbers = [k for k, value in gains.items() if type(value) is float and k not in ORIGINS]
    return section | {name: gains[name] for name in numbers}


#: Time that is simulated at once, between which controls are set [s].
SLICE = 0.02
# Curvature of the error by which a posture is a saddle, as a share of the error.
_SADDLE = 0.05
# For how long what was written of motions is kept [s].
_KEEP_TIME = 1.0
# Highest and lowest force over the document's.
_FORCES = (0.2, 3.0)

# Choices of a page, and switches, each with its key of a setup and its label; what they do.
_CHOICES = {
    "law": "Controller; the next one goes on with the velocity of the last one.",
    "level": "Kinematic: an arm that follows at once. Dynamic: with mass and motors.",
}
_SWITCHES = {
    "learned": ("learned", "learn J", "Whether the law learns its Jacobian, or knows it."),
    "noise": ("noisy", "noise", "Whether the law sees noise in what is measured."),
}

#: Called with the steps of each slice, the first of which ended the slice before.
Watcher = Callable[[Segment, Steps], None]


@dataclass(frozen=True)
class Reply:
    """What a control has led to, as a sentence for the page; empty if there is nothing to say.

    Attributes:
        text: The sentence.
        refused: Whether it tells why something was not done.
        notice: What else has come of it, which is not to be overlooked.
    """

    text: str = ""
    refused: bool = False
    notice: str = ""


def reach_text(
    arm: ArmKinematics,
    limits: JointLimits,
    q: Array,
    p_WE: Array,
    R_WE: Array | None,
    axes: Sequence[int] = (0, 1, 2),
) -> str:
    """Return how far off a target is that no motion of the joints brings nearer; else nothing.

    Args:
        arm: Kinematics of the arm.
        limits: Limits of the joints.
        q: Joint positions, shape (n,) [rad].
        p_WE: Position of the target, shape (3,) [m].
        R_WE: Orientation of it, shape (3, 3); None if it does not count.
        axes: Axes along which the position counts.
    """
    J_pose, counts, turn = np.vstack((arm.J_omega(q), arm.J(q))), np.zeros(6), np.zeros(3)
    counts[3 + np.array(axes)] = 1.0
    if R_WE is not None:
        counts[:3], turn = LEVER, rotation_error(arm.R_WE(q), R_WE)
    error, J = counts * np.concatenate((turn, p_WE - arm.p_WE(q))), counts[:, None] * J_pose
    ends = out_of_reach(J, error, q, limits)
    if ends is None:
        return ""
    free = np.setdiff1d(np.arange(q.size), ends)
    # Where the arm is straight and the target behind it, it is a saddle, which the arm leaves.
    curvature = (J.T @ J - bend(J_pose, counts * error))[np.ix_(free, free)]
    if np.linalg.eigvalsh(curvature).min(initial=0.0) < -_SADDLE * np.linalg.norm(error):
        return ""
    away = f"{np.linalg.norm(error[3:]):.2g} m"
    if not ends:
        return f"target out of reach: {away} beyond"
    names = ", ".join(str(k + 1) for k in ends)
    return f"target {away} off: {'joints' if len(ends) > 1 else 'joint'} {names} at the limit"


class Session:
    """A running experiment that is played with.

    It knows neither a clock nor a network: `advance` simulates the next slice, `set` takes what a
    user does. Whatever is set, the joints' command keeps its bounds from slice to slice: a law that
    takes over goes on with the velocity that the last one commanded.

    Args:
        experiment: The experiment.
        obstacle_speed: See `Variants`.

    Raises:
        InvalidInputError: If the experiment cannot be played with.
    """

    def __init__(self, experiment: Experiment, obstacle_speed: float = OBSTACLE_SPEED) -> None:
        self.variants = Variants(experiment, obstacle_speed)
        self.watch: Watcher | None = None
        self._count, self._samples = 0, 0
        self._law: Law = experiment.law
        self._paused, self._failure = False, ""
        self._states = np.zeros((0, 0))
        # Simulations that have not been released.
        self._segments: list[Segment] = []
        self._recording: Recording | None = None
        self._restart(self.variants.base)

    # What runs.

    @property
    def time(self) -> float:
        """Time that has been simulated [s]."""
        return self._segment.begin + self.local_time

    @property
    def local_time(self) -> float:
        """Time since the simulation that runs began [s]; the experiment's own."""
        return self._samples * self._period

    @property
    def experiment(self) -> Experiment:
        """The experiment that runs, as it is led by hand."""
        return self._segment.experiment

    @property
    def base(self) -> Experiment:
        """The experiment as its document says it, which the page is made of."""
        return self.variants.experiment(self.variants.base)

    @property
    def document(self) -> ExperimentDocument:
        """Its document, with what that says of itself."""
        return self.variants.document

    @property
    def readouts(self) -> tuple[Readout, ...]:
        """Numbers that are shown of the experiment and of its variants, in their order."""
        return readouts_of(self.experiment)

    @property
    def moved_obstacles(self) -> dict[int, Array]:
        """How far each obstacle that may move has gone [m], by its number in the document."""
        return {k: self.hands.p_WO(k, self.time) for k in self.hands.moved_obstacles}

    @property
    def p_WO(self) -> Array | None:
        """How far obstacles that may move have gone, shape (m, 3) [m]; None if none may."""
        motions = self.experiment.motions
        return None if motions is None else motions.at(self.local_time)

    @property
    def warnings(self) -> list[str]:
        """Warnings about the experiment, and about what is not kept of it."""
        if self.variants.kept:
            return list(self.base.warnings)
        return [
            *self.base.warnings,
            "live: the bounds are kept as far as the law and its filter keep them by themselves",
        ]

    @property
    def recording(self) -> Recording | None:
        """What is being recorded, or was recorded last."""
        return self._recording

    @property
    def takeovers(self) -> int:
        """How often a simulation went on from another one, since the last reset."""
        return self._count - 1

    @property
    def is_paused(self) -> bool:
        """Whether nothing is simulated."""
        return self._paused

    @property
    def failure(self) -> str:
        """Why the simulation cannot go on; empty if it can."""
        return self._failure

    def advance(self) -> None:
        """Simulate the next slice, unless it is paused; a failure is kept, and pauses it."""
        if self._paused:
            return
        segment, period = self._segment, self._period
        number = self._samples + max(1, ceil(SLICE / period - 1e-9))
        self.hands.go_on(segment.begin + number * period)
        try:
            segment.simulator.AdvanceTo(number * period)
        except (SimulationError, InvalidInputError, RuntimeError) as error:
            self._failure, self._paused = str(error), True
            return
        self._samples = number
        self._take(segment.recorder.take())
        self.hands.forget(self._earliest)

    def _take(self, steps: Steps) -> None:
        layout = self._segment.controller.reading.state
        self._states = steps.series("state")[-2:].copy()
        self._peaks.add(steps, layout.part(steps.series("state"), "v"))
        if self.watch is not None:
            self.watch(self._segment, steps)
        if (recording := self._recording) is not None and not recording.ended:
            recording.add(steps)
            if recording.ended:
                self._end_recording()

    @property
    def _earliest(self) -> float:
        """Time from which what was written of motions is still needed [s]."""
        recording = self._recording
        return min(self.time - _KEEP_TIME, self.time if recording is None else recording.begin)

    # What is shown.

    def numbers(self) -> dict[str, float]:
        """Return the numbers of this moment by key, and the peaks since they were last asked."""
        return {**self._peaks.take(), **numbers_now(self._segment, self.local_time)}

    def position(self) -> Array:
        """Return the joint positions of the arm, shape (n,) [rad]."""
        loop = self._segment.loop
        body = loop.arm.GetMyContextFromRoot(self._segment.root)
        q: Array = loop.arm.GetOutputPort("position").Eval(body)
        return q

    @property
    def kinematics(self) -> ArmKinematics:
        """The kinematics of the arm that runs."""
        return self._segment.loop.arm.kinematics

    @property
    def last_step(self) -> LastStep | None:
        """The last step of a law of joint targets; None of another law, or before a step."""
        segment, states = self._segment, self._states
        reading, targets = segment.controller.reading, segment.experiment.targets
        if not isinstance(reading, JointStreamReading) or targets is None or len(states) < 2:
            return None
        t = max(self.local_time - self._period, 0.0)
        u = {"position": reading.state.part(states[0], "commanded")}
        u["target"] = targets.goals(np.array([t]), segment.experiment.start)[0]
        if (motions := segment.experiment.motions) is not None and "p_WO" in reading.inputs:
            u["p_WO"] = motions.at(t)
        return LastStep(reading, states[0], u, reading.state.part(states[1], "v"))

    def contact_force(self) -> Array:
        """Return the force on the tool of an experiment with a contact, shape (3,) [N]."""
        loop = self._segment.loop
        body = loop.arm.GetMyContextFromRoot(self._segment.root)
        force: Array = loop.arm.GetOutputPort("contact_force").Eval(body)
        return force

    def remark(self) -> str:
        """Return that the target is out of reach, where it is; else nothing."""
        experiment, arm = self.experiment, self.kinematics
        if not experiment.law.follows_position or experiment.contact is not None:
            return ""
        t, desired = self.local_time, experiment.desired
        R = desired.orientation(t)[0] if experiment.holds_orientation else None
        axes, limits = list(experiment.task.axes), experiment.limits
        return reach_text(arm, limits, self.position(), desired.position(t)[0], R, axes)

    def controls(self) -> Mapping[str, Control]:
        """Return what may be set now, by name."""
        return self._controls

    # What is set.

    def set(self, name: Any, value: Any) -> Reply:
        """Set a control; what cannot be set is refused with a sentence, and changes nothing."""
        recording = self._recording
        running = recording is not None and not recording.ended
        try:
            control = read_message(self._controls, name, value)
            text = self._do(name, control)
        except (InvalidInputError, RuntimeError, OSError) as error:
            # Whatever a page does, and whatever the machine lacks, the session goes on.
            return Reply(str(error), refused=True)
        if name in self._controls:
            self._controls[name] = self._controls[name].set(control)
        ends_recording = running and recording is not None and name != "record"
        return Reply(text, notice=self._describe_loss(recording) if ends_recording else "")

    def _describe_loss(self, recorded: Recording | None) -> str:
        """Return what has become of a recording that ran when something else was set."""
        if recorded is None or not recorded.ended:
            return ""
        if recorded is not self._recording:
            return f"the recording of {recorded.duration:.1f} s is discarded"
        return f"the recording has ended, after {recorded.duration:.1f} s; it can be saved"

    def _do(self, name: str, value: Any) -> str:
        control = self._controls[name]
        if isinstance(control, Handle):
            self.hands.drag(name, value)
            return ""
        if name.startswith("law."):
            return self._set_gain(name, value)
        actions: dict[str, Callable[[Any], str]] = {
            "force": self._set_force,
            "law": lambda kind: self._switch(law=kind),
            "learned": lambda on: self._switch(learned=on),
            "level": lambda level: self._switch(level=level),
            "noise": lambda on: self._switch(noisy=on),
            "reset J": lambda _: self._forget(),
            "reset": lambda _: self._restart(self._setup),
            "path": lambda _: self._follow(),
            "stop": lambda _: self._stop(),
            "pause": self._pause,
            "record": self._record,
        }
        return actions[name](value)

    def _set_gain(self, name: str, value: float) -> str:
        law = with_gain(self._law, name, value)
        self._segment.set_law(law)
        self._law = law
        if (recording := self._recording) is not None and not recording.ended:
            recording.note(f"{name} = {value:.4g}")
        return ""

    def _set_force(self, value: float) -> str:
        assert self.hands.force is not None
        self.hands.force.set(value)
        return ""

    def _follow(self) -> str:
        self.hands.target.follow()
        return "the target returns to its path"

    def _stop(self) -> str:
        self.hands.target.stay()
        return "the target stops"

    def _pause(self, on: bool) -> str:
        if self._failure and not on:
            raise InvalidInputError(f"{self._failure}; reset to begin again")
        self._paused = on
        return ""

    def _forget(self) -> str:
        self._end_recording()
        self._segment.begin_anew(self._law)
        return "the learned Jacobian is forgotten"

    def _switch(self, **changes: Any) -> str:
        setup = self.variants.switch(self._setup, **changes)
        if setup == self._setup:
            return ""
        experiment = self.variants.experiment(setup)
        carry = self._segment.carry_over(self._law)
        begin = self.time
        experiment_by_hand = self.hands.lead(experiment, begin)
        start = carry.position_commanded
        self._begin(_starting(experiment_by_hand, start), setup, begin, carry)
        return ", ".join(f"{name}: {_name_of(value)}" for name, value in changes.items())

    def _restart(self, setup: Setup) -> str:
        """Begin again, at rest where the experiment begins."""
        hands = Hands(self.variants.experiment(self.variants.base))
        experiment = hands.lead(self.variants.experiment(setup), 0.0)
        segment = begin_segment(experiment, 0.0, None)
        self.hands, self._count = hands, 0
        self._paused, self._failure = False, ""
        self._end_recording()
        self._recording = None
        self._take_over(segment, setup)
        return "reset"

    def _begin(self, experiment: Experiment, setup: Setup, begin: float, carry: Any) -> None:
        segment = begin_segment(experiment, begin, carry)
        self._end_recording()
        self._take_over(segment, setup)

    def _take_over(self, segment: Segment, setup: Setup) -> None:
        """Go on with a simulation that has begun."""
        self._segments.append(segment)
        self._segment, self._setup = segment, setup
        self._law = segment.experiment.law
        self._samples, self._count = 0, self._count + 1
        self._states = np.zeros((0, 0))
        self._peaks = Peaks(segment.experiment)
        self._release()
        self._controls = self._make_controls()

    def _release(self) -> None:
        """Release the simulations that neither run nor belong to what was recorded last."""
        recording = self._recording
        last_segment = None if recording is None else recording.segment
        for segment in self._segments:
            if segment is not self._segment and segment is not last_segment:
                segment.release()
        self._segments = [self._segment]
        if last_segment is not None and last_segment is not self._segment:
            self._segments.append(last_segment)

    @property
    def _period(self) -> float:
        return self._segment.controller.period

    # What is recorded.

    def _record(self, on: bool) -> str:
        if not on:
            self._end_recording()
            return ""
        self._recording = Recording(self._segment, self._law, self.time)
        self._release()
        return "recording"

    def _end_recording(self) -> None:
        if (recording := self._recording) is not None:
            recording.ended = True
        controls = self._known_controls()
        if (switch := controls.get("record")) is not None:
            controls["record"] = switch.set(False)

    def end_recording(self) -> Result:
        """Return the last recording as the result of a run, ending it if it goes on.

        Raises:
            InvalidInputError: If there is none, or it cannot be saved; it is kept.
        """
        if self._recording is None:
            raise InvalidInputError("recording: there is none; record first")
        self._end_recording()
        return self._recording.result(self.hands)

    # What may be set.

    def _known_controls(self) -> dict[str, Control]:
        return vars(self).get("_controls", {})

    def _make_controls(self) -> dict[str, Control]:
        variants, setup = self.variants, self._setup
        options = variants.options(setup)
        controls: dict[str, Control] = dict(self.hands.handles)
        controls |= gains_of(self._law, self._segment.controller, self.experiment.document)
        contact = self._segment.experiment.contact
        if contact is not None:
            low, high = (share * contact.force.value for share in _FORCES)
            text = "Desired force on the surface [N]."
            controls["force"] = Slider("force", low, high, contact.force.value, "N", meaning=text)
        for name, text in _CHOICES.items():
            if len(options[name]) > 1:
                choice = str(vars(setup)[name])
                controls[name] = Choice(name, tuple(options[name]), choice, meaning=text)
        for name, (key, label, text) in _SWITCHES.items():
            if len(options[key]) > 1:
                controls[name] = Switch(label, bool(vars(setup)[key]), meaning=text)
        if self._segment.controller.law.learns_jacobian:
            text = "The Jacobian is learned anew, from its first guess."
            controls["reset J"] = Button("forget J", meaning=text)
        if "target" in controls:
            controls |= {"path": Button("follow the path"), "stop": Button("stop")}
        controls["pause"] = Switch("pause", self._paused)
        controls["record"] = Switch("record", False)
        controls["reset"] = Button("reset")
        return controls


def _name_of(value: Any) -> str:
    return {True: "on", False: "off"}.get(value, str(value)) if isinstance(value, bool) else value


def _starting(experiment: Experiment, start: Array) -> Experiment:
    """Return an experiment that starts in another posture, shape (n,) [rad]."""
    return replace(experiment, start=start)
