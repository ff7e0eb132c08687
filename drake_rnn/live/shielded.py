"""A shield that is looked at while it runs: of a loop of one's own, or led by a hand.

- What a page shows of a shield, in the place of a `Session`.
- A shield whose source leads the tool to where a hand drags the target.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RotationMatrix

from ..errors import InvalidInputError
from ..experiment import Experiment, make_experiment
from ..experiment.components import Arms
from ..experiment.document import ExperimentDocument
from ..inputs.fields import Array
from ..laws.guard import LastStep
from ..robot.kinematics import ArmKinematics
from ..robot.rotation import rotation_error
from ..runs.result import Result
from ..shield.arms import DualArmShield
from ..shield.chunks import Kind
from ..shield.process import Shield
from ..shield.report import ShieldRecord, joint_step
from .controls import Button, Choice, Control, Handle, Slider, Switch, read_message
from .hands import TARGET, Hands
from .segment import DERIVATIVES, Readout, readouts_of
from .session import SLICE, Reply, reach_text

# What the arm is called in the document that is drawn.
_ARM = "of a shield"


def drawn_document(name: str, arm: str, period: float) -> dict[str, Any]:
    """Return a document of an arm that stands, by which a shield is drawn.

    Args:
        name: Name of the arm.
        arm: The arm, as a document names it.
        period: Period of the commands [s].
    """
    return {
        "name": f"{name}_shield",
        "arm": arm,
        "path": {"kind": "rest"},
        "law": {"kind": "adaptive", "jacobian": "known"},
        "period": period,
        "duration": 1.0,
    }


def experiment_of(shield: Shield | DualArmShield) -> Experiment:
    """Return an experiment with the arm, the limits and the obstacles of a shield, to be drawn."""
    arms = Arms()
    arms.add(_ARM, shield.arm.with_limits(shield.limits))
    document = drawn_document(shield.arm.name, _ARM, shield.period)
    document["start"] = shield.position.tolist()
    if shield.clearance is not None:
        document["obstacles"] = shield.obstacles
    return replace(make_experiment(document, arms=arms), clearance=shield.clearance)


class ShieldSession:
    """What a page shows of a shield that a loop of one's own calls.

    Args:
        shield: The shield.
        experiment: What is drawn, of `experiment_of`.
    """

    recording = None
    failure = ""
    is_paused = False

    shield: Shield | DualArmShield

    def __init__(self, shield: Shield | DualArmShield, experiment: Experiment) -> None:
        self.shield, self.experiment = shield, experiment
        self.kinematics: ArmKinematics = experiment.arm.kinematics()
        self._watch(shield)

    def _watch(self, shield: Shield | DualArmShield) -> None:
        """Show a shield from now on."""
        self.shield, self._noted = shield, shield.time
        self._v, self._a, self._has_a = shield.velocity, np.zeros(shield.arm.n), False
        self._peaks = dict.fromkeys(DERIVATIVES, 0.0)

    @property
    def base(self) -> Experiment:
        """See `Session.base`."""
        return self.experiment

    @property
    def document(self) -> ExperimentDocument:
        """See `Session.document`."""
        return self.experiment.document

    @property
    def readouts(self) -> tuple[Readout, ...]:
        """See `Session.readouts`."""
        behind = Readout("behind", "behind the source", "rad", log=True)
        return *readouts_of(self.experiment), behind

    @property
    def time(self) -> float:
        """Time of the last command [s]."""
        return self.shield.time

    @property
    def local_time(self) -> float:
        """The same."""
        return self.shield.time

    @property
    def last_step(self) -> LastStep:
        """The last step of what commands."""
        return self.shield.last_step

    @property
    def record(self) -> ShieldRecord:
        """What the shield says of its last command."""
        return self.shield.last_record

    @property
    def moved_obstacles(self) -> dict[int, Array]:
        """See `Session.moved_obstacles`."""
        places, clearance = self.shield.p_WO, self.shield.clearance
        if clearance is None:
            return {}
        names = [clearance.solids.names[k] for k in clearance.solids.moving]
        numbers = {each.name: k for k, each in enumerate(self.experiment.obstacles)}
        return {
            numbers[name]: p_WO
            for name, p_WO in zip(names, places, strict=True)
            if name in numbers and np.isfinite(p_WO).all()
        }

    @property
    def p_WO(self) -> Array | None:
        """See `Session.p_WO`."""
        return self.shield.p_WO if len(self.shield.p_WO) else None

    def position(self) -> Array:
        """Return the positions commanded last, shape (n,) [rad]."""
        return self.shield.position

    def contact_force(self) -> Array:
        """Return the force on the tool, shape (3,) [N]; there is none."""
        return np.zeros(3)

    def end_recording(self) -> Result:
        """Raise an InvalidInputError: nothing is recorded here."""
        raise InvalidInputError("recording: there is none of a shield")

    def note(self) -> None:
        """Note what the last command uses of its bounds; of the jerk, if each one is noted."""
        shield = self.shield
        v, step = shield.velocity, shield.time - self._noted
        if step <= 0.0:
            return
        values, is_next = {"velocity": v}, step < 1.5 * shield.period
        a = (v - self._v) / shield.period
        if is_next:
            values["acceleration"] = a
            if self._has_a:
                values["jerk"] = (a - self._a) / shield.period
        for name, value in values.items():
            if (bound := shield.limits.toward(name, value)) is not None:
                self._peaks[name] = max(self._peaks[name], float((np.abs(value) / bound).max()))
        self._v, self._a, self._has_a, self._noted = v, a, is_next, shield.time

    def numbers(self) -> dict[str, float]:
        """See `Session.numbers`."""
        shield, q = self.shield, self.position()
        limits, clearance = shield.limits, shield.clearance
        room = np.minimum(q - limits.position_lower, limits.position_upper - q)
        numbers = {f"{name}_ratio": share for name, share in self._peaks.items()}
        status = shield.status
        every = status.values() if isinstance(status, dict) else (status,)
        numbers |= {"margin": float(room.min()), "behind": max(each.behind for each in every)}
        self._peaks = dict.fromkeys(DERIVATIVES, 0.0)
        if clearance is not None and np.isfinite(shield.p_WO).all():
            gaps = clearance.gaps(q, self.p_WO)
            numbers["distance"] = float(gaps.min(initial=np.inf))
        return numbers

    def remark(self) -> str:
        """Return what keeps an arm from what is wanted that no limit or pair tells."""
        status = self.shield.status
        every = status if isinstance(status, dict) else {"": status}
        said = []
        for name, each in every.items():
            prefix = f"{name}: " if name else ""
            if "reach" in each.limited_by:
                said.append(f"{prefix}target out of reach")
            if each.tracking == "lost":
                said.append(f"{prefix}tracking lost")
        return ". ".join(said)

    def advance(self) -> None:
        """Do nothing: the loop goes on by itself."""

    def controls(self) -> Mapping[str, Control]:
        """See `Session.controls`."""
        return {}

    def set(self, name: Any, value: Any) -> Reply:
        """See `Session.set`."""
        return Reply(f"{name}: this page shows a loop that runs elsewhere", refused=True)


# Targets of a chunk, and their rate [1/s]; damping of the joints' way through them [m^2].
_ROWS, _RATE, _DAMPING = 16, 20.0, 1e-3


class _Message(NamedTuple):
    """A chunk on its way: when it comes, and for which time its first target is [s]."""

    arrives: float
    start: float
    kind: Kind
    values: Array


class DraggedShield(ShieldSession):
    """A shield that follows chunks of a source which leads the tool to where a hand drags it.

    The source sees where the arm is, and asks for the straight way to the target at a speed of its
    own, whatever is in between.

    Args:
        make: Makes the shield, at rest.
        experiment: What is drawn.
    """

    shield: Shield

    def __init__(self, make: Callable[[], Shield], experiment: Experiment) -> None:
        super().__init__(make(), experiment)
        self._make, self._rng = make, np.random.default_rng(0)
        self._controls: dict[str, Control] = {
            "targets": Choice(
                "targets", ("positions", "poses"), "positions", meaning="What a chunk consists of."
            ),
            "on path": Switch(
                "keep the path",
                self.shield.settings.on_path,
                meaning="The way waits for the arm, which else leaves it where it cannot keep up.",
            ),
            "speed": Slider("speed", 0.05, 5.0, 0.5, "m/s", meaning="Speed that is asked for."),
            "rate": Slider("chunks", 1.0, 25.0, 5.0, "1/s", meaning="Chunks a second."),
            "delay": Slider(
                "delay", 0.01, 1.0, 0.1, "s", meaning="From when the arm is seen to the chunk."
            ),
            "noise": Slider("noise", 1e-4, 0.1, 1e-4, "m", meaning="By how much chunks disagree."),
            "stop": Button("stop"),
            "pause": Switch("pause", False),
            "reset": Button("reset"),
        }
        self._begin(self.shield)

    def _begin(self, shield: Shield) -> None:
        self._watch(shield)
        self.hands, self.failure, self._count = Hands(self.experiment), "", 0
        self._motions = self.hands.motions(self.experiment.motions, 0.0)
        self._sent, self._next = deque[_Message](), 0.0
        self._goal = self.kinematics.p_WE(shield.position)
        self._R_WE = self.kinematics.R_WE(shield.position)
        shield.settings = replace(shield.settings, on_path=self._value("on path"))

    def _value(self, name: str) -> Any:
        control: Any = self._controls[name]
        return control.value

    @property
    def is_paused(self) -> bool:  # type: ignore[override]
        """Whether time stands still."""
        return bool(self._value("pause"))

    def advance(self) -> None:
        """Go on for a slice of time; a failure is kept, and pauses it."""
        if self.is_paused:
            return
        h = self.shield.period
        count = max(1, ceil(SLICE / h - 1e-9))
        self.hands.go_on((self._count + count) * h)
        try:
            for _ in range(count):
                self._command(self._count * h)
                self._count += 1
        except (InvalidInputError, RuntimeError) as error:
            self.failure = str(error)
            self._controls["pause"] = self._controls["pause"].set(True)
        self.hands.forget(self._count * h - 1.0)

    def remark(self) -> str:
        """See `ShieldSession.remark`; whatever a chunk consists of, it is the tool that is led."""
        q, limits = self.shield.position, self.shield.limits
        return reach_text(self.kinematics, limits, q, self._goal, self._R_WE)

    def _command(self, t: float) -> None:
        """Send what is due, and make a command."""
        if t >= self._next:
            kind: Kind = self._value("targets")
            self._sent.append(_Message(t + self._value("delay"), t, kind, self._chunk(kind)))
            self._next = t + 1.0 / self._value("rate")
        while self._sent and self._sent[0].arrives <= t:
            message = self._sent.popleft()
            self.shield.follow(message.kind, message.values, _RATE, message.start, t)
        self.shield.command(t, None if self._motions is None else self._motions.at(t))
        self.note()

    def _chunk(self, kind: Kind) -> Array:
        """Return what the source wants from now on, shape (k, w)."""
        q, limits = self.shield.position, self.shield.limits
        p = self.kinematics.p_WE(q)
        way = self._goal + self._value("noise") * self._rng.normal(size=3) - p
        length = max(float(np.linalg.norm(way)), 1e-9)
        shares = np.minimum(self._value("speed") / length * np.arange(_ROWS) / _RATE, 1.0)
        points = p + shares[:, None] * way
        if kind == "poses":
            wxyz = RotationMatrix.ProjectToRotationMatrix(self._R_WE).ToQuaternion().wxyz()
            return np.hstack((points, np.tile(wxyz, (_ROWS, 1))))
        rows = np.empty((_ROWS, q.size))
        for k, point in enumerate(points):
            turn = rotation_error(self.kinematics.R_WE(q), self._R_WE)
            to = np.concatenate((turn, point - self.kinematics.p_WE(q)))
            step = joint_step(self.kinematics, q, to, _DAMPING)
            rows[k] = q = np.clip(q + step, limits.position_lower, limits.position_upper)
        return rows

    def controls(self) -> Mapping[str, Control]:
        """See `Session.controls`."""
        return {**self.hands.handles, **self._controls}

    def set(self, name: Any, value: Any) -> Reply:
        """See `Session.set`."""
        try:
            return Reply(self._set(name, read_message(self.controls(), name, value)))
        except (InvalidInputError, RuntimeError) as error:
            return Reply(str(error), refused=True)

    def _set(self, name: str, value: Any) -> str:
        if name == TARGET:
            self._goal = value
        elif isinstance(self.controls()[name], Handle):
            self.hands.drag(name, value)
        elif name == "stop":
            self._goal = self.kinematics.p_WE(self.position())
        elif name == "reset":
            self._begin(self._make())
        elif name == "pause" and self.failure and not value:
            raise InvalidInputError(f"{self.failure}; reset to begin again")
        if name in self._controls:
            self._controls[name] = self._controls[name].set(value)
        if name == "on path":
            self.shield.settings = replace(self.shield.settings, on_path=value)
        return ""
