"""Random quadratic programs, and their optima by a QP solver."""

import daqp
import numpy as np

from drake_rnn.laws.parts.programs import (
    Program,
    Rates,
)
from drake_rnn.laws.zeroing import Variables


def random_program(rng, *, box=True, rows=True, k=7, m=3):
    """A program with a solution, of which some bounds are active."""
    A, inside = rng.normal(size=(m, k)), 0.4 * rng.uniform(-1.0, 1.0, k)
    root = rng.normal(size=(k, k))
    C = rng.normal(size=(3, k))
    return Program(
        W=np.eye(k) + 0.2 * root @ root.T,
        c=2.0 * rng.normal(size=k),
        A=A,
        b=A @ inside,
        box=(-rng.uniform(0.5, 0.8, k), rng.uniform(0.5, 0.8, k)) if box else None,
        C=C if rows else None,
        d=C @ inside + rng.uniform(0.0, 0.2, 3) if rows else None,
    )


def optimum(program):
    """The optimum by daqp, shape (k,)."""
    W, c, A, b = program[:4]
    k = c.size
    lower, upper = program.box or (np.full(k, -1e30), np.full(k, 1e30))
    above, below, rows = [upper, b], [lower, b], [A]
    if program.C is not None:
        rows.append(program.C)
        above.append(program.d)
        below.append(np.full(program.d.size, -1e30))
    kinds = np.zeros(sum(map(len, above)), dtype=np.int32)
    kinds[k : k + b.size] = 5  # equations
    x, _, flag, _ = daqp.solve(
        W, c, np.vstack(rows), np.concatenate(above), np.concatenate(below), kinds
    )
    assert flag == 1
    return x


def variables_of(program):
    inequalities = program.inequalities()
    return Variables(
        program.c.size, program.b.size, 0 if inequalities is None else inequalities[1].size
    )


def turning_program(t):
    """A program that changes with time, and its rates: all terms but W, by sines."""
    rng = np.random.default_rng(3)
    parts = {}
    for name, shape in (("c", (5,)), ("A", (2, 5)), ("b", (2,))):
        size, phase = rng.normal(size=shape), rng.uniform(0.0, 6.0, shape)
        parts[name] = size + 0.5 * np.sin(3.0 * t + phase), 1.5 * np.cos(3.0 * t + phase)
    now = {name: value for name, (value, _) in parts.items()}
    rates = {name: rate for name, (_, rate) in parts.items()}
    return Program(W=np.eye(5), **now), Rates(**rates)
