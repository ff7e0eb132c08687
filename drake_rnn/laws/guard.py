"""A guard between a source of joint targets and a robot, as a plain object without a diagram."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from .joint_stream import JointStream
from .law import SampledReading


class Guard:
    """Turns joint targets, whenever they come, into commands within every bound.

    It runs a `JointStream` outside of any diagram, for a loop of one's own. As a system of a
    diagram the same law runs in a `SampledController`, with the input port ``target``.

    Args:
        law: What is kept, and how targets are followed.
        period: Time between two calls of `command` [s].
        start: Posture that the robot rests in, shape (n,) [rad]; by default the law's ``home``.

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or the robot starts beyond
            its limits or too near to something.
    """

    def __init__(self, law: JointStream, period: float, start: Array | None = None) -> None:
        require_type("law", law, JointStream)
        self._reading: SampledReading = law.sampled(period)
        q = law.home if start is None else _numbers("start", start, law.home.size)
        if not np.isfinite(q).all():
            raise InvalidInputError(f"start: must be finite, not {short(q)}")
        if law.limits.violation(q).any():
            raise InvalidInputError(f"start: {law.limits.complaint(q)}")
        law.safety.check_start(q)
        self.law = law
        self.period = float(period)
        self._none = np.full(q.size, np.nan)
        self._seen = {name: np.zeros(shape) for name, shape in law.safety.inputs.items()}
        signals = {"position": q, "target": self._none, **self._seen}
        self._x = self._reading.initial_state(np.random.default_rng(0), signals)
        self._t, self._q = 0.0, q

    @classmethod
    def within(
        cls, limits: JointLimits, start: Array, period: float, clearance: Clearance | None = None
    ) -> Guard:
        """Return a guard with the defaults of `JointStream`.

        Args:
            limits: Limits of the joints.
            start: Posture that the robot rests in, shape (n,) [rad].
            period: Time between two calls of `command` [s].
            clearance: What the arm is to stay clear of; None for nothing.
        """
        return cls(JointStream(limits=limits, home=start, clearance=clearance), period)

    def command(self, target: Array | None = None, p_WO: Array | None = None) -> Array:
        """Return the positions to command for the next period, shape (n,) [rad].

        They are reached at its end, at the constant `velocity`.

        Args:
            target: A target that has come since the last call, shape (n,) [rad]; None, or with
                NaN or infinite entries, if there is none to follow.
            p_WO: How far the obstacles that may move have gone from where they are stated, in the
                order of ``clearance.solids.moving``, as measured now, shape (m, 3) [m]; must be
                given if there are any.

        Raises:
            InvalidInputError: If target or obstacles have another shape, or the latter are not
                given.
        """
        wanted = self._none if target is None else _numbers("target", target, self._none.size)
        wanted = wanted if np.isfinite(wanted).all() else self._none
        signals = {"position": self._q, "target": wanted, **self._obstacles(p_WO)}
        self._x = self._reading.step(self._t, self._x, signals, self.period)
        self._t += self.period
        return self.position

    def _obstacles(self, p_WO: Array | None) -> dict[str, Array]:
        """Return what is measured of obstacles, as the law sees it."""
        shape = next((part.shape for part in self._seen.values()), (0, 3))
        given = np.zeros((0, 3)) if p_WO is None else np.asarray(p_WO, dtype=float)
        if given.shape != shape:
            raise InvalidInputError(
                f"p_WO: must be of shape {shape}, one row for each obstacle that may move, not "
                f"{given.shape}"
            )
        return {name: given for name in self._seen}

    def resume(self, q: Array, v: Array, a: Array) -> None:
        """Go on from what was commanded without the guard.

        Args:
            q: Positions commanded, shape (n,) [rad].
            v: Velocities that have led there, shape (n,) [rad/s].
            a: Accelerations that have led to these, shape (n,) [rad/s^2].
        """
        self._x = self._reading.resumed(self._x, q, v, a)
        self._q = q

    def part(self, name: str) -> Array:
        """Return a part of the law's state, such as ``missed`` or ``held_back``."""
        return np.array(self._reading.state.part(self._x, name))

    @property
    def position(self) -> Array:
        """Positions commanded last, shape (n,) [rad]."""
        return self.part("commanded")

    @property
    def velocity(self) -> Array:
        """Velocities commanded last, shape (n,) [rad/s]."""
        return self.part("v")


def _numbers(name: str, value: object, size: int) -> Array:
    """Return as many numbers as there are joints; NaN is one of them."""
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (size,):
        raise InvalidInputError(
            f"{name}: must be {size} numbers, one per joint, not {short(value)}"
        )
    return found
