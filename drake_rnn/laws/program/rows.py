r"""Equations of a scheme: what the joint velocities x must do.

The end effector follows its path with a feedback of its position, and of its orientation as the
rotation vector from the actual to the desired one:

.. math::
    J x = b, \qquad b = \dot p_d + K (p_d - p), \qquad
    \dot b = \ddot p_d + K (\dot p_d - J x) .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from ...arrays.algebra import joined, matvec
from ...inputs.fields import Array
from ...robot.rotation import rotation_error
from ..layout import Signals
from .costs import Shapes


class Rows(Protocol):
    """Equations A x = b of a scheme."""

    @property
    def inputs(self) -> Shapes:
        """Shapes of the signals that they see, by name."""

    @property
    def size(self) -> int:
        """Number m of equations."""

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """Return A and b, shapes (..., m, k) and (..., m)."""

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """Return the time derivatives of A and b, as `Cost.rates` does."""


@dataclass(frozen=True, eq=False)
class EndEffectorVelocity:
    """The end effector's velocity along its path, with feedback.

    Attributes:
        joints: Number n of joints.
        size: Number m of rows of J; of 6 rows the first three are rotation.
        feedback: Gain K of the feedback [1/s].
    """

    joints: int
    size: int
    feedback: Any

    @property
    def inputs(self) -> Shapes:
        """See `Rows.inputs`."""
        axes = min(self.size, 3)
        shapes: Shapes = {"J": (self.size, self.joints), "p_WE": (axes,)}
        shapes |= {f"{letter}_WE_desired": (axes,) for letter in "pva"}
        if self._turns:
            shapes |= {"R_WE": (3, 3), "R_WE_desired": (3, 3)}
            shapes |= {"w_WE_desired": (3,), "alpha_WE_desired": (3,)}
        return shapes

    @property
    def _turns(self) -> bool:
        return self.size == 6

    def terms(self, u: Signals) -> tuple[Array, Array]:
        """See `Rows.terms`."""
        away, wanted = u["p_WE_desired"] - u["p_WE"], u["v_WE_desired"]
        if self._turns:
            away = joined((rotation_error(u["R_WE"], u["R_WE_desired"]), away))
            wanted = joined((u["w_WE_desired"], wanted))
        return u["J"], wanted + self.feedback * away

    def rates(self, u: Signals, u_dot: Signals, x: Array) -> tuple[Array | None, Array | None]:
        """See `Rows.rates`; that of a rotation vector is exact as it vanishes."""
        wanted, onward = u["v_WE_desired"], u["a_WE_desired"]
        if self._turns:
            wanted = joined((u["w_WE_desired"], wanted))
            onward = joined((u["alpha_WE_desired"], onward))
        return u_dot["J"], onward + self.feedback * (wanted - matvec(u["J"], x))
