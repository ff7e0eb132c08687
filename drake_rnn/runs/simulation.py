"""The simulation of an experiment.

- What a run takes, estimated before it starts.
- The diagram of an experiment: the loop of each arm, what it follows, and what is recorded.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System

from ..diagrams import AddLoop, Loop
from ..errors import InterruptedRunError, InvalidInputError, SimulationError, old_arguments
from ..experiment import (
    Experiment,
    ExperimentDocument,
    ExperimentSource,
    check_reach,
    forecasts,
    load_experiment,
)
from ..features.base import drive_of
from ..features.detour import add_detours, recorded_detours
from ..features.feature import LoopPart, ports_of
from ..features.pairs import refuse
from ..features.second import add_led, add_neighbour
from ..inputs.fields import checked, flag, instance
from ..inputs.messages import require_type, short
from ..inputs.processes import run_uninterrupted
from ..laws import Law
from ..measures import PART, Recorder
from ..robot.limits import OUTSIDE
from ..robot.task import TaskSection
from ..systems import (
    BODIES,
    ContinuousController,
    Controller,
    JointReference,
    PathSource,
    SampledController,
    TargetSource,
    followed_path,
)
from ..systems.block import release, release_at_end
from ..systems.plant import PlantSettings
from .checkpoint import Checkpoint, Keeper, begun_in
from .evaluation import Evaluations
from .folder import Status, claim_folder
from .result import Result, replace_in_both, stop
from .series import PREFIX, RunOptions, Series, stored_period, thin

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
        wrapper = experiment.locks or experiment.handling or drive_of(experiment.arm)
        controller = SampledController(
            law, *settings, experiment.safety, wrapper, compiled=compiled
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
    if loop.arm.has_motors and loop.arm.follows_command:
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


#: Time that a run may be expected to take unless it is told to run anyway [s].
LONGEST = 3 * 3600.0
#: Samples that a run may store: some 1.5 kB each.
MOST_SAMPLES = 1e7
# What a step costs, roughly, by what makes it [s].
_COSTS = {"period": 2e-4, "integrator.step": 3e-4, "plant.time_step": 4e-4}
_COSTS |= {"dither.hold": 1e-4, "disturbance.hold": 1e-4}
# And a sample at which distances are computed.
_DISTANCES = 3e-4


@dataclass(frozen=True)
class Effort:
    """What a run is expected to take.

    Attributes:
        key: Key of the document that determines it; empty if an integrator chooses its steps.
        step: Its value [s].
        steps: Number of steps.
        time: Time on a usual machine, within a factor of a few [s].
    """

    key: str = ""
    step: float = 0.0
    steps: float = 0.0
    time: float = 0.0


def effort_of(document: ExperimentDocument) -> Effort:
    """Return what a run is expected to take; nothing is known of an integrator's own steps.

    Args:
        document: Document of the experiment.
    """
    times = {
        "period": document.period,
        "integrator.step": document.integrator and document.integrator.step,
        "dither.hold": document.dither and document.dither.hold,
        "disturbance.hold": document.disturbance and document.disturbance.hold,
    }
    if BODIES[document.level].has_motors:
        times["plant.time_step"] = (document.plant or PlantSettings()).time_step
    costs = dict(_COSTS)
    if document.obstacles is not None or (document.safety and document.safety.collisions):
        costs["period"] += _DISTANCES
    efforts = [
        Effort(key, step, document.duration / step, document.duration / step * costs[key])
        for key, step in times.items()
        if step
    ]
    return max(efforts, key=lambda effort: effort.time, default=Effort())


def check_effort(experiment: Experiment, stored_period: float) -> None:
    """Raise an InvalidInputError if a run would take very long, or store very many samples.

    Args:
        experiment: The experiment.
        stored_period: Time between two stored samples [s].
    """
    document = experiment.document
    require_effort(effort_of(document), document.duration)
    samples = document.duration / stored_period
    if samples > MOST_SAMPLES:
        raise InvalidInputError(
            f"log_period: {document.log_period:g} s stores {samples:.2g} samples in "
            f"{document.duration:g} s; a run may store {MOST_SAMPLES:g}; `drake-rnn run "
            "--anyway` (in Python: anyway=True) makes it nevertheless"
        )


def require_effort(effort: Effort, duration: float) -> None:
    """Raise an InvalidInputError if a run would take very long.

    Args:
        effort: What it is expected to take.
        duration: Its duration [s].
    """
    if effort.time > LONGEST:
        raise InvalidInputError(
            f"{effort.key}: {effort.step:g} s makes {effort.steps:.2g} steps in "
            f"{duration:g} s, which may take {effort.time / 3600:.2g} hours; a run may "
            f"take {LONGEST / 3600:g} hours; `drake-rnn run --anyway` (in Python: anyway=True) "
            "makes it nevertheless"
        )


#: Callback for the simulated time [s], called from time to time.
Progress = Callable[[float], None]


@checked(anyway=flag, compiled=flag, in_reach=flag)
def check_experiment(
    experiment: Experiment,
    anyway: bool = False,
    series: Series = "full",
    compiled: bool = False,
    *,
    in_reach: bool = False,
) -> list[str]:
    """Return the warnings about an experiment that can be given before it runs.

    Args:
        experiment: The experiment.
        anyway: Whether it may take as many steps as it likes.
        series: What of the series is to be stored.
        compiled: Whether the steps of the law are to be compiled; they are not compiled here.
        in_reach: Whether the path is known to be in reach; it is not followed then, and there are
            no warnings about it.

    Raises:
        InvalidInputError: If the path is out of reach, the diagram cannot be built, the law fails
            when it is tried at the start, the run would take very many steps, or the experiment has
            what does not go with a compiled law.
    """
    require_type("experiment", experiment, Experiment)
    options = RunOptions(anyway, series, compiled)
    _require_host(experiment, options)
    if not anyway:
        check_effort(experiment, stored_period(experiment, series))
    warnings = list(experiment.warnings) if in_reach else check_reach(experiment)
    diagram, loops = build_loops(experiment)
    with release_at_end(diagram):
        start_laws(loops, diagram.CreateDefaultContext())
    return warnings


@checked(
    anyway=flag,
    keep=instance(str, Path, None),
    compiled=flag,
)
def simulate(
    experiment: ExperimentSource,
    progress: Progress | None = None,
    *,
    anyway: bool = False,
    series: Series = "full",
    keep: str | Path | None = None,
    compiled: bool = False,
) -> Result:
    """Run an experiment and return its result.

    The path is first checked against the arm's reach. Steps are evaluated while it runs, in parts:
    apart from the stored series, memory does not grow with the duration.

    Args:
        experiment: Experiment to run, or what `load_experiment` takes: a shipped name, a YAML file
            or a document.
        progress: Called with the simulated time [s] from time to time.
        anyway: Whether it may take as many steps as it likes.
        series: What of the series is stored: "full", a sample for each ``log_period``; "thin", some
            of these, at most 2000, whose period is then the ``log_period`` of the result; or
            "none", the last step alone. Metrics are the same.
        keep: Folder in which is kept what `resume` needs if the run is stopped: at whole seconds of
            its time, at most once a second. To save the result there removes it. No other process
            may write to the folder meanwhile.
        compiled: Whether the steps of the law are compiled: to C where a C compiler is found, else
            by JAX. The result differs by rounding.

    Raises:
        InvalidInputError: If the experiment is none, the path is out of reach, the law fails when
            it is tried at the start, the run would take very many steps, another process writes
            to ``keep``, or the law cannot be compiled.
        SimulationError: If the run stops early; its ``result`` covers the time until then. Also if
            what the law says of a complete run is wrong.
        InterruptedRunError: After Ctrl-C. While metrics are taken Ctrl-C waits; if it comes after
            the last step, the ``result`` is that of the whole run.
    """
    options = RunOptions(anyway, series, compiled)
    if not isinstance(experiment, Experiment):
        experiment = load_experiment(experiment)
    if not anyway:
        check_effort(experiment, stored_period(experiment, series))
    with ExitStack() as stack:
        if keep is not None:
            stack.enter_context(begun_in(Path(keep)))
        return _run(stack, experiment, progress, options, keep)


@old_arguments(kept="contents")
@checked(contents=instance(str, Path, Checkpoint))
def resume(contents: str | Path | Checkpoint, progress: Progress | None = None) -> Result:
    """Go on with a run that was stopped, from the last whole second of its time that was kept.

    The result has the bits of a run that was not stopped; timings are those of what was left. A law
    of one's own must keep all that varies in its state.

    Args:
        contents: Folder that `simulate` was told to ``keep``, or that of `drake-rnn run`; or what
            was loaded from it.
        progress: Called with the simulated time [s] from time to time.

    Raises:
        InvalidInputError: If the folder holds no run that was stopped, or one that was begun by
            other code or from another document, or that cannot go on.
        SimulationError: As `simulate` does.
    """
    with ExitStack() as stack:
        folder = contents.folder if isinstance(contents, Checkpoint) else Path(contents)
        stack.enter_context(claim_folder(folder, within=True))
        since = contents if isinstance(contents, Checkpoint) else Checkpoint.load(contents)
        return _run(stack, since.experiment, progress, since.options, since.folder, since)


def _run(
    stack: ExitStack,
    experiment: Experiment,
    progress: Progress | None,
    options: RunOptions,
    keep: str | Path | None = None,
    since: Checkpoint | None = None,
) -> Result:
    """Run an experiment, or go on with it since a checkpoint, and return its result.

    Its diagram is released when ``stack`` is left.
    """
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress: must be a function of time, not {short(progress)}")
    period, original = stored_period(experiment, options.series), experiment
    _require_host(experiment, options)
    experiment = thin(experiment, period)
    wall_begin = time.perf_counter()
    forecast = [forecasts(each) for each in (experiment, experiment.second) if each is not None]
    simulator, loops, recorder = recorded_simulator(experiment, options=options)
    stack.callback(release, simulator.get_system())
    root, loop = simulator.get_mutable_context(), loops[0]
    start_laws(loops, root)
    evaluation = Evaluations(experiment, loops, period)
    keeper = (
        None if keep is None else Keeper(keep, original, options, recorder, loop.arm.tick, since)
    )
    _watch(simulator, recorder, evaluation, progress, keeper, since)

    begin, evaluation_begin = root.get_time(), evaluation.wall_time
    run_time, failure = _advance(simulator, experiment)
    run_time -= evaluation.wall_time - evaluation_begin
    steps = recorder.steps
    whole = bool(steps.time.size) and bool(steps.time[-1] >= experiment.document.duration)
    told_to_end = whole and isinstance(failure, InterruptedRunError)
    failure = None if told_to_end else failure

    def conclude() -> tuple[Result, InvalidInputError | None]:
        result, fault = evaluation.finish(steps, forecast, simulator.get_system())
        if failure is None and isinstance(loop.controller, SampledController):
            context = loop.controller.GetMyContextFromRoot(root)
            result.timings["control_step_us"] = _step_cost(loop.controller, context)
        return replace_in_both(result, options=options), fault

    (result, fault), told_late = run_uninterrupted(conclude)
    result.timings["real_time_factor"] = (root.get_time() - begin) / run_time
    result.timings["wall_time_s"] = time.perf_counter() - wall_begin
    if since is not None:
        result.timings["resumed_at_s"] = begin
    if keeper is not None and keeper.trouble:
        result.warnings.append(f"checkpoint: {keeper.trouble}")
    failure = _failure(failure, fault, root.get_time())
    try:
        return _give(result, failure, root.get_time(), told_to_end=told_to_end or told_late)
    finally:
        # What an error leads to, and is led to by, is freed by the garbage collector alone.
        failure = fault = None


def _failure(
    failure: SimulationError | None, fault: InvalidInputError | None, t: float
) -> SimulationError | None:
    """Return the error that stopped a run, or one for what its law says wrongly of it."""
    if failure is None and fault is not None:
        failure = SimulationError(str(fault), t)
        failure.__cause__ = fault
    return failure


def _give(
    result: Result, failure: SimulationError | None, t: float, *, told_to_end: bool
) -> Result:
    """Return the result of a run that nothing stopped; else raise an error that has the result.

    Args:
        result: The result.
        failure: What stopped the run.
        t: Time at which it ended [s].
        told_to_end: Whether a signal told it to end after its last step.
    """
    if failure is not None:
        status: Status = "interrupted" if isinstance(failure, InterruptedRunError) else "failed"
        result = failure.result = stop(result, status, str(failure))
    if told_to_end and result.status != "interrupted":
        failure = InterruptedRunError("interrupted after its last step", t)
        failure.result = result
    try:
        if failure is not None:
            raise failure
    finally:
        failure = None
    return result


def _watch(
    simulator: Simulator,
    recorder: Recorder,
    evaluation: Evaluations,
    progress: Progress | None,
    keeper: Keeper | None,
    since: Checkpoint | None,
) -> None:
    """Let all watch a simulator that are to; bring it and them to a checkpoint, if there is one."""
    if since is not None:
        since.restore(simulator)
    recorder.watch(
        simulator, evaluation.take if keeper is None else keeper.taking(evaluation.take), PART
    )
    if since is not None:
        recorder.replay(since.times, since.rows)
    tell = None if progress is None else _now_and_then(progress)
    monitors = [each for each in (recorder, keeper, tell) if each is not None]
    if len(monitors) > 1:
        simulator.set_monitor(_each_of(monitors))


def _require_host(experiment: Experiment, options: RunOptions) -> None:
    """Raise an InvalidInputError if an experiment does not go with how it is to be run."""
    refuse(replace(experiment.combination, host=options.host))


def _advance(simulator: Simulator, experiment: Experiment) -> tuple[float, SimulationError | None]:
    """Run the simulator; return the wall time [s] and the error that stopped it, if any."""
    root = simulator.get_context()
    began = time.perf_counter()
    failure: SimulationError | None = None
    try:
        if root.get_time() == 0.0:
            simulator.Initialize()
        began = time.perf_counter()
        for stop in _stops(experiment):
            if stop > root.get_time():
                simulator.AdvanceTo(stop)
    except SimulationError as error:
        failure = error
        integrator = experiment.document.integrator
        if integrator is not None and integrator.step is not None:
            failure.args = (f"{error}; try a shorter integrator.step",)
    except KeyboardInterrupt:
        failure = InterruptedRunError("interrupted", root.get_time())
    except (InvalidInputError, RuntimeError) as error:
        # The kinematics refuse a posture, or Drake's integrator finds no step.
        failure = SimulationError(str(error), root.get_time())
        failure.__cause__ = error
    try:
        return time.perf_counter() - began, failure
    finally:
        del failure


def _stops(experiment: Experiment) -> list[float]:
    """Return the times to end a step at: an integrator must not step over jumps in the path."""
    end = experiment.document.duration
    if experiment.document.integrator is None:
        return [end]
    return [*(t for t in experiment.desired.knots(end).tolist() if 0 < t < end), end]


def _now_and_then(progress: Progress) -> Callable[[Context], None]:
    steps = 0

    def monitor(context: Context) -> None:
        nonlocal steps
        steps += 1
        if steps % 256 == 0:
            progress(context.get_time())

    return monitor


def _each_of(monitors: Sequence[Callable[[Context], None]]) -> Callable[[Context], None]:
    def monitor(context: Context) -> None:
        for each in monitors:
            each(context)

    return monitor


def _step_cost(controller: SampledController, context: Context, repeats: int = 100) -> float:
    """Return the median time of one sample of the law [us]; fewer repeats for a slow law."""
    u, x = controller.signals(context), controller.state(context)
    step = controller.step_of(context)
    costs: list[float] = []
    while len(costs) < repeats and sum(costs) < 0.05:
        begin = time.perf_counter()
        step(context.get_time(), x, u, controller.period)
        costs.append(time.perf_counter() - begin)
    return float(np.median(costs)) * 1e6
