"""The base classes of all laws: neural dynamics as functions of arrays, without Drake.

A law that `takes_many` robots is written once for one and for any number of them: states, signals,
gains and results may have leading axes, the same or such as broadcast, in arrays of NumPy or of
JAX, all of one kind. The functions in `drake_rnn.arrays.algebra` take either. For one robot in
NumPy they are the plain ones. Where its numbers would decide which way the program goes, those of
many choose between results: `drake_rnn.arrays.algebra.is_one`. `drake_rnn.laws.checks` makes one
law of many that differ in their numbers. A robot's result has the same bits in any company, and
those that it has alone but for rounding.

Each scheme is a `Law`. A controller runs one of its readings: the sampled one at a fixed period, or
the continuous one with a Drake integrator. Most laws are their own readings and extend
`SampledLaw`, `ContinuousLaw`, or both.

Named parts of flat vectors: the state of a law, and the signals that it sees.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, ParamSpec, Protocol, TypeVar

import numpy as np

from ..arrays.algebra import functions_of
from ..errors import InvalidInputError, OldName
from ..inputs.fields import Array, checked, number, whole
from ..inputs.messages import field_names, short
from ..robot.clearance import Clearance
from ..robot.clearance.clearance import Neighbour
from .call_checks import check_calls
from .guarantee import Guarantee as Guarantee

Signals = Mapping[str, Array]
#: Parts of the state of a law, by name.
State = dict[str, Array]

_P = ParamSpec("_P")
_Output = TypeVar("_Output", covariant=True)


class Component(Protocol[_P, _Output]):
    """A part of a law with memory: what it remembers is in the parts of the law's state it names.

    A law puts the `shapes` of its components side by side in its `Layout`, their `init` in its
    initial state, and what their steps return in its next state. A component never changes itself,
    so that one step can be repeated, traced by JAX, and taken for many robots at once.
    """

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name; empty if it remembers nothing."""

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state, by name.

        Args:
            u: Signals at the start.
            rng: Random generator with the experiment's seed.
        """

    def step(
        self, state: State, u: Signals, period: float, /, *args: _P.args, **kwargs: _P.kwargs
    ) -> tuple[_Output, State]:
        """Return what it finds at a sample, and its parts of the next state, by name.

        Args:
            state: Parts of the law's state, by name, its own among them.
            u: Signals at the sample.
            period: Time until the next sample [s].
            args: What the law, or components before it, have found at this sample.
            kwargs: Likewise, by name.
        """


class Layout:
    """The named parts of a flat vector, in order; iteration yields their names.

    Args:
        parts: Shape of each part by name, e.g. ``v=(7,), J_hat=(3, 7)``.

    Raises:
        InvalidInputError: If a shape is not one or more positive whole numbers.
    """

    def __init__(self, **parts: tuple[int, ...]) -> None:
        for name, shape in parts.items():
            _check_shape(name, shape)
        sizes = [int(np.prod(shape)) for shape in parts.values()]
        ends = np.cumsum([0, *sizes])
        self.size = int(ends[-1])
        self.parts = {
            name: (slice(int(end) - size, int(end)), shape)
            for (name, shape), size, end in zip(parts.items(), sizes, ends[1:], strict=True)
        }
        self._places = tuple(self.parts.values())

    def __contains__(self, name: str) -> bool:
        return name in self.parts

    def __iter__(self) -> Iterator[str]:
        return iter(self.parts)

    def __len__(self) -> int:
        return len(self.parts)

    def __repr__(self) -> str:
        return f"Layout({', '.join(f'{name}={shape}' for name, shape in self.shapes.items())})"

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each part, by name."""
        return {name: shape for name, (_, shape) in self.parts.items()}

    def split(self, x: Array) -> list[Array]:
        """Return views of the parts of ``x``, shape (..., size), in order."""
        if x.ndim == 1:
            # Called at every sample: reshaping only the parts that need it saves time.
            return [x[at] if len(s) == 1 else x[at].reshape(s) for at, s in self._places]
        lead = x.shape[:-1]
        return [x[..., at].reshape(lead + shape) for at, shape in self._places]

    def part(self, x: Array, name: str) -> Array:
        """Return a view of one part of ``x``, shape (..., size)."""
        at, shape = self.parts[name]
        return x[..., at].reshape(x.shape[:-1] + shape)

    def by_name(self, x: Array) -> dict[str, Array]:
        """Return views of the parts of ``x``, shape (..., size), by name."""
        return dict(zip(self.parts, self.split(x), strict=True))

    def from_parts(self, values: Signals) -> Array:
        """Return the flat vector of parts by name, shape (..., size); see `join`."""
        return self.join(*(values[name] for name in self.parts))

    def with_parts(self, x: Array, **values: Array) -> Array:
        """Return a copy of ``x``, shape (..., size), with other values of some parts."""
        places = [(self.parts[name][0], name) for name in values]
        if not isinstance(x, np.ndarray):
            for at, name in places:
                x = x.at[..., at].set(values[name].reshape((*x.shape[:-1], -1)))
            return x
        # In the order of memory of what is copied.
        x = x.copy(order="K")
        for at, name in places:
            x[..., at] = values[name].reshape((*x.shape[:-1], -1))
        return x

    def join(self, *values: Array) -> Array:
        """Return the flat vector of the given parts, shape (..., size).

        Their leading axes are broadcast against each other.
        """
        if values[0].ndim == len(self._places[0][1]) and isinstance(values[0], np.ndarray):
            return np.concatenate([value.ravel() for value in values])
        xp = functions_of(*values)
        shapes = [shape for _, shape in self._places]
        leads = [v.shape[: v.ndim - len(s)] for v, s in zip(values, shapes, strict=True)]
        lead = np.broadcast_shapes(*leads)
        whole = (
            xp.broadcast_to(v, lead + s).reshape((*lead, -1))
            for v, s in zip(values, shapes, strict=True)
        )
        return xp.concatenate(list(whole), axis=-1)

    joined = OldName("from_parts")
    named = OldName("by_name")
    replaced = OldName("with_parts")


def _check_shape(name: str, shape: object) -> None:
    sizes = shape if isinstance(shape, tuple) else ()
    if not sizes or not all(isinstance(size, (int, np.integer)) and size > 0 for size in sizes):
        raise InvalidInputError(
            f"Layout: the shape of {name!r} must be positive whole numbers, e.g. (3,) or (3, 7), "
            f"not {short(shape)}"
        )


class Reading(ABC):
    """The form of a law that a controller runs: a state, its inputs and the commanded velocity.

    A reading holds the gains and never changes. The state, a flat vector, is kept by the
    controller.

    `SampledReading.step` and `ContinuousReading.derivatives` check what they are given and raise an
    InvalidInputError that names it: a law's signals come from its user.
    """

    #: Whether `step`, `derivatives`, `commanded_velocity` and `diagnostics` take leading axes of
    #: robots, as the top of this file says. Else they take one robot at a time.
    #: Tried with two robots before a run.
    takes_many = False

    #: Inputs that may be NaN, where there is nothing to see. All others must be finite.
    inputs_with_gaps: tuple[str, ...] = ()

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        check_calls(cls)

    @property
    @abstractmethod
    def state(self) -> Layout:
        """Parts of the state, including ``v``, the joint velocities that it commands."""

    @property
    @abstractmethod
    def inputs(self) -> Layout:
        """Input signals, by port name; without ``J``, it does not know the robot's structure."""

    @property
    def observables(self) -> Layout:
        """Signals that `diagnostics` returns; none by default."""
        return Layout()

    @property
    def knows_commanded_position(self) -> bool:
        """Whether its state has where it has commanded the arm to be, as the part ``commanded``."""
        return "commanded" in self.state

    @property
    def knows_acceleration(self) -> bool:
        """Whether its state has the acceleration that it has commanded, as the part ``a``."""
        return "a" in self.state

    @property
    def holds_command(self) -> bool:
        """Whether the command depends on the state alone, and not on time as well.

        A reading that overrides `commanded_velocity` does so to let the command vary with time.
        """
        return type(self).commanded_velocity is Reading.commanded_velocity

    @property
    def integration_scheme(self) -> str:
        """Name of the Drake scheme that integrates the command over a sample exactly in one step.

        By default Euler's for a velocity that is held, and Heun's, exact for a ramp, otherwise.
        """
        return "explicit_euler" if self.holds_command else "runge_kutta2"

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """Return the initial state, shape (state.size,); zero by default.

        Args:
            rng: Random generator with the experiment's seed.
            u: Signals at the start.
        """
        return np.zeros(self.state.size)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        """Return the commanded joint velocities, of time and state, shape (..., n) [rad/s]."""
        return x[self._v] if x.ndim == 1 else x[..., self._v]

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        """Return the observables, by name; they are recorded, and nothing in the loop may use them.

        For many instants at once, all arrays have a leading dimension, and ``u`` holds signals
        computed from posture, path and time, not measured ones.
        """
        return {}

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        """Return warnings to show after a run with these metrics."""
        return []

    @cached_property
    def _v(self) -> slice:
        return self.state.parts["v"][0]


class SampledReading(Reading):
    """A reading that runs at a fixed sampling period."""

    @abstractmethod
    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state one period later, shape (..., state.size).

        Args:
            t: Time of the sample [s].
            x: State, shape (..., state.size); must not be modified.
            u: Signals at the sample, by name, of the shape in `inputs` after any leading axes.
            period: Time until the next sample [s].
        """

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        """Return a state that goes on from what was commanded without the law.

        The parts of the state that hold what was commanded are those named here, where there are
        any.

        Args:
            x: State, shape (state.size,).
            q: Positions commanded, shape (n,) [rad].
            v: Velocities that have led there, shape (n,) [rad/s].
            a: Accelerations that have led to these, shape (n,) [rad/s^2].
            elapsed: Time that has passed since the sample that is due, in which the law commanded
                nothing [s]; None if it is not known.
        """
        motion = {"commanded": q, "v": v, "a": a}
        return self.state.with_parts(x, **{k: y for k, y in motion.items() if k in self.state})


class ReadingWrapper(ABC):
    """What comes between the reading of a law and its loop."""

    @abstractmethod
    def around(self, reading: SampledReading) -> SampledReading:
        """Return a reading that does what another one does, but for what comes in between.

        Args:
            reading: The other one.
        """


class ContinuousReading(Reading):
    """A reading that is an ordinary differential equation."""

    @abstractmethod
    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the time derivative of the state, shape (..., state.size)."""


@checked(interval=number(above=0.0), count=whole(1))
@dataclass(frozen=True)
class JointPreview:
    """Spacing and number of the future joint positions in a law's input ``position_preview``.

    Attributes:
        interval: Time between two positions [s].
        count: Number of positions; the first is one interval ahead.
    """

    interval: float
    count: int


class Circumstances(NamedTuple):
    """Properties of the loop that a law is to run in.

    Attributes:
        loop_delay: Delay of the filter between the law's command and its inputs [s]; 0 for none.
        reference_is_delayed: Whether the desired position is delayed by the same time.
        pressing_force: Desired pressing force of the tool [N]; None without a contact.
        path_turns: Whether the desired orientation changes along the path.
        start_offset: Way from the end effector to the path at the start, in the task's axes,
            shape (m,) [m]; None without a path.
        start_velocity: Desired velocity of the path at the start, likewise [m/s].
        J: Jacobian of the arm in these axes at the start, shape (m, n), for an estimate of what it
            can do; None without a path.
        task_J: Function of a posture, shape (n,) [rad], that returns the Jacobian of the whole
            task, its rotation first; None if there is none.
        period: Sampling period [s]; None for a law that Drake integrates.
        duration: How long it is to run [s]; None if that is not known.
    """

    loop_delay: float = 0.0
    reference_is_delayed: bool = False
    pressing_force: float | None = None
    path_turns: bool = False
    start_offset: Array | None = None
    start_velocity: Array | None = None
    J: Array | None = None
    task_J: Callable[[Array], Array] | None = None
    period: float | None = None
    duration: float | None = None


class Law(Reading):
    """Neural dynamics of one scheme; the defaults suit most laws."""

    #: Whether the joint velocities scale with the speed of the path, so that `drake_rnn.fastest`
    #: may stretch the path in time.
    stays_on_path = False
    #: Whether it follows joint targets that come to its input ``target``, and no path.
    follows_joint_targets = False
    #: Whether it commands torques, as the part ``torque`` of its state, and not velocities.
    commands_torque = False
    #: Whether it follows the coordinates of a list of objectives in place of a position. They are
    #: then its ``p_WE`` and desired signals, of as many entries as its J has rows.
    follows_objectives = False
    #: Whether it keeps objectives within ranges, and prices their errors, as its field
    #: ``objectives`` says.
    keeps_ranges = False
    #: Whether it may be led round what it is stuck before, by the input ``detour``, if its field
    #: ``detours`` is true.
    makes_detours = False

    # What it can do, by name. The defaults are what its state and inputs declare, which serves laws
    # that do not say more; ask these properties, and nowhere else for the name of a signal.

    @classmethod
    def can_see_pixels(cls) -> bool:
        """Return whether, as set by a document with a camera, it sees pixels.

        Such a law has the fields ``points`` and ``pixel_size``, which follow from the camera.
        """
        return {"points", "pixel_size"} <= set(field_names(cls))

    @property
    def learns_jacobian(self) -> bool:
        """Whether it learns the Jacobian, as the part ``J_hat`` of its state."""
        return "J_hat" in self.state

    @property
    def sees_jacobian(self) -> bool:
        """Whether it is given the Jacobian of the position or of the orientation."""
        return self._sees("J", "J_omega")

    @property
    def sees_velocity(self) -> bool:
        """Whether it is given the velocities of the joints, to which dither is added."""
        return self._sees("velocity")

    @property
    def sees_tool_velocity(self) -> bool:
        """Whether it is given the velocity of the end effector."""
        return self._sees("v_WE")

    @property
    def sees_pixels(self) -> bool:
        """Whether it is given pixels of a camera in place of the end effector's position."""
        return self._sees("pixels")

    @property
    def sees_turning(self) -> bool:
        """Whether it is given the desired orientation, itself or by the pixels of points."""
        return self._sees("R_WE_desired", "pixels_desired")

    @property
    def follows_position(self) -> bool:
        """Whether it is given the desired position of the end effector."""
        return self._sees("p_WE_desired")

    @property
    def sees_desired_motion(self) -> bool:
        """Whether it is given the desired position and velocity of the end effector."""
        return self.follows_position and self._sees("v_WE_desired")

    @property
    def follows_orientation(self) -> bool:
        """Whether it is given the desired orientation of the end effector."""
        return self._sees("R_WE_desired")

    @property
    def presses(self) -> bool:
        """Whether it presses against a surface, whose normal it is given."""
        return self._sees("normal_WE")

    @property
    def measures_force(self) -> bool:
        """Whether it is given the measured force along the normal of a surface."""
        return self._sees("normal_force")

    def _sees(self, *names: str) -> bool:
        return any(name in self.inputs for name in names)

    @property
    def keeps(self) -> tuple[str, ...]:
        """Limits that its command keeps by construction, whatever its inputs are.

        The names are those of `drake_rnn.robot.limits.LIMIT_UNITS`. They hold for an ideal arm that
        starts at rest within its limits, in every reading that the law has; none by default.
        """
        return ()

    #: Whether it keeps bounds of velocity and acceleration that differ for the two directions.
    keeps_each_direction = False

    @property
    def returns_inside(self) -> bool:
        """Whether it brings joints back that start outside their position limits.

        By default what keeps these limits does.
        """
        return "position" in self.keeps

    @property
    def neighbour(self) -> Neighbour | None:
        """Another arm beside the one it moves, which it counts with; None without one."""
        return None

    def beside(self, clearance: Clearance, neighbour: Neighbour) -> Law | None:
        """Return the law where another arm stands beside its own; None if it minds nothing there.

        Args:
            clearance: What its arm is to stay clear of, the other arm included.
            neighbour: The other arm.
        """
        return None

    @property
    def keeps_distance(self) -> float | None:
        """Distance that its command keeps, from the arm itself and from obstacles [m].

        By construction, as `keeps`; None for a law that does not look at what is in the way.
        """
        return None

    @property
    def keeps_torque(self) -> tuple[float, ...] | None:
        """Largest torques of the joints that it commands, whatever it sees [N m].

        Infinite for a joint without a limit; None without any, or for a law of velocities.
        """
        return None

    @property
    def guarantee(self) -> Guarantee:
        """What its command keeps by construction, `keeps` and what stands beside it."""
        return Guarantee(self.keeps, self.keeps_distance, torque=self.keeps_torque)

    @property
    def arms_thresholds(self) -> tuple[float, float] | None:
        """Distances of two arms at which rows of the law come into force and allow no approach [m].

        The larger one first; nothing is kept by them. None without such rows.
        """
        return None

    @property
    def distance_doubt(self) -> str:
        """What to say before a run if `keeps_distance` is None and distances are looked at."""
        return (
            "obstacles: this law does not avoid them; distances are measured alone; with "
            "safety.collisions any law avoids them"
        )

    @property
    def limits_remedy(self) -> str:
        """What to give so that it keeps the limits that it does not keep; empty if nothing does."""
        return ""

    @property
    def levels_are_derivatives(self) -> bool:
        """Whether the part ``levels`` of its state, if any, holds derivatives of joint positions.

        If not, it holds other signals that stand for them.
        """
        return True

    @property
    def loop_gains(self) -> Mapping[str, float]:
        """Gains of the position feedback, by field [1/s]; a delay in the loop limits them.

        Empty if the effect of a delay on the law is not known.
        """
        return {}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        """Gains that the sampling period limits, by field [1/s]; by default the loop gains.

        A period must be below the inverse of each: a feedback of more takes away all of an error,
        or more, in one sample. `sampled` refuses any other.
        """
        return self.loop_gains

    @property
    def joint_preview(self) -> JointPreview | None:
        """Future joint positions that the law needs as an input; None by default."""
        return None

    def sampled(self, period: float) -> SampledReading:
        """Return the reading that runs at a fixed period.

        Args:
            period: Sampling period [s].

        Raises:
            InvalidInputError: If the law cannot be sampled, or not at this period; e.g. one of its
                `sampled_gains` is too high for it.
        """
        raise InvalidInputError(
            f"period: {type(self).__name__} cannot be sampled; give an integrator instead"
        )

    def continuous(self) -> ContinuousReading:
        """Return the reading that Drake integrates.

        Raises:
            InvalidInputError: If the law, with its arguments, is not a differential equation.
        """
        raise InvalidInputError(
            f"integrator: {type(self).__name__} is not a differential equation; "
            "give a period instead"
        )

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return warnings to show before a run.

        Raises:
            InvalidInputError: If the law cannot run in these circumstances.
        """
        return []


class SampledLaw(Law, SampledReading):
    """A law that implements `step`."""

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself; laws that do not accept every period override this."""
        return self


class ContinuousLaw(Law, ContinuousReading):
    """A law that implements `derivatives`."""

    def continuous(self) -> ContinuousReading:
        """Return the law itself; laws that are not always continuous override this."""
        return self
