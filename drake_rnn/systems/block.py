"""Systems in Python that are freed once nothing needs them, and diagrams that are freed at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any, ClassVar
from weakref import proxy

from pydrake.systems.framework import Context, InputPort, LeafSystem, System

from ..signals import SIGNALS, Signal, View

# Attribute in which pydrake lets systems, ports, builders and diagrams keep each other alive.
_PEERS = "_pydrake_internal_ref_cycle_peers"
# Attribute of a diagram that is released, with its systems, which do not refer to it any more.
_SYSTEMS = "_systems"
# Attribute of a block with the functions that Drake calls.
_CALLED = "_called"


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


class Block(LeafSystem, metaclass=Collectable):
    """Base class of this package's systems.

    Drake holds the functions that it calls where Python's garbage collector does not see them. A
    function that refers to its own system, as a method or by one of the system's ports, would keep
    that system alive for ever. So whatever is declared of a block, the block holds its functions,
    and Drake a weak reference.

    Attributes:
        role: What it does in a loop, for drawings of diagrams: ``reference``, ``law``, ``command``,
            ``model``, ``sensor``, ``noise`` or ``force``; empty for something else.
    """

    role: ClassVar[str] = ""

    def _for_drake(self, given: Any) -> Any:
        """Return what Drake may hold of a function; anything else as it is."""
        if not callable(given) or isinstance(given, type):
            return given
        self.__dict__.setdefault(_CALLED, []).append(given)
        held: Any = proxy(given)

        def called(*arguments: Any) -> Any:
            return held(*arguments)

        return called


def _declaring(declare: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of a block that declares what one of Drake's does."""

    @wraps(declare)
    def declared(block: Block, *given: Any, **named: Any) -> Any:
        held = {name: block._for_drake(each) for name, each in named.items()}
        return declare(block, *map(block._for_drake, given), **held)

    return declared


for _name in dir(LeafSystem):
    if _name.startswith("Declare"):
        setattr(Block, _name, _declaring(getattr(LeafSystem, _name)))


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
        needed = {tickets[cause] for cause in sorted(signal.causes)}
        block.DeclareVectorOutputPort(signal.name, signal.size(**lengths), calc, needed)


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
        if hasattr(peer, _CALLED):
            delattr(peer, _CALLED)
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
def released(diagram: System) -> Iterator[None]:
    """Release a diagram at the end, whatever happens until then, see `release`."""
    try:
        yield
    finally:
        release(diagram)
