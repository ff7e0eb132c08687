"""Running an experiment."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from .diagrams.kinematic import AddKinematicLoop, KinematicLoop
from .errors import InterruptedRunError, InvalidInputError, SimulationError
from .experiment import Experiment
from .experiment_setup import OUTSIDE
from .fields import Array
from .laws.law import ContinuousLaw, Law, Signals
from .laws.receding_horizon import RecedingHorizon
from .laws.rotation_error import rotation_error
from .metrics import Motion, law_metrics, motion_metrics
from .reach import check_reach
from .recorder import Recorder
from .result import Result
from .systems.controllers import ContinuousController, SampledController
from .systems.delayed_path_source import DelayedPathSource
from .systems.joint_reference import JointReference, followed_path
from .systems.moving_average import MovingAverage
from .systems.path_source import PathSource
from .task import TASKS

#: Called with the simulated time [s] every so often.
Progress = Callable[[float], None]

_LONGEST_STEP = 0.01


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
    diagram, loop = build_diagram(experiment)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(simulator_config(experiment), simulator)
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

    result = _result(experiment, recorder, warnings, diagram, loop.controller.law)
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


def build_diagram(experiment: Experiment, law: Law | None = None) -> tuple[Diagram, KinematicLoop]:
    """The diagram of an experiment, not yet simulated, and the systems of its loop.

    Args:
        experiment: What it consists of.
        law: Instead of the experiment's own.
    """
    setup = experiment.setup
    law = setup.law if law is None else law
    builder = DiagramBuilder()
    held = setup.R_WE_start if TASKS[experiment.task].with_orientation else None
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
    if isinstance(law, RecedingHorizon):
        until = experiment.duration + law.horizon * law.interval
        positions_at = followed_path(setup.path, setup.arm, setup.start, until, experiment.task)
        ahead = JointReference(positions_at, setup.arm.n, law.interval, law.horizon)
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
    loop = AddKinematicLoop(
        builder,
        setup.arm,
        controller,
        source,
        start=setup.start,
        task=experiment.task,
        dither=experiment.dither,
        filter=moving_average,
        feedback=experiment.feedback,
        signals=signals,
        seed=experiment.seed,
        outside=OUTSIDE,  # the setup has refused those that may not
    )
    diagram = builder.Build()
    diagram.set_name(experiment.name or "experiment")
    return diagram, loop


def add_recorder(simulator: Simulator, loop: KinematicLoop) -> Recorder:
    """A recorder of the loop, as the simulator's monitor."""
    ports = {
        "position": loop.arm.GetOutputPort("position"),
        "velocity": loop.arm.GetOutputPort("velocity"),
        "state": loop.controller.GetOutputPort("state"),
    }
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


def _set_initial_state(loop: KinematicLoop, root: Context) -> None:
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


def _result(
    experiment: Experiment,
    recorder: Recorder,
    warnings: list[str],
    diagram: Diagram,
    law: Law,
) -> Result:
    motion = _motion(experiment, recorder, law)
    delay = experiment.setup.path_delay
    evaluation = (experiment.setup.limits, experiment.window, experiment.settling_tolerance_m)
    metrics = motion_metrics(motion, *evaluation)
    seen = motion
    if delay > 0.0:
        metrics["path_delay_s"] = delay
        seen = _seen(experiment, recorder, law, motion)
    if seen.J is not motion.J and seen.J_hat is not None:
        # What was learned is the Jacobian of the arm that the law saw.
        metrics |= {
            name: value
            for name, value in motion_metrics(seen, *evaluation).items()
            if name.startswith("jacobian_")
        }
    observed = _diagnostics(experiment, seen, recorder.series("state"), law)
    metrics |= law_metrics(seen, observed)
    caveats = getattr(experiment.setup.law, "caveats", None)
    if caveats is not None:
        warnings = [*warnings, *caveats(metrics)]

    at = _samples(motion.time, experiment.log_period)
    names = ("position", "velocity", "network_velocity", "p_WE", "v_WE", "p_WE_desired")
    series = {name: getattr(motion, name)[at] for name in (*names, "v_WE_desired", "J")}
    for name, values in (
        ("acceleration", motion.joint_acceleration()),
        ("network_acceleration", motion.network_acceleration()),
    ):
        # The step that ends at a sample; before the first there is none.
        series[name] = np.concatenate((np.zeros((1, values.shape[1])), values))[at]
        series[f"{name}_peak"] = _peaks(np.abs(values), at)
    if motion.target is not None:
        series["joint_error"] = (motion.position - motion.target)[at]
    if motion.orientation_error is not None:
        series["orientation_error"] = motion.orientation_error[at]
    state = recorder.series("state")[at]
    for name in law.state.parts:
        if name != "v":
            series[name] = law.state.part(state, name)
    return Result(
        experiment=experiment,
        time=motion.time[at],
        series=series | {name: values[at] for name, values in observed.items()},
        metrics=metrics,
        warnings=warnings,
        graphviz=diagram.GetGraphvizString(max_depth=1),
    )


def _samples(time: Array, period: float) -> NDArray[np.intp]:
    """Numbers of the steps to keep: the first in each period, and the last, shape (j,)."""
    number = np.floor(time / period + 1e-6)
    kept = np.diff(number, prepend=-1.0) != 0
    # One that ends a rounding error late has been kept as the period's first.
    if time.size and time[-1] - time[kept][-1] > 1e-6 * period:
        kept[-1] = True
    return np.flatnonzero(kept)


def _diagnostics(experiment: Experiment, motion: Motion, states: Array, law: Law) -> Signals:
    """What the law tells of itself, at every step; computed now, not while running."""
    u = {
        "position": motion.position,
        "p_WE": motion.p_WE,
        "p_WE_desired": motion.p_WE_desired,
        "v_WE_desired": motion.v_WE_desired,
        "J": motion.J,
    }
    u |= _further(experiment, motion, [name for name in law.inputs.parts if name not in u])
    return law.diagnostics(motion.time, states, u)


def _further(experiment: Experiment, motion: Motion, names: Iterable[str]) -> Signals:
    """Those of the signals that posture, velocity and time determine, at every step."""
    setup = experiment.setup
    arm = setup.arm.kinematics()
    axes = list(TASKS[experiment.task].axes)
    of_step: dict[str, Callable[[float, Array, Array], Array]] = {
        "a_WE_desired": lambda t, q, v: setup.path.evaluate(t)[2][axes],
        "Jdot_v": lambda t, q, v: arm.Jdot_v(q, v)[axes],
        "M": lambda t, q, v: arm.M(q),
        "bias": lambda t, q, v: arm.bias(q, v),
        "gravity": lambda t, q, v: arm.gravity(q),
    }
    steps = list(zip(motion.time.tolist(), motion.position, motion.velocity, strict=True))
    return {
        name: np.array([of_step[name](*step) for step in steps])
        for name in names
        if name in of_step
    }


def _seen(experiment: Experiment, recorder: Recorder, law: Law, motion: Motion) -> Motion:
    """The motion as the law saw it, where a path is followed with a delay."""
    if experiment.feedback == "unfiltered":
        return _motion(experiment, recorder, law, virtual=True)
    axes = list(TASKS[experiment.task].axes)
    evaluate = experiment.setup.path.evaluate
    v_WE_desired = np.array([evaluate(t)[1][axes] for t in recorder.time.tolist()])
    return replace(motion, v_WE_desired=v_WE_desired)


def _motion(
    experiment: Experiment, recorder: Recorder, law: Law, *, virtual: bool = False
) -> Motion:
    """The recorded steps, and what follows from them: path and kinematics are functions.

    Asking their ports while running would cost more than the law itself.

    Args:
        experiment: What has run.
        recorder: What it recorded.
        law: Its law.
        virtual: Whether of the virtual arm, which the path's delay does not concern.
    """
    setup = experiment.setup
    task = TASKS[experiment.task]
    axes = list(task.axes)
    kinematics = setup.arm.kinematics()
    origin = setup.path.start_point(setup.p_WE_start)
    prefix, delay = ("virtual_", 0.0) if virtual else ("", setup.path_delay)
    position, velocity = (recorder.series(prefix + name) for name in ("position", "velocity"))
    steps = position.shape[0]
    p_WE, p_WE_desired, v_WE_desired = (np.empty((steps, len(axes))) for _ in range(3))
    J = np.empty((steps, task.size, position.shape[1]))
    turned = np.empty(steps) if task.with_orientation else None
    for k, (t, q) in enumerate(zip(recorder.time, position, strict=True)):
        p_WE[k] = kinematics.p_WE(q)[axes]
        J[k] = task.J(kinematics, q)
        p, v, _ = setup.path.evaluate(float(t) - delay)
        p_WE_desired[k] = (origin + p)[axes]
        v_WE_desired[k] = v[axes]
        if turned is not None:
            turned[k] = np.linalg.norm(rotation_error(kinematics.R_WE(q), setup.R_WE_start))
    state = recorder.series("state")
    return Motion(
        time=recorder.time,
        position=position,
        velocity=velocity,
        network_velocity=law.state.part(state, "v"),
        p_WE=p_WE,
        v_WE=np.einsum("kmn,kn->km", J[:, -len(axes) :], velocity),
        p_WE_desired=p_WE_desired,
        v_WE_desired=v_WE_desired,
        J=J,
        J_hat=law.state.part(state, "J_hat") if "J_hat" in law.state else None,
        target=setup.target,
        orientation_error=turned,
        tick=_tick(experiment),
        network_tick=experiment.period,
    )


def _tick(experiment: Experiment) -> float | None:
    """Time for which the arm's velocity is held [s]; None if it changes all the time."""
    dither = experiment.dither
    if dither is None or dither.model != "actuated" or experiment.filter is not None:
        return experiment.period
    return dither.hold if experiment.period is None else min(dither.hold, experiment.period)


def _peaks(values: Array, at: NDArray[np.intp]) -> Array:
    """Largest entry of the rows up to each of ``at`` since the one before, shape (len(at),)."""
    peaks = np.zeros(at.size)
    for k in range(1, at.size):
        peaks[k] = values[at[k - 1] : at[k]].max(initial=0.0)
    return peaks


def _step_cost(controller: SampledController, context: Context, repeats: int = 200) -> float:
    """Median cost of one sample of the law alone [us]; of a slow law, of few of them."""
    u, x = controller.signals(context), controller.state(context)
    costs: list[float] = []
    while len(costs) < repeats and sum(costs) < 0.2:
        begin = time.perf_counter()
        controller.law.step(context.get_time(), x, u, controller.period)
        costs.append(time.perf_counter() - begin)
    return float(np.median(costs)) * 1e6
