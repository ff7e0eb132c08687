"""Contact of an arm's tool with a surface: the surface, the force and the force sensor.

- Desired pressing force on a surface, and the surface's normal.
- A force sensor with noise, delay, a low-pass filter and failures.
- Detection of a stuck force sensor.
- The pressing component of a force.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Annotated, Any, Literal

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from ..environments import ContactModel, ElasticSurface, Surface
from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import Array, Delay, NonNegative, Positive, Time, between, validated
from ..inputs.keys import Meaning
from ..inputs.kinds import naming
from ..inputs.messages import require_type, short
from ..laws.state_adjustment import smooth_rise
from ..robot.arm import Arm
from ..robot.tool import standoff
from .block import AutoDiffFunctions, Block, Calc, constant_time
from .sensors import WhiteNoise, late_samples


@validated
class ForceProfile:
    """A pressing force, constant once it has risen."""

    value: Annotated[Positive, between(0.0, 1e6), Meaning("Final force.", unit="N")]
    rise_time: Annotated[
        Time | None,
        Meaning(
            "Time in which the force rises smoothly from ``initial``; None for a force that is "
            "constant from the start.",
            unit="s",
        ),
    ] = None
    initial: Annotated[
        NonNegative,
        Meaning("Force at the start; only with ``rise_time``.", unit="N"),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.initial > 0.0 and self.rise_time is None:
            raise ValueError(f"initial: must be 0 without rise_time, not {self.initial:g}")

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        if self.rise_time is None:
            return self.value
        return self.initial + (self.value - self.initial) * float(smooth_rise(t, self.rise_time))


class ContactReference(Block):
    """Source of ``normal_WE``, shape (3,), and ``normal_force_desired``, shape (1,) [N].

    Args:
        normal: Outward unit normal of the surface in the world frame, shape (3,).
        force: Desired pressing force.
    """

    def __init__(self, normal: Array, force: ForceProfile) -> None:
        super().__init__()

        def normal_WE(context: Context, output: Any) -> None:
            output.set_value(normal)

        def normal_force_desired(context: Context, output: Any) -> None:
            output.set_value([force.at(context.get_time())])

        self.DeclareVectorOutputPort("normal_WE", 3, normal_WE, {self.nothing_ticket()})
        # A constant force is computed only once.
        varies = self.nothing_ticket() if force.rise_time is None else self.time_ticket()
        self.DeclareVectorOutputPort("normal_force_desired", 1, normal_force_desired, {varies})
        self._normal, self._force = normal, force

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        normal, force, name = self._normal, self._force, "normal_force_desired"
        return AutoDiffFunctions(
            {
                "normal_WE": lambda context: normal,
                name: lambda context: force.at(constant_time(context, name)),
            }
        )


@validated
class SensorSettings:
    """Imperfections of a force sensor."""

    noise: Annotated[
        NonNegative,
        between(0.0, 1e6),
        Meaning("Standard deviation of the normal noise on each sample.", unit="N"),
    ] = 0.0
    delay: Annotated[
        Delay,
        Meaning(
            "Delay of each sample beyond that of the sampling itself; a multiple of the period, "
            "at most 5 s because all delayed samples are stored.",
            unit="s",
        ),
    ] = 0.0
    low_pass: Annotated[
        Positive | None,
        Meaning(
            "Corner frequency of a first-order filter after the noise; None for none.",
            unit="Hz",
        ),
    ] = None
    failure: Annotated[
        Literal["nan", "frozen"] | None,
        Meaning(
            "Failure at ``fails_at``: ``nan``, which stops the run, or ``frozen`` at the last "
            "value.",
        ),
    ] = None
    fails_at: Annotated[NonNegative | None, Meaning("Time of the failure.", unit="s")] = None

    def __post_init__(self) -> None:
        if (self.failure is None) != (self.fails_at is None):
            raise ValueError("failure: must be given together with fails_at; give both or neither")


class ForceSensor(Block):
    """Sampled force sensor: from ``normal_force_true`` to ``normal_force``, shape (1,) [N].

    Args:
        settings: Imperfections of the sensor.
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
        SimulationError: During a simulation, if the output would not be finite.
    """

    def __init__(self, settings: SensorSettings, period: float, seed: int = 0) -> None:
        super().__init__()
        self._settings = settings
        self._period = period
        self._noise = WhiteNoise(1, seed, stream=2)
        late = late_samples("sensor.delay", settings.delay, period)
        # Share of the previous output that the low-pass filter keeps after one period.
        corner = settings.low_pass
        self._kept = 0.0 if corner is None else math.exp(-2.0 * math.pi * corner * period)
        self._measured = self.DeclareVectorInputPort("normal_force_true", 1)
        # Delayed samples, newest first, then the output.
        self.DeclareDiscreteState(late + 2)
        self.DeclareVectorOutputPort(
            "normal_force",
            1,
            lambda context, output: output.set_value(
                context.get_discrete_state_vector().value()[-1:]
            ),
            {self.xd_ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = context.get_discrete_state_vector().CopyToVector()
        number = round(context.get_time() / self._period)
        said = x[-1]
        x[1:-1] = x[:-2]
        x[0] = self._measured.Eval(context)[0] + self._error(number)
        x[-1] = self._kept * said + (1.0 - self._kept) * x[-2]
        broken = self._settings.fails_at
        if broken is not None and context.get_time() >= broken:
            x[-1] = said if self._settings.failure == "frozen" else math.nan
        if not math.isfinite(x[-1]):
            # A law that sees this could only report that its own state is not finite.
            raise SimulationError(
                f"{self.get_name()}: the force sensor reads {x[-1]}", context.get_time()
            )
        state.set_value(x)

    def _error(self, number: int) -> float:
        sigma = self._settings.noise
        return 0.0 if sigma == 0.0 else sigma * float(self._noise.sample(number)[0])


@dataclass(frozen=True)
class Contact:
    """A surface, the force to press on it with, and the sensor of that force.

    Attributes:
        surface: An `ElasticSurface` for an `IdealArm`, a `ContactModel` for a `PlantArm`.
        force: Desired pressing force.
        sensor: Force sensor; None for an ideal one.

    Raises:
        InvalidInputError: If one of them has the wrong type, or the surface's normal is none.
    """

    surface: Surface
    force: ForceProfile
    sensor: SensorSettings | None = None

    def __post_init__(self) -> None:
        require_type("Contact.surface", self.surface, ElasticSurface, ContactModel)
        require_type("Contact.force", self.force, ForceProfile)
        require_type("Contact.sensor", self.sensor, SensorSettings, NoneType)
        _check_own(self.surface)

    def place(self, arm: Arm, start: Array) -> Array:
        """Return the point of the surface below the tool at the start, shape (3,) [m].

        Raises:
            InvalidInputError: If the arm's frame carries no tool, or the distance from the frame to
                the end of the tool is not known.
        """
        n = self.surface.normal_W
        reach = 0.0
        if isinstance(self.surface, ContactModel):
            given = self.surface.standoff
            reach = standoff(arm, start, n) if given is None else given
        return arm.kinematics().p_WE(start) - (self.surface.gap + reach) * n


def _check_own(surface: Surface) -> None:
    """Raise an InvalidInputError if what a user's own surface says of itself is wrong."""
    name = type(surface).__name__
    with naming(f"{name}.normal_W"):
        normals = {"normal_W": surface.normal_W, "believed_normal_W": surface.believed_normal_W}
    for key, normal in normals.items():
        if np.shape(normal) != (3,) or not abs(np.linalg.norm(normal) - 1.0) < 1e-9:
            raise InvalidInputError(
                f"{name}.{key}: must be an array of shape (3,) and of length 1, not {short(normal)}"
            )
    require_type(f"{name}.is_plane", surface.is_plane, bool)


# Joint motion below which a working sensor may read the same force [rad].
_AT_REST = 1e-9


class ForceWatch(Block):
    """Watchdog that stops a run if the force sensor is stuck.

    Inputs are ``normal_force``, shape (1,) [N], and ``position`` of the joints, shape (n,) [rad];
    there are no outputs. The sensor is stuck if the force is not zero and stays the same to the
    last bit while the joints move. A sensor stuck at exactly 0 N is not detected, because an ideal
    sensor without contact reads the same. A sensor that reads NaN is stopped by `ForceSensor`.

    Args:
        size: Number of joints.
        period: Time between two checks [s].
        patience: Time for which the force may stay the same [s].

    Raises:
        SimulationError: During a simulation, if the sensor is stuck.
    """

    def __init__(self, size: int, period: float, patience: float = 0.1) -> None:
        super().__init__()
        self._patience = patience
        self._measured = self.DeclareVectorInputPort("normal_force", 1)
        self._position = self.DeclareVectorInputPort("position", size)
        # Last force [N], time of its first sample [s], and joint positions at that time [rad].
        self.DeclareDiscreteState(np.zeros(2 + size))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        t, force = context.get_time(), float(self._measured.Eval(context)[0])
        x = context.get_discrete_state_vector().CopyToVector()
        q = self._position.Eval(context)
        if force != x[0] or force == 0.0:
            state.set_value(np.concatenate(((force, t), q)))
        elif t - x[1] > self._patience and np.abs(q - x[2:]).max() > _AT_REST:
            raise SimulationError(
                f"{self.get_name()}: the force sensor has been stuck at {force:.6g} N since "
                f"t = {x[1]:.4g} s, while the arm moves",
                t,
            )


class NormalForce(Block):
    """Component ``normal_force``, shape (1,) [N], of ``force`` along ``normal_WE``, shape (3,)."""

    def __init__(self) -> None:
        super().__init__()
        force = self.DeclareVectorInputPort("force", 3)
        normal = self.DeclareVectorInputPort("normal_WE", 3)

        def normal_force(context: Context, output: Any) -> None:
            output.set_value([normal.Eval(context).dot(force.Eval(context))])

        seen = {force.ticket(), normal.ticket()}
        self.DeclareVectorOutputPort("normal_force", 1, normal_force, seen)

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        force, normal = inputs["force"], inputs["normal_WE"]
        return AutoDiffFunctions(
            {"normal_force": lambda context: normal(context).dot(force(context))}
        )
