"""What an arm is to stay clear of if another one stands beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...inputs.fields import Array
from .capsules import ArmCapsules
from .clearance import Clearance


def beside(one: Clearance, other: ArmCapsules) -> Clearance:
    """Return what an arm is to stay clear of: itself, obstacles and another arm.

    Postures of the result are those of the arm and, behind them, of the other one. What the other
    arm is to stay clear of besides, itself and obstacles, is none of this arm's pairs.

    Args:
        one: What the arm is to stay clear of alone.
        other: The capsules of the other arm, where it stands in the same world frame.
    """
    arm = ArmCapsules.beside(one.arm, other)
    moved = np.nonzero(one.arm.carried.any(axis=1))[0]
    count = len(one.arm.links)
    others = np.arange(count, count + len(other.links))
    pairs = np.stack(np.meshgrid(moved, others, indexing="ij"), axis=-1).reshape(-1, 2)
    own = np.concatenate((one.own, pairs)).astype(np.intp)
    return Clearance(arm, own, one.solids, alone=count, touching=one.touching)


def stood(clearance: Clearance, R: Array, p: Array) -> Clearance:
    """Return the pairs of an arm with itself where its base is turned by R and moved by p.

    Args:
        clearance: Its pairs where it stands at the origin.
        R: Orientation of its base, shape (3, 3).
        p: Position of its base, shape (3,) [m].
    """
    return replace(clearance, arm=clearance.arm.moved(R, p))
