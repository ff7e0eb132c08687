"""Recording of a simulation at every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, OutputPort

from ..inputs.fields import Array
from ..laws.layout import Layout
from .signals_held import signals_held

#: Number of steps that are evaluated together, unless a tick has more: about 100 MB.
PART = 2**16


@dataclass(frozen=True)
class Steps:
    """Recorded steps, in arrays that the recorder's next step overwrites.

    Attributes:
        time: Times of all steps, shape (k,) [s].
        rows: What was recorded, shape (k, layout.size).
        layout: Where each port is in a row.
        origin: Time of the run's first step [s]; None if it is the first of these.
    """

    time: Array
    rows: Array
    layout: Layout
    origin: float | None = None

    def series(self, name: str) -> Array:
        """Return the values of one port at every step, shape (k, size)."""
        return self.layout.part(self.rows, name)

    def until(self, last: int) -> Steps:
        """Return the steps up to and including the one with this number."""
        return Steps(self.time[: last + 1], self.rows[: last + 1], self.layout, self.origin)


#: Evaluates a part of the run and returns the number of the step with which the next part begins; 0
#: if no part ends within these steps.
Take = Callable[[Steps], int]


class Recorder:
    """Recorder of a diagram's output ports at every accepted step.

    It is the simulator's monitor, which adds no events and therefore does not change the steps.
    Values at time t are those just before the updates at t: velocities are those of the step that
    ended there.

    Args:
        root: Context of the simulated diagram.
        ports: Output ports to record, by name.
        take: Called with the steps of each part; without it, all steps are kept.
        part: Number of steps of a part.
    """

    def __init__(
        self,
        root: Context,
        ports: Mapping[str, OutputPort],
        take: Take | None = None,
        part: int = PART,
    ) -> None:
        self._layout = Layout(**{name: (port.size(),) for name, port in ports.items()})
        self._sources = [
            (port.Eval, port.get_system().GetMyContextFromRoot(root), self._layout.parts[name][0])
            for name, port in ports.items()
        ]
        self._take, self._part = take, part
        self._origin: float | None = None
        self._times = np.empty(min(1024, part))
        self._rows = np.empty((self._times.size, self._layout.size))
        self._count = 0

    def __call__(self, context: Context) -> None:
        """Record the ports at the present time."""
        if self._count == self._times.size:
            self._make_room()
        count = self._count
        self._times[count] = context.get_time()
        row = self._rows[count]
        for read, place, at in self._sources:
            row[at] = read(place)
        self._count = count + 1

    @property
    def steps(self) -> Steps:
        """The steps not taken yet; they begin with the last step of the part taken before."""
        count = self._count
        return Steps(self._times[:count], self._rows[:count], self._layout, self._origin)

    def _make_room(self) -> None:
        # An interrupt in this block could make steps count twice or not at all.
        with signals_held():
            taken = 0
            if self._take is not None and self._count >= self._part:
                taken = self._take(self.steps)
            if taken:
                self._drop(taken)
            else:
                self._times = np.concatenate((self._times, np.empty_like(self._times)))
                self._rows = np.concatenate((self._rows, np.empty_like(self._rows)))

    def _drop(self, first: int) -> None:
        """Drop the steps before the one with this number."""
        if self._origin is None:
            self._origin = float(self._times[0])
        kept = self._count - first
        self._times[:kept] = self._times[first : self._count]
        self._rows[:kept] = self._rows[first : self._count]
        self._count = kept
