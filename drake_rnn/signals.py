"""The signals of a loop and the series of its runs: one table of what each is and follows from.

A law sees signals, by name, and a run records series. Each has a row here: its unit, shape and
frame, what offers it, and, if it follows from posture, velocity and time, its function of them. The
blocks of a diagram, the evaluation of a run and a batch compute what they need by these functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from .inputs.fields import Array

#: What offers a signal: the joints, kinematics or dynamics computed from them, the path, the
#: surface that is pressed, a camera, a reference of joint positions, another feature, the law as
#: part of its state or of its observables, or the evaluation of a run.
Origin = Literal[
    "joints", "kinematics", "dynamics", "path", "surface", "camera", "reference", "feature", "law",
    "run",
]  # fmt: skip
#: What a signal follows from: joint positions, joint velocities, time.
Cause = Literal["q", "v", "t"]
#: The motion of a path: a value, its first and its second derivative.
MotionState = tuple[Any, Any, Any]


class PathMotion(Protocol):
    """A desired motion by time, or by what stands for the time where there are many robots."""

    def position(self, t: Any, /) -> MotionState:
        """Return p_WE, v_WE and a_WE [m, m/s, m/s^2]."""

    def orientation(self, t: Any, /) -> MotionState:
        """Return R_WE, w_WE and alpha_WE [1, rad/s, rad/s^2]."""


class ChosenAxes(Protocol):
    """The axes of a task, as `drake_rnn.robot.task.Task` has them."""

    @property
    def lengths(self) -> Mapping[str, int]:
        """Lengths of ``axes`` and ``rows``."""

    def J(self, kinematics: Any, q: Array, /) -> Array:
        """Return the Jacobian of the task, shape (rows, n)."""

    def coordinates(self, kinematics: Any, q: Array, /) -> Array:
        """Return the position along the axes, or the coordinates of objectives, shape (axes,)."""

    def velocity(self, kinematics: Any, q: Array, v: Array, /) -> Array:
        """Return their derivative, shape (axes,)."""

    def bias(self, kinematics: Any, q: Array, v: Array, /) -> Array:
        """Return their acceleration at constant joint velocities, shape (axes,)."""

    def desired(self, path: Any, t: Any, /) -> MotionState:
        """Return what they should be along a path, with two derivatives, shape (axes,) each."""


@dataclass(frozen=True)
class View:
    """What the functions of the table compute signals with, of one robot.

    Attributes:
        task: The controlled axes.
        kinematics: Kinematics of the arm.
        path: Its desired motion; None where nothing of the path is asked for.
        dynamics: Its dynamics, as it is believed to be; None likewise.
        normal_W: The surface's believed normal, shape (3,); None without a surface.
    """

    task: ChosenAxes
    kinematics: Any = None
    path: Any = None
    dynamics: Any = None
    normal_W: Array | None = None

    def coordinates(self, q: Array) -> Array:
        """Return the position of E along the axes of the task, shape (m,) [m]."""
        return self.task.coordinates(self.kinematics, q)

    def desired(self, t: Any) -> MotionState:
        """Return that of the path, with two derivatives, shape (m,) each."""
        return self.task.desired(self.path, t)

    def task_J(self, q: Array) -> Array:
        """Return the Jacobian of the task, shape (rows, n)."""
        return self.task.J(self.kinematics, q)

    def tip_velocity(self, q: Array, v: Array) -> Array:
        """Return the velocity of E along the axes of the task, shape (m,) [m/s]."""
        return self.task.velocity(self.kinematics, q, v)

    def tip_bias(self, q: Array, v: Array) -> Array:
        """Return its acceleration at constant joint velocities, shape (m,) [m/s^2]."""
        return self.task.bias(self.kinematics, q, v)


#: A signal's value, of a view (`View`, or that of robots side by side), joint positions, joint
#: velocities and time. What it does not follow from may be None.
Function = Callable[[Any, Any, Any, Any], Any]


@dataclass(frozen=True)
class Signal:
    """A signal that laws see, or a series that runs record.

    Attributes:
        name: Its name, with frames as in Drake: p_WE is the position of E, the end effector's task
            frame, measured from and expressed in the world W.
        unit: Its unit; empty for a pure number, or for several units.
        shape: Names of its axes: ``n`` joints, the ``axes`` and ``rows`` of the task, ``xyz`` of a
            frame, ``pixels``; None if it may have any.
        frame: Frame in which it is expressed: the world W; empty for what has none.
        origin: What offers it.
        meaning: What it is, for the header of a law in C; empty for what no law sees.
        function: How it follows from posture, velocity and time; None if it does not.
        causes: What it follows from.
        ahead: Name of the same signal one period ahead; empty without one.
        hint: What to give where a loop lacks it, as the end of a message.
        series: Whether it is a series of runs, under the same name.
        sensed: Whether sensors may measure it; ``measured`` is then a series, too.
        motion: Whether every `drake_rnn.measures.Motion` has a field of this name.
        sometimes: Whether only runs with obstacles or with a camera have this series; laws may have
            a part of their state or an observable of its name.
    """

    name: str
    unit: str = ""
    shape: tuple[str, ...] | None = None
    frame: str = ""
    origin: Origin = "run"
    meaning: str = ""
    function: Function | None = field(default=None, repr=False)
    causes: frozenset[Cause] = frozenset()
    ahead: str = ""
    hint: str = ""
    series: bool = False
    sensed: bool = False
    motion: bool = False
    sometimes: bool = False

    @property
    def measurement_name(self) -> str:
        """Name of the series of its measurements."""
        return f"{self.name}_measured"

    @property
    def description(self) -> str:
        """What it is, with its frame and its unit."""
        frame, unit = self.frame and f", in {self.frame}", self.unit and f" [{self.unit}]"
        return f"{self.meaning}{frame}{unit}"

    def lengths(self, **known: int) -> tuple[int, ...]:
        """Return its shape, from the lengths of its axes by their names; ``xyz`` is 3."""
        assert self.shape is not None
        return tuple(3 if axis == "xyz" else known[axis] for axis in self.shape)

    def size(self, **known: int) -> int:
        """Return how many numbers it has."""
        return int(np.prod(self.lengths(**known)))


_N, _AXES, _ROWS, _XYZ, _TURN = ("n",), ("axes",), ("rows", "n"), ("xyz",), ("xyz", "xyz")
_Q: frozenset[Cause] = frozenset(("q",))
_V: frozenset[Cause] = frozenset(("v",))
_T: frozenset[Cause] = frozenset(("t",))
_IN_W: dict[str, Any] = {"frame": "W", "origin": "kinematics"}
_OF_PATH: dict[str, Any] = {"frame": "W", "origin": "path", "causes": _T}
_TURNING: dict[str, Any] = {**_OF_PATH, "hint": "; give the PathSource R_WE"}
_OF_JOINTS: dict[str, Any] = {"origin": "joints", "series": True, "motion": True, "sensed": True}


class TaskMeasure(NamedTuple):
    """What tells how well a task of objectives is done: a series of runs, and what shows it.

    Attributes:
        name: Name of the series, and its key in `drake_rnn.measures.Motion.task`.
        unit: ``m`` or ``rad``.
        text: What figures and playbacks call it.
        meaning: What it is, for lists of figures.
        kind: ``error``: its largest value and root mean square are metrics; ``length``: its least
            and largest value; ``margin``: its least.
        stem: How the names of its metrics begin.
    """

    name: str
    unit: str
    text: str
    meaning: str
    kind: str
    stem: str

    @property
    def metrics(self) -> dict[str, str]:
        """What each of its metrics is, by their names."""
        what = {
            "error": {"max": "largest", "rms": "root mean square"},
            "length": {"min": "least", "max": "largest"},
            "margin": {"min": "least"},
        }[self.kind]
        return {f"{self.stem}_{how}_{self.unit}": text for how, text in what.items()}


#: Of all objectives. One that is measured otherwise adds a row, and its metrics to those of
#: `drake_rnn.features.objectives`.
TASK_MEASURES = (
    TaskMeasure(
        *("axis_error", "rad", "axis error"),
        "the angle between an axis of the tool and where it should point",
        *("error", "axis_error"),
    ),
    TaskMeasure(
        *("frame_position_error", "m", "position error of the tools"),
        "how far another frame of two tools is from where it is held",
        *("error", "frame_position_error"),
    ),
    TaskMeasure(
        *("frame_orientation_error", "rad", "orientation error of the tools"),
        "the angle by which another frame of two tools is turned from how it is held",
        *("error", "frame_orientation_error"),
    ),
    TaskMeasure(
        *("shaft_distance", "m", "remote centre error"),
        "how far the tool's shaft passes from its remote centre",
        *("error", "remote_centre_error"),
    ),
    TaskMeasure(
        *("insertion_depth", "m", "insertion depth"),
        "how far the tool is beyond its remote centre, along the shaft",
        *("length", "insertion_depth"),
    ),
    TaskMeasure(
        *("position_margin", "m", "position margin of the task"),
        "how far the tool is within the bounds that its task sets to its position",
        *("margin", "range_margin"),
    ),
    TaskMeasure(
        *("angle_margin", "rad", "angle margin of the task"),
        "how far an axis of the tool is within the cone of its task",
        *("margin", "range_margin"),
    ),
)

_OF_RUN: dict[str, Any] = {"series": True}
_OF_LAW: dict[str, Any] = {"origin": "law", "series": True}
_OF_DYNAMICS: dict[str, Any] = {"origin": "dynamics", "frame": ""}
_OF_SURFACE: dict[str, Any] = {"origin": "surface"}

_ROWS_OF_TABLE = (
    # The joints, and the end effector E in the world W.
    Signal(
        *("position", "rad", _N),
        meaning="joint positions, as measured or as commanded",
        function=lambda x, q, v, t: q,
        causes=_Q,
        **_OF_JOINTS,
    ),
    Signal(
        *("velocity", "rad/s", _N),
        meaning="joint velocities, as measured or as commanded",
        function=lambda x, q, v, t: v,
        causes=_V,
        **_OF_JOINTS,
    ),
    Signal("network_velocity", "rad/s", _N, motion=True, **_OF_RUN),
    Signal(
        *("p_WE", "m", _AXES),
        meaning="position of the end effector, as measured",
        function=lambda x, q, v, t: x.coordinates(q),
        causes=_Q,
        series=True,
        motion=True,
        sensed=True,
        **_IN_W,
    ),
    Signal(
        *("v_WE", "m/s", _AXES),
        meaning="velocity of the end effector, as measured",
        function=lambda x, q, v, t: x.tip_velocity(q, v),
        causes=_Q | _V,
        series=True,
        motion=True,
        sensed=True,
        **_IN_W,
    ),
    Signal(
        *("R_WE", "", _TURN),
        meaning="orientation of the end effector, as measured",
        function=lambda x, q, v, t: x.kinematics.R_WE(q),
        causes=_Q,
        sensed=True,
        **_IN_W,
    ),
    # The desired motion.
    Signal(
        *("p_WE_desired", "m", _AXES),
        meaning="desired position of the end effector",
        function=lambda x, q, v, t: x.desired(t)[0],
        ahead="p_preview",
        series=True,
        motion=True,
        **_OF_PATH,
    ),
    Signal(
        *("v_WE_desired", "m/s", _AXES),
        meaning="desired velocity of the end effector",
        function=lambda x, q, v, t: x.desired(t)[1],
        ahead="v_preview",
        series=True,
        motion=True,
        **_OF_PATH,
    ),
    Signal(
        *("a_WE_desired", "m/s^2", _AXES),
        meaning="desired acceleration of the end effector",
        function=lambda x, q, v, t: x.desired(t)[2],
        ahead="a_preview",
        **_OF_PATH,
    ),
    Signal(
        *("R_WE_desired", "", _TURN),
        meaning="desired orientation of the end effector",
        function=lambda x, q, v, t: x.path.orientation(t)[0],
        ahead="R_preview",
        **_TURNING,
    ),
    Signal(
        *("w_WE_desired", "rad/s", _XYZ),
        meaning="desired angular velocity of the end effector",
        function=lambda x, q, v, t: x.path.orientation(t)[1],
        ahead="w_preview",
        **_TURNING,
    ),
    Signal(
        *("alpha_WE_desired", "rad/s^2", _XYZ),
        meaning="desired angular acceleration of the end effector",
        function=lambda x, q, v, t: x.path.orientation(t)[2],
        ahead="alpha_preview",
        **_TURNING,
    ),
    # How the joints move the end effector.
    Signal(
        *("J", "m", _ROWS),
        meaning="Jacobian of the task",
        function=lambda x, q, v, t: x.task_J(q),
        causes=_Q,
        series=True,
        motion=True,
        **_IN_W,
    ),
    Signal(
        *("J_omega", "", ("xyz", "n")),
        meaning="Jacobian of the angular velocity",
        function=lambda x, q, v, t: x.kinematics.J_omega(q),
        causes=_Q,
        **_IN_W,
    ),
    Signal(
        *("Jdot_v", "m/s^2", _AXES),
        meaning="acceleration of the end effector at constant joint velocities",
        function=lambda x, q, v, t: x.tip_bias(q, v),
        causes=_Q | _V,
        **_IN_W,
    ),
    # The dynamics as they are believed to be: torque = M v_dot + bias - gravity.
    Signal(
        *("M", "kg m^2", ("n", "n")),
        meaning="mass matrix of the arm",
        function=lambda x, q, v, t: x.dynamics.M(q),
        causes=_Q,
        **_OF_DYNAMICS,
    ),
    Signal(
        *("bias", "Nm", _N),
        meaning="torques of Coriolis and centrifugal effects",
        function=lambda x, q, v, t: x.dynamics.bias(q, v),
        causes=_Q | _V,
        **_OF_DYNAMICS,
    ),
    Signal(
        *("gravity", "Nm", _N),
        meaning="torques of gravity",
        function=lambda x, q, v, t: x.dynamics.gravity(q),
        causes=_Q,
        **_OF_DYNAMICS,
    ),
    # Joint targets.
    Signal("target", "rad", _N, origin="reference", meaning="joint positions to move to"),
    Signal(
        *("position_preview", "rad"),
        meaning="joint positions ahead of time",
        origin="reference",
        hint="; give a JointReference",
    ),
    # What laws see of obstacles that move, and of a second arm.
    Signal(
        *("p_WO", "m", None, "W"),
        meaning=(
            "how far each obstacle that may move has gone from where it is stated, as measured; in "
            "the order of their list"
        ),
        origin="feature",
    ),
    Signal(
        *("other_commanded", "rad"),
        meaning="joint positions that the other arm's law has commanded",
        origin="feature",
    ),
    Signal(
        *("other_v", "rad/s"),
        meaning="joint velocities that the other arm's law commands",
        origin="feature",
    ),
    Signal(
        *("detour", "rad/s", _N),
        meaning="joint velocities that lead round what the arm is stuck before; NaN for none",
        origin="feature",
    ),
    Signal(
        *("posture", "rad", _N),
        meaning="joint positions that joints prefer: the end of the last detour, or the law's own",
        origin="feature",
    ),
    # The surface that the tool presses on.
    Signal(
        *("normal_WE", "", _XYZ, "W"),
        meaning="normal of the surface that the tool presses on, as it is believed to be",
        function=lambda x, q, v, t: x.normal_W,
        hint="; give the body a contact",
        series=True,
        sometimes=True,
        **_OF_SURFACE,
    ),
    Signal(
        *("normal_force", "N", ()),
        meaning="force along this normal, as measured",
        sensed=True,
        series=True,
        **_OF_SURFACE,
    ),
    Signal(
        *("normal_force_desired", "N", ()),
        meaning="desired force along this normal",
        series=True,
        **_OF_SURFACE,
    ),
    Signal("contact_force", "N", _XYZ, "W", **_OF_RUN),
    Signal("normal_force_bound", "N", (), sometimes=True, **_OF_RUN),
    Signal("normal_force_ratio", "", (), sometimes=True, **_OF_RUN),
    Signal("admittance_offset", "m", (), sometimes=True, **_OF_RUN),
    Signal("admittance_speed", "m/s", (), sometimes=True, **_OF_RUN),
    Signal("admittance_lag", "m", (), sometimes=True, **_OF_RUN),
    # What a camera sees of points on the tool.
    Signal(
        *("pixels", "px", ("pixels",)),
        meaning="pixels of points on the tool, as measured",
        origin="camera",
        sensed=True,
        hint="; give the loop a camera",
        series=True,
        sometimes=True,
    ),
    Signal(
        *("pixels_desired", "px", ("pixels",)),
        meaning="desired pixels of these points",
        origin="camera",
        hint="; give an ImageSource as the reference",
        ahead="pixels_preview",
        series=True,
        sometimes=True,
    ),
    # What the evaluation of a run adds.
    Signal("acceleration", "rad/s^2", _N, **_OF_RUN),
    Signal("acceleration_peak", "rad/s^2", (), **_OF_RUN),
    Signal("network_acceleration", "rad/s^2", _N, **_OF_RUN),
    Signal("network_acceleration_peak", "rad/s^2", (), **_OF_RUN),
    Signal("joint_error", "rad", _N, **_OF_RUN),
    Signal("distance", "m", (), sometimes=True, **_OF_RUN),
    Signal("arms_distance", "m", (), sometimes=True, **_OF_RUN),
    Signal("orientation_error", "rad", (), **_OF_RUN),
    *(Signal(each.name, each.unit, (), **_OF_RUN) for each in TASK_MEASURES),
    # What laws say of themselves.
    Signal("J_hat", "m", _ROWS, meaning="learned Jacobian", **_OF_LAW),
    Signal("displacement", "m", **_OF_LAW),
    Signal("velocity_lower", "rad/s", _N, **_OF_LAW),
    Signal("velocity_upper", "rad/s", _N, **_OF_LAW),
    Signal("acceleration_demand", "rad/s^2", _N, **_OF_LAW),
    Signal("velocity_error_predicted", "m/s", **_OF_LAW),
    Signal("torque", "N m", _N, **_OF_LAW),
    Signal("torque_hat", "N m", _N, **_OF_LAW),
    Signal("M_hat", "kg m^2", ("n", "n"), **_OF_LAW),
    Signal("joint_power", "W", **_OF_LAW),
)
#: The table, by name.
SIGNALS: Mapping[str, Signal] = {signal.name: signal for signal in _ROWS_OF_TABLE}


# What laws keep in parts of their state of these names.
_STATE_PARTS = {
    signal.name: signal
    for signal in (
        Signal("v", "rad/s", _N, origin="law", meaning="joint velocities that the law commands"),
        Signal(
            *("commanded", "rad", _N),
            meaning="joint positions that the law has commanded",
            origin="law",
        ),
        Signal(
            "a", "rad/s^2", _N, origin="law", meaning="joint accelerations that the law commands"
        ),
        SIGNALS["J_hat"],
        # Of laws that keep clear of something.
        Signal(
            *("seen", "rad"),
            origin="law",
            meaning="joint positions in which distances were looked at last",
        ),
        Signal(*("gaps", "m"), origin="law", meaning="lower bounds of the distances of pairs"),
        Signal(
            "held_back",
            origin="law",
            meaning="number of samples in which neither certificate held for the wanted velocity",
        ),
        Signal(
            "uncertified",
            origin="law",
            meaning="number of samples in which the arm moved and no stop was certified",
        ),
        Signal(
            *("stop_delay", "s"),
            origin="law",
            meaning="time by which the stop that was certified last is late; 1000 without one",
        ),
    )
}


def input_description(name: str) -> str:
    """Return what an input of a law is, with frame and unit; of one's own, that it is one."""
    if name in AHEAD:
        signal = SIGNALS[AHEAD[name]]
        return replace(signal, meaning=f"{signal.meaning}, one period ahead").description
    if name in SIGNALS and SIGNALS[name].meaning:
        return SIGNALS[name].description
    return "input of the law; its unit is not declared"


def state_description(name: str) -> str:
    """Return what a part of a law's state is, with its unit as far as that is known."""
    return _STATE_PARTS[name].description if name in _STATE_PARTS else "memory of the law"


def names_of(*origins: Origin) -> tuple[str, ...]:
    """Return the names of the signals that these origins offer, in the order of the table."""
    return tuple(name for name, signal in SIGNALS.items() if signal.origin in origins)


#: Names of signals ahead of time, and of those that they are one period later.
AHEAD = {signal.ahead: name for name, signal in SIGNALS.items() if signal.ahead}
#: Names of what shows a path ahead of time.
PATH_AHEAD = frozenset(SIGNALS[name].ahead for name in names_of("path"))
#: Signals of a path: its position with derivatives, and its orientation with derivatives.
POSITION_OF_PATH, ORIENTATION_OF_PATH = names_of("path")[:3], names_of("path")[3:]
#: Where the end effector should be, and how it should be turned.
DESIRED_POSITION, DESIRED_ORIENTATION = POSITION_OF_PATH[0], ORIENTATION_OF_PATH[0]
#: Position of the end effector, and the desired one.
TRACKING = ("p_WE", DESIRED_POSITION)
#: What to give where a loop lacks a signal, as the end of a message.
HINTS = {name: signal.hint for name, signal in SIGNALS.items() if signal.hint} | {
    SIGNALS[name].ahead: "; give the PathSource a preview of one period"
    for name in POSITION_OF_PATH
}


def _series() -> Iterable[tuple[str, Signal]]:
    """Yield the series of runs by their names."""
    for name, signal in SIGNALS.items():
        if signal.series:
            yield name, signal
        if signal.sensed:
            yield signal.measurement_name, signal


#: Units of the series of a run, by name; a series that is not listed has none.
SERIES_UNITS = {name: signal.unit for name, signal in _series() if signal.unit}
#: Shapes of the series at one time, by name; a series that is not listed may have any shape.
SERIES_SHAPES = {name: signal.shape for name, signal in _series() if signal.shape is not None}
#: Series that every run has; a motion has fields of these names.
OF_EVERY_MOTION = tuple(name for name, signal in SIGNALS.items() if signal.motion)
#: Names that parts of a law's state and its observables must not have: recorded series, what is
#: recorded to make them, and arguments of the function that saves the series.
RESERVED_NAMES = frozenset(
    name for name, signal in _series() if not (signal.origin == "law" or signal.sometimes)
) | {*("time", "state", "next_state", "commanded_velocity", "file", "allow_pickle")}


class DelayedPath:
    """A path by time, a delay ago; the values of the last two times are remembered.

    Signals of one time share an evaluation, and what was ahead at a sample is now at the next one,
    but where the two times differ by rounding.

    Args:
        path: The path.
        delay: The delay [s].
    """

    def __init__(self, path: PathMotion, delay: float = 0.0) -> None:
        self._position = lru_cache(maxsize=2)(lambda t: path.position(t - delay))
        self._orientation = lru_cache(maxsize=2)(lambda t: path.orientation(t - delay))
        self._delay = delay

    def time(self, t: float) -> float:
        """Return the time along the path at a time [s]."""
        return t - self._delay

    def position(self, t: float) -> MotionState:
        """Return p_WE, v_WE and a_WE at a time [s]."""
        return self._position(t)

    def orientation(self, t: float) -> MotionState:
        """Return R_WE, w_WE and alpha_WE at a time [s]."""
        return self._orientation(t)


def at_steps(
    view: View,
    names: Iterable[str],
    times: Array,
    position: Array,
    velocity: Array | None = None,
    **lengths: int,
) -> dict[str, Array]:
    """Return signals at every step of a run, by name, with the steps in front.

    Args:
        view: What they are computed with.
        names: Their names; each must have a function.
        times: Time of every step, shape (k,) [s].
        position: Joint positions at every step, shape (k, n) [rad].
        velocity: Joint velocities likewise [rad/s]; None if no signal follows from them.
        lengths: Lengths of the axes of signals, besides ``n``.
    """
    steps, n = position.shape
    functions = [(SIGNALS[name].function, name) for name in names]
    values = {
        name: np.empty((steps, *SIGNALS[name].lengths(n=n, **lengths))) for _, name in functions
    }
    v = None
    for k, (t, q) in enumerate(zip(times.tolist(), position, strict=True)):
        if velocity is not None:
            v = velocity[k]
        for function, name in functions:
            assert function is not None
            values[name][k] = function(view, q, v, t)
    return values
