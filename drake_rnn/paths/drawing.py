r"""Paths that a pen draws: strokes in a plane, joined by moves along it or above it.

The point rests at the ends of strokes, and at corners unless they are rounded. From rest to rest
it follows a time law along the arc length; its acceleration is continuous, except at rest with
"sin2".

- A run of a pen: curves passed without a stop, from rest to rest by a time law.
- Strokes of a pen: lines and curves with corners, divided into runs from rest to rest.
- Text in single-stroke letters.
"""

from __future__ import annotations

from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise
from typing import Annotated, Literal

import numpy as np
from HersheyFonts import HersheyFonts
from numpy.typing import NDArray
from pydantic import Field
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array, Finite, Flag, Length, Positive, Speed, Time, between, validated
from ..inputs.keys import Meaning
from ..inputs.messages import fields_of, nearest
from .curve import RAMP, Ramp, TimeLaw, time_law
from .path import Motion, require_count, require_time
from .pieces import CORNER, Arc, Pieces, join, line, rounding, through, turn
from .planar import InPlane

# Equal steps of time, and points of each piece of a curve, at which a motion is looked at.
_STEPS, _POINTS = 500, 4
# Highest local maxima that are looked at closely, how often, and in how many steps each time.
_PEAKS, _TIMES, _CLOSER = 6, 3, 21


@dataclass(frozen=True, eq=False)
class Run:
    """Curves one after another.

    Attributes:
        arcs: The curves; each begins where the one before it ends, with the same tangent.
    """

    arcs: tuple[Arc, ...]

    @cached_property
    def length(self) -> float:
        """Length of all curves [m]."""
        return self._begins[-1]

    @property
    def straight(self) -> bool:
        """Whether all of it is one straight line."""
        return all(arc.straight for arc in self.arcs)

    @cached_property
    def _begins(self) -> list[float]:
        return list(accumulate((arc.length for arc in self.arcs), initial=0.0))

    def at(self, s: float) -> Motion:
        """Return point [m], tangent and its derivative [1/m] at an arc length [m]."""
        number = max(bisect_right(self._begins, s, hi=len(self.arcs)) - 1, 0)
        curve = _trajectories(self.arcs[number], self._begins[number])
        p, tangent, curvature = (each.value(s).ravel() for each in curve)
        return p, tangent, curvature

    def motion(self, law: TimeLaw, time: float, t: float) -> Motion:
        """Return position [m], velocity [m/s] and acceleration [m/s^2].

        Args:
            law: The time law.
            time: Duration of the run [s].
            t: Time since its start [s].
        """
        s, ds, dds = law(t / time)
        p, tangent, curvature = self.at(s * self.length)
        rate, gain = ds * self.length / time, dds * self.length / time**2
        return p, rate * tangent, rate**2 * curvature + gain * tangent

    def largest(self, law: TimeLaw) -> tuple[float, float]:
        """Return the largest speed [m/s] and acceleration [m/s^2] if the run lasts 1 s."""
        begins = zip(self.arcs, self._begins, strict=False)
        curve = join([arc.pieces(begin) for arc, begin in begins])
        steps, ways = _even(law)
        times = self._passing_times(curve.times, steps, ways[:, 0])
        taus, order = np.unique(np.concatenate((steps, times)), return_index=True)
        motions = np.concatenate((ways, _motions(law, times)))[order]
        values = self._magnitudes(curve, motions)
        speed, gain = (self._peak(curve, law, taus, values, which) for which in range(2))
        return speed, gain

    def _passing_times(self, breaks: Array, steps: Array, ways: Array) -> Array:
        """Return times at which several points of each piece are passed."""
        shares = np.arange(_POINTS) / _POINTS
        s = (breaks[:-1, None] + np.diff(breaks)[:, None] * shares).ravel() / self.length
        return np.interp(s, ways, steps)

    def _magnitudes(self, curve: Pieces, motions: Array) -> tuple[Array, Array]:
        """Return speeds and magnitudes of the acceleration by phase, rate and gain of a time law.

        Args:
            curve: The curve by its arc length.
            motions: What the law gives for times of a run of 1 s, shape (n, 3).
        """
        s, ds, dds = (self.length * motions).T
        tangent, curvature = curve.values(np.clip(s, 0.0, self.length), (1, 2))
        speeds = np.abs(ds) * np.linalg.norm(tangent, axis=1)
        ds, dds = ds[:, None], dds[:, None]
        return speeds, np.linalg.norm(ds**2 * curvature + dds * tangent, axis=1)

    def _peak(
        self, curve: Pieces, law: TimeLaw, taus: Array, magnitudes: tuple[Array, Array], which: int
    ) -> float:
        """Return the largest of values, and of those between the highest and their neighbours."""
        values = magnitudes[which]
        padded_values = np.concatenate(([-1.0], values, [-1.0]))
        tops = np.flatnonzero((values >= padded_values[:-2]) & (values >= padded_values[2:]))
        tops = tops[np.argsort(values[tops])[-_PEAKS:]]
        best = float(values.max())
        low, high = taus[np.maximum(tops - 1, 0)], taus[np.minimum(tops + 1, taus.size - 1)]
        for _ in range(_TIMES):
            # A row for each of them.
            near = np.arange(_CLOSER) * ((high - low) / (_CLOSER - 1))[:, None] + low[:, None]
            near[:, -1] = high
            peaks = self._magnitudes(curve, _motions(law, near.ravel()))[which].reshape(near.shape)
            best = max(best, float(peaks.max()))
            place, row = peaks.argmax(axis=1), np.arange(len(near))
            low = near[row, np.maximum(place - 1, 0)]
            high = near[row, np.minimum(place + 1, _CLOSER - 1)]
        return best


@lru_cache(maxsize=100)
def _trajectories(arc: Arc, begin: float) -> tuple[PiecewisePolynomial, ...]:
    """Return points by arc length, and their two derivatives.

    They take some 0.2 MB, and a drawing may have thousands of curves.
    """
    curve = arc.pieces(begin).trajectory
    return curve, curve.MakeDerivative(1), curve.MakeDerivative(2)


@lru_cache(maxsize=10)
def _even(law: TimeLaw) -> tuple[Array, Array]:
    """Return equal steps of time, and what a time law gives for them."""
    steps = np.linspace(0.0, 1.0, _STEPS + 1)
    return steps, _motions(law, steps)


def _motions(law: TimeLaw, taus: Array) -> Array:
    """Return what a time law gives for some times, shape (n, 3)."""
    return np.array([law(tau) for tau in taus.tolist()])


def times_of(
    runs: list[Run],
    law: TimeLaw,
    period: float | None,
    speed: float | None,
    acceleration: float | None,
) -> Array:
    """Return the time of each run [s].

    Args:
        runs: The runs.
        law: The time law of each.
        period: Time of all runs [s], shared so that the largest acceleration is the same in all.
        speed: Largest speed [m/s], without a period.
        acceleration: Largest acceleration [m/s^2], without a period; this, ``speed`` or both.
    """
    # That of one straight line says that of all.
    unit = np.array(Run((line(np.zeros(3), np.array([1.0, 0.0, 0.0])),)).largest(law))
    speeds, gains = np.array(
        [run.length * unit if run.straight else run.largest(law) for run in runs]
    ).T
    if period is not None:
        shares = np.sqrt(gains)
        return np.asarray(period * shares / shares.sum())
    times = np.zeros(len(runs))
    if speed is not None:
        times = np.maximum(times, speeds / speed)
    if acceleration is not None:
        times = np.maximum(times, np.sqrt(gains / acceleration))
    return times


#: Lines and curves, each given by points of shape (k, 3) [m]: two of a straight line, more of a
#: curve through them. Each begins where the one before it ends.
Stroke = Sequence[Array]

# Distance up to which a stroke begins where the one before it ended [m].
_SAME = 1e-9
# Largest share of a line or curve that the rounding of one corner takes.
_SHARE = 0.45
# Turns at a corner: one that is none [rad], one that is rounded where others are stopped at, and
# one that is stopped at where others are rounded, because the point all but goes back.
_NONE, _SLIGHT_ANGLE, _BACK = 1e-9, np.deg2rad(10.0), np.deg2rad(170.0)
# Pieces into which a curve is divided between two of its points.
_PIECES = 2


@dataclass(frozen=True)
class Pen:
    """How strokes are drawn.

    Attributes:
        radius: Largest distance from a corner at which its rounding begins or ends [m]; None to
            stop at corners.
        slight: The same for corners of at most 10 degrees, which are always rounded [m].
        lift: Vector by which moves between strokes lie away from them, shape (3,) [m].
        returns: Whether a move leads from the last stroke back to the first.
    """

    radius: float | None
    slight: float
    lift: Array
    returns: bool

    def runs(self, strokes: Sequence[Stroke]) -> list[Run]:
        """Return the runs that draw strokes one after another.

        A stroke that begins where the one before it ends goes on with it.
        """
        strokes = _join(strokes)
        runs = self._draw(strokes[0])
        for before, stroke in pairwise(strokes):
            runs += [*self._move(before[-1][-1], stroke[0][0]), *self._draw(stroke)]
        if self.returns:
            runs += self._move(strokes[-1][-1][-1], strokes[0][0][0])
        return runs

    def _draw(self, stroke: Stroke) -> list[Run]:
        arcs = [
            line(*points) if len(points) == 2 else through(points, _PIECES) for points in stroke
        ]
        return _runs(arcs, [self._radius(*pair) for pair in pairwise(arcs)])

    def _radius(self, before: Arc, after: Arc) -> float | None:
        """Return the reach of the rounding between two curves [m]; None for a stop."""
        angle = turn(before.tangent[-1], after.tangent[0])
        if angle <= _NONE and before.straight and after.straight:
            return 0.0
        if angle <= _SLIGHT_ANGLE:
            return self.slight if self.radius is None else max(self.radius, self.slight)
        return None if angle >= _BACK else self.radius

    def _move(self, p: Array, q: Array) -> list[Run]:
        """Return the move from the end of a stroke to a start; none if they are the same."""
        if np.linalg.norm(q - p) < _SAME:
            return []
        if not self.lift.any():
            return [Run((line(p, q),))]
        arcs = [line(*pair) for pair in pairwise((p, p + self.lift, q + self.lift, q))]
        return _runs(arcs, [float(np.linalg.norm(self.lift))] * 2)


def _join(strokes: Sequence[Stroke]) -> list[Stroke]:
    strokes_joined = [list(strokes[0])]
    for stroke in strokes[1:]:
        if np.linalg.norm(stroke[0][0] - strokes_joined[-1][-1][-1]) < _SAME:
            strokes_joined[-1] += stroke
        else:
            strokes_joined.append(list(stroke))
    return list(strokes_joined)


def _runs(arcs: Sequence[Arc], radii: Sequence[float | None]) -> list[Run]:
    """Return the runs of curves one after another, divided where there is a stop.

    Args:
        arcs: The curves.
        radii: Reach of the rounding between each two of them [m]; None for a stop.
    """
    reaches = [
        0.0 if radius is None else min(radius, _SHARE * one.length, _SHARE * other.length)
        for radius, (one, other) in zip(radii, pairwise(arcs), strict=True)
    ]
    cut = [
        arc.part(begin, arc.length - end) if begin or end else arc
        for arc, begin, end in zip(arcs, [0.0, *reaches], [*reaches, 0.0], strict=True)
    ]
    runs: list[list[Arc]] = [[cut[0]]]
    for radius, reach, (before, after) in zip(radii, reaches, pairwise(cut), strict=True):
        if radius is None:
            runs.append([])
        elif reach:
            runs[-1].append(rounding(before, after, reach))
        runs[-1].append(after)
    return [Run(tuple(run)) for run in runs]


def divide(points: Array) -> list[Array]:
    """Return points, shape (k, 3), divided at corners: where lines between them turn sharply."""
    ways = np.diff(points, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    t, u = ways[:-1], ways[1:]
    turns = 2.0 * np.arctan2(*(np.linalg.norm(way, axis=1) for way in (u - t, u + t)))
    ends = [0, *(np.flatnonzero(turns >= CORNER) + 1).tolist(), len(points) - 1]
    return [points[begin : end + 1] for begin, end in pairwise(ends)]


# Largest distance from a slight corner at which its rounding begins, as a share of the drawing.
_SLIGHT = 0.01
# Height, as a share of that to which a pen is lifted, above which it does not draw.
_LIFT = 1e-3


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
        return np.asarray(np.abs(heights) <= _LIFT * abs(self.lift))

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


#: Names of the fonts.
FONTS: list[str] = list(HersheyFonts().default_font_names)
#: Characters that a text may have: more take hours to write.
MOST_CHARACTERS = 500
# Distance of two lines, relative to the height of capital letters.
_LINES = 1.6
# Length of a line, relative to the shorter one beside it, from which it is straight in a curve.
_LONG = 2.0


@validated
class Text(Drawing):
    """Text in letters of single strokes, by Hershey's fonts.

    The path passes the points of each letter, with a smooth curve through those between which the
    letter's lines turn by less than 55 degrees; the others are corners. The text's own origin is
    the centre of what is drawn.

    Source:
        A. V. Hershey, Calligraphy for Computers, 1967.
    """

    kind: Literal["text"] = "text"
    summary = "Text in letters of single strokes, by Hershey's fonts."
    text: Annotated[
        str,
        Field(strict=True, max_length=MOST_CHARACTERS),
        Meaning("What is written; lines are divided by line breaks."),
    ]
    size: Annotated[Length, Meaning("Height of capital letters.", unit="m")]
    font: Annotated[
        str,
        Meaning(
            "Name of a font of the package HersheyFonts. Letters of ``futural``, ``rowmans`` and "
            "``scripts`` are lines alone, those of most others outlines.",
        ),
    ] = "futural"

    @cached_property
    def _strokes(self) -> list[Stroke]:
        lines = self._lines
        if not lines:
            raise ValueError(f"text: must have a letter that is drawn, unlike {self.text!r}")
        corners = np.concatenate(lines)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        return [list(map(_evenly_spaced, divide(points - middle))) for points in lines]

    @property
    def _lines(self) -> list[Array]:
        """Points of each line of the letters, shape (k, 3) [m]."""
        if self.font not in FONTS:
            raise ValueError(f"font: no font {self.font!r}; {nearest(self.font, FONTS)}")
        font = HersheyFonts()
        font.load_default_font(self.font)
        lines: list[Array] = []
        for number, text in enumerate(self.text.split("\n")):
            x = 0.0
            for character in text:
                glyph = font.all_glyphs.get(character)
                if glyph is None or (not glyph.strokes and character != " "):
                    raise ValueError(f"text: the font {self.font} has no {character!r}")
                height = glyph.base_line - glyph.cap_line
                base = glyph.base_line - _LINES * height * number
                left = x - glyph.left_offset
                for stroke in glyph.strokes:
                    points = np.array([(left + a, base - b, 0.0) for a, b in stroke])
                    lines.append(self.size / height * points)
                x += glyph.char_width
        return lines


def _evenly_spaced(points: Array) -> Array:
    """Return points with more of them on lines that are long beside the next ones.

    Without these the curve through the points would swing out where a line leads into a bend.
    """
    if len(points) == 2:
        return points
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    chords_with_ends = np.concatenate(([np.inf], chords, [np.inf]))
    beside = np.minimum(chords_with_ends[:-2], chords_with_ends[2:])
    counts = np.where(chords > _LONG * beside, np.ceil(2.0 * chords / beside), 1.0).astype(int)
    between = [
        p + np.arange(count)[:, None] / count * (q - p)
        for count, (p, q) in zip(counts, pairwise(points), strict=True)
    ]
    return np.vstack([*between, points[-1:]])
