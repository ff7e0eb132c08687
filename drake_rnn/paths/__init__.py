r"""Paths: desired motions of the end effector, with exact first and second derivatives.

`Path` is what all of them are; `Path.placed` gives the motion in the world frame. A `Curve` is
traced by its phase f in [0, 2 pi], to which a time law (see `timing`) maps time. A planar curve is
the complex number z(f) = x + i y, relative to an origin of its own:

=============  =======================================================================
kind           z(f); a = size
=============  =======================================================================
circle         a e^{if}
nephroid       a (3 e^{if} - e^{3if}), from the cusp at 2a
four_ring      a (e^{if} + b e^{-3if}), b = ring
clover         a cos(2f) e^{if} from a tip, or a sin(2f) e^{if} from the centre
deltoid        a (2 e^{if} + e^{-2if}), from the cusp at 3a
cat            a R(S) e^{iS}, S = f - pi/2: a head with two ears, from the chin
square         side a, from a corner: -x, +y, +x, -y; the origin is its centre
parallelogram  sides u, v: +u, +v, -u, -v; the origin is its centre
line           straight, open, with a turn if asked for
spline         cubic spline through points in space, open
points         the same; periodic if it is closed
rest           a fixed point
text           letters of single strokes, joined by moves
svg            the shapes of an SVG file, joined by moves
=============  =======================================================================

Not traced by phase are ``text`` and ``svg`` (see `drawing`), ``waypoints``, through positions and
orientations at given times (see `pieces`), ``sequence``, paths one after another, and
`TrajectoryPath`, a trajectory of Drake's.

Source:
    Classical curves. The papers that follow a nephroid, a four-ring, a four-leaf clover, a
    tricuspid or a cat give no formula for it; these formulas are this package's own.

The cat's outline is R = 1 + .4 g(.32 pi, .17) + .4 g(.68 pi, .17) - .12 g(.5 pi, .2)
- .1 g(1.5 pi, .5) - .1 g(-.5 pi, .5), with g(c, w) = exp(-(S - c)^2 / (2 w^2)); its two ends
meet within 1e-30.

The straight edges of "sharp" figures take equal times, and the time law applies to each of
them. With "uniform" the speed is constant along an edge and the velocity jumps at the corners;
with all other time laws the point rests at the corners. Every other curve is one segment.
"""

from ..inputs.kinds import Kinds
from .planar import Cat as Cat
from .curve import Curve as Curve
from .drawing import Drawing as Drawing
from .joint_targets import JointTargets as JointTargets, RecordedTargets as RecordedTargets
from .path import LedPath as LedPath
from .curve import Line as Line
from .path import (
    BASE as BASE,
    TOOL as TOOL,
    Motion as Motion,
    Passage as Passage,
    Path as Path,
    PlacedPath as PlacedPath,
)
from .planar import Planar as Planar
from .points import Points as Points, Spline as Spline, ThroughPoints as ThroughPoints
from .planar import (
    Parallelogram as Parallelogram,
    Square as Square,
)
from .path import RelativePath as RelativePath
from .curve import Rest as Rest
from .sequence import Part as Part, Sequence as Sequence
from .svg import Svg as Svg
from .joint_targets import TargetPath as TargetPath
from .drawing import Text as Text
from .curve import (
    TimeLaw as TimeLaw,
    Timing as Timing,
    time_at as time_at,
    time_law as time_law,
)
from .trajectory import TrajectoryPath as TrajectoryPath, as_path as as_path
from .planar import (
    Circle as Circle,
    Clover as Clover,
    Deltoid as Deltoid,
    FourRing as FourRing,
    Nephroid as Nephroid,
    Trigonometric as Trigonometric,
)
from .points import Waypoints as Waypoints

#: The curves an experiment may name, by their ``kind``.
PATHS: Kinds[Path] = Kinds(
    "path",
    Path,
    {
        "circle": Circle,
        "nephroid": Nephroid,
        "four_ring": FourRing,
        "clover": Clover,
        "deltoid": Deltoid,
        "cat": Cat,
        "square": Square,
        "parallelogram": Parallelogram,
        "line": Line,
        "waypoints": Waypoints,
        "points": Points,
        "spline": Spline,
        "rest": Rest,
        "text": Text,
        "svg": Svg,
        "sequence": Sequence,
    },
)
