"""Curves in space that a point runs along by a time law: once, or lap after lap if they close."""

# No postponed annotations: see `path`.
import math
from abc import abstractmethod
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array, Count, NonNegative, validated
from ..inputs.keys import Meaning
from .checks import require_count, require_values
from .path import Motion
from .relative import RelativePath
from .timing import TimeLaw, Timing, time_at, time_law

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
        elapsed = t * self._frequency if not self.pause else self._elapsed(t)
        done = (elapsed + _INSTANT) // 1.0
        if not 0.0 <= done < self._last:
            if not math.isfinite(t):
                raise InvalidInputError(f"t: must be finite, not {t}")
            return None
        s, ds, dds = self._law(max(elapsed - done, 0.0))
        stretch = TURN / self.segments
        rate = ds * stretch * self._frequency
        gain = dds * stretch * self._frequency**2
        return (done % self.segments + s) * stretch, rate, gain

    def _elapsed(self, t: float) -> float:
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
