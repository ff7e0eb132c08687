"""Many robots at one step of their runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ..arrays.algebra import root
from ..arrays.namespace import AnyArray
from ..inputs.fields import Array
from ..laws import Signals

#: Values of a metric by name, each of shape (robots,).
Found = dict[str, Array]


@dataclass(frozen=True)
class Pressed:
    """The contact of many robots.

    Attributes:
        normal: Outward unit normals of the surfaces, shape (3, robots).
        force: Pressing forces along these, shape (robots,) [N].
        desired: Desired ones, likewise.
    """

    normal: Array
    force: Array
    desired: Array


class Seen(NamedTuple):
    """The arms that the laws see, where they are not those that move.

    Attributes:
        p_WE: Positions of their end effectors along the task's axes, shape (m, robots) [m].
        J: Their Jacobians, shape (size of the task, n, robots).
    """

    p_WE: Array
    J: Array


@dataclass(frozen=True)
class Step:
    """Many robots at the end of a step, before what happens then.

    Attributes:
        number: Number of the step.
        time: Its time [s].
        position, velocity: Joint positions and velocities, shape (n, robots) [rad, rad/s].
        network_velocity: The laws' own joint velocities, shape (n, robots) [rad/s].
        p_WE, p_WE_desired, v_WE, v_WE_desired: Positions and velocities of the end effectors and
            their desired values along the task's axes, shape (m, robots) [m, m/s].
        J: Jacobians, shape (size of the task, n, robots).
        turned: Angles to the desired orientations, shape (robots,) [rad]; None without these.
        J_hat: Learned Jacobians, shape (m, n, robots); None without learning.
        observed: Observables of the laws, each of shape (robots, ...).
        pressed: Contact with surfaces; None without these.
        virtual: Virtual arms that the laws see; None if they see the arms themselves.
    """

    number: int
    time: float
    position: Array
    velocity: Array
    network_velocity: Array
    p_WE: Array
    p_WE_desired: Array
    v_WE: Array
    v_WE_desired: Array
    J: Array
    turned: Array | None
    J_hat: Array | None
    observed: Signals
    pressed: Pressed | None = None
    virtual: Seen | None = None

    @property
    def seen(self) -> Seen:
        """The arms that the laws see."""
        return self.virtual or Seen(self.p_WE, self.J)

    def aside(self, vectors: Array) -> Array:
        """Return ``vectors``, shape (m, robots); in contact, only their part along the surface."""
        if self.pressed is None:
            return vectors
        normal = self.pressed.normal
        return vectors - summed(vectors * normal) * normal


def summed(rows: AnyArray) -> AnyArray:
    """Return the sum over the first axis, one row after the other, however many robots there are.

    NumPy's own sum of a single column may add in another order than that of several.
    """
    total = rows[0]
    for k in range(1, len(rows)):
        total = total + rows[k]
    return total


def lengths(vectors: AnyArray) -> AnyArray:
    """Return the norms of vectors, shape (m, robots)."""
    return root(summed(vectors * vectors))
