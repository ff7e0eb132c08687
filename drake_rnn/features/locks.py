r"""Joints that lock during a run: the section ``faults``, brakes, and what a law is told.

`JointBrakes` stand between the command and the arm, and a `LockAwareReading` around the law's own
tells it of joints that have locked. Both follow one `JointLocks`; no law and no body knows of them.

A joint that stands still causes nothing, whatever a law wants of it: its column of the Jacobian is
zero. In a program whose cost and bounds are those of each joint alone, as

.. math::
    \min_v \tfrac12 v^T W v + c^T v \quad \text{s.t.} \quad J v = w, \quad
    \underline v \le v \le \overline v

with a diagonal W, the other joints then get the velocities of the program whose bounds of the
locked joint are zero; in one that couples joints, such as of their torques, they still follow the
task, but at another cost. What the law goes on to want of the locked joint itself is cut off behind
it, by the brake.

A law that sees J sees that column of it as zero, and the column of a part ``J_hat`` of its state
is set to zero before each step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictInt
from pydrake.geometry import Rgba, Sphere
from pydrake.systems.framework import Context, DiscreteValues

from .. import colours
from ..arrays.algebra import AnyArray
from ..errors import InvalidInputError, OldName
from ..inputs.fields import (
    Array,
    Flag,
    NonNegative,
    is_flags,
    is_vector,
    validated,
)
from ..inputs.keys import Meaning
from ..inputs.messages import (
    nearest,
    plural,
    short,
)
from ..laws import Law, PostureLaw
from ..laws.call_checks import without_checks
from ..laws.law import (
    Layout,
    ReadingWrapper,
    SampledReading,
    Signals,
)
from ..robot.joint_stop import stop_step
from ..robot.limits import JointLimits
from ..systems.block import Block
from .feature import (
    OF_POSITIONS,
    EvaluationSteps,
    Feature,
    Frames,
    Guarantee,
    JointVelocity,
    LegendEntry,
    LoopBuild,
    LoopPart,
    Moment,
    SceneItem,
    Stage,
)

# Sample times carry rounding errors [s].
_ROUNDING = 1e-9
# Acceleration with which a joint stops from one sample to the next [rad/s^2].
_AT_ONCE = 1e12
# Signals and parts of the state whose last axis is joints, with the effect of each on the task.
_JACOBIANS = ("J", "J_omega")
_ESTIMATE = "J_hat"
# Limits of what is commanded that the stop of a joint keeps if the command before it did.
_STOPS_WITHIN = ("acceleration", "jerk")


@validated
class JointLock:
    """A joint that locks during a run, and does not move again."""

    joint: Annotated[StrictInt | str, Meaning("Number of the joint, from 1, or its name.")]
    time: Annotated[
        NonNegative,
        Meaning(
            "Time at which its brake closes; in a sampled loop the first sample from then on.",
            unit="s",
        ),
    ]
    stop: Annotated[
        Literal["braked", "at_once"],
        Meaning(
            "How it comes to rest: ``braked``, as fast as the limits of its acceleration and, if "
            "there is one, of its jerk allow; ``at_once``, from one sample to the next, whatever "
            "the limits are. A joint without a limit of the acceleration always stops at once.",
        ),
    ] = "braked"
    told: Annotated[
        Flag,
        Meaning(
            "Whether a law that sees the Jacobian sees the column of this joint as zero from "
            "then on, and one that learns a Jacobian sets that column of it to zero.",
        ),
    ] = True
    told_after: Annotated[
        NonNegative,
        Meaning("Time after ``time`` from which it does [s], such as a detection takes.", unit="s"),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.told_after > 0.0 and not self.told:
            raise ValueError("told_after: must be left out with told: false")

    def index(self, joints: Sequence[str]) -> int:
        """Return the index of the joint, from 0, among those of an arm.

        Args:
            joints: Their names.

        Raises:
            InvalidInputError: If it is not among them.
        """
        if isinstance(self.joint, str):
            if self.joint not in joints:
                raise InvalidInputError(
                    f"joint: there is no joint {self.joint!r}; {nearest(self.joint, list(joints))}"
                )
            return list(joints).index(self.joint)
        if not 1 <= self.joint <= len(joints):
            raise InvalidInputError(
                f"joint: must be a number from 1 to {len(joints)}, or a name, not {self.joint}"
            )
        return self.joint - 1


@dataclass(frozen=True, eq=False)
class JointLocks(ReadingWrapper, LoopPart):
    """When the joints of an arm lock, shape (n,) each.

    Attributes:
        times: Time at which each joint's brake closes [s]; infinite for one that stays free.
        told: Time from which laws are told of it [s]; infinite if they never are.
        at_once: Whether it stops from one sample to the next.
    """

    times: Array
    told: Array
    at_once: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, entry in (("times", self.times), ("told", self.told)):
            if not is_vector(entry) or not (np.asarray(entry) >= 0.0).all():
                raise InvalidInputError(
                    f"{name}: must be times of 0 or more, one per joint, infinite for never, not "
                    f"{short(entry)}"
                )
        sizes: dict[str, tuple[object, int]] = {"told": (self.told, np.size(self.told))}
        sizes["at_once"] = self.at_once, np.size(self.at_once) if is_flags(self.at_once) else 0
        for name, (value, size) in sizes.items():
            if size != np.size(self.times):
                raise InvalidInputError(
                    f"{name}: must be one per joint, {np.size(self.times)} as in times, not "
                    f"{short(value)}"
                )
        object.__setattr__(self, "times", np.array(self.times, dtype=float))
        object.__setattr__(self, "told", np.array(self.told, dtype=float))
        object.__setattr__(self, "at_once", np.array(self.at_once, dtype=bool))

    @classmethod
    def of(cls, joints: Sequence[str], locks: Sequence[JointLock]) -> JointLocks:
        """Return when the joints of an arm lock.

        Args:
            joints: Names of its joints.
            locks: Its locks, one or more.

        Raises:
            InvalidInputError: If the arm has no such joint, or one locks twice.
        """
        times, told_times = np.full((2, len(joints)), np.inf)
        at_once = np.zeros(len(joints), dtype=bool)
        for lock in locks:
            joint = lock.index(joints)
            if np.isfinite(times[joint]):
                raise InvalidInputError(
                    f"joint: {lock.joint} locks at {times[joint]:g} s already; give it once"
                )
            times[joint] = lock.time
            told_times[joint] = lock.time + lock.told_after if lock.told else np.inf
            at_once[joint] = lock.stop == "at_once"
        return cls(times, told_times, at_once)

    @classmethod
    def of_run(
        cls, joints: Sequence[str], locks: Sequence[JointLock] | None, duration: float
    ) -> JointLocks | None:
        """Return when the joints of an arm lock during a run; None if none does.

        Args:
            joints: Names of its joints.
            locks: Section ``faults`` of a document.
            duration: Duration of the run [s].

        Raises:
            InvalidInputError: If there is no such joint, one locks twice, or none does in this run.
        """
        if not locks:
            return None
        for number, lock in enumerate(locks):
            _require_within(lock, f"faults.{number}", duration)
            try:
                cls.of(joints, locks[: number + 1])
            except InvalidInputError as error:
                raise InvalidInputError(f"faults.{number}.{error}") from None
        return cls.of(joints, locks)

    def around(self, reading: SampledReading) -> SampledReading:
        """See `ReadingWrapper.around`."""
        return LockAwareReading(reading, self)

    def traits(self) -> Mapping[str, Any]:
        return {"faults": self}

    def change_command(self, loop: LoopBuild) -> None:
        """Add what brakes leave of the velocities, which are one then."""
        if loop.period is None:
            return
        brakes = JointBrakes(self, loop.body.arm.limits, loop.period)
        loop.wiring.add("brakes", brakes)
        loop.wiring.connect(loop.velocity.moved, brakes.get_input_port())
        output = brakes.get_output_port()
        loop.velocity = JointVelocity(output, output, output)

    @property
    def moments(self) -> list[Moment]:
        """Times at which joints lock, each with its name in figures and pages."""
        return [
            Moment(float(self.times[joint]), f"joint {joint + 1} locks") for joint in self.joints
        ]

    @property
    def size(self) -> int:
        """Number of joints of the arm."""
        return self.times.size

    @property
    def joints(self) -> list[int]:
        """Indices of the joints that lock, from 0, in the order in which they do."""
        order = np.argsort(self.times, kind="stable").tolist()
        return [joint for joint in order if np.isfinite(self.times[joint])]

    @cached_property
    def span(self) -> tuple[float, float]:
        """Times at which the first and the last of them lock [s]."""
        finite = self.times[np.isfinite(self.times)]
        return float(finite.min()), float(finite.max())

    def is_locked(self, t: float) -> NDArray[np.bool_]:
        """Return whether the brake of each joint is closed at a time [s], shape (n,)."""
        return np.asarray(self.times <= t + _ROUNDING)

    def free(self, t: float | AnyArray) -> AnyArray:
        """Return 1 for each joint that a law takes for free at one or many times [s], 0 for others.

        Args:
            t: The times, a number or shape (k,).

        Returns:
            Factors of the columns of a Jacobian, shape (1, n) or (k, 1, n).
        """
        times = np.asarray(t, dtype=float)[..., np.newaxis, np.newaxis]
        return np.where(self.told <= times + _ROUNDING, 0.0, 1.0)

    locked = OldName("is_locked")


def _require_within(lock: JointLock, key: str, duration: float) -> None:
    """Raise an InvalidInputError if a joint locks, or a law is told of it, after a run."""
    if lock.time >= duration:
        raise InvalidInputError(
            f"{key}.time: must be before the end of the run, {duration:g} s, not {lock.time:g}"
        )
    if lock.time + lock.told_after >= duration:
        raise InvalidInputError(
            f"{key}.told_after: must end before the run does, at {duration:g} s, not be "
            f"{lock.told_after:g}; for never, give told: false"
        )


@dataclass(frozen=True, eq=False)
class LockAwareReading(SampledReading):
    """A reading around another one, which tells it of joints that have locked.

    Attributes:
        reading: The other one.
        locks: When joints lock.

    Raises:
        InvalidInputError: If these are of another number of joints.
    """

    reading: SampledReading
    locks: JointLocks

    def __post_init__(self) -> None:
        shapes = {**self.reading.state.shapes, **self.reading.inputs.shapes}
        sizes = [shapes[name][-1] for name in (*_JACOBIANS, "v", "position") if name in shapes]
        if sizes and sizes[0] != self.locks.size:
            raise InvalidInputError(
                f"locks: must be of {plural(sizes[0], 'joint')}, not of {self.locks.size}"
            )

    @property
    def state(self) -> Layout:
        return self.reading.state

    @property
    def inputs(self) -> Layout:
        return self.reading.inputs

    @property
    def inputs_with_gaps(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Reading.inputs_with_gaps`."""
        return self.reading.inputs_with_gaps

    @property
    def observables(self) -> Layout:
        return self.reading.observables

    @property
    def holds_command(self) -> bool:
        return self.reading.holds_command

    @property
    def integration_scheme(self) -> str:
        return self.reading.integration_scheme

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        return self.reading.initial_state(rng, u)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        return self.reading.commanded_velocity(t, x)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        return np.asarray(self._step(t, self._law_state(t, x), self._view(t, u), period))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return self.reading.diagnostics(t, x, self._view(t, u))

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        return self.reading.resumed(x, q, v, a, elapsed)

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.reading.caveats(metrics)

    @cached_property
    def _step(self) -> Any:
        return without_checks(self.reading.step)

    def _view(self, t: float | Array, u: Signals) -> Signals:
        """Return the signals of a law that is told."""
        free = self.locks.free(t)
        if free.all():
            return u
        return {**u, **{name: free * u[name] for name in _JACOBIANS if name in u}}

    def _law_state(self, t: float, x: Array) -> Array:
        """Return the state of a law that is told."""
        free = self.locks.free(t)
        if _ESTIMATE not in self.state or free.all():
            return x
        return self.state.with_parts(x, **{_ESTIMATE: free * self.state.part(x, _ESTIMATE)})


class JointBrakes(Block):
    """Joint velocities as commanded, but for joints whose brakes are closed.

    From the sample at which a brake closes, its joint comes to rest in the fastest way that its
    limits of acceleration and jerk allow, from the velocity and the acceleration that it had; then
    it rests for good. Where it comes to rest follows from these: a command that leaves no room for
    this stop, as some laws' commands do, may lead a joint beyond its position limit.

    Input is ``commanded``, output ``braked``, both of shape (n,) [rad/s].

    Args:
        locks: When the joints lock.
        limits: Limits of the joints.
        period: Sampling period, for which the braked velocities are held [s].

    Raises:
        InvalidInputError: If locks and limits are of different numbers of joints.
    """

    def __init__(self, locks: JointLocks, limits: JointLimits, period: float) -> None:
        super().__init__()
        n = locks.size
        if limits.size != n:
            raise InvalidInputError(f"locks: must be of {limits.size} joints, not of {n}")
        self._locks, self._period = locks, period
        has_none = limits.acceleration is None
        bounds = np.full(n, np.inf) if has_none else limits.sides("acceleration").least
        most = np.where(locks.at_once, np.inf, bounds)
        jerk = np.full(n, np.inf) if limits.jerk is None else limits.jerk
        # A stop whose acceleration is not bounded has no bound of the jerk.
        self._smooth = np.isfinite(most) & np.isfinite(jerk)
        self._most, self._jerk = np.minimum(most, _AT_ONCE), jerk
        self._command = self.DeclareVectorInputPort("commanded", n)
        # What joints with closed brakes are given; whether they have them; what all were given
        # in the period before this one.
        state = [self.DeclareDiscreteState(n) for _ in range(3)]
        self._given, self._closed, self._before = state
        self.DeclareVectorOutputPort("braked", n, self._calc_braked)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_braked(self, context: Context, output: Any) -> None:
        output.set_value(self._brake(context))

    def _brake(self, context: Context) -> Array:
        command, is_closed = (self._part(context, each) for each in (self._given, self._closed))
        return np.where(is_closed > 0.0, command, self._command.Eval(context))

    def _part(self, context: Context, index: Any) -> Array:
        return context.get_discrete_state(index).value()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        is_closed = self._locks.is_locked(context.get_time())
        v = self._brake(context)
        # The law steps at the same time: the command is still the one of the period that ends now.
        if is_closed.any():
            a = (v - self._part(context, self._before)) / self._period
            state.set_value(self._given, self._slower(v, a, is_closed))
            state.set_value(self._closed, is_closed.astype(float))
        state.set_value(self._before, v)

    def _slower(self, v: Array, a: Array, is_closed: NDArray[np.bool_]) -> Array:
        """Return the next velocities of a stop, shape (n,); zero for joints that are free."""
        after = np.zeros(v.size)
        a = np.clip(a, -self._most, self._most)
        for smooth in (False, True):
            which = is_closed & (self._smooth == smooth)
            moving = v[which].tolist(), a[which].tolist(), self._most[which].tolist()
            jerk = self._jerk[which].tolist() if smooth else None
            after[which], _ = stop_step(*moving, jerk, self._period)
        return after


def lock_doubts(
    locks: JointLocks | None, law: Law, joints: Sequence[str], task_size: int
) -> list[str]:
    """Return warnings about the joints that lock.

    Args:
        locks: When joints lock; None if none does.
        law: The law.
        joints: Names of the arm's joints.
        task_size: Number of dimensions of the task.
    """
    if locks is None:
        return []
    names = [joints[joint] for joint in locks.joints]
    doubts, left = [], len(joints) - len(names)
    if left < task_size:
        doubts.append(
            f"faults: with {', '.join(names)} locked, {plural(left, 'joint')} "
            f"remain{'s' * (left == 1)} for the {task_size} dimensions of the task"
        )
    tellable = law.sees_jacobian or law.learns_jacobian
    if np.isfinite(locks.told).any() and not tellable:
        doubts.append(
            f"faults: {type(law).__name__} sees and learns no Jacobian, so that it cannot be "
            "told; it goes on as if the joints moved"
        )
    if isinstance(law, PostureLaw):
        doubts.append(
            f"faults: {', '.join(names)} will not reach the target posture, unless they lock there"
        )
    return doubts


def left_by_locks(arm: Guarantee, locks: JointLocks, limits: JointLimits) -> Guarantee:
    """Return what is left of what an arm keeps where joints lock: a stop is of all joints.

    A joint that locks stops within the limits that the command kept, but not within higher ones.

    Args:
        arm: What it keeps without locks.
        locks: When joints lock.
        limits: Limits of the joints.
    """
    able = ("velocity", *_STOPS_WITHIN) if not locks.at_once.any() else ("velocity",)
    # A command within fewer bounds than its stop may need more way than it has.
    names = {name for name in _STOPS_WITHIN if limits.bounds[name] is not None}
    room = names <= set(arm.limits)
    return Guarantee(
        tuple(name for name in arm.limits if name in able or (room and name in OF_POSITIONS))
    )


# A ball that the arm's links show through [m].
_MARK_RADIUS, _MARK_OPACITY = 0.09, 0.6


class DrawnLocks(SceneItem):
    """A ball round each joint that has locked, below "/locked" in the scene.

    Args:
        stage: Where they are drawn.
        locks: When joints lock.
    """

    def __init__(self, stage: Stage, locks: JointLocks) -> None:
        self._stage, self._locks = stage, locks

    def draw(self) -> list[str]:
        for joint in self._locks.joints:
            ball = Rgba(*colours.components(colours.BOUND), _MARK_OPACITY)
            self._stage.meshcat.SetObject(_place(joint), Sphere(_MARK_RADIUS), ball)
            self._stage.meshcat.SetProperty(_place(joint), "visible", False)
        return []

    def record(self, frames: Frames) -> None:
        """Record where the balls are, and from when on they are seen."""
        motion, begin = self._stage.motion, self._stage.begin
        postures = motion.at(frames.time, motion.position)
        points = np.array([self._points(q) for q in postures])
        for number, joint in enumerate(self._locks.joints):
            frames.move(_place(joint), points[:, number])
            frames.show(_place(joint), float(self._locks.times[joint]) - begin)

    def _points(self, q: Array) -> list[Array]:
        """Return where the joints that lock are in a posture, shape (3,) each [m]."""
        arm = self._stage.arm
        arm.set_posture(q)
        names = [arm.arm.joints[joint] for joint in self._locks.joints]
        bodies = [arm.plant.GetJointByName(name).child_body() for name in names]
        return [arm.X_WB(body).translation() for body in bodies]


def _place(joint: int) -> str:
    return f"/locked/{joint}"


class LocksFeature(Feature):
    """The section ``faults``."""

    key = "faults"

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        return {"locks": experiment.locks}

    def doubts(self, experiment: Any) -> list[str]:
        size = experiment.task.size
        return lock_doubts(experiment.locks, experiment.law, experiment.arm.joints, size)

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        locks = experiment.locks
        return arm if locks is None else left_by_locks(arm, locks, experiment.limits)

    def moments(self, experiment: Any) -> Iterable[Moment]:
        return () if experiment.locks is None else experiment.locks.moments

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        return {} if experiment.locks is None else {"locked": experiment.locks.span}

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        if (locks := stage.experiment.locks) is not None:
            yield DrawnLocks(stage, locks)

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        entry = LegendEntry("locked", "locked joint", colour=colours.BOUND)
        return () if experiment.locks is None else (entry,)
