"""Whole runs side by side, compiled by JAX from the same source that NumPy runs.

- Compilation for arrays of a few numbers, and what cannot be compiled.
- Derivatives of a run's metric with respect to gains, through the closed loop.
- A sample of one robot's law with its kinematics, compiled by JAX for a user's own loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import AnyArray, require_jax
from ..compiled.library import NativeRobot, NativeStep, Scene, compiler
from ..compiled.step import NUMBERS, Sample, trace_step
from ..errors import InvalidInputError, OldName
from ..experiment import Experiment, ExperimentSource, load_experiment
from ..features.pairs import refusal, refuse
from ..inputs.fields import Array, checked, choice, each, instance, optional, whole
from ..inputs.messages import fields_of, nearest, replace_unchecked, require_several, short
from ..laws import SampledReading
from ..laws.checks import Numbers, with_gains
from ..measures import METRICS, Metric, Motion
from ..measures.metric import State
from ..signals import SIGNALS
from .grouping import Robot, blocks, contents
from .robots import Around, Moving, Robots, motion_of
from .run import named_place, robots_of

_PURPOSE = "JAX compiles a law for tuning, from the same source"

# Operations one after the other: to hand small ones to threads takes longer than they do.
_OPTIONS = {"xla_cpu_scheduler_type": 1}


def compilable(descriptions: Sequence[ExperimentSource]) -> list[Robot]:
    """Return robots that `run_many` can run and JAX can compile.

    Args:
        descriptions: Experiments, or what `load_experiment` takes.

    Raises:
        InvalidInputError: If one cannot be; the message says which and why.
    """
    robots = robots_of(descriptions)
    for number, robot in enumerate(robots):
        if (why := refusal(replace(robot.experiment.combination, host="compiled run"))) is not None:
            raise InvalidInputError(f"{named_place(descriptions, number)}{why}")
    return robots


def compiled_in_order(function: Callable[..., Any]) -> Any:
    """Return a function compiled by JAX, on a processor without threads for its operations.

    Args:
        function: What to compile, as for ``jax.jit``.
    """
    jax = require_jax()
    return jax.jit(function, compiler_options=_OPTIONS) if _can() else jax.jit(function)


@cache
def _can() -> bool:
    """Return whether this version of JAX, and what it computes on, know the option."""
    jax = require_jax()
    if jax.default_backend() != "cpu":
        return False
    try:
        jax.jit(lambda x: x + 1.0, compiler_options=_OPTIONS)(0.0)
    except Exception:
        return False
    return True


#: Numbers of a law by the names of its fields, each of shape (robots,).
Gains = Mapping[str, AnyArray]


class _Row(NamedTuple):
    """Inputs of a step that do not depend on gains; a table of them has an axis of steps in front.

    Attributes:
        t, until: Times at which it begins and ends [s].
        samples: Whether laws make a sample.
        within: Whether it lies in the window.
        around: Paths and surfaces.
        noise: Noise from its time on, of standard deviation 1; None without dither.
    """

    t: AnyArray
    until: AnyArray
    samples: AnyArray
    within: AnyArray
    around: Around
    noise: AnyArray | None


class CompiledRuns:
    """Runs of experiments side by side, compiled as a whole at the first call.

    They equal those of `run_many` except for rounding. The metrics of a robot whose state is no
    longer finite are not finite. Paths and noise are kept in tables for all steps.

    Args:
        experiments: Experiments that `run_many` can run, whose laws differ in nothing but numbers;
            each an experiment or what `load_experiment` takes. 1000 fit the cache of a processor; a
            graphics card takes ten thousands.
        metrics: Names of the metrics to take; by default all of `METRICS` that these runs have and
            that have derivatives.

    Raises:
        InvalidInputError: If JAX is not installed, an experiment cannot be run so, or a metric
            cannot be taken.
    """

    @checked(metrics=optional(each(str)))
    def __init__(
        self, experiments: Sequence[ExperimentSource], metrics: Sequence[str] | None = None
    ) -> None:
        self._jax = require_jax()
        robots = compilable(experiments)
        if len(blocks(robots, most=None)) != 1:
            raise InvalidInputError(
                "experiments: must be one or more, whose laws differ in nothing but numbers"
            )
        self.experiments: list[Experiment] = [robot.experiment for robot in robots]
        self._first, self._robots = robots[0], Robots(robots)
        self._start = self._robots.start()
        available = self._differentiable()
        for name in metrics or ():
            if name not in available:
                suggestion = nearest(str(name), list(available))
                raise InvalidInputError(
                    f"metric: {name!r} cannot be taken of this run: it does not apply, has no "
                    f"derivative, or needs several steps at once; {suggestion}"
                )
        self._taken = [available[name] for name in (available if metrics is None else metrics)]
        samples = self._robots.schedule.samples[:-1]
        self._always = bool(samples.all())
        self._table: _Row | None = None
        self._compiled = compiled_in_order(self.of_gains)

    @property
    def law(self) -> SampledReading:
        """Reading of the law with the numbers of all robots."""
        return self._robots.law

    def run(self) -> dict[str, Array]:
        """Run all and return the metrics, by name, each of shape (robots,)."""
        result = self._compiled({}, self.table)
        return {name: np.asarray(values) for name, values in result.items()}

    def start_of(self, gains: Mapping[str, float]) -> Array:
        """Return the initial state of the first law with other numbers, shape (1, state.size)."""
        reading = with_gains(self._first.reading, gains)
        x: Array = Robots([replace(self._first, reading=reading)]).start().x
        return x

    @property
    def table(self) -> _Row:
        """Inputs of all steps, made once; an argument of `of_gains`."""
        if self._table is None:
            table = self._rows()
            self._table = self._jax.tree.map(self._jax.numpy.asarray, table)
        return self._table

    def of_gains(self, gains: Gains, table: _Row) -> dict[str, AnyArray]:
        """Return the metrics of runs with other numbers, for JAX to trace.

        Args:
            gains: Numbers of the law.
            table: Inputs of all steps.
        """
        law = with_gains(self.law, gains)
        first = replace(self._start, command=law.commanded_velocity(0.0, self._start.x))
        rows = self._jax.tree.map(lambda values: values[:-1], table)
        last = self._jax.tree.map(lambda values: values[-1], table)

        def body(carry: Any, row: _Row) -> tuple[Any, None]:
            now = Moving(*carry[0])
            states = self._add(law, carry[1], now, row)
            return (_parts(self._advance(law, now, row)), states), None

        carry = (self._jax.tree.map(self._jax.numpy.asarray, _parts(first)), self._begin(law, last))
        (parts, states), _ = self._jax.lax.scan(body, carry, rows)
        states = self._add(law, states, Moving(*parts), last)
        return {
            metric.name: metric.by.value(state)
            for metric, state in zip(self._taken, states, strict=True)
        }

    def _differentiable(self) -> dict[str, Metric]:
        """Return the metrics that these runs have and that have derivatives, by name."""
        begin = float(self._robots.schedule.times[0])
        motion = self._motion(self.law, self._start, begin, self._robots.around(0))
        return {metric.name: metric for metric in METRICS if self._values(metric, motion).size}

    def _values(self, metric: Metric, motion: Motion) -> AnyArray:
        """Return the values of a metric at a step, shape (1, robots, ...), or none."""
        values = None
        if metric.differentiable and metric.of is not None:
            values = metric.of(motion, self._robots.yardsticks)
        return np.empty(0) if values is None else values

    def _begin(self, law: SampledReading, row: _Row) -> list[State]:
        """Return the gathered states before the first step, in the shapes that they keep."""

        def once() -> list[State]:
            return self._add(law, [m.by.start for m in self._taken], self._start, row)

        shapes = self._jax.eval_shape(once)
        starts = [metric.by.start for metric in self._taken]
        xp = self._jax.numpy
        return self._jax.tree.map(
            lambda start, like: xp.full(like.shape, start, like.dtype), starts, shapes
        )

    def _rows(self) -> _Row:
        schedule, noises = self._robots.schedule, self._robots.noises
        noise, times = None, schedule.times
        if noises is not None:
            # The noise held at a step is that of the last step at which it changed.
            changes = np.flatnonzero(schedule.noises)
            noise_rows = np.stack([noises.row(float(times[k])) for k in changes])
            noise = noise_rows[np.cumsum(schedule.noises) - 1]
        return _Row(
            times,
            np.append(times[1:], times[-1]),
            schedule.samples,
            schedule.within,
            self._robots.all_around(),
            noise,
        )

    def _motion(self, law: SampledReading, now: Moving, t: AnyArray, around: Around) -> Motion:
        """Return the motion of a single step."""
        look = self._robots.look(t, self._jax.numpy.asarray(now.q), around)
        snapshot = self._robots.measure(law, look, now, observes=False)
        return motion_of([snapshot], **self._robots.constants)

    def _add(
        self, law: SampledReading, state_list: Sequence[State], now: Moving, row: _Row
    ) -> list[State]:
        """Return the gathered states after another step."""
        motion, xp = self._motion(law, now, row.t, row.around), self._jax.numpy
        states = []
        for metric, before in zip(self._taken, state_list, strict=True):
            after = metric.by.add(before, self._values(metric, motion), motion.time)
            if metric.over == "window":
                pairs = zip(after, before, strict=True)
                after = tuple(xp.where(row.within, new, old) for new, old in pairs)
            states.append(after)
        return states

    def _advance(self, law: SampledReading, now: Moving, row: _Row) -> Moving:
        """Return the robots one step later."""
        look = self._robots.look(row.t, now.q, row.around)
        u, period = self._robots.signals(look, now), self._robots.schedule.period

        def sampled() -> AnyArray:
            return trace_step(law, row.t, now.x, u, period, _PURPOSE, own_only=True)

        x = sampled() if self._always else self._jax.lax.cond(row.samples, sampled, lambda: now.x)
        noises = self._robots.noises
        noise = None if noises is None else noises.of_each(row.noise)
        return self._robots.move(law, replace(now, x=x, noise=noise), row.t, row.until)


def _parts(now: Moving) -> tuple[AnyArray, ...]:
    return now.q, now.x, now.command, now.noise


_LAW = "law."


@checked(keys=each(str), metric=instance(str))
def value_and_gradient(
    experiment: ExperimentSource, keys: Sequence[str], metric: str
) -> tuple[float, dict[str, float]]:
    """Return a metric of a whole run and its derivatives with respect to numbers of the law.

    The run is that of the experiment, with its seed, compiled by JAX: the value equals that of
    `simulate` except for rounding. Derivatives are taken in forward mode, step by step through the
    closed loop. Where the law switches, e.g. at a bound, they are one-sided, on the side of the
    run. For several calls keep a `Slopes`. ::

        value, gradient = value_and_gradient(
            "slc_nephroid_known", ["law.kappa", "law.return_gain"], "position_error_rms_m"
        )

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes.
        keys: Dotted keys of numbers of the law, e.g. ``law.kappa``.
        metric: Name of the metric.

    Returns:
        The metric and, by key, its derivative.

    Raises:
        InvalidInputError: If JAX is not installed, the experiment cannot be run so, a key is no
            number of the law, or there is no such metric.
    """
    slopes = Slopes(experiment, keys, metric)
    value, slope = slopes.at(slopes.start[np.newaxis])
    return float(value[0]), dict(zip(slopes.keys, slope[0].tolist(), strict=True))


class Slopes:
    """A metric of an experiment as a function of gains, with its derivatives.

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes.
        keys: Dotted keys of numbers of the law, e.g. ``law.kappa``.
        metric: Name of the metric.
        rows: How many sets of gains are asked for at a time; they run side by side.

    Attributes:
        experiment: The experiment.
        keys: The keys.
        start: The experiment's own gains, shape (keys,).

    Raises:
        InvalidInputError: As `value_and_gradient` does.
    """

    @checked(keys=each(str), metric=instance(str), rows=whole(1, 1000))
    def __init__(
        self, experiment: ExperimentSource, keys: Sequence[str], metric: str, rows: int = 1
    ) -> None:
        self._jax = require_jax()
        require_several("keys", keys)
        start_experiment = (
            experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
        )
        self.experiment, self.keys, self._metric = start_experiment, tuple(keys), metric
        self._runs = CompiledRuns([start_experiment] * rows, [metric])
        self._fields = tuple(_field(key) for key in self.keys)
        if len(set(self.keys)) < len(self.keys) or not self.keys:
            raise InvalidInputError(f"keys: must be given, each once, not {short(list(keys))}")
        pairs = zip(self.keys, self._fields, strict=True)
        self.start = np.array([_number(start_experiment, key, field) for key, field in pairs])
        self._require_run_alone()
        self._compiled = compiled_in_order(self._derive)

    def at(self, gains: Array) -> tuple[Array, Array]:
        """Return metrics, shape (rows,), and derivatives, shape (rows, keys).

        Args:
            gains: Sets of gains, shape (rows, keys). They are not checked against the law.

        Raises:
            InvalidInputError: If the gains have another shape, or the law needs to know one of the
                numbers before it runs.
        """
        if np.shape(gains) != (shape := (len(self._runs.experiments), len(self.keys))):
            raise InvalidInputError(f"gains: must have shape {shape}, not {np.shape(gains)}")
        try:
            values, slopes = self._compiled(np.asarray(gains, float).T, self._runs.table)
        except self._jax.errors.ConcretizationTypeError:
            raise InvalidInputError(
                f"keys: one of {', '.join(self.keys)} decides which way the program goes; there "
                "is no derivative with respect to it"
            ) from None
        return np.asarray(values), np.asarray(slopes).T

    def _derive(self, gains: AnyArray, table: Any) -> tuple[AnyArray, AnyArray]:
        def metric(gains: AnyArray) -> AnyArray:
            by_name = dict(zip(self._fields, gains, strict=True))
            return self._runs.of_gains(by_name, table)[self._metric]

        def along(direction: AnyArray) -> tuple[AnyArray, AnyArray]:
            value, slope = self._jax.jvp(metric, (gains,), (direction,))
            return value, slope

        # One gain of all rows at once: no row depends on the gains of another.
        each = np.eye(len(self.keys))[:, :, np.newaxis] * np.ones(gains.shape)
        derivatives: Any = self._jax.vmap(along, out_axes=(None, 0))(each)
        return derivatives[0], derivatives[1]

    def _require_run_alone(self) -> None:
        """Refuse numbers that the initial state depends on, since it is drawn before the run."""
        x = self._runs.start_of({})
        for key, field, value in zip(self.keys, self._fields, self.start, strict=True):
            if not np.array_equal(x, self._runs.start_of({field: 1.01 * float(value)})):
                raise InvalidInputError(
                    f"{key}: sets the law's initial state, through which there is no derivative"
                )


def _field(key: str) -> str:
    if not isinstance(key, str) or not key.startswith(_LAW) or key == _LAW:
        raise InvalidInputError(f"keys: must be numbers of the law, as law.KEY, not {short(key)}")
    return key.removeprefix(_LAW)


def _number(experiment: Experiment, key: str, field: str) -> float:
    """Return a number of the law by the name of its field."""
    value: Any = experiment.law
    for name in field.split("."):
        fields: Mapping[str, Any] = fields_of(value)
        if name not in fields:
            names = [
                each for each, one in fields.items() if isinstance(one, float) or fields_of(one)
            ]
            hint = f"; {nearest(name, names)}" if names else ""
            law = type(experiment.law).__name__
            raise InvalidInputError(f"{key}: no such key of {law}{hint}")
        value = fields[name]
    if value is None or value == "none":
        raise InvalidInputError(f"{key}: is not given; give it a number to start from")
    if not isinstance(value, float):
        raise InvalidInputError(f"{key}: must be a number, not {short(value)}")
    return value


class CompiledStep:
    """A sample of an experiment's law: from joint positions to a joint velocity.

    Kinematics, path and law are compiled together, to C if the machine has a C compiler. A table
    has the experiment's path at all samples. Obstacles are given with each sample, so that one
    build serves scenes with others: see `start`. ::

        robot = CompiledStep("slc_nephroid_known").start()
        for _ in range(robot.samples):
            v = robot.step(q)        # q as measured, or as commanded
            q = q + robot.period * v

    On a CPU, JAX hands each call to a thread, and waiting for it takes most of a step. To avoid
    this with ``backend="jax"``, call ``require_jax().config.update("jax_cpu_enable_async_dispatch",
    False)`` before JAX computes anything.

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes, without
            contact. Its dither may only be ``actuated``: the caller's own loop then adds the noise.
        backend: ``c`` or ``jax``; by default C where a C compiler is found, else JAX.

    Attributes:
        samples: Number of samples of the experiment.
        period: Sampling period [s].
        backend: What it is compiled by.
        scene: What it is given of the experiment; ``table`` and ``first`` are parts of it.

    Raises:
        InvalidInputError: If JAX is not installed, the experiment cannot be run so, or there is no
            C compiler and C is asked for.
    """

    @checked(backend=optional(choice(("c", "jax"))))
    def __init__(self, experiment: ExperimentSource, backend: str | None = None) -> None:
        jax = require_jax()
        (robot,) = compilable([experiment])
        self._jax, self._robot = jax, robot
        self.document = robot.experiment.document
        refuse(replace(robot.experiment.combination, host="compiled step"))
        self._robots = Robots([robot])
        schedule = self._robots.schedule
        self.samples, self.period = int(schedule.samples.sum()), schedule.period
        self.joints = robot.experiment.arm.n
        self.home = robot.experiment.start
        self._numbers = Numbers.of([robot.reading])
        self.scene = self._scene_of(robot, self._robots)
        self.table, self.first = self.scene.table, self.scene.first
        self._unpacked = self._unpack()
        self.backend = backend or ("jax" if compiler() is None else "c")
        if self.backend == "c":
            self._compile_to_c()
        else:
            self._compile_by_jax()

    def _rows(self, robots: Robots) -> tuple[AnyArray, Around]:
        """Return the times of all samples and what is known of them."""
        schedule = robots.schedule
        return self._jax.tree.map(
            lambda values: values[schedule.samples], (schedule.times, robots.all_around())
        )

    def _unpack(self) -> Callable[[AnyArray], Any]:
        """Return what makes the time and what is known of a row of the table."""
        row = self._jax.tree.map(lambda values: values[0], self._rows(self._robots))
        return import_module("jax.flatten_util").ravel_pytree(row)[1]

    def _scene_of(self, robot: Robot, robots: Robots) -> Scene:
        """Return what the step is given of a robot."""
        parts = [
            np.reshape(part, (len(part), -1)) for part in self._jax.tree.leaves(self._rows(robots))
        ]
        # One array for the table and one for the state: each argument of a call takes time.
        table = np.ascontiguousarray(np.concatenate(parts, axis=1))
        first = np.concatenate(([0.0], robots.start().x[0], np.zeros(self.joints)))
        return Scene(table, first, self._numbers.of_reading(robot.reading))

    def scene_of(self, experiment: ExperimentSource) -> Scene:
        """Return what the step is given of another experiment that it serves.

        That may have obstacles of its own, as many of each shape, a start, a path and a duration.

        Args:
            experiment: The experiment, or what `load_experiment` takes.

        Raises:
            InvalidInputError: If it differs in something else.
        """
        (robot,) = compilable([experiment])
        first, document = self._robot, robot.experiment.document
        # For how long it runs does not matter.
        times = {"duration": self.document.duration, "window": self.document.window}
        as_long = replace_unchecked(robot.experiment, document=replace_unchecked(document, **times))
        alike = len(blocks([first, replace(robot, experiment=as_long)])) == 1
        same_arm = contents(robot.arm) == contents(first.arm)
        if not (alike and same_arm and self._numbers.serve(robot.reading)):
            raise InvalidInputError(
                "experiment: may differ from that of the step in obstacles, as many of each shape, "
                "in its start and its path"
            )
        return self._scene_of(robot, Robots([robot]))

    def _compile_to_c(self) -> None:
        causes = [SIGNALS[name].causes for name in self._robots.law.inputs.parts if name in SIGNALS]
        #: The steps with the velocity that the law commands, and with one that is given.
        self.native = NativeStep(self._sample(with_velocity=False), ("around",))
        self.native_with_velocity = self.native
        if any("v" in each for each in causes):
            self.native_with_velocity = NativeStep(self._sample(with_velocity=True), ("around",))

    def _compile_by_jax(self) -> None:
        self._samples = (self._sample(with_velocity=False), self._sample(with_velocity=True))
        self._compiled = compiled_in_order(self._step)
        # Compiled here, and not at the first sample.
        for velocity in (None, np.zeros(self.joints)):
            self._compiled(self.scene, self.first, self.home, velocity)

    def _sample(self, *, with_velocity: bool) -> Sample:
        """Return a sample of the law, with the velocity that it commands or with one it is told."""
        input_shapes = {"around": (self.table.shape[1] - 1,)}
        input_shapes |= {NUMBERS: (self._numbers.size,)} if self._numbers.size else {}
        input_shapes |= {"position": (self.joints,)}
        input_shapes |= {"velocity": (self.joints,)} if with_velocity else {}
        law = self._robots.law
        return Sample(law, self.period, input_shapes, self._signals_of, self._numbers)

    def _signals_of(
        self, t: AnyArray, x: AnyArray, inputs: Mapping[str, AnyArray]
    ) -> Mapping[str, AnyArray]:
        """Return the signals of a sample, as `Sample` asks for them."""
        row = self._jax.numpy.concatenate((self._jax.numpy.reshape(t, (1,)), inputs["around"][0]))
        t, around = self._unpacked(row)
        q, velocity = inputs["position"], inputs.get("velocity")
        command = self._robots.law.commanded_velocity(t, x) if velocity is None else velocity
        look = self._robots.look(t, q, around)
        return self._robots.signals(look, Moving(q, x, command, None))

    def start(self, experiment: ExperimentSource | None = None) -> SteppedRobot:
        """Return a robot at the start of the experiment; there may be several.

        Nothing is built for another experiment that the step serves as well.

        Args:
            experiment: That of the robot, see `scene_of`; None for that of the step.

        Raises:
            InvalidInputError: If the step does not serve it.
        """
        return SteppedRobot(self, None if experiment is None else self.scene_of(experiment))

    def _step(
        self, scene: Scene, state: AnyArray, q: AnyArray, velocity: AnyArray | None
    ) -> AnyArray:
        """Return number, law's state and mean velocity one sample later."""
        xp, number = self._jax.numpy, state[0]
        row, x = (
            xp.asarray(scene.table)[number.astype(int)],
            state[None, 1 : 1 + self._robots.law.state.size],
        )
        inputs = {"around": row[None, 1:], "position": xp.asarray(q)[None]}
        if self._numbers.size:
            inputs[NUMBERS] = xp.asarray(scene.numbers)[None]
        if velocity is not None:
            inputs["velocity"] = xp.asarray(velocity)[None]
        x, mean = self._samples[velocity is not None](row[0], x, inputs)
        return xp.concatenate((number[None] + 1.0, x[0], mean[0]))

    def advance(
        self, state: AnyArray, q: Array, velocity: Array | None, scene: Scene | None = None
    ) -> AnyArray:
        """Return number, law's state and mean velocity one sample later.

        Args:
            state: The same of the sample before.
            q: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s]; None for those that the law commands.
            scene: Of `scene_of`; None for that of the step's experiment.
        """
        scene = scene or self.scene
        if self.backend == "jax":
            return self._compiled(scene, state, q, velocity)
        native = self.native if velocity is None else self.native_with_velocity
        inputs = np.concatenate((scene.numbers, q, *(() if velocity is None else (velocity,))))
        after = native.call(state[1 : 1 - self.joints or None], inputs, scene.table[int(state[0])])
        return np.concatenate(([state[0] + 1.0], after))

    advanced = OldName("advance")


class SteppedRobot:
    """A robot that steps from sample to sample.

    Args:
        step: The compiled step.
        scene: Of `CompiledStep.scene_of`; None for that of the step's experiment.

    Attributes:
        number: Number of the next sample.
    """

    def __init__(self, step: CompiledStep, scene: Scene | None = None) -> None:
        self._scene = scene or step.scene
        self._step, self._state = step, self._scene.first
        self._shape = (step.joints,)
        self.number = 0
        self._native: NativeRobot | None = None
        if step.backend == "c":
            self._native = NativeRobot(step.native, step.native_with_velocity, self._scene)

    @property
    def samples(self) -> int:
        """Number of samples of the experiment."""
        return len(self._scene.table)

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self._step.period

    def step(self, position: Array, velocity: Array | None = None) -> Array:
        """Return the joint velocity to command until the next sample, shape (n,) [rad/s].

        It is the mean over the period: an arm that follows the command is then at ``position +
        period * velocity``. Where the command is held, it is the command.

        Args:
            position: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s]; by default those that the law commands.
                If noise moves the arm, they must be given: as measured, or with the noise.

        Raises:
            InvalidInputError: If an argument is no such array, all samples have been made, or the
                velocity is not finite.
        """
        if not (type(position) is np.ndarray and position.shape == self._shape):
            raise InvalidInputError(
                f"position: must be an array, shape {self._shape}, not {short(position)}"
            )
        if velocity is not None and np.shape(velocity) != self._shape:
            raise InvalidInputError(
                f"velocity: must be an array, shape {self._shape}, not {short(velocity)}"
            )
        number = self.number
        if number >= self.samples:
            raise InvalidInputError(
                f"step: all {self.samples} samples of the experiment have been made"
            )
        self.number = number + 1
        if self._native is not None:
            v = self._native.step(number, position, velocity)
        else:
            v = self._by_jax(position, velocity)
        if v is None:
            raise InvalidInputError(
                f"step: the velocity of sample {number} is not finite: either the law has "
                f"failed, or what it was given is not finite, {short(position)}"
            )
        return v

    def _by_jax(self, position: Array, velocity: Array | None) -> Array | None:
        """Return the velocity of a sample; None if it is not finite."""
        self._state = self._step.advance(self._state, position, velocity, self._scene)
        v = np.asarray(self._state)[-self._shape[0] :]
        # For a few numbers faster than NumPy.
        return v if isfinite(sum(v.tolist())) else None
