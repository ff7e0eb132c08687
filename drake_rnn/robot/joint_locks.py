"""Joints that lock during a run: which, when, how they come to rest, and whether a law is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictInt

from ..arrays.namespace import AnyArray
from ..errors import InvalidInputError
from ..inputs.arguments import is_flags, is_vector
from ..inputs.complaints import nearest, short
from ..inputs.fields import Array, Flag, NonNegative, validated

# Sample times carry rounding errors [s].
_ROUNDING = 1e-9


@validated
class JointLock:
    """A joint that locks during a run, and does not move again.

    Args:
        joint: Number of the joint, from 1, or its name.
        time: Time at which its brake closes [s]; in a sampled loop the first sample from then on.
        stop: How it comes to rest: ``braked``, as fast as the limits of its acceleration and, if
            there is one, of its jerk allow; ``at_once``, from one sample to the next, whatever the
            limits are. A joint without a limit of the acceleration always stops at once.
        told: Whether a law that sees the Jacobian sees the column of this joint as zero from then
            on, and one that learns a Jacobian sets that column of it to zero.
        told_after: Time after ``time`` from which it does [s], such as a detection takes.
    """

    joint: StrictInt | str
    time: NonNegative
    stop: Literal["braked", "at_once"] = "braked"
    told: Flag = True
    told_after: NonNegative = 0.0

    def __post_init__(self) -> None:
        if self.told_after > 0.0 and not self.told:
            raise ValueError("told_after: must be left out with told: false")

    def index(self, joints: Sequence[str]) -> int:
        """Return the index of the joint, from 0, among those of an arm.

        Args:
            joints: Their names.

        Raises:
            InvalidInputError: If it is not among them.
        """
        if isinstance(self.joint, str):
            if self.joint not in joints:
                raise InvalidInputError(
                    f"joint: there is no joint {self.joint!r}; {nearest(self.joint, list(joints))}"
                )
            return list(joints).index(self.joint)
        if not 1 <= self.joint <= len(joints):
            raise InvalidInputError(
                f"joint: must be a number from 1 to {len(joints)}, or a name, not {self.joint}"
            )
        return self.joint - 1


@dataclass(frozen=True, eq=False)
class JointLocks:
    """When the joints of an arm lock, shape (n,) each.

    Attributes:
        times: Time at which each joint's brake closes [s]; infinite for one that stays free.
        told: Time from which laws are told of it [s]; infinite if they never are.
        at_once: Whether it stops from one sample to the next.
    """

    times: Array
    told: Array
    at_once: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, given in (("times", self.times), ("told", self.told)):
            if not is_vector(given) or not (np.asarray(given) >= 0.0).all():
                raise InvalidInputError(
                    f"{name}: must be times of 0 or more, one per joint, infinite for never, not "
                    f"{short(given)}"
                )
        sizes: dict[str, tuple[object, int]] = {"told": (self.told, np.size(self.told))}
        sizes["at_once"] = self.at_once, np.size(self.at_once) if is_flags(self.at_once) else 0
        for name, (value, size) in sizes.items():
            if size != np.size(self.times):
                raise InvalidInputError(
                    f"{name}: must be one per joint, {np.size(self.times)} as in times, not "
                    f"{short(value)}"
                )

    @classmethod
    def of(cls, joints: Sequence[str], locks: Sequence[JointLock]) -> JointLocks:
        """Return when the joints of an arm lock.

        Args:
            joints: Names of its joints.
            locks: Its locks, one or more.

        Raises:
            InvalidInputError: If the arm has no such joint, or one locks twice.
        """
        times, told = np.full((2, len(joints)), np.inf)
        at_once = np.zeros(len(joints), dtype=bool)
        for lock in locks:
            joint = lock.index(joints)
            if np.isfinite(times[joint]):
                raise InvalidInputError(
                    f"joint: {lock.joint} locks at {times[joint]:g} s already; give it once"
                )
            times[joint] = lock.time
            told[joint] = lock.time + lock.told_after if lock.told else np.inf
            at_once[joint] = lock.stop == "at_once"
        return cls(times, told, at_once)

    @property
    def size(self) -> int:
        """Number of joints of the arm."""
        return self.times.size

    @property
    def joints(self) -> list[int]:
        """Indices of the joints that lock, from 0, in the order in which they do."""
        order = np.argsort(self.times, kind="stable").tolist()
        return [joint for joint in order if np.isfinite(self.times[joint])]

    @cached_property
    def span(self) -> tuple[float, float]:
        """Times at which the first and the last of them lock [s]."""
        finite = self.times[np.isfinite(self.times)]
        return float(finite.min()), float(finite.max())

    def locked(self, t: float) -> NDArray[np.bool_]:
        """Return whether the brake of each joint is closed at a time [s], shape (n,)."""
        return np.asarray(self.times <= t + _ROUNDING)

    def free(self, t: float | AnyArray) -> AnyArray:
        """Return 1 for each joint that a law takes for free at one or many times [s], 0 for others.

        Args:
            t: The times, a number or shape (k,).

        Returns:
            Factors of the columns of a Jacobian, shape (1, n) or (k, 1, n).
        """
        times = np.asarray(t, dtype=float)[..., np.newaxis, np.newaxis]
        return np.where(self.told <= times + _ROUNDING, 0.0, 1.0)
