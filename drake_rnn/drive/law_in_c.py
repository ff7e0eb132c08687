"""The law of a drive in C: what is called in a cycle, in place of the law in NumPy.

- A step that ends within a time, and whose faults end nothing but itself.
- A sample of a law with its kinematics and its path, and with how it goes on from what was
  commanded without it: all that a pacer calls in its own cycle.
- The controller of a drive, whose steps are made elsewhere.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import ceil
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pydrake.systems.framework import Context, Diagram, OutputPort

from ..arrays.algebra import AnyArray, require_jax
from ..batch.signals import Sight
from ..compiled.library import NativeStep, build_library, native_step, open_library
from ..compiled.step import NUMBERS, Sample, SignalArrays
from ..diagrams import Loop
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..laws.checks import Numbers
from ..laws.law import SampledReading, Signals
from ..robot.limits import JointLimits
from ..robot.load_arm import screws_of
from ..robot.screws import PairScrews, Screws
from ..robot.task import Task
from ..signals import names_of
from ..systems import SampledController
from .pacer import NOT_FINITE, fault_text, law_bytes

# The guard of a step: a fault within the step, or its time, ends the call alone. What a step has is
# on the stack, so nothing is left over. Faults outside of it are treated as before.
_GUARD = """\
#define _XOPEN_SOURCE 700
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <time.h>

typedef int step_of(const double *, const double *, const double *, double *);

enum { NOT_FINITE = -1, TOO_LONG = -2, NO_GUARD = -3, FAULTS = 4 };

static const int faults[FAULTS] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL};
static struct sigaction before[FAULTS];
static sigjmp_buf outside;
static volatile sig_atomic_t within;
static pthread_t caller;
static timer_t timer;
static int is_ready;
static int alarm_number;
static char stack[1 << 16];

static void leave(int number)
{
    const int own = pthread_equal(pthread_self(), caller);
    if (within && own) {
        within = 0;
        siglongjmp(outside, number);
    }
    if (number == alarm_number) {
        if (within) {
            pthread_kill(caller, number);
        }
        return;
    }
    for (int k = 0; k < FAULTS; ++k) {
        if (faults[k] == number) {
            sigaction(number, &before[k], NULL);
        }
    }
}

/* Return where to note what treated a fault before this did. */
static struct sigaction *action_before(int k)
{
    struct sigaction now;
    sigaction(faults[k], NULL, &now);
    return now.sa_handler == leave ? NULL : &before[k];
}

/* A timer is not that of the child of its process. */
static void forget(void)
{
    is_ready = 0;
}

static int prepare(void)
{
    stack_t room = {0};
    struct sigaction action = {0};
    struct sigevent event = {0};
    sigaltstack(NULL, &room);
    if (room.ss_flags & SS_DISABLE) {
        room.ss_sp = stack;
        room.ss_size = sizeof(stack);
        room.ss_flags = 0;
        if (sigaltstack(&room, NULL) != 0) {
            return 1;
        }
    }
    action.sa_handler = leave;
    /* Nothing is blocked, so that nothing has to be unblocked. */
    action.sa_flags = SA_ONSTACK | SA_RESTART | SA_NODEFER;
    for (int k = 0; k < FAULTS; ++k) {
        if (sigaction(faults[k], &action, action_before(k)) != 0) {
            return 1;
        }
    }
    if (alarm_number == 0 && pthread_atfork(NULL, NULL, forget) != 0) {
        return 1;
    }
    alarm_number = SIGRTMAX - 3;
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = alarm_number;
    if (sigaction(alarm_number, &action, NULL) != 0) {
        return 1;
    }
    if (timer_create(CLOCK_MONOTONIC, &event, &timer) != 0) {
        return 1;
    }
    is_ready = 1;
    return 0;
}

int guarded_step(step_of *step, const double *state, const double *given, const double *row,
                 double *after, long microseconds);

int guarded_step(step_of *step, const double *state, const double *given, const double *row,
                 double *after, long microseconds)
{
    struct itimerspec until = {{0, 0}, {microseconds / 1000000, microseconds % 1000000 * 1000}};
    const struct itimerspec never = {{0, 0}, {0, 0}};
    if (!is_ready && prepare() != 0) {
        return NO_GUARD;
    }
    caller = pthread_self();
    const int number = sigsetjmp(outside, 0);
    if (number != 0) {
        timer_settime(timer, 0, &never, NULL);
        return number == alarm_number ? TOO_LONG : number;
    }
    if (timer_settime(timer, 0, &until, NULL) != 0) {
        return NO_GUARD;
    }
    within = 1;
    const int failure = step(state, given, row, after);
    within = 0;
    timer_settime(timer, 0, &never, NULL);
    return failure ? NOT_FINITE : 0;
}
"""
# Time that a step may take in a diagram, whose robot waits, before it is given up [s]: what is
# endless takes longer, and a step of a machine that is busy with others does not.
_LONGEST = 1.0
# Samples of a table at most; more of them are a drive of a quarter of an hour at 1 kHz.
_MOST_SAMPLES = 2**20
# Largest difference of a step in C from that in NumPy, as a share of what is as large as one:
# screws and Drake place the end effector 1e-13 m apart, which is 1e-7 rad/s^2 in 1 ms.
_SAME = 1e-5
# What a pacer gives a step, each 7 numbers but the last two, in the order of `pacer.GIVEN`.
_MOTION = ("position_commanded", "velocity_commanded", "acceleration_commanded")
_MEASURED = ("position_measured", "velocity_measured")
_ELAPSED, _RESUMES = "elapsed", "resumes"


@cache
def _guard() -> tuple[str, Any]:
    """Return the file of the guard, and its function."""
    file = build_library(_GUARD)
    function = open_library(file, "guarded_step")["guarded_step"]
    function.argtypes = (*(ctypes.c_void_p,) * 5, ctypes.c_long)
    return str(file), function


def _guarded(native: NativeStep, state: Array, inputs: Array, row: Array) -> tuple[int, Array]:
    """Return what a guarded call of a step has returned, and its results."""
    after = np.zeros_like(native.after)
    arrays = [*(np.ascontiguousarray(each, dtype=float) for each in (state, inputs, row)), after]
    step = ctypes.cast(native.function, ctypes.c_void_p)
    code = _guard()[1](step, *(each.ctypes.data for each in arrays), int(1e6 * _LONGEST))
    return code, after


# Steps for pacers by experiment: to trace one takes seconds.
_STEPS: WeakKeyDictionary[Experiment, NativeStep] = WeakKeyDictionary()


class GuardedStep:
    """The step of a law in C, in the place of `SampledReading.step`, which no fault of it outlasts.

    Args:
        loop: The law's loop in its diagram.

    Raises:
        InvalidInputError: If the law cannot be compiled, or there is no compiler.
    """

    def __init__(self, loop: Loop) -> None:
        law, period = loop.controller.reading, loop.controller.period
        assert isinstance(law, SampledReading)
        assert period is not None
        self._native, numbers = native_step(law, period)
        self._size, self._time = law.state.size, np.zeros(1)
        self._inputs = np.zeros_like(self._native.inputs)
        self._inputs[: numbers.size] = numbers
        self._views = [
            (name, self._inputs[self._native.places[name]].reshape(shape))
            for name, shape in law.inputs.shapes.items()
        ]
        _guard()

    def __call__(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state one period later, see `SampledReading.step`.

        Raises:
            RuntimeError: If the step ends by a fault, or takes too long.
        """
        self._time[0] = t
        for name, view in self._views:
            view[...] = u[name]
        code, after = _guarded(self._native, x, self._inputs, self._time)
        if code not in (0, NOT_FINITE):
            raise RuntimeError(fault_text(code, _LONGEST))
        return after[: self._size].copy()


@dataclass(frozen=True, eq=False)
class _PacedSample(Sample):
    """A sample that goes on from what was commanded without the law, where it is told to."""

    def __call__(self, t: AnyArray, x: AnyArray, inputs: SignalArrays) -> tuple[AnyArray, AnyArray]:
        q, v, a = (inputs[name] for name in _MOTION)
        try:
            resumed = self.law_of(inputs).resumed(x, q, v, a, inputs[_ELAPSED])
        except Exception as error:
            # A law whose step cannot be compiled says why.
            super().__call__(t, x, inputs)
            raise InvalidInputError(
                f"{type(self.law).__name__}.resumed: cannot be compiled: {type(error).__name__}"
            ) from error
        x = require_jax().numpy.where(inputs[_RESUMES] > 0.0, resumed, x)
        return super().__call__(t, x, inputs)


@dataclass(frozen=True)
class _Sources:
    """Where a law's signals come from.

    Attributes:
        task, screws: Task and kinematics of the arm.
        measured: Whether the law sees the arm as measured, and not as commanded.
        timed: Ports that depend on time alone, by the names of the signals.
    """

    task: Task
    screws: Screws | PairScrews
    measured: bool
    timed: dict[str, OutputPort]


class LawInC:
    """A law in C with kinematics and path, as a pacer calls it.

    Args:
        experiment: The experiment.
        diagram: Its diagram.
        loop: The law's loop in it.
        root: Context of the diagram at the start, in which the law has its initial state.

    Raises:
        InvalidInputError: If the law cannot be compiled, or sees what is not compiled; the message
            says why in a sentence.
    """

    def __init__(self, experiment: Experiment, diagram: Diagram, loop: Loop, root: Context) -> None:
        controller = loop.controller
        assert isinstance(controller, SampledController)
        law, self.period = controller.reading, controller.period
        self._law, self._n = law, experiment.arm.n
        self.samples = ceil(experiment.document.duration / self.period - 1e-9)
        if self.samples > _MOST_SAMPLES:
            raise InvalidInputError(
                f"duration: has {self.samples} samples; a table of the path has at most "
                f"{_MOST_SAMPLES}"
            )
        sources = _sources(experiment, diagram, loop)
        self._numbers = Numbers.of([law])
        if experiment not in _STEPS:
            _STEPS[experiment] = self._compile(law, sources)
        self._native = _STEPS[experiment]
        self._table = _table(sources.timed, diagram, self.samples, self.period)
        self._start = controller.state(controller.GetMyContextFromRoot(root))
        self._joints, self._home = experiment.arm.joints, experiment.start
        _guard()

    def _compile(self, law: SampledReading, sources: _Sources) -> NativeStep:
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys((*_MOTION, *_MEASURED), (self._n,))
        shapes |= dict.fromkeys((_ELAPSED, _RESUMES), (1,))
        timed = {name: law.inputs.parts[name][1] for name in sources.timed}
        others = law.inputs.parts.keys() - timed.keys()
        kind = _MEASURED if sources.measured else _MOTION[:2]

        def signals_of(t: AnyArray, x: AnyArray, inputs: SignalArrays) -> SignalArrays:
            q, v = inputs[kind[0]], inputs[kind[1]]
            if not sources.measured:
                v = law.commanded_velocity(t, x)
            rows = [each if each.ndim > 1 else each[None] for each in (q, v)]
            sight = Sight(sources.task, sources.screws.at(rows[0]), rows[0])
            seen = sight.of_arms(others, rows[1], rows[1])
            if q.ndim == 1:
                seen = {name: value[0] for name, value in seen.items()}
            return seen | {name: inputs[name] for name in timed}

        shapes |= timed | ({NUMBERS: (self._numbers.size,)} if self._numbers.size else {})
        sample = _PacedSample(law, self.period, shapes, signals_of, self._numbers)
        return NativeStep(sample, tuple(timed))

    def require_same(self, states: Sequence[Array]) -> None:
        """Raise an InvalidInputError unless the first steps are those of NumPy.

        Args:
            states: States of the law after its first steps, of an arm that is measured to rest at
                its start.
        """
        x, own = self._start, []
        numbers = self._numbers.of_reading(self._law)
        still, v = np.zeros(self._n), self._law.state.parts["v"][0]
        motion = [self._home, still, still]
        for row in self._table[: len(states)]:
            given = np.concatenate((*motion, self._home, still, (0.0, 0.0), numbers))
            code, after = _guarded(self._native, x, given, row)
            if code != 0:
                raise InvalidInputError(f"law: {fault_text(code, _LONGEST)} when it is tried")
            x = after[: x.size].copy()
            own.append(x)
            motion = [motion[0] + self.period * x[v], x[v], (x[v] - motion[1]) / self.period]
        require_same(own, states)

    def memory(self, limits: JointLimits, commanded: JointLimits, patience: int) -> bytes:
        """Return what a pacer is handed, see `law_bytes`.

        Args:
            limits: Limits of the law, which its stop keeps.
            commanded: Limits of every command.
            patience: Cycles for which nobody has to look at the robot.
        """
        parts = self._law.state.parts
        most = limits.require("acceleration", "coming to rest")
        about = {
            "library": str(self._native.library),
            "guard": _guard()[0],
            "start": self._start.tolist(),
            "numbers": self._numbers.of_reading(self._law).tolist(),
            "v": parts["v"][0].start,
            "a": parts["a"][0].start if self._law.knows_acceleration else None,
            "period": self.period,
            "samples": self.samples,
            "columns": self._table.shape[1],
            "most": most.tolist(),
            "jerk": None if limits.jerk is None else limits.jerk.tolist(),
            "lower": commanded.position_lower.tolist(),
            "upper": commanded.position_upper.tolist(),
            "fastest": commanded.velocity.tolist(),
            "names": self._joints,
            "patience": patience,
        }
        return law_bytes(about, self._table.tobytes())


def require_same(states: Sequence[Array], expected: Sequence[Array]) -> None:
    """Raise an InvalidInputError unless the states of a law in C are those in NumPy."""
    for state, own in zip(states, expected, strict=False):
        off = (np.abs(state - own) / np.maximum(np.abs(own), 1.0)).max()
        if not off <= _SAME:
            raise InvalidInputError(
                f"law: a step in C differs from that in NumPy by {off:.3g}; does it depend on "
                "anything but its arguments?"
            )


def _sources(experiment: Experiment, diagram: Diagram, loop: Loop) -> _Sources:
    """Return where a law's signals come from.

    Raises:
        InvalidInputError: If one comes from what is not compiled.
    """
    controller, arm = loop.controller, loop.arm
    inputs = controller.reading.inputs.parts
    wires = {
        (system, int(port)): source.get_output_port(index)
        for (system, port), (source, index) in diagram.connection_map().items()
    }

    def into(system: Any, name: str) -> OutputPort:
        return wires[system, int(system.GetInputPort(name).get_index())]

    if not controller.reading.holds_command or loop.filter is not None:
        raise InvalidInputError("law: its command varies within a sample, or is filtered")
    if into(loop.joint_command, "u0") is not controller.GetOutputPort("commanded_velocity"):
        raise InvalidInputError("law: its command is changed before the arm is told")
    commanded = loop.joint_command.get_output_port()
    seen = into(loop.kinematics, "position")
    if seen is not commanded and seen is not arm.GetOutputPort("position"):
        raise InvalidInputError(
            f"law: sees {_words(seen)} in place of the arm as measured or as commanded"
        )
    timed: dict[str, OutputPort] = {}
    own = {*names_of("kinematics")} | {"position", "velocity"}
    arms = (loop.kinematics, loop.joint_command, controller, arm)
    for name in inputs:
        source = into(controller, name)
        system = source.get_system()
        if name in own and any(system is each for each in arms):
            continue
        if not _is_timed(system):
            raise InvalidInputError(f"law: sees {name} of {_words(source)}, which is not compiled")
        timed[name] = source
    task, screws = experiment.law_task, screws_of(experiment.arm)
    return _Sources(task, screws, seen is not commanded, timed)


def _words(port: OutputPort) -> str:
    return f"the system {port.get_system().get_name()!r}"


def _is_timed(system: Any) -> bool:
    """Return whether a system's outputs depend on time alone."""
    context = system.AllocateContext()
    return system.num_input_ports() == 0 and context.num_total_states() == 0


def _table(ports: dict[str, OutputPort], diagram: Diagram, samples: int, period: float) -> Array:
    """Return time and signals of the path, a row for each sample."""
    root = diagram.CreateDefaultContext()
    reads = [(port, port.get_system().GetMyContextFromRoot(root)) for port in ports.values()]
    rows = []
    for k in range(samples):
        root.SetTime(k * period)
        rows.append(np.concatenate([(k * period,), *(port.Eval(at) for port, at in reads)]))
    return np.ascontiguousarray(rows)


class LawSteps:
    """What makes the steps of a drive's law.

    Attributes:
        step: In place of `SampledReading.step`; None for the law itself.
        count: Number of steps that were made so.
    """

    def __init__(self) -> None:
        self.step: Callable[[float, Array, Signals, float], Array] | None = None
        self.count = 0

    def __call__(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state one period later."""
        assert self.step is not None
        self.count += 1
        return self.step(t, x, u, period)


class DrivenController(SampledController):
    """A controller whose steps may be made elsewhere.

    Args:
        experiment: Experiment whose law it runs.
        steps: What makes its steps.
    """

    def __init__(self, experiment: Experiment, steps: LawSteps) -> None:
        document = experiment.document
        assert document.period is not None
        settings = (document.period, document.seed)
        super().__init__(experiment.law, *settings, experiment.safety, experiment.locks)
        self._steps = steps

    def step_of(self, context: Context) -> Callable[..., Array]:
        """See `SampledController.step_of`."""
        return super().step_of(context) if self._steps.step is None else self._steps
