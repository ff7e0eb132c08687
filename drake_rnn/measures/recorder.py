"""Recording of a simulation at every step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.systems.framework import Context, OutputPort

from ..inputs.fields import Array
from ..laws.law import Layout


class Recorder:
    """Recorder of a diagram's output ports at every accepted step.

    It is the simulator's monitor, which adds no events and therefore does not change the steps.
    Values at time t are those just before the updates at t: velocities are those of the step that
    ended there.

    Args:
        root: Context of the simulated diagram.
        ports: Output ports to record, by name.
    """

    def __init__(self, root: Context, ports: Mapping[str, OutputPort]) -> None:
        self._layout = Layout(**{name: (port.size(),) for name, port in ports.items()})
        self._sources = [
            (port.Eval, port.get_system().GetMyContextFromRoot(root), self._layout.parts[name][0])
            for name, port in ports.items()
        ]
        self._times = np.empty(1024)
        self._rows = np.empty((1024, self._layout.size))
        self._count = 0

    def __call__(self, context: Context) -> None:
        """Record the ports at the present time."""
        count = self._count
        if count == self._times.size:
            self._times = np.concatenate((self._times, np.empty_like(self._times)))
            self._rows = np.concatenate((self._rows, np.empty_like(self._rows)))
        self._times[count] = context.get_time()
        row = self._rows[count]
        for read, place, at in self._sources:
            row[at] = read(place)
        self._count = count + 1

    @property
    def time(self) -> Array:
        """Times of all steps, shape (k,) [s]."""
        return self._times[: self._count]

    def series(self, name: str) -> Array:
        """Return the values of one port at every step, shape (k, size)."""
        return self._layout.part(self._rows[: self._count], name)
