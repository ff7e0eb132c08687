"""What a step of the adaptive law costs with obstacles and without, in turn along the same motion.

::

    python benchmarks/avoidance_cost.py

Steps are those of `adaptive_obstacle_on_path`, of 6 balls and 26 pairs of the arm's own. The unit u
is p_WE and J of the posture by pydrake, timed in turn with them.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from drake_rnn import load_experiment
from drake_rnn.laws.checks import sampled_reading
from markdown_table import head, row

NAME, UNTIL = "adaptive_obstacle_on_path", 9.0
#: Balls that stand about, besides the one on the path; 0.4 m and more from it.
FAR = [[0.7, 0.5, 0.3], [0.7, -0.6, 0.4], [-0.5, 0.5, 0.5], [-0.6, -0.4, 0.3], [0.1, 0.8, 0.8]]


def main() -> None:
    first = load_experiment(NAME).document.obstacles
    balls = [{"kind": "ball", "center": center, "radius": 0.05} for center in FAR]
    changes = {"obstacles": [*(first or []), *balls]}
    experiment = load_experiment(NAME, changes)
    blind = load_experiment(NAME, {**changes, "law.avoidance": "none"})
    period = float(experiment.document.period or 0.0)
    readings = [sampled_reading(each.law, period) for each in (experiment, blind)]
    kinematics, q = experiment.arm.kinematics(), experiment.start.copy()
    plant = experiment.arm.plant()
    context, E = plant.CreateDefaultContext(), plant.GetFrameByName(experiment.arm.frame)
    times, states = [], list[np.ndarray]()
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
            "p_WE_desired": experiment.desired.position(t)[0],
            "p_preview": experiment.desired.position(t + period)[0],
        }
        if not states:
            states = [each.initial_state(np.random.default_rng(0), u) for each in readings]
        # Both go on from where the arm is.
        for part in ("v", "commanded"):
            readings[1].state.part(states[1], part)[:] = readings[0].state.part(states[0], part)
        for number, reading in enumerate(readings):
            began = perf_counter()
            states[number] = reading.step(t, states[number], u, period)
            taken.append(perf_counter() - began)
        q = q + period * readings[0].commanded_velocity(t, states[0])
        times.append(taken)
    found = np.array(times)
    unit = float(np.median(found[:, 0]))
    near = slice(round(6.0 / period), round(8.4 / period))
    head("steps", "with [us]", "without [us]", "more [u]", "99.9 % within [ms]")
    for name, steps in (("all", slice(None)), ("from 6 to 8.4 s, beside the ball", near)):
        _, with_, without = found[steps].T
        medians = np.median(with_), np.median(without)
        more, last = (medians[0] - medians[1]) / unit, 1e3 * np.quantile(with_, 0.999)
        row(name, *(f"{1e6 * median:.0f}" for median in medians), f"{more:.1f}", f"{last:.2f}")
    print(f"\nu: {1e6 * unit:.1f} us")


if __name__ == "__main__":
    main()
