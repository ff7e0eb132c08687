"""A law as a Drake system: sampled as on a robot, or integrated by Drake.

- A sampled controller: its reading may be a parameter, so that gains change between two samples,
  and its next state is a port, which another controller takes into account at the same sample.
- A continuous controller, which converts to AutoDiffXd, so that Drake linearises its loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from types import NoneType
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import GetIntegrationSchemes
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, State

from ..compiled.library import NativeLaw, law_step
from ..errors import InvalidInputError, OldName, SimulationError, old_arguments
from ..inputs.fields import Array, require_seed
from ..inputs.kinds import describe
from ..inputs.messages import is_number, nearest, require_type, short
from ..laws.call_checks import is_sound, without_checks
from ..laws.checks import (
    continuous_reading,
    flaw,
    is_finite,
    observables_of,
    sampled_reading,
    start,
    try_reading,
)
from ..laws.law import ContinuousReading, Law, Reading, ReadingWrapper, SampledReading, Signals
from ..laws.safety import Safety
from .block import (
    AutoDiffFunctions,
    Block,
    Calc,
    autodiff,
    autodiff_array,
    values_of,
    varies,
)

# What a law without a reading says in the words of a document, and how a diagram says it.
_WORDS = {
    "give a period instead of an integrator": "use SampledController(law, period)",
    "give a period instead": "use SampledController(law, period)",
    "give an integrator instead": "use ContinuousController(law)",
}


@contextmanager
def _in_words_of_diagrams() -> Iterator[None]:
    """Name classes of systems, not keys of a document, where a law has no such reading."""
    try:
        yield
    except InvalidInputError as error:
        text = str(error)
        for words, others in _WORDS.items():
            if words in text:
                plain = text.removeprefix("integrator: ").removeprefix("period: ")
                text = "law: " + plain.removeprefix("law: ").replace(words, others)
        if text == str(error):
            raise
        raise InvalidInputError(text) from error.__cause__


class Controller(Block):
    """Base class of the systems that run a law.

    Input ports are the law's inputs, by name. Outputs are ``commanded_velocity``, ``state``
    and each part of the state by name, which depend on state and time alone, and each
    observable, which depends directly on the inputs and serves only for recording. Matrices are
    flattened row by row.

    The initial state is the law's own, drawn with ``seed``, unless a state has been set before
    the simulation is initialized.
    """

    role = "law"

    #: Sampling period [s]; None for a law that Drake integrates.
    period: float | None = None

    #: What comes between the law's reading and its loop, such as joint locks.
    wrapper: ReadingWrapper | None = None
    locks = OldName("wrapper")

    def __init__(self, law: Law, reading: Reading, seed: int) -> None:
        super().__init__()
        self.law = law
        self.reading = reading
        require_seed(seed)
        self.seed = seed
        self._input_ports = {
            name: (self.DeclareVectorInputPort(name, at.stop - at.start), shape)
            for name, (at, shape) in reading.inputs.parts.items()
        }
        # Read at every sample: methods are bound once, and only matrices are reshaped.
        self._readers = [(name, port.Eval) for name, (port, _) in self._input_ports.items()]
        self._state_shape = (reading.state.size,)
        self._command_shape = reading.state.parts["v"][1]
        shapes = {name: shape for name, (_, shape) in self._input_ports.items()}
        self._matrices = [(name, shape) for name, shape in shapes.items() if len(shape) > 1]

    def reading_in(self, context: Context) -> Reading:
        """Return the reading that runs."""
        return self.reading

    def _declare_command(self, tickets: set[Any]) -> None:
        """Declare the port of a command that is computed, given the tickets of its causes."""
        reading, at_rest = self.reading, np.zeros(self._command_shape)

        def of_state(context: Context, x: Array) -> Array:
            return reading.commanded_velocity(context.get_time(), x)

        # A held command is a part of the state, which has been checked.
        command = of_state if reading.holds_command else self._checked_command

        def calc_command(context: Context, output: Any) -> None:
            x = self._state(context)
            # The state is NaN until it is initialized; until then the arm is at rest.
            rest = x[0] != x[0]
            output.set_value(at_rest if rest else command(context, x))

        if not reading.holds_command:
            tickets = tickets | {self.time_ticket()}
        self.DeclareVectorOutputPort("commanded_velocity", at_rest.size, calc_command, tickets)

    def _declare_parts(self, state: Any) -> None:
        """Declare the ports of observables and of the state's parts, given the state's ticket."""
        for name, (at, _) in self.reading.state.parts.items():
            self.DeclareVectorOutputPort(
                name,
                at.stop - at.start,
                lambda context, output, at=at: output.set_value(self._state(context)[at]),
                {state},
            )
        for name, (at, _) in self.reading.observables.parts.items():
            self.DeclareVectorOutputPort(
                name,
                at.stop - at.start,
                lambda context, output, name=name: output.set_value(
                    self.diagnostics(context)[name].astype(float).ravel()
                ),
            )

    def _state(self, context: Context) -> Array:
        """Return the law's state for immediate use; it may alias the context's memory."""
        raise AssertionError("each reading has its own")

    def set_state(self, context: Context, x: Array) -> None:
        """Set the law's state, shape (state.size,), before the simulation is initialized.

        Raises:
            InvalidInputError: If it has another shape or is not finite.
        """
        if (complaint := flaw(x, self._state_shape)) or not is_finite(x):
            complaint = complaint or f"finite, not {short(x)}"
            raise InvalidInputError(f"{self.get_name()}: the state must be {complaint}")
        self._write_state(context, x)

    def _write_state(self, context: Context, x: Array) -> None:
        raise AssertionError("each reading has its own")

    def state(self, context: Context) -> Array:
        """Return a copy of the law's state, shape (state.size,)."""
        return self._state(context).copy()

    def signals(self, context: Context) -> dict[str, Array]:
        """Return the law's input signals, by name."""
        u = {name: read(context) for name, read in self._readers}
        for name, shape in self._matrices:
            u[name] = u[name].reshape(shape)
        return u

    def initial_state(self, context: Context, **known: Array) -> Array:
        """Return the law's initial state, shape (state.size,), from the signals at its ports.

        Args:
            context: Context of this system, with all input ports connected.
            known: Further signals, e.g. ``J`` for a law without that input.

        Raises:
            InvalidInputError: If an input is not connected, or the position is not finite.
        """
        self._require_connected(context)
        u = self.signals(context)
        position = u.get("position")
        if position is not None and not np.isfinite(position).all():
            raise InvalidInputError(
                f"{self.get_name()}: position is {position.tolist()}; set the start posture"
            )
        rng = np.random.default_rng([self.seed, 0])
        return start(self.reading_in(context), rng, {**u, **known}, context.get_time())

    def try_law(self, context: Context) -> Array:
        """Return the state to start from, after each part of the law has been called and checked.

        This also happens when the simulation is initialized. The context does not change.

        Args:
            context: Context of this system, with all input ports connected.

        Raises:
            InvalidInputError: If the law fails or returns what is wrong; the message names the law,
                the part and the time.
        """
        self._require_connected(context)
        x = self.state(context)
        x = self.initial_state(context) if np.isnan(x).any() else x
        reading = self.reading_in(context)
        try_reading(reading, context.get_time(), x, self.signals(context), self.period)
        return x

    def _require_connected(self, context: Context) -> None:
        for name, (port, _) in self._input_ports.items():
            if not port.HasValue(context):
                raise InvalidInputError(
                    f"{self.get_name()}: its input port {name!r} is not connected"
                )

    def diagnostics(self, context: Context) -> Signals:
        """Return the present values of the law's observables, by name."""
        x, u = self.state(context), self.signals(context)
        return observables_of(self.reading_in(context), context.get_time(), x, u)

    def _checked_command(self, context: Context, x: Array) -> Array:
        """Return the commanded velocity of a law that computes it from time and state."""
        t = context.get_time()
        try:
            v = self.reading_in(context).commanded_velocity(t, x)
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise self._error("commanded_velocity", f" raised {describe(error)}", t) from error
        if is_sound(v, self._command_shape):
            return v
        if complaint := flaw(v, self._command_shape):
            raise self._error("commanded_velocity", f": must return {complaint}", t)
        if not is_finite(v):
            raise self._error("commanded_velocity", f": must be finite, not {v.tolist()}", t)
        return v

    def _error(self, part: str, what: str, t: float) -> SimulationError:
        """Return an error that names the system, the law, the part and the time."""
        return SimulationError(f"{self.get_name()}: {type(self.reading).__name__}.{part}{what}", t)

    def _require_sound(self, part: str, what: str, value: Array, context: Context) -> None:
        """Raise a SimulationError that names what is wrong with a value like a state, if any is.

        Args:
            part: Method that has returned the value.
            what: What its parts are, before their names.
            value: The value.
            context: Context of this system.
        """
        if complaint := flaw(value, self._state_shape):
            raise self._error(part, f": must return {complaint}", context.get_time())
        if is_finite(value):
            return
        parts = self.reading.state.parts.items()
        bad = [name for name, (at, _) in parts if not np.isfinite(value[at]).all()]
        unsound = [n for n, array in self.signals(context).items() if not np.isfinite(array).all()]
        cause = f"; neither are the inputs {', '.join(unsound)}" if unsound else ""
        what = f": {what}{', '.join(bad)} is no longer finite{cause}"
        raise self._error(part, what, context.get_time())


class SampledController(Controller):
    """A controller that runs a law once every ``period``.

    Between samples the commanded velocity is held, or follows the law's ramp.

    All updates at a time see what was before it; so the state after the sample is a further output
    port, ``next_state``, which depends on the inputs.

    Args:
        law: The law.
        period: Sampling period [s].
        seed: Seed of the law's random initial state.
        safety: What is kept of the law's command; None to take it as it is.
        wrapper: What comes between the law's reading and its loop: `JointLocks`, which the law is
            told of, or the differential drive of a base; None for nothing.
        tunable: Whether `set_reading` may give the law other gains while it runs. The reading is
            then a parameter of the context, which is looked up at every sample.
        leads: Whether the port ``next_state`` is connected, and so read at every sample; else it is
            computed anew whenever it is asked for.
        compiled: Whether the law's steps are compiled: to C where a C compiler is found, else by
            JAX. They differ from those of NumPy by rounding.

    Attributes:
        compiled: Whether they are.

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, nothing can be kept of its
            command, or it cannot be compiled.
        SimulationError: During a simulation, if the state is no longer finite.
    """

    reading: SampledReading
    period: float

    @old_arguments(locks="wrapper")
    def __init__(
        self,
        law: Law,
        period: float,
        seed: int = 0,
        safety: Safety | None = None,
        wrapper: ReadingWrapper | None = None,
        *,
        tunable: bool = False,
        leads: bool = False,
        compiled: bool = False,
    ) -> None:
        require_type("law", law, Law)
        require_type("tunable", tunable, bool)
        require_type("leads", leads, bool)
        require_type("compiled", compiled, bool)
        if compiled and tunable:
            raise InvalidInputError(
                "compiled: must be left out with tunable; gains are compiled in"
            )
        if not is_number(period) or period <= 0.0:
            raise InvalidInputError(f"period: must be a positive time [s], not {short(period)}")
        with _in_words_of_diagrams():
            reading = _read_sampled(law, period, safety, wrapper)
        super().__init__(law, reading, seed)
        self.period = period
        self.safety, self.wrapper = safety, wrapper
        self._parameter: int | None = None
        if tunable:
            self._parameter = self.DeclareAbstractParameter(
                AbstractValue.Make(_ReadingValue(reading))
            )
        self.compiled = compiled
        self._step: Any = law_step(reading, period) if compiled else without_checks(reading.step)
        state = self.DeclareDiscreteState(np.full(reading.state.size, np.nan))
        self._read_state: Any = self.DeclareStateOutputPort("state", state).Eval
        self._command_part: slice | None = (
            reading.state.parts["v"][0] if reading.holds_command else None
        )
        if self._command_part is None:
            self._declare_command({self.xd_ticket(), self.all_parameters_ticket()})
        else:
            # A held command is kept beside the state that it is a part of, so that Drake hands it
            # on without a call of Python. Until the state is initialized the arm is at rest.
            command = self.DeclareDiscreteState(np.zeros(self._command_shape))
            self.DeclareStateOutputPort("commanded_velocity", command)
        self._declare_parts(self.xd_ticket())
        # A step in C takes what ports say without a dictionary of signals.
        self._of_ports: Callable[[Context], Array] | None = None
        if isinstance(self._step, NativeLaw):
            self._of_ports = self._step.of_ports(self._read_state, self._readers)
        port = self.DeclareVectorOutputPort("next_state", reading.state.size, self._calc_next)
        self._read_next: Any = port.Eval if leads else None
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def step_of(self, context: Context) -> Callable[..., Array]:
        """Return the function that makes the steps, as `SampledReading.step`, without checks."""
        step: Callable[..., Array] = self._step
        return step if self._parameter is None else self._value_in(context).step

    def read(self, law: Law) -> SampledReading:
        """Return the reading of a law that can take the place of this one's.

        Raises:
            InvalidInputError: If it cannot be sampled at this period, or has another state or other
                inputs.
        """
        reading = _read_sampled(law, self.period, self.safety, self.wrapper)
        mine, other = self.reading, reading
        if (mine.state.parts, mine.inputs.parts) != (other.state.parts, other.inputs.parts):
            raise InvalidInputError(
                f"{type(law).__name__}: must have the state and the inputs of the law that runs"
            )
        return reading

    def set_reading(self, context: Context, reading: SampledReading) -> None:
        """Run another reading from the next sample on, one that `read` has returned.

        Raises:
            InvalidInputError: If the controller is not ``tunable``.
        """
        if self._parameter is None:
            raise InvalidInputError(
                f"{self.get_name()}: its law cannot be replaced; give SampledController "
                "tunable: True"
            )
        value = AbstractValue.Make(_ReadingValue(reading))
        context.get_mutable_abstract_parameter(self._parameter).SetFrom(value)

    def reading_in(self, context: Context) -> SampledReading:
        """Return the reading that runs."""
        return self.reading if self._parameter is None else self._value_in(context).reading

    def _value_in(self, context: Context) -> _ReadingValue:
        value: _ReadingValue = context.get_abstract_parameter(self._parameter).get_value()
        return value

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`; a sampled law has none."""
        raise InvalidInputError(
            self._no_autodiff(
                "a sampled law has no continuous state; give a ContinuousController a law that is "
                "a differential equation"
            )
        )

    def _state(self, context: Context) -> Array:
        return self._read_state(context)

    def _write_state(self, context: Context, x: Array) -> None:
        self._write(context.get_mutable_discrete_state(), x)

    def _write(self, state: DiscreteValues, x: Array) -> None:
        """Write the state and what is kept of it."""
        state.set_value(0, x)
        if self._command_part is not None:
            state.set_value(1, x[self._command_part])

    def _initialize(self, context: Context, state: DiscreteValues) -> None:
        self._write(state, self.try_law(context))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        read = self._read_next
        self._write(state, self._next(context) if read is None else read(context))

    def _calc_next(self, context: Context, output: Any) -> None:
        """Set the law's state after the sample that is due; NaN until it is initialized."""
        x = self._read_state(context)
        output.set_value(x if x[0] != x[0] else self._next(context))

    def _next(self, context: Context) -> Array:
        """Return the law's state after the sample that is due."""
        step = self._of_ports or self._of_signals
        x = step(context)
        if not is_sound(x, self._state_shape):
            self._require_sound("step", "", x, context)
        return np.asarray(x)

    def _of_signals(self, context: Context) -> Array:
        """Return the same, by the function that makes the steps; it is not checked."""
        # A copy, so that a law that modifies its arguments cannot change the context.
        x = self._read_state(context)
        t, u = context.get_time(), self.signals(context)
        step = self.step_of(context)
        try:
            return step(t, x, u, self.period)
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise self._error("step", f" raised {describe(error)}", t) from error


@dataclass(frozen=True, eq=False)
class _ReadingValue:
    """A reading, which never changes and so is shared by contexts that are copied."""

    reading: SampledReading

    @cached_property
    def step(self) -> Any:
        return without_checks(self.reading.step)

    def __copy__(self) -> _ReadingValue:
        return self

    def __deepcopy__(self, memo: Any) -> _ReadingValue:
        return self


def _read_sampled(
    law: Law, period: float, safety: Safety | None, wrapper: ReadingWrapper | None
) -> SampledReading:
    """Return the reading of a law that a clock steps, with ``safety`` and a wrapper around it.

    Raises:
        InvalidInputError: If there is none at this period, or nothing can be kept of its command.
    """
    reading = sampled_reading(law, period)
    if reading.integration_scheme not in GetIntegrationSchemes():
        raise InvalidInputError(
            f"{type(reading).__name__}.integration_scheme: must be one of Drake's, not "
            f"{reading.integration_scheme!r}; "
            + nearest(reading.integration_scheme, GetIntegrationSchemes())
        )
    require_type("safety", safety, Safety, NoneType)
    require_type("wrapper", wrapper, ReadingWrapper, NoneType)
    reading = reading if safety is None else safety.around(reading, period)
    return reading if wrapper is None else wrapper.around(reading)


class ContinuousController(Controller):
    """A controller that runs a law as a differential equation integrated by Drake.

    Args:
        law: The law.
        seed: Seed of the law's random initial state.

    Raises:
        InvalidInputError: If the law is not a differential equation.
        SimulationError: During a simulation, if a derivative is not finite; Drake's
            error-controlled integrators would otherwise shorten their step forever.
    """

    reading: ContinuousReading

    def __init__(self, law: Law, seed: int = 0) -> None:
        require_type("law", law, Law)
        with _in_words_of_diagrams():
            reading = continuous_reading(law)
        super().__init__(law, reading, seed)
        self._derivatives = without_checks(reading.derivatives)
        state = self.DeclareContinuousState(BasicVector(np.full(reading.state.size, np.nan)))
        self.DeclareStateOutputPort("state", state)
        self._declare_command({self.xc_ticket()})
        self._declare_parts(self.xc_ticket())
        self.DeclareInitializationUnrestrictedUpdateEvent(self._initialize)

    def _state(self, context: Context) -> Array:
        return context.get_continuous_state_vector().CopyToVector()

    def _write_state(self, context: Context, x: Array) -> None:
        context.SetContinuousState(x)

    def _initialize(self, context: Context, state: State) -> None:
        state.get_mutable_continuous_state().SetFromVector(self.try_law(context))

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """See `Block.autodiff_functions`."""
        law = _AutoDiffLaw(self.get_name(), self.reading, inputs)
        state, observables = self.reading.state.parts, self.reading.observables.parts
        outputs: dict[str, Calc] = {"state": law.state, "commanded_velocity": law.command}
        outputs |= {name: partial(law.part, at=at) for name, (at, _) in state.items()}
        outputs |= {name: partial(law.observable, name=name) for name in observables}
        return AutoDiffFunctions(outputs, law.rates)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: Any) -> None:
        """Set the time derivatives of the law's state; Drake calls this."""
        x, t, u = self._state(context), context.get_time(), self.signals(context)
        try:
            rates = self._derivatives(t, x, u)
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise self._error("derivatives", f" raised {describe(error)}", t) from error
        if not is_sound(rates, self._state_shape):
            self._require_sound("derivatives", "the rate of ", rates, context)
        derivatives.SetFromVector(rates)


class _AutoDiffLaw:
    """A reading that is evaluated with numbers of AutoDiffXd.

    Args:
        name: Name of the controller.
        reading: The reading.
        inputs: What reads the input ports of the controller's twin, by name.
    """

    def __init__(self, name: str, reading: ContinuousReading, inputs: Mapping[str, Calc]) -> None:
        self._name, self._reading, self._inputs = name, reading, inputs
        self._derivatives = without_checks(reading.derivatives)
        self._at_rest = np.zeros(reading.state.parts["v"][1])

    def state(self, context: Context) -> Array:
        """Return the state, shape (state.size,)."""
        return context.get_continuous_state_vector().CopyToVector()

    def part(self, context: Context, at: slice) -> Array:
        """Return a part of the state."""
        return self.state(context)[at]

    def command(self, context: Context) -> Array:
        """Return the commanded velocity, zero until the state is initialized."""
        x = self.state(context)
        if np.isnan(values_of(x)).any():
            return self._at_rest
        reading = self._reading
        return self._call("commanded_velocity", reading.commanded_velocity, context, x)

    def observable(self, context: Context, name: str) -> Array:
        """Return an observable."""

        def observe(t: Any, x: Array, u: Signals) -> Array:
            return self._reading.diagnostics(t, x, u)[name]

        return self._call("diagnostics", observe, context, self.state(context), self._u(context))

    def rates(self, context: Context) -> Array:
        """Return the time derivative of the state, shape (state.size,)."""
        x = self.state(context)
        if np.isnan(values_of(x)).any():
            t = context.get_time().value()
            raise SimulationError(
                f"{self._name}: its state is not set; initialize a Simulator with the context, or "
                "call set_state, before the diagram is linearised",
                t,
            )
        return self._call("derivatives", self._derivatives, context, x, self._u(context))

    def _u(self, context: Context) -> dict[str, Array]:
        """Return the law's input signals, by name."""
        shapes = self._reading.inputs.parts
        return {
            name: autodiff_array(read(context).reshape(shapes[name][1]))
            for name, read in self._inputs.items()
        }

    def _call(
        self, part: str, function: Callable[..., Any], context: Context, x: Array, *u: Signals
    ) -> Array:
        """Return what a part of the law returns, flat; a SimulationError unless it is finite."""
        time = context.get_time()
        t = autodiff_array(time) if varies(time) else time.value()
        place = f"{self._name}: {type(self._reading).__name__}.{part}"
        try:
            value = autodiff(function(t, autodiff_array(x), *u))
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise SimulationError(
                f"{place}: cannot be computed with numbers of AutoDiffXd: it raised "
                f"{describe(error)}",
                time.value(),
            ) from error
        if not all(np.isfinite(number.value()) for number in value):
            raise SimulationError(f"{place}: must be finite", time.value())
        if not all(np.isfinite(number.derivatives()).all() for number in value):
            raise SimulationError(
                f"{place}: its derivatives are not finite, as those of a norm at zero are not",
                time.value(),
            )
        return value
