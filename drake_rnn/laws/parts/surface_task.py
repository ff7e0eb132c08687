"""What is asked of a tool's tip: to follow a path along a surface, and to press against it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import clipped, dot, functions_of, is_one, outer, scaled
from ...inputs.fields import Array
from ..layout import Signals
from .contact_loss import LOST, ContactLoss
from .stiffness import FixedStiffness, OnlineStiffness

Kept = dict[str, Array]

_NOTHING = np.zeros(0)


def surface_split(normal_WE: Array, stiffness: Any) -> Array:
    """Return the rows that split a tip velocity into pressing and sliding, shape (..., 6, 3).

    Args:
        normal_WE: Outward normal of the surface, of length 1, shape (..., 3).
        stiffness: Scale of the pressing rows [N/m].
    """
    n = normal_WE
    P_n = outer(n, n)
    return functions_of(n).concatenate((scaled(stiffness, P_n), np.eye(3) - P_n), axis=-2)


def printed_orientation_rows(J_omega: Array, R_WE: Array) -> Array:
    """Return the Jacobian of the paper's w = [b2, b3, c2, c3], shape (..., 4, n).

    Args:
        J_omega: Jacobian of the tool's angular velocity, shape (..., 3, n).
        R_WE: Orientation of the tool with the axes a, b, c as columns, shape (..., 3, 3).
    """
    # The columns b and c of R rotate with the angular velocity: b' = omega x b.
    xp = functions_of(J_omega, R_WE)
    turned = [
        xp.cross(J_omega, R_WE[..., :, axis, np.newaxis], axis=-2)[..., 1:, :] for axis in (1, 2)
    ]
    return xp.concatenate(turned, axis=-2)


class SurfaceTask(NamedTuple):
    """Motion along a surface and force along its normal, with what is learned of the contact.

    Its state has the parts ``stiffness`` and ``contact``, each only if it is needed.

    Attributes:
        gain: Gain of the position and force feedback [1/s].
        surface: Stiffness of the contact, given or learned.
        measured: Whether the force is measured, and not computed from the depth of the tip.
        approach_speed: Largest speed along the normal [m/s]; None for no bound.
        contact_loss: Reaction to a lost contact; None to ignore it.
    """

    gain: Any
    surface: FixedStiffness | OnlineStiffness
    measured: bool
    approach_speed: Any
    contact_loss: ContactLoss | None

    @property
    def learns_stiffness(self) -> bool:
        """Whether the stiffness is learned."""
        return self.surface.size > 0

    @property
    def stiffness(self) -> Any:
        """The given stiffness [N/m], for options with which it cannot be learned."""
        assert isinstance(self.surface, FixedStiffness)
        return self.surface.value

    @property
    def inputs(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the signals of the contact that it sees, by name."""
        told: dict[str, tuple[int, ...]] = {"normal_WE": (3,), "normal_force_desired": (1,)}
        return told | ({"normal_force": (1,)} if self.measured else {})

    @property
    def observables(self) -> dict[str, tuple[int, ...]]:
        """Shapes of what `diagnostics` returns, by name."""
        return {} if self.contact_loss is None else {"contact_lost": (1,)}

    def parts(self) -> dict[str, tuple[int, ...]]:
        """Return the parts of its state, by name."""
        parts: dict[str, tuple[int, ...]] = {}
        if self.learns_stiffness:
            parts["stiffness"] = (self.surface.size,)
        if self.contact_loss is not None:
            parts["contact"] = (ContactLoss.size,)
        return parts

    def start(self) -> Kept:
        """Return the initial values of these parts, by name."""
        parts = {}
        if self.learns_stiffness:
            parts["stiffness"] = self.surface.start()
        if self.contact_loss is not None:
            parts["contact"] = self.contact_loss.start()
        return parts

    def felt(self, kept: Signals, u: Signals, period: float) -> Kept:
        """Return stiffness and contact after one more sample of the force, as far as they are kept.

        Args:
            kept: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Sampling period [s].
        """
        if not self.parts():
            return {}
        force, desired = _number(u["normal_force"]), _number(u["normal_force_desired"])
        felt = {}
        if self.learns_stiffness:
            depth = -dot(u["normal_WE"], u["p_WE"])
            felt["stiffness"] = self.surface.update(kept["stiffness"], force, desired, depth)
        if self.contact_loss is not None:
            felt["contact"] = self.contact_loss.update(kept["contact"], force, desired, period)
        return felt

    def tip_velocity(self, kept: Signals, u: Signals) -> Array:
        """Return the desired velocity of the tip, shape (..., 3) [m/s].

        Args:
            kept: Parts of the law's state, by name.
            u: Signals at the sample.
        """
        n = u["normal_WE"]
        along = u["v_WE_desired"] + self.gain * (u["p_WE_desired"] - u["p_WE"])
        out = dot(n, along)
        pressing = along + (self._rise(kept, u, out) - out) * n
        return self.unless_lost(kept, pressing, n)

    def depth_error(self, kept: Signals, u: Signals) -> Any:
        """Return how much too deep the tip is for the desired force [m], a float or (..., 1).

        Args:
            kept: Parts of the law's state, by name.
            u: Signals at the sample.
        """
        force, desired = _number(u["normal_force"]), _number(u["normal_force_desired"])
        return self.surface.depth_error(self._known(kept), force, desired)

    def unless_lost(self, kept: Signals, pressing: Array, normal_WE: Array) -> Array:
        """Return a velocity of the tip where it has contact, and that of the reaction elsewhere.

        Args:
            kept: Parts of the law's state, by name.
            pressing: Velocity of a tip that has not lost its contact, shape (..., 3) [m/s].
            normal_WE: Outward normal of the surface, shape (..., 3).
        """
        if self.contact_loss is None:
            return pressing
        contact = kept["contact"]
        away = self.contact_loss.retreat(contact) * normal_WE
        if is_one(contact):
            return away if contact[0] == LOST else pressing
        return functions_of(contact, pressing).where(contact[..., :1] == LOST, away, pressing)

    def diagnostics(self, kept: Signals) -> Kept:
        """Return the observables, by name, from the parts of the law's state."""
        if self.contact_loss is None:
            return {}
        return {"contact_lost": (kept["contact"][..., :1] == LOST).astype(float)}

    def check(self, key: str, pressing_force: float | None) -> None:
        """Raise an InvalidInputError if the desired force would count as no contact.

        Args:
            key: Key of the reaction to a lost contact, for the message.
            pressing_force: Desired pressing force [N]; None without a contact.
        """
        if self.contact_loss is not None:
            self.contact_loss.check(key, pressing_force)

    def caveats(self, key: str, metrics: Mapping[str, float]) -> list[str]:
        """Return what to say after a run with these metrics.

        Args:
            key: Key of the reaction to a lost contact, for the message.
            metrics: Metrics of the run, by name.
        """
        return [] if self.contact_loss is None else self.contact_loss.caveats(key, metrics)

    def _rise(self, kept: Signals, u: Signals, out: Any) -> Any:
        """Return the speed out of the surface that the force asks for [m/s].

        Args:
            kept: Parts of the law's state, by name.
            u: Signals at the sample.
            out: Speed out of the surface that the path asks for [m/s].
        """
        desired = _number(u["normal_force_desired"])
        if self.measured:
            force, known = _number(u["normal_force"]), self._known(kept)
            rise = self.surface.retreat_speed(known, force, desired, self.gain)
        else:
            rise = out - self.gain * desired / self.stiffness
        return rise if self.approach_speed is None else _limited(rise, self.approach_speed)

    def _known(self, kept: Signals) -> Array:
        """Return what is known of the stiffness; nothing if it is given."""
        return kept["stiffness"] if self.learns_stiffness else _NOTHING


def _number(signal: Array) -> Any:
    """Return a signal of one entry: a float, or an array of shape (..., 1) of many robots."""
    return float(signal[0]) if is_one(signal) else signal


def _limited(value: Any, largest: Any) -> Any:
    if isinstance(value, float):
        return min(max(value, -largest), largest)
    return clipped(value, -largest, largest)
