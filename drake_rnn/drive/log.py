"""What was heard and sent in each cycle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from ..inputs.fields import Array
from .cycles import Cycle

#: What a drive does in a cycle.
Phase = Literal["listen", "approach", "run", "stop"]
PHASES: tuple[Phase, ...] = get_args(Phase)


@dataclass
class Log:
    """The cycles of a drive, in the order in which they were carried out.

    Attributes:
        joints: Number of joints.
        times: Robot's clock in each cycle [s].
        hosts: Clock of this side when the command was sent [s].
        phases: What was done.
        measured: Measured positions, shape (n,) each [rad]; NaN where no status came in time.
        velocities: Measured velocities, shape (n,) each [rad/s]; likewise.
        sent: Commanded positions, shape (n,) each [rad]; NaN where nothing was sent.
    """

    joints: int
    times: list[float] = field(default_factory=list)
    hosts: list[float] = field(default_factory=list)
    phases: list[int] = field(default_factory=list)
    measured: list[Array] = field(default_factory=list)
    velocities: list[Array] = field(default_factory=list)
    sent: list[Array] = field(default_factory=list)

    def add(self, phase: Phase, cycle: Cycle, sent: Array | None, host: float) -> None:
        """Add a cycle; without a command if nothing was sent in it."""
        nothing = np.full(self.joints, np.nan)
        status = cycle.status
        self.times.append(cycle.time)
        self.hosts.append(host)
        self.phases.append(PHASES.index(phase))
        self.measured.append(nothing if status is None else status.position)
        self.velocities.append(nothing if status is None else status.velocity)
        self.sent.append(nothing if sent is None else sent)

    def arrays(self) -> dict[str, Array]:
        """Return all cycles as arrays, by name, as a file has them."""
        n = self.joints
        return {
            "time": np.array(self.times),
            "host_time": np.array(self.hosts),
            "phase": np.array([PHASES[phase] for phase in self.phases]),
            "position_measured": np.reshape(self.measured, (-1, n)),
            "velocity_measured": np.reshape(self.velocities, (-1, n)),
            "position_sent": np.reshape(self.sent, (-1, n)),
        }

    def of(self, phase: Phase) -> dict[str, Array]:
        """Return the cycles of a phase as arrays, by name."""
        arrays = self.arrays()
        chosen = arrays["phase"] == phase
        return {name: values[chosen] for name, values in arrays.items()}
