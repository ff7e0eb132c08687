"""Measures of the claims about least torques: the report's six methods on its three rods.

- MTN and MTNB, (5) and (8): least torques, and least torques weighed by their limits.
- PTR, (13) to (17): the torque within its limits that makes the next one least.
- MBP, (21) to (24): least torques now and a preview later.
- MTND and MBPD, (25) to (28): MTN and MBP with damping.

All are integrated as printed, by (9), and no torque is clipped. `drake-rnn run rods3_short` has MTN
and MTND in Drake's plant instead.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ..claims import Run

# Mass [kg] and length [m] of a rod; posture at first; limits of torque [N m]; sampling period [s].
_MASS, _LENGTH = 10.0, 1.0
_START = np.deg2rad([-45.0, 135.0, -135.0])
_LIMITS = np.array([54.0, 24.0, 6.0])
_STEP = 1e-3
# Gains of the feedback [1/s^2, 1/s] and of the damping [1/s]; periods of the preview.
_KP, _KD, _DAMPING, _PREVIEW = 10.0, 1.0, 10.0, 100
# Acceleration [m/s^2] and length [m] of the movements, along x and along y.
_PATHS = {"short": (2.0, 0.2), "long": (1.0, 0.83)}
# Sums of the angles of the joints are those of the rods; moments of pairs of rods [kg m^2].
_SUMS = np.tril(np.ones((3, 3)))
_CENTERS = np.tril(np.ones((3, 3)), -1) + 0.5 * np.eye(3)
_MOMENTS = _MASS * _LENGTH**2 * _CENTERS.T @ _CENTERS
_INERTIA = _MASS * _LENGTH**2 / 12.0 * np.eye(3)


class _Course(NamedTuple):
    """Torques, those expected a preview later and velocities, (steps, 3), errors (steps,)."""

    torque: Array
    later: Array
    velocity: Array
    error: Array


def tracking_error(run: Run, method: str, path: str, preview: int = _PREVIEW) -> float:
    """Largest distance of the tip from the path [m].

    Args:
        run: Not needed.
        method: ``mtn``, ``mtnb``, ``ptr``, ``mbp``, ``mtnd`` or ``mbpd``.
        path: ``short`` or ``long``.
        preview: Periods of the preview of MBP and MBPD.
    """
    return float(_course(method, path, preview).error.max())


def largest_share(run: Run, method: str, path: str) -> float:
    """Largest torque per its limit [1]."""
    return float(np.abs(_course(method, path).torque / _LIMITS).max())


def rms_norm(run: Run, of: str, method: str, path: str) -> float:
    """Root mean square of the norm of the torques [N m], or of the velocities [rad/s]."""
    course = _course(method, path)
    series = {"torque": course.torque, "velocity": course.velocity}[of]
    return float(np.sqrt((series**2).sum(axis=1).mean()))


def largest_norm(run: Run, method: str, path: str, start: float = 0.0, end: float = 1.0) -> float:
    """Largest norm of the torques between two shares of the time [N m]."""
    norm = np.linalg.norm(_course(method, path).torque, axis=1)
    return float(norm[round(start * norm.size) : round(end * norm.size)].max())


def profile_apart(run: Run, method: str, other: str, path: str, joint: int = 0) -> float:
    """Largest difference of a joint's torques by two methods, per its largest torque [1].

    Args:
        run: Not needed.
        method: The method.
        other: The other one, whose torque it is divided by.
        path: The path.
        joint: Number of the joint; 0 for the largest one of all joints.
    """
    torque, base = (_course(each, path).torque for each in (method, other))
    apart = np.abs(torque - base).max(axis=0) / np.abs(base).max(axis=0)
    return float(apart[joint - 1] if joint else apart.max())


def later_norm(
    run: Run,
    method: str,
    path: str,
    preview: int = _PREVIEW,
    start: float = 0.0,
    end: float = 1.0,
    forces: str = "then",
) -> float:
    """Largest norm of the torques expected a preview later, between shares of the time [N m].

    Args:
        run: Not needed.
        method: The method.
        path: The path.
        preview: Periods of the preview.
        start: The share at which it begins [1].
        end: The share at which it ends [1].
        forces: ``then``, of the velocities a preview later as in (21), or ``now``, of those of the
            moment.
    """
    norm = np.linalg.norm(_course(method, path, preview, forces).later, axis=1)
    return float(norm[round(start * norm.size) : round(end * norm.size)].max())


def peaks(run: Run, path: str, preview: int, rising: bool = False, forces: str = "then") -> float:
    """Number of peaks of the norm of the torques that MBP expects [1].

    A peak is larger than 0.4 of the largest one, and than twice what is least between it and each
    larger one.

    Args:
        run: Not needed.
        path: The path.
        preview: Periods of the preview.
        rising: Whether only those count that are larger than all before.
        forces: As of `later_norm`.
    """
    norm = np.linalg.norm(_course("mbp", path, preview, forces).later, axis=1)
    found: list[int] = []
    for k in np.argsort(-norm):
        if norm[k] < 0.4 * norm.max():
            break
        if all(2.0 * norm[min(k, p) : max(k, p)].min() < norm[k] for p in found):
            found.append(int(k))
    found.sort()
    if rising:
        found = [k for n, k in enumerate(found) if all(norm[k] > norm[p] for p in found[:n])]
    return float(len(found))


def _turned(q: Array) -> tuple[Array, Array]:
    """Return the angles of the rods and the differences of each pair."""
    angle = _SUMS @ q
    return angle, angle[:, None] - angle


def _mass(q: Array) -> Array:
    """Return M, shape (3, 3)."""
    return _SUMS.T @ (_MOMENTS * np.cos(_turned(q)[1]) + _INERTIA) @ _SUMS


def _factor(q: Array, v: Array) -> Array:
    """Return S of the forces S v, so that dM/dt - 2 S is skew, shape (3, 3)."""
    return _SUMS.T @ (_MOMENTS * np.sin(_turned(q)[1]) * (_SUMS @ v)) @ _SUMS


def _tip(q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return the tip's position (2,), J (2, 3) and h, which is dJ/dt v (2,)."""
    angle, rate = _turned(q)[0], _SUMS @ v
    c, s = _LENGTH * np.cos(angle), _LENGTH * np.sin(angle)
    p = np.array([c.sum(), s.sum()])
    J = np.array([-s, c]) @ _SUMS
    return p, J, -np.array([c @ rate**2, s @ rate**2])


def _desired(t: float, path: str) -> tuple[float, float, float]:
    """Return how far x and y have gone, and its two derivatives; at rest after the end."""
    a, length = _PATHS[path]
    half = np.sqrt(length / a)
    if t <= half:
        return 0.5 * a * t**2, a * t, a
    if t <= 2.0 * half:
        return length - 0.5 * a * (2.0 * half - t) ** 2, a * (2.0 * half - t), -a
    return length, 0.0, 0.0


def _least(Q: Array, r: Array, A: Array, b: Array) -> Array:
    """Return x of the least x^T Q x / 2 + r^T x with A x = b."""
    rows = len(b)
    both = np.block([[Q, A.T], [A, np.zeros((rows, rows))]])
    return np.linalg.solve(both, np.concatenate((-r, b)))[: len(r)]


@cache
def _course(method: str, path: str, preview: int = _PREVIEW, forces: str = "then") -> _Course:
    """Return what a method does on a path."""
    a, length = _PATHS[path]
    steps = int(np.ceil(2.0 * np.sqrt(length / a) / _STEP))
    q, v = _START.copy(), np.zeros(3)
    begin = _tip(q, v)[0]
    rows: list[tuple[Array, Array, Array, float]] = []
    for k in range(steps):
        t = k * _STEP
        far, fast, b = _desired(t, path)
        p, J, h = _tip(q, v)
        e = begin + far - p
        wanted = b + _KD * (fast - J @ v) + _KP * e - h
        if method == "ptr":
            acceleration, later = _reduced(q, v, t + _STEP, path)
        elif method.startswith("mbp"):
            ahead = _desired(t + preview * _STEP, path)[2]
            damping = _DAMPING if method.endswith("d") else 0.0
            T = preview * _STEP
            acceleration, torque_later = _previewed(q, v, wanted, ahead, T, damping)
            moves = v + acceleration * T if forces == "then" else v
            later = torque_later + _factor(q + v * T, v) @ moves
        else:
            acceleration, later = _instantaneous(method, q, v, wanted), np.full(3, np.nan)
        torque = _mass(q) @ acceleration + _factor(q, v) @ v
        rows.append((torque, later, v, float(np.linalg.norm(e))))
        q = q + v * _STEP + 0.5 * acceleration * _STEP**2
        v = v + acceleration * _STEP
    return _Course(*map(np.array, zip(*rows, strict=True)))


def _instantaneous(method: str, q: Array, v: Array, wanted: Array) -> Array:
    """Return the accelerations of MTN, MTND or MTNB, (5) and (8), (3,)."""
    M, n = _mass(q), _factor(q, v) @ v
    if method == "mtnd":
        n = n + _DAMPING * M @ v
    W = np.diag(1.0 / (2.0 * _LIMITS) ** 2) if method == "mtnb" else np.eye(3)
    return _least(M @ W @ M, M @ W @ n, _tip(q, v)[1], wanted)


def _previewed(
    q: Array, v: Array, wanted: Array, ahead: float, T: float, damping: float
) -> tuple[Array, Array]:
    """Return the accelerations of MBP or MBPD, (21) to (28), and M q'' of a preview later."""
    q_later = q + v * T
    M, M_later = _mass(q), _mass(q_later)
    S, S_later = _factor(q, v) + damping * M, _factor(q_later, v) + damping * M_later
    J, J_later = _tip(q, v)[1], _tip(q_later, v)[1]
    cross = T * S_later.T @ M_later
    Q = np.block([[M @ M + T**2 * S_later.T @ S_later, cross], [cross.T, M_later @ M_later]])
    r = np.concatenate((M @ S @ v + T * S_later.T @ S_later @ v, M_later @ S_later @ v))
    A = np.block([[J, np.zeros((2, 3))], [J_later - J, J_later]])
    x = _least(Q, r, A, np.concatenate((wanted, ahead - (J_later - J) @ v / T)))
    return x[:3], M_later @ x[3:]


def _reduced(q: Array, v: Array, t: float, path: str) -> tuple[Array, Array]:
    """Return the accelerations of PTR, (13) to (17), and the torques that it expects.

    The next velocities are those of the path and any share s of the motion that the tip does not
    see. Torques are linear in s, the expected ones quadratic, and their weighed square is least at
    an end of what the limits allow, or where its derivative vanishes. Where the limits
    allow none, s is halfway between those that contradict each other.
    """
    _, fast, ahead = _desired(t, path)
    q_later = q + v * _STEP
    M, n = _mass(q), _factor(q, v) @ v
    M_later, J_later = _mass(q_later), _tip(q_later, v)[1]
    free = np.cross(*J_later @ np.eye(3))
    free /= np.linalg.norm(free)
    base = np.linalg.pinv(J_later) @ np.full(2, fast)

    def torque(s: float) -> Array:
        return M @ (base + s * free - v) / _STEP + n

    def expected(s: float) -> Array:
        w = base + s * free
        n_later = _factor(q_later, w) @ w
        W = np.diag(1.0 / (2.0 * _LIMITS) ** 2)
        x = _least(
            M_later @ W @ M_later, M_later @ W @ n_later, J_later, ahead - _tip(q_later, w)[2]
        )
        return M_later @ x + n_later

    slope, first = torque(1.0) - torque(0.0), torque(0.0)
    ends = np.sort([(-_LIMITS - first) / slope, (_LIMITS - first) / slope], axis=0)
    lower, upper = float(ends[0].max()), float(ends[1].min())
    if lower > upper:
        s = 0.5 * (lower + upper)
    else:
        # The three values of each torque give its quadratic; squares of these add up.
        below, at, above = expected(-1.0), expected(0.0), expected(1.0)
        quadratics = np.stack((0.5 * (above + below) - at, 0.5 * (above - below), at), axis=1)
        cost = sum(np.polymul(p, p) for p in quadratics / _LIMITS[:, None])
        roots = np.roots(np.polyder(cost))
        inner = [x.real for x in roots if abs(x.imag) < 1e-9 and lower < x.real < upper]
        s = min([lower, upper, *inner], key=lambda each: float(np.polyval(cost, each)))
    return (base + s * free - v) / _STEP, expected(s)
