"""Running an experiment."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from .diagrams.dynamic import AddDynamicLoop
from .diagrams.kinematic import AddKinematicLoop
from .diagrams.loop import Loop
from .errors import InterruptedRunError, InvalidInputError, SimulationError
from .evaluation import evaluate
from .experiment import Experiment
from .experiment_setup import OUTSIDE
from .laws.law import ContinuousLaw, Law
from .reach import check_reach
from .recorder import Recorder
from .result import Result
from .systems.controllers import ContinuousController, SampledController
from .systems.delayed_path_source import DelayedPathSource
from .systems.joint_reference import JointReference, followed_path
from .systems.moving_average import MovingAverage
from .systems.path_source import PathSource

#: Called with the simulated time [s] every so often.
Progress = Callable[[float], None]

_LONGEST_STEP = 0.01

# What the tool feels: what is, and what the law is told of it.
_FORCES = ("contact_force", "normal_force")

# What builds the loop at each level, and which further keys of an experiment it takes.
_LEVELS: dict[str, tuple[Callable[..., Loop], tuple[str, ...]]] = {
    "kinematic": (AddKinematicLoop, ()),
    "dynamic": (AddDynamicLoop, ("plant",)),
}


def check_experiment(experiment: Experiment) -> list[str]:
    """What a user should know of an experiment before it runs.

    Raises:
        InvalidInputError: If it cannot be run: its path is out of reach, or its diagram cannot
            be built.
    """
    warnings = check_reach(experiment)
    build_diagram(experiment)
    return warnings


def simulate(experiment: Experiment, progress: Progress | None = None) -> Result:
    """Run an experiment.

    The path is checked against the arm's reach before anything runs.

    Args:
        experiment: What to run.
        progress: Told how far the run has come.

    Raises:
        InvalidInputError: If the path is out of reach.
        SimulationError: If the run cannot go on; its ``result`` holds what there was until
            then.
    """
    started = time.perf_counter()
    warnings = check_reach(experiment)
    simulator, loop = build_simulator(experiment)
    root = simulator.get_mutable_context()
    _set_initial_state(loop, root)

    recorder = add_recorder(simulator, loop)
    if progress is not None:
        simulator.set_monitor(_with_progress(recorder, progress))

    running = time.perf_counter()
    failure: SimulationError | None = None
    try:
        simulator.Initialize()
        running = time.perf_counter()
        for stop in _stops(experiment):
            simulator.AdvanceTo(stop)
    except SimulationError as error:
        failure = error
        if experiment.integrator is not None and experiment.integrator.step is not None:
            failure.args = (f"{error}; try a shorter integrator.step",)
    except KeyboardInterrupt:
        failure = InterruptedRunError("interrupted", root.get_time())
    except (InvalidInputError, RuntimeError) as error:
        # A posture that kinematics refuses, or an integrator of Drake's that finds no step.
        failure = SimulationError(str(error), root.get_time())
    run_time = time.perf_counter() - running

    result = evaluate(experiment, recorder, warnings, simulator.get_system(), loop.controller.law)
    result.metrics["real_time_factor"] = root.get_time() / run_time
    result.metrics["wall_time_s"] = time.perf_counter() - started
    if isinstance(loop.controller, SampledController) and failure is None:
        result.metrics["control_step_us"] = _step_cost(
            loop.controller, loop.controller.GetMyContextFromRoot(root)
        )
    if failure is not None:
        failure.result = result
        raise failure
    return result


def build_diagram(experiment: Experiment, law: Law | None = None) -> tuple[Diagram, Loop]:
    """The diagram of an experiment, not yet simulated, and the systems of its loop.

    Args:
        experiment: What it consists of.
        law: Instead of the experiment's own.
    """
    setup = experiment.setup
    law = setup.law if law is None else law
    builder = DiagramBuilder()
    held = setup.R_WE_start if setup.holds_orientation else None
    controller: SampledController | ContinuousController
    if experiment.period is not None:
        controller = SampledController(law, experiment.period, experiment.seed)
    else:
        controller = ContinuousController(cast(ContinuousLaw, law), experiment.seed)
    source = PathSource(
        setup.path,
        setup.p_WE_start,
        experiment.task,
        held,
        preview=experiment.period if "p_preview" in controller.law.inputs else None,
    )
    builder.AddNamedSystem("path", source)
    settings = experiment.filter
    moving_average = None
    signals: dict[str, OutputPort] = {}
    if "position_preview" in law.inputs:
        looks: Any = law
        until = experiment.duration + looks.horizon * looks.interval
        positions_at = followed_path(setup.path, setup.arm, setup.start, until, experiment.task)
        ahead = JointReference(positions_at, setup.arm.n, looks.interval, looks.horizon)
        builder.AddNamedSystem("joint_reference", ahead)
        signals["position_preview"] = ahead.GetOutputPort("position_preview")
    if settings is not None and experiment.period is not None:
        moving_average = MovingAverage(
            setup.limits, experiment.period, precompensate=settings.precompensate
        )
        if settings.delay_desired:
            past = DelayedPathSource(
                setup.path_delay, setup.path, setup.p_WE_start, experiment.task
            )
            builder.AddNamedSystem("delayed_path", past)
            signals["p_WE_desired"] = past.GetOutputPort("p_WE_desired")
    add, more = _LEVELS[experiment.level]
    loop = add(
        builder,
        setup.arm,
        controller,
        source,
        start=setup.start,
        task=experiment.task,
        dither=experiment.dither,
        filter=moving_average,
        feedback=experiment.feedback,
        contact=setup.contact,
        signals=signals,
        seed=experiment.seed,
        outside=OUTSIDE,  # the setup has refused those that may not
        **{name: getattr(experiment, name) for name in more},
    )
    diagram = builder.Build()
    diagram.set_name(experiment.name or "experiment")
    return diagram, loop


def build_simulator(experiment: Experiment, law: Law | None = None) -> tuple[Simulator, Loop]:
    """A simulator of that diagram, set as the experiment asks, and not yet initialized."""
    diagram, loop = build_diagram(experiment, law)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(simulator_config(experiment), simulator)
    return simulator, loop


def add_recorder(simulator: Simulator, loop: Loop) -> Recorder:
    """A recorder of the loop, as the simulator's monitor."""
    ports = {
        "position": loop.arm.GetOutputPort("position"),
        "velocity": loop.arm.GetOutputPort("velocity"),
        "state": loop.controller.GetOutputPort("state"),
    }
    ports |= {name: loop.forces[name] for name in _FORCES if name in loop.forces}
    if loop.virtual_arm is not None:
        for name in ("position", "velocity"):
            ports[f"virtual_{name}"] = loop.virtual_arm.GetOutputPort(name)
    recorder = Recorder(simulator.get_context(), ports)
    simulator.set_monitor(recorder)
    return recorder


def simulator_config(experiment: Experiment) -> SimulatorConfig:
    """Drake's settings for an experiment."""
    config = SimulatorConfig()
    settings = experiment.integrator
    if settings is None:
        # One step a sample is exact: Euler's for a command that is held, Heun's for a ramp.
        law = getattr(experiment.setup.law, "sampled", experiment.setup.law)
        curved = getattr(law, "integration_scheme", "runge_kutta2")
        config.integration_scheme = "explicit_euler" if law.holds_command else curved
        config.max_step_size = experiment.period
        config.use_error_control = False
        return config
    config.integration_scheme = settings.scheme
    config.use_error_control = settings.accuracy is not None
    config.max_step_size = _LONGEST_STEP if settings.step is None else settings.step
    if settings.accuracy is not None:
        config.accuracy = settings.accuracy
    return config


def _stops(experiment: Experiment) -> list[float]:
    """Times to end a step at: an integrator must not step over what jumps in the path."""
    end = experiment.duration
    if experiment.integrator is None:
        return [end]
    return [*(t for t in experiment.setup.path.knots(end).tolist() if 0 < t < end), end]


def _set_initial_state(loop: Loop, root: Context) -> None:
    """The law's first state; it may be given J, which it need not see in the loop."""
    J_port = loop.kinematics.GetOutputPort("J")
    kinematics_context = loop.kinematics.GetMyContextFromRoot(root)
    context = loop.controller.GetMyMutableContextFromRoot(root)
    n = loop.kinematics.arm.n
    J = J_port.Eval(kinematics_context).reshape(-1, n)
    loop.controller.set_state(context, loop.controller.initial_state(context, J=J))


def _with_progress(recorder: Recorder, progress: Progress) -> Callable[[Context], None]:
    steps = 0

    def monitor(context: Context) -> None:
        nonlocal steps
        recorder(context)
        steps += 1
        if steps % 256 == 0:
            progress(context.get_time())

    return monitor


def _step_cost(controller: SampledController, context: Context, repeats: int = 200) -> float:
    """Median cost of one sample of the law alone [us]; of a slow law, of few of them."""
    u, x = controller.signals(context), controller.state(context)
    costs: list[float] = []
    while len(costs) < repeats and sum(costs) < 0.2:
        begin = time.perf_counter()
        controller.law.step(context.get_time(), x, u, controller.period)
        costs.append(time.perf_counter() - begin)
    return float(np.median(costs)) * 1e6
