r"""Curves in space that a point runs along by a time law: once, or lap after lap if they close.

Time laws: the motion of a point along a segment of its path.

Each law maps the fraction of the segment's time, tau in [0, 1], to the fraction of its phase,
s(tau), with s(0) = 0 and s(1) = 1, and to the two derivatives of s.

========  ==========================================  ==============================
law       s(tau)                                      at both ends
========  ==========================================  ==============================
uniform   tau                                         moves at constant speed
sin2      sin^2(pi tau / 2)                           at rest; acceleration jumps
quintic   10 tau^3 - 15 tau^4 + 6 tau^5               at rest, zero acceleration
cycloid   tau - sin(2 pi tau) / (2 pi)                at rest, zero acceleration
ramps     speed rises as S7, is constant, falls       at rest, s'' to s'''' zero
========  ==========================================  ==============================

S7(u) = u^4 (35 - 84 u + 70 u^2 - 20 u^3) rises from 0 to 1 with three derivatives zero at
both ends, so that the motion has four continuous derivatives and a bounded fifth.

- A fixed point in place of a path.
- A straight line, with a turn on the way if asked for.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from math import cos, pi, sin
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.common.eigen_geometry import AngleAxis

from ..errors import InvalidInputError
from ..inputs.fields import Array, Count, NonNegative, Point, validated, zeros
from ..inputs.keys import Meaning
from ..inputs.messages import short
from ..robot.limits import degree_hint
from .path import Motion, RelativePath, require_count, require_values

Timing = Literal["uniform", "sin2", "quintic", "cycloid", "ramps"]
TimeLaw = Callable[[float], tuple[float, float, float]]


def _uniform(tau: float) -> tuple[float, float, float]:
    return tau, 1.0, 0.0


def _sin2(tau: float) -> tuple[float, float, float]:
    s = sin(pi / 2 * tau)
    return s * s, pi / 2 * sin(pi * tau), pi * pi / 2 * cos(pi * tau)


def _quintic(tau: float) -> tuple[float, float, float]:
    left = 1.0 - tau
    s = tau**3 * (10.0 + tau * (6.0 * tau - 15.0))
    return s, 30.0 * (tau * left) ** 2, 60.0 * tau * left * (1.0 - 2.0 * tau)


def _cycloid(tau: float) -> tuple[float, float, float]:
    turn = 2.0 * pi * tau
    return tau - sin(turn) / (2.0 * pi), 2.0 * sin(pi * tau) ** 2, 2.0 * pi * sin(turn)


def _ramps(ramp: float, tau: float) -> tuple[float, float, float]:
    speed = 1.0 / (1.0 - ramp)
    u = min(tau, 1.0 - tau) / ramp
    if u < 1.0:
        way = speed * ramp * u**5 * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)))
        rate = speed * u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
        rise = speed / ramp * 140.0 * (u * (1.0 - u)) ** 3
        return (way, rate, rise) if tau < 0.5 else (1.0 - way, rate, -rise)
    return speed * (tau - ramp / 2.0), speed, 0.0


def time_law(timing: Timing, ramp: float) -> TimeLaw:
    """Return the time law of this name: tau -> (s, s', s'').

    Args:
        timing: Name of the law.
        ramp: Fraction of the time taken by each of the two ramps of "ramps", in (0, 0.5].
    """
    laws: dict[Timing, TimeLaw] = {
        "uniform": _uniform,
        "sin2": _sin2,
        "quintic": _quintic,
        "cycloid": _cycloid,
        "ramps": partial(_ramps, ramp),
    }
    return laws[timing]


def time_at(law: TimeLaw, share: float) -> float:
    """Return the tau at which s(tau) is ``share``, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if law(middle)[0] < share else (low, middle)
    return low


Triple = tuple[float, float, float]

#: Duration of a lap [s].
Period = Annotated[float, Field(strict=True, ge=1e-3, le=1e6, allow_inf_nan=False)]

TURN = 2.0 * math.pi
#: Fraction of a segment's time that a ramp takes.
Ramp = Annotated[float, Field(strict=True, ge=1e-3, le=0.5)]
#: This fraction, unless it is given.
RAMP = 0.2
_INSTANT = 1e-12  # share of a segment; a time this close to its end belongs to the next segment


@validated
class Curve(RelativePath):
    """A curve with a time law.

    A subclass traces the curve; a time law maps time to the phase, which grows from 0 to 2 pi over
    a lap. An open curve, whose class says that it is not `closed`, is passed once.
    """

    period: Annotated[Period, Meaning("Duration of one lap.", unit="s")]
    timing: Annotated[Timing, Meaning("Time law of each segment.")] = "uniform"
    ramp: Annotated[
        Ramp | None,
        Meaning(
            'Fraction of a segment\'s time taken by each of the two ramps of "ramps"; 0.2 by '
            "default. Only with that time law.",
        ),
    ] = None
    laps: Annotated[
        Count | None,
        Meaning(
            "Number of laps, after which the point rests; None for no end. For a closed curve.",
        ),
    ] = None
    pause: Annotated[
        NonNegative,
        Meaning(
            "Time for which the point rests after each lap but the last. For a closed curve, "
            "with a time law that comes to rest.",
            unit="s",
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.ramp is not None and self.timing != "ramps":
            raise ValueError(f"ramp: only with timing: ramps, not {self.timing}")
        if not self.closed and (self.laps or 1) > 1:
            raise ValueError("laps: an open path is passed once; a sequence may repeat it")
        if self.pause > 0.0 and not self.closed:
            raise ValueError("pause: an open path is passed once and rests where it ends")
        if self.pause > 0.0 and self.timing == "uniform":
            raise ValueError(
                "pause: needs a timing that comes to rest; uniform would stop at once; give "
                "another timing"
            )

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it began."""
        return True

    @property
    def segments(self) -> int:
        """Number of segments of a lap; all have the same duration and the same time law."""
        return 1

    @property
    def bends(self) -> tuple[float, ...]:
        """Phases of a one-segment curve at which its derivatives by phase jump [rad]."""
        return ()

    @property
    def passes(self) -> float:
        """Number of laps; infinite for a curve without an end."""
        if not self.closed:
            return 1.0
        return math.inf if self.laps is None else float(self.laps)

    @property
    def duration(self) -> float:
        """Duration of all laps with the pauses between them [s]; infinite without ``laps``."""
        if not self.pause:
            return self.passes * self.period
        return self.passes * (self.period + self.pause) - self.pause

    @property
    def traversal(self) -> float:
        """Duration of one lap [s]."""
        return self.period

    @abstractmethod
    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """Return the displacement from the first point and its two derivatives by phase [m]."""

    @cached_property
    def _law(self) -> TimeLaw:
        return time_law(self.timing, RAMP if self.ramp is None else self.ramp)

    @cached_property
    def _frequency(self) -> float:
        return self.segments / self.period

    @cached_property
    def _last(self) -> float:
        return self.passes * self.segments

    @cached_property
    def _end(self) -> Array:
        """Displacement after the last lap, shape (3,) [m]."""
        return np.zeros(3) if self.closed else np.array(self.trace(TURN)[0])

    def phase_at(self, t: float) -> tuple[float, float, float] | None:
        """Return phase [rad], its rate and its second derivative at time ``t`` [s].

        None while the point rests before the start, in a pause or after the end.

        Raises:
            InvalidInputError: If ``t`` is not finite.
        """
        segments = t * self._frequency if not self.pause else self._passed_segments(t)
        laps = (segments + _INSTANT) // 1.0
        if not 0.0 <= laps < self._last:
            if not math.isfinite(t):
                raise InvalidInputError(f"t: must be finite, not {t}")
            return None
        s, ds, dds = self._law(max(segments - laps, 0.0))
        stretch = TURN / self.segments
        rate = ds * stretch * self._frequency
        gain = dds * stretch * self._frequency**2
        return (laps % self.segments + s) * stretch, rate, gain

    def _passed_segments(self, t: float) -> float:
        """Return the number of segments passed at time ``t`` of a path with pauses; -1 in one."""
        if not math.isfinite(t):
            return t
        cycle = self.period + self.pause
        lap = (t + _INSTANT * self.period) // cycle
        share = (t - lap * cycle) / self.period
        if share >= 1.0 - _INSTANT and lap + 1.0 < self.passes:
            return -1.0
        return (lap + share) * self.segments

    def evaluate(self, t: float) -> Motion:
        try:
            phase = self.phase_at(t)
        except InvalidInputError:
            raise
        except (TypeError, ValueError):
            raise InvalidInputError(f"t: must be a finite number, not {short(t)}") from None
        if phase is None:
            p = self._end if t > 0.0 else np.zeros(3)
            return p.copy(), np.zeros(3), np.zeros(3)
        angle, rate, gain = phase
        place, (ux, uy, uz), (wx, wy, wz) = self.trace(angle)
        square = rate * rate
        return (
            np.array(place),
            np.array((ux * rate, uy * rate, uz * rate)),
            np.array((wx * square + ux * gain, wy * square + uy * gain, wz * square + uz * gain)),
        )

    def _breaks(self, until: float) -> list[Array | float]:
        """Return the starts and ends of segments, laps and pauses, and the times of ``bends``.

        The ends of the laps of a smooth curve with uniform timing are no knots.
        """
        shares = {time_at(self._law, bend / TURN) for bend in self.bends}
        if self.timing != "uniform" or self.segments > 1:
            shares.add(0.0)
        count = math.floor(until * self._frequency + _INSTANT) + 1
        inner = [
            (k + share) * self.period / self.segments + self.pause * (k // self.segments)
            for k in range(count)
            for share in shares
        ]
        # Where there are pauses, one begins when a lap ends.
        laps = range(1 + count // self.segments) if self.pause else ()
        ends = [(lap + 1) * self.period + lap * self.pause for lap in laps]
        return [0.0, *inner, *ends, self.duration]

    def sample(self, count: int) -> Array:
        """Return one lap of displacements at equal steps of phase, shape (count, 3) [m].

        Raises:
            InvalidInputError: If ``count`` is not a whole number of at least 1.
        """
        require_count(count)
        return np.array([self.trace(phase)[0] for phase in np.linspace(0.0, TURN, count)])

    def require_motion(self) -> None:
        phases = np.linspace(0.0, TURN, 5).tolist()
        name = f"{type(self).__name__}.trace"
        require_values(name, self.trace, "phase", phases, ((3,), (3,), (3,)))
        super().require_motion()


_STILL: Triple = (0.0, 0.0, 0.0)


@validated
class Rest(Curve):
    """A fixed point: the arm's start or, with an ``offset``, a point away from it."""

    kind: Literal["rest"] = "rest"
    summary = "A fixed point: the arm's start or, with an offset, a point away from it."
    period: Period = 1.0

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        return _STILL, _STILL, _STILL


_STRAIGHT: Triple = (0.0, 0.0, 0.0)


@validated
class Line(Curve):
    """A straight line, passed once."""

    kind: Literal["line"] = "line"
    summary = "A straight line, passed once."
    by: Annotated[
        Point | None,
        Meaning("End relative to the first point, shape (3,); give this or ``to``.", unit="m"),
    ] = None
    to: Annotated[Point | None, Meaning("End, shape (3,).", unit="m")] = None
    turn: Annotated[
        Point,
        Meaning(
            "Rotation vector by which the end effector turns on the way, shape (3,) [rad]: about "
            "its direction, by its length.",
            unit="rad",
        ),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.by is None) == (self.to is None):
            raise ValueError("give either by or to")
        if self.by is not None and not self.by.any() and not self.turn.any():
            raise ValueError("by: must not be zero without a turn; kind: rest stays")

    @property
    def closed(self) -> bool:
        return False

    @property
    def turns(self) -> bool:
        """Whether there is a turn on the way."""
        return bool(self.turn.any())

    @property
    def notes(self) -> Sequence[str]:
        """See `Path.notes`; a turn of so many rounds is one in degrees."""
        angle = float(np.linalg.norm(self.turn))
        hint = degree_hint([angle], "rad")
        return [f"turn: {angle:.4g} rad are {angle / TURN:.3g} rounds{hint}"] if hint else []

    @cached_property
    def _rate(self) -> Triple:
        """Displacement for each radian of phase [m]."""
        if self.by is None:
            raise InvalidInputError(
                "to: how far that is depends on where the path begins; place the path first"
            )
        x, y, z = (self.by / TURN).tolist()
        return x, y, z

    def begun_at(self, p_FE: Array) -> RelativePath:
        if self.to is None:
            return self
        return replace(self, by=self.to - self.start_point(p_FE), to=None)

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        x, y, z = self._rate
        return (phase * x, phase * y, phase * z), self._rate, _STRAIGHT

    def evaluate_rotation(self, t: float) -> Motion:
        phase = self.phase_at(t)
        angle, rate, gain = (TURN if t > 0.0 else 0.0, 0.0, 0.0) if phase is None else phase
        size = float(np.linalg.norm(self.turn))
        axis = self.turn / size if size else np.array((1.0, 0.0, 0.0))
        R = AngleAxis(size * angle / TURN, axis).rotation()
        return R, self.turn * (rate / TURN), self.turn * (gain / TURN)
