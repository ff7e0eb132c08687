"""What a law is: neural dynamics as plain functions of arrays, without Drake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ..fields import Array

Signals = Mapping[str, Array]


class Layout:
    """The named parts of a flat vector, in order.

    Args:
        parts: Name and shape of each part, e.g. ``v=(7,), J_hat=(3, 7)``.
    """

    def __init__(self, **parts: tuple[int, ...]) -> None:
        sizes = [int(np.prod(shape)) for shape in parts.values()]
        ends = np.cumsum([0, *sizes])
        self.size = int(ends[-1])
        self.parts = {
            name: (slice(int(end) - size, int(end)), shape)
            for (name, shape), size, end in zip(parts.items(), sizes, ends[1:], strict=True)
        }
        self._places = tuple(self.parts.values())

    def __contains__(self, name: str) -> bool:
        return name in self.parts

    def split(self, x: Array) -> list[Array]:
        """Views of the parts of ``x``, shape (..., size), in order."""
        if x.ndim == 1:
            # Read at every sample: flat parts need no reshaping.
            return [x[at] if len(s) == 1 else x[at].reshape(s) for at, s in self._places]
        lead = x.shape[:-1]
        return [x[..., at].reshape(lead + shape) for at, shape in self._places]

    def part(self, x: Array, name: str) -> Array:
        """View of one part of ``x``, shape (..., size)."""
        at, shape = self.parts[name]
        return x[..., at].reshape(x.shape[:-1] + shape)

    def join(self, *values: Array) -> Array:
        """The flat vector, shape (size,), of the given parts."""
        return np.concatenate([value.ravel() for value in values])


class Law(Protocol):
    """Neural dynamics of one scheme. A law holds its gains and never changes.

    Its state owns the joint velocities it asks for, as the part ``v``.

    Beyond what stands here a law may have, and others look whether it has:

    - ``derivatives(t, x, u)``: see `ContinuousLaw`; a law without is sampled, never integrated.
    - ``sampled``: the law, of another state and other inputs, that is sampled in its stead.
    - ``check_period(period)``: raises an InvalidInputError if it cannot be sampled so, ``period``
      in [s]; asked before a run, and of ``sampled`` by the controller.
    - ``check_integrated()``: raises one if, with these arguments, it cannot be integrated.
    - ``integration_scheme``: Drake's, one step of which a sample integrates the command that
      ``holds_command`` says is not held; without it ``runge_kutta2``, exact for a ramp.
    - ``interval``: between two of its plans [s], which must be that of the reference it is shown.
    - ``caveats(metrics)``: the warnings that a run's metrics give cause for, a list of sentences.
    """

    @property
    def state(self) -> Layout:
        """Parts of its state."""

    @property
    def inputs(self) -> Layout:
        """What it may see. A law without ``J`` among its inputs is blind to the structure."""

    @property
    def observables(self) -> Layout:
        """What ``diagnostics`` tells."""

    @property
    def holds_command(self) -> bool:
        """Whether ``commanded_velocity`` depends on the state alone, not on time as well."""

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """The state to start from, shape (state.size,); ``rng`` carries the experiment's seed."""

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """The state one period later, shape (state.size,)."""

    def commanded_velocity(self, t: float, x: Array) -> Array:
        """Joint velocities asked of the arm, shape (n,) [rad/s]; of time and state alone."""

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        """What to record beside the state, by name; nothing in the loop may use it.

        Of one instant, or of many at once: then everything has a leading dimension, and
        ``u`` holds what follows from posture, path and time, not what was measured.
        """


class ContinuousLaw(Law, Protocol):
    """A law that is an ordinary differential equation."""

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Time derivative of the state, shape (state.size,)."""
