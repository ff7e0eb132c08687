"""Measures of the claims of the scheme that keeps two arms apart.

- The distance of two segments by alternating projections (LSDM), beside the closed form.
- The scheme (25) to (28), whose program the LVI-based primal-dual network (32) solves, with rows
  for each link near the other arm, those of `drake_rnn.laws.scheme`; without (28) it is the scheme
  of least velocity (MVN).
- The network's equations, and how much of it there is.

The arms are PA10s with a tool on an eighth joint. The text gives postures, radius, slope and
thresholds. Where the second arm stands follows from coordinates printed in Fig. 9: both elbows are
0.45 m from a shoulder, and 0.0873 m is the distance of Table I at the start. Lengths beyond the
elbow, the axes of the circles and the time law are chosen, so that the least velocity comes within
20 mm of its column of Table I.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ...laws.parts.programs import Program
from ...laws.projection import NetworkInstant, inequality, neurons, project
from ...laws.scheme import MutualAvoidance, MutualRows
from ...robot.clearance.capsules import between_segments
from ...robot.clearance.clearance import CriticalPoints
from ..claims import Run

# Lengths of the links, shoulder to elbow, to wrist, to the tool's joint, to its tip [m].
_LINKS = (0.45, 0.48, 0.08, 0.4)
_BASES = np.array([[0.0, 0.0, 0.0], [0.3368, -0.1856, 0.0]])
_POSTURES = np.array(
    [[0, 1, 0, -2, 0, 1, 0, 1], [-2, -1, 0, 2, 0, -1, 0, -1]],
) * (np.pi / 4.0)
# The circles: radius, slope, time of a lap [m, rad, s]; their first axes and the level parts of
# their second ones.
_RADIUS, _SLOPE, _LAP = 0.2, np.pi / 3.0, 10.0
_FIRST = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
_LEVEL = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
# Thresholds [m], gain of the network [1/s], step [s] and bound of the joint velocities [rad/s].
_INNER, _OUTER, _GAIN, _STEP, _FASTEST = 0.05, 0.12, 1e5, 1e-2, 2.0
# Of the scheme without rows, bounds that are never met [m^2/s].
_FAR = 1e3
# Coordinates printed below Fig. 9 and drawn in it [m], of the least velocity.
_PRINTED = np.array([[0.292, 0.055, 0.392], [0.2332, 0.025, 0.384]])
_DRAWN = np.array([[0.2129, 0.05537, 0.3926], [0.2332, 0.02514, 0.3839]])
# Table I: distances at 0, 2, ..., 10 s with (28) [m].
_TABLE = np.array([0.0873, 0.09784, 0.1212, 0.1154, 0.11969, 0.116])


def distance_apart(
    run: Run, stop: float, rounds: int = 3000, degrees: float = 90.0, method: str = "lsdm"
) -> float:
    """Largest difference of a calculated distance of segments from the closed form [m].

    Args:
        run: Not needed.
        stop: Decline of the distance in a round below which the iteration ends [m].
        rounds: Number of rounds after which it ends.
        degrees: Largest angle between the segments; 0 for parallel ones.
        method: ``lsdm`` or ``printed_foot``, the foot of (9), whose place is compared.
    """
    A, B = _segments(degrees)
    if method == "printed_foot":
        # (9) and the three cases below it, against a projection.
        X, (P, Q) = B[:, 0], np.moveaxis(A, 1, 0)
        length = np.linalg.norm(Q - P, axis=1)
        to_P, to_Q = np.linalg.norm(X - P, axis=1), np.linalg.norm(X - Q, axis=1)
        share = np.clip((to_Q**2 + length**2 - to_P**2) / (2.0 * length**2), 0.0, 1.0)
        foot = Q + share[:, None] * (P - Q)
        return float(np.abs(foot - _foot(X, A)).max())
    return float(np.abs(_lsdm(A, B, stop, rounds) - between_segments(A, B).distance).max())


def coordinates_over(run: Run, drawn: bool) -> float:
    """Distance of the critical points of Fig. 9(a), per the printed 0.03744 m [1]."""
    p, q = _DRAWN if drawn else _PRINTED
    return float(np.linalg.norm(p - q) / 0.03744)


def avoided_coordinates_over(run: Run) -> float:
    """Distance of the critical points of Fig. 9(b), per the printed 0.11765 m [1]."""
    away = np.array([0.147, 0.0363, 0.424]) - [0.250, -0.0193, 0.409]
    return float(np.linalg.norm(away) / 0.11765)


def rms_of_table(run: Run, of: str) -> float:
    """Root mean square of Table I's distances with (28), or of how far d2 is from them [m]."""
    values = _TABLE if of == "distance" else _TABLE - _OUTER
    return float(np.sqrt((values**2).mean()))


def distance(
    run: Run, rows: str, at: float | None = None, until: float = _LAP, start: float = 0.0
) -> float:
    """Distance of the arms at a time, or the least one over a time [m].

    Args:
        run: Not needed.
        rows: ``none`` (the least velocity), ``printed`` (a row for each coordinate), ``zero`` (the
            same with 0 in place of B) or ``scalar`` (one row for each critical point).
        at: The time [s]; None for the least distance.
        until: End of the time looked at [s].
        start: Its begin [s].
    """
    course = _run(rows)
    if at is not None:
        return float(course.distance[round(at / _STEP)])
    return float(course.distance[round(start / _STEP) : round(until / _STEP) + 1].min())


def position_error(run: Run, rows: str) -> float:
    """Largest component of both tools' position errors on the circles [m]."""
    return float(_run(rows).error.max())


def speed_jump(run: Run, rows: str) -> float:
    """Largest change of a joint velocity from step to step [rad/s]."""
    return float(_run(rows).jump)


def turned_feasibility(run: Run) -> float:
    """Share of turned world frames in which an allowed velocity breaks (10) [1].

    The velocity leads straight away from the other arm in the mean, but not along each coordinate.
    """
    rng = np.random.default_rng(4)
    r, v = np.array([0.1, 0.02, 0.0]), np.array([-0.1, 0.05, 0.0])
    if not r @ v < 0.0:
        return np.inf
    turns = np.linalg.qr(rng.normal(size=(500, 3, 3)))[0]
    return float(((turns @ r) * (turns @ v) > 0.0).any(axis=1).mean())


def general_form_apart(run: Run, corrected: bool) -> float:
    """Largest difference of (35) with the printed weights from (32), per its size [1].

    Args:
        run: Not needed.
        corrected: Whether the input is -q and rho the inverse of lambda (I + M^T).
    """
    rng = np.random.default_rng(5)
    program = _random_program(rng)
    M, q, lower, upper = inequality(program, 0.0)
    eye, worst = np.eye(q.size), 0.0
    for _ in range(20):
        Y = rng.normal(size=q.size)
        wanted = project("lvi", program, 0.0).rate(Y)
        error = np.clip((eye - M) @ Y + (-q if corrected else q), lower, upper) - Y
        rho = np.linalg.inv(eye + M.T) if corrected else eye + M.T
        rate = np.linalg.solve(rho, error)
        worst = max(worst, float(np.abs(rate - wanted).max() / np.abs(wanted).max()))
    return worst


def error_left(run: Run, time: float) -> float:
    """Largest distance of the network's variables from the optimum, per that at first [1].

    Of 20 random programs that stand still, after a time [s] at the printed gain.
    """
    rng, worst = np.random.default_rng(6), 0.0
    for _ in range(20):
        program = _random_program(rng)
        network = project("lvi", program, 0.0)
        optimum = _settle(network, np.zeros(network.g.size), 1e4)
        y = np.zeros(network.g.size)
        for _ in range(400):
            y = network.after(y, _GAIN * time / 400)
        k = program.c.size
        away = np.linalg.norm((y - optimum)[:k]) / np.linalg.norm(optimum[:k])
        worst = max(worst, float(away))
    return worst


def infeasible(run: Run, what: str) -> float:
    """What the network does where the equations contradict the rows.

    Args:
        run: Not needed.
        what: ``growth`` for the growth of its multipliers from 1000 to 2000 time constants, per
            their size [1]; ``residual`` for the size of (29) that is left [1]; ``least_squares``
            for the distance of its variables from those of least squared violations, per their
            size [1].
    """
    # x_1 = 1 and x_1 <= 0: least squared violations have x_1 = 1/2; x_2 is free and least at 0.
    eye = np.eye(2)
    program = Program(
        eye, np.zeros(2), eye[:1], np.ones(1), (-5.0 * np.ones(2), 5.0 * np.ones(2)),
        eye[:1], np.zeros(1),
    )  # fmt: skip
    network = project("lvi", program, 0.0)
    early = _settle(network, np.zeros(4), 1e3)
    late = _settle(network, early, 1e3)
    if what == "growth":
        return float(np.linalg.norm(late[2:]) / np.linalg.norm(early[2:]) - 1.0)
    if what == "residual":
        return float(np.abs(network.error(late)).max())
    return float(np.linalg.norm(late[:2] - [0.5, 0.0]) / 0.5)


def count_over(run: Run, what: str) -> float:
    """Parts that the network needs, per what is printed or per the dual network's [1].

    Args:
        run: Not needed.
        what: ``multipliers`` or ``summers`` of (39), per the printed number, or ``of_dual``: its
            products per those of a dual network with W = I, which needs no I + H^T.
    """
    h = neurons("lvi", 16, 6, True, 24)
    if what == "multipliers":
        return float((h * h + h * h + h) / (2 * h**2 + h))
    if what == "summers":
        # Of each neuron: h products, q and Y behind one projection; then h products.
        return float((h * (h - 1 + 2) + h * (h - 1)) / (2 * h**2))
    other = neurons("dual", 16, 6, True, 24)
    return float((2 * h**2 + h) / (other**2 + other))


class _Course(NamedTuple):
    """Distances at the steps, the largest position error and the largest jump of a velocity."""

    distance: Array
    error: Array
    jump: float


class _Links(NamedTuple):
    """Points between the links, shape (5, 3), the joints' axes and points on them, (8, 3) each."""

    points: Array
    axes: Array
    origins: Array

    def J(self, p: Array, joints: int = 8) -> Array:
        """Return the Jacobian of a point that the first joints move, shape (3, 8)."""
        J = np.zeros((3, 8))
        J[:, :joints] = np.cross(self.axes[:joints], p - self.origins[:joints]).T
        return J


def _links(q: Array, base: Array) -> _Links:
    """Return the links of an arm, whose joints turn about z and y in turn."""
    R, p, points, axes, origins = np.eye(3), base, [base], [], []
    for k, angle in enumerate(q):
        c, s, turns_y = np.cos(angle), np.sin(angle), k % 2
        axes.append(R[:, 1 if turns_y else 2])
        origins.append(p)
        if turns_y:
            R = R @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
            p = p + _LINKS[k // 2] * R[:, 2]
            points.append(p)
        else:
            R = R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return _Links(np.array(points), np.array(axes), np.array(origins))


def _circle(t: float, arm: int) -> tuple[Array, Array]:
    """Return how far a tool has gone and its velocity, from rest to rest."""
    second = np.cos(_SLOPE) * _LEVEL[arm] + np.sin(_SLOPE) * np.array([0.0, 0.0, 1.0])
    x = 0.5 * np.pi * t / _LAP
    phase, rate = 2.0 * np.pi * np.sin(x) ** 2, np.pi**2 / _LAP * np.sin(2.0 * x)
    c, s = np.cos(phase), np.sin(phase)
    away = (c - 1.0) * _FIRST[arm] + s * second
    return _RADIUS * away, _RADIUS * rate * (c * second - s * _FIRST[arm])


class _Rows:
    """The rows (28), of `drake_rnn.laws.scheme`, for the arms here, and their memory."""

    def __init__(self, kind: str) -> None:
        settings = MutualAvoidance(
            inner=_INNER,
            outer=_OUTER,
            product="scalar" if kind == "scalar" else "coordinates",
            fading=kind != "zero",
        )
        self._has_none = kind == "none"
        self._rows = MutualRows(settings, 8, lambda q: self._critical)
        self._critical = CriticalPoints(np.zeros(8), np.zeros((8, 3)), np.zeros((8, 3, 16)))
        self._memory = self._rows.init({}, np.random.default_rng(0))

    def terms(self, arms: list[_Links], v: Array) -> tuple[Array, Array, float]:
        """Return C, d and the distance of the arms."""
        A, B = (np.stack((arm.points[:-1], arm.points[1:]), 1) for arm in arms)
        near = between_segments(A[:, None], B[None])
        least = float(near.distance.min())
        if self._has_none:
            return np.zeros((self._rows.size, 16)), np.full(self._rows.size, _FAR), least
        gaps, ways, J = self._critical
        for arm, link in np.ndindex(2, 4):
            row = (near.distance[link] if arm == 0 else near.distance[:, link]).argmin()
            pair = (link, row) if arm == 0 else (row, link)
            p, e = near.p_A[pair], near.p_B[pair]
            p, e = (p, e) if arm == 0 else (e, p)
            k = 4 * arm + link
            gaps[k], ways[k] = near.distance[pair], e - p
            J[k, :, 8 * arm : 8 * arm + 8] = arms[arm].J(p, 2 * link + 2)
        # Points and Jacobians are those of the moment, whatever the joint positions.
        u = {"position": np.zeros(16)}
        (C, d), self._memory = self._rows.step(self._memory, u, _STEP, v)
        return C, d, least


@cache
def _run(kind: str) -> _Course:
    """Return the course of both arms on their circles, by the midpoint rule."""
    q, rows = _POSTURES.copy(), _Rows(kind)
    box = -_FASTEST * np.ones(16), _FASTEST * np.ones(16)
    y = np.zeros(neurons("lvi", 16, 6, True, 8 * (1 if kind == "scalar" else 3)))
    starts = [_links(*arm).points[-1] for arm in zip(q, _BASES, strict=True)]
    distances, error, jump, before = [], 0.0, 0.0, None

    def velocity(t: float, q: Array, y: Array, turns: float) -> tuple[Array, float]:
        arms = [_links(*arm) for arm in zip(q, _BASES, strict=True)]
        A = np.zeros((6, 16))
        for k, arm in enumerate(arms):
            A[3 * k : 3 * k + 3, 8 * k : 8 * k + 8] = arm.J(arm.points[-1])
        b = np.concatenate([_circle(t, k)[1] for k in range(2)])
        C, d, gap = rows.terms(arms, y[:16])
        program = Program(np.eye(16), np.zeros(16), A, b, box, C, d)
        return project("lvi", program, 0.0).after(y, turns), gap

    steps = round(_LAP / _STEP)
    for k in range(steps + 1):
        t = k * _STEP
        y, gap = velocity(t, q, y, _GAIN * 0.5 * _STEP)
        distances.append(gap)
        for arm in range(2):
            tip = _links(q[arm], _BASES[arm]).points[-1]
            error = max(error, float(np.abs(tip - starts[arm] - _circle(t, arm)[0]).max()))
        if before is not None:
            jump = max(jump, float(np.abs(y[:16] - before).max()))
        before = y[:16]
        middle = q + 0.5 * _STEP * y[:16].reshape(2, 8)
        y, _ = velocity(t + 0.5 * _STEP, middle, y, _GAIN * 0.5 * _STEP)
        q = q + _STEP * y[:16].reshape(2, 8)
    return _Course(np.array(distances), np.array([error]), jump)


def _segments(degrees: float) -> tuple[Array, Array]:
    """Return 500 random pairs of segments at most so far turned, shape (500, 2, 3) each [m]."""
    rng = np.random.default_rng(3)
    start, other = rng.uniform(-0.5, 0.5, (2, 500, 3))
    along = rng.normal(size=(500, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(500, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.radians(degrees) * rng.uniform(0.0, 1.0, (500, 1))
    turned = np.cos(angle) * along + np.sin(angle) * across
    lengths = rng.uniform(0.05, 0.5, (2, 500, 1))
    first = np.stack((start, start + lengths[0] * along), 1)
    return first, np.stack((other, other + lengths[1] * turned), 1)


def _foot(points: Array, segments: Array) -> Array:
    """Return the nearest points of segments, shape (k, 3)."""
    p, d = segments[:, 0], segments[:, 1] - segments[:, 0]
    share = np.clip(((points - p) * d).sum(axis=1) / (d * d).sum(axis=1), 0.0, 1.0)
    return p + share[:, None] * d


def _lsdm(A: Array, B: Array, stop: float, rounds: int) -> Array:
    """Return distances by alternating projections from an end of the first segments, (k,) [m]."""
    P, last = A[:, 1], np.full(len(A), np.inf)
    is_done = np.zeros(len(A), dtype=bool)
    for _ in range(rounds):
        E = _foot(P, B)
        P = _foot(E, A)
        now = np.where(is_done, last, np.linalg.norm(E - P, axis=1))
        is_done |= last - now <= stop
        last = now
        if is_done.all():
            break
    return last


def _random_program(rng: np.random.Generator) -> Program:
    """Return a program of 8 variables, 3 equations and 4 rows that some x fulfils."""
    A, C, x = rng.normal(size=(3, 8)), rng.normal(size=(4, 8)), rng.uniform(-0.5, 0.5, 8)
    box = -np.ones(8), np.ones(8)
    return Program(np.eye(8), rng.normal(size=8), A, A @ x, box, C, C @ x + 0.1)


def _settle(network: NetworkInstant, y: Array, turns: float) -> Array:
    """Return the state so many time constants later."""
    for _ in range(100):
        y = network.after(y, turns / 100)
    return y
