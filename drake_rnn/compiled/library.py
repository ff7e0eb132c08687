"""Steps of laws in C: built once by the compiler of the machine, kept, and called from Python.

The text of a step is its key: what has been built is found in the user's folder of caches, in
``compiled/``. Nothing is built where there is no compiler.
"""

from __future__ import annotations

import ctypes
import platform
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import require_jax
from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import Array
from ..inputs.files import cached_file
from ..inputs.packages import c_compiler
from ..laws.checks import Numbers
from ..laws.guard import StepInPlace
from ..laws.law import SampledReading, Signals
from .step import Sample, leaf_texts

#: Options with which C keeps the bits: nothing is contracted or reordered.
FLAGS = ("-std=c99", "-ffp-contract=off", "-fPIC", "-shared")
#: Further ones for loops over large arrays, which keep them as well.
LOOP_FLAGS = (
    *("-ftree-vectorize", "-fno-tree-slp-vectorize", "-fvect-cost-model=dynamic"),
    *("-fno-trapping-math", "-fno-math-errno"),
)
# Characters of a source from which on it is optimized less, so that it is built in seconds: of a
# step among obstacles, 0.9 MB, gcc 12 takes 5 s with -O1 and 13 s with -O2, for steps as fast. One
# whose branches stand once for each joint, 1.7 MB, took 13 and 23 s, also for steps as fast.
_LARGE = 200_000
# Time that a compiler may take [s], and how much of what it says is read [bytes].
_LONGEST, _TOLD = 900, 10_000


@cache
def compiler() -> tuple[str, ...] | None:
    """Return the command of the machine's C compiler, see `c_compiler`."""
    return c_compiler()


def build_library(source: str, *, has_loops: bool = False) -> Path:
    """Return a library of a source in C, built now or before.

    Args:
        source: The source.
        has_loops: Whether it has loops over large arrays.

    Raises:
        InvalidInputError: If there is no compiler, it refuses the source, or the library cannot be
            kept.
    """
    if (program := compiler()) is None:
        raise InvalidInputError(
            "compiled: no C compiler is found; install gcc or clang, or set CC to one"
        )
    flags: tuple[str, ...] = (*FLAGS, "-O1" if len(source) > _LARGE else "-O2")
    if has_loops:
        flags = (*flags, *_loop_flags(program))
    key = "\n".join((source, *program, *flags, platform.machine(), platform.system()))
    name = f"compiled/{sha256(key.encode()).hexdigest()[:32]}.so"
    return cached_file(name, lambda: _library((*program, *flags), source))


def open_library(file: Path, *names: str) -> ctypes.PyDLL:
    """Return a library of `build_library`, whose calls keep Python's lock: they take microseconds.

    Args:
        file: The library.
        names: Functions that it must have.

    Raises:
        InvalidInputError: If it cannot be loaded. It is removed, so that it is built anew.
    """
    try:
        library = ctypes.PyDLL(str(file))
        for name in names:
            library[name]
        return library
    except (OSError, AttributeError) as error:
        with suppress(OSError):
            file.unlink()
        raise InvalidInputError(
            f"compiled: what the C compiler has built cannot be loaded: {error}; set CC to a "
            "compiler for this machine"
        ) from None


@cache
def _loop_flags(program: tuple[str, ...]) -> tuple[str, ...]:
    """Return the flags for loops over large arrays that a compiler takes.

    Those of wider vectors are not among them: with ``-mavx2`` gcc 12.2 makes wrong code of some
    loops, and a certificate must not depend on that. They would save a quarter of the time.
    """
    try:
        _library((*program, *FLAGS, *LOOP_FLAGS), "int f(void);\n")
    except InvalidInputError:
        return ()
    return LOOP_FLAGS


def _library(program: Sequence[str], source: str) -> bytes:
    """Return the content of a library.

    Raises:
        InvalidInputError: If the compiler cannot be run, refuses the source or writes no library.
    """
    name = Path(program[0]).name
    try:
        with TemporaryDirectory() as folder:
            text, library = Path(folder, "step.c"), Path(folder, "step.so")
            text.write_text(source, encoding="ascii")
            run_compiler([*program, "-o", str(library), str(text), "-lm"], "the step")
            content = library.read_bytes() if library.is_file() else b""
    except OSError as error:
        raise InvalidInputError(
            f"compiled: a library cannot be built in a temporary folder: {error.strerror}; set "
            "TMPDIR to one that can be written to"
        ) from None
    if not content:
        raise InvalidInputError(f"compiled: {name} has written no library; set CC to a C compiler")
    return content


def run_compiler(command: Sequence[str], what: str) -> None:
    """Run a compiler.

    Args:
        command: Its command, with all arguments.
        what: What it compiles, for messages.

    Raises:
        InvalidInputError: If it cannot be run, refuses what it is given, is ended by a signal or
            does not end.
    """
    name = Path(command[0]).name
    try:
        with TemporaryFile() as said:
            process = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                timeout=_LONGEST,
                check=False,
            )
            said.seek(0)
            message = " ".join(said.read(_TOLD).decode(errors="replace").split())[:300]
    except subprocess.TimeoutExpired:
        raise InvalidInputError(
            f"compiled: {name} has not ended with {what} in {_LONGEST} s; set CC to a C compiler"
        ) from None
    except OSError as error:
        raise InvalidInputError(
            f"compiled: {name} cannot be run: {error.strerror}; set CC to a C compiler"
        ) from None
    if (status := process.returncode) != 0:
        if not message:
            message = f"it is ended by signal {-status}" if status < 0 else f"status {status}"
        raise InvalidInputError(f"compiled: {name} refuses {what}: {message}")


_SOURCE = """\
#include <math.h>

{helpers}
static int sample(const double *state, const double *given, const double *row, double *after)
{{
{body}
    double odd = 0.0;
    for (int k = 0; k < {count}; ++k) {{
        odd += after[k] - after[k];
    }}
    return odd == 0.0 ? 0 : 1;
}}

int law_sample(const double *state, const double *given, const double *row, double *after);

int law_sample(const double *state, const double *given, const double *row, double *after)
{{
    return sample(state, given, row, after);
}}

typedef struct {{
    double *after;
    const double *given;
    const double *table;
    int columns;
}} robot;

int law_tick(const robot *it, int number);

int law_tick(const robot *it, int number)
{{
    return sample(it->after, it->given, it->table + (long)it->columns * number, it->after);
}}

void law_samples(int robots, const double *states, const double *given, const double *row,
                 double *after);

void law_samples(int robots, const double *states, const double *given, const double *row,
                 double *after)
{{
    for (long k = 0; k < robots; ++k) {{
        (void)sample(states + k * {size}, given + k * {given}, row, after + k * {count});
    }}
}}
"""


class _Robot(ctypes.Structure):
    """What is the same at all samples of a robot, so that a call has two arguments."""

    _fields_ = (
        ("after", ctypes.c_void_p),
        ("given", ctypes.c_void_p),
        ("table", ctypes.c_void_p),
        ("columns", ctypes.c_int),
    )


class NativeStep:
    """A sample in C, called from Python.

    What is given lies in one array, ``inputs``, and in rows of a table; what comes out in another.

    Args:
        sample: The sample.
        rows: Names of what is given by rows, which begin with the time.

    Attributes:
        inputs: What is given at a sample, one after the other, without what rows have.
        state: The state of the law.
        after: The next state and then the mean velocity. The first is written over ``state`` if
            this is a view of it.
        library: File of the library.
        places: Where each of ``inputs`` is.

    Raises:
        InvalidInputError: If the law cannot be compiled, or there is no compiler.
    """

    def __init__(self, sample: Sample, rows: tuple[str, ...] = ()) -> None:
        size, n = sample.law.state.size, sample.law.state.parts["v"][0]
        joints = n.stop - n.start
        texts = {"time": "row[0]"} | leaf_texts("state", (size,), "state")
        self.places: dict[str, slice] = {}
        counts = {"given": 0, "row": 1}
        for name, shape in sample.input_shapes.items():
            array = "row" if name in rows else "given"
            texts |= leaf_texts(name, shape, array, counts[array])
            until = counts[array] + int(np.prod(shape))
            if array == "given":
                self.places[name] = slice(counts[array], until)
            counts[array] = until
        after = [f"after[{k}]" for k in range(size)]
        velocity = [f"after[{size + k}]" for k in range(joints)]
        body = sample.body(texts, after, velocity)
        self.source = _SOURCE.format(
            helpers=body.helpers,
            body="\n".join(
                "    " + line
                for line in ("(void)state;", "(void)given;", "(void)row;", *body.lines)
            ),
            count=size + joints,
            size=size,
            given=counts["given"],
        )
        self.library = build_library(self.source, has_loops=body.memory > 0)
        library = open_library(self.library, "law_sample", "law_tick", "law_samples")
        self.function: Any = library["law_sample"]
        self.function.restype = ctypes.c_int
        self.function.argtypes = (ctypes.c_void_p,) * 4
        self.tick: Any = library["law_tick"]
        self.tick.restype = ctypes.c_int
        self._samples: Any = library["law_samples"]
        self._samples.argtypes = (ctypes.c_int, *(ctypes.c_void_p,) * 4)
        self.inputs = np.zeros(counts["given"])
        self.after = np.zeros(size + joints)
        self.operations, self.is_bounded = body.operations, body.is_bounded

    def call(self, state: Array, inputs: Array, row: Array) -> Array:
        """Return the next state and the mean velocity, one after the other."""
        arrays = [np.ascontiguousarray(each, dtype=float) for each in (state, inputs, row)]
        after = np.zeros_like(self.after)
        self.function(*(each.ctypes.data for each in (*arrays, after)))
        return after

    def call_many(self, states: Array, inputs: Array, row: Array) -> Array:
        """Return what `call` does of many robots, with these in front of states and inputs."""
        arrays = [np.ascontiguousarray(each, dtype=float) for each in (states, inputs, row)]
        after = np.empty((len(states), self.after.size))
        self._samples(len(states), *(each.ctypes.data for each in (*arrays, after)))
        return after


class Scene(NamedTuple):
    """What a compiled step is given of a robot.

    Attributes:
        table: What is known of each sample, a row for each; it is contiguous.
        first: Number of the first sample, the law's state and the mean velocity before it.
        numbers: Numbers of its law, see `drake_rnn.laws.checks.Numbers`.
    """

    table: Array
    first: Array
    numbers: Array


class NativeRobot:
    """A robot whose law steps in C along a table of what is given.

    Args:
        native: The step with joint positions.
        with_velocity: The step with joint velocities behind these, or the same.
        scene: What is given.
    """

    def __init__(self, native: NativeStep, with_velocity: NativeStep, scene: Scene) -> None:
        n, table = native.places["position"].stop - native.places["position"].start, scene.table
        # The state that is read and the one that is written are the same array.
        self._after, self._table = np.array(scene.first[1:], float), table
        self._inputs = np.concatenate((scene.numbers, np.zeros(2 * n)))
        self._v = self._after[-n:]
        self._position, self._velocity = self._inputs[scene.numbers.size :].reshape(2, n)
        self._tick, self._tick_with_velocity = native.tick, with_velocity.tick
        places = [each.ctypes.data for each in (self._after, self._inputs, table)]
        self._robot = _Robot(*places, table.shape[1])
        self._at = ctypes.c_void_p(ctypes.addressof(self._robot))

    def step(self, number: int, position: Array, velocity: Array | None) -> Array | None:
        """Return the mean velocity of a sample, shape (n,) [rad/s]; None if it is not finite."""
        self._position[:] = position
        if velocity is None:
            failure = self._tick(self._at, number)
        else:
            self._velocity[:] = velocity
            failure = self._tick_with_velocity(self._at, number)
        return None if failure else self._v.copy()


# Steps of laws among obstacles, with what they serve: to trace one takes seconds.
_NATIVE: list[tuple[Sample, NativeStep]] = []
_MOST = 32


def native_step(law: SampledReading, period: float) -> tuple[NativeStep, Array]:
    """Return the step of a law in C, and the numbers that it is given first, shape (k,).

    One that was made for the same law, or for it among other obstacles, is used again.

    Args:
        law: Reading of the law.
        period: Its period [s].

    Raises:
        InvalidInputError: If the law cannot be compiled, or there is no compiler.
    """
    for place, (sample, native) in enumerate(_NATIVE):
        if sample.period == period and sample.numbers is not None and sample.numbers.serve(law):
            # Of many the one that was used last goes last.
            _NATIVE.append(_NATIVE.pop(place))
            return native, sample.numbers_of(law)
    sample = Sample.of(law, period)
    native = NativeStep(sample)
    if sample.numbers is not None:
        _NATIVE[:] = [*_NATIVE[1 - _MOST :], (sample, native)]
    return native, sample.numbers_of(law)


class NativeLaw:
    """The step of a law in C, in the place of `SampledReading.step`.

    Args:
        law: Reading of the law.
        period: Its period [s], the only one that it is called with.

    Attributes:
        source: The source in C.

    Raises:
        InvalidInputError: If the law cannot be compiled, or there is no compiler.
    """

    def __init__(self, law: SampledReading, period: float) -> None:
        native, numbers = native_step(law, period)
        self.source, self._native = native.source, native
        inputs, after = np.zeros_like(native.inputs), np.zeros_like(native.after)
        inputs[: numbers.size] = numbers
        # Signals are given as they come from ports, as flat arrays.
        self._views = {name: inputs[native.places[name]] for name in law.inputs.parts}
        self._time, self._state = np.zeros(1), np.zeros(law.state.size)
        self._after = after[: law.state.size]
        self._function = native.function
        arrays = (self._state, inputs, self._time, after)
        self._places = [ctypes.c_void_p(array.ctypes.data) for array in arrays]

    def __call__(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state one period later, see `SampledReading.step`."""
        self._time[0] = t
        self._state[:] = x
        for name, view in self._views.items():
            view[:] = u[name].ravel()
        self._function(*self._places)
        return self._after.copy()

    def of_ports(
        self, state: Callable[[Any], Array], signals: Iterable[tuple[str, Callable[[Any], Array]]]
    ) -> Callable[[Any], Array]:
        """Return what makes a step of what ports say in a context.

        Args:
            state: Reads the state.
            signals: What reads each signal, by its name, as a flat array.

        Returns:
            A function from a context to the state one period later, which the next call overwrites.
        """
        time, before, after, places = self._time, self._state, self._after, self._places
        readers = [(self._views[name], read) for name, read in signals]
        function = self._function

        def step(context: Any) -> Array:
            time[0] = context.get_time()
            before[:] = state(context)
            for view, read in readers:
                view[:] = read(context)
            function(*places)
            return after

        return step


def laws_step(
    laws: Sequence[SampledReading], together: SampledReading, period: float
) -> Callable[[float, Array, Signals, float], Array]:
    """Return the compiled step of many laws, in the place of that of all together.

    One build serves all: in what they differ is given with each step.

    Args:
        laws: Readings of the laws.
        together: What `drake_rnn.laws.checks.stack` makes of them.
        period: Their period [s], the only one that it is called with.

    Raises:
        InvalidInputError: If JAX is not installed, or the laws cannot be compiled.
    """
    shapes, size = together.inputs.shapes, together.state.size
    if compiler() is None:
        step_by_jax = require_jax().jit(Sample(together, period, shapes))
        return lambda t, x, u, period: np.array(step_by_jax(t, x, dict(u))[0])
    sample = Sample.of(laws[0], period, laws[1:])
    native, numbers = NativeStep(sample), np.stack([sample.numbers_of(law) for law in laws])

    def step(t: float, x: Array, u: Signals, period: float) -> Array:
        signals = (np.reshape(u[name], (len(x), -1)) for name in shapes)
        given = np.concatenate((numbers, *signals), axis=1)
        return native.call_many(x, given, np.array([t]))[:, :size]

    return step


def law_step(law: SampledReading, period: float) -> Callable[[float, Array, Signals, float], Array]:
    """Return the compiled step of a law, in the place of `SampledReading.step`.

    It is compiled to C where a C compiler is found, else by JAX.

    Args:
        law: Reading of the law.
        period: Its period [s], the only one that it is called with.

    Raises:
        InvalidInputError: If JAX is not installed, or the law cannot be compiled.
    """
    if compiler() is not None:
        return NativeLaw(law, period)
    jax = require_jax()
    sample = Sample(law, period, law.inputs.shapes)
    step_by_jax = jax.jit(
        lambda t, x, u: sample(
            t, sample.as_batch(x), {name: sample.as_batch(u[name]) for name in u}
        )[0]
    )
    names = tuple(law.inputs.parts)

    def step(t: float, x: Array, u: Signals, period: float) -> Array:
        return np.array(step_by_jax(t, x, {name: u[name] for name in names})).reshape(x.shape)

    return step


@dataclass(frozen=True)
class BuiltStep:
    """A step in C that has been built, as it can be sent to another process.

    Attributes:
        library: The library.
        size: Numbers of the law's state.
        joints: Numbers of the mean velocity, which are put behind it.
        shapes: Shapes of what the law sees, by name, as they follow each other.
        numbers: Its own numbers, which come before these, see `Numbers`.
    """

    library: Path
    size: int
    joints: int
    shapes: Mapping[str, tuple[int, ...]]
    numbers: Array

    @classmethod
    def of(cls, law: SampledReading, library: Path) -> BuiltStep:
        """Return the step of a law by a library that was built of it, or of one like it."""
        numbers = Numbers.of([law], of_start=True).of_reading(law)
        return cls(library, law.state.size, law.state.shapes["v"][0], law.inputs.shapes, numbers)

    def arrays(self) -> StepArrays:
        """Return arrays that the step can be made in."""
        return StepArrays(self)

    def in_place(self) -> StepInPlace:
        """Return the step, made in arrays that stay where they are.

        A step that gives what is not finite raises a SimulationError.

        Raises:
            InvalidInputError: If the library cannot be loaded.
        """
        arrays = self.arrays()
        return StepInPlace(arrays.x, arrays.u, arrays.by(self.library))


class StepArrays:
    """Arrays that the step of a law is made in, by C or by NumPy.

    Args:
        step: Their sizes, and the law's own numbers.

    Attributes:
        x: The state, shape (step.size,); the one that is read is the one that is written.
        u: What the law sees, by name.
    """

    def __init__(self, step: BuiltStep) -> None:
        sizes = [step.numbers.size, *(int(np.prod(shape)) for shape in step.shapes.values())]
        ends = np.cumsum(sizes)
        given, row, after = np.zeros(int(ends[-1])), np.zeros(1), np.zeros(step.size + step.joints)
        given[: step.numbers.size] = step.numbers
        self.x = after[: step.size]
        self.u = {
            name: given[ends[k] : ends[k + 1]].reshape(shape)
            for k, (name, shape) in enumerate(step.shapes.items())
        }
        # They live as long as what is made in them.
        self._arrays = after, given, row

    def by(self, library: Path) -> Callable[[], None]:
        """Return what makes a step by a library, see `BuiltStep.in_place`."""
        function: Any = open_library(library, "law_tick")["law_tick"]
        function.restype = ctypes.c_int
        # Each argument of a call costs as much as what a step of a light law does.
        robot = _Robot(*(array.ctypes.data for array in self._arrays), 0)
        place = ctypes.c_void_p(ctypes.addressof(robot))

        def make(robot: _Robot = robot) -> None:
            if function(place, 0):
                raise SimulationError("law: its step in C gives what is not finite", 0.0)

        return make


def built_step(law: SampledReading, period: float) -> BuiltStep | None:
    """Return the step of a law in C; None where there is no compiler.

    Args:
        law: Reading of the law.
        period: Its period [s], the only one that it is called with.

    Raises:
        InvalidInputError: If the law cannot be compiled.
    """
    if compiler() is None:
        return None
    return BuiltStep.of(law, native_step(law, period)[0].library)
