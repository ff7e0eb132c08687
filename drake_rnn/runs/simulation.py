"""The simulation of an experiment."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain

from ..diagrams import AddLoop, Loop
from ..diagrams.wiring import ports_of
from ..errors import InterruptedRunError, InvalidInputError, SimulationError
from ..experiment import (
    OUTSIDE,
    Described,
    Experiment,
    check_reach,
    forecasts,
    load_experiment,
)
from ..inputs.complaints import require_type, short
from ..laws import Law
from ..laws.called import unchecked
from ..measures import PART, Recorder
from ..paths import LedPath
from ..systems import (
    ContinuousController,
    Controller,
    ImageSource,
    JointReference,
    LeadingController,
    LedSource,
    MovingAverage,
    NeighbourSource,
    ObstacleSource,
    PathSource,
    SampledController,
    TargetSource,
    followed_path,
)
from .beside import PREFIX
from .checkpoint import Checkpoint, Keeper
from .effort import check_effort
from .evaluation import Evaluations
from .result import Result, Status, stopped
from .stored import Series, stored_period, thinned

#: Callback for the simulated time [s], called from time to time.
Progress = Callable[[float], None]

_LONGEST_STEP = 0.01

# Recorded forces on the tool: the true one, and the one that the law sees.
_FORCES = ("contact_force", "normal_force")


def check_experiment(
    experiment: Experiment,
    anyway: bool = False,
    series: Series = "full",
    *,
    in_reach: bool = False,
) -> list[str]:
    """Return the warnings about an experiment that can be given before it runs.

    Args:
        experiment: The experiment.
        anyway: Whether it may take as many steps as it likes.
        series: What of the series is to be stored.
        in_reach: Whether the path is known to be in reach; it is not followed then, and there are
            no warnings about it.

    Raises:
        InvalidInputError: If the path is out of reach, the diagram cannot be built, the law fails
            when it is tried at the start, or the run would take very many steps.
    """
    require_type("experiment", experiment, Experiment)
    _simulated(experiment)
    if not anyway:
        check_effort(experiment, stored_period(experiment, series))
    warnings = list(experiment.warnings) if in_reach else check_reach(experiment)
    builder = DiagramBuilder()
    loops = _add_loops(builder, experiment, None)
    start_laws(loops, _built(builder, experiment).CreateDefaultContext())
    return warnings


def simulate(
    experiment: Described,
    progress: Progress | None = None,
    *,
    anyway: bool = False,
    series: Series = "full",
    keep: str | Path | None = None,
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
            its time, at most once a second. To save the result there removes it.

    Raises:
        InvalidInputError: If the experiment is none, the path is out of reach, the law fails when
            it is tried at the start, or the run would take very many steps.
        SimulationError: If the run stops early; its ``result`` covers the time until then. Also if
            what the law says of a complete run is wrong.
    """
    if not isinstance(experiment, Experiment):
        experiment = load_experiment(experiment)
    if not anyway:
        check_effort(experiment, stored_period(experiment, series))
    return _run(experiment, progress, series, keep)


def resume(kept: str | Path | Checkpoint, progress: Progress | None = None) -> Result:
    """Go on with a run that was stopped, from the last whole second of its time that was kept.

    The result has the bits of a run that was not stopped; timings are those of what was left. A law
    of one's own must keep all that varies in its state.

    Args:
        kept: Folder that `simulate` was told to ``keep``, or that of `drake-rnn run`; or what was
            loaded from it.
        progress: Called with the simulated time [s] from time to time.

    Raises:
        InvalidInputError: If the folder holds no run that was stopped, or one that was begun by
            other code or from another document, or that cannot go on.
        SimulationError: As `simulate` does.
    """
    since = kept if isinstance(kept, Checkpoint) else Checkpoint.load(kept)
    return _run(since.experiment, progress, since.series, since.folder, since)


def _run(
    experiment: Experiment,
    progress: Progress | None,
    series: Series,
    keep: str | Path | None = None,
    since: Checkpoint | None = None,
) -> Result:
    """Run an experiment, or go on with it since a checkpoint, and return its result."""
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress: must be a function of time, not {short(progress)}")
    period, given = stored_period(experiment, series), experiment
    experiment = _simulated(thinned(experiment, period))
    started = time.perf_counter()
    found = [forecasts(each) for each in (experiment, experiment.second) if each is not None]
    simulator, loops, recorder = recorded_simulator(experiment)
    root, loop = simulator.get_mutable_context(), loops[0]
    start_laws(loops, root)
    evaluation = Evaluations(experiment, loops, period)
    keeper = None if keep is None else Keeper(keep, given, series, recorder, loop.arm.tick, since)
    _watch(simulator, recorder, evaluation, progress, keeper, since)

    begin, evaluated = root.get_time(), evaluation.wall_time
    run_time, failure = _advance(simulator, experiment)
    run_time -= evaluation.wall_time - evaluated
    result, fault = evaluation.finish(recorder.steps, found, simulator.get_system())
    if failure is None and fault is not None:
        failure = SimulationError(str(fault), root.get_time())
        failure.__cause__ = fault
    result.timings["real_time_factor"] = (root.get_time() - begin) / run_time
    result.timings["wall_time_s"] = time.perf_counter() - started
    if since is not None:
        result.timings["resumed_at_s"] = begin
    if keeper is not None and keeper.trouble:
        result.warnings.append(f"checkpoint: {keeper.trouble}")
    if failure is not None:
        status: Status = "interrupted" if isinstance(failure, InterruptedRunError) else "failed"
        failure.result = stopped(result, status, str(failure))
        raise failure
    if isinstance(loop.controller, SampledController):
        context = loop.controller.GetMyContextFromRoot(root)
        result.timings["control_step_us"] = _step_cost(loop.controller, context)
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
    told = None if progress is None else _now_and_then(progress)
    monitors = [each for each in (recorder, keeper, told) if each is not None]
    if len(monitors) > 1:
        simulator.set_monitor(_each_of(monitors))


def _simulated(experiment: Experiment) -> Experiment:
    """Return an experiment, or raise an InvalidInputError if only a robot can move its arm."""
    if not experiment.level.is_simulated:
        raise InvalidInputError(
            f"level: {experiment.document.level} is for `drake-rnn drive`, which moves a robot; a "
            "run without one is at level: kinematic or dynamic"
        )
    return experiment


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
    return time.perf_counter() - began, failure


def build_diagram(experiment: Experiment, law: Law | None = None) -> tuple[Diagram, Loop]:
    """Return the diagram of an experiment, not yet simulated, and the systems of its loop.

    Args:
        experiment: The experiment.
        law: Law to run instead of the experiment's own.

    Raises:
        InvalidInputError: If the parts of the diagram do not fit together.
    """
    builder = DiagramBuilder()
    loop, *_ = _add_loops(builder, experiment, law)
    return _built(builder, experiment), loop


def _built(builder: DiagramBuilder, experiment: Experiment) -> Diagram:
    diagram = builder.Build()
    diagram.set_name(experiment.name or "experiment")
    return diagram


def _add_loops(
    builder: DiagramBuilder, experiment: Experiment, law: Law | None
) -> tuple[Loop, ...]:
    """Add the loop of an experiment and, beside it, that of its second arm, if there is one."""
    require_type("experiment", experiment, Experiment)
    document, second = experiment.document, experiment.second
    law = experiment.law if law is None else law
    if document.period is None:
        return (_add_experiment(builder, experiment, ContinuousController(law, document.seed)),)
    settings = (document.period, document.seed)
    if second is None:
        controller = SampledController(law, *settings, experiment.safety, experiment.locks)
        return (_add_experiment(builder, experiment, controller),)
    leader = LeadingController(law, *settings)
    follower = SampledController(second.law, *settings)
    seen = [
        _add_neighbour(builder, one, other, controller)
        for one, other, controller in ((experiment, second, follower), (second, experiment, leader))
    ]
    first = _add_experiment(builder, experiment, leader, ports_of(seen[0]))
    led = _add_led(builder, experiment, second, leader)
    loops = (first, _add_experiment(builder, second, follower, ports_of(seen[1]) | led, PREFIX))
    for source, port in (
        (seen[0], follower.GetOutputPort("state")),
        (seen[1], leader.GetOutputPort("next_state")),
    ):
        builder.Connect(port, source.get_input_port())
    return loops


def _add_neighbour(
    builder: DiagramBuilder, one: Experiment, other: Experiment, controller: SampledController
) -> NeighbourSource:
    """Add what the law of one arm sees of the other arm, whose controller is not connected yet."""
    neighbour = one.law.neighbour
    assert neighbour is not None
    source = NeighbourSource(neighbour, controller.reading.state, other.start)
    name = f"{'second_' if neighbour.has_chosen else ''}neighbour"
    return builder.AddNamedSystem(name, source)


def _add_led(
    builder: DiagramBuilder, first: Experiment, second: Experiment, leader: LeadingController
) -> dict[str, OutputPort]:
    """Add and return the desired positions of a second arm that goes along with the first one."""
    if not isinstance(second.desired, LedPath):
        return {}
    kinematics = first.arm.kinematics()
    axes = second.task.axes
    source = LedSource(second.desired, kinematics, first.start, leader.period, axes)
    builder.AddNamedSystem("led", source)
    at, _ = leader.reading.state.parts["commanded"]
    for state, joints in (("state", "now"), ("next_state", "next")):
        port = leader.GetOutputPort(state)
        part = np.eye(port.size())[at]
        taken = builder.AddNamedSystem(f"led_{joints}", MatrixGain(part))
        builder.Connect(port, taken.get_input_port())
        builder.Connect(taken.get_output_port(), source.GetInputPort(joints))
    return ports_of(source)


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
    body = experiment.level(arm, start, contact, document.plant, outside=OUTSIDE)
    return AddLoop(
        builder,
        body,
        controller,
        source,
        task=document.task,
        dither=document.joint_noise,
        filter=_filter(experiment),
        feedback=experiment.feedback,
        sensing=document.sensing,
        signals=signals,
        locks=experiment.locks,
        camera=document.camera,
        seed=document.seed,
        prefix=prefix,
    )


def _add_path(
    builder: DiagramBuilder, experiment: Experiment, controller: Controller, prefix: str
) -> PathSource | ImageSource:
    document = experiment.document
    if document.camera is not None and controller.period is not None:
        late = 0.0 if document.sensing is None else document.sensing.delay
        shown = ImageSource(experiment.desired, document.camera, controller.period, late)
        return builder.AddNamedSystem(f"{prefix}path", shown)
    source = PathSource(
        experiment.desired,
        task=document.task,
        preview=controller.period if "p_preview" in controller.reading.inputs else None,
    )
    return builder.AddNamedSystem(f"{prefix}path", source)


def _filter(experiment: Experiment) -> MovingAverage | None:
    settings, period = experiment.document.filter, experiment.document.period
    if settings is None or period is None:
        return None
    return MovingAverage(
        experiment.limits, period, precompensate=settings.precompensate, above=settings.above
    )


def _add_previews(
    builder: DiagramBuilder, experiment: Experiment, controller: Controller, prefix: str
) -> dict[str, OutputPort]:
    """Add and return previews, a delayed path, joint targets and what obstacles do, by name."""
    document, desired, start = experiment.document, experiment.desired, experiment.start
    signals: dict[str, OutputPort] = {}
    if (preview := controller.law.joint_preview) is not None:
        until = document.duration + preview.count * preview.interval
        positions_at = followed_path(desired, experiment.arm, start, until, document.task)
        ahead = JointReference(positions_at, experiment.arm.n, preview.interval, preview.count)
        builder.AddNamedSystem(f"{prefix}joint_reference", ahead)
        signals["position_preview"] = ahead.GetOutputPort("position_preview")
    delayed = document.filter is not None and document.filter.delay_desired
    if delayed and "p_WE_desired" in controller.reading.inputs:
        past = PathSource(desired, task=document.task, delay=experiment.path_delay)
        builder.AddNamedSystem(f"{prefix}delayed_path", past)
        for name in ("p_WE_desired", "R_WE_desired"):
            if name in controller.reading.inputs:
                signals[name] = past.GetOutputPort(name)
    if experiment.targets is not None and document.period is not None:
        came = TargetSource(experiment.targets, document.period)
        signals["target"] = builder.AddNamedSystem(f"{prefix}targets", came).get_output_port()
    motions, sees = experiment.motions, "p_WO" in controller.reading.inputs
    if sees and motions is not None and document.period is not None:
        source = ObstacleSource(motions, document.period, document.seed)
        builder.AddNamedSystem(f"{prefix}obstacles", source)
        signals["p_WO"] = source.GetOutputPort("p_WO")
    return signals


def build_simulator(experiment: Experiment, law: Law | None = None) -> tuple[Simulator, Loop]:
    """Return a simulator of the experiment's diagram, not yet initialized, and its loop."""
    diagram, loop = build_diagram(experiment, law)
    return _simulator(diagram, experiment, loop), loop


def recorded_simulator(
    experiment: Experiment, law: Law | None = None, controller: Controller | None = None
) -> tuple[Simulator, tuple[Loop, ...], Recorder]:
    """Return what `build_simulator` does, with the loop of each arm, and a recorder of the diagram.

    The recorder does not watch yet.

    Args:
        experiment: The experiment.
        law: Law to run instead of the experiment's own.
        controller: Controller to run instead of one of that law, for a single arm.
    """
    builder = DiagramBuilder()
    if controller is None:
        loops = _add_loops(builder, experiment, law)
    else:
        loops = (_add_experiment(builder, experiment, controller),)
    ports = _recorded(loops[0])
    if len(loops) > 1:
        ports |= {PREFIX + name: port for name, port in _recorded(loops[1]).items()}
    recorder = Recorder(builder, ports)
    return _simulator(_built(builder, experiment), experiment, loops[0]), loops, recorder


def _simulator(diagram: Diagram, experiment: Experiment, loop: Loop) -> Simulator:
    simulator = Simulator(diagram)
    ApplySimulatorConfig(simulator_config(experiment, loop), simulator)
    return simulator


def _recorded(loop: Loop) -> dict[str, OutputPort]:
    """Return the output ports that are recorded, by name."""
    ports = {
        "position": loop.arm.GetOutputPort("position"),
        "velocity": loop.arm.GetOutputPort("velocity"),
        "state": loop.controller.GetOutputPort("state"),
    }
    if loop.arm.has_motors:
        ports["position_commanded"] = loop.joint_command.get_output_port()
    ports |= {name: loop.forces[name] for name in _FORCES if name in loop.forces}
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


def _stops(experiment: Experiment) -> list[float]:
    """Return the times to end a step at: an integrator must not step over jumps in the path."""
    end = experiment.document.duration
    if experiment.document.integrator is None:
        return [end]
    return [*(t for t in experiment.desired.knots(end).tolist() if 0 < t < end), end]


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


def _step_cost(controller: SampledController, context: Context, repeats: int = 200) -> float:
    """Return the median time of one sample of the law [us]; fewer repeats for a slow law."""
    u, x = controller.signals(context), controller.state(context)
    step = unchecked(controller.reading.step)
    costs: list[float] = []
    while len(costs) < repeats and sum(costs) < 0.2:
        begin = time.perf_counter()
        step(context.get_time(), x, u, controller.period)
        costs.append(time.perf_counter() - begin)
    return float(np.median(costs)) * 1e6
