"""What a step of the adaptive law costs with obstacles and without, in turn along the same motion.

::

    python benchmarks/avoidance_cost.py
    python benchmarks/avoidance_cost.py --jerk 20
    python benchmarks/avoidance_cost.py --fine

Steps are those of `adaptive_obstacle_on_path` with five further balls, of both laws with the jerk
bounded as given. The unit u is p_WE and J of the posture by pydrake, timed in turn with them. The
step with obstacles is then made in C, from the same states, one after the other. With ``--fine``
the step with obstacles is compared for coarse and for fine capsules of the arm, three times in
turn, of which the least median counts; it ends with an error above `FINE`.
"""

from __future__ import annotations

import argparse
from time import perf_counter
from typing import Any

import numpy as np

from drake_rnn import Experiment, load_experiment
from drake_rnn.compiled.library import built_step
from drake_rnn.inputs.fields import Array
from drake_rnn.laws.checks import sampled_reading
from markdown_table import head, row

NAME, UNTIL = "adaptive_obstacle_on_path", 9.0
#: Balls that stand about, besides the one on the path; 0.4 m and more from it.
FAR = [[0.7, 0.5, 0.3], [0.7, -0.6, 0.4], [-0.5, 0.5, 0.5], [-0.6, -0.4, 0.3], [0.1, 0.8, 0.8]]

#: Largest cost of a step with fine capsules over that with coarse ones.
FINE = 1.5


def timed(experiment: Experiment, blind: Experiment) -> Array:
    """Return how long u, a step of each law, and the first in C took, shape (k, 4) [s]."""
    period = float(experiment.document.period or 0.0)
    readings = [sampled_reading(each.law, period) for each in (experiment, blind)]
    kinematics, q = experiment.arm.kinematics(), experiment.start.copy()
    plant = experiment.arm.plant()
    context, E = plant.CreateDefaultContext(), plant.GetFrameByName(experiment.arm.frame)
    # Both go on from where the arm is.
    parts = [part for part in ("v", "commanded", "a") if part in readings[1].state]
    times, states, given = [], list[Array](), list[tuple[Array, dict[str, Array]]]()
    for k in range(round(UNTIL / period)):
        t = k * period
        began = perf_counter()
        plant.SetPositions(context, q)
        E.CalcPoseInWorld(context)
        kinematics.J(q)
        taken = [perf_counter() - began]
        u = {
            "position": q,
            "p_WE": kinematics.p_WE(q),
            "J": kinematics.J(q),
            "J_omega": kinematics.J_omega(q),
            "p_WE_desired": experiment.desired.position(t)[0],
            "p_preview": experiment.desired.position(t + period)[0],
        }
        if not states:
            states = [each.initial_state(np.random.default_rng(0), u) for each in readings]
        for part in parts:
            readings[1].state.part(states[1], part)[:] = readings[0].state.part(states[0], part)
        given.append((states[0], u))
        for number, reading in enumerate(readings):
            began = perf_counter()
            states[number] = reading.step(t, states[number], u, period)
            taken.append(perf_counter() - began)
        q = q + period * readings[0].commanded_velocity(t, states[0])
        times.append(taken)
    return np.column_stack((times, timed_in_c(readings[0], period, given)))


def timed_in_c(reading: Any, period: float, given: list[tuple[Array, dict[str, Array]]]) -> Array:
    """Return how long a step in C takes from each state, shape (k,) [s]; the least of five."""
    built = built_step(reading, period)
    assert built is not None, "a C compiler is needed"
    step, times = built.in_place(), np.full(len(given), np.inf)
    for _ in range(5):
        for k, (state, u) in enumerate(given):
            step.x[:] = state
            for name, signal in step.u.items():
                signal[:] = u[name]
            began = perf_counter()
            step.make()
            times[k] = min(times[k], perf_counter() - began)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jerk", type=float, help="largest jerk [rad/s^3]; none without it")
    parser.add_argument("--fine", action="store_true", help="compare coarse and fine capsules")
    options = parser.parse_args()
    first = load_experiment(NAME).document.obstacles
    balls = [{"kind": "ball", "center": center, "radius": 0.05} for center in FAR]
    changes: dict[str, Any] = {"obstacles": [*(first or []), *balls]}
    if options.jerk is not None:
        changes["limits.jerk"] = options.jerk
    if options.fine:
        return compare_shapes(changes)
    experiment = load_experiment(NAME, changes)
    found = timed(experiment, load_experiment(NAME, {**changes, "law.avoidance": "none"}))
    unit = float(np.median(found[:, 0]))
    period = float(experiment.document.period or 0.0)
    near = slice(round(6.0 / period), round(8.4 / period))
    in_c = ("in C [us]", "99.9 % within [us]")
    head("steps", "with [us]", "without [us]", "more [u]", "99.9 % within [ms]", *in_c)
    for name, steps in (("all", slice(None)), ("from 6 to 8.4 s, beside the ball", near)):
        _, with_, without, compiled = found[steps].T
        medians = np.median(with_), np.median(without)
        more, last = (medians[0] - medians[1]) / unit, 1e3 * np.quantile(with_, 0.999)
        quantiles = (f"{1e6 * np.quantile(compiled, share):.0f}" for share in (0.5, 0.999))
        costs = (f"{1e6 * median:.0f}" for median in medians)
        row(name, *costs, f"{more:.1f}", f"{last:.2f}", *quantiles)
    clearance = experiment.clearance
    assert clearance is not None
    own = len(clearance.own)
    print(f"\nu: {1e6 * unit:.1f} us")
    print(f"pairs: {own} of the arm's own, {clearance.count - own} with obstacles")
    return None


def compare_shapes(changes: dict[str, Any]) -> None:
    """Print what a step costs with coarse and with fine capsules of the arm.

    Raises:
        SystemExit: If a fine one costs too much.
    """
    arm = load_experiment(NAME).document.arm
    own = arm if isinstance(arm, dict) else {"model": arm}
    found: dict[str, list[Array]] = {"coarse": [], "fine": []}
    pairs = {}
    for _ in range(3):
        for shapes, runs in found.items():
            keys = {**changes, "arm": {**own, "shapes": shapes}}
            experiment = load_experiment(NAME, keys)
            blind = load_experiment(NAME, {**keys, "law.avoidance": "none"})
            runs.append(timed(experiment, blind)[:, [1, 3]])
            assert experiment.clearance is not None
            pairs[shapes] = experiment.clearance.count
    head("steps", "pairs", "[us]", "99.9 % within [us]", "in C [us]", "99.9 % within [us]")
    medians = {}
    for shapes, runs in found.items():
        middle, last = (
            1e6 * np.min([np.quantile(run, share, axis=0) for run in runs], axis=0)
            for share in (0.5, 0.999)
        )
        medians[shapes] = middle
        numbers = (f"{value:.0f}" for both in zip(middle, last, strict=True) for value in both)
        row(shapes, str(pairs[shapes]), *numbers)
    ratios = medians["fine"] / medians["coarse"]
    row("fine over coarse", "", f"{ratios[0]:.2f}", "", f"{ratios[1]:.2f}", "")
    if (ratios > FINE).any():
        raise SystemExit(f"a step with fine capsules costs more than {FINE:g} times a coarse one")


if __name__ == "__main__":
    main()
