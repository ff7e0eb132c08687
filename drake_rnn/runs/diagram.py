"""The diagram of an experiment: the loop of each arm, what it follows, and what is recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System

from ..diagrams import AddLoop, Loop
from ..experiment import Experiment
from ..features.base import drive_of
from ..features.detour import add_detours, recorded_detours
from ..features.feature import LoopPart, ports_of
from ..features.second import add_led, add_neighbour
from ..inputs.messages import require_type
from ..laws import Law
from ..measures import Recorder
from ..robot.limits import OUTSIDE
from ..robot.task import TaskSection
from ..systems import (
    ContinuousController,
    Controller,
    JointReference,
    PathSource,
    SampledController,
    TargetSource,
    followed_path,
)
from .series import PREFIX, RunOptions

_LONGEST_STEP = 0.01


def build_diagram(experiment: Experiment, law: Law | None = None) -> tuple[Diagram, Loop]:
    """Return the diagram of an experiment, not yet simulated, and the systems of its loop.

    Args:
        experiment: The experiment.
        law: Law to run instead of the experiment's own.

    Raises:
        InvalidInputError: If the parts of the diagram do not fit together.
    """
    diagram, (loop, *_) = build_loops(experiment, law)
    return diagram, loop


def build_loops(experiment: Experiment, law: Law | None = None) -> tuple[Diagram, tuple[Loop, ...]]:
    """Return what `build_diagram` does, with the loop of each arm."""
    builder = DiagramBuilder()
    loops = _add_loops(builder, experiment, law, RunOptions())
    return _build(builder, experiment), loops


def _build(builder: DiagramBuilder, experiment: Experiment) -> Diagram:
    diagram = builder.Build()
    diagram.set_name(experiment.name or "experiment")
    return diagram


def _add_loops(
    builder: DiagramBuilder, experiment: Experiment, law: Law | None, options: RunOptions
) -> tuple[Loop, ...]:
    """Add the loop of an experiment and, beside it, that of its second arm, if there is one."""
    require_type("experiment", experiment, Experiment)
    document, second = experiment.document, experiment.second
    law, compiled = experiment.law if law is None else law, options.compiled
    if document.period is None:
        return (_add_experiment(builder, experiment, ContinuousController(law, document.seed)),)
    settings = (document.period, document.seed)
    if second is None:
        between = experiment.locks or experiment.handling or drive_of(experiment.arm)
        controller = SampledController(
            law, *settings, experiment.safety, between, compiled=compiled
        )
        return (_add_arm(builder, experiment, controller),)
    leader = SampledController(law, *settings, leads=True, compiled=compiled)
    follower = SampledController(second.law, *settings, compiled=compiled)
    neighbours = experiment.law.neighbour, second.law.neighbour
    assert neighbours[0] is not None
    assert neighbours[1] is not None
    neighbour = (
        add_neighbour(builder, neighbours[0], follower.reading.state, second.start),
        add_neighbour(builder, neighbours[1], leader.reading.state, experiment.start),
    )
    led = add_detours(builder, experiment)
    ways = ({}, {}) if led is None else led.ways
    first = _add_experiment(builder, experiment, leader, ports_of(neighbour[0]) | ways[0])
    led_signals = add_led(builder, experiment, second, leader)
    loops = (
        first,
        _add_experiment(
            builder, second, follower, ports_of(neighbour[1]) | led_signals | ways[1], PREFIX
        ),
    )
    if led is not None:
        led.watch(builder, [loop.joint_command.get_output_port() for loop in loops])
    for source, port in (
        (neighbour[0], follower.GetOutputPort("state")),
        (neighbour[1], leader.GetOutputPort("next_state")),
    ):
        builder.Connect(port, source.get_input_port())
    return loops


def _add_arm(builder: DiagramBuilder, experiment: Experiment, controller: Controller) -> Loop:
    """Add the loop of a single arm, with what leads it on detours, if it makes any."""
    if (led := add_detours(builder, experiment)) is None:
        return _add_experiment(builder, experiment, controller)
    loop = _add_experiment(builder, experiment, controller, led.ways[0])
    led.watch(builder, [loop.joint_command.get_output_port()])
    return loop


def _add_experiment(
    builder: DiagramBuilder,
    experiment: Experiment,
    controller: Controller,
    beside: Mapping[str, OutputPort] | None = None,
    prefix: str = "",
) -> Loop:
    """Add the loop of one arm; ``beside`` is what its law sees of another one, by name."""
    document = experiment.document
    source = _add_path(builder, experiment, controller, prefix)
    signals = _add_previews(builder, experiment, controller, prefix)
    signals |= beside or {}
    arm, start, contact = experiment.arm, experiment.start, experiment.contact
    # Whether the start may lie outside the limits was checked when the experiment was made.
    options: dict[str, Any] = {"outside": OUTSIDE}
    arguments: dict[str, Any] = {}
    for feature in document.features:
        options |= feature.body_arguments(experiment)
        arguments |= feature.loop_arguments(experiment)
    body = experiment.level(arm, start, contact, document.plant, **options)
    return AddLoop(
        builder,
        body,
        controller,
        source,
        task=_loop_task(experiment),
        feedback=experiment.feedback,
        signals=signals,
        **arguments,
        parts=[part for part in experiment.features.values() if isinstance(part, LoopPart)],
        seed=document.seed,
        prefix=prefix,
    )


def _loop_task(experiment: Experiment) -> TaskSection:
    """Return the task as a loop takes it."""
    task = experiment.law_task
    return task if task.objectives else experiment.document.task


def _add_path(
    builder: DiagramBuilder, experiment: Experiment, controller: Controller, prefix: str
) -> System:
    document = experiment.document
    for feature in document.features:
        if (path_source := feature.path_source(experiment, controller.period)) is not None:
            return builder.AddNamedSystem(f"{prefix}path", path_source)
    source = PathSource(
        experiment.desired,
        task=_loop_task(experiment),
        preview=controller.period if "p_preview" in controller.reading.inputs else None,
    )
    return builder.AddNamedSystem(f"{prefix}path", source)


def _add_previews(
    builder: DiagramBuilder, experiment: Experiment, controller: Controller, prefix: str
) -> dict[str, OutputPort]:
    """Add and return previews, joint targets and signals of features, by name."""
    document, path, start = experiment.document, experiment.desired, experiment.start
    signals: dict[str, OutputPort] = {}
    if (preview := controller.law.joint_preview) is not None:
        until = document.duration + preview.count * preview.interval
        positions_at = followed_path(path, experiment.arm, start, until, document.task)
        ahead = JointReference(positions_at, experiment.arm.n, preview.interval, preview.count)
        builder.AddNamedSystem(f"{prefix}joint_reference", ahead)
        signals["position_preview"] = ahead.GetOutputPort("position_preview")
    if experiment.targets is not None and document.period is not None:
        came = TargetSource(experiment.targets, document.period)
        signals["target"] = builder.AddNamedSystem(f"{prefix}targets", came).get_output_port()
    inputs = controller.reading.inputs
    for feature in document.features:
        for name, (source, used) in feature.signal_sources(experiment, inputs).items():
            builder.AddNamedSystem(f"{prefix}{name}", source)
            signals |= {port: source.GetOutputPort(port) for port in used}
    return signals


def build_simulator(experiment: Experiment, law: Law | None = None) -> tuple[Simulator, Loop]:
    """Return a simulator of the experiment's diagram, not yet initialized, and its loop."""
    diagram, loop = build_diagram(experiment, law)
    return _simulator(diagram, experiment, loop), loop


def recorded_simulator(
    experiment: Experiment,
    law: Law | None = None,
    controller: Controller | None = None,
    options: RunOptions = RunOptions(),  # noqa: B008  it is frozen
) -> tuple[Simulator, tuple[Loop, ...], Recorder]:
    """Return what `build_simulator` does, with the loop of each arm, and a recorder of the diagram.

    The recorder does not watch yet.

    Args:
        experiment: The experiment.
        law: Law to run instead of the experiment's own.
        controller: Controller to run instead of one of that law, for a single arm.
        options: How the run is made.
    """
    builder = DiagramBuilder()
    if controller is None:
        loops = _add_loops(builder, experiment, law, options)
    else:
        loops = (_add_arm(builder, experiment, controller),)
    ports = _recorded_ports(loops[0]) | recorded_detours(builder)
    if len(loops) > 1:
        ports |= {PREFIX + name: port for name, port in _recorded_ports(loops[1]).items()}
    recorder = Recorder(builder, ports)
    return _simulator(_build(builder, experiment), experiment, loops[0]), loops, recorder


def _simulator(diagram: Diagram, experiment: Experiment, loop: Loop) -> Simulator:
    simulator = Simulator(diagram)
    ApplySimulatorConfig(simulator_config(experiment, loop), simulator)
    return simulator


def _recorded_ports(loop: Loop) -> dict[str, OutputPort]:
    """Return the output ports that are recorded, by name."""
    ports = {
        "position": loop.arm.GetOutputPort("position"),
        "velocity": loop.arm.GetOutputPort("velocity"),
        "state": loop.controller.GetOutputPort("state"),
    }
    if loop.arm.has_motors:
        ports["position_commanded"] = loop.joint_command.get_output_port()
    ports |= loop.recorded
    if loop.virtual_arm is not None:
        for name in ("position", "velocity"):
            ports[f"virtual_{name}"] = loop.virtual_arm.GetOutputPort(name)
    return ports | {f"measured_{name}": port for name, port in loop.measured.items()}


def simulator_config(experiment: Experiment, loop: Loop) -> SimulatorConfig:
    """Return Drake's settings for an experiment with this loop."""
    config, document = SimulatorConfig(), experiment.document
    settings = document.integrator
    if settings is None:
        config.integration_scheme = loop.controller.reading.integration_scheme
        config.max_step_size = document.period
        config.use_error_control = False
        return config
    config.integration_scheme = settings.scheme
    config.use_error_control = settings.accuracy is not None
    config.max_step_size = _LONGEST_STEP if settings.step is None else settings.step
    if settings.accuracy is not None:
        config.accuracy = settings.accuracy
    return config


def start_laws(loops: Sequence[Loop], root: Context) -> None:
    """Set the laws' initial states, which may depend on a ``J`` they cannot see, and try them."""
    for loop in loops:
        J_port = loop.kinematics.GetOutputPort("J")
        kinematics_context = loop.kinematics.GetMyContextFromRoot(root)
        context = loop.controller.GetMyMutableContextFromRoot(root)
        n = loop.kinematics.arm.n
        J = J_port.Eval(kinematics_context).reshape(-1, n)
        loop.controller.set_state(context, loop.controller.initial_state(context, J=J))
        loop.controller.try_law(context)
