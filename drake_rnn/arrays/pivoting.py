"""Block principal pivoting: which entries of a program change sides from round to round.

An entry is at its lower bound, -1, at its upper one, 1, or free, 0. All that are wrong change sides
at once as long as fewer are wrong each time, or once more; then only the last one that is wrong
does, as Murty's rule has it, which ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .algebra import functions_of
from .namespace import AnyArray

#: Further rounds in which all entries may change sides though not fewer are wrong. With 3, five
#: times as many programs that allow nothing like their task need more than 60 rounds.
PATIENCE = 1.0


def first(sides: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the fewest that were wrong and the patience before the first round, (..., 1) each."""
    each = 0.0 * sides[..., :1]
    return each + sides.shape[-1] + 1.0, each + PATIENCE


def turned(sides: AnyArray, ought: AnyArray, fewest: Any, patience: Any) -> tuple[AnyArray, ...]:
    """Return sides, fewest and patience of the next round, and who is done, shape (..., 1).

    Args:
        sides: Sides of this round, shape (..., n).
        ought: Sides that its solution is on, likewise.
        fewest: The fewest that were wrong so far, shape (..., 1).
        patience: Rounds that all may still change sides in, likewise.
    """
    xp, order = functions_of(sides, ought), np.arange(sides.shape[-1])
    wrong = ought != sides
    count = 1.0 * wrong.sum(axis=-1, keepdims=True)
    fewer = count < fewest
    last = wrong & (xp.where(wrong, order, -1).max(axis=-1, keepdims=True) == order)
    sides = xp.where(fewer | (patience > 0.0) | last, ought, sides)
    patience = xp.where(fewer, PATIENCE, patience - 1.0)
    return sides, xp.minimum(fewest, count), patience, count == 0.0
