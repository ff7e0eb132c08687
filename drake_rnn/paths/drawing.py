r"""Paths that a pen draws: strokes in a plane, joined by moves along it or above it.

The point rests at the ends of strokes, and at corners unless they are rounded. From rest to rest
it follows a time law along the arc length; its acceleration is continuous, except at rest with
"sin2".
"""

# No postponed annotations: see `path`.
from abc import abstractmethod
from bisect import bisect_right
from functools import cached_property
from itertools import accumulate
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array, Finite, Flag, Positive, Speed, Time, between, validated
from ..inputs.keys import Meaning
from .checks import require_count, require_time
from .curve import RAMP, Ramp
from .in_plane import InPlane
from .path import Motion
from .run import Run, times_of
from .strokes import Pen, Stroke
from .timing import TimeLaw, time_law

# Largest distance from a slight corner at which its rounding begins, as a share of the drawing.
_SLIGHT = 0.01
# Height, as a share of that to which a pen is lifted, above which it does not draw.
_LIFTED = 1e-3


@validated
class Drawing(InPlane):
    """Strokes in a plane, drawn one after another and joined by moves.

    Give ``period``, or ``speed``, ``acceleration`` or both.
    """

    blend_radius: Annotated[
        Annotated[Positive, Field(le=1e3)] | None,
        Meaning(
            "Largest distance from a corner at which its rounding begins or ends; less where a "
            "line is too short for two of them. If None, the point rests at each corner of more "
            "than 10 degrees.",
            unit="m",
        ),
    ] = None
    lift: Annotated[
        Finite,
        between(-1e3, 1e3),
        Meaning(
            "Height of the moves between strokes above the plane, along its normal; below 0 for "
            "the other side, 0 for straight moves in the plane.",
            unit="m",
        ),
    ] = 0.0
    returns: Annotated[
        Flag,
        Meaning("Whether a move leads back to the start in the end, so that the path closes."),
    ] = False
    period: Annotated[
        Time | None,
        Meaning(
            "Duration; shared among the parts from rest to rest so that the largest acceleration "
            "is the same in all of them.",
            unit="s",
        ),
    ] = None
    speed: Annotated[Speed | None, Meaning("Largest speed along the path.", unit="m/s")] = None
    acceleration: Annotated[
        Annotated[Positive, Field(le=1e3)] | None,
        Meaning("Largest acceleration along the path.", unit="m/s^2"),
    ] = None
    timing: Annotated[
        Literal["quintic", "cycloid", "ramps", "sin2"],
        Meaning("Time law of each part from rest to rest."),
    ] = "quintic"
    ramp: Annotated[
        Ramp | None,
        Meaning(
            'Fraction of a part\'s time taken by each of the two ramps of "ramps"; 0.2 by '
            "default. Only with that time law.",
        ),
    ] = None

    def __post_init__(self) -> None:
        self._require_place()
        if self.ramp is not None and self.timing != "ramps":
            raise ValueError(f"ramp: only with timing: ramps, not {self.timing}")
        rivals = [key for key in ("speed", "acceleration") if fields_of(self)[key] is not None]
        if self.period is None and not rivals:
            raise ValueError("give a period, or speed, acceleration or both")
        if self.period is not None and rivals:
            raise ValueError(f"{rivals[0]}: cannot be combined with period; leave one out")
        # A bad drawing is refused now, not during a run.
        self._ends  # noqa: B018

    def pen_is_down(self, points: Array) -> NDArray[np.bool_]:
        """See `Path.pen_is_down`; it draws in the plane, all of it without a ``lift``.

        Likewise where the plane turns with another frame than the base.
        """
        if self.lift == 0.0 or self.frame != "base":
            return np.ones(len(points), dtype=bool)
        heights = (points - points[0]) @ self.normal
        return np.asarray(np.abs(heights) <= _LIFTED * abs(self.lift))

    @property
    @abstractmethod
    def _strokes(self) -> list[Stroke]:
        """Strokes along the plane's x, y and normal, relative to the drawing's origin [m]."""

    @property
    def closed(self) -> bool:
        """Whether the path ends where it began."""
        return self.returns

    @property
    def duration(self) -> float:
        """Time at which the last stroke ends, or the move back [s]."""
        return self._ends[-1]

    @property
    def length(self) -> float:
        """Length of all strokes and moves [m]."""
        return sum(run.length for run in self._runs)

    @cached_property
    def _runs(self) -> list[Run]:
        strokes = self._placed_strokes
        points = np.concatenate([points for stroke in strokes for points in stroke])
        slight = _SLIGHT * float(np.linalg.norm(np.ptp(points, axis=0)))
        lift = self.lift * self._axes[2]
        return Pen(self.blend_radius, slight, lift, self.returns).runs(strokes)

    @cached_property
    def _ends(self) -> list[float]:
        """Times at which runs begin and end, from 0 [s]."""
        times = times_of(self._runs, self._law, self.period, self.speed, self.acceleration)
        ends = list(accumulate(times.tolist(), initial=0.0))
        return ends if self.period is None else [*ends[:-1], self.period]

    @cached_property
    def _law(self) -> TimeLaw:
        return time_law(self.timing, RAMP if self.ramp is None else self.ramp)

    @cached_property
    def _placed_strokes(self) -> list[Stroke]:
        """Strokes along the axes of the base, relative to the drawing's origin [m]."""
        axes = np.stack(self._axes)
        return [[points @ axes for points in stroke] for stroke in self._strokes]

    @property
    def _first_point(self) -> Array:
        return np.asarray(self._placed_strokes[0][0][0])

    def evaluate(self, t: float) -> Motion:
        require_time(t)
        first = self._placed_strokes[0][0][0]
        if not 0.0 <= t < self.duration:
            run = self._runs[0 if t < 0.0 else -1]
            end = 0.0 if t < 0.0 else run.length
            return run.at(end)[0] - first, np.zeros(3), np.zeros(3)
        number = bisect_right(self._ends, t) - 1
        begin, end = self._ends[number : number + 2]
        p, v, a = self._runs[number].motion(self._law, end - begin, t - begin)
        return p - first, v, a

    def _breaks(self, until: float) -> list[Array | float]:
        return [np.array(self._ends)]

    def sample(self, count: int) -> Array:
        """Return displacements at about equal steps of arc length, shape (count, 3) [m].

        The points at which the pen rests are among them, unless there are more than ``count``.

        Raises:
            InvalidInputError: If ``count`` is not a whole number of at least 1.
        """
        require_count(count)
        begins = np.cumsum([0.0, *(run.length for run in self._runs)])
        at = np.linspace(0.0, begins[-1], count)
        at[np.rint(begins / begins[-1] * (count - 1)).astype(int)] = begins
        numbers = np.clip(np.searchsorted(begins, at, side="right") - 1, 0, len(self._runs) - 1)
        points = [
            self._runs[number].at(s - begins[number])[0]
            for number, s in zip(numbers.tolist(), at.tolist(), strict=True)
        ]
        return np.array(points) - self._placed_strokes[0][0][0]
