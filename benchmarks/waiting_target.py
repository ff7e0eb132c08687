"""Whether an arm gets past obstacles more often if its target waits for it.

The target goes along its path at the share max(0, 1 - e / E) of its pace while the tool is e away
from it, and no slower than a least share; scenes are those of ``avoidance.py``::

    python benchmarks/waiting_target.py --scenes 60
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

from avoidance import BACK, LAPS, STUCK, document, scene
from drake_rnn import load_experiment
from drake_rnn.laws.checks import sampled_reading
from kept_cases import Found, cases
from markdown_table import head, row
from shared_options import add_case_options

NAME, SPEED = "adaptive_nephroid_known", 2.0
#: Rows of the table: the error at which a target waits [m], and its least share of the pace.
ROWS = {
    "goes on": (np.inf, 1.0),
    "waits": (0.02, 0.0),
    "goes slowly": (0.02, 0.2),
}


def run(seed: int, waits_at: float, least: float) -> Found:
    """Return what comes of a scene once the target has gone its way, or after three times that."""
    changes = document("panda", SPEED)
    given = {**changes, "obstacles": scene(seed, changes)}
    experiment = load_experiment(NAME, given)
    period, end = float(experiment.document.period or 0.0), LAPS / SPEED
    reading, kinematics = sampled_reading(experiment.law, period), experiment.arm.kinematics()
    q, s, state, error = experiment.start.copy(), 0.0, None, 0.0
    for k in range(round(3.0 * end / period)):
        p_WE = kinematics.p_WE(q)
        p_WE_desired = experiment.desired.position(s)[0]
        error = float(np.linalg.norm(p_WE - p_WE_desired))
        if s >= end:
            break
        ahead = s + period * max(least, 1.0 - error / waits_at)
        u = {
            "position": q,
            "p_WE": p_WE,
            "J": kinematics.J(q),
            "J_omega": kinematics.J_omega(q),
            "p_WE_desired": p_WE_desired,
            "p_preview": experiment.desired.position(ahead)[0],
        }
        if state is None:
            state = reading.initial_state(np.random.default_rng(0), u)
        state = reading.step(k * period, state, u, period)
        q = q + period * reading.commanded_velocity(k * period, state)
        s = ahead
    return {"error": error, "done": min(s / end, 1.0), "time": k * period / end}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--seeds", type=int, nargs="+", help="these scenes instead")
    add_case_options(parser)
    options = parser.parse_args()
    seeds = options.seeds or range(options.scenes)
    columns = ("at its end within three times the time", "on the path then", "stuck")
    head("the target", "scenes", *columns, "time over that planned, mean")
    for name, (waits_at, least) in ROWS.items():
        task = partial(run, waits_at=waits_at, least=least)
        found = cases(task, seeds, options.jobs, options.kept, name)
        error, done, time = (np.array([each[key] for each in found]) for key in found[0])
        there = done >= 1.0
        back, stuck = there & (error < BACK), ~there | (error > STUCK)
        row(name, len(found), *(int(x.sum()) for x in (there, back, stuck)), f"{time.mean():.2f}")


if __name__ == "__main__":
    main()
