"""Print how near networks come to the optimum of programs along a run, beside a QP solver.

`python benchmarks/network_solvers.py` records the programs of `RUN`, in which bounds act, at 1 kHz,
and solves each with every network from zero, and from the solution a sample before. An iteration is
one evaluation of a network's right-hand side, with the largest step that is stable for all of these
programs; of 94LVI, of the zeroing network and of the implicit step, one round of it. Errors are the
largest of any joint velocity and program; times are the least of several runs, on one core.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import daqp
import numpy as np

from drake_rnn import Array, load_experiment
from drake_rnn.laws.parts.programs import Program
from drake_rnn.laws.projection import Network, iterate, project
from drake_rnn.laws.zeroing import Optimality
from markdown_table import head, row
from networks_in_the_box import seen

RUN = {
    "name": "solvers",
    "arm": "panda",
    "path": {"kind": "circle", "plane": "yz", "size": 0.05, "period": 4, "timing": "sin2"},
    "law": {"kind": "projection", "bounds": "velocity"},
    "limits": {"velocity": 0.17},
    "period": 1e-3,
    "duration": 4,
}
#: Instants at which programs are solved [s], every one after that of a sample before.
INSTANTS = np.linspace(1.1, 2.9, 13)
_DAMPING = 1e-12
_COUNTS = (1, 10, 100, 1000)
_NETWORKS: tuple[Network, ...] = ("lvi", "simplified_lvi", "dual", "simplified_dual")


class Method(NamedTuple):
    """A solver.

    Attributes:
        start: State to begin with at zero, given a program.
        after: State after a number of iterations.
        optimum: Variables of a state.
        rest: State that no longer changes, given a program.
    """

    start: Callable[[Program], Array]
    after: Callable[[Program, Array, int], Array]
    optimum: Callable[[Program, Array], Array]
    rest: Callable[[Program], Array]


def recorded() -> list[tuple[Program, Program]]:
    """Return programs along the run, each after that of a sample before."""
    experiment = load_experiment(RUN)
    law, period = experiment.law, 1e-3
    reading, kinematics = law.sampled(period), experiment.arm.kinematics()
    q, x, before, found = experiment.start, None, None, []
    wanted = {round(t / period) for t in INSTANTS.tolist()}
    for k in range(round(4.0 / period)):
        u = seen(experiment, kinematics, law.inputs, q, k * period)
        x = reading.initial_state(np.random.default_rng(0), u) if x is None else x
        program = law.scheme.program(u)
        if k in wanted and before is not None:
            found.append((before, program))
        before, x = program, reading.step(k * period, x, u, period)
        q = q + period * reading.commanded_velocity(0.0, x)
    return found


def exact(program: Program) -> Array | None:
    """Return the optimum by daqp, shape (k,); None if no velocity does the task."""
    W, c, A, b = program[:4]
    assert program.box is not None
    lower, upper = (np.concatenate((side, b)) for side in program.box)
    kinds = np.zeros(len(upper), dtype=np.int32)
    kinds[len(c) :] = 5
    x, _, flag, _ = daqp.solve(W, c, A, upper, lower, kinds)
    return np.asarray(x) if flag == 1 else None


def explicit(network: Network, programs: list[Program]) -> Method:
    """Return a network in Euler's steps."""
    step = 0.9 * min(project(network, each, _DAMPING).stable_below() for each in programs)

    def after(program: Program, y: Array, count: int) -> Array:
        form = project(network, program, _DAMPING)
        for _ in range(count):
            y = y + step * form.rate(y)
        return y

    return Method(_zero(network), after, _optimum(network), _rest(network))


def implicit(network: Network) -> Method:
    """Return a network in implicit steps, each of a gain times period of 1e8."""

    def after(program: Program, y: Array, count: int) -> Array:
        form = project(network, program, _DAMPING)
        for _ in range(count):
            y = form.after(y, 1e8)
        return y

    return Method(_zero(network), after, _optimum(network), _rest(network))


def _zero(network: Network) -> Callable[[Program], Array]:
    return lambda program: 0.0 * project(network, program, _DAMPING).g


def _rest(network: Network) -> Callable[[Program], Array]:
    def rest(program: Program) -> Array:
        form = project(network, program, _DAMPING)
        return form.after(form.after(0.0 * form.g, 1e8), 1e8)

    return rest


def _optimum(network: Network) -> Callable[[Program, Array], Array]:
    return lambda program, y: project(network, program, _DAMPING).optimum(y)


def _nothing(program: Program) -> Array:
    return np.zeros(3 * len(program.c) + len(program.b))


def _zeroing(program: Program, y: Array, count: int) -> Array:
    conditions = Optimality(program, _DAMPING)
    for _ in range(count):
        y = y - np.linalg.solve(conditions.slope(y), conditions.error(y))
    return y


def methods(programs: list[Program]) -> dict[str, Method]:
    """Return the solvers by name."""
    found = {f"`{each}`, `euler`": explicit(each, programs) for each in _NETWORKS}
    found["`lvi`, `iterated` (94LVI)"] = Method(
        lambda p: np.zeros(len(p.c) + len(p.b)),
        lambda p, y, count: iterate(p, _DAMPING, y, count),
        lambda p, y: y[: len(p.c)],
        _rest("lvi"),
    )
    found |= {f"`{each}`, `implicit`": implicit(each) for each in _NETWORKS}
    found["`zeroing`, `implicit`"] = Method(
        _nothing,
        _zeroing,
        lambda p, y: y[: len(p.c)],
        lambda p: _zeroing(p, _nothing(p), 100),
    )
    return found


def _seconds(call: Callable[[], object]) -> float:
    """Return the least time of a call [s]."""
    least = np.inf
    for _ in range(30):
        started = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - started)
    return float(least)


def main() -> None:
    """Print the table."""
    solved = [(pair, exact(pair[1])) for pair in recorded()]
    pairs = [pair for pair, x in solved if x is not None]
    optima = [x for _, x in solved if x is not None]
    active = sum(bool((np.abs(x) > 0.17 - 1e-6).any()) for x in optima)
    left_out = len(solved) - len(pairs)
    print(f"{len(pairs)} programs, in {active} of which a bound acts; {left_out} have no solution.")
    told = [f"from zero, {count}" for count in _COUNTS[:3]] + ["1000"]
    warm = [f"a sample on, {count}" for count in _COUNTS[:2]]
    head("method, error after iterations [rad/s]", *told, *warm, "one [us]", "each more [us]")
    for name, method in methods([program for _, program in pairs]).items():
        cells = []
        with np.errstate(over="ignore", invalid="ignore"):
            for count in _COUNTS:
                cells.append(_largest(method, pairs, optima, count, False))
            for count in _COUNTS[:2]:
                cells.append(_largest(method, pairs, optima, count, True))
        program = pairs[len(pairs) // 2][1]
        y = method.start(program)
        one, more = (
            _seconds(lambda m=method, p=program, y=y, k=k: m.optimum(p, m.after(p, y, k)))
            for k in (1, 11)
        )
        row(name, *cells, f"{1e6 * one:.0f}", f"{1e5 * (more - one):.0f}")
    program = pairs[len(pairs) // 2][1]
    row("daqp", *["0"] * 6, f"{1e6 * _seconds(lambda: exact(program)):.0f}", "")


def _largest(
    method: Method, pairs: list[tuple[Program, Program]], optima: list[Array], count: int, on: bool
) -> str:
    """Return the largest error after a number of iterations, as it is printed."""
    errors = []
    for (before, program), x in zip(pairs, optima, strict=True):
        try:
            y = method.rest(before) if on else method.start(program)
            found = method.optimum(program, method.after(program, y, count))
        except np.linalg.LinAlgError:
            return "singular"
        errors.append(np.abs(found - x).max())
    return f"{max(errors):.2g}"


if __name__ == "__main__":
    main()
