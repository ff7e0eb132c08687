"""A change of the limits of a guard while its arm moves.

A motion within the old limits may have no stop within the new ones. So the guard goes on along the
stop that was certified within the old ones, until from where it is a next velocity is within the
new ones, with a stop after it that is within all of them and free; at rest there is one, at the
latest. From then on the new ones are in force. Limits that are only wider are so at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.limits import JointLimits
from ..robot.velocity_envelope import SHARE_OF_RATE
from .law import SampledReading, Signals
from .parts.safe_velocity import NO_STOP

# A place this far outside of limits is inside but for rounding [rad].
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class LimitChange:
    """A law with other limits, that waits until they accept the motion of the arm.

    Attributes:
        law: The law, a `JointStream`.
        reading: Its `JointStreamReading`.
        step: The step of that, a `StepInPlace`.
    """

    law: Any
    reading: Any
    step: Any

    def take_over(self, before: SampledReading, x: Array, a: Array, u: Signals) -> None:
        """Begin where the law that is in force is.

        Args:
            before: Reading of that law.
            x: Its state, shape (before.state.size,).
            a: Accelerations that have led to its velocities, shape (n,) [rad/s^2].
            u: Signals that it sees.
        """
        self.step.x[:] = self._state(before.state.by_name(x), a)
        for name, signal in u.items():
            self.step.u[name][:] = signal

    def try_step(self, before: SampledReading, x: Array, a: Array, u: Signals) -> Array | None:
        """Make a step, of the arguments of `take_over`, if its limits accept the motion.

        Returns:
            The state before it, shape (state.size,); None if the limits must wait.
        """
        self.take_over(before, x, a, u)
        state: Array = self.step.x.copy()
        parts, after = (self.reading.state.by_name(each) for each in (state, self.step.x))
        if not self._accepts(parts["commanded"], parts["v"], a):
            return None
        self.step.make()
        is_free = "uncertified" not in after or after["uncertified"] == parts["uncertified"]
        return state if is_free else None

    def _accepts(self, q: Array, v: Array, a: Array) -> bool:
        """Return whether a motion has a stop within the limits, whatever is near."""
        limits, reached = self.law.limits, self.reading.limits
        if limits.jerk is not None and reached.jerk is None:
            # No change within the bounds of the acceleration reaches that of the jerk.
            most = limits.toward("acceleration", a)
            if most is not None and (np.abs(a) > most * SHARE_OF_RATE).any():
                return False
        return bool(reached.have_stop(q, v, a, self.reading.period).all())

    def _state(self, parts: Signals, a: Array) -> Array:
        """Return the state with these limits, of parts of that of the law in force."""
        still = np.zeros(a.size)
        own: dict[str, Array] = {"a": a, "a_path": still, "v_path": parts["v"], **parts}
        if "stop_delay" in parts and parts["v"].any():
            # No stop within these limits was certified.
            own["stop_delay"] = np.full(1, NO_STOP)
        state: Array = self.reading.state.from_parts(own)
        return state


def require_rest_within(limits: JointLimits, end: Array) -> None:
    """Raise an InvalidInputError unless an arm that stops now rests within limits.

    Args:
        limits: The limits.
        end: Where its joints would rest, shape (n,) [rad].
    """
    if limits.size != end.size:
        raise InvalidInputError(f"limits: are of {limits.size} joints; the guard moves {end.size}")
    lower, upper = limits.resting
    beyond = np.maximum(lower - end, end - upper)
    worst = int(np.argmax(beyond))
    if beyond[worst] > _ROUNDING:
        raise InvalidInputError(
            f"limits: joint {worst + 1} comes to rest at {end[worst]:.6g} rad, and may rest at "
            f"{lower[worst]:.6g} to {upper[worst]:.6g} within these; bring it there before they "
            "are changed"
        )
