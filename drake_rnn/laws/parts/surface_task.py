"""What is asked of a tool's tip: to follow a path along a surface, and to press against it."""

from __future__ import annotations

from typing import NamedTuple

from ...inputs.fields import Array
from ..layout import Layout, Signals
from .contact_loss import LOST, ContactLoss
from .fixed_stiffness import FixedStiffness
from .online_stiffness import OnlineStiffness


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

    gain: float
    surface: FixedStiffness | OnlineStiffness
    measured: bool
    approach_speed: float | None
    contact_loss: ContactLoss | None

    @property
    def learns_stiffness(self) -> bool:
        """Whether the stiffness is learned."""
        return self.surface.size > 0

    @property
    def stiffness(self) -> float:
        """The given stiffness [N/m], for options with which it cannot be learned."""
        assert isinstance(self.surface, FixedStiffness)
        return self.surface.value

    def parts(self) -> dict[str, tuple[int, ...]]:
        """Return the parts of its state, by name."""
        parts: dict[str, tuple[int, ...]] = {}
        if self.learns_stiffness:
            parts["stiffness"] = (self.surface.size,)
        if self.contact_loss is not None:
            parts["contact"] = (ContactLoss.size,)
        return parts

    def start(self) -> dict[str, Array]:
        """Return the initial values of these parts, by name."""
        parts = {}
        if self.learns_stiffness:
            parts["stiffness"] = self.surface.start()
        if self.contact_loss is not None:
            parts["contact"] = self.contact_loss.start()
        return parts

    def feel(self, state: Layout, x: Array, u: Signals, period: float) -> None:
        """Update stiffness and contact from the measured force, in place.

        Args:
            state: Layout of the law's state, which has these parts.
            x: State of the law, shape (state.size,).
            u: Signals at the sample.
            period: Sampling period [s].
        """
        force, desired = float(u["normal_force"][0]), float(u["normal_force_desired"][0])
        if self.learns_stiffness:
            known = state.part(x, "stiffness")
            depth = -float(u["normal_WE"].dot(u["p_WE"]))
            known[:] = self.surface.update(known, force, desired, depth)
        if self.contact_loss is not None:
            contact = state.part(x, "contact")
            contact[:] = self.contact_loss.update(contact, force, desired, period)

    def tip_velocity(self, state: Layout, x: Array, u: Signals) -> Array:
        """Return the desired velocity of the tip, shape (3,) [m/s].

        Args:
            state: Layout of the law's state, which has these parts.
            x: State of the law, shape (state.size,).
            u: Signals at the sample.
        """
        n = u["normal_WE"]
        if self.contact_loss is not None:
            contact = state.part(x, "contact")
            if contact[0] == LOST:
                return self.contact_loss.retreat(contact) * n
        along = u["v_WE_desired"] + self.gain * (u["p_WE_desired"] - u["p_WE"])
        desired = float(u["normal_force_desired"][0])
        if self.measured:
            known = state.part(x, "stiffness") if self.learns_stiffness else x[:0]
            force = float(u["normal_force"][0])
            rise = self.surface.retreat_speed(known, force, desired, self.gain)
        else:
            rise = float(n.dot(along)) - self.gain * desired / self.stiffness
        if self.approach_speed is not None:
            rise = min(max(rise, -self.approach_speed), self.approach_speed)
        return along + (rise - float(n.dot(along))) * n
