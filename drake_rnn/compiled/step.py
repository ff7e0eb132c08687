"""A sample of a law: one function of arrays, which JAX compiles, and which is printed as C99."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import prod
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from ..arrays.algebra import AnyArray, require_jax
from ..errors import DrakeRnnError, InvalidInputError
from ..inputs.fields import Array
from ..laws.call_checks import without_checks
from ..laws.checks import Numbers
from ..laws.law import SampledReading
from .c_text import Body, body_of
from .graph import Graph, Node
from .tracing import Tracer

_PURPOSE = "JAX traces a law that is compiled, and so it must take arrays of JAX"
_PACKAGE = __package__.partition(".")[0]

#: Signals by name, each with a leading axis of robots.
SignalArrays = Mapping[str, AnyArray]


def trace_step(
    law: SampledReading,
    t: AnyArray,
    x: AnyArray,
    u: SignalArrays,
    period: float,
    purpose: str,
    *,
    own_only: bool = False,
) -> AnyArray:
    """Return the state of a law one period later, as JAX traces it; arguments are those of `step`.

    Args:
        law: The law.
        t: Time of the sample [s].
        x: State, shape (robots, state.size).
        u: Signals at the sample.
        period: Time until the next sample [s].
        purpose: What it is traced for, as the end of a message.
        own_only: Whether only errors of laws of a user's own are told so; others are raised as
            they are.

    Raises:
        InvalidInputError: If JAX cannot trace the law; the message names the line.
    """
    step: Any = without_checks(law.step)
    try:
        after = step(t, x, u, period)
    except (DrakeRnnError, KeyboardInterrupt):
        raise
    except BaseException as error:
        if own_only and type(law).__module__.startswith(f"{_PACKAGE}."):
            raise
        raise InvalidInputError(_untraced_message(law, error, purpose)) from error
    if after.shape != x.shape or after.dtype != x.dtype:
        raise InvalidInputError(
            f"{type(law).__name__}.step: returns shape {after.shape} of {after.dtype} for states "
            f"of shape {x.shape} of {x.dtype}, when JAX compiles it"
        )
    return after


def _untraced_message(law: SampledReading, error: BaseException, purpose: str) -> str:
    """Return why JAX cannot compile a law, with the line of the law's own module."""
    errors, place = require_jax().errors, f"{type(law).__name__}.step{_line(law, error)}"
    if type(law).__module__.startswith(f"{_PACKAGE}.") and not law.takes_many:
        why = (
            "is written for one robot and NumPy (takes_many is False), as laws are that plan ahead "
            "or see locked joints"
        )
    elif isinstance(error, errors.TracerArrayConversionError):
        why = (
            "calls a function of NumPy with an array of JAX; call that of functions_of(...), which "
            "is numpy or jax.numpy"
        )
    elif isinstance(error, errors.ConcretizationTypeError):
        why = (
            "decides by numbers which JAX does not have yet (if, float, range, an index); choose "
            "between results by where, of functions_of(...)"
        )
    else:
        text = str(error).strip().partition("\n")[0]
        why = f"raised {type(error).__name__}: {text[:200]}"
        if "incompatible shapes" in text:
            why += " A gain that is tuned has shape (robots, 1); before a matrix, gain[..., None]"
    return f"{place}: {why}; {purpose}"


def _line(law: SampledReading, error: BaseException) -> str:
    """Return which line has failed: of the law's own module if one has, else of this package."""
    frames, own = extract_tb(error.__traceback__), inspect.getsourcefile(type(law))
    lines = [each.lineno for each in frames if each.filename == own]
    if lines and not type(law).__module__.startswith(f"{_PACKAGE}."):
        return f", line {lines[-1]}"
    here = Path(__file__).parent
    for frame in reversed(frames):
        file = Path(frame.filename)
        if here.parent in file.parents and file.parent not in (here, here.parent / "arrays"):
            return f", {file.name} line {frame.lineno}"
    return ""


#: Name under which numbers of a law are given, beside its signals.
NUMBERS = "law_numbers"


@dataclass(frozen=True, eq=False)
class Sample:
    """A sample of a law with what it sees, of one robot.

    Attributes:
        law: Reading of the law.
        period: Sampling period [s].
        input_shapes: Shapes of what is given at a sample, by name.
        signals_of: Returns the signals that the law sees, of what is given, state and time; None
            where these are given.
        numbers: Numbers of the law that are given as well, under the name `NUMBERS`; None for none.
    """

    law: SampledReading
    period: float
    input_shapes: Mapping[str, tuple[int, ...]]
    signals_of: Callable[[AnyArray, AnyArray, SignalArrays], SignalArrays] | None = None
    numbers: Numbers | None = None

    @classmethod
    def of(
        cls, law: SampledReading, period: float, others: Sequence[SampledReading] = ()
    ) -> Sample:
        """Return a sample of a law that is given all that it sees, and numbers.

        Args:
            law: Reading of the law.
            period: Sampling period [s].
            others: Further readings that it is to serve, see `Numbers`.
        """
        numbers = Numbers.of([law, *others], of_start=True)
        shapes = {NUMBERS: (numbers.size,)} if numbers.size else {}
        return cls(law, period, shapes | law.inputs.shapes, numbers=numbers)

    def __call__(self, t: AnyArray, x: AnyArray, inputs: SignalArrays) -> tuple[AnyArray, AnyArray]:
        """Return the next state and the mean velocity until the next sample, as JAX traces them.

        Args:
            t: Time of the sample [s].
            x: State, as `as_batch` returns it.
            inputs: What is given, likewise.
        """
        law, h = self.law_of(inputs), self.period
        inputs = {name: value for name, value in inputs.items() if name != NUMBERS}
        u = inputs if self.signals_of is None else self.signals_of(t, x, inputs)
        after = trace_step(law, t, x, u, h, _PURPOSE)
        velocity = law.commanded_velocity(t, after)
        if not law.holds_command:
            # Heun's method, exact for a ramp.
            velocity = velocity + 0.5 * (law.commanded_velocity(t + h, after) - velocity)
        return after, velocity

    def law_of(self, inputs: SignalArrays) -> SampledReading:
        """Return the law with the numbers that are given, if any are."""
        if self.numbers is None or NUMBERS not in inputs:
            return self.law
        return self.numbers.within(inputs[NUMBERS])

    def numbers_of(self, law: SampledReading) -> Array:
        """Return the numbers of a law that are given, shape (k,)."""
        return np.zeros(0) if self.numbers is None else self.numbers.of_reading(law)

    def as_batch(self, array: AnyArray) -> AnyArray:
        """Return an array with a leading axis of one robot, if the law takes many."""
        return array[None] if self.law.takes_many else array

    @cached_property
    def expressions(self) -> tuple[list[Node], list[Node]]:
        """The next state and the mean velocity, as expressions of leaves, see `leaf_texts`.

        Raises:
            InvalidInputError: If the law cannot be compiled; the message says which line cannot.
        """
        with _without_collection():
            return self._traced()

    def _traced(self) -> tuple[list[Node], list[Node]]:
        jax, name = require_jax(), type(self.law).__name__
        graph = Graph()
        shapes = {"time": (), "state": (self.law.state.size,), **self.input_shapes}
        leaves = [_leaves(graph, key, shape, self._cuts(key)) for key, shape in shapes.items()]
        zeros = [jax.numpy.zeros(shape) for shape in shapes.values()]
        zeros = [zeros[0], *(self.as_batch(each) for each in zeros[1:])]

        def trace(t: AnyArray, x: AnyArray, *rows: AnyArray) -> tuple[AnyArray, AnyArray]:
            return self(t, x, dict(zip(self.input_shapes, rows, strict=True)))

        jaxpr = jax.make_jaxpr(trace)(*zeros)
        args = []
        for nodes, zero in zip(leaves, zeros, strict=True):
            array = np.empty(len(nodes), dtype=object)
            array[:] = nodes
            args.append(array.reshape(zero.shape))
        tracer = Tracer(graph, name)
        after, velocity = map(tracer.entries, tracer.evaluate(jaxpr, args))
        return list(after.ravel()), list(velocity.ravel())

    def _cuts(self, name: str) -> list[int]:
        """Return where the parts of an array begin that may lie apart in memory."""
        if name == NUMBERS and self.numbers is not None:
            return [part.start for part in self.numbers.places.values()]
        parts = self.law.state.parts.values() if name == "state" else ()
        return [size.start for size, _ in parts]

    def body(self, texts: Mapping[str, str], after: list[str], velocity: list[str]) -> Body:
        """Return the statements in C of a sample.

        Args:
            texts: The text of each leaf, by its name.
            after: Where each entry of the next state is put.
            velocity: Where each entry of the mean velocity is put; empty for nowhere.
        """
        state, mean = self.expressions
        outputs = [*zip(after, state, strict=True)]
        if velocity:
            outputs += zip(velocity, mean, strict=True)
        with _without_collection():
            return body_of(texts, outputs)


@contextmanager
def _without_collection() -> Iterator[None]:
    """Collect no garbage: a program has 100,000 parts, all needed, which would be looked at often.

    It takes a quarter of the time.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _leaves(graph: Graph, name: str, shape: tuple[int, ...], cuts: list[int]) -> list[Node]:
    """Return the leaves of an array, whose parts may lie apart in memory."""
    names = _leaf_names(name, shape)
    starts = sorted({0, *cuts})
    nodes = []
    for start, stop in zip(starts, [*starts[1:], len(names)], strict=True):
        nodes += graph.array(names[start:stop])
    return nodes


def _leaf_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of the entries of an array."""
    return [name] if shape == () else [f"{name}_{k}" for k in range(prod(shape))]


def leaf_texts(name: str, shape: tuple[int, ...], array: str, first: int = 0) -> dict[str, str]:
    """Return the text of each entry of an array by the name of its leaf: entries of another."""
    return {leaf: f"{array}[{first + k}]" for k, leaf in enumerate(_leaf_names(name, shape))}
