"""Measures of the six iterations' claims: the printed formulas, on programs of a PUMA 560.

- With U = (v, multipliers) and e(U) = U - P(U - (M U + p)), each is U <- U - rho Q e.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from time import process_time
from typing import NamedTuple

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from ...experiment import load_experiment
from ...inputs.fields import Array
from ..claims import Run

_NAME = "lvi_petals"
# Bounds of multipliers, in place of infinity.
_FREE = 1e10
# Bound of joint velocities on the paths [rad/s].
_FASTEST = 1.5
# Norm of e at which Algorithm 1 ends, and at which an optimum is taken as found.
_DONE, _FOUND = 1e-3, 1e-13
# Tables III and IV as printed, joints by methods, and their last rows [rad].
_METHODS = ("94LVI", "E47", "M3", "M4", "M5", "M6")
_TABLE = {
    3: [
        [-5.0160e-6, -2.8086e-6, -6.3589e-6, -4.3697e-6, -4.4284e-6, -4.3840e-6],
        [-2.3883e-6, -1.8801e-6, -5.3472e-6, -5.0057e-6, -1.8268e-6, -2.7357e-6],
        [-2.1117e-6, -4.5231e-6, 3.2700e-6, -3.0729e-6, -3.6114e-6, -3.9413e-6],
        [-2.3928e-6, 2.3173e-6, 2.5634e-5, 2.4521e-5, 2.3452e-6, 2.3366e-5],
        [-6.2540e-6, 5.6179e-6, -9.2761e-6, -8.1923e-6, -5.5667e-6, -5.8205e-6],
        [0.0] * 6,
    ],
    4: [
        [6.0699e-6, 1.2740e-5, 1.3497e-5, 1.1264e-5, 1.0313e-5, 6.3533e-6],
        [-7.1712e-6, -1.9946e-5, -1.9219e-5, -1.8383e-5, -1.9629e-5, -9.3808e-6],
        [-3.3858e-5, -6.8786e-5, 6.9262e-5, -7.1534e-5, -6.9258e-5, -3.2785e-5],
        [1.4662e-4, 3.0442e-4, 3.0425e-4, 3.0352e-4, 3.0426e-4, 1.4699e-4],
        [2.2988e-5, 5.0995e-5, 5.1306e-5, 5.3095e-5, 5.1891e-5, 2.1713e-5],
        [0.0] * 6,
    ],
}
_NORMS = {
    3: [2.5436e-5, 2.4504e-6, 2.8686e-6, 2.6695e-5, 2.4839e-5, -2.4941e-5],
    4: [1.5254e-4, 3.1711e-4, 3.1709e-4, 3.1706e-4, 3.1171e-4, 1.5259e-4],
}


class _Program(NamedTuple):
    """A program of (11) to (13) as M, p and the bounds of U."""

    M: Array
    p: Array
    lower: Array
    upper: Array

    def short(self, U: Array) -> Array:
        """Return e(U)."""
        return U - np.clip(U - (self.M @ U + self.p), self.lower, self.upper)


def printed_drift(run: Run, table: int) -> float:
    """Largest joint drift that Table III or IV prints [rad]."""
    return float(np.abs(_TABLE[table]).max())


def printed_norm_misfit(run: Run, table: int) -> float:
    """Largest ratio, either way, of a printed norm to that of its column [1]."""
    ratios = np.abs(_NORMS[table]) / np.linalg.norm(_TABLE[table], axis=0)
    return float(np.maximum(ratios, 1.0 / ratios).max())


def inequality_excess(run: Run, method: str) -> float:
    """Largest excess over (28) in one step, as a share of the squared distance before it [1].

    Of 200 steps from random U on four programs, of which two have bounds that act.
    """
    worst: float = -np.inf
    for seed, program in enumerate(_programs()):
        G = np.eye(program.p.size) + np.linalg.inv(program.M.T)
        best = _optimum(seed)
        for before, after, e, rho in _steps(method, program, _start(program, seed), 200):
            away, apart = before - best, after - best
            square = away @ G @ away
            if square < 1e-12:
                break
            worst = max(worst, float((apart @ G @ apart - square + rho * (e @ e)) / square))
    return float(worst)


def iterations(run: Run, method: str, at_bounds: bool) -> float:
    """Largest number of iterations down to |e| of 1e-3, from random U [1]; at most 100000.

    Args:
        run: Not needed.
        method: One of the six.
        at_bounds: Whether bounds of the programs act.
    """
    counts = []
    for seed, program in enumerate(_programs()):
        start = _start(program, seed)
        if (seed >= 2) == at_bounds:
            numbers = (
                k
                for k, (_, _, e, _) in enumerate(_steps(method, program, start, 100000))
                if e @ e <= _DONE**2
            )
            counts.append(next(numbers, 100000))
    return float(max(counts))


def rank_along_path(run: Run, method: str) -> float:
    """Place of a method among the six, by iterations along the path; the fewest are first [1].

    At 150 places of a run each goes on from the last U until |e| is 1e-3.
    """
    return _place(method, {each: _along_path(run, each) for each in _METHODS})


def rank_in_time(run: Run, method: str) -> float:
    """Place of a method among the six, by processor time along the path; the least is first [1].

    Algorithm 1 as printed: Q is made anew in each iteration. The path is that of the ranks by
    iterations; the least of two times counts, which are taken in turn.
    """
    times = [_times_along_path(run) for _ in range(2)]
    return _place(method, {each: min(time[each] for time in times) for each in _METHODS})


def _place(method: str, costs: dict[str, float]) -> float:
    return float(1 + sum(cost < costs[method] for cost in costs.values()))


def _times_along_path(run: Run) -> dict[str, float]:
    """Return the processor time of each method along the path [s]."""
    times = {}
    for each in _METHODS:
        began = process_time()
        _along_path(run, each, anew=True)
        times[each] = process_time() - began
    return times


def _along_path(run: Run, method: str, anew: bool = False) -> int:
    """Return the iterations along the path, with Q made once at each place or in each of them."""
    result = run(_NAME)
    experiment, series = result.experiment, result.series
    kinematics, n = experiment.arm.kinematics(), experiment.arm.n
    total, U = 0, np.zeros(n + 3)
    for k in np.linspace(0, len(result.time) - 1, 150).astype(int):
        q = series["position"][k]
        pull, v_desired = 4.0 * (q - experiment.start), series["v_WE_desired"][k]
        program = _program(kinematics.J(q), pull, v_desired, _FASTEST)
        for _, after, e, _ in _steps(method, program, U, 10000, anew):
            if e @ e <= _DONE**2:
                break
            total, U = total + 1, after
    return total


def short_at_the_optimum(run: Run) -> float:
    """Largest |e| of (20) at the optima of programs that Drake's Clarabel finds [1]."""
    return max(float(np.abs(program.short(_by_clarabel(program))).max()) for program in _programs())


def least_reach(run: Run, stiffness: float, period: float | None = None) -> float:
    """Way left to a joint limit, least over 10 s at the bound of (9) from 1 rad before it [rad].

    Args:
        run: Not needed.
        stiffness: The coefficient of (9) [1/s].
        period: Sampling period [s]; None for continuous time.
    """
    left = least = 1.0
    if period is None:
        # At full speed down to 1.5 / stiffness, and from there on exponentially.
        slow = min(left, _FASTEST / stiffness)
        return float(slow * np.exp(-stiffness * (10.0 - (left - slow) / _FASTEST)))
    for _ in range(round(10.0 / period)):
        left -= period * min(_FASTEST, stiffness * left)
        least = min(least, left)
    return least


@cache
def _programs() -> tuple[_Program, ...]:
    """Return programs in the paper's posture; in the first two no bound acts."""
    experiment = load_experiment(_NAME)
    J = experiment.arm.kinematics().J(experiment.start)
    n, rng, programs = J.shape[1], np.random.default_rng(5), []
    for k in range(4):
        fastest, pull = (1.5, 0.4) if k < 2 else (0.5, 2.0)
        drift = np.asarray(pull * rng.normal(size=n))
        inside = rng.uniform(-0.5, 0.5, n) * fastest
        programs.append(_program(J, drift, J @ inside, fastest))
    return tuple(programs)


def _program(J: Array, drift: Array, v_desired: Array, fastest: float) -> _Program:
    """Return the program of (18) and (19) for a drift C and a task velocity."""
    m, n = J.shape
    M = np.block([[np.eye(n), -J.T], [J, np.zeros((m, m))]])
    ends = np.append(np.full(n, fastest), np.full(m, _FREE))
    return _Program(M, np.append(drift, -v_desired), -ends, ends)


@cache
def _optimum(number: int) -> Array:
    """Return the optimum of a program, by E47 as its authors have it: Q = I + M^T."""
    program = _programs()[number]
    Q, U = np.eye(program.p.size) + program.M.T, np.zeros(program.p.size)
    for _ in range(200000):
        e = program.short(U)
        way = Q @ e
        if np.abs(e).max() < _FOUND:
            break
        U = U - (e @ e) / (way @ way) * way
    return U


def _steps(
    method: str, program: _Program, U: Array, count: int, anew: bool = False
) -> Iterator[tuple[Array, Array, Array, float]]:
    """Yield U before and after each step, e before it, and rho, from a first U.

    Q is made once, or anew in each step as in the paper's Algorithm 1.
    """
    M = program.M
    Q = _way_of(method, M)
    for _ in range(count):
        e = program.short(U)
        if anew:
            Q = _way_of(method, M)
        way = Q @ e
        if not e.any():
            return
        rho = float(e @ e / _size_of(method, M, e, way))
        after = U - rho * way
        yield U, after, e, rho
        U = after


def _way_of(method: str, M: Array) -> Array:
    """Return Q of a method."""
    eye = np.eye(len(M))
    if method == "94LVI":
        return eye
    if method == "M5":
        return M.T
    if method == "M4":
        return np.asarray(np.linalg.inv(eye + M))
    inverse = np.asarray(np.linalg.inv(M))
    return inverse if method == "E47" else eye + inverse


def _size_of(method: str, M: Array, e: Array, way: Array) -> float:
    """Return the divisor of the step length of a method."""
    if method == "94LVI":
        return float(e @ (e + M @ e))
    if method == "E47":
        return float(e @ (e + way))
    if method == "M3":
        return float(way @ (way + M @ way))
    if method == "M4":
        return float(e @ e)
    rotation = way if method == "M5" else M.T @ e
    return float(rotation @ (e + rotation))


def _start(program: _Program, seed: int) -> Array:
    """Return a random U within its bounds."""
    U = np.random.default_rng(seed).normal(size=program.p.size)
    return np.clip(U, program.lower, program.upper)


def _by_clarabel(program: _Program) -> Array:
    """Return U of the optimum of a program, with the multipliers of its equations."""
    n = int(np.count_nonzero(program.upper < _FREE))
    J, c, b = program.M[n:, :n], program.p[:n], -program.p[n:]
    problem = MathematicalProgram()
    x = problem.NewContinuousVariables(n)
    problem.AddQuadraticCost(np.eye(n), c, x, is_convex=True)
    rows = problem.AddLinearEqualityConstraint(J, b, x)
    problem.AddBoundingBoxConstraint(program.lower[:n], program.upper[:n], x)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-12)
    solution = ClarabelSolver().Solve(problem, None, options)
    return np.append(solution.GetSolution(x), solution.GetDualSolution(rows))
