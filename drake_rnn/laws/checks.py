"""What a law declares and returns, checked, with errors that name the law and the part.

- A trial of a law at its start, so that what it returns is checked before it moves an arm.
- One law with the numbers of many, so that one call serves robots with gains of their own.
- Numbers that are given with each call, so that one build serves scenes with other obstacles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from types import MappingProxyType, MethodType, NoneType
from typing import Any, Literal, TypeVar

import numpy as np

from ..arrays.algebra import AnyArray, functions_of
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.kinds import at, describe, naming
from ..inputs.messages import fields_of, is_number, require_type, short
from ..inputs.messages import replace_unchecked as unchecked_of_messages
from ..robot.clearance import Clearance
from ..robot.limits import LIMIT_UNITS, JointLimits
from ..signals import RESERVED_NAMES
from .call_checks import FLOAT, require_many, without_checks
from .law import ContinuousReading, JointPreview, Law, Layout, Reading, SampledReading, Signals

_R = TypeVar("_R", bound=Reading)
_Flaws = Callable[[Any, Reading], Iterator[str]]


def _of_state(state: Layout, reading: Reading) -> Iterator[str]:
    if "v" not in state:
        parts = ", ".join(state.parts) or "no parts"
        yield f": must have the part v, the joint velocities that it commands; it has {parts}"
    elif len(shape := state.parts["v"][1]) != 1:
        yield f": its part v must have the shape (joints,), not {shape}"
    yield from (_NAME_CLASH.format(part) for part in state.parts if part in RESERVED_NAMES)


def _of_inputs(inputs: Layout, reading: Reading) -> Iterator[str]:
    (joints,) = reading.state.parts["v"][1]
    for part in inputs.parts.keys() & {"J", "J_omega"}:
        (_, shape) = inputs.parts[part]
        if shape[1:] != (joints,):
            yield (
                f": {part} must have one column for each of {joints} joints, shape "
                f"(rows, {joints}), not {shape}"
            )


def _of_observables(observables: Layout, reading: Reading) -> Iterator[str]:
    not_allowed = RESERVED_NAMES | reading.state.parts.keys()
    return (_NAME_CLASH.format(part) for part in observables.parts if part in not_allowed)


def _of_gains(gains: Mapping[str, Any], law: Reading) -> Iterator[str]:
    text = "[{!r}]: must be a number of at least 0, not {}".format
    return (text(k, short(g)) for k, g in gains.items() if not (is_number(g) and g >= 0.0))


def _of_keeps(names: tuple[object, ...], law: Reading) -> Iterator[str]:
    text = f": may name {', '.join(LIMIT_UNITS)}, not {{}}".format
    return (text(short(name)) for name in names if name not in LIMIT_UNITS)


def _fine(value: object, law: Reading) -> Iterator[str]:
    return iter(())


_NAME_CLASH = ": {!r} is the name of another recorded signal"
#: What laws declare: whether every `Reading` does or a `Law` alone, the member's name, its value of
#: a law, the classes that this may be of, and what tells the ends of messages about what else is
#: wrong with it. Later members may rely on earlier ones.
_DECLARATIONS: tuple[tuple[type, str, Callable[[Any], Any], tuple[type, ...], _Flaws], ...] = (
    (Reading, "state", lambda law: law.state, (Layout,), _of_state),
    (Reading, "inputs", lambda law: law.inputs, (Layout,), _of_inputs),
    (Reading, "observables", lambda law: law.observables, (Layout,), _of_observables),
    (Reading, "takes_many", lambda law: law.takes_many, (bool,), _fine),
    (Reading, "integration_scheme", lambda law: law.integration_scheme, (str,), _fine),
    (Law, "loop_gains", lambda law: law.loop_gains, (Mapping,), _of_gains),
    (Law, "sampled_gains", lambda law: law.sampled_gains, (Mapping,), _of_gains),
    (Law, "joint_preview", lambda law: law.joint_preview, (JointPreview, NoneType), _fine),
    (Law, "keeps", lambda law: law.keeps, (tuple,), _of_keeps),
    (Law, "keeps_distance", lambda law: law.keeps_distance, (float, NoneType), _fine),
    (Law, "keeps_torque", lambda law: law.keeps_torque, (tuple, NoneType), _fine),
    (Law, "stays_on_path", lambda law: law.stays_on_path, (bool,), _fine),
    (Law, "follows_joint_targets", lambda law: law.follows_joint_targets, (bool,), _fine),
    (Law, "levels_are_derivatives", lambda law: law.levels_are_derivatives, (bool,), _fine),
    (Law, "limits_remedy", lambda law: law.limits_remedy, (str,), _fine),
)


def check_declared(reading: Reading) -> None:
    """Raise an InvalidInputError if what a law or a reading declares is not what it may be."""
    for declares, name, read, kinds, flaws in _DECLARATIONS:
        if not isinstance(reading, declares):
            continue
        place = f"{_class(reading)}.{name}"
        with naming(place):
            value = read(reading)
            if isinstance(value, MethodType):
                raise InvalidInputError(f"{place}: is a method; decorate it with @property")
            require_type(place, value, *kinds)
            for complaint in flaws(value, reading):
                raise InvalidInputError(f"{place}{complaint}")


def sampled_reading(law: Law, period: float) -> SampledReading:
    """Return the law's reading at a fixed period, with all that it declares checked.

    Args:
        law: The law.
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or declares what is wrong.
    """
    return _reading(law, "sampled", lambda: law.sampled(period), SampledReading)


def continuous_reading(law: Law) -> ContinuousReading:
    """Return the reading of a law that Drake integrates, with all that it declares checked.

    Args:
        law: The law.

    Raises:
        InvalidInputError: If the law is not a differential equation, or declares what is wrong.
    """
    return _reading(law, "continuous", law.continuous, ContinuousReading)


def _reading(law: Law, part: str, read: Callable[[], _R], kind: type) -> _R:
    check_declared(law)
    limits = fields_of(law).get("limits")
    if isinstance(limits, JointLimits) and not law.keeps_each_direction:
        limits.require_one_bound(f"the law {_class(law)}")
    with naming(f"{_class(law)}.{part}"):
        reading = read()
    require_type(f"{_class(law)}.{part}()", reading, kind)
    if reading is not law:
        check_declared(reading)
    return reading


def warnings_of(
    reading: Reading, part: Literal["doubts", "caveats"], tell: Callable[[], object]
) -> list[str]:
    """Return the warnings of a law before a run, or of its reading after one.

    Args:
        reading: The law, or its reading.
        part: Its method that tells them.
        tell: Calls this method.

    Raises:
        InvalidInputError: If the law cannot run so, or returns something else.
    """
    place = f"{_class(reading)}.{part}"
    with naming(place):
        value = tell()
    if isinstance(value, list) and all(isinstance(text, str) for text in value):
        return value
    raise InvalidInputError(f"{place}: must return a list of texts, not {short(value)}")


def flaw(value: object, shape: tuple[int, ...]) -> str:
    """Return what a value must be, and what it is; an empty text if it is what it must be.

    Args:
        value: What the law has returned.
        shape: Shape that it must have.
    """
    expectation = f"a NumPy array of floats, shape {shape}"
    if not isinstance(value, np.ndarray):
        return f"{expectation}, not {'None' if value is None else 'a ' + type(value).__name__}"
    if value.shape != shape:
        return f"{expectation}, not {value.shape}"
    if value.dtype != FLOAT:
        return f"{expectation}, not of {value.dtype}"
    return "" if type(value) is np.ndarray else f"{expectation}, not a {type(value).__name__}"


def is_finite(value: Array) -> bool:
    """Return whether all entries of an array are finite, however large their sum."""
    return bool(np.isfinite(value).all())


def observables_of(reading: Reading, t: float | Array, x: Array, u: Signals) -> Signals:
    """Return the law's observables by name, checked, of one instant or of many.

    Args:
        reading: Reading of the law.
        t: Time, a number or shape (k,) [s].
        x: State, shape (size,) or (k, size).
        u: Signals; of many instants with a leading dimension of k.

    Raises:
        InvalidInputError: If the law fails, or returns other names or shapes than it declares.
    """
    place, lead = f"{_class(reading)}.diagnostics", x.shape[:-1]
    many = f" for {lead[0]} instants at once" if lead else ""
    with naming(f"{place}{many}"):
        observables = reading.diagnostics(t, x, u)
    if not isinstance(observables, Mapping):
        raise InvalidInputError(
            f"{place}: must return a mapping of names to arrays, not {short(observables)}"
        )
    parts = reading.observables.parts
    if observables.keys() != parts.keys():
        raise InvalidInputError(
            f"{place}: must return its observables, {', '.join(parts) or 'none'}; it returns "
            f"{', '.join(map(str, observables)) or 'none'}"
        )
    for name, (_, shape) in parts.items():
        value = observables[name]
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            raise InvalidInputError(
                f"{place}: {name} must be an array of numbers, not {short(value)}"
            )
        if value.shape != lead + shape:
            raise InvalidInputError(
                f"{place}: {name} must have the shape {lead + shape}{many}, not {value.shape}"
            )
    return observables


def _class(law: object) -> str:
    return type(law).__name__


_Call = Callable[[float, Array, Signals], Array]
# What a controller calls: its name, the shape of the result, and the function.
_Part = tuple[str, tuple[int, ...], _Call]
# Largest relative difference between a robot's result alone and among others: sums are added in
# another order, and a network's equations enlarge rounding by a million.
_ROUNDING = 1e-6
# Period of a trial before the law is to run [s].
_PERIOD = 1e-3


def start(reading: Reading, rng: np.random.Generator, u: Signals, t: float) -> Array:
    """Return the law's initial state, shape (state.size,), checked.

    Args:
        reading: Reading of the law.
        rng: Random generator with the experiment's seed.
        u: Signals at the start.
        t: Time of the start [s].

    Raises:
        InvalidInputError: If the law fails, or returns something else than a finite state.
    """
    place = f"{type(reading).__name__}.initial_state"
    with naming(place, t):
        x = reading.initial_state(rng, u)
    _require_array(place, x, (reading.state.size,), t)
    return x


def try_reading(
    reading: Reading, t: float, x: Array, u: Mapping[str, Array], period: float | None
) -> None:
    """Call each part of a law, with arrays that it cannot modify, and check the results.

    A law that `takes_many` robots is called with two as well, alike, which must get what one gets.
    Without finite signals there is nothing to try: the run itself will name the one that is not.

    Args:
        reading: Reading of the law.
        t: Time [s].
        x: State, shape (state.size,).
        u: Signals by name.
        period: Sampling period [s]; None for a law that Drake integrates.

    Raises:
        InvalidInputError: If the law fails, modifies its arguments, or returns what is wrong; the
            message names the law, the part and the time.
    """
    if not all(np.isfinite(value).all() for value in (x, *u.values())):
        return
    one, two = _read_only(x, u), _read_only(x, u, 2)
    for part in _calls(reading, period):
        value = _check(part, t, *one)
        if reading.takes_many:
            _require_both(part[0], [value, value], part[2], t, two)
    observables_of(reading, t, *one)
    # Recorded runs are computed in one call for all instants.
    observables_of(reading, np.array([t, t]), *two)


def try_pair(pair: Sequence[Reading], together: Reading) -> None:
    """Try two readings side by side with made-up signals, before a batch begins.

    Args:
        pair: Both readings, each of one robot.
        together: One reading with the numbers of both.

    Raises:
        InvalidInputError: If the robots do not get side by side what each gets alone; the message
            names the law, the part and the shapes. An error of a robot alone, with signals that no
            arm has, is left to the run.
    """
    rng = np.random.default_rng(0)
    try:
        with np.errstate(all="ignore"):
            each = [_made_up(reading, rng) for reading in pair]
            parts = zip(*(_calls(reading, _PERIOD) for reading in pair), strict=True)
            alone = [
                [_check(part, 0.0, *value) for part, value in zip(both, each, strict=True)]
                for both in parts
            ]
    except InvalidInputError:
        return
    x = np.stack([state for state, _ in each])
    u = {name: np.stack([signals[name] for _, signals in each]) for name in together.inputs.parts}
    two = _read_only(x, u)
    for (place, _, call), values in zip(_calls(together, _PERIOD), alone, strict=True):
        with np.errstate(all="ignore"):
            _require_both(place, values, call, 0.0, two)


def _made_up(reading: Reading, rng: np.random.Generator) -> tuple[Array, Signals]:
    """Return a state and signals of the size of an arm's; rotations and inertias are identities."""

    def likely(name: str, shape: tuple[int, ...]) -> Array:
        return np.eye(shape[0]) if name == "M" or name[:2] == "R_" else rng.uniform(0.1, 0.5, shape)

    u = {name: likely(name, shape) for name, (_, shape) in reading.inputs.parts.items()}
    # The initial state may depend on a J that the law cannot see.
    J = likely("J", (3, *reading.state.parts["v"][1]))
    return _read_only(start(reading, rng, {"J": J, **u}, 0.0), u)


def _calls(reading: Reading, period: float | None) -> Iterator[_Part]:
    """Yield what a controller calls: name, shape of the result, and function."""
    name, size = type(reading).__name__, reading.state.size
    (_, v_shape) = reading.state.parts["v"]
    yield f"{name}.commanded_velocity", v_shape, lambda t, x, u: reading.commanded_velocity(t, x)
    if isinstance(reading, SampledReading) and period is not None:
        step = without_checks(reading.step)
        yield f"{name}.step", (size,), lambda t, x, u: step(t, x, u, period)
    elif isinstance(reading, ContinuousReading):
        yield f"{name}.derivatives", (size,), without_checks(reading.derivatives)


def _check(part: _Part, t: float, x: Array, u: Signals) -> Array:
    """Return what a part of a law returns to one robot, checked."""
    place, shape, call = part
    with naming(place, t):
        value = call(t, x, u)
    _require_array(place, value, shape, t)
    return value


def _require_array(place: str, value: Array, shape: tuple[int, ...], t: float) -> None:
    if complaint := flaw(value, shape):
        raise InvalidInputError(f"{place}: must return {complaint}{at(t)}")
    if not is_finite(value):
        raise InvalidInputError(
            f"{place}: must return finite numbers, not {np.round(value, 4).tolist()}{at(t)}"
        )


def _require_both(
    place: str, alone: Sequence[Array], call: _Call, t: float, two: tuple[Array, Signals]
) -> None:
    """Raise an InvalidInputError unless each of two robots gets what it gets alone."""
    x, u = two
    cause, expected_stack = None, np.stack(alone)
    try:
        both = call(t, x, u)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        cause, complaint = error, f"raised {describe(error)}"
    else:
        scale = _ROUNDING * (1.0 + np.abs(expected_stack).max(initial=0.0))
        if complaint := flaw(both, expected_stack.shape):
            complaint = f"must return {complaint}"
        elif not np.allclose(both, expected_stack, rtol=0.0, atol=scale):
            complaint = (
                f"must return {short(expected_stack)}, what each gets alone, not {short(both)}"
            )
    if complaint:
        shapes = ", ".join(f"{name} {value.shape}" for name, value in {"x": x, **u}.items())
        raise InvalidInputError(
            f"{place}: called with two robots, as takes_many allows, {complaint}{at(t)}; arguments "
            f"were {shapes}"
        ) from cause


class _LawSignals(dict[str, Array]):
    """Signals that a law sees; asking for another one is told in full."""

    def __missing__(self, name: str) -> Array:
        raise KeyError(f"{name} is not among its inputs, {', '.join(self) or 'none'}")


def _read_only(x: Array, u: Signals, *robots: int) -> tuple[Array, Signals]:
    """Return a state and signals that cannot be modified, the same for a number of robots."""
    signals = {name: np.broadcast_to(value, (*robots, *value.shape)) for name, value in u.items()}
    return np.broadcast_to(x, (*robots, *x.shape)), MappingProxyType(_LawSignals(signals))


def stack(readings: Sequence[_R]) -> _R:
    """Return a reading with the numbers of many, for states with one leading axis.

    Numbers that differ have shape (count, 1), vectors that differ shape (count, n); what all have
    in common stays as it is. Options, sizes and what is given or not are the same for all.

    Args:
        readings: Readings of laws of one class, e.g. ``law.sampled(period)`` of each, which has
            checked them.

    Raises:
        InvalidInputError: If there are none, they differ in more than numbers, or are of a law
            that runs one robot at a time; or if two of them, tried side by side, do not get what
            each gets alone.
    """
    if not len(readings):
        raise InvalidInputError("laws: must be given")
    first = readings[0]
    require_many(first)
    differing: set[int] = set()
    together: _R = _stack_field("", list(readings), differing)
    for other in sorted(differing) or [0]:
        pair = [first, readings[other]]
        try_pair(pair, _stack_field("", pair, set()))
    return together


def with_gains(reading: _R, gains: Mapping[str, Any]) -> _R:
    """Return a reading with other numbers, which nothing checks: e.g. traced by JAX, or of many.

    Args:
        reading: Reading of a law.
        gains: Numbers, or arrays with an entry for each robot, shape (...), by field of the law,
            e.g. ``kappa``, ``warm_up.rho`` or ``secondary.objectives.0.weight``. Vectors have
            shape (..., n): ``limits.velocity``.

    Raises:
        InvalidInputError: If the law has no such number, or runs one robot at a time.
    """
    require_many(reading)
    for path, value in gains.items():
        reading = _replace(reading, path, path, value)
    return reading


def _equal(one: Any, other: Any) -> bool:
    """Return whether two values of one type are equal; arrays may have different shapes."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    return not np.any(np.asarray(one != other))


def _stack_field(path: str, values: list[Any], differing: set[int]) -> Any:
    """Return values of a field together; of each that differs add a robot with another number."""
    first = values[0]
    kinds = {type(value) for value in values}
    if all(isinstance(value, float) for value in values):
        others = [robot for robot, value in enumerate(values) if value != first]
        differing.update(others[:1])
        return np.array(values)[:, np.newaxis] if others else first
    if kinds == {np.ndarray} and len({value.shape for value in values}) == 1:
        together = np.stack(values)
        others = np.flatnonzero((together != first).reshape(len(values), -1).any(axis=1)).tolist()
        differing.update(others[:1])
        return together if others else first
    if kinds == {Clearance} and len({value.structure for value in values}) == 1:
        return _stack_clearances(path, values, differing)
    if len(kinds) == 1 and fields_of(first) and kinds != {Clearance}:
        parts = {
            name: _stack_field(
                f"{path}.{name}".lstrip("."), [fields_of(v)[name] for v in values], differing
            )
            for name in fields_of(first)
        }
        return unchecked_of_messages(first, **parts)
    if (
        kinds == {tuple}
        and len({len(value) for value in values}) == 1
        and all(map(fields_of, first))
    ):
        return tuple(
            _stack_field(f"{path}[{number}]", list(each), differing)
            for number, each in enumerate(zip(*values, strict=True))
        )
    for number, value in enumerate(values):
        if type(value) is not type(first) or not _equal(value, first):
            raise InvalidInputError(
                f"laws[{number}]{'.' * bool(path)}{path}: must be as in laws[0], {short(first)}, "
                f"not {short(value)}; only numbers may differ"
            )
    return first


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers of a reading that are given beside its signals, so that one build serves many.

    These are all numbers of obstacles and where arms beside each other stand, with them the posture
    that a law calls ``home``, and others in which given readings differ.

    Attributes:
        reading: The reading.
        shapes: Shape of each for one robot, by where it is, see `with_gains`.
        of_start: Whether ``home`` is one of them where there are no obstacles either.
    """

    reading: SampledReading
    shapes: Mapping[str, tuple[int, ...]]
    of_start: bool = False

    @classmethod
    def of(cls, readings: Sequence[SampledReading], *, of_start: bool = False) -> Numbers:
        """Return those of readings that `stack` takes."""
        first, *others = (dict(_leaves("", reading)) for reading in readings)
        of_scene = {
            place
            for place, value in first.items()
            if (".solids." in place or place.endswith(_BASES)) and value.size
        }
        if of_scene or of_start:
            of_scene |= {place for place in first if place.rpartition(".")[2] == "home"}
        shapes = {
            place: np.shape(value)
            for place, value in first.items()
            if place in of_scene or any(np.any(each[place] != value) for each in others)
        }
        return cls(readings[0], shapes, of_start)

    def serve(self, reading: SampledReading) -> bool:
        """Return whether a reading differs in these numbers alone."""
        both = [self.reading, reading]
        try:
            _stack_field("", both, set())
        except InvalidInputError:
            return False
        return Numbers.of(both, of_start=self.of_start).shapes == self.shapes

    @property
    def places(self) -> dict[str, slice]:
        """Where each of them lies in their array."""
        ends = np.cumsum([0, *map(prod, self.shapes.values())]).tolist()
        return dict(zip(self.shapes, map(slice, ends, ends[1:]), strict=True))

    @property
    def size(self) -> int:
        """How many there are."""
        return sum(map(prod, self.shapes.values()))

    def of_reading(self, reading: SampledReading) -> Array:
        """Return those of a reading, shape (size,)."""
        values = dict(_leaves("", reading))
        return np.concatenate([np.zeros(0), *(np.ravel(values[place]) for place in self.shapes)])

    def within(self, numbers: AnyArray) -> SampledReading:
        """Return the reading with other ones, shape (..., size), as `stack` returns readings."""
        reading = self.reading
        for place, part in self.places.items():
            value, shape = numbers[..., part], self.shapes[place]
            if shape:
                value = functions_of(value).reshape(value, (*value.shape[:-1], *shape))
            reading = _replace(reading, place, place, value if shape else value[..., 0])
        return reading


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield where numbers are within an object, and the numbers; of pairs, see `Numbers`."""
    if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype == FLOAT):
        yield path, value
    parts = fields_of(value)
    if isinstance(value, tuple) and all(map(fields_of, value)):
        parts = {str(number): part for number, part in enumerate(value)}
    if isinstance(value, Clearance):
        parts = {"solids": value.solids, _BASES: value.arm.poses.bases}
    for name, part in parts.items():
        yield from _leaves(f"{path}.{name}".lstrip("."), part)


# Where a clearance has the poses of the bases of arms beside each other.
_BASES = "arm.poses.bases"


def _stack_clearances(path: str, values: list[Clearance], differing: set[int]) -> Clearance:
    """Return the pairs of several scenes together, with the names of the first one."""
    first, names = values[0], values[0].solids.names
    if all(value is first or value.contents == first.contents for value in values):
        return first
    each = [unchecked_of_messages(value.solids, names=names) for value in values]
    solids = _stack_field(f"{path}.solids", each, differing)
    bases = _stack_field(f"{path}.{_BASES}", [value.arm.poses.bases for value in values], differing)
    poses = unchecked_of_messages(first.arm.poses, bases=bases)
    arm = unchecked_of_messages(first.arm, poses=poses)
    found: Clearance = unchecked_of_messages(first, solids=solids, arm=arm)
    return found


def _replace(owner: Any, path: str, whole: str, value: Any) -> Any:
    fields = fields_of(owner)
    name, _, rest = path.partition(".")
    if name not in fields and "law" in fields:
        return unchecked_of_messages(owner, law=_replace(fields["law"], path, whole, value))
    field = fields.get(name)
    if rest and fields_of(field):
        return unchecked_of_messages(owner, **{name: _replace(field, rest, whole, value)})
    number, _, inner = rest.partition(".")
    if inner and isinstance(field, tuple) and number.isdecimal() and int(number) < len(field):
        entries = list(field)
        entries[int(number)] = _replace(entries[int(number)], inner, whole, value)
        return unchecked_of_messages(owner, **{name: tuple(entries)})
    if rest or not isinstance(field, (float, np.ndarray)):
        raise InvalidInputError(f"law.{whole}: is no number of {type(owner).__name__}")
    if isinstance(field, float) and not isinstance(value, float):
        value = value[..., np.newaxis]
    return unchecked_of_messages(owner, **{name: value})
