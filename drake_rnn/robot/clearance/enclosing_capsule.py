"""The smallest capsule round points, as far as a search over its directions finds it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array

# Directions over half of a sphere, and how often the best is looked at more closely.
_DIRECTIONS, _CLOSER = 200, 4
# Beyond rounding errors of a projection [m].
_SAFE = 1e-9


class Enclosing(NamedTuple):
    """A capsule: all points within a radius of a segment.

    Attributes:
        ends: Ends of the segment, shape (2, 3) [m].
        radius: Radius [m].
    """

    ends: Array
    radius: float

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        length = float(np.linalg.norm(self.ends[1] - self.ends[0]))
        return np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius)


def enclosing_capsule(points: Array) -> Enclosing:
    """Return a small capsule that holds all points.

    The segment's direction is searched over a grid of a sphere that becomes finer; for each, the
    radius is that of the smallest circle round the projected points, and the segment as short as
    the points allow.

    Args:
        points: At least one point, shape (k, 3) [m].
    """
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    tried = np.concatenate((axes, _half_sphere(_DIRECTIONS)))
    best = min((_along(points, d) for d in tried), key=lambda found: found.volume)
    width = 2.0 / np.sqrt(_DIRECTIONS)
    rng = np.random.default_rng(0)
    for _ in range(_CLOSER):
        along = best.ends[1] - best.ends[0]
        length = np.linalg.norm(along)
        if length < _SAFE:
            break
        near = along / length + width * rng.uniform(-1.0, 1.0, (40, 3))
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        best = min((best, *(_along(points, d) for d in near)), key=lambda found: found.volume)
        width *= 0.4
    return best


def _along(points: Array, direction: Array) -> Enclosing:
    """Return the smallest capsule whose segment has a direction."""
    _, _, axes = np.linalg.svd(direction[None, :])
    plane = axes[1:]
    centre, radius = smallest_circle(points @ plane.T)
    radius += _SAFE
    s = points @ direction
    away = ((points @ plane.T - centre) ** 2).sum(axis=1)
    # How far before and after its foot on the axis a point is within the radius.
    reach = np.sqrt(np.maximum(radius**2 - away, 0.0))
    first, last = (s + reach).min(), (s - reach).max()
    if first > last:
        # A ball holds all points, and no segment is needed.
        first = last = 0.5 * (first + last)
    foot = centre @ plane
    return Enclosing(np.array([foot + first * direction, foot + last * direction]), float(radius))


def smallest_circle(points: Array) -> tuple[Array, float]:
    """Return centre and radius of the smallest circle round points of a plane, shape (k, 2).

    The circle through two or three of them that leaves none out: it grows by the farthest that is
    outside until there is none (as the algorithms of Welzl, "Smallest enclosing disks", 1991).
    """
    centre = points.mean(axis=0)
    far = points[((points - centre) ** 2).sum(axis=1).argmax()]
    on, centre, radius = [far], far, 0.0
    for _ in range(100):
        away = np.sqrt(((points - centre) ** 2).sum(axis=1))
        k = int(away.argmax())
        if away[k] <= radius * (1.0 + 1e-12) + 1e-15:
            break
        on, centre, radius = _basis([*on, points[k]])
    away = np.sqrt(((points - centre) ** 2).sum(axis=1))
    return centre, float(max(radius, away.max()))


def _basis(on: list[Array]) -> tuple[list[Array], Array, float]:
    """Return the two or three of up to four points whose circle holds them all, and the circle."""
    last = on[-1]
    best: tuple[list[Array], Array, float] | None = None
    for chosen in _choices(on[:-1], last):
        circle = _through(chosen)
        if circle is None:
            continue
        centre, radius = circle
        holds = all(np.linalg.norm(p - centre) <= radius * (1.0 + 1e-10) + 1e-15 for p in on)
        if holds and (best is None or radius < best[2]):
            best = (chosen, centre, radius)
    if best is None:
        centre = np.mean(on, axis=0)
        return on[-3:], centre, float(max(np.linalg.norm(p - centre) for p in on))
    return best


def _choices(others: list[Array], last: Array) -> list[list[Array]]:
    """Return the pairs and triples that hold the last point, the one which was outside."""
    pairs = [[p, last] for p in others]
    triples = [[p, r, last] for k, p in enumerate(others) for r in others[k + 1 :]]
    return pairs + triples


def _through(points: list[Array]) -> tuple[Array, float] | None:
    """Return the circle whose diameter is two points, or through three; None on a line."""
    if len(points) == 2:
        centre = 0.5 * (points[0] + points[1])
        return centre, float(np.linalg.norm(points[0] - centre))
    a, b = points[1] - points[0], points[2] - points[0]
    twice = 2.0 * (a[0] * b[1] - a[1] * b[0])
    if abs(twice) < 1e-18:
        return None
    aa, bb = a @ a, b @ b
    offset = np.array([b[1] * aa - a[1] * bb, a[0] * bb - b[0] * aa]) / twice
    return points[0] + offset, float(np.linalg.norm(offset))


def _half_sphere(count: int) -> Array:
    """Return unit vectors spread over half of a sphere, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z**2)
    return np.stack((r * np.cos(turn), r * np.sin(turn), z), axis=1)
