"""Contact of an arm's tool with a surface: the sections ``environment``, ``force`` and ``sensor``.

- Desired pressing force on a surface, and the surface's normal.
- A force sensor with noise, delay, a low-pass filter and failures.
- Detection of a stuck force sensor.
- The pressing component of a force.

A path that gives way along the normal is in `drake_rnn.features.admittance`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import NoneType
from typing import Annotated, Any, Literal

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import (
    Context,
    DiagramBuilder,
    DiscreteValues,
    OutputPort,
    System,
)
from pydrake.systems.primitives import MatrixGain

from ..environments import (
    ENVIRONMENTS,
    ContactModel,
    ElasticSurface,
    Surface,
    TouchedSurface,
    solids_of,
)
from ..errors import InvalidInputError, SimulationError
from ..inputs.documents import construct, without_kind
from ..inputs.fields import (
    Array,
    Delay,
    NonNegative,
    Positive,
    Time,
    between,
    validated,
)
from ..inputs.keys import Meaning
from ..inputs.kinds import Modules, naming
from ..inputs.messages import fields_of, is_number, require_type
from ..laws.state_adjustment import smooth_rise
from ..measures import Metric, Motion, Pressing, RunMetrics, Steps
from ..measures.metric import Values
from ..paths import PlacedPath
from ..robot.arm import Arm
from ..robot.clearance.obstacles import Obstacle
from ..robot.tool import beyond_tool
from ..systems.block import AutoDiffFunctions, Block, Calc, constant_time, release
from ..systems.body import Body
from .admittance import (
    LAG_METRIC,
    AdmittanceSettings,
    ForceSampling,
    add_admittance,
    admittance_doubts,
    admittance_series,
    bound_caveats,
)
from .feature import (
    Assumption,
    EvaluationSteps,
    Feature,
    Guarantee,
    LoopBuild,
    LoopPart,
    ports_of,
)
from .obstacles import MakePath, fastest_across, make_motion
from .sensing import Stream, WhiteNoise, late_samples


@validated
class DesiredForce:
    """A pressing force, constant once it has risen."""

    kind: Annotated[
        Literal["law", "admittance"],
        Meaning(
            "``law``: the law presses. ``admittance``: its path gives way along the normal, as a "
            "mass with damping and stiffness would on which force and desired force act; for "
            "laws that follow a path and do not press.",
        ),
    ] = "law"
    value: Annotated[
        NonNegative,
        between(0.0, 1e6),
        Meaning("Final force; may be 0 with a ``stiffness``.", unit="N"),
    ]
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

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        if self.rise_time is None:
            return self.value
        return self.initial + (self.value - self.initial) * float(smooth_rise(t, self.rise_time))


@validated
class ForceProfile(AdmittanceSettings, DesiredForce):
    """A pressing force, constant once it has risen, and what keeps it."""

    def __post_init__(self) -> None:
        if self.initial > 0.0 and self.rise_time is None:
            raise ValueError(f"initial: must be 0 without rise_time, not {self.initial:g}")
        if self.value == 0.0 and not (self.yields and self.stiffness > 0.0):
            raise ValueError("value: must be greater than 0, not 0")
        self.require_bound(max(self.value, self.initial) if self.yields else None)

    @property
    def scale(self) -> float:
        """The force that others are drawn beside, final or largest or 1 N."""
        return self.value or self.largest or 1.0

    @property
    def yields(self) -> bool:
        """Whether the path gives way, in place of a law that presses."""
        return self.kind == "admittance"


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


@dataclass(frozen=True)
class Contact(TouchedSurface, LoopPart):
    """A surface, the force to press on it with, and the sensor of that force.

    Attributes:
        surface: An `ElasticSurface` for an `IdealArm`, a `ContactModel` for a `PlantArm`.
        force: Desired pressing force.
        sensor: Force sensor; None for an ideal one.
        motion: Path of the surface from where it begins; None for one that stands still.
        path_speed: Largest speed of the path along the surface [m/s], which a bound of the force
            with a ``normal_error`` counts on; None if it is not known.

    Raises:
        InvalidInputError: If one of them has the wrong type, or the surface's normal is none.
    """

    force: ForceProfile
    sensor: SensorSettings | None = None
    motion: PlacedPath | None = None
    path_speed: float | None = None

    def __post_init__(self) -> None:
        require_type("Contact.surface", self.surface, ElasticSurface, ContactModel)
        require_type("Contact.force", self.force, ForceProfile)
        require_type("Contact.sensor", self.sensor, SensorSettings, NoneType)
        require_type("Contact.motion", self.motion, PlacedPath, NoneType)
        require_type("Contact.path_speed", self.path_speed, float, int, NoneType)
        super().__post_init__()

    def along(self, path: PlacedPath, duration: float) -> Contact:
        """Return the contact with the largest speed of a path along the surface, where it counts.

        Args:
            path: The path.
            duration: Time from 0 for which it is followed [s].
        """
        if self.force.normal_error == 0.0:
            return self
        n = None if self.surface.is_local else self.surface.believed_normal_W
        return replace(self, path_speed=fastest_across(path, duration, n))

    def assumptions(self, duration: float) -> tuple[Assumption, ...]:
        """Return what the bound of the force rests on; nothing without one.

        Args:
            duration: Duration of the run [s].
        """
        if not self.force.yields or self.force.largest is None:
            return ()
        noise, frozen = 0.0, 0.0
        if self.sensor is not None:
            noise = self.sensor.noise
            if self.sensor.failure == "frozen" and self.sensor.fails_at is not None:
                frozen = max(duration - self.sensor.fails_at, 0.0)
        return self.force.assumptions(self, duration, noise, frozen)

    def traits(self) -> Mapping[str, Any]:
        return {
            "environment": True,
            "force": True,
            "sensor": self.sensor is not None,
            "admittance": self.force.yields,
            "moving_surface": self.motion is not None,
        }

    def add_sensors(self, loop: LoopBuild) -> None:
        """Add the signals of the contact, and what watches its sensor."""
        body, reference = loop.body, ContactReference(self.surface.believed_normal_W, self.force)
        loop.wiring.add("contact_reference", reference)
        loop.offered |= ports_of(reference)
        if self.surface.is_local and "normal_WE" not in loop.given:
            loop.offered["normal_WE"] = self._add_local_normal(loop)
        tool_force = body.GetOutputPort("tool_force")
        measured = self._add_force_sensor(loop, self._add_pressing(loop, tool_force))
        loop.offered["normal_force"] = measured
        force = loop.given.get("normal_force", measured)
        if loop.period is not None:
            self._add_sampled(loop, force, loop.period)
        contact_force = body.GetOutputPort("contact_force")
        loop.forces |= {"contact_force": contact_force, "tool_force": tool_force}
        loop.forces["normal_force"] = force
        loop.recorded |= {"contact_force": contact_force, "normal_force": force}

    def _add_local_normal(self, loop: LoopBuild) -> OutputPort:
        """Add and return the surface's normal where it is nearest to the tool."""
        body, normal = loop.body, LocalNormal(self, loop.body.arm, loop.body.start)
        loop.wiring.add("normal", normal)
        loop.wiring.connect(body.GetOutputPort("position"), normal.get_input_port())
        return normal.get_output_port()

    def _add_pressing(self, loop: LoopBuild, tool_force: OutputPort) -> OutputPort:
        """Add and return the pressing component of the force on the tool."""
        normal = loop.given.get("normal_WE")
        if normal is None and self.surface.is_local:
            normal = loop.offered["normal_WE"]
        if normal is None:
            # For a constant normal Drake's own block is faster.
            row = self.surface.believed_normal_W[np.newaxis, :]
            pressing: System = loop.wiring.add("normal_force", MatrixGain(row))
        else:
            pressing = loop.wiring.add("normal_force", NormalForce())
            loop.wiring.connect(normal, pressing.GetInputPort("normal_WE"))
        loop.wiring.connect(tool_force, pressing.get_input_port(0))
        return pressing.get_output_port()

    def _add_force_sensor(self, loop: LoopBuild, normal_force: OutputPort) -> OutputPort:
        """Add the sensor of a force, if there is one, and return what is measured."""
        if self.sensor is None or loop.period is None:
            return normal_force
        sensor = ForceSensor(self.sensor, loop.period, loop.seed)
        loop.wiring.add("force_sensor", sensor)
        loop.wiring.connect(normal_force, sensor.get_input_port())
        return sensor.get_output_port()

    def _add_sampled(self, loop: LoopBuild, force: OutputPort, period: float) -> None:
        """Add what watches the measured force, and the path that gives way."""
        wiring, position = loop.wiring, loop.body.GetOutputPort("position")
        watch = wiring.add("force_watch", ForceWatch(position.size(), WATCH_WINDOW * period))
        wiring.connect(force, watch.GetInputPort("normal_force"))
        wiring.connect(position, watch.GetInputPort("position"))
        if not self.force.yields:
            return
        if self.force.normal_error > 0.0 and self.path_speed is None:
            raise InvalidInputError(
                "Contact.path_speed: must be given with force.normal_error, the largest speed of "
                "the path along the surface"
            )
        sampling = ForceSampling(period, path_speed=self.path_speed or 0.0)
        if self.sensor is not None:
            late = 1 + late_samples("sensor.delay", self.sensor.delay, period)
            sampling = sampling._replace(late=late, noise=self.sensor.noise)
        add_admittance(loop, self.force, self.force.at, self.surface, force, sampling)

    def normals(self, arm: Arm, start: Array) -> Callable[[float, Array], Array]:
        """Return what gives the true normal at a time [s] nearest to a point, shape (3,) [m].

        Args:
            arm: The arm.
            start: Start posture, shape (n,) [rad].
        """
        if not self.surface.is_local or not isinstance(self.surface, ContactModel):
            return lambda t, point: self.surface.normal_W
        local = LocalNormals(self.surface, self.place(arm, start))
        return lambda t, point: local.at(point - self.shift(t)[0])


class ContactReference(Block):
    """Source of ``normal_WE``, shape (3,), and ``normal_force_desired``, shape (1,) [N].

    Args:
        normal: Outward unit normal of the surface in the world frame, shape (3,).
        force: Desired pressing force.
    """

    role = "force"

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


class LocalNormals:
    """Outward normals of a surface of bodies where it is nearest to points.

    Args:
        surface: The surface.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Raises:
        InvalidInputError: If no distance from any of its shapes is known.
    """

    def __init__(self, surface: ContactModel, p_WS: Array) -> None:
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
        surface.add_to(plant, p_WS)
        plant.Finalize()
        diagram = builder.Build()
        release(diagram)
        self._root = diagram.CreateDefaultContext()
        self._diagram, self._scene_graph = diagram, scene_graph
        if not self._near(p_WS):
            raise InvalidInputError(
                "environment.normals: must be start; no distance from a shape of the model is known"
            )

    def _near(self, point: Array) -> list[Any]:
        context = self._scene_graph.GetMyContextFromRoot(self._root)
        query = self._scene_graph.get_query_output_port().Eval(context)
        return list(query.ComputeSignedDistanceToPoint(point))

    def at(self, point: Array) -> Array:
        """Return the normal nearest to a point, shape (3,) both [m]."""
        nearest = min(self._near(point), key=lambda each: each.distance)
        return np.asarray(nearest.grad_W)


class LocalNormal(Block):
    """Source of ``normal_WE``, shape (3,): the surface's normal where it is nearest to the tool.

    The input is ``position`` of the joints, shape (n,) [rad].

    Args:
        contact: The contact.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
    """

    role = "force"

    def __init__(self, contact: Contact, arm: Arm, start: Array) -> None:
        super().__init__()
        normal_at, kinematics = contact.normals(arm, start), arm.kinematics()
        position = self.DeclareVectorInputPort("position", arm.n)

        def normal_WE(context: Context, output: Any) -> None:
            output.set_value(normal_at(context.get_time(), kinematics.p_WE(position.Eval(context))))

        causes = {position.ticket()}
        if contact.motion is not None:
            causes.add(self.time_ticket())
        self.DeclareVectorOutputPort("normal_WE", 3, normal_WE, causes)


class NormalForce(Block):
    """Component ``normal_force``, shape (1,) [N], of ``force`` along ``normal_WE``, shape (3,)."""

    role = "force"

    def __init__(self) -> None:
        super().__init__()
        force = self.DeclareVectorInputPort("force", 3)
        normal = self.DeclareVectorInputPort("normal_WE", 3)

        def normal_force(context: Context, output: Any) -> None:
            output.set_value([normal.Eval(context).dot(force.Eval(context))])

        prerequisites = {force.ticket(), normal.ticket()}
        self.DeclareVectorOutputPort("normal_force", 1, normal_force, prerequisites)

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        force, normal = inputs["force"], inputs["normal_WE"]
        return AutoDiffFunctions(
            {"normal_force": lambda context: normal(context).dot(force(context))}
        )


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

    role = "force"

    def __init__(self, settings: SensorSettings, period: float, seed: int = 0) -> None:
        super().__init__()
        self._settings = settings
        self._period = period
        self._noise = WhiteNoise(1, seed, Stream.FORCE)
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
        is_failing = x[-1]
        x[1:-1] = x[:-2]
        x[0] = self._measured.Eval(context)[0] + self._error(number)
        x[-1] = self._kept * is_failing + (1.0 - self._kept) * x[-2]
        fails_at = self._settings.fails_at
        if fails_at is not None and context.get_time() >= fails_at:
            x[-1] = is_failing if self._settings.failure == "frozen" else math.nan
        if not math.isfinite(x[-1]):
            # A law that sees this could only report that its own state is not finite.
            raise SimulationError(
                f"{self.get_name()}: the force sensor reads {x[-1]}", context.get_time()
            )
        state.set_value(x)

    def _error(self, number: int) -> float:
        sigma = self._settings.noise
        return 0.0 if sigma == 0.0 else sigma * float(self._noise.sample(number)[0])


#: Samples from one check of the force sensor to the next: each costs time, and a stuck sensor stays
#: stuck.
WATCH_WINDOW = 10

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

    role = "force"

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


def described_contact(
    section: Mapping[str, Any] | None,
    force: ForceProfile | None,
    sensor: SensorSettings | None,
    level: type[Body],
    modules: Modules,
    duration: float,
    make_path: MakePath,
) -> Contact | None:
    """Return the contact that a document describes; None without an environment.

    Args:
        section: Section ``environment`` of the document.
        force: Desired force.
        sensor: Force sensor; None for an ideal one.
        level: Class of the body.
        modules: Modules that may be imported for the environment.
        duration: Duration of the run [s].
        make_path: Makes the path of a surface that moves.

    Raises:
        InvalidInputError: If a key is missing or wrong.
    """
    if section is None:
        return None
    kind = ENVIRONMENTS.named_by(section, modules)
    level.check_surface(kind)
    if force is None:
        raise InvalidInputError("force: must be given with an environment")
    surface: Surface = construct(kind, without_kind(section), "environment")
    motion = None
    if surface.moves is not None:
        motion = make_motion(surface.moves, "environment.moves", "surface", make_path)
        if isinstance(surface, ContactModel) and not surface.is_carried:
            raise InvalidInputError(
                f"environment.moves: must be left out; {kind.__name__} has no is_carried"
            )
    return Contact(surface, force, sensor, motion)


_NO_EXTENT = (
    "obstacles: the surface of environment is a spring without extent, which only the end effector "
    "meets; distances from it are not looked at"
)


def pressed_solids(
    contact: Contact | None, arm: Arm, start: Array
) -> tuple[tuple[Obstacle, ...], tuple[str, ...]]:
    """Return what the surface of a contact is to bodies that do not press on it, and warnings.

    Args:
        contact: The contact; None without one.
        arm: The arm.
        start: Start posture, shape (n,) [rad].

    Raises:
        InvalidInputError: If the arm has no tool, or no solid fits round the surface.
    """
    if contact is None:
        return (), ()
    surface = contact.surface
    if not isinstance(surface, ContactModel):
        return (), (_NO_EXTENT,)
    return solids_of(surface, contact.place(arm, start)), ()


# Largest extent of a path along the normal, where only the force is controlled [m].
_OFF = 1e-3
# Speed of the tool along the normal, with joints at 1 rad/s, below which it cannot press [m/s].
_STICK_SPEED = 1e-3


def contact_doubts(
    contact: Contact | None, path: PlacedPath, arm: Arm, start: Array, duration: float
) -> list[str]:
    """Return warnings about the contact of an experiment, checked together with its path.

    Args:
        contact: The contact; None without one.
        path: Path of the experiment, placed at the start.
        arm: The arm.
        start: Start posture, shape (n,) [rad].
        duration: Duration of the run [s].

    Raises:
        InvalidInputError: If arm or path do not fit the surface.
    """
    if contact is None:
        return []
    _require_mobility(contact.surface, arm, start)
    if contact.force.stiffness == 0.0 or not contact.force.yields:
        _require_along(contact.surface, path)
    doubts = _doubts(contact, path, arm, start)
    if contact.force.yields:
        is_filtered = contact.sensor is not None and contact.sensor.low_pass is not None
        assumptions, speed = contact.assumptions(duration), contact.path_speed or 0.0
        doubts += admittance_doubts(contact.force, contact.surface, speed, assumptions, is_filtered)
    fails_at = None if contact.sensor is None else contact.sensor.fails_at
    if fails_at is not None and fails_at >= duration:
        doubts.append(
            f"sensor.fails_at: {fails_at:g} s is not before the run's end, {duration:g} s"
        )
    return doubts


def _require_mobility(surface: Surface, arm: Arm, start: Array) -> None:
    """Raise an InvalidInputError if no joint moves the tool along the surface's normal."""
    n = surface.believed_normal_W
    speed = float(np.linalg.norm(n @ arm.kinematics().J(start)))
    if speed < _STICK_SPEED:
        raise InvalidInputError(
            f"environment.normal: the arm cannot move its tool along {np.round(n, 4).tolist()} "
            f"from its start ({speed:.2g} m/s at 1 rad/s), so it cannot press there"
        )


def _require_along(surface: Surface, path: PlacedPath) -> None:
    """Raise an InvalidInputError for a path off the plane, which would be ignored silently."""
    if not surface.is_plane:
        return
    extent = float(np.ptp(path.sample(100) @ surface.normal_W))
    if extent > _OFF:
        raise InvalidInputError(
            f"path: leaves the surface by {extent:.3g} m along the normal, where the force is "
            "controlled; give a path in the plane with the normal "
            f"{np.round(surface.normal_W, 4).tolist()}"
        )


def _doubts(contact: Contact, path: PlacedPath, arm: Arm, start: Array) -> list[str]:
    surface = contact.surface
    p_WS = contact.place(arm, start)
    doubts = []
    if isinstance(surface, ContactModel) and surface.gap < 0.0:
        doubts.append(
            f"environment.gap: the tool starts {-surface.gap:.3g} m inside the surface, which "
            "pushes it out at once"
        )
    if isinstance(surface, ContactModel) and surface.is_plane:
        for name, excess in beyond_tool(arm, start, surface.normal_W).items():
            doubts.append(
                f"arm.tool: {name} reaches up to {excess:.2g} m farther towards the surface than "
                "the tool; only the tool makes contact, so it passes through: give a longer tool"
            )
    with naming(f"{type(surface).__name__}.overhang"):
        beyond = float(surface.overhang(path.sample(200), p_WS))
    if beyond > 0.0:
        doubts.append(f"path: extends {beyond:.3g} m beyond the edges of the surface")
    return doubts


# Share of the force that may be missing without a warning, and what advice aims at; the largest
# gain that is advised, as a share of one over the period.
_MISSING, _AIM, _MOST = 0.1, 0.03, 0.1
# Share of the force that may be missing in any run without a warning.
_MUCH = 1.0 / 3.0
# Time constants of the feedback after which a force has risen.
_SETTLED = 3.0


def _force_gains(law: Any) -> dict[str, float]:
    """Return the gain of the feedback of a measured force [1/s], by its key in the law, if any."""
    if not law.measures_force:
        return {}
    own = fields_of(law)
    control = own.get("force_control")
    gains, key = (own, "") if control is None else (fields_of(control), "force_control.")
    return {f"{key}gain": float(gains["gain"])} if is_number(gains.get("gain")) else {}


def _force_caveats(experiment: Any, metrics: Mapping[str, float]) -> Iterable[str]:
    """Yield a warning if the force is off, as over a surface that rises or falls along the path.

    More than a third of it is told whatever the window is; a tenth of it only once it has settled.
    """
    if experiment.contact.force.stiffness > 0.0 and experiment.contact.force.yields:
        return  # its path is to keep the tool, not the force
    target_force, period = experiment.contact.force.value, experiment.document.period
    window = experiment.document.window
    off, mean = metrics.get("force_error_rms_N", 0.0), metrics.get("force_error_mean_N", 0.0)
    end = metrics.get("force_error_end_N", 0.0)
    gains = _force_gains(experiment.law)
    slowest = min(gains.values(), default=1.0)
    settling_end = (experiment.contact.force.rise_time or 0.0) + _SETTLED / slowest
    # Without a window, what is missing on average is also what was missing before contact.
    average = 0.0 if window is None else abs(mean)
    if off > _MISSING * target_force and (window or (0.0,))[0] >= settling_end:
        text = (
            f"force: off by {off:.3g} N rms of {target_force:g} N in the window, {mean:+.3g} N on "
            "average"
        )
    elif max(average, abs(end)) > _MUCH * target_force:
        text = (
            f"force: off by more than a third of {target_force:g} N: {end:+.3g} N when the run "
            f"ends, {mean:+.3g} N on average, {off:.3g} N rms"
        )
    else:
        return
    for key, gain in gains.items():
        better = gain * off / (_AIM * target_force)
        better = min(better, _MOST / period) if period is not None else better
        if better > 1.5 * gain:
            text += (
                f"; where the surface rises or falls along the path, this goes as 1 / law.{key}: "
                f"{float(f'{better:.1g}'):g} in place of {gain:g} leaves about "
                f"{off * gain / float(f'{better:.1g}'):.2g} N"
            )
    measures = experiment.law.measures_force or experiment.contact.force.yields
    yield text + ("; a slower path leaves less" if measures else "; the law does not measure it")


def _series_of(name: str) -> Values:
    """Return the values of a series at the steps of a motion; None without it."""
    return lambda motion, against: motion.features.get(name)


class ContactFeature(Feature):
    """The sections ``environment``, ``force`` and ``sensor``."""

    key = "environment"
    metrics = (
        Metric(
            "normal_force_ratio_max",
            "largest true force along the normal over ``force.largest``",
            shown=("force", "sweep"),
            of=_series_of("normal_force_ratio"),
        ),
        LAG_METRIC,
    )

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        """Return the same, with the largest force that an admittance keeps."""
        return arm._replace(force=self.stated(experiment).get("force"))

    def assumptions(self, experiment: Any) -> Mapping[str, Sequence[Assumption]]:
        """Return what the bound of the force rests on."""
        if experiment.contact is None:
            return {}
        assumptions = experiment.contact.assumptions(experiment.document.duration)
        return {"force": assumptions} if assumptions else {}

    def stated(self, experiment: Any) -> Mapping[str, float]:
        """Return the largest force."""
        contact = experiment.contact
        if contact is None or not contact.force.yields or contact.force.largest is None:
            return {}
        return {"force": contact.force.largest}

    def doubts(self, experiment: Any) -> list[str]:
        path, duration = experiment.desired, experiment.document.duration
        arm, start = experiment.arm, experiment.start
        return contact_doubts(experiment.contact, path, arm, start, duration)

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        """Return the true contact force along the true normal of the surface."""
        contact, duration = experiment.contact, experiment.document.duration
        if contact is None:
            return {}
        n, force = contact.surface.normal_W, contact.force
        tip_force, series = run.steps.series("contact_force"), {}
        if contact.surface.is_local:
            normal_at, arm = contact.normals(experiment.arm, experiment.start), experiment.arm
            tip = map(arm.kinematics().p_WE, run.position)
            n = np.array(
                [normal_at(*each) for each in zip(run.steps.time.tolist(), tip, strict=True)]
            )
            series["normal_WE"] = n
        if not run.virtual:
            series |= admittance_series(experiment, run, n)
        pressing = Pressing(
            normal=n,
            force=(tip_force * n).sum(axis=1) if n.ndim == 2 else tip_force @ n,
            desired=np.array([force.at(t) for t in run.steps.time.tolist()]),
            desired_end=force.at(duration),
        )
        if series and force.largest is not None:
            series["normal_force_ratio"] = pressing.force / force.largest
        return {"pressing": pressing, **series}

    def series(self, motion: Motion, steps: Steps) -> Mapping[str, Array]:
        if motion.pressing is None:
            return {}
        return {
            "normal_force": motion.pressing.force,
            "normal_force_desired": motion.pressing.desired,
            "normal_force_measured": steps.series("normal_force")[:, 0],
            "contact_force": steps.series("contact_force"),
        }

    def caveats(
        self, experiment: Any, metrics: Mapping[str, float], run: RunMetrics
    ) -> Iterable[str]:
        """Yield warnings about a contact that was never made, or lost."""
        if run.gap.force_seen is False:
            yield "contact: the tool never touched the surface"
        if "contact_lost_time_s" in metrics:
            yield f"contact: lost at t = {metrics['contact_lost_time_s']:.4g} s"
        elif run.gap.force_seen and experiment.contact is not None:
            yield from _force_caveats(experiment, metrics)
        if experiment.contact is not None:
            assumptions = experiment.contact.assumptions(experiment.document.duration)
            yield from bound_caveats(experiment.contact.force, assumptions, metrics)
