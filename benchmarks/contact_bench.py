"""Measure the cost of controller and recorder relative to the bare plant in the same contact.

The bare plant has the same motors, with the same commands from Drake's own trajectory sources, so
it makes the same motion in the same contact. All figures of a row are measured in turn in the same
run; the smallest of each counts, as the least disturbed.
"""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from rich.console import Console
from rich.table import Table

from drake_rnn import Experiment, load_experiment, shipped_experiments
from drake_rnn.runs.simulation import build_simulator, recorded_simulator
from drake_rnn.systems.plant import add_plant, motors_of

#: Largest ratio of the wall time of everything to that of the bare plant.
TARGET = 2.0
DURATION = 2.0


def whole(experiment: Experiment, *, recorded: bool) -> float:
    """Return the wall time of the experiment's diagram [s]."""
    if recorded:
        simulator, _, recorder = recorded_simulator(experiment)
        recorder.watch(simulator)
    else:
        simulator, _ = build_simulator(experiment)
    simulator.Initialize()
    began = time.perf_counter()
    simulator.AdvanceTo(experiment.document.duration)
    return time.perf_counter() - began


def commands(experiment: Experiment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times [s] and the motors' commands: desired state and torque, one row per time."""
    simulator, (loop, *_), recorder = recorded_simulator(experiment)
    recorder.watch(simulator)
    simulator.AdvanceTo(experiment.document.duration)
    kinematics, steps = experiment.arm.kinematics(), recorder.steps
    torque = np.array([-kinematics.gravity(q) for q in steps.series("position")])
    states = zip(steps.time, steps.series("state"), strict=True)
    v = [loop.controller.reading.commanded_velocity(t, x) for t, x in states]
    state = np.hstack((steps.series("position_commanded"), v))
    once = np.flatnonzero(np.diff(steps.time, prepend=-1.0) > 1e-9)
    return steps.time[once], state[once], torque[once]


def bare(
    experiment: Experiment, told: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[float, float]:
    """Return the wall time of the bare plant [s], and the contact force at the end [N]."""
    arm, contact = experiment.arm, experiment.contact
    builder = DiagramBuilder()
    added = add_plant(builder, arm, experiment.start, contact, experiment.document.plant)
    motors = [motor.joint().name() for motor in motors_of(added.plant, added.instance)]
    order = [arm.joints.index(name) for name in motors]
    times, state, torque = told
    twice = [*order, *(k + arm.n for k in order)]
    for values, port in (
        (state[:, twice], added.plant.get_desired_state_input_port(added.instance)),
        (torque[:, order], added.plant.get_actuation_input_port(added.instance)),
    ):
        held = PiecewisePolynomial.ZeroOrderHold(times, values.T)
        builder.Connect(builder.AddSystem(TrajectorySource(held)).get_output_port(), port)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    began = time.perf_counter()
    simulator.AdvanceTo(experiment.document.duration)
    taken = time.perf_counter() - began
    context = added.plant.GetMyContextFromRoot(simulator.get_context())
    results = added.plant.get_contact_results_output_port().Eval(context)
    patches = map(results.hydroelastic_contact_info, range(results.num_hydroelastic_contacts()))
    force = sum(abs(patch.F_Ac_W().translational() @ contact.surface.normal_W) for patch in patches)
    return taken, force


def contact_table(rounds: int = 3) -> Table:
    """Return a table with one row per shipped experiment in contact."""
    table = Table(title=f"wall time of {DURATION:g} s in contact [s]")
    columns = ("bare plant", "+ diagram and law", "+ recorder", "ratio", "at most")
    for column in ("experiment", *columns, "real_time_factor", "end force, bare [N]"):
        table.add_column(column, justify="right")
    changes = {"duration": DURATION, "window": None, "accept": None}
    for name in (n for n in shipped_experiments() if n.startswith("contact_")):
        experiment = load_experiment(name, changes)
        told = commands(experiment)
        costs = []
        for _ in range(rounds):
            alone, force = bare(experiment, told)
            costs.append((alone, *(whole(experiment, recorded=flag) for flag in (False, True))))
        alone, unseen, seen = (min(column) for column in zip(*costs, strict=True))
        table.add_row(
            name,
            f"{alone:.2f}",
            f"{unseen - alone:.2f}",
            f"{seen - unseen:.2f}",
            f"{seen / alone:.2f}",
            f"{TARGET:g}",
            f"{DURATION / seen:.2f}",
            f"{force:.3g}",
        )
    return table


if __name__ == "__main__":
    Console(width=160).print(contact_table())
