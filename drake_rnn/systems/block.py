"""Systems in Python that are freed once nothing needs them, and diagrams that are freed at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from weakref import proxy

from pydrake.systems.framework import Context, LeafSystem, System

# Attribute in which pydrake lets systems, ports, builders and diagrams keep each other alive.
_PEERS = "_pydrake_internal_ref_cycle_peers"
# Attribute of a block with the functions that Drake calls.
_CALLED = "_called"

#: A function that Drake calls with a context and what it fills in.
Call = Callable[[Context, Any], Any]


class Collectable(type(LeafSystem)):  # type: ignore[misc]  # the metaclass of pydrake's classes
    """Metaclass of systems whose reference cycles Python's garbage collector finds.

    In Python 3.11 the collector counts the attributes of an instance twice if its class is derived
    from one of pydrake's and has a dictionary of its own, and so never frees it. With ``__slots__``
    a class has none: attributes are kept in the dictionary that pydrake's class has.
    """

    def __new__(
        mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any
    ) -> Any:
        """Return a class without a dictionary of its own."""
        namespace.setdefault("__slots__", ())
        return super().__new__(mcs, name, bases, namespace, **options)


class Block(LeafSystem, metaclass=Collectable):
    """Base class of this package's systems.

    Drake holds the functions that it calls where Python's garbage collector does not see them. A
    function that refers to its own system, as a method or by one of the system's ports, would keep
    that system alive for ever. So the system holds its functions, and Drake a weak reference.
    """

    def _for_drake(self, function: Call) -> Call:
        """Return what Drake may hold of a function, which lives as long as this system."""
        vars(self).setdefault(_CALLED, []).append(function)
        held: Call = proxy(function)

        def called(context: Context, filled: Any) -> Any:
            return held(context, filled)

        return called

    def DeclareVectorOutputPort(self, name: str, size: Any, calc: Call, *rest: Any) -> Any:
        """See `pydrake.systems.framework.LeafSystem`."""
        return super().DeclareVectorOutputPort(name, size, self._for_drake(calc), *rest)

    def DeclarePeriodicDiscreteUpdateEvent(self, period: float, offset: float, update: Call) -> Any:
        """See `pydrake.systems.framework.LeafSystem`."""
        held = self._for_drake(update)
        return super().DeclarePeriodicDiscreteUpdateEvent(period, offset, held)

    def DeclareInitializationDiscreteUpdateEvent(self, update: Call) -> Any:
        """See `pydrake.systems.framework.LeafSystem`."""
        return super().DeclareInitializationDiscreteUpdateEvent(self._for_drake(update))

    def DeclareInitializationUnrestrictedUpdateEvent(self, update: Call) -> Any:
        """See `pydrake.systems.framework.LeafSystem`."""
        return super().DeclareInitializationUnrestrictedUpdateEvent(self._for_drake(update))


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
