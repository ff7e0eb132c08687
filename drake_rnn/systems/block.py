"""Systems in Python that are freed once nothing needs them, and diagrams that are freed at once.

A system may support Drake's scalar conversion: its twin has the same ports and the same continuous
state, of numbers with derivatives (AutoDiffXd), so that Drake linearises a diagram of such systems.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from threading import Lock
from typing import Any, ClassVar, NamedTuple
from weakref import proxy

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import (
    BasicVector_,
    Context,
    InputPort,
    LeafSystem,
    LeafSystem_,
    System,
)
from pydrake.systems.scalar_conversion import TemplateSystem

from ..errors import InvalidInputError, SimulationError
from ..signals import SIGNALS, Signal, View

# Attribute in which pydrake lets systems, ports, builders and diagrams keep each other alive.
_PEERS = "_pydrake_internal_ref_cycle_peers"
# Attribute of a diagram that is released, with its systems, which do not refer to it any more.
_SYSTEMS = "_systems"
# Attribute of a block with the functions that Drake calls.
_FUNCTIONS = "_functions"


try:

    class Collectable(type(LeafSystem)):  # type: ignore[misc]  # the metaclass of pydrake's classes
        """Metaclass of systems whose reference cycles Python's garbage collector finds.

        In Python 3.11 the collector counts the attributes of an instance twice if its class is
        derived from one of pydrake's and has a dictionary of its own, and so never frees it. With
        ``__slots__`` a class has none: attributes are kept in the dictionary of pydrake's class.
        """

        def __new__(
            mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any
        ) -> Any:
            """Return a class without a dictionary of its own."""
            namespace.setdefault("__slots__", ())
            return super().__new__(mcs, name, bases, namespace, **options)

except TypeError:
    # pydrake made with nanobind, for Python 3.12 and later: its metaclass has no subclasses, and
    # Python 3.12 counts attributes once.
    Collectable: Any = type(LeafSystem)  # type: ignore[no-redef]


#: Reads an input port or computes the numbers of an output port, given the context.
Calc = Callable[[Context], Any]


class AutoDiffFunctions(NamedTuple):
    """What computes the twin of a block in AutoDiffXd; results are arrays of any shape.

    Attributes:
        outputs: Functions of the context, by the name of the output port.
        rates: Function of the context that returns the time derivative of the continuous state;
            None for a block without one.
    """

    outputs: Mapping[str, Calc]
    rates: Calc | None = None


class Block(LeafSystem, metaclass=Collectable):
    """Base class of this package's systems.

    Drake holds the functions that it calls where Python's garbage collector does not see them. A
    function that refers to its own system, as a method or by one of the system's ports, would keep
    that system alive for ever. So whatever is declared of a block, the block holds its functions,
    and Drake a weak reference.

    A block converts to AutoDiffXd if its class overrides `autodiff_functions`.

    Attributes:
        role: What it does in a loop, for drawings of diagrams: ``reference``, ``law``, ``command``,
            ``model``, ``sensor``, ``noise`` or ``force``; empty for something else.
    """

    role: ClassVar[str] = ""

    def _construct(self, converter: Any = None) -> None:
        """Make the block; `pydrake.systems.scalar_conversion.TemplateSystem` calls this."""
        LeafSystem.__init__(self, converter=converter)

    def _construct_copy(self, other: AutoDiffBlock, converter: Any = None) -> None:
        """Refuse to convert a twin back; `TemplateSystem` calls this."""
        raise InvalidInputError(
            f"{other.get_name()}: cannot be converted from AutoDiffXd back to float; keep the "
            "diagram that it was converted from"
        )

    def autodiff_functions(self, inputs: Mapping[str, Calc]) -> AutoDiffFunctions:
        """Return what computes this block's outputs and rates in AutoDiffXd.

        The block itself should not be kept by these functions.

        Args:
            inputs: Functions that read the twin's input ports, by name.

        Raises:
            InvalidInputError: If this block does not convert.
        """
        raise InvalidInputError(
            self._no_autodiff("it changes at samples, or its derivatives are not known")
        )

    def _no_autodiff(self, reason: str) -> str:
        """Return the message that the block does not convert, for a reason."""
        return (
            f"{self.get_name()}: {type(self).__name__} cannot be converted to AutoDiffXd, so its "
            f"diagram cannot be linearised: {reason}"
        )

    def _for_drake(self, value: Any) -> Any:
        """Return what Drake may hold of a function; anything else as it is."""
        if not callable(value) or isinstance(value, type):
            return value
        self.__dict__.setdefault(_FUNCTIONS, []).append(value)
        function: Any = proxy(value)

        def call(*arguments: Any) -> Any:
            return function(*arguments)

        return call


class AutoDiffBlock(LeafSystem_[AutoDiffXd], metaclass=Collectable):
    """The twin of a block in AutoDiffXd: the same ports, continuous state and dependencies.

    Made by Drake's scalar conversion, as in ``diagram.ToAutoDiffXd()``.
    """

    _for_drake = Block._for_drake

    def _construct(self, converter: Any = None) -> None:
        """Refuse to make a twin of nothing; `TemplateSystem` calls this."""
        raise InvalidInputError("AutoDiffBlock: is made by converting a block, not by itself")

    def _construct_copy(self, other: Block, converter: Any = None) -> None:
        """Make the twin of a block; `TemplateSystem` calls this."""
        LeafSystem_[AutoDiffXd].__init__(self, converter=converter)
        inputs: dict[str, Calc] = {}
        for k in range(other.num_input_ports()):
            port = other.get_input_port(k)
            inputs[port.get_name()] = self.DeclareVectorInputPort(port.get_name(), port.size()).Eval
        size = other.num_continuous_states()
        if size:
            unset = np.array([AutoDiffXd(np.nan)] * size)
            self.DeclareContinuousState(BasicVector_[AutoDiffXd](unset))
        outputs, self._rates = other.autodiff_functions(inputs)
        always = {self.time_ticket()} | ({self.xc_ticket()} if size else set())
        for k in range(other.num_output_ports()):
            port = other.get_output_port(k)
            calc = _calc(outputs[port.get_name()])
            sources = (j for j in range(len(inputs)) if other.HasDirectFeedthrough(j, k))
            tickets = always | {self.get_input_port(j).ticket() for j in sources}
            self.DeclareVectorOutputPort(port.get_name(), port.size(), calc, tickets)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: Any) -> None:
        """Set the time derivatives of the state; Drake calls this."""
        if self._rates is not None:
            derivatives.SetFromVector(autodiff(self._rates(context)))


def _calc(function: Calc) -> Callable[[Context, Any], None]:
    """Return what computes an output port of a twin."""

    def calc(context: Context, output: Any) -> None:
        output.SetFromVector(autodiff(function(context)))

    return calc


def autodiff(values: Any) -> Any:
    """Return numbers as a flat array of AutoDiffXd; those without derivatives are constants."""
    flat = np.asarray(values, dtype=object).ravel()
    return np.array([x if isinstance(x, AutoDiffXd) else AutoDiffXd(float(x)) for x in flat])


def constant_time(context: Context, name: str) -> float:
    """Return the time of a twin's context [s] for what has no derivative by time.

    Args:
        context: Context of the twin.
        name: What has none, for the message.

    Raises:
        SimulationError: If the time has derivatives.
    """
    t = context.get_time()
    if varies(t):
        raise SimulationError(
            f"{name}: has no derivative by time; take derivatives by state and inputs alone",
            t.value(),
        )
    return float(t.value())


def varies(number: Any) -> bool:
    """Return whether a number of AutoDiffXd has derivatives other than zero."""
    return bool(number.derivatives().any())


def values_of(numbers: Any) -> Any:
    """Return the values of an array of AutoDiffXd, of the same shape."""
    return np.reshape([x.value() for x in autodiff(numbers)], np.shape(numbers))


class AutoDiffArray(np.ndarray):
    """An array of AutoDiffXd for laws, which take it as any array that is not a plain one of NumPy.

    NumPy's functions return such arrays, of shape () in place of a number; of ``numpy.linalg``
    there are ``solve``, ``inv``, ``pinv``, ``norm`` and the
    singular values of ``svd``. An entry that is a float is a constant.
    """

    # Above NumPy's own, whose products then are such arrays.
    __array_priority__ = 15.0

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: Any, *inputs: Any, out: Any = None, **options: Any
    ) -> Any:
        """Return what a function of NumPy returns, entry by entry."""
        if ufunc is np.isfinite:
            return np.isfinite(values_of(inputs[0]))
        plain = [_plain(each) if ufunc in _OPERATORS else _all_autodiff(each) for each in inputs]
        if out is not None:
            options["out"] = tuple(_plain(each) for each in out)
        return autodiff_array(super().__array_ufunc__(ufunc, method, *plain, **options))

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Return what another function of NumPy returns."""
        if func is np.linalg.solve:
            return _solution(*args, **kwargs)
        if func is np.linalg.inv:
            return _solution(args[0], np.eye(args[0].shape[-1]))
        if func is np.linalg.pinv:
            return _pseudoinverse(*args, **kwargs)
        if func is np.linalg.svd and not kwargs.get("compute_uv", True):
            return _singular_values(*args)
        return autodiff_array(super().__array_function__(func, types, args, kwargs))

    def __getitem__(self, key: Any) -> Any:
        """Return an entry, of shape (), or several."""
        return autodiff_array(super().__getitem__(key))

    def dot(self, other: Any, out: Any = None) -> Any:
        """Return the product with another array."""
        return autodiff_array(_plain(self).dot(_plain(other)))


#: Functions of NumPy that are operators of its entries, and take floats among them.
_OPERATORS = {
    *(np.add, np.subtract, np.multiply, np.divide, np.negative, np.positive, np.matmul),
    *(np.absolute, np.maximum, np.minimum, np.clip, np.sign),
    *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal),
    *(np.logical_and, np.logical_or, np.logical_not),
}


def autodiff_array(value: Any) -> Any:
    """Return a number or an array of AutoDiffXd as an array for laws; anything else as it is."""
    if isinstance(value, AutoDiffXd):
        value = np.array(value, dtype=object)
    if isinstance(value, np.ndarray):
        return value.view(AutoDiffArray) if value.dtype == object else value
    return [autodiff_array(each) for each in value] if isinstance(value, (list, tuple)) else value


def _plain(value: Any) -> Any:
    """Return an array for laws as one of NumPy's; anything else as it is."""
    return value.view(np.ndarray) if isinstance(value, AutoDiffArray) else value


def _all_autodiff(value: Any) -> Any:
    """Return an array for laws as one of NumPy's, without floats among its entries."""
    if not isinstance(value, AutoDiffArray):
        return value
    return autodiff(value).reshape(value.shape)


def _solution(A: Any, b: Any) -> Any:
    """Return x with A x = b, with its derivatives, of arrays as NumPy takes them."""
    A0 = values_of(A)
    x = np.linalg.solve(A0, values_of(b))
    # Of value zero, but for rounding; its derivatives are those of the solution.
    return x + np.linalg.inv(A0) @ (b - A @ x)


def _pseudoinverse(A: Any, *args: Any, **kwargs: Any) -> Any:
    """Return the pseudoinverse, with its derivatives where the rank is constant (Golub, 1973)."""
    A0 = values_of(A)
    P = np.linalg.pinv(A0, *args, **kwargs)
    # Of value zero.
    dA = A - A0
    outside, inside = np.eye(A0.shape[0]) - A0 @ P, np.eye(A0.shape[1]) - P @ A0
    return P - P @ dA @ P + P @ P.T @ dA.T @ outside + inside @ dA.T @ P.T @ P


def _singular_values(A: Any) -> Any:
    """Return the singular values, with their derivatives where they differ."""
    A0 = values_of(A)
    U, values, V_T = np.linalg.svd(A0, full_matrices=False)
    return values + np.einsum("ik,ij,kj->k", U, A - A0, V_T)


def _declaring(declare: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of a block that declares what one of Drake's does."""

    @wraps(declare)
    def declare_on(block: Any, *arguments: Any, **options: Any) -> Any:
        options = {name: block._for_drake(each) for name, each in options.items()}
        return declare(block, *map(block._for_drake, arguments), **options)

    return declare_on


for _base, _block in ((LeafSystem, Block), (LeafSystem_[AutoDiffXd], AutoDiffBlock)):
    for _name in dir(_base):
        if _name.startswith("Declare"):
            setattr(_block, _name, _declaring(getattr(_base, _name)))

#: Converts blocks to their twins.
# Without a scope, pydrake looks at all modules for this one, and so imports those that wait.
BLOCKS = TemplateSystem("Block_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
_INSTANTIATIONS: dict[Any, type[Block | AutoDiffBlock]] = {float: Block, AutoDiffXd: AutoDiffBlock}
_AT_WORK = Lock()


def _construct_first(self: Any, *arguments: Any, **options: Any) -> None:
    """Construct a block, maybe the first one: then Drake is told how blocks convert.

    That looks at all modules, a tenth of an import, and what makes no diagram does without it.
    """
    with _AT_WORK:
        for scalar, block in _INSTANTIATIONS.items():
            if vars(block).get("__init__") is _construct_first:
                delattr(block, "__init__")
                BLOCKS.add_instantiation(scalar, block, skip_rename=True)
    base: Any = Block if isinstance(self, Block) else AutoDiffBlock
    base.__init__(self, *arguments, **options)


for _block in _INSTANTIATIONS.values():
    setattr(_block, "__init__", _construct_first)  # noqa: B010  mypy forbids the assignment


def declare_signals(
    block: Block,
    view: View,
    names: Iterable[str],
    joints: tuple[InputPort, InputPort],
    lengths: Mapping[str, int],
) -> None:
    """Declare output ports of signals that follow from the joints, flattened.

    Args:
        block: The block.
        view: What the signals are computed with.
        names: Their names.
        joints: Input ports of the joint positions and velocities.
        lengths: Lengths of the axes of signals, by name.
    """
    # Evaluated at every sample: methods are bound once.
    read_q, read_v = (port.Eval for port in joints)
    tickets = {"q": joints[0].ticket(), "v": joints[1].ticket()}
    for signal in (SIGNALS[name] for name in names):
        calc = _of_joints(view, signal, read_q, read_v if "v" in signal.causes else None)
        causes = {tickets[cause] for cause in sorted(signal.causes)}
        block.DeclareVectorOutputPort(signal.name, signal.size(**lengths), calc, causes)


def autodiff_signals(
    view: View, names: Iterable[str], inputs: Mapping[str, Calc]
) -> AutoDiffFunctions:
    """Return what computes these signals of the joints in AutoDiffXd.

    Args:
        view: What the signals are computed with, in AutoDiffXd.
        names: Their names.
        inputs: What reads ``position`` and ``velocity`` of the joints.
    """
    read_q, read_v = inputs["position"], inputs["velocity"]

    def calc(signal: Signal) -> Calc:
        function = signal.function
        assert function is not None
        if "v" in signal.causes:
            return lambda context: function(view, read_q(context), read_v(context), None)
        return lambda context: function(view, read_q(context), None, None)

    return AutoDiffFunctions({name: calc(SIGNALS[name]) for name in names})


def _of_joints(view: View, signal: Signal, read_q: Any, read_v: Any) -> Callable[..., None]:
    """Return what computes a signal for a port; without ``read_v`` it needs no velocity."""
    function = signal.function
    assert function is not None

    def at_q(context: Context, output: Any) -> None:
        output.set_value(function(view, read_q(context), None, None).ravel())

    def at_q_v(context: Context, output: Any) -> None:
        output.set_value(function(view, read_q(context), read_v(context), None).ravel())

    return at_q if read_v is None else at_q_v


def release(diagram: System) -> None:
    """Let a diagram be freed with the last name for it, and its systems and ports with it.

    Without this it is freed when Python's garbage collector next looks at old objects, which is
    seldom: pydrake lets a diagram, its builder, its systems and their ports keep each other alive.
    Of a diagram with systems in Python, or with a port that is read by one, nothing that needs
    them can be evaluated afterwards: a ReferenceError is raised. One of Drake's own systems may be
    evaluated for as long as the diagram is held.

    Args:
        diagram: The diagram.
    """
    waiting: list[Any] = [diagram]
    systems: list[Any] = []
    while waiting:
        peer = waiting.pop()
        if isinstance(peer, System) and peer is not diagram:
            systems.append(peer)
        if hasattr(peer, _FUNCTIONS):
            delattr(peer, _FUNCTIONS)
        if hasattr(peer, _PEERS):
            peers = getattr(peer, _PEERS)
            # Made with nanobind, pydrake keeps the functions that Drake calls there, too.
            functions = {each for each in peers if isinstance(each, tuple)}
            waiting.extend(each for each in peers if each not in functions)
            delattr(peer, _PEERS)
            if functions:
                setattr(peer, _PEERS, functions)
    setattr(diagram, _SYSTEMS, systems)


@contextmanager
def release_at_end(diagram: System) -> Iterator[None]:
    """Release a diagram at the end, whatever happens until then, see `release`."""
    try:
        yield
    finally:
        release(diagram)
