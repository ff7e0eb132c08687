r"""What joints do besides their task: a small list of terms with weights.

Each term is a velocity that the joints prefer; of those that do the task, the law takes the one
nearest to their sum.

======================  ======================================================================
term                    preferred velocity
======================  ======================================================================
``posture``             weight times the way to a posture
``limits``              away from position limits: from 0 at the edge of a zone before each
                        limit to the weight at the limit, as the square of the way into the zone
``manipulability``      weight times the gradient of ln sqrt(det J J^T), which leads away from
                        singular postures
``low_acceleration``    all of these, smoothed with this time constant
``obstacles``           away from obstacles that the law avoids, along the slope of their distance:
                        from 0 at the edge of a zone to the weight where they touch, as the square
                        of the way into the zone; not smoothed
======================  ======================================================================

Joints that make way before they have to: away from what is near, as far as a task leaves it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ...arrays.algebra import (
    acts,
    clipped,
    functions_of,
    is_one,
    matmul,
    scaled,
    solved,
    transposed,
)
from ...inputs.fields import (
    Array,
    Gain,
    GainOrZero,
    Length,
    NonNegative,
    Vector,
    between,
    validated,
)
from ...inputs.keys import Meaning, Only
from ...robot.limits import JointLimits
from ..law import Signals

# Keeps the gradient of the manipulability finite in a singular posture [m^2].
_REGULAR = 1e-6


@validated
class Secondary:
    """Weights of the secondary objectives; 0 leaves one out."""

    posture: Annotated[GainOrZero, Meaning("Pull towards the posture.", unit="1/s")] = 1.0
    target: Annotated[
        Vector | None,
        Meaning(
            "The posture, shape (n,); by default that of the start.",
            unit="rad",
            only=(Only("posture"),),
        ),
    ] = None
    limits: Annotated[
        GainOrZero,
        Meaning("Speed with which a joint at a position limit prefers to leave.", unit="rad/s"),
    ] = 3.0
    limits_zone: Annotated[
        Gain,
        Meaning(
            "Way before a position limit in which a joint is pushed back.",
            unit="rad",
            only=(Only("limits"),),
        ),
    ] = 0.3
    manipulability: Annotated[
        GainOrZero,
        Meaning(
            "Weight of the manipulability's gradient; needs a known Jacobian and ``task`` xyz or "
            "pose.",
            unit="rad^2/s",
        ),
    ] = 0.0
    low_acceleration: Annotated[
        NonNegative,
        between(0.0, 100.0),
        Meaning("Time constant of what is preferred.", unit="s"),
    ] = 0.0
    obstacles: Annotated[
        GainOrZero,
        Meaning(
            "Weight of the slope of the distance to an obstacle that is touched.",
            unit="rad^2/(m s)",
            only=(Only("avoidance"),),
        ),
    ] = 2.0
    obstacles_zone: Annotated[
        Length,
        Meaning(
            "Distance below which the joints make way for an obstacle.",
            unit="m",
            only=(Only("obstacles"),),
        ),
    ] = 0.1

    @property
    def seeks_manipulability(self) -> bool:
        """Whether the joints are led away from singular postures."""
        return acts(self.manipulability)

    def preferred(
        self,
        limits: JointLimits,
        home: Array,
        q: Array,
        v: Array,
        J: Array,
        u: Signals,
        period: float,
    ) -> Array:
        """Return the joint velocities preferred among those that do the task, shape (..., n).

        Args:
            limits: Limits of the joints.
            home: Posture at the start, shape (n,) [rad].
            q: Joint positions, shape (..., n) [rad].
            v: Velocities until now, shape (..., n) [rad/s].
            J: Jacobian of the task, shape (..., m, n).
            u: Signals at the sample, ``J_omega`` among them where singular postures are left.
            period: Time until the next sample [s].
        """
        g = self.posture * ((home if self.target is None else self.target) - q)
        if acts(self.limits):
            g = g + pushed_back(q, limits, self.limits, self.limits_zone)
        if self.seeks_manipulability:
            g = g + self.manipulability * manipulability_gradient(J, u["J_omega"])
        if acts(self.low_acceleration):
            g = v + (g - v) * (period / (self.low_acceleration + period))
        return g


def pushed_back(q: Array, limits: JointLimits, weight: Any, zone: Any) -> Array:
    """Return velocities away from the position limits, shape (..., n) [rad/s].

    Args:
        q: Joint positions, shape (..., n) [rad].
        limits: Limits of the joints.
        weight: Speed at a limit [rad/s].
        zone: Way before a limit in which it acts [rad].
    """
    if is_one(q) and not is_in_zone(q, limits, zone):
        return 0.0 * q
    xp = functions_of(q)
    gaps = q - limits.position_lower, limits.position_upper - q
    into = [xp.maximum(1.0 - gap / zone, 0.0) for gap in gaps]
    return weight * (into[0] * into[0] - into[1] * into[1])


def is_in_zone(q: Array, limits: JointLimits, zone: float) -> bool:
    """Return whether a joint of one robot is within a zone before a limit.

    Args:
        q: Joint positions, shape (n,) [rad].
        limits: Limits of the joints.
        zone: Way before a limit [rad].
    """
    # Plain floats: NumPy's overhead would take several times as long.
    lower, upper = limits.position_lower.tolist(), limits.position_upper.tolist()
    for x, low, high in zip(q.tolist(), lower, upper, strict=True):
        if x - low < zone or high - x < zone:
            return True
    return False


def manipulability_gradient(J: Array, J_omega: Array) -> Array:
    r"""Return the gradient of ln sqrt(det J J^T) by the joint positions, shape (..., n).

    It is tr(J^+ dJ/dq_j). In a chain, moving joint j turns all that follows it: it changes column i
    of the translation by z_j x J_i if i >= j, and by z_i x J_j otherwise, and z_i by z_j x z_i if
    i > j, where z are the columns of the rotation, zero for joints that slide.

    Args:
        J: Jacobian of the task, shape (..., m, n), of 3 rows of translation, or those of the
            rotation before them.
        J_omega: Jacobian of the rotation, shape (..., 3, n).
    """
    xp = functions_of(J)
    J_T = transposed(J)
    regular = scaled(_REGULAR, np.eye(J.shape[-2]))
    # Rows of the transposed pseudoinverse.
    P = solved(matmul(J, J_T) + regular, J)
    J_v, P_v, z = J[..., -3:, :], P[..., -3:, :], J_omega
    turned = _crossed(J_v, P_v)
    if J.shape[-2] == 6:
        turned = turned + _crossed(J[..., :3, :], P[..., :3, :])
    after = xp.flip(xp.cumsum(xp.flip(turned, -1), axis=-1), -1)
    lever = _crossed(P_v, z)
    before = xp.cumsum(lever, axis=-1) - lever
    sums = z * after + J_v * before
    return sums[..., 0, :] + sums[..., 1, :] + sums[..., 2, :]


def _crossed(a: Array, b: Array) -> Array:
    """Return the cross products of columns, shape (..., 3, n)."""
    (ax, ay, az), (bx, by, bz) = ((m[..., 0, :], m[..., 1, :], m[..., 2, :]) for m in (a, b))
    return functions_of(a).stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-2)


# A posture this close to a limit [rad], or with so small a singular value, is doubted.
_NEAR_LIMIT, _SINGULAR = 0.1, 0.05


def posture_doubts(
    key: str, target: Array, limits: JointLimits, task_J: Callable[[Array], Array] | None
) -> list[str]:
    """Return sentences on what may go wrong, with remedies.

    Args:
        key: What gives the posture, for messages.
        target: The posture, shape (n,) [rad].
        limits: Limits of the joints.
        task_J: Jacobian of the task, shape (m, n), of joint positions; None if it is not known.
    """
    gap = np.minimum(target - limits.position_lower, limits.position_upper - target)
    found = []
    if gap.min() < _NEAR_LIMIT:
        found.append(
            f"{key}: joint {int(gap.argmin()) + 1} is pulled to {max(gap.min(), 0.0):.2g} rad "
            "from its limit, and may be held there; consider another law.secondary.target, or "
            "law.secondary.posture: 0"
        )
    if task_J is not None:
        least = float(np.linalg.svd(task_J(target), compute_uv=False)[-1])
        if least < _SINGULAR:
            found.append(
                f"{key}: the arm is pulled towards a posture that is singular for its task "
                f"(smallest singular value {least:.2g}), where it loses the task; consider "
                "law.secondary.target with the joints some 0.1 rad away, or "
                "law.secondary.posture: 0"
            )
    return found


@dataclass(frozen=True)
class LedAway:
    """How joints prefer to go away from what is near, along the slope of its distance.

    Attributes:
        weight: Weight with which they do of what they touch [rad^2/(m s)]; less of what is farther
            away, as the square of the way into the zone.
        zone: Distance below which they do [m].
    """

    weight: float
    zone: float

    def preferred(self, gaps: Array, slopes: Array) -> Array:
        """Return the velocities that they prefer, shape (n,) [rad/s].

        Args:
            gaps: Distances of what they make way for, shape (r,) [m].
            slopes: Derivatives of these with respect to the joints, shape (r, n) [m/rad].
        """
        into = clipped(1.0 - gaps / self.zone, 0.0, 1.0)
        return np.asarray(self.weight * (into * into) @ slopes)
