"""The capsules of an arm: fitted to its geometry, or read from a file, and placed in its model.

Fine capsules are several for each body. They are found in three steps: the body's surface is cut by
planes, a capsule is fitted to each piece, and a random search moves the ends of their segments
while each radius is the least with which every small triangle lies in one capsule. Bisection of
every triangle then proves that the surface is inside.
"""

# No postponed annotations: pydantic resolves those of fields.
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydrake.geometry import CalcVolume
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, PrismaticJoint

from ...errors import InvalidInputError
from ...inputs.documents import construct, read_yaml
from ...inputs.fields import Array, NonNegative, validated
from ...inputs.files import cached_numbers
from ...inputs.messages import nearest
from ...inputs.progress import telling
from ..arm import SECOND, Arm
from ..arm_description import GRIPPER
from ..kinematics import joints_to
from .arm_shapes import (
    ArmShapes,
    Enclosing,
    Part,
    arm_shapes,
    capsule_along,
    convex,
    enclosing_capsule,
    fit_name,
    half_sphere,
    hull_triangles,
    kept_capsule,
    payload_of,
)
from .capsules import ArmCapsules, Capsule, LinkPoses, number_names, off_segment

# Most fine capsules round each shape of a payload; corners that are nearer are the same [m].
_HELD, _SAME = 4, 1e-9
_SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))
# Least radius of a fitted capsule [m].
_THINNEST = 1e-5


@validated
class FineCapsules:
    """Several capsules for a body, which contain it more closely than one.

    Args:
        capsules: The capsules; bodies that are not among them have those of the file.
        left_out: Pairs that are not looked at, as in `CapsulesFile`, in place of those there.
        outside: How far a point of a face is outside of them at most [m].
        excess: Volume of their union over that of the convex hulls of what they contain.
        made_by: The command that fits them again.
    """

    capsules: list[Capsule]
    left_out: list[tuple[str, str]] = Field(default_factory=list)
    outside: NonNegative | None = None
    excess: NonNegative | None = None
    made_by: str = ""


@validated
class CapsulesFile:
    """The contents of a file of capsules.

    Args:
        capsules: The capsules; a body may have several.
        left_out: Pairs of bodies that are not looked at, because they cannot collide, or because
            their capsules touch where they do not. ``link 2`` is the second capsule of a body that
            has several.
        tools: Bodies of tools. What is stated of one counts only where the arm has it.
        source: The meshes that they hold, where these are not the model's own.
        fine: Several capsules a body, for ``arm.shapes: fine``.
    """

    capsules: list[Capsule]
    left_out: list[tuple[str, str]] = Field(default_factory=list)
    tools: list[str] = Field(default_factory=lambda: ["tool"])
    source: list[str] = Field(default_factory=list)
    fine: FineCapsules | None = None


def fitted_capsules(parts: Iterable[Part]) -> list[Capsule]:
    """Return a capsule round each part of an arm, which holds all of its points.

    They are kept in the cache: those of meshes take seconds to find.
    """
    capsules, every = [], list(parts)
    with telling("capsules are fitted to shapes") as tell:
        for k, part in enumerate(every):
            tell(f"{k} of {len(every)}")
            ends, radius = part.exact or kept_capsule(part.points)
            wide = max(radius, _THINNEST)
            capsules.append(Capsule(body=part.body, ends=(ends[0], ends[1]), radius=wide))
    return capsules


# In the search a surface is cut into triangles of this share of its size; of these it begins with
# the outermost in so many directions, and with one in each cell of so many of the size.
_EDGES, _CELLS, _MORE_CELLS = 16, 10, 40
_SPREAD = np.concatenate((half_sphere(100), -half_sphere(100)))
_AROUND = _SPREAD[::4]
# Points at which it is seen how much space is taken, and where that costs little [m].
_SAMPLES, _NEAR = 4000, 0.003
# Levels at which pieces are cut, further directions of cuts, and how many cuts are tried.
_LEVELS, _TURNS, _TRIALS = 7, 4, 4
# Moves of the search, the first shorter and the last longer one, and their shares of the size.
_MOVES, _MOST_MOVES, _WIDE, _NARROW = 150, 500, 0.1, 2e-3
# Pieces of a surface that are smaller than this are not cut any more [m]; numbers of a file [m].
_SMALLEST, _DIGIT = 2e-5, 1e-6


def covering_capsules(
    triangles: Array,
    most: int = 3,
    gain: float = 0.05,
    seed: int = 0,
    beside: Sequence[Enclosing] = (),
    effort: int = 1,
) -> list[Enclosing]:
    """Return a few capsules that together contain a surface, every vertex and every face.

    Args:
        triangles: Corners of the triangles of the surface, shape (t, 3, 3) [m].
        most: Largest number of capsules.
        gain: Share of the cost by which one more must lower it, to be taken. The cost is the space
            that is taken, where it counts with its squared distance from the surface; the space
            itself must become less, too.
        seed: Seed of the search.
        beside: Capsules that are there already: what they contain need not be contained, and space
            in them costs nothing.
        effort: Number of searches, of so many times as many moves. The capsules that take the least
            space count.
    """
    if beside:
        triangles = cut_small(triangles, float(np.ptp(triangles, axis=(0, 1)).max()) / _EDGES)
        over = [_needs(triangles, each.ends) - each.radius for each in beside]
        triangles = triangles[np.min(over, axis=0) > 0.0]
    searches = (_search(triangles, most, gain, seed + k, beside, effort) for k in range(effort))
    return min(searches, key=union_volume)


def _search(
    triangles: Array,
    most: int,
    gain: float,
    seed: int,
    beside: Sequence[Enclosing],
    effort: int,
) -> list[Enclosing]:
    """Return what a search for capsules finds, see `covering_capsules`."""
    surface = _Surface(triangles, np.random.default_rng(seed), effort)
    for capsule in beside:
        is_taken = off_segment(surface.samples, capsule.ends) <= capsule.radius
        surface.weights[is_taken] = 0.0
    first = enclosing_capsule(surface.outermost(surface.used))
    best = _settle(surface, [first.ends])
    partitions: list[_Partition] = [[(np.arange(len(surface.used)), first)]]
    for _ in range(1, most):
        cuts = (cut for partition in partitions for cut in _cuts(surface, partition))
        partitions = [cut for _, cut in sorted(cuts, key=lambda each: each[0])[::3][:_TRIALS]]
        if not partitions:
            break
        trials = [_Cover(surface, _fitted(surface, each)).improve() for each in partitions]
        trials.sort(key=lambda trial: trial.cost)
        new = min((_settle(surface, t.ends) for t in trials[:2]), key=lambda trial: trial.cost)
        is_smaller = union_volume(new.capsules) < union_volume(best.capsules)
        if is_smaller and new.cost < (1.0 - gain) * best.cost:
            best = new
        partitions = partitions[:2]
    return _proven(surface.triangles, best.capsules)


def outside_of(triangles: Array, capsules: Sequence[Enclosing]) -> float:
    """Return how far a surface reaches out of the union of capsules at most [m]; 0 if nowhere.

    Triangles that may reach farther than the corners that were looked at are bisected, until each
    piece is in one capsule, or smaller than 20 um: so the bound holds for every point of every
    face. Outside of the capsules it is exact to one percent.
    """
    farthest = bound = 0.0
    while len(triangles):
        away = _away(triangles, capsules)
        farthest = max(farthest, float(away.min(axis=0).max()))
        over = away.max(axis=2).min(axis=0)
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        is_open = (over > 1.01 * farthest) & (sides.max(axis=1) >= _SMALLEST)
        bound = max(bound, float(over[~is_open].max(initial=0.0)))
        triangles = _halves(triangles[is_open], sides[is_open])
    return bound


def fine_capsules(surfaces: Mapping[str, Array], most: int = 3, effort: int = 1) -> list[Capsule]:
    """Return a few capsules round each body, see `covering_capsules`.

    Args:
        surfaces: Triangles of each body, shape (t, 3, 3) each, in its frame [m].
        most: Largest number of capsules of a body.
        effort: Number of searches for those of a body.
    """
    capsules: list[Capsule] = []
    with telling("fine capsules are fitted") as tell:
        for k, (body, triangles) in enumerate(surfaces.items(), start=1):
            tell(f"{body}, {k} of {len(surfaces)}")
            capsules += [
                Capsule(body=body, ends=(each.ends[0], each.ends[1]), radius=each.radius)
                for each in covering_capsules(triangles, most, effort=effort)
            ]
    return capsules


def rounded(capsule: Capsule, points: Array) -> Capsule:
    """Return a capsule with numbers of a micrometre that contains points, shape (k, 3) [m]."""
    ends = np.round(capsule.ends, 6)
    inner = Capsule(body=capsule.body, ends=(ends[0], ends[1]), radius=capsule.radius)
    radius = capsule.radius + max(0.0, float(inner.outside(points).max()))
    return replace(inner, radius=round(float(np.ceil(radius / _DIGIT)) * _DIGIT, 6))


def union_volume(capsules: Sequence[Capsule | Enclosing], points: int = 200_000) -> float:
    """Return the volume of the union of capsules of one body [m^3], by random points."""
    ends = np.array([capsule.ends for capsule in capsules])
    radii = np.array([capsule.radius for capsule in capsules])[:, None, None]
    low, high = (ends - radii).min(axis=(0, 1)), (ends + radii).max(axis=(0, 1))
    sample = np.random.default_rng(0).uniform(low, high, (points, 3))
    away = [off_segment(sample, e) - r for e, r in zip(ends, radii[:, 0, 0], strict=True)]
    inside = np.min(away, axis=0) <= 0.0
    return float(inside.mean() * np.prod(high - low))


@dataclass(frozen=True)
class Fit:
    """How closely capsules contain a body.

    Attributes:
        body: Name of the body.
        radii: Radii of its capsules [m].
        volume: Volume of their union [m^3].
        hull: Volume of the convex hull of the body [m^3].
        outside: How far a point of a face is outside of them at most [m].
    """

    body: str
    radii: tuple[float, ...]
    volume: float
    hull: float
    outside: float


def fits_of(surfaces: Mapping[str, Array], capsules: Sequence[Capsule]) -> list[Fit]:
    """Return how closely capsules contain each of the bodies, given as for `fine_capsules`."""
    fits = []
    for body, triangles in surfaces.items():
        own = [capsule for capsule in capsules if capsule.body == body]
        far = outside_of(triangles, [Enclosing(np.array(c.ends), c.radius) for c in own])
        hull = CalcVolume(convex(triangles.reshape(-1, 3), body))
        fits.append(Fit(body, tuple(c.radius for c in own), union_volume(own), hull, far))
    return fits


def capsules_text(
    capsules: Sequence[Capsule], left_out: Iterable[tuple[str, str, str]], indent: str = ""
) -> str:
    """Return capsules, and pairs with a note each, as text of a file of capsules."""
    lines = ["capsules:"]
    for capsule in capsules:
        numbers = [", ".join(f"{x:.6g}" for x in np.round(e, 6) + 0.0) for e in capsule.ends]
        lines += [f"- body: {capsule.body}", "  ends:", *(f"  - [{x}]" for x in numbers)]
        lines.append(f"  radius: {capsule.radius:.6f}")
    pairs = [f"- [{one}, {other}]  # {note}" for one, other, note in left_out]
    lines += ["left_out:", *pairs] if pairs else ["left_out: []"]
    return "".join(f"{indent}{line}\n" for line in lines)


def fine_text(
    capsules: Sequence[Capsule],
    left_out: Iterable[tuple[str, str, str]],
    fits: Sequence[Fit],
    made_by: str,
) -> str:
    """Return fine capsules as text of a file of capsules, with how closely they fit."""
    excess = sum(fit.volume for fit in fits) / sum(fit.hull for fit in fits)
    return (
        f"fine:\n  made_by: {made_by}\n"
        f"  outside: {max(fit.outside for fit in fits):.6f}\n  excess: {excess:.2f}\n"
        + capsules_text(capsules, left_out, "  ")
    )


class _Surface:
    """The surface that capsules are to contain, and the space round it.

    Attributes:
        triangles: All of its triangles, shape (t, 3, 3) [m].
        small: The same, cut into small ones, shape (s, 3, 3) [m].
        used: Those of them that the search looks at; more are added behind them.
        size: Largest extent [m].
        rng: Random numbers of the search.
        effort: By how much the search has more moves.
        samples: Points round the surface, shape (k, 3) [m].
        weights: What each of them costs, shape (k,).
    """

    def __init__(self, triangles: Array, rng: np.random.Generator, effort: int) -> None:
        self.triangles, self.rng, self.effort = triangles, rng, effort
        self.size = float(np.ptp(triangles, axis=(0, 1)).max())
        self.small = cut_small(triangles, self.size / _EDGES)
        first = enclosing_capsule(self.outermost(self.small))
        cells = (self.small.mean(axis=1) * (_CELLS / self.size)).round()
        far = (self.small.reshape(-1, 3) @ _SPREAD.T).argmax(axis=0) // 3
        self._is_used = np.zeros(len(self.small), dtype=bool)
        self._is_used[far] = self._is_used[np.unique(cells, axis=0, return_index=True)[1]] = True
        self.used = self.small[self._is_used]
        low = (first.ends - first.radius).min(axis=0)
        high = (first.ends + first.radius).max(axis=0)
        self.samples = rng.uniform(low, high, (_SAMPLES, 3))
        points = self.small[:: 1 + len(self.small) // 2000].mean(axis=1)
        squares = np.full(_SAMPLES, np.inf)
        for some in np.array_split(points, 20):
            each = ((self.samples[:, None] - some) ** 2).sum(axis=2)
            squares = np.minimum(squares, each.min(axis=1, initial=np.inf))
        self.weights = np.prod(high - low) / _SAMPLES * (squares + _NEAR**2)

    @staticmethod
    def outermost(triangles: Array) -> Array:
        """Return the corners that are outermost in 200 directions, shape (k, 3) [m]."""
        corners = triangles.reshape(-1, 3)
        return corners[np.unique((corners @ _SPREAD.T).argmax(axis=0))]

    def use_outside(self, capsules: Sequence[Enclosing]) -> bool:
        """Use more of the triangles that are outside; return whether there are any."""
        each = np.array([_needs(self.small, c.ends) - c.radius for c in capsules], dtype=np.float64)
        over: Array = each.min(axis=0)
        out = np.flatnonzero(np.where(self._is_used, False, over > _SAFE))
        out = out[np.argsort(-over[out])]
        cells = (self.small[out].mean(axis=1) * (_MORE_CELLS / self.size)).round()
        fresh = out[np.unique(cells, axis=0, return_index=True)[1]]
        self._is_used[fresh] = True
        self.used = np.concatenate((self.used, self.small[fresh]))
        return len(fresh) > 0


# Beyond rounding errors [m].
_SAFE = 1e-9
# Pieces of a surface: numbers of its triangles in use, and a capsule round them.
_Partition = list[tuple[NDArray[np.intp], Enclosing]]


class _Cover:
    """Capsules in the search: together they contain all triangles in use.

    Attributes:
        ends: Ends of their segments, shape (c, 2, 3) [m].
        radii: The least radii with which they do, each with those of the others, shape (c,) [m].
        cost: What the space in them costs.
    """

    def __init__(self, surface: _Surface, ends: Sequence[Array] | Array) -> None:
        self._surface, self.ends = surface, np.array(ends)
        self._needs = np.array([_needs(surface.used, each) for each in self.ends])
        self._away = np.array([off_segment(surface.samples, each) for each in self.ends])
        nearest_one = self._needs.argmin(axis=0)
        radii = [n[nearest_one == k].max(initial=0.0) for k, n in enumerate(self._needs)]
        self.radii = _tight(self._needs, np.array(radii))
        self.cost = self._cost_of(self._away, self.radii)

    @property
    def capsules(self) -> list[Enclosing]:
        """Those of them that contain anything."""
        both = zip(self.ends, self.radii, strict=True)
        return [Enclosing(ends, float(radius)) for ends, radius in both if radius > 0.0]

    def _cost_of(self, away: Array, radii: Array) -> float:
        return float(self._surface.weights[(away <= radii[:, None]).any(axis=0)].sum())

    def improve(self, moves: int = _MOVES) -> "_Cover":
        """Move the ends at random, ever less; what costs less is kept."""
        rng, size = self._surface.rng, self._surface.size
        moves *= self._surface.effort
        for share in np.linspace(0.0, 1.0, moves, endpoint=False):
            k, kind = rng.integers(len(self.ends)), rng.integers(3)
            move = rng.normal(0.0, size * _WIDE * (_NARROW / _WIDE) ** share, (2, 3))
            if kind == 0:
                move[1] = move[0]
            elif kind == 1:
                move[rng.integers(2)] = 0.0
            self._try(int(k), self.ends[k] + move)
        return self

    def _try(self, k: int, ends: Array) -> None:
        needs, away, radii = self._needs.copy(), self._away.copy(), self.radii.copy()
        needs[k] = _needs(self._surface.used, ends)
        away[k] = off_segment(self._surface.samples, ends)
        contains = needs <= radii[:, None]
        contains[k] = False
        radii[k] = needs[k][~contains.any(axis=0)].max(initial=0.0)
        radii = _tight(needs, radii)
        if (cost := self._cost_of(away, radii)) < self.cost:
            self._needs, self._away, self.radii, self.cost = needs, away, radii, cost
            self.ends[k] = ends


def _settle(surface: _Surface, ends: Sequence[Array] | Array) -> _Cover:
    """Return capsules that contain all small triangles, as far as a few rounds add those."""
    cover = _Cover(surface, ends).improve(_MOST_MOVES)
    for _ in range(3):
        if not surface.use_outside(cover.capsules):
            break
        cover = _Cover(surface, cover.ends).improve()
    return cover


def _fitted(surface: _Surface, partition: _Partition) -> list[Array]:
    outermost = (surface.outermost(surface.used[numbers]) for numbers, _ in partition)
    return [enclosing_capsule(points).ends for points in outermost]


def _cuts(surface: _Surface, partition: _Partition) -> Iterator[tuple[float, _Partition]]:
    """Yield partitions of which one piece is cut in two by a plane, with what each costs."""
    for k, (numbers, _) in enumerate(partition):
        rest = [piece for j, piece in enumerate(partition) if j != k]
        middles = surface.used[numbers].mean(axis=1)
        axes = np.linalg.svd(middles - middles.mean(axis=0), full_matrices=False)[2]
        for normal in np.concatenate((axes, np.eye(3), half_sphere(_TURNS))):
            along = middles @ normal
            for level in np.linspace(along.min(), along.max(), _LEVELS + 2)[1:-1]:
                is_below = along < level
                if min(is_below.sum(), (~is_below).sum()) < 4:
                    continue
                sides = [numbers[is_below], numbers[~is_below]]
                directions = (axes[0], axes[1], normal)
                cut = [*rest, *((side, _rough(surface.used[side], directions)) for side in sides)]
                taken = [off_segment(surface.samples, c.ends) <= c.radius for _, c in cut]
                yield float(surface.weights[np.any(taken, axis=0)].sum()), cut


def _rough(triangles: Array, directions: Iterable[Array]) -> Enclosing:
    """Return about the smallest capsule round triangles with one of some directions."""
    points = triangles.reshape(-1, 3)
    points = points[np.unique((points @ _AROUND.T).argmax(axis=0))]
    return min((capsule_along(points, d) for d in directions), key=lambda found: found.volume)


def _tight(needs: Array, radii: Array) -> Array:
    """Return radii made smaller, the largest first, by what other capsules contain."""
    radii = radii.copy()
    for k in np.argsort(-radii):
        contains = needs <= radii[:, None]
        contains[k] = False
        radii[k] = needs[k][~contains.any(axis=0)].max(initial=0.0)
    return radii


def _needs(triangles: Array, ends: Array) -> Array:
    """Return the radius with which a capsule contains each triangle, shape (t,) [m].

    A capsule is convex: it contains a triangle if it contains its corners.
    """
    return np.asarray(off_segment(triangles.reshape(-1, 3), ends).reshape(-1, 3).max(axis=1))


def _away(triangles: Array, capsules: Sequence[Enclosing]) -> Array:
    """Return how far corners are outside of capsules, shape (capsules, t, 3) [m]."""
    corners = triangles.reshape(-1, 3)
    away = [off_segment(corners, each.ends) - each.radius for each in capsules]
    return np.array(away).reshape(len(capsules), -1, 3)


def _halves(triangles: Array, sides: Array) -> Array:
    """Return triangles cut in the middle of their longest sides."""
    longest, every = sides.argmax(axis=1), np.arange(len(triangles))
    a, b, c = (triangles[every, (longest + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))


def cut_small(triangles: Array, longest: float) -> Array:
    """Return triangles cut until no side is longer."""
    done = []
    while len(triangles):
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        is_long = sides.max(axis=1) > longest
        done.append(triangles[~is_long])
        triangles = _halves(triangles[is_long], sides[is_long])
    return np.concatenate(done)


def _proven(triangles: Array, capsules: Sequence[Enclosing]) -> list[Enclosing]:
    """Return capsules with numbers of a file, grown until they contain a surface.

    They grow round corners that are outside of all. Triangles of which no capsule has all corners
    are bisected; round pieces that are smaller than 20 um a capsule grows.
    """
    ends = np.round([each.ends for each in capsules], 6)
    radii = np.array([np.ceil(each.radius / _DIGIT) * _DIGIT for each in capsules])
    while len(triangles):
        away = _away(triangles, [Enclosing(*each) for each in zip(ends, radii, strict=True)])
        away -= _grow(radii, away.reshape(len(radii), -1))[:, None, None]
        over = away.max(axis=2)
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        is_small = sides.max(axis=1) < _SMALLEST
        over -= _grow(radii, over * is_small)[:, None]
        is_open = (over > 0.0).all(axis=0)
        triangles = _halves(triangles[is_open], sides[is_open])
    rounded_radii = np.ceil(np.round(radii / _DIGIT, 3)) * _DIGIT
    return [Enclosing(e, round(float(r), 6)) for e, r in zip(ends, rounded_radii, strict=True)]


def _grow(radii: Array, away: Array) -> Array:
    """Let each capsule grow by what is nearest to it and outside of all, shape (capsules, k) [m].

    Returns:
        By how much each has grown, shape (capsules,) [m].
    """
    nearest_one, is_out = away.argmin(axis=0), (away > 0.0).all(axis=0)
    more = np.array(
        [each[is_out & (nearest_one == k)].max(initial=0.0) for k, each in enumerate(away)]
    )
    more = np.where(more > 0.0, np.ceil(more / _DIGIT) * _DIGIT, 0.0)
    radii += more
    return more


@lru_cache(maxsize=32)
def _round_hull(points: bytes) -> tuple[Enclosing, ...]:
    """Return fine capsules round the hull of points, shape (k, 3) [m]; they take seconds to fit."""
    corners = np.frombuffer(points).reshape(-1, 3)

    def fit() -> Array:
        found = covering_capsules(hull_triangles(corners), _HELD)
        return np.array([[*each.ends.ravel(), each.radius] for each in found])

    with telling("fine capsules are fitted to a shape"):
        rows = cached_numbers(fit_name(f"hull{_HELD}", corners), fit).reshape(-1, 7)
    return tuple(Enclosing(row[:6].reshape(2, 3), float(row[6])) for row in rows)


def _round_held(arm: Arm, points: Array) -> Sequence[Enclosing]:
    """Return fine capsules round a shape of what an arm holds, of which points are known."""
    payload = arm.description.payload
    for solid in () if payload is None else payload.shapes:
        if solid.size is None:
            continue
        R, p = solid.X_HG.rotation().matrix(), solid.X_HG.translation()
        corners = p + (0.5 * solid.size * _SIGNS) @ R.T
        away = np.linalg.norm(points[:, None] - corners, axis=-1)
        if len(points) == len(corners) and away.min(axis=0).max() < _SAME:
            return [
                Enclosing(p + each.ends @ R.T, each.radius)
                for each in capsules_in_box(solid.size, _HELD)
            ]
    return _round_hull(points.tobytes())


def capsules_in_box(size: Array, most: int) -> list[Enclosing]:
    """Return parallel capsules that contain a box, one round each cell of a grid across it.

    A cell is as long as the box. Its corners are on the balls round the ends of a segment through
    its middle, so that the capsule contains it.

    Args:
        size: Edges of the box, shape (3,) [m].
        most: Largest number of capsules.
    """
    grids = [
        (along, m, n) for along in range(3) for m in range(1, most + 1) for n in range(1, most + 1)
    ]

    def space(grid: tuple[int, int, int]) -> float:
        """Return the volume of a box round the capsules."""
        along, *counts = grid
        across = np.delete(size, along) / counts
        radius = 0.5 * float(np.linalg.norm(across))
        return float((np.delete(size, along) + 2.0 * radius - across).prod()) * (
            float(size[along]) + 2.0 * radius
        )

    along, *counts = min((g for g in grids if g[1] * g[2] <= most), key=space)
    first, second = np.delete(np.arange(3), along)
    across = size[[first, second]] / counts
    # Cells overlap a little: pieces of faces across a seam are in one of them, see `outside_of`.
    radius = float(np.ceil((0.5 * np.linalg.norm(across) + 2.0 * _SMALLEST) / _DIGIT) * _DIGIT)
    capsules = []
    for k, m in product(*map(range, counts)):
        ends = np.zeros((2, 3))
        ends[:, first] = across[0] * (k + 0.5) - 0.5 * size[first]
        ends[:, second] = across[1] * (m + 0.5) - 0.5 * size[second]
        ends[:, along] = 0.5 * size[along] * np.array([-1.0, 1.0])
        capsules.append(Enclosing(ends, radius))
    return capsules


def capsules_of(
    arm: Arm, shapes: ArmShapes | None = None
) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return the capsules of an arm, and the pairs of bodies that its file leaves out.

    Without a file all of them are fitted. To bodies that a file does not have, such as a tool that
    was added, capsules are fitted.

    Args:
        arm: The arm.
        shapes: The shapes of its bodies, if they are known already.

    Raises:
        InvalidInputError: If the file cannot be read, a field is wrong, a body does not exist, or a
            body without a capsule has a shape that has no bounds.
    """
    shapes = arm_shapes(arm) if shapes is None else shapes
    own_capsules, left_out = _read_capsules(arm)
    bodies = {capsule.body for capsule in own_capsules}
    for body, kind in shapes.endless.items():
        if body not in bodies:
            raise InvalidInputError(
                f"arm: {body!r} has a {kind}, round which no capsule fits; give the body a capsule "
                f"in a file: {capsules_key(body)}"
            )
    others = [part for part in shapes.parts if part.body not in bodies]
    held = [part for part in others if part.body == payload_of(arm) and not part.exact]
    if arm.description.shapes == "fine" and held:
        others = [part for part in others if part not in held]
        own_capsules += (
            Capsule(body=part.body, ends=(each.ends[0], each.ends[1]), radius=each.radius)
            for part in held
            for each in _round_held(arm, part.points)
        )
    return [*own_capsules, *fitted_capsules(others)], left_out


def capsules_key(body: str) -> str:
    """Return the key of a document that names the file of a body's capsules."""
    return "arm.gripper.capsules" if body.startswith(GRIPPER) else "arm.capsules"


def stated_bodies(arm: Arm) -> frozenset[str]:
    """Return the names of the bodies to which an arm's file gives capsules.

    Raises:
        InvalidInputError: As `capsules_of` does.
    """
    return frozenset(capsule.body for capsule in _read_capsules(arm)[0])


def fine_of_meshes(arm: Arm) -> bool:
    """Return whether an arm's capsules are fine ones round meshes that its model does not have."""
    file = arm.description.capsules
    if arm.description.shapes != "fine" or file is None:
        return False
    return bool(construct(CapsulesFile, read_yaml(Path(file)), file).source)


def _read_capsules(arm: Arm) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return what the files of an arm, and of a second one, state of bodies that it has."""
    capsules, left_out = _read_own_capsules(arm)
    if arm.other is None:
        return capsules, left_out
    others, others_out = _read_capsules(arm.other)
    capsules = [*capsules, *(replace(each, body=SECOND + each.body) for each in others)]
    return capsules, [*left_out, *((SECOND + a, SECOND + b) for a, b in others_out)]


def _read_own_capsules(arm: Arm) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return what the files of an arm and of its gripper state of bodies that the arm has."""
    capsules, left_out = _read_arm_capsules(arm)
    gripper = arm.description.gripper
    if gripper is None or (file := gripper.capsules) is None:
        return capsules, left_out
    names = [n.removeprefix(GRIPPER) for n in _names(arm.plant()) if n.startswith(GRIPPER)]
    read = construct(CapsulesFile, read_yaml(Path(file)), file)
    own, own_out = read.capsules, read.left_out
    if arm.description.shapes == "fine" and read.fine is not None:
        bodies = {capsule.body for capsule in read.fine.capsules}
        own = [*read.fine.capsules, *(each for each in own if each.body not in bodies)]
        own_out = read.fine.left_out
    known = {*names, *number_names([capsule.body for capsule in own if capsule.body in names])}
    for name in (*(capsule.body for capsule in own), *(n for pair in own_out for n in pair)):
        if name not in known:
            raise InvalidInputError(
                f"arm.gripper.capsules: {file}: no body {name!r} in {Path(gripper.model).name}; "
                + nearest(name, names)
            )
    capsules = [*capsules, *(replace(each, body=GRIPPER + each.body) for each in own)]
    return capsules, [*left_out, *((GRIPPER + a, GRIPPER + b) for a, b in own_out)]


def _read_arm_capsules(arm: Arm) -> tuple[list[Capsule], list[tuple[str, str]]]:
    """Return what an arm's file states of bodies that the arm has."""
    is_fine = arm.description.shapes == "fine"
    if (file := arm.description.capsules) is None:
        if is_fine:
            raise _no_fine_capsules(arm, "no file of capsules is given, arm.capsules")
        return [], []
    read = construct(CapsulesFile, read_yaml(Path(file)), file)
    capsules, left_out, where = read.capsules, read.left_out, file
    if is_fine:
        if read.fine is None:
            raise _no_fine_capsules(arm, f"{file} has none")
        own = {capsule.body for capsule in read.fine.capsules}
        capsules = [*read.fine.capsules, *(each for each in capsules if each.body not in own)]
        left_out, where = read.fine.left_out, f"{file}: fine"
    names = _names(arm.plant())
    absent = set(read.tools) - set(names)
    bodies = [capsule.body for capsule in capsules if capsule.body in names]
    names_of_file = {*names, *absent, *number_names(bodies)}
    for name in (name for pair in left_out for name in pair):
        if name not in names_of_file:
            raise InvalidInputError(
                f"{where}: left_out: no body {name!r} in {arm.model.name}; {nearest(name, names)}"
            )
    left_out = [pair for pair in left_out if not absent & set(pair)]
    return [capsule for capsule in capsules if capsule.body not in absent], left_out


def _no_fine_capsules(arm: Arm, why: str) -> InvalidInputError:
    return InvalidInputError(
        f"arm.shapes: no fine capsules of {arm.name} are known: {why}; "
        f"drake-rnn arm {arm.model.name} --fit FILE fits them"
    )


def _names(plant: MultibodyPlant) -> list[str]:
    """Return the names of all bodies of a plant but the world."""
    bodies = map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies())))
    return [body.name() for body in bodies]


def place_capsules(arm: Arm, capsules: list[Capsule]) -> ArmCapsules:
    """Return an arm's capsules where all of its joints are at zero.

    Raises:
        InvalidInputError: If a body does not exist, or joints that are controlled do not follow one
            after the other from base to tip, of each of two tools.
    """
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
    axes, points, slides = [], [], []
    for name in arm.joints:
        joint = plant.GetJointByName(name)
        X_WF = joint.frame_on_parent().CalcPoseInWorld(context)
        slides.append(isinstance(joint, PrismaticJoint))
        axis = joint.translation_axis() if slides[-1] else joint.revolute_axis()
        axes.append(X_WF.rotation().matrix() @ axis)
        points.append(X_WF.translation())
    names = _names(plant)
    links, ends = [], []
    for capsule in capsules:
        if capsule.body not in names:
            raise InvalidInputError(
                f"arm.capsules: no body {capsule.body!r} in {arm.model.name}; "
                + nearest(capsule.body, names)
            )
        body = plant.GetBodyByName(capsule.body)
        joint_names = [joint.name() for joint in joints_to(plant, body) if joint.num_positions()]
        chains = [
            chain
            for chain, begin in enumerate(arm.begins)
            if joint_names == list(arm.joints[begin : begin + len(joint_names)])
        ]
        if not chains:
            raise InvalidInputError(
                f"arm.joints: {capsule.body!r} is moved by {', '.join(joint_names)}, which are not "
                "the first of the controlled joints; capsules need joints one after the other"
            )
        X_WB = body.EvalPoseInWorld(context)
        # The base of a second arm does not move: its bodies count as those of the first one.
        moved = arm.begins[chains[0]] + chains[0] + len(joint_names)
        links.append(moved if joint_names else 0)
        ends.append([X_WB @ end for end in capsule.ends])
    farthest = np.maximum(np.abs(arm.limits.position_lower), np.abs(arm.limits.position_upper))
    travels = np.where(slides, farthest, 0.0)
    return ArmCapsules(
        poses=LinkPoses(np.array(axes), np.array(points), tuple(slides), travels, arm.begins),
        bodies=tuple(capsule.body for capsule in capsules),
        links=np.array(links),
        ends=np.array(ends).reshape(-1, 2, 3),
        radii=np.array([capsule.radius for capsule in capsules]),
    )
