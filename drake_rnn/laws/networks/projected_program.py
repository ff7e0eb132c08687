r"""Networks of one projection whose equilibrium is the optimum of a program.

For :math:`\min \tfrac12 x^T W x + c^T x` with A x = b, bounds of x and C x <= d.

**LVI-based primal-dual network** (LVI-PDNN). The optimality conditions are a linear variational
inequality: with y = (x, lambda, mu), and Omega the bounds of x, all lambda and mu >= 0, it holds
just at the optimum that :math:`y = P_\Omega(y - (H y + p))`, where

.. math::
    H = \begin{pmatrix} W & -A^T & C^T \\ A & \varepsilon & 0 \\ -C & 0 & 0 \end{pmatrix}, \quad
    p = \begin{pmatrix} c \\ -b \\ d \end{pmatrix}, \qquad
    \dot y = \gamma (I + H^T) \left( P_\Omega(y - (H y + p)) - y \right) .

The *simplified* one leaves I + H^T out. It is the projection network of Xia, Leung and Wang for
these conditions. With W = I and no C it is the network (16) of
`drake_rnn.laws.simultaneous_learning`, and up to the sign of the multipliers that of
`drake_rnn.laws.parts.primal_dual`.

**Dual network**. Its neurons u are the multipliers of all rows E = [A; I; C], whose bounds are b
twice, those of x, and -inf and d:

.. math::
    \dot u = \gamma \left( P(E x - u) - E x \right), \qquad x = W^{-1} (E^T u - c) .

In the *simplified* one the equations are solved, so that it has neurons for the bounds alone:
x = M E^T u + s, with E = [I; C], and M and s such that every x fulfils A x = b.

A small epsilon, the square of a damping, keeps lambda bounded where the bounds allow no x with
A x = b: at the optimum epsilon lambda is what is short, b - A x.

Sources:
    LVI-PDNN and its simplified form were read in public code: a simulation of a Kinova arm, and a
    drift-free scheme. The dual one was read in public code that has it as a rival, for W = I and
    c = 0. The simplified dual one (Liu, Wang, "A simplified dual neural network for quadratic
    programming with its KWTA application", IEEE Transactions on Neural Networks 17, 2006), and the
    iteration below, are from memory.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np

from ...arrays.algebra import (
    clipped,
    dot,
    functions_of,
    joined,
    matmul,
    matvec,
    scaled,
    solved,
    solved_for,
    transposed,
    vecmat,
)
from ...inputs.fields import Array
from ..program.quadratic_program import Program, block_matrix, stacked_rows
from .projected_step import Projected

Network = Literal["lvi", "simplified_lvi", "dual", "simplified_dual"]

#: Networks whose state begins with the variables x.
PRIMAL: tuple[Network, ...] = ("lvi", "simplified_lvi")


class Inequality(NamedTuple):
    """A linear variational inequality, of N = k + m + l entries y = (x, lambda, mu).

    Attributes:
        H: Its matrix, shape (..., N, N).
        p: Its constant part, shape (..., N).
        lower: Lower bounds of the set Omega, shape (..., N).
        upper: Upper bounds, likewise.
    """

    H: Array
    p: Array
    lower: Array
    upper: Array


def projected(network: Network, program: Program, damping: Any) -> Projected:
    """Return a network for a program.

    Args:
        network: Which one.
        program: The program; for ``simplified_dual`` one with bounds or inequalities.
        damping: The small number epsilon.
    """
    if network == "dual":
        return _dual(program, damping)
    if network == "simplified_dual":
        return _simplified_dual(program, damping)
    H, p, lower, upper = inequality(program, damping)
    eye = np.eye(p.shape[-1])
    K = eye + transposed(H) if network == "lvi" else None
    return Projected(eye - H, -p, lower, upper, eye[: program.c.shape[-1]], K=K)


def neurons(network: Network, k: int, m: int, bounded: bool, rows: int = 0) -> int:
    """Return the number of neurons of a network.

    Args:
        network: Which one.
        k: Number of the program's variables.
        m: Number of its equations.
        bounded: Whether the variables have bounds.
        rows: Number of its further inequalities.
    """
    bounds = k if bounded or network in PRIMAL else 0
    return bounds + rows + (0 if network == "simplified_dual" else m)


def inequality(program: Program, damping: Any) -> Inequality:
    """Return the optimality conditions of a program as a linear variational inequality.

    Args:
        program: The program, of k variables, m equations and l further inequalities.
        damping: The small number epsilon.
    """
    W, c, A, b = program[:4]
    own = scaled(damping, np.eye(b.shape[-1]))
    blocks, p = [[W, -transposed(A)], [A, own]], [c, -b]
    lower, upper = [-np.inf + 0.0 * c, -np.inf + 0.0 * b], [np.inf + 0.0 * c, np.inf + 0.0 * b]
    if program.box is not None:
        lower[0], upper[0] = program.box
    if program.C is not None and program.d is not None:
        C, d = program.C, program.d
        none = np.zeros((d.shape[-1], b.shape[-1]))
        blocks[0].append(transposed(C))
        blocks[1].append(none.T)
        blocks.append([-C, none, np.zeros((d.shape[-1], d.shape[-1]))])
        p.append(d)
        lower.append(0.0 * d)
        upper.append(np.inf + 0.0 * d)
    return Inequality(block_matrix(blocks), joined(p), joined(lower), joined(upper))


def iterated(program: Program, damping: Any, y: Array, count: int) -> Array:
    r"""Return the state after a number of iterations of 94LVI, shape (..., N).

    With :math:`e = y - P_\Omega(y - (H y + p))`,

    .. math::
        y \leftarrow P_\Omega(y - \rho (H^T e + H y + p)), \qquad
        \rho = |e|^2 / |(H^T + I) e|^2 .

    An iteration costs two products and no factorisation.

    Args:
        program: The program.
        damping: The small number epsilon.
        y: State to begin with, of the LVI-based networks, shape (..., N).
        count: Number of iterations.
    """
    H, p, lower, upper = inequality(program, damping)
    where = functions_of(p, y).where
    for _ in range(count):
        F = matvec(H, y) + p
        e = y - clipped(y - F, lower, upper)
        back = vecmat(e, H)
        length = dot(back + e, back + e)
        rho = dot(e, e) / where(length == 0.0, 1.0, length)
        y = clipped(y - rho * (back + F), lower, upper)
    return y


def _weight(program: Program) -> Array:
    """Return W with the leading axes of the robots, and in arrays of their kind."""
    return program.W + 0.0 * program.c[..., None]


def _dual(program: Program, damping: Any) -> Projected:
    W, c, A, b = _weight(program), *program[1:4]
    E, lower, upper = _bounded_rows(program)
    lead = joined((b, lower)), joined((b, upper))
    E = A if E is None else stacked_rows([A, E])
    R = solved(W, transposed(E))
    r = -solved_for(W, c)
    N, s = matmul(E, R), matvec(E, r)
    count = N.shape[-1]
    own = np.diag(np.arange(count) < b.shape[-1]).astype(float)
    return Projected(N - np.eye(count), s, *lead, R, r, N + scaled(damping, own), s)


def _simplified_dual(program: Program, damping: Any) -> Projected:
    W, c, A, b = _weight(program), *program[1:4]
    E, lower, upper = _bounded_rows(program)
    if E is None:
        raise ValueError("simplified_dual: needs a program with bounds or inequalities")
    T, least = solved(W, transposed(A)), solved_for(W, c)
    soft = matmul(A, T) + scaled(damping, np.eye(b.shape[-1]))
    s = matvec(T, solved_for(soft, b + matvec(A, least))) - least
    # W^-1 (I - A^T soft^-1 A W^-1) E^T
    back = solved(W, transposed(E))
    R = back - matmul(T, solved(soft, matmul(A, back)))
    N, f = matmul(E, R), matvec(E, s)
    return Projected(N - np.eye(N.shape[-1]), f, lower, upper, R, s, N, f)


def _bounded_rows(program: Program) -> tuple[Array | None, Array, Array]:
    """Return the rows E = [I; C] of what is bounded, and lower and upper bounds."""
    none = program.c[..., :0]
    rows, lower, upper = [], [none], [none]
    if program.box is not None:
        rows.append(np.eye(program.c.shape[-1]))
        lower.append(program.box[0])
        upper.append(program.box[1])
    if program.C is not None and program.d is not None:
        rows.append(program.C)
        lower.append(-np.inf + 0.0 * program.d)
        upper.append(program.d)
    return stacked_rows(rows) if rows else None, joined(lower), joined(upper)
