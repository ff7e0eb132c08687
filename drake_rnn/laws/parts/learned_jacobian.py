r"""Where a sampled law takes its Jacobian from, if it learns it: from what its motions cause.

It is learned by a Kalman filter, whose one covariance serves all rows.

The rows of J are taken to wander, each entry with the variance q_n per second, and the velocity y
that joint velocities w cause to be measured with the variance R:

.. math::
    C \leftarrow C + q_n h I, \quad K = \frac{C w}{R + w^T C w}, \quad
    \hat J \leftarrow \hat J + (y - \hat J w) K^T, \quad C \leftarrow C - K w^T C.

What has not been moved for a while is uncertain, so the first motion along it teaches at once: no
noise needs to be injected. For the same reason an arm at rest must not learn from measurements that
err: its covariance would grow, and each error would count as a motion's effect.

Pixels, which a camera measures, may leap when another camera comes in its place. A change from one
sample to the next that is ten times as far from what J_hat says as C, R and the errors of
measurement explain is such a leap. Nothing is learned from it; C begins anew, so that the next
motions teach at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...arrays.algebra import dot, functions_of, joined, matvec, outer, root, scaled
from ...inputs.fields import Array
from ...robot.rotation import rotation_error
from ..layout import Signals
from .late import pushed
from .learning import first_J_hat
from .measurement import EXACT

# Ratio of a leap to what explains a motion.
_LEAP = 10.0


def kalman_update(
    J_hat: Array, C: Array, w: Array, y: Array, wander: Any, variance: Any
) -> tuple[Array, Array]:
    """Return J_hat, shape (..., m, n), and its covariance, shape (..., n, n), one sample later.

    Args:
        J_hat: The learned Jacobian, shape (..., m, n).
        C: Covariance of each of its rows, shape (..., n, n), symmetric.
        w: Measured joint velocities, shape (..., n) [rad/s].
        y: Task velocity that they caused, shape (..., m).
        wander: Growth of the variances in this sample, q_n h.
        variance: Variance R of y.
    """
    C = C + scaled(wander, np.eye(w.shape[-1]))
    spread = matvec(C, w)
    K = spread / (variance + dot(w, spread))
    return J_hat + outer(y - matvec(J_hat, w), K), C - outer(K, spread)


@dataclass(frozen=True)
class LearnedJacobian:
    """A Jacobian learned from measured joint positions and end effector positions.

    Both velocities are difference quotients over the last samples. The arm has moved so for all of
    that time, whatever was commanded.

    Attributes:
        task_size: Number m of rows; of 6 rows the first three are rotation, if the task turns.
        size: Number n of joints.
        samples: Number of samples over which the quotients are taken.
        wander: Growth q_n of the variance of each entry [1/s].
        variance: Variance R of the measured task velocity [m^2/s^2].
        still: Joint speed below which J_hat and its covariance stay as they are [rad/s].
        initial: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own.
        turns: Whether the first three rows are those of a rotation.
        leaps: Whether what is measured may leap, because a camera is swapped.
        error: Standard deviation of a measured position [m], by which a leap is told.
    """

    task_size: int
    size: int
    samples: int
    wander: Any
    variance: Any
    still: float
    initial: Literal["uniform", "zero", "exact"]
    turns: bool = False
    leaps: bool = False
    error: float = 0.0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        n, m, k = self.size, self.task_size, self.samples
        parts = {"J_hat": (m, n), "covariance": (n, n), "q_before": (k, n)}
        parts["p_before"] = (k, m - 3 * self.turns)
        return parts | ({"R_before": (k, 3, 3)} if self.turns else {})

    def start(self, rng: np.random.Generator, u: Signals) -> dict[str, Array]:
        """Return its parts of the initial state, by name.

        Raises:
            InvalidInputError: If ``initial`` is ``exact`` and there is no J among the signals.
        """
        shapes = self.shapes
        J_hat = first_J_hat(self.initial, shapes["J_hat"], rng, u)
        found = {"J_hat": J_hat, "covariance": np.eye(self.size)}
        measured = {"q_before": "position", "p_before": "p_WE", "R_before": "R_WE"}
        for part in shapes.keys() & measured.keys():
            found[part] = np.broadcast_to(u[measured[part]], shapes[part])
        return found

    def advanced(
        self, kept: dict[str, Array], u: Signals, period: float
    ) -> tuple[Array, dict[str, Array]]:
        """Return the Jacobian, shape (..., m, n), and its parts of the next state.

        Args:
            kept: Its parts of the state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
        """
        over = self.samples * period
        q, p = u["position"], u["p_WE"]
        w = (q - kept["q_before"][..., -1, :]) / over
        y = (p - kept["p_before"][..., -1, :]) / over
        found = {
            "q_before": pushed(kept["q_before"], q, -2),
            "p_before": pushed(kept["p_before"], p, -2),
        }
        if self.turns:
            R = u["R_WE"]
            turned = rotation_error(kept["R_before"][..., -1, :, :], R) / over
            y = joined((turned, y))
            found["R_before"] = pushed(kept["R_before"], R, -3)
        before = kept["J_hat"], kept["covariance"]
        after = kalman_update(*before, w, y, self.wander * period, self.variance)
        if self.still > 0.0:
            moves = (w * w).sum(axis=-1)[..., None, None] > self.still**2
            xp = functions_of(w)
            after = tuple(xp.where(moves, new, old) for new, old in zip(after, before, strict=True))
        found["J_hat"], found["covariance"] = after
        if self.leaps:
            found = self._unless_leapt(kept, found, q, p, period)
        return found["J_hat"], found

    def _unless_leapt(
        self, kept: dict[str, Array], found: dict[str, Array], q: Array, p: Array, period: float
    ) -> dict[str, Array]:
        """Return the parts of the next state, which after a leap know of no motion before it."""
        moved = q - kept["q_before"][..., 0, :]
        way = p - kept["p_before"][..., 0, :] - matvec(kept["J_hat"], moved)
        doubt = dot(moved, matvec(kept["covariance"], moved)) + (EXACT.variance**0.5 * period) ** 2
        explained = 2.0**0.5 * self.error + root(doubt)
        leapt = (abs(way) > _LEAP * explained).any(axis=-1)
        xp = functions_of(p)
        if type(leapt) is np.bool_ and not leapt:
            return found
        anew = {
            "J_hat": kept["J_hat"],
            "covariance": np.eye(self.size),
            "q_before": q[..., None, :],
            "p_before": p[..., None, :],
        }
        leapt = leapt[..., None, None]
        return {name: xp.where(leapt, anew[name], part) for name, part in found.items()}
