"""Measure the cost of one tick of the whole diagram, in units of the arm's bare p_WE and J.

CPU times still vary by a factor of two between machines and from moment to moment. All figures of
a row are measured in turn in the same run; the smallest of each counts, as the least disturbed.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

import beside
from drake_rnn import Experiment, Law, Layout, SampledLaw, load_experiment
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.runs.simulation import build_simulator, recorded_simulator

#: Largest cost of a tick, in units, by experiment.
TARGETS = {
    "slc_nephroid_unbounded": 16.0,
    "slc_nephroid_known": 16.0,
    "slc_nephroid": 20.0,
    "naljdf_clover": 35.0,
    "adaptive_nephroid_known": 14.0,
    "adaptive_nephroid": 20.0,
    "adaptive_jerk": 20.0,
}
#: Largest cost of a sample of the law alone, likewise, where there is a target for it.
LAW_TARGETS = {"adaptive_nephroid_known": 6.0}


class Idle(SampledLaw):
    """A law without inputs that does nothing, to measure the cost of Drake's loop alone.

    Args:
        law: Law that it replaces, with the same state and integration scheme.
        period: Sampling period [s].
    """

    state = Layout()
    inputs = Layout()

    def __init__(self, law: Law, period: float) -> None:
        self.state = law.state
        self._scheme = law.sampled(period).integration_scheme

    @property
    def integration_scheme(self):
        return self._scheme

    def step(self, t, x, u, period):
        return x


def unit(experiment: Experiment, repeats: int = 5000) -> float:
    """Return the cost of p_WE and J, directly from pydrake, with a new posture each time [us]."""
    arm = experiment.arm
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    frame, world, origin = plant.GetFrameByName(arm.frame), plant.world_frame(), np.zeros(3)
    q = experiment.start.copy()
    began = time.process_time()
    for _ in range(repeats):
        q[0] += 1e-6
        plant.SetPositions(context, q)
        plant.CalcPointsPositions(context, frame, origin, world)
        plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, frame, origin, world, world
        )
    return (time.process_time() - began) / repeats * 1e6


def tick(experiment: Experiment, *, recorded: bool, idle: bool = False) -> float:
    """Return the cost of one sample of the diagram [us]."""
    duration, period = experiment.document.duration, experiment.document.period
    law = Idle(experiment.law, period) if idle else None
    if recorded:
        simulator, _, recorder = recorded_simulator(experiment, law)
        recorder.watch(simulator)
    else:
        simulator, _ = build_simulator(experiment, law)
    simulator.Initialize()
    began = time.process_time()
    simulator.AdvanceTo(duration)
    return (time.process_time() - began) / (duration / period) * 1e6


def law_step(experiment: Experiment, repeats: int = 3000) -> float:
    """Return the cost of one sample of the law alone, on signals of a running diagram [us]."""
    period = experiment.document.period
    simulator, loop = build_simulator(experiment)
    # On the path, once the arm has reached it.
    simulator.AdvanceTo(0.75 * experiment.document.duration)
    context = loop.controller.GetMyContextFromRoot(simulator.get_context())
    u, x = loop.controller.signals(context), loop.controller.state(context)
    step = without_checks(loop.controller.reading.step)
    began = time.process_time()
    for _ in range(repeats):
        step(0.0, x, u, period)
    return (time.process_time() - began) / repeats * 1e6


def radau_ratio(name: str = "naljdf_clover") -> float:
    """Return the CPU time of scipy's Radau for the same run, divided by that of the diagram."""
    experiment = load_experiment(name)
    document, law, path = experiment.document, experiment.law, experiment.path
    kinematics, start = experiment.arm.kinematics(), path.start_point(experiment.p_WE_start)
    n = experiment.arm.n

    def rates(t, y):
        q, x = y[:n], y[n:]
        v = law.commanded_velocity(t, x)
        p, p_dot, p_ddot = path.evaluate(t)
        u = {"position": q, "p_WE": kinematics.p_WE(q), "J": kinematics.J(q)}
        u |= {"Jdot_v": kinematics.Jdot_v(q, v), "p_WE_desired": start + p}
        u |= {"v_WE_desired": p_dot, "a_WE_desired": p_ddot}
        return np.concatenate((v, law.derivatives(t, x, u)))

    y = np.concatenate((experiment.start, law.initial_state(np.random.default_rng(0), {})))
    began = time.process_time()
    solve_ivp(rates, (0.0, document.duration), y, "Radau", rtol=1e-6, atol=1e-9)
    taken = time.process_time() - began
    whole = tick(experiment, recorded=True) * document.duration / document.period
    return taken / (whole * 1e-6)


def levels_cost(rounds: int, name: str = "recursive_circle_printed") -> tuple[float, float]:
    """Return the cost of a sample of the recursive law with one level and with all [us]."""
    gains = list(load_experiment(name).document.law["gains"])
    one, all_levels = (
        load_experiment(name, {"law.gains": chosen, "accept": None})
        for chosen in (gains[:1], gains)
    )
    costs = [(law_step(one), law_step(all_levels)) for _ in range(rounds)]
    first, last = (min(column) for column in zip(*costs, strict=True))
    return first, last


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--ticks", type=int, default=4000)
    parser.add_argument(
        "--beside",
        type=Path,
        metavar="FOLDER",
        help="only compare ticks and whole runs with those of another checkout",
    )
    arguments = parser.parse_args()
    if arguments.beside is not None:
        periods = {name: load_experiment(name).document.period for name in TARGETS}
        durations = {name: arguments.ticks * period for name, period in periods.items()}
        print("\n".join(beside.table(arguments.beside, durations, arguments.rounds)))
        print(f"Ratios should be at most {beside.AT_MOST}.")
        return
    table = Table(title="cost of one tick, in units of p_WE and J (us in brackets)")
    columns = ("p and J", "law", "ports", "Drake's loop", "recorder", "whole", "targets")
    for column in ("experiment", "period", *columns, "real_time_factor"):
        table.add_column(column, justify="right")
    for name, target in TARGETS.items():
        period = load_experiment(name).document.period
        experiment = load_experiment(name, {"duration": arguments.ticks * period})
        rounds = []
        for _ in range(arguments.rounds):
            costs = (
                unit(experiment),
                law_step(experiment),
                tick(experiment, recorded=False, idle=True),
                tick(experiment, recorded=False),
                tick(experiment, recorded=True),
            )
            rounds.append(costs)
        one, law, loop, bare, whole = (min(column) for column in zip(*rounds, strict=True))
        values = (one, law, bare - law - loop, loop, whole - bare, whole)
        table.add_row(
            name,
            f"{period:g} s",
            *(f"{value / one:.1f} ({value:.1f})" for value in values),
            f"law {LAW_TARGETS[name]:g}, {target:g}" if name in LAW_TARGETS else f"{target:g}",
            f"{period * 1e6 / whole:.2f}",
        )
    console = Console(width=160)
    console.print(table)
    ratio = min(radau_ratio() for _ in range(3))
    console.print(f"naljdf_clover: scipy's Radau takes {ratio:.2f} times as long as the diagram")
    one, five = levels_cost(arguments.rounds)
    console.print(
        f"recursive_circle_printed: the law takes {five / one:.2f} times as long with five levels "
        f"({five:.1f} us) as with one ({one:.1f} us)"
    )


if __name__ == "__main__":
    main()
