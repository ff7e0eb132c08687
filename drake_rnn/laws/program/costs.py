r"""Costs of a scheme at the velocity level: what is minimised of the joint velocities x.

The least velocity (minimum velocity norm, MVN) and repetitive motion (RMP, also drift-free), which
adds the way back to the posture q_0 at the start to it,

.. math::
    \tfrac12 x^T x + k (q - q_0)^T x .

A closed path then ends near the posture in which it began: in the null space of the task the joints
move towards q_0 at the rate k.

Both are standard; that of repetitive motion was read in the public code of a varying-parameter
network (``vp-rnn``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...arrays.algebra import acts
from ...inputs.fields import Array
from ..layout import Signals

Shapes = dict[str, tuple[int, ...]]


class Cost(Protocol):
    """What a scheme minimises, 1/2 x^T W x + c^T x."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that it sees, by name."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """Return W and c, shapes (..., k, k) and (..., k)."""

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """Return the time derivatives of W and c; None for what is constant.

        Args:
            u: Signals.
            u_dot: Time derivatives of those of them that no other signal tells.
            x: Variables of the program, shape (..., k).
        """


@dataclass(frozen=True, eq=False)
class ReturningVelocity:
    """The velocity's square and a way back: minimum velocity, and repetitive motion.

    Attributes:
        home: Posture q_0, shape (n,) [rad].
        return_gain: Gain k of the way back [1/s]; 0 for the least velocity.
    """

    home: Array
    return_gain: Any

    @property
    def inputs(self) -> Shapes:
        """See `Cost.inputs`."""
        return {"position": (self.home.shape[-1],)}

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Cost.terms`."""
        return np.eye(self.home.shape[-1]), self.return_gain * (u["position"] - self.home)

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Cost.rates`."""
        return None, self.return_gain * x if acts(self.return_gain) else None
