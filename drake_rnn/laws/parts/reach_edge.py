r"""Coming to rest where a target is out of reach, at the point that is nearest to it.

There the task wants what no motion brings. In the direction u_i in which the target is out of reach
the singular value of J falls to 0, in proportion to the way w_i = sigma_i / c that the joints have
left. A feedback f_i that does not fall as well wants the joint velocity sigma_i f_i / (sigma_i^2 +
mu). Near the end of the way this goes from one bound to the other within a few milliradians, which
no joint with a bounded acceleration or jerk can follow: the arm swings there for ever.

So a joint velocity that comes of the feedback must be one that can be braked on the way left,

.. math::
    |f_i| \le \frac{\sigma_i^2 + \mu}{\sigma_i}\, v(w_i), \qquad
    v(w) = \min\left(k w, \sqrt{2 a w / \nu}, \sqrt[3]{9 j w^2 / (2 \nu)}\right),

with a and j the least bounds of acceleration and jerk. The two roots are the motions that come to
rest with a constant acceleration and a constant jerk. A direction without this limit has all of the
feedback: before its speed is chosen, each f_i that is beyond sigma_i v(w_i) has its part of the
error made as much smaller.

The directions are the eigenvectors of J J^T, with the columns of J those of the joints that are
free: one at a position limit, which the task wants beyond it, brings nothing. Near the edge two
more things are done. The preferred velocities are freed of all that acts on the task, which would
hold the arm short of the nearest point. With the jerk bounded, the task is softer by the square of
the way that the feedback goes while a joint turns its acceleration round, as far as that is more
than a centimetre. The preferred velocities are slower where the jerk is low, everywhere. Where none
of this acts, no bit changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import cbrt, sqrt
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import (
    clipped,
    dot,
    functions_of,
    is_one,
    matmul,
    matvec,
    root,
    solved_regular,
    transposed,
    vecmat,
)
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from .measurement import REACH
from .near_singular import least_square
from .secondary import is_in_zone

#: Returns the task velocity of the feedback of an error, both of shape (..., m).
Approach = Callable[[Array], Array]

# Share nu of the bounds of acceleration and jerk: one part of this many brakes.
_SHARE = 8.0
#: Largest slope k of the joint velocity over the way left [1/s], and its share of one over the time
#: after which a command is seen.
_SLOPE, _SEEN = 20.0, 0.25
# Way before a position limit in which a joint counts less and less [rad].
_ZONE = 0.01
# Times a / j for which the way of the feedback counts, and the way that does not count [m].
_TURNS, _SHORT = 2.0, 0.01
# Ways that a joint goes at its largest velocity while it turns its acceleration round.
_COASTS = 4.0
#: Way below which anything is braked, with a J that is known, and one that is learned [rad]: while
#: is learned, directions look worse than they are.
BEGINS, BEGINS_LEARNED = 0.3, 0.1
# Time in which a joint may turn its acceleration round at the usual gains of what is preferred [s].
_PULLED = 0.125
# Stands for an acceleration that is not bounded [rad/s^2].
_UNBOUNDED = 1e6
# What is no larger is nothing [m, m/s].
_TINY = 1e-12


class Edge(NamedTuple):
    """What the arm may do along the directions of its task, from the worst to the best.

    Attributes:
        axes: Unit vectors as columns, shape (..., m, m), of rows that are scaled to lengths.
        singular: Singular values of the free joints along them, shape (..., m) [m].
        most: Largest joint velocities along them, shape (..., m) [rad/s].
        near: Whether anything may be more than that; shape (..., 1) for many robots.
    """

    axes: Array
    singular: Array
    most: Array
    near: Any


@dataclass(frozen=True)
class ReachEdge:
    """The edge of reach of an arm, and what its joints can brake before it.

    Attributes:
        limits: Limits of the joints, those of `drake_rnn.laws.parts.reached_limits`.
        scales: Lengths that make the rows count alike, shape (..., m): the lever for rotations.
        seen_after: Time after which the effect of a command is seen [s].
        reach: Growth c of a singular value over the way from where it is 0 [m/rad].
        begins: Way below which anything is braked [rad], at least.
    """

    limits: JointLimits
    scales: Array
    seen_after: float
    reach: float = REACH
    begins: float = BEGINS

    def speed(self, way: Array) -> Array:
        """Return the largest joint velocities that can be braked on a way, shape (..., m) [rad/s].

        Args:
            way: The way, shape (..., m) [rad].
        """
        xp = functions_of(way)
        fastest = xp.minimum(self._slope * way, root(2.0 / _SHARE * self._acceleration * way))
        if self.limits.jerk is None:
            return fastest
        # In JAX, the derivative of a cubic root at 0 is infinite.
        square = 4.5 / _SHARE * self._jerk * way * way
        return xp.minimum(fastest, xp.cbrt(xp.maximum(square, _TINY**3)))

    def softness(self, softness: Array, feedback: Array) -> tuple[Array, Any]:
        """Return the softness of the rows, shape (..., m, m), and whether any was added.

        Args:
            softness: What it is without a bound of the jerk, shape (..., m, m).
            feedback: Task velocity of the feedback, shape (..., m).
        """
        if self.limits.jerk is None:
            return softness, False
        way = _TURNS * self._turn * self.length(feedback)
        if is_one(feedback):
            if way <= _SHORT:
                return softness, False
            return softness + (way * way - _SHORT**2) * np.diag(self.scales**-2), True
        added = functions_of(way).maximum(way * way - _SHORT**2, 0.0)
        rows = (added * self.scales**-2)[..., None] * np.eye(feedback.shape[-1])
        return softness + rows, added > 0.0

    def preferred(self, g: Array) -> Array:
        """Return preferred joint velocities, slower where the jerk is low, shape (..., n) [rad/s].

        Args:
            g: The velocities, shape (..., n) [rad/s].
        """
        if self.limits.jerk is None:
            return g
        part = _PULLED / self._turn
        if isinstance(part, float):
            return g if part >= 1.0 else part * g
        return functions_of(part).minimum(part, 1.0) * g

    def length(self, velocity: Array) -> Any:
        """Return the length of a task velocity, a float or shape (..., 1) [m/s]."""
        scaled = self.scales * velocity
        square = dot(scaled, scaled)
        return sqrt(square) if is_one(velocity) else root(square)

    def free(self, J: Array, error: Array, q: Array) -> Array:
        """Return J with less of the joints that cannot go where the task wants them.

        Args:
            J: Jacobian of the task, shape (..., m, n).
            error: Error of the task, shape (..., m).
            q: Joint positions, shape (..., n) [rad].
        """
        if is_one(q) and not is_in_zone(q, self.limits, _ZONE):
            return J
        weights = self.scales * self.scales
        return J * self._room(vecmat(weights * error, J), q)[..., None, :]

    def _room(self, toward: Array, q: Array) -> Array:
        """Return how free joints are to go somewhere, from 0 at a limit to 1, shape (..., n)."""
        xp = functions_of(q)
        lower, upper = self.limits.position_lower, self.limits.position_upper
        room = xp.where(toward > 0.0, upper - q, q - lower)
        return clipped(room / _ZONE, 0.0, 1.0)

    def at(self, free: Array, fastest: Any) -> Edge | None:
        """Return the edge in a posture; None if no robot is near it.

        Args:
            free: Jacobian of the joints that are free, shape (..., m, n).
            fastest: Length of the task velocity that is wanted, a float or shape (..., 1) [m/s].
        """
        rows = self.scales[..., None] * free
        gram = matmul(rows, transposed(rows))
        one = is_one(gram[..., 0])
        if one and self._is_far(sqrt(max(least_square(gram), 0.0)), fastest):
            return None
        xp = functions_of(gram)
        near: Any = True
        if not one:
            least = root(xp.maximum(xp.linalg.eigvalsh(gram)[..., :1], 0.0))
            near = least * self._most(least) < fastest
            if xp is np and not near.any():
                return None
            # Others keep out of it: in JAX, equal eigenvalues have no derivative.
            gram = xp.where(near[..., None], gram, np.diag(1.0 + np.arange(gram.shape[-1])))
        squares, axes = xp.linalg.eigh(gram)
        singular = root(xp.maximum(squares, 0.0))
        most = self._most(singular)
        if one and singular[0] * most[0] >= fastest:
            return None
        return Edge(axes, singular, most, near)

    def _is_far(self, least: float, fastest: float) -> bool:
        """Return whether a singular value lets one robot want a velocity, in plain numbers."""
        way = least / self.reach
        if way >= self._begins:
            return True
        speed = min(self._slope * way, sqrt(2.0 / _SHARE * self._acceleration * way))
        if self.limits.jerk is not None:
            speed = min(speed, cbrt(4.5 / _SHARE * self._jerk * way * way))
        return least * speed >= fastest

    def _most(self, singular: Array) -> Array:
        """Return the largest joint velocities along directions, shape (..., m) [rad/s]."""
        xp = functions_of(singular)
        way = singular / self.reach
        return self.speed(way) / xp.maximum(1.0 - (way / self._begins) ** 2, _TINY)

    def feedback(
        self,
        edge: Edge,
        whole: Array,
        error: Array,
        approach: Approach,
        slide: Approach,
        softness: Array,
    ) -> tuple[Array, Any]:
        """Return the task velocity of a feedback that can be braked, shape (..., m), and its share.

        The share is the least that is left of it in any direction, a number or shape (..., 1).

        Args:
            edge: The edge of reach.
            whole: The feedback of the whole error, shape (..., m).
            error: The error, shape (..., m).
            approach: Returns the feedback of an error.
            slide: Returns a task velocity without what the feedback has no say in.
            softness: Softness of the rows, shape (..., m, m).
        """
        xp = functions_of(whole)
        wanted = abs(vecmat(self.scales * whole, edge.axes))
        most = edge.singular * edge.most
        share = xp.minimum(1.0, most / xp.maximum(wanted, _TINY))
        share = xp.where(wanted <= most + _TINY, 1.0, share)
        left = vecmat(self.scales * error, edge.axes) * share
        rest = vecmat(self.scales * approach(matvec(edge.axes, left) / self.scales), edge.axes)
        price = (self.scales**2 * softness.diagonal(axis1=-2, axis2=-1)).max(axis=-1)[..., None]
        most = most + price * edge.most / xp.maximum(edge.singular, _TINY)
        braked = slide(matvec(edge.axes, clipped(rest, -most, most)) / self.scales)
        least = share.min(axis=-1, keepdims=True)
        if edge.near is True:
            return (braked, float(least[0])) if least[0] < 1.0 else (whole, 1.0)
        bent = edge.near & (least < 1.0)
        return xp.where(bent, braked, whole), xp.where(bent, least, 1.0)

    def braked(self, v: Array, J: Array, q: Array) -> Array:
        """Return joint velocities of one robot that can be braked near the edge, shape (n,).

        Args:
            v: Joint velocities that a law wants, shape (n,) [rad/s].
            J: Jacobian of its task, shape (m, n).
            q: Joint positions, shape (n,) [rad].
        """
        rows = self.scales[:, None] * J
        begins = self._begins * self.reach
        if least_square(rows.dot(rows.T)) >= begins**2 and not is_in_zone(q, self.limits, _ZONE):
            return v
        rows = rows * self._room(v, q)
        squares, axes = np.linalg.eigh(rows.dot(rows.T))
        singular = np.sqrt(np.maximum(squares, 0.0))
        most = singular * self._most(singular)
        wanted = rows.dot(v).dot(axes)
        beyond = wanted - clipped(wanted, -most, most)
        if not beyond.any():
            return v
        return v - (axes.dot(beyond / np.maximum(squares, _TINY**2))).dot(rows)

    @cached_property
    def _slope(self) -> float:
        return min(_SLOPE, _SEEN / self.seen_after)

    @cached_property
    def _acceleration(self) -> Any:
        bound = self.limits.require("acceleration", "braking in time")
        return _least(functions_of(bound).minimum(bound, _UNBOUNDED))

    @cached_property
    def _jerk(self) -> Any:
        return _least(self.limits.require("jerk", "its bound"))

    @cached_property
    def _begins(self) -> Any:
        """Way below which anything is braked [rad], a number or shape (..., 1)."""
        if self.limits.jerk is None:
            return self.begins
        fastest = -_least(-self.limits.velocity)
        coasts = _COASTS * fastest * self._turn
        if isinstance(coasts, float):
            return max(self.begins, coasts)
        return functions_of(coasts).maximum(self.begins, coasts)

    @cached_property
    def _turn(self) -> Any:
        """Time in which a joint turns its acceleration round [s], a number or shape (..., 1)."""
        jerk = self.limits.require("jerk", "its bound")
        xp = functions_of(jerk)
        most = self.limits.require("acceleration", "braking in time")
        return -_least(-xp.minimum(most / jerk, xp.sqrt(self.limits.velocity / jerk)))


def _least(bounds: Array) -> Any:
    """Return the least entry, of one robot a float, else of shape (..., 1)."""
    return float(bounds.min()) if is_one(bounds) else bounds.min(axis=-1, keepdims=True)


def freed(g: Array, J: Array, free: Array, softness: Array, where: Any) -> Array:
    """Return preferred joint velocities without what acts on a task, shape (..., n) [rad/s].

    Args:
        g: The velocities, shape (..., n) [rad/s].
        J: Jacobian of the task, shape (..., m, n).
        free: That of the joints that are free, likewise.
        softness: Softness of its rows, shape (..., m, m).
        where: Whether to do so; of many robots for all, or of shape (..., 1).
    """
    if where is False:
        return g
    left = _idle(_idle(g, J, softness), free, softness)
    return left if where is True else functions_of(g).where(where, left, g)


def _idle(g: Array, J: Array, softness: Array) -> Array:
    y = solved_regular(matmul(J, transposed(J)) + softness, matvec(J, g))
    return g - vecmat(y, J)
