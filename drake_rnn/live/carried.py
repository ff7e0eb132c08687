"""What one simulation hands on to the next, as another law or another arm takes over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array
from ..laws import Layout
from ..laws.parts.held_clear import NO_STOP
from ..laws.parts.obstacle_tracks import TRACKS

# Prefix of the parts that belong to what keeps a law safe, see `drake_rnn.laws.safety`.
_SAFE = "safe_"
# Parts of the state by which a stop is certified, see `drake_rnn.laws.parts.held_within` and
# `drake_rnn.laws.parts.held_clear`.
_MOTION = ("commanded", "a", "a_path", "v_path", "seen", "gaps", "held_back", "uncertified")


@dataclass(frozen=True)
class Carried:
    """The motion of an arm and the state of its law at the end of a simulation.

    Attributes:
        position_commanded: Shape (n,) [rad].
        position, velocity: Those of the arm, shape (n,) each [rad, rad/s].
        kind: Class of the law.
        parts: Parts of the law's state, by name.
        shapes: Their layout, the shapes by name.
    """

    position_commanded: Array
    position: Array
    velocity: Array
    kind: type
    parts: dict[str, Array]
    shapes: dict[str, tuple[int, ...]]

    def into(self, layout: Layout, x: Array, kind: type, *, anew: bool = False) -> Array:
        """Return the first state of a law that takes over.

        It goes on with the velocity, with the positions commanded until now and with what its stop
        was certified by, whether they are a law's own or those of what keeps it safe. A law of the
        same class and state goes on with everything; one that learned its Jacobian otherwise, with
        that.

        Args:
            layout: Layout of its state.
            x: The state that it would begin with, shape (layout.size,).
            kind: Its class.
            anew: Whether it begins anew in all but the motion.
        """
        known = {**({} if anew else self._of_law(layout, kind)), **self._motion(layout)}
        fitting = {
            name: known[name]
            for name, (_, shape) in layout.parts.items()
            if name in known and known[name].shape == shape
        }
        return layout.replaced(x, **fitting)

    def _motion(self, layout: Layout) -> dict[str, Array]:
        """Return what belongs to the motion, as a layout names it: a law's own, or its guard's."""
        guarded = f"{_SAFE}commanded"
        mine = _SAFE if guarded in self.parts else "" if "commanded" in self.parts else None
        held = {} if mine is None else {n: self.parts.get(mine + n) for n in (*_MOTION, *TRACKS)}
        known = {name: value for name, value in held.items() if value is not None}
        known.setdefault("commanded", self.position_commanded)
        # What was certified may have been with other bounds, or not at all.
        known["stop_delay"] = np.full(1, NO_STOP)
        v = self.parts["v"]
        if guarded in layout:
            return {"v": v, f"{_SAFE}wanted": v, **{_SAFE + n: each for n, each in known.items()}}
        return {"v": v, **(known if "commanded" in layout else {})}

    def _of_law(self, layout: Layout, kind: type) -> dict[str, Array]:
        if kind is not self.kind:
            return {}
        shapes = {name: shape for name, (_, shape) in layout.parts.items()}
        if shapes == self.shapes:
            return self.parts
        return {name: self.parts[name] for name in ("J_hat",) if name in self.parts}
