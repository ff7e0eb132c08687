"""Systems in Python that are freed once nothing needs them, and diagrams that are freed at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any
from weakref import proxy

from pydrake.systems.framework import LeafSystem, System

# Attribute in which pydrake lets systems, ports, builders and diagrams keep each other alive.
_PEERS = "_pydrake_internal_ref_cycle_peers"
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
    """

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


def release(diagram: System) -> None:
    """Let a diagram be freed with the last name for it, and its systems and ports with it.

    Without this it is freed when Python's garbage collector next looks at old objects, which is
    seldom: pydrake lets a diagram, its builder, its systems and their ports keep each other alive.
    A diagram with systems in Python, or with a port that is read by one, must not be evaluated
    afterwards; one of Drake's own systems may be for as long as it is held.

    Args:
        diagram: The diagram.
    """
    waiting: list[Any] = [diagram]
    while waiting:
        system = waiting.pop()
        waiting.extend(getattr(system, _PEERS, ()))
        for name in (_PEERS, _CALLED):
            if hasattr(system, name):
                delattr(system, name)


@contextmanager
def released(diagram: System) -> Iterator[None]:
    """Release a diagram at the end, whatever happens until then, see `release`."""
    try:
        yield
    finally:
        release(diagram)
