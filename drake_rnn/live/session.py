"""An experiment that is stepped in slices, and set by named controls between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

from ..errors import InvalidInputError, SimulationError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..laws import Law
from ..measures import Steps
from ..robot.kinematics import ArmKinematics
from ..runs.result import Result
from .controls import Button, Choice, Control, Handle, Slider, Switch, read_message
from .gains import gains_of, with_gain
from .gauge import Peaks, numbers_now
from .hands import Hands
from .recording import Recording
from .segment import Segment, begun
from .variants import OBSTACLE_SPEED, Setup, Variants

#: Time that is simulated at once, between which controls are set [s].
SLICE = 0.02
# For how long what was written of motions is kept [s].
_KEPT = 1.0
# Highest and lowest force over the document's.
_FORCES = (0.2, 3.0)

#: Called with the steps of each slice, the first of which ended the slice before.
Watcher = Callable[[Segment, Steps], None]


@dataclass(frozen=True)
class Reply:
    """What a control has led to, as a sentence for the page; empty if there is nothing to say.

    Attributes:
        text: The sentence.
        refused: Whether it tells why something was not done.
    """

    text: str = ""
    refused: bool = False


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
    def warnings(self) -> list[str]:
        """Warnings about the experiment, and about what is not kept of it."""
        made = self.variants.experiment(self.variants.base)
        if self.variants.kept:
            return list(made.warnings)
        return [
            *made.warnings,
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
        self._take(segment.recorder.taken())
        self.hands.forget(self._earliest)

    def _take(self, steps: Steps) -> None:
        layout = self._segment.controller.reading.state
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
        recorded = self._recording
        return min(self.time - _KEPT, self.time if recorded is None else recorded.begin)

    # What is shown.

    def numbers(self) -> dict[str, float]:
        """Return the numbers of this moment by key, and the peaks since they were last asked."""
        return {**self._peaks.taken(), **numbers_now(self._segment, self.local_time)}

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

    def contact_force(self) -> Array:
        """Return the force on the tool of an experiment with a contact, shape (3,) [N]."""
        loop = self._segment.loop
        body = loop.arm.GetMyContextFromRoot(self._segment.root)
        force: Array = loop.arm.GetOutputPort("contact_force").Eval(body)
        return force

    def controls(self) -> Mapping[str, Control]:
        """Return what may be set now, by name."""
        return self._controls

    # What is set.

    def set(self, name: Any, value: Any) -> Reply:
        """Set a control; what cannot be set is refused with a sentence, and changes nothing."""
        try:
            known = read_message(self._controls, name, value)
            text = self._do(name, known)
        except (InvalidInputError, RuntimeError, OSError) as error:
            # Whatever a page does, and whatever the machine lacks, the session goes on.
            return Reply(str(error), refused=True)
        if name in self._controls:
            self._controls[name] = self._controls[name].set(known)
        return Reply(text)

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
        setup = self.variants.switched(self._setup, **changes)
        if setup == self._setup:
            return ""
        experiment = self.variants.experiment(setup)
        carried = self._segment.carried(self._law)
        begin = self.time
        led = self.hands.led(experiment, begin)
        start = carried.position_commanded
        self._begin(_starting(led, start), setup, begin, carried)
        return ", ".join(f"{name}: {_named(value)}" for name, value in changes.items())

    def _restart(self, setup: Setup) -> str:
        """Begin again, at rest where the experiment begins."""
        hands = Hands(self.variants.experiment(self.variants.base))
        experiment = hands.led(self.variants.experiment(setup), 0.0)
        segment = begun(experiment, 0.0, None)
        self.hands, self._count = hands, 0
        self._paused, self._failure = False, ""
        self._end_recording()
        self._recording = None
        self._take_over(segment, setup)
        return "reset"

    def _begin(self, experiment: Experiment, setup: Setup, begin: float, carried: Any) -> None:
        segment = begun(experiment, begin, carried)
        self._end_recording()
        self._take_over(segment, setup)

    def _take_over(self, segment: Segment, setup: Setup) -> None:
        """Go on with a simulation that has begun."""
        self._segments.append(segment)
        self._segment, self._setup = segment, setup
        self._law = segment.experiment.law
        self._samples, self._count = 0, self._count + 1
        self._peaks = Peaks(segment.experiment)
        self._release()
        self._controls = self._made_controls()

    def _release(self) -> None:
        """Release the simulations that neither run nor belong to what was recorded last."""
        recording = self._recording
        recorded = None if recording is None else recording.segment
        for segment in self._segments:
            if segment is not self._segment and segment is not recorded:
                segment.release()
        self._segments = [self._segment]
        if recorded is not None and recorded is not self._segment:
            self._segments.append(recorded)

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

    def recorded(self) -> Result:
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

    def _made_controls(self) -> dict[str, Control]:
        variants, setup = self.variants, self._setup
        options = variants.options(setup)
        found: dict[str, Control] = dict(self.hands.handles)
        found |= gains_of(self._law, self._segment.controller)
        contact = self._segment.experiment.contact
        if contact is not None:
            low, high = (share * contact.force.value for share in _FORCES)
            found["force"] = Slider("force", low, high, contact.force.value, "N")
        for name, key, label in (("law", "law", "law"), ("level", "level", "level")):
            if len(options[key]) > 1:
                found[name] = Choice(label, tuple(options[key]), str(vars(setup)[key]))
        for name, key, label in (
            ("learned", "learned", "learn J"),
            ("noise", "noisy", "noise"),
        ):
            if len(options[key]) > 1:
                found[name] = Switch(label, bool(vars(setup)[key]))
        if self._segment.controller.law.learns_jacobian:
            found["reset J"] = Button("forget J")
        if "target" in found:
            found |= {"path": Button("follow the path"), "stop": Button("stop")}
        found["pause"] = Switch("pause", self._paused)
        found["record"] = Switch("record", False)
        found["reset"] = Button("reset")
        return found


def _named(value: Any) -> str:
    return {True: "on", False: "off"}.get(value, str(value)) if isinstance(value, bool) else value


def _starting(experiment: Experiment, start: Array) -> Experiment:
    """Return an experiment that starts in another posture, shape (n,) [rad]."""
    return replace(experiment, start=start)
