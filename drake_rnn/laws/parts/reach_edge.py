r"""Coming to rest where a target is out of reach, at the point that is nearest to it.

There the task wants what no motion brings. In the direction u_i in which the target is out of reach
the singular value of J falls to 0, in proportion to the way w_i = sigma_i / c that the joints have
left. A feedback f_i that does not fall as well wants the joint velocity sigma_i f_i / (sigma_i^2 +
mu). Near the end of the way this goes from one bound to the other within a few milliradians, which
no joint with a bounded acceleration or jerk can follow: the arm swings there for ever.

So a joint velocity that comes of the feedback must be one that can be braked on the way left. If it
is more than twice the velocity v_i, f_i is multiplied by m_i / (|f_i| - m_i), which leaves v_i of
what is much faster, with

.. math::
    m_i = \frac{\sigma_i^2 + \mu}{\sigma_i}\, v_i, \qquad
    v_i = \frac{v_0 \min(1, \sigma_i / \sigma_0)^2 + v(w_i)}
        {[1 - \sigma_i^2 / 2 c |e_i|]_+}, \qquad
    w_i = \frac{[\sigma_i - \sigma_0]_+}{c_i},

    \frac{1}{v(w)} = \frac{1}{k w} +
    \frac{1}{\min(\sqrt{\tfrac12 a w}, \tfrac12 \sqrt[3]{j w^2})},

and a and j the least bounds of acceleration and jerk. The root of a is a motion that comes to rest
with a quarter of it, so twice the velocity could just be braked. With that of j, the time in which
a joint changes its velocity by v, which is 2 sqrt(v / j), is 0.7 of the time for the way. In a
model of one joint it comes to rest with either, also if the way is half of what it is taken for.
The term with k is for what is seen late. The arm comes to rest at sigma_0, where a radian brings no
more than 2.5 mm, and only creeps on with at most v_0: ridges of the reach are long.

How fast sigma_i falls with the way differs between arms, and for one arm between the directions it
bends in, from 0.5 m/rad to 0.03. So c_i is what it fell by over the last motion of the joints along
this direction, as far as they moved along it, and c, the largest, as far as they moved otherwise.

Of an error e_i, the arm can take back about sigma_i^2 / (2 c) before it is at the edge: if that is
all of it, nothing is limited. A direction without this limit has all of the feedback: before its
speed is chosen, each other part of the error is multiplied by what is left of f_i without mu. Where
the target is far out of reach, by E_i in the other directions, a joint motion along u_i turns these
as well, and the part e_i changes by sigma_i + c E_i / sigma_i for each radian, not by sigma_i. So
its speed is chosen of e_i sigma_i^2 / (sigma_i^2 + c E_i): the way to where the gradient of the
error is 0, by Newton's method.

At the edge what is preferred of the joints would lead off it: a stretched arm bends in more
directions than the one above. It is multiplied by the square of the least of these factors, which
falls faster than v_i, and it is braked to half of v on its own way. Everywhere it is slower
where the jerk is low. The task is softer then, by the square of the way that the end effector goes
while a joint turns its acceleration round twice, as far as that is more than a centimetre: joints
with an acceleration over jerk of a second would follow the task from one bound to the other, with
large velocities that the task does not see. The speed of the end effector counts as the least of
the feedback's and 0.15 m times that of the joints, so that nothing is softer at rest or on a path.

None of this sees saddles of the error, which an arm leaves ever so slowly, nor valleys, along which
it would go for minutes, and it brakes with a quarter of the acceleration, since what is wanted
turns as the arm moves. Of a pose, J tells the posture where the arm is to rest: its columns are
the axes of the joints, so pose and J after any motion follow from it (`pose_after`). Of a position
it does so with the columns of J_omega. From where the fastest stop leads, Newton's method with the
sizes of the curvatures goes to the least error (`ReachEdge.to_rest`). Where that posture is found
and the target rests, each joint goes there as fast as it can brake on its way. The posture is
remembered until the target moves (`RestPosture`), so nothing swings, whatever the bounds are: of
joints that get far before they can stop, the stops end near one least error, then near another.

The directions are the eigenvectors of J J^T, with the columns of J those of the joints that are
free: one at a position limit, which the task wants beyond it, brings nothing. Where none
of this acts, no bit changes.

A softer task near a singular posture, where an arm would otherwise not come to rest.

Stretched out towards what is out of its reach, an arm gains its last millimetres by large joint
velocities to and fro. Where the smallest singular value of J falls below an edge, the softness
grows as the square of the way below it. Rows of the rotation count as with a lever of 1 m. Of
points on a tool that turn about one another little is seen, in every posture: for pixels the edge
is lower.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from math import cbrt, inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import (
    Parts,
    acts,
    clip,
    dot,
    either,
    functions_of,
    is_one,
    join,
    matmul,
    matvec,
    outer,
    repeat,
    root,
    transpose,
    vecmat,
)
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ...robot.rotation import rotation_error
from ..law import Signals, State
from .jacobian import REACH
from .secondary import NO_BOUND, cross_columns, is_in_zone

#: Smallest singular value from which on a posture counts as near a singular one.
EDGE = 0.05
# What is added to the softness in a singular one: with 1e-4 arms still cycle, with 1e-3 they rest.
_MOST = 1e-3
#: Share of the edge, and root of that of the softness added, for pixels: with all of it half of the
#: runs with three points, of random cameras, do not settle within 3 s.
OF_PIXELS = 0.2


def row_softness(softness: Any, lever: Any, task_size: int, turns: bool) -> Array:
    """Return the softness of a task's rows, a diagonal matrix, shape (..., m, m).

    Args:
        softness: Price of an error of the position [m^2].
        lever: Length that makes an error of the orientation count like one of the position [m].
        task_size: Number m of rows.
        turns: Whether the first three of 6 rows are rotation.
    """
    each = np.ones(task_size - 3 * turns)
    # A lever of each robot's own gives both parts its leading axis.
    rows = join((each * lever**-2, each + 0.0 * lever)) if turns else each
    rows = softness * rows
    return rows[..., None] * np.eye(task_size)


def soften(J: Array, softness: Array, share: float = 1.0, scales: Array | None = None) -> Array:
    """Return the softness with what is added near a singular posture, shape (..., m, m).

    Args:
        J: Jacobian, shape (..., m, n).
        softness: Softness of the rows elsewhere, shape (..., m, m).
        share: Share of the edge at which it begins, and root of that of what is added.
        scales: Lengths that make the rows of objectives count alike, shape (..., m); None if they
            count as they are. Of more rows than joints, those are not counted that no motion of
            the joints serves.
    """
    if scales is not None:
        J = scales[..., None] * J
    gram = matmul(J, transpose(J))
    if type(gram) is np.ndarray and gram.shape == (3, 3) and least_square(gram) > EDGE**2:
        return softness
    xp = functions_of(gram)
    first = 0 if scales is None else max(J.shape[-2] - J.shape[-1], 0)
    least = xp.maximum(xp.linalg.eigvalsh(gram)[..., first : first + 1], 0.0)
    below = xp.maximum(1.0 - root(least) / (share * EDGE), 0.0)
    if scales is not None:
        below = below / scales
    return softness + (share**2 * _MOST * below * below)[..., None] * np.eye(J.shape[-2])


def least_square(gram: Array) -> float:
    """Return a number that no eigenvalue of a symmetric matrix is below, shape (m, m).

    Args:
        gram: The matrix, J J^T; of three rows the number is the least eigenvalue or less.
    """
    if gram.shape != (3, 3):
        return float(np.linalg.eigvalsh(gram)[0])
    (a, b, c), (_, d, e), (_, _, f) = gram.tolist()
    determinant = a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)
    # The product of the other two is at most the square of half the trace.
    half = 0.5 * (a + d + f)
    return float(determinant / max(half * half, 1e-300))


#: An orientation and the desired one, shape (..., 3, 3) each.
Turn = tuple[Array, Array]
#: Returns the task velocity of the feedback of an error, both of shape (..., m).
Approach = Callable[[Array], Array]

# Largest growth k of the joint velocity with the way left, times the time until a command is seen.
_SIGHT = 0.25
# Way that a radian brings where it is not worth it [m/rad], and the velocity there [rad/s].
_IDLE, _CREEP = 2.5e-3, 4e-3
# Least growth of a singular value with the way that is believed [m/rad].
_LEAST = 0.02
# Way before a position limit in which a joint counts less and less [rad].
_ZONE = 0.01
# Time in which a joint may turn its acceleration round at the usual gains of what is preferred [s].
_PULL_TIME = 0.125
# Task velocity that counts for a joint velocity at most [m/rad].
_SWAY = 0.15
# Turns of the acceleration for which the way of the feedback counts, and the way that does not [m].
_TURNS, _SHORT = 2.0, 0.01
# Least curvature of the error that counts, as a share of the largest; longest step of Newton's
# method, and one that has found it [rad]; the number of steps; error of what is out of reach [m].
_FLAT, _FARTHEST, _FOUND, _TRIES, _OUT = 2e-3, 0.5, 1e-7, 40, 1e-3
# Way before a position limit in which a joint counts as one at it [rad].
_END = 1e-3
# What a radian must bring the task nearer, or else it cannot come nearer [m]; and how near to its
# position limit a joint then counts as at its end [rad].
_NEARER, _AT_END = 0.05, 0.02
# Factors of the speeds that acceleration and jerk allow to a posture that stays where it is.
_FIXED = (1.8, 0.7)
#: Task velocity of a target that rests [m/s, rad/s].
AT_REST = 1e-9
# Way of a stop after which it may matter that the target is out of reach [rad].
_OVER = 0.5
# What is no larger is nothing [m, m/s].
_TINY = 1e-12


class Change(NamedTuple):
    """A change of the Jacobian, and of the joints that it comes of.

    Attributes:
        J: Change of the task's Jacobian, shape (..., m, n).
        q: Motion of the joints, shape (..., n) [rad].
        learned: Whether J is learned, so that it changes by what is learned as well.
    """

    J: Array
    q: Array
    learned: bool = False


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
        limits: Limits of the joints, those of `drake_rnn.laws.parts.bounded_velocity`.
        scales: Lengths that make the rows count alike, shape (..., m): the lever for rotations.
        seen_after: Time after which the effect of a command is seen [s].
        reach: Growth c of a singular value over the way from where it is 0 [m/rad].
        begin: Least singular value from which on no posture is near the edge [m].
    """

    limits: JointLimits
    scales: Array
    seen_after: float
    reach: float = REACH
    begin: float = inf

    def speed(self, singular: Array, growth: Any) -> Array:
        """Return the largest joint velocities that can be braked, shape (..., m) [rad/s].

        Args:
            singular: Singular values of the directions, shape (..., m) [m].
            growth: Growth of these with the way from where they are 0, likewise, or a number.
        """
        xp = functions_of(singular)
        creep = _CREEP * xp.minimum(singular / _IDLE, 1.0) ** 2
        way = xp.maximum(singular - _IDLE, 0.0) / growth
        return creep + self.stoppable(way)

    def stoppable(self, way: Array, share: float = 0.5, part: float = 0.5) -> Array:
        """Return the largest joint velocities that can be braked on a way, shape (..., m) [rad/s].

        Args:
            way: The way, shape (..., m) [rad].
            share: Twice the share of the acceleration that brakes.
            part: Factor of the speed that the jerk allows.
        """
        xp = functions_of(way)
        last = _SIGHT / self.seen_after * way
        most = root(share * self._acceleration * way)
        if self.limits.jerk is not None:
            # In JAX, the derivative of a cubic root at 0 is infinite.
            square = self._jerk * way * way
            most = xp.minimum(most, part * xp.cbrt(xp.maximum(square, _TINY**3)))
        return last * most / (last + most + _TINY)

    def softness(self, softness: Array, feedback: Array, v: Array) -> Array:
        """Return the softness of the rows, more where the jerk is low, shape (..., m, m).

        Args:
            softness: What it is without a bound of the jerk, shape (..., m, m).
            feedback: Task velocity of the feedback, shape (..., m).
            v: Joint velocities until now, shape (..., n) [rad/s].
        """
        if self.limits.jerk is None:
            return softness
        if is_one(feedback):
            fastest = min(self.length(feedback), _SWAY * sqrt(dot(v, v)))
            way = _TURNS * self.turn * fastest
            if way <= _SHORT:
                return softness
            return softness + (way * way - _SHORT**2) * np.diag(self.scales**-2)
        xp = functions_of(feedback)
        fastest = xp.minimum(self.length(feedback), _SWAY * root(dot(v, v)))
        way = _TURNS * self.turn * fastest
        excess = xp.maximum(way * way - _SHORT**2, 0.0)
        return softness + (excess * self.scales**-2)[..., None] * np.eye(feedback.shape[-1])

    def slow(self, g: Array) -> Array:
        """Return preferred joint velocities, slower where the jerk is low, shape (..., n) [rad/s].

        Args:
            g: The velocities, shape (..., n) [rad/s].
        """
        if self.limits.jerk is None:
            return g
        part = _PULL_TIME / self.turn
        if isinstance(part, float):
            return g if part >= 1.0 else part * g
        return functions_of(part).minimum(part, 1.0) * g

    def brake_preferred(self, g: Array, pull: Any, share: Any) -> Array:
        """Return preferred joint velocities that can be braked, shape (..., n) [rad/s].

        Args:
            g: The velocities, shape (..., n) [rad/s].
            pull: Their growth with the way from where they are 0 [1/s].
            share: Least share that is left of the feedback in any direction, a number or shape
                (..., 1); 1 for all of them.
        """
        xp = functions_of(g)
        if acts(pull):
            most = 0.5 * self.stoppable(abs(g) / xp.maximum(pull, _TINY))
            g = share * g + (1.0 - share) * clip(g, -most, most)
        return share * share * g

    def length(self, velocity: Array) -> Any:
        """Return the length of a task velocity, a float or shape (..., 1) [m/s]."""
        v_scaled = velocity if self._is_plain(velocity) else self.scales * velocity
        square = dot(v_scaled, v_scaled)
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
        lower, upper = self.limits.resting
        room = xp.where(toward > 0.0, upper - q, q - lower)
        return clip(room / _ZONE, 0.0, 1.0)

    def at(
        self,
        free: Array,
        error: Array,
        velocity: Array,
        change: Callable[[], Change | None] = lambda: None,
    ) -> Edge | None:
        """Return the edge in a posture; None if no robot is near it.

        Args:
            free: Jacobian of the joints that are free, shape (..., m, n).
            error: Error of the task, shape (..., m).
            velocity: Task velocity that is wanted, likewise.
            change: Returns the last change of J, None if it is not known; of one robot it is asked
                for near the edge alone.
        """
        known = None if is_one(error) else change()
        rows = free if self._is_plain(free) else self.scales[..., None] * free
        gram = matmul(rows, transpose(rows))
        out, fastest = self.length(error), self.length(velocity)
        one = is_one(gram[..., 0])
        if one and self._is_far(sqrt(max(least_square(gram), 0.0)), out, fastest):
            return None
        xp = functions_of(gram)
        near: Any = True
        if not one:
            least = root(xp.maximum(xp.linalg.eigvalsh(gram)[..., :1], 0.0))
            slow = 2.0 * least * self.speed(least, self.reach) < fastest
            near = slow & (least * least < 2.0 * self.reach * out) & (least < self.begin)
            if xp is np and not near.any():
                return None
            # Others keep out of it: in JAX, equal eigenvalues have no derivative.
            gram = xp.where(near[..., None], gram, np.diag(1.0 + np.arange(gram.shape[-1])))
        squares, axes = xp.linalg.eigh(gram)
        squares = xp.maximum(squares, 0.0)
        singular = root(squares)
        if one and singular[0] >= self.begin:
            return None
        extent = 2.0 * self.reach * abs(vecmat(self.scales * error, axes))
        beyond = xp.maximum(1.0 - squares / xp.maximum(extent, _TINY), _TINY)
        growth = self._growth(rows, axes, singular, change() if one else known)
        return Edge(axes, singular, self.speed(singular, growth) / beyond, near)

    def _is_far(self, least: float, out: float, fastest: float) -> bool:
        """Return whether a singular value lets one robot want a velocity, in plain numbers."""
        if least * least >= 2.0 * self.reach * out:
            return True
        creep, way = _CREEP * min(least / _IDLE, 1.0) ** 2, max(least - _IDLE, 0.0) / self.reach
        last, most = _SIGHT / self.seen_after * way, sqrt(0.5 * self._acceleration * way)
        if self.limits.jerk is not None:
            most = min(most, 0.5 * cbrt(self._jerk * way * way))
        return 2.0 * least * (creep + last * most / (last + most + _TINY)) >= fastest

    def _growth(self, rows: Array, axes: Array, singular: Array, change: Change | None) -> Any:
        """Return the growth of singular values with the way along them, shape (..., m) [m/rad].

        It is known of the directions in which the joints have moved.

        Args:
            rows: Jacobian of the free joints, of rows scaled to lengths, shape (..., m, n).
            axes: Directions as columns, shape (..., m, m).
            singular: Singular values, shape (..., m) [m].
            change: The last change; None if it is not known.
        """
        if change is None:
            return self.reach
        xp = functions_of(singular)
        inward = matmul(transpose(axes), rows) / xp.maximum(singular, _TINY)[..., None]
        rates = matmul(transpose(axes), self.scales[..., None] * change.J)
        joints_before = change.q[..., None, :]
        along = (inward * joints_before).sum(axis=-1)
        square = (joints_before * joints_before).sum(axis=-1)
        bent = abs((rates * inward).sum(axis=-1)) / xp.maximum(abs(along), _TINY)
        share = along * along / xp.maximum(square, _TINY**2)
        if change.learned:
            # Where the jerk lets a joint turn soon, it brakes in time with the usual growth, and
            # what is learned meanwhile would cost accuracy.
            late = self.limits.jerk is not None and self.turn > _PULL_TIME
            share = share * late
        bent = clip(bent, _LEAST, self.reach)
        return self.reach + share * (bent - self.reach)

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
        toward = vecmat(self.scales * whole, edge.axes)
        price = (self.scales**2 * softness.diagonal(axis1=-2, axis2=-1)).max(axis=-1)[..., None]
        most = edge.most * (edge.singular + price / xp.maximum(edge.singular, _TINY))
        share = _part(edge.singular * edge.most, toward)
        left = vecmat(self.scales * error, edge.axes)
        squares = edge.singular * edge.singular
        out = xp.maximum(abs(left) - squares / (2.0 * self.reach), 0.0)
        others = out.sum(axis=-1, keepdims=True) - out
        left = left * share * squares / xp.maximum(squares + self.reach * others, _TINY)
        rest = vecmat(self.scales * approach(matvec(edge.axes, left) / self.scales), edge.axes)
        part = _part(most, toward)
        rest = xp.where(part < 1.0, part * toward, clip(rest, -2.0 * most, 2.0 * most))
        rate = slide(matvec(edge.axes, rest) / self.scales)
        least = share.min(axis=-1, keepdims=True)
        if edge.near is True:
            return (rate, float(least[0])) if least[0] < 1.0 else (whole, 1.0)
        bent = edge.near & (least < 1.0)
        return xp.where(bent, rate, whole), xp.where(bent, least, 1.0)

    def stops(self, v: Array) -> Array:
        """Return the ways of the fastest stops, roughly, shape (..., n) [rad].

        Args:
            v: Joint velocities until now, shape (..., n) [rad/s].
        """
        times = abs(v) / (2.0 * self._acceleration)
        if self.limits.jerk is not None:
            times = functions_of(v).maximum(times, root(abs(v) / self._jerk))
        return v * times

    def to_rest(
        self, seeks: Any, J: Array, R: Turn | None, away: Array, q: Array, begin: Array
    ) -> tuple[Array, Any]:
        """Return the way to where an arm rests, shape (..., n) [rad], and whether it is found.

        That is the posture of least error that is found from a first one. It is not where Newton's
        method does not end, or where the target is reached.

        Args:
            seeks: For which robots it is sought, a truth value or shape (..., 1).
            J: Jacobian of the pose, shape (..., 6, n), of joints that follow one another.
            R: Orientation, and the desired one, shape (..., 3, 3) each; None for a task of the
                position alone, of which ``scales`` has 3 entries.
            away: Way to the desired position, shape (..., 3) [m].
            q: Joint positions, shape (..., n) [rad].
            begin: Way to the first posture, likewise [rad].
        """
        xp = functions_of(J)
        lower, upper = (bound - q for bound in self.limits.resting)
        scales = self.scales if R is not None else join((0.0 * self.scales, self.scales))
        weights, regular = scales * scales, np.diag(1.0 + np.arange(J.shape[-1]))

        errors = partial(_errors_after, J, R, away)

        def length(error: Array) -> Array:
            return root(dot(scales * error, scales * error) + 0.0 * far)

        def advance(parts: Parts) -> Parts:
            d, part, error, J_there, done = parts
            steep, free = _slope(d, vecmat(weights * error, J_there), lower, upper)
            rows, out = scales[..., None] * J_there, length(error)
            H = matmul(transpose(rows), rows) - bend(J_there, weights * error)
            H = xp.where(done[..., None], regular, H * outer(free, free))
            bends, ways = xp.linalg.eigh(H)
            least = _FLAT * self.reach * out
            step = free * matvec(ways, vecmat(steep, ways) / (abs(bends) + least))
            way = abs(step).max(axis=-1, keepdims=True)
            size = xp.minimum(1.0, part * _FARTHEST / (way + _TINY))
            there = clip(d + size * step, lower, upper)
            error_there, J_next = errors(there)
            better = ~done & (length(error_there) <= out)
            part = xp.where(better, xp.minimum(2.0 * part, 1.0), 0.25 * size * way / _FARTHEST)
            d, error = xp.where(better, there, d), xp.where(better, error_there, error)
            J_there = xp.where(better[..., None], J_next, J_there)
            return d, part, error, J_there, done | (way < _FOUND)

        def steepness(d: Array, error: Array, J_there: Array) -> Array:
            steep, _ = _slope(d, vecmat(weights * error, J_there), lower, upper)
            return root(dot(steep, steep) + 0.0 * far)

        # A joint that locks brings nothing any more.
        d = xp.where(abs(J).max(axis=-2) > 0.0, clip(begin, lower, upper), 0.0)
        far, (error, J_there) = np.ones(d[..., :1].shape) + 0.0 * d[..., :1], errors(d)
        # No step from a posture that was found before is longer than this.
        longest = steepness(d, error, J_there) / (_FLAT * self.reach * length(error) + _TINY)
        done = ~(seeks | (far < 0.0)) | (longest < _FOUND)
        if not (type(done) is np.ndarray and done.all()):
            d, _, error, J_there, _ = repeat(advance, (d, far, error, J_there, done), _TRIES)
        out = length(error)
        return d, (steepness(d, error, J_there) < _IDLE * out) & (out > _OUT)

    def reach_posture(self, way: Array, v: Array, a: Array | None) -> Array:
        """Return joint velocities to a posture that stays where it is, shape (..., n) [rad/s].

        Each joint is as fast as it can brake on its way. With a bound of the jerk that is the way
        from where its acceleration can be 0.

        Args:
            way: Way to the posture, shape (..., n) [rad].
            v: Joint velocities until now, likewise [rad/s].
            a: Accelerations that led to them, likewise; None without a bound of the jerk [rad/s^2].
        """
        if a is not None:
            time = abs(a) / self._jerk
            way = way - time * (v + a * time / 3.0)
        return functions_of(way).sign(way) * self.stoppable(abs(way), *_FIXED)

    def brake(self, v: Array, J: Array, error: Array, q: Array) -> Array:
        """Return joint velocities of one robot that can be braked near the edge, shape (n,).

        Args:
            v: Joint velocities that a law wants, shape (n,) [rad/s].
            J: Jacobian of its task, shape (m, n).
            error: Error of its task, shape (m,).
            q: Joint positions, shape (n,) [rad].
        """
        free = self.free(J, error, q)
        edge = self.at(free, error, J.dot(v))
        if edge is None:
            return v
        xp = functions_of(v)
        singular = xp.maximum(edge.singular, _TINY)
        rows = edge.axes.T.dot(self.scales[:, None] * free) / singular[:, None]
        along = rows.dot(v)
        part = _part(edge.most, along)
        least = part.min()
        if xp is np and least >= 1.0:
            return v
        braked = (part * along).dot(rows) + least**2 * (v - along.dot(rows))
        return braked if xp is np else xp.where(edge.near & (least < 1.0), braked, v)

    def _is_plain(self, array: Array) -> bool:
        """Return whether scales change nothing of an array of NumPy, in which all are 1."""
        return self._are_ones and type(array) is np.ndarray

    @cached_property
    def _are_ones(self) -> bool:
        return type(self.scales) is np.ndarray and bool((self.scales == 1.0).all())

    @cached_property
    def _acceleration(self) -> Any:
        bound = self.limits.sides("acceleration", "braking in time").least
        return _least(functions_of(bound).minimum(bound, NO_BOUND))

    @cached_property
    def _jerk(self) -> Any:
        return _least(self.limits.require("jerk", "its bound"))

    @cached_property
    def turn(self) -> Any:
        """Time in which a joint turns its acceleration round [s], a number or shape (..., 1)."""
        if self.limits.jerk is None:
            return 0.0
        jerk = self.limits.require("jerk", "its bound")
        xp = functions_of(jerk)
        most = self.limits.sides("acceleration", "braking in time").least
        speed = self.limits.sides("velocity").largest
        return -_least(-xp.minimum(most / jerk, xp.sqrt(speed / jerk)))


@dataclass(frozen=True)
class RestPosture:
    """Where an arm rests whose target is out of reach; it is remembered while the target rests.

    Attributes:
        edge: The edge of reach.
        size: Number n of joints; 0 where nothing tells the posture.
        turns: Whether J is that of a pose; else the axes are those of ``J_omega``.
        exact: 1 where measurements are exact and in time, else 0, a number or shape (..., 1).
    """

    edge: ReachEdge
    size: int
    turns: bool
    exact: Any

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state: the posture, and 1 while the arm is led there."""
        return {"rest": (self.size,), "leads": (1,)} if self.size else {}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {"rest": u["position"], "leads": np.zeros(1)} if self.size else {}

    def step(
        self, state: State, u: Signals, period: float, along: Array, near: Any
    ) -> tuple[Array | None, State]:
        """Return joint velocities to the posture, NaN for robots that are not led; None if none is.

        See `Component.step`; it reads the parts ``v`` and, if there is one, ``a`` as well.

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            along: Task velocity of the path, shape (..., m).
            near: Whether the arm is near the edge, a truth value or shape (..., 1).
        """
        if not self.size:
            return None, {}
        v, q, rest = state["v"], u["position"], state["rest"]
        none = {"rest": rest, "leads": 0.0 * state["leads"]}
        if not acts(self.exact):
            return None, none
        xp, stops = functions_of(along), self.edge.stops(v)
        rests = (abs(along).max(axis=-1, keepdims=True) <= AT_REST) & (self.exact > 0.0)
        led = state["leads"] > 0.0
        # Joints that get far before they can stop may leave the edge, and come back to it.
        seeks = rests & (led | near | (abs(stops).max(axis=-1, keepdims=True) > _OVER))
        if type(seeks) is np.ndarray and not seeks.any():
            return None, none

        def seek() -> tuple[Array, ...]:
            J, away = u["J"], u["p_WE_desired"] - u["p_WE"]
            R = (u["R_WE"], u["R_WE_desired"]) if self.turns else None
            if R is None:
                J = xp.concatenate((u["J_omega"], J), axis=-2)
            begin = xp.where(led, rest - q, stops)
            way, found = self.edge.to_rest(seeks, J, R, away, q, begin)
            leads = seeks & found
            velocity = xp.where(leads, self.edge.reach_posture(way, v, state.get("a")), np.nan)
            return velocity, q + way, xp.where(leads, 1.0, 0.0)

        idle = np.nan * v, rest, none["leads"]
        velocity, rest, leads = either(seeks.any(), seek, lambda: idle)
        return velocity, {"rest": rest, "leads": leads}

    def leads_one(self, state: State, q: Array) -> bool:
        """Return whether one robot, of positions of shape (n,) [rad], has been led until now."""
        return bool(self.size) and is_one(q) and bool(state["leads"][0] > 0.0)

    def resumed(self, state: State) -> State:
        """Return its parts of the state after a pause: the posture is sought again."""
        return {"leads": 0.0 * state["leads"]} if self.size else {}


def out_of_reach(J: Array, error: Array, q: Array, limits: JointLimits) -> tuple[int, ...] | None:
    """Return the joints at their ends without which no motion reduces an error; None if one does.

    Args:
        J: Jacobian of the task, of rows that are lengths, shape (m, n) [m].
        error: Error of these rows, shape (m,) [m].
        q: Joint positions, shape (n,) [rad].
        limits: Limits of the joints.
    """
    size = float(np.linalg.norm(error))
    if size < _OUT:
        return None
    nearer = error @ J / size
    at_end = np.where(nearer > 0.0, limits.position_upper - q, q - limits.position_lower) < _AT_END
    if np.linalg.norm(nearer[~at_end]) > _NEARER:
        return None
    return tuple(np.flatnonzero(at_end & (np.abs(nearer) > _NEARER)).tolist())


def bend(J: Array, pull: Array) -> Array:
    r"""Return how the slope of a pose along a pull turns with the joints, shape (..., n, n).

    It is the sum of the second derivatives of the rows by the joints, each times the pull along it.
    In a chain, joint j turns all that follows it: column i of the translation by z_j x J_i and
    z_i by z_j x z_i if i > j, where z are the columns of the rotation, zero for joints that slide.
    Of the latter, half is in the symmetric part.

    Args:
        J: Jacobian of the pose, shape (..., 6, n).
        pull: Weights of the rows, shape (..., 6).
    """
    z, J_v = J[..., :3, :], J[..., 3:, :]
    turning, moving = (part[..., None] + 0.0 * z for part in (pull[..., :3], pull[..., 3:]))
    half = matmul(transpose(J_v), cross_columns(moving, z))
    half = half + 0.5 * matmul(transpose(z), cross_columns(turning, z))
    lower = np.tril(np.ones(half.shape[-2:]))
    return half * lower + transpose(half) * (1.0 - lower)


def pose_after(J: Array, d: Array) -> tuple[Array, Array, Array]:
    """Return the turn, the way and the Jacobian of a pose after a motion of the joints.

    The columns of its Jacobian are the joints' axes, so they tell it exactly, as a product of
    exponentials: seen from the end effector, an axis z whose column of the translation is x passes
    through z x x.

    Args:
        J: Jacobian of the pose before, shape (..., 6, n), of joints that follow one another.
        d: Motion of the joints, shape (..., n) [rad].

    Returns:
        Rotation, shape (..., 3, 3), way, shape (..., 3) [m], and Jacobian, shape (..., 6, n).
    """
    xp, z, x = functions_of(J, d), J[..., :3, :], J[..., 3:, :]
    through, turns = cross_columns(z, x), (z * z).sum(axis=-2) > 0.5
    sine, less = xp.where(turns, xp.sin(d), d), 1.0 - xp.cos(d)
    R, p = np.eye(3) + 0.0 * J[..., :3, :1], 0.0 * J[..., :3, 0]
    axes, points, slides = [], [], []
    for i in range(J.shape[-1]):
        s, c = sine[..., i, None], less[..., i, None]
        axis = matvec(R, z[..., :, i])
        axes.append(axis)
        points.append(matvec(R, through[..., :, i]) + p)
        slides.append(xp.where(turns[..., i, None], 0.0, matvec(R, x[..., :, i])))
        p = p + matvec(R, c * through[..., :, i] + s * x[..., :, i])
        once = cross_columns(axis[..., None], R)
        turned = s[..., None] * once + c[..., None] * cross_columns(axis[..., None], once)
        # The axis of a joint that slides is 0.
        R = R + turned
    axes_now = xp.stack(axes, axis=-1)
    J_v = cross_columns(axes_now, p[..., None] - xp.stack(points, axis=-1))
    J_now = xp.concatenate((axes_now, J_v + xp.stack(slides, axis=-1)), axis=-2)
    return R, p, J_now


def _errors_after(J: Array, R: Turn | None, away: Array, d: Array) -> tuple[Array, Array]:
    """Return the error of a pose after a motion of the joints, and its Jacobian there.

    Args:
        J: See `ReachEdge.to_rest`; as the following.
        R: Orientation, and the desired one; None if it does not count.
        away: Way to the desired position.
        d: The motion, shape (..., n) [rad].
    """
    turned, p, J_there = pose_after(J, d)
    if R is None:
        return join((0.0 * p, away - p)), J_there
    return join((rotation_error(matmul(turned, R[0]), R[1]), away - p)), J_there


def _slope(d: Array, steep: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return a slope without joints at a limit that it leads beyond, and 1 for others.

    Args:
        d: Motion of the joints, shape (..., n) [rad].
        steep: The slope with all joints, likewise.
        lower: Motion to the lower position limits, likewise [rad].
        upper: That to the upper ones.
    """
    xp = functions_of(steep)
    stuck = (d <= lower + _END) & (steep < 0.0) | (d >= upper - _END) & (steep > 0.0)
    return xp.where(stuck, 0.0, steep), xp.where(stuck, 0.0, 1.0)


def _part(most: Array, velocity: Array) -> Array:
    """Return what is left of velocities that can be braked if they are `most`, shape (..., m)."""
    xp = functions_of(velocity)
    return xp.minimum(1.0, most / xp.maximum(abs(velocity) - most, _TINY))


def _least(bounds: Array) -> Any:
    """Return the least entry, of one robot a float, else of shape (..., 1)."""
    return float(bounds.min()) if is_one(bounds) else bounds.min(axis=-1, keepdims=True)
