"""What a law is: neural dynamics as plain functions of arrays, without Drake.

A scheme is a `Law`. A clock runs its sampled reading, Drake's integrators its continuous one; most
laws are their own readings, and say so by the class they extend: `SampledLaw`, `ContinuousLaw`, or
both.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array

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


class Reading(ABC):
    """What a controller runs: a state, the signals it sees, and the joint velocities it commands.

    A reading holds its gains and never changes; what varies in time is the state, a flat vector
    that the controller keeps.
    """

    #: Drake's integration scheme one step of which integrates the command over a sample exactly:
    #: Euler's for a velocity that is held, a higher one for a command that varies with time.
    integration_scheme = "explicit_euler"

    @property
    @abstractmethod
    def state(self) -> Layout:
        """Parts of the state; ``v`` among them, the joint velocities it commands."""

    @property
    @abstractmethod
    def inputs(self) -> Layout:
        """Signals it sees, by port name. One without ``J`` is blind to the robot's structure."""

    @property
    def observables(self) -> Layout:
        """Signals that `diagnostics` returns; none by default."""
        return Layout()

    @property
    def holds_command(self) -> bool:
        """Whether the command depends on the state alone, and not on time as well."""
        return self.integration_scheme == "explicit_euler"

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """Return the state to start from, shape (state.size,): zero by default.

        Args:
            rng: Carries the experiment's seed.
            u: Signals at the start.
        """
        return np.zeros(self.state.size)

    def commanded_velocity(self, t: float, x: Array) -> Array:
        """Return the commanded joint velocities, shape (n,) [rad/s]: of time and state alone."""
        return x[self._v]

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        """Return what to record beside the state, by name; nothing in the loop may use it.

        It is asked at one instant, or at many at once: then all arrays have a leading dimension,
        and ``u`` holds the signals that follow from posture, path and time, not measured ones.
        """
        return {}

    @cached_property
    def _v(self) -> slice:
        return self.state.parts["v"][0]


class SampledReading(Reading):
    """A reading that a clock runs."""

    @abstractmethod
    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state one period later, shape (state.size,).

        Args:
            t: Time of the sample [s].
            x: State, shape (state.size,); must not be written to.
            u: Signals seen at the sample.
            period: Time until the next sample [s].
        """


class ContinuousReading(Reading):
    """A reading that is an ordinary differential equation."""

    @abstractmethod
    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the time derivative of the state, shape (state.size,)."""


@dataclass(frozen=True)
class JointPreview:
    """Desired joint positions that a law sees ahead of time, as ``position_preview``.

    Attributes:
        interval: Time between two of them [s].
        count: How many; the first is one interval ahead.
    """

    interval: float
    count: int


class Circumstances(NamedTuple):
    """What a law may need to know of the loop it is to run in.

    Attributes:
        loop_delay: Delay of the filter between its command and what it sees [s]; 0 for none.
        reference_is_delayed: Whether the desired position is delayed by as much.
        pressing_force: Force the tool is to press with [N]; None without a contact.
    """

    loop_delay: float = 0.0
    reference_is_delayed: bool = False
    pressing_force: float | None = None


class Law(Reading):
    """Neural dynamics of one scheme; the defaults are what most laws are."""

    #: Whether its joint velocities scale with the speed of the path, so that `drake_rnn.fastest`
    #: may stretch the path in time.
    stays_on_path = False
    #: Whether a part ``levels`` of its state holds derivatives of the joint positions, and not
    #: signals that stand for them.
    levels_are_derivatives = True

    @property
    def loop_gains(self) -> Mapping[str, float]:
        """Gains of the position feedback, by field [1/s]: a delay in the loop limits them.

        Empty if it is not known how the law takes a delay.
        """
        return {}

    @property
    def joint_preview(self) -> JointPreview | None:
        """Desired joint positions it sees ahead of time; None by default."""
        return None

    def sampled(self, period: float) -> SampledReading:
        """Return the reading that a clock runs.

        Args:
            period: Time between two samples [s].

        Raises:
            InvalidInputError: If the law cannot be sampled, or not at this period.
        """
        raise InvalidInputError(
            f"period: {type(self).__name__} cannot be sampled; give an integrator"
        )

    def continuous(self) -> ContinuousReading:
        """Return the reading that Drake integrates.

        Raises:
            InvalidInputError: If the law, with these arguments, is no differential equation.
        """
        raise InvalidInputError(
            f"integrator: {type(self).__name__} is no differential equation; "
            "sample it with a period"
        )

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return what a user should be warned of before a run.

        Raises:
            InvalidInputError: If the law cannot run in these circumstances.
        """
        return []

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        """Return what a user should be warned of after a run with these metrics."""
        return []


class SampledLaw(Law, SampledReading):
    """A law with a `step` of its own."""

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself; a law that cannot take any period overrides this."""
        return self


class ContinuousLaw(Law, ContinuousReading):
    """A law with `derivatives` of its own."""

    def continuous(self) -> ContinuousReading:
        """Return the law itself; a law that is not always continuous overrides this."""
        return self
