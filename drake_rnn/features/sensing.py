"""The section ``sensing``: what a law measures of a robot, with noise, steps and delay.

- Joint positions and velocities as a robot measures them: noisy, in steps, and late.
- The end effector's pose as a camera or a tracker measures it from outside: noisy and late.
- Imperfections of the measurements that a law sees of its arm.
- Time in whole samples: delays, the sample at a time, and sensors with a delay.
- Normal white noise as a function of seed and sample number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydrake.systems.framework import Context, DiscreteValues

from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Delay,
    NonNegative,
    NonNegativeEach,
    PositiveEach,
    between,
    require_seed,
    validated,
)
from ..inputs.keys import Meaning
from ..inputs.messages import short
from ..laws.parts.jacobian import LEVER, REACH, Measurement
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.rotation import rotation_by
from ..robot.task import TaskSection, named_task
from ..systems.block import Block
from .feature import OF_POSITIONS, Feature, Guarantee, LoopBuild, LoopPart, ports_of

# Largest error of a measured position or orientation [rad, or m].
_COARSEST = 1.0
_Noise = Annotated[NonNegative, between(0.0, _COARSEST)]


@validated
class SensingSettings(LoopPart):
    """Imperfections of the measurements that a law sees of its arm.

    Joints are always measured. The pose of the end effector follows from them by forward
    kinematics; or it is measured from outside, as by a camera, if a noise of the pose is given,
    which may be 0.
    """

    position_noise: Annotated[
        NonNegativeEach,
        Meaning(
            "Standard deviation of the normal noise on each measured position, one number for "
            "all joints or shape (n,) [rad, or m for a joint that slides].",
        ),
    ] = 0.0
    resolution: Annotated[
        PositiveEach | None,
        Meaning("Step of each measured position, likewise; None for no steps."),
    ] = None
    encoder_bits: Annotated[
        Annotated[int, Field(strict=True, ge=1, le=40)] | None,
        Meaning(
            "Bits of an encoder over one turn, in place of ``resolution``, which is then 2 pi / "
            "2^bits; only for joints that turn.",
        ),
    ] = None
    delay: Annotated[
        Delay,
        Meaning(
            "Delay of each measurement; a multiple of the period, at most 5 s because all "
            "delayed measurements are stored.",
            unit="s",
        ),
    ] = 0.0
    secant_samples: Annotated[
        int,
        Field(strict=True, ge=0, le=1000),
        Meaning(
            "Number of samples over which the measured velocity is the difference quotient of "
            "the measured positions; 0 for the robot's own velocity, without noise. ``v_WE`` of "
            "an end effector that is measured from outside always is such a quotient.",
        ),
    ] = 0
    p_WE_noise: Annotated[
        _Noise | None,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of the end effector's "
            "position, measured from outside; None for a position without noise if "
            "``R_WE_noise`` is given, otherwise for one that follows from the joints.",
            unit="m",
        ),
    ] = None
    R_WE_noise: Annotated[
        _Noise | None,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of a rotation vector by "
            "which its measured orientation is off; None likewise.",
            unit="rad",
        ),
    ] = None

    def __post_init__(self) -> None:
        errors = {"position_noise": self.position_noise, "resolution": self.resolution}
        for name, value in errors.items():
            if value is not None and np.max(value) > _COARSEST:
                raise ValueError(f"{name}: may be at most {_COARSEST:g} rad, not {np.max(value):g}")
        if self.resolution is not None and self.encoder_bits is not None:
            raise ValueError(
                "resolution: cannot be combined with encoder_bits, which sets it; give one of them"
            )

    @property
    def from_outside(self) -> bool:
        """Whether the end effector is measured from outside, not computed from the joints."""
        return self.p_WE_noise is not None or self.R_WE_noise is not None

    @property
    def of_position_alone(self) -> bool:
        """Whether nothing but the position of the end effector is measured with errors."""
        steps = self.resolution is not None or self.encoder_bits is not None
        others = np.max(self.position_noise), self.delay, self.secant_samples, self.R_WE_noise
        return self.p_WE_noise is not None and not steps and not any(others)

    def traits(self) -> Mapping[str, Any]:
        return {"sensing": self}

    def add_sensors(self, loop: LoopBuild) -> None:
        body, period = loop.body, loop.period
        if period is None:
            return
        sensor = JointSensor(self, body.arm, body.start, period, loop.seed)
        joints = loop.wiring.add("joint_sensor", sensor)
        for name in ("position", "velocity"):
            loop.wiring.connect(body.GetOutputPort(name), joints.GetInputPort(f"{name}_true"))
        loop.joints |= ports_of(joints)
        if not self.from_outside:
            return
        pose = PoseSensor(self, body.kinematics, loop.task, body.start, period, loop.seed)
        loop.wiring.add("pose_sensor", pose)
        loop.wiring.connect(body.GetOutputPort("position"), pose.GetInputPort("position_true"))
        loop.outside = ports_of(pose) | loop.outside

    def step_of(self, arm: Arm) -> Array | None:
        """Return the step of each joint's measured position, shape (n,); None without steps.

        Raises:
            InvalidInputError: If an encoder counts turns of a joint that slides, or there are not
                as many numbers as joints.
        """
        if self.encoder_bits is None:
            resolution = self.resolution
            return None if resolution is None else arm.each("sensing.resolution", resolution)
        for name, unit in zip(arm.joints, arm.units, strict=True):
            if unit != "rad":
                raise InvalidInputError(
                    f"sensing.encoder_bits: is for joints that turn, and {name} slides; give "
                    "sensing.resolution, one number for each joint"
                )
        return np.full(arm.n, 2.0 * math.pi / 2.0**self.encoder_bits)


#: Number of samples that are drawn together.
BLOCK = 1024


class Stream(IntEnum):
    """Noises of one experiment: its seed gives each another stream of values.

    0 is the stream of a law's first state, 7 that of an arm's link errors.
    """

    DITHER = 1
    FORCE = 2
    JOINTS = 3
    POSES = 4
    OBSTACLES = 5
    CAMERA = 6
    DISTURBANCE = 8


class WhiteNoise:
    """Independent standard normal values that depend on seed and sample number alone.

    Every run and every process gets the same values, in whichever order samples are requested.

    Args:
        size: Number of values of each sample.
        seed: Seed of an experiment.
        stream: Which noise of the experiment it is.
        clip: Largest magnitude of a value; infinite for no bound.

    Raises:
        InvalidInputError: If the size or the seed is not a valid number.
    """

    def __init__(self, size: int, seed: int, stream: Stream, clip: float = np.inf) -> None:
        if not isinstance(size, (int, np.integer)) or size < 1:
            raise InvalidInputError(
                f"size: must be a whole number of at least 1, not {short(size)}"
            )
        require_seed(seed)
        self._size = size
        self._key = (seed, stream)
        self._clip = clip
        # Memo of a pure function: samples are asked for one after the other.
        self._block = (-1, np.zeros((0, size)))

    def sample(self, number: int) -> Array:
        """Return the values of one sample, shape (size,)."""
        block, row = divmod(number, BLOCK)
        if self._block[0] != block:
            self._block = (block, self.block(block))
        return self._block[1][row]

    def block(self, number: int) -> Array:
        """Return the values of `BLOCK` samples, of which that block is the ``number``-th.

        Args:
            number: Number of the block, from 0.

        Returns:
            Shape (BLOCK, size).
        """
        rng = np.random.default_rng([*self._key, number])
        values = rng.standard_normal((BLOCK, self._size))
        return np.clip(values, -self._clip, self._clip)


Measure = Callable[[Context], Array]


def late_samples(key: str, delay: float, period: float) -> int:
    """Return the number of samples that a delay lasts.

    Args:
        key: Name of the delay, for the message.
        delay: The delay [s].
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
    """
    late = round(delay / period)
    if abs(late * period - delay) > 1e-6 * period:
        raise InvalidInputError(
            f"{key}: must be a multiple of the period, {period:g} s, not {delay:g}"
        )
    return late


def sample_number(time: float, period: float) -> int:
    """Return the number of the sample at a time, or of the next one after it.

    Args:
        time: The time [s].
        period: Sampling period [s].
    """
    # Times of samples carry rounding errors.
    return math.ceil(time / period - 1e-6)


class LateSensor(Block):
    """Base class of sensors that measure once every period, with a delay of whole samples.

    At the time of a sample the outputs are the measurements of that sample, or of the sample that
    lies the delay before; between two samples they are what the next sample would measure. Before
    the first sample the arm is assumed to have rested at its start.

    Args:
        settings: Imperfections of the measurement.
        period: Sampling period [s].
        noise: Normal noise, which depends on seed and sample number alone.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
    """

    def __init__(self, settings: SensingSettings, period: float, noise: WhiteNoise) -> None:
        super().__init__()
        self._period, self._noise = period, noise
        self._late = late_samples("sensing.delay", settings.delay, period)
        self._secant = settings.secant_samples
        self._kept = 0  # measurements of which past ones are a state

    def _declare(
        self, name: str, measure: Measure, first: Array, inputs: set[Any], rate: str | None = None
    ) -> None:
        """Declare the output of a measurement, and perhaps of its rate.

        Args:
            name: Name of the output.
            measure: Measurement of now, or of the next sample, shape (size,).
            first: Measurement before the first sample, shape (size,).
            inputs: Tickets of the inputs that are measured.
            rate: Name of the output of the difference quotient over ``secant_samples``; None for
                no such output.
        """
        number, rows = self._kept, self._late + (0 if rate is None else self._secant)
        if rows > 0:
            # Past measurements, newest first.
            self.DeclareDiscreteState(np.tile(first, rows))
            self._kept += 1

            def update(context: Context, state: DiscreteValues) -> None:
                newest, past = measure(context), context.get_discrete_state(number).value()
                state.set_value(number, np.concatenate((newest, past[: -newest.size])))

            self.DeclarePeriodicDiscreteUpdateEvent(self._period, 0.0, update)

        def past(context: Context) -> Array:
            return context.get_discrete_state(number).value().reshape(rows, -1)

        def late(context: Context) -> Array:
            return past(context)[self._late - 1] if self._late else measure(context)

        def quotient(context: Context) -> Array:
            return (late(context) - past(context)[-1]) / (self._secant * self._period)

        prerequisites = {self.xd_ticket(), self.time_ticket(), *inputs}
        for output, calc in ((name, late), (rate, quotient)):
            if output is not None:
                self.DeclareVectorOutputPort(
                    output,
                    first.size,
                    lambda c, out, told=calc: out.set_value(told(c)),
                    prerequisites,
                )

    def _sample(self, context: Context) -> Array:
        """Return the noise of the sample of now, or of the next one."""
        return self._noise.sample(sample_number(context.get_time(), self._period))


class JointSensor(LateSensor):
    """Measurement of a body's joints, once every period of the controller that reads it.

    Inputs are ``position_true`` and ``velocity_true``, outputs ``position`` and ``velocity``, all
    of shape (n,) [rad, rad/s]. `LateSensor` explains their times. The noise is added before the
    encoder rounds to its steps. The robot's own velocity has the same delay as the positions.

    Args:
        settings: Imperfections of the measurement.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period, or the settings do not fit
            the arm.
    """

    role = "sensor"

    def __init__(
        self, settings: SensingSettings, arm: Arm, start: Array, period: float, seed: int = 0
    ) -> None:
        super().__init__(settings, period, WhiteNoise(arm.n, seed, Stream.JOINTS))
        self._step = settings.step_of(arm)
        sigma = arm.each("sensing.position_noise", settings.position_noise)
        self._sigma = sigma if sigma.any() else None
        position = self.DeclareVectorInputPort("position_true", arm.n)
        velocity = self.DeclareVectorInputPort("velocity_true", arm.n)
        self._read_q = position.Eval
        first, at_q = self._quantize(np.asarray(start)), {position.ticket()}
        if settings.secant_samples:
            self._declare("position", self._measure, first, at_q, "velocity")
        else:
            self._declare("position", self._measure, first, at_q)
            self._declare("velocity", velocity.Eval, np.zeros(arm.n), {velocity.ticket()})

    def _measure(self, context: Context) -> Array:
        """Return the measurement of now, or of the next sample, shape (n,) [rad]."""
        q = self._read_q(context)
        if self._sigma is not None:
            q = q + self._sigma * self._sample(context)
        return self._quantize(q)

    def _quantize(self, q: Array) -> Array:
        return q if self._step is None else np.round(q / self._step) * self._step


def pose_noise(seed: int) -> WhiteNoise:
    """Return the noise of a pose, of standard deviation 1: three of position, three of rotation.

    Args:
        seed: Seed of the experiment.
    """
    return WhiteNoise(6, seed, Stream.POSES)


class PoseSensor(LateSensor):
    """Measurement of the task frame E from outside, once every period of the controller.

    Input is ``position_true``, shape (n,) [rad]: the pose is that of the true joints, not of
    the measured ones. Outputs, along the m position axes of the task, are ``p_WE``, shape (m,)
    [m], and, with ``secant_samples``, their difference quotient ``v_WE``, shape (m,) [m/s]; and
    ``R_WE``, the orientation, shape (3, 3), flattened. The measured one is exp(e) R_WE with a small
    rotation vector e in W.

    Delay and samples are those of a `JointSensor`, so that measurements of joints and pose are of
    one instant; the noise is independent of that of the joints.

    Args:
        settings: Imperfections of the measurement.
        kinematics: Kinematics of the arm.
        task: A key of `drake_rnn.robot.task.TASKS`.
        start: Start posture, shape (n,) [rad].
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period, or there is no such task.
    """

    role = "sensor"

    def __init__(
        self,
        settings: SensingSettings,
        kinematics: ArmKinematics,
        task: TaskSection,
        start: Array,
        period: float,
        seed: int = 0,
    ) -> None:
        super().__init__(settings, period, pose_noise(seed))
        self._p_noise, self._R_noise = settings.p_WE_noise or 0.0, settings.R_WE_noise or 0.0
        self._kinematics, self._task = kinematics, named_task(task)
        position = self.DeclareVectorInputPort("position_true", np.size(start))
        self._read_q, at_q = position.Eval, {position.ticket()}
        rate = "v_WE" if settings.secant_samples else None
        self._declare("p_WE", self._measure_p_WE, self._p_WE(start), at_q, rate)
        self._declare("R_WE", self._measure_R_WE, kinematics.R_WE(start).ravel(), at_q)

    def _p_WE(self, q: Array) -> Array:
        return self._task.position(self._kinematics.p_WE(q))

    def _measure_p_WE(self, context: Context) -> Array:
        """Return the position measured now, or at the next sample, shape (m,) [m]."""
        p_WE = self._p_WE(self._read_q(context))
        if self._p_noise == 0.0:
            return p_WE
        return p_WE + self._p_noise * self._task.position(self._sample(context)[:3])

    def _measure_R_WE(self, context: Context) -> Array:
        """Return the orientation measured now, or at the next sample, shape (9,)."""
        R_WE = self._kinematics.R_WE(self._read_q(context))
        if self._R_noise:
            R_WE = rotation_by(self._R_noise * self._sample(context)[3:]) @ R_WE
        return np.ravel(R_WE)


def measurement_of(sensing: SensingSettings | None, noise: float, *, turns: bool) -> Measurement:
    """Return the quality of the measurements that a law sees.

    Args:
        sensing: The measurements; None for ideal ones.
        noise: Error of positions that a camera sees [m].
        turns: Whether the task has an orientation.
    """
    if sensing is None:
        return Measurement(error=noise)
    steps = 0.0 if sensing.resolution is None else float(np.max(sensing.resolution))
    if sensing.encoder_bits is not None:
        steps = 2.0 * math.pi / 2.0**sensing.encoder_bits
    # The mean square error of rounding to steps is a twelfth of the step squared.
    joints = math.hypot(float(np.max(sensing.position_noise)), steps / math.sqrt(12.0))
    arm_length = LEVER * (sensing.R_WE_noise or 0.0) if turns else 0.0
    error = math.hypot(sensing.p_WE_noise or 0.0, noise, REACH * joints, arm_length)
    samples = sensing.secant_samples or None
    return Measurement(error=error, delay=sensing.delay, secant_samples=samples)


class SensingFeature(Feature):
    """The section ``sensing``."""

    key = "sensing"

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        return {"sensing": experiment.document.sensing}

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        """Return what does not depend on positions, which are seen with errors.

        Behind a filter the filter says what is kept.
        """
        document = experiment.document
        if document.sensing is None or document.filter is not None:
            return arm
        left = tuple(name for name in arm.limits if name not in OF_POSITIONS)
        return Guarantee(left, torque=arm.torque)
