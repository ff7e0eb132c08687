r"""A quadratic program at one instant, and how fast it changes.

.. math::
    \min_x \tfrac12 x^T W x + c^T x \quad \text{s.t.} \quad A x = b, \quad
    \underline x \le x \le \overline x, \quad C x \le d .
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import functions_of, joined
from ...inputs.fields import Array


class Program(NamedTuple):
    """A program of k variables, m equations and, where there are any, l inequalities.

    Attributes:
        W: Weight, symmetric and positive semidefinite, shape (..., k, k).
        c: Linear term, shape (..., k).
        A: Matrix of the equations, shape (..., m, k).
        b: Their right-hand side, shape (..., m).
        box: Lower and upper bounds of x, finite, shape (..., k) each; None for none.
        C: Matrix of the inequalities, shape (..., l, k); None for none.
        d: Their right-hand side, shape (..., l); None for none.
    """

    W: Array
    c: Array
    A: Array
    b: Array
    box: tuple[Array, Array] | None = None
    C: Array | None = None
    d: Array | None = None

    def ahead(self, rates: Rates, time: float) -> Program:
        """Return the program a time [s] later, if its rates stay as they are."""
        later = partial(_later, time=time)
        box = self.box
        if box is not None and rates.box is not None:
            box = later(box[0], rates.box[0]), later(box[1], rates.box[1])
        return Program(
            W=later(self.W, rates.W),
            c=later(self.c, rates.c),
            A=later(self.A, rates.A),
            b=later(self.b, rates.b),
            box=box,
            C=None if self.C is None else later(self.C, rates.C),
            d=None if self.d is None else later(self.d, rates.d),
        )

    def inequalities(self) -> tuple[Array, Array] | None:
        """Return all inequalities as rows and right-hand sides, the box first; None for none."""
        rows, sides = [], []
        if self.box is not None:
            eye = np.eye(self.c.shape[-1])
            rows += [eye, -eye]
            sides += [self.box[1], -self.box[0]]
        if self.C is not None and self.d is not None:
            rows.append(self.C)
            sides.append(self.d)
        return (stacked_rows(rows), joined(sides)) if rows else None


class Rates(NamedTuple):
    """Time derivatives of what a `Program` consists of; None for what is constant."""

    W: Array | None = None
    c: Array | None = None
    A: Array | None = None
    b: Array | None = None
    box: tuple[Array, Array] | None = None
    C: Array | None = None
    d: Array | None = None

    def inequalities(self, program: Program) -> tuple[Array | None, Array | None]:
        """Return the rates of `Program.inequalities`; None for what is constant."""
        sides, k = [], program.c.shape[-1]
        changing = self.box is not None or self.d is not None
        if program.box is not None:
            lower, upper = (0.0 * program.c,) * 2 if self.box is None else self.box
            sides += [upper, -lower]
        if program.d is not None:
            sides.append(0.0 * program.d if self.d is None else self.d)
        rows = self.C
        if rows is not None and program.box is not None:
            rows = stacked_rows([np.zeros((2 * k, k)), rows])
        return rows, joined(sides) if changing else None


def stacked_rows(blocks: list[Array]) -> Array:
    """Return matrices one above the other; their leading axes are broadcast."""
    if len(blocks) == 1:
        return blocks[0]
    return _concatenated(blocks, -2)


def block_matrix(blocks: list[list[Array]]) -> Array:
    """Return a matrix made of rows of blocks; the blocks' leading axes are broadcast."""
    return _concatenated([_concatenated(row, -1) for row in blocks], -2)


def _concatenated(blocks: list[Array], axis: int) -> Array:
    lead = np.broadcast_shapes(*(block.shape[:-2] for block in blocks))
    xp = functions_of(*blocks)
    whole = [xp.broadcast_to(block, lead + block.shape[-2:]) for block in blocks]
    return xp.concatenate(whole, axis=axis)


def _later(value: Array, rate: Array | None, time: Any) -> Array:
    return value if rate is None else value + time * rate
