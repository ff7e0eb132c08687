"""Helpers that add named systems to a diagram and check port sizes when connecting them."""

from __future__ import annotations

from typing import TypeVar

from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System

from ..errors import InvalidInputError

#: Output ports by name.
Ports = dict[str, OutputPort]

S = TypeVar("S")


class Wiring:
    """A part of a diagram under construction.

    Args:
        builder: Diagram builder that the systems are added to.
        prefix: Prefix of the systems' names in ``builder``.

    Attributes:
        systems: Systems added so far, by name without the prefix.
    """

    def __init__(self, builder: DiagramBuilder, prefix: str) -> None:
        self._builder = builder
        self._prefix = prefix
        self.systems: dict[str, System] = {}

    def add(self, name: str, system: S) -> S:
        """Add a system and return it.

        Raises:
            InvalidInputError: If the diagram has it already, or another one of this name.
        """
        # Drake would end the process over either.
        if any(system is known for known in self._builder.GetSystems()):
            raise InvalidInputError(f"{name}: is in this diagram already; make another one")
        full = self._prefix + name
        if self._builder.HasSubsystemNamed(full):
            raise InvalidInputError(
                f"prefix: there is a system {full!r} in this diagram already; give each loop a "
                f"prefix of its own, not {self._prefix!r}"
            )
        self._builder.AddNamedSystem(full, system)
        self.systems[name] = system
        return system

    def connect(self, output: OutputPort, port: InputPort) -> None:
        """Connect two ports.

        Raises:
            InvalidInputError: If the ports differ in size.
        """
        if output.size() != port.size():
            raise InvalidInputError(
                f"{_place(output)}: must have {port.size()} entries, like {_place(port)}, not "
                f"{output.size()}; was it made for another task or arm?"
            )
        self._builder.Connect(output, port)


def ports_of(system: System) -> Ports:
    """Return the output ports of a system, by name."""
    ports = [system.get_output_port(index) for index in range(system.num_output_ports())]
    return {port.get_name(): port for port in ports}


def _place(port: InputPort | OutputPort) -> str:
    return f"{port.get_system().get_name()}.{port.get_name()}"
