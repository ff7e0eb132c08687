"""How two arms fare whose paths lead through the same place, from random places and in random time.

python benchmarks/two_arms.py --cases 100 --compiled
python benchmarks/two_arms.py --cases 20 --jerk 20
python benchmarks/two_arms.py --cases 100 --compiled --detour --duration 16

With ``--detour`` there is a row of arms that make detours. With ``--compiled`` laws step in C, by
one build for all pairs. With ``--free-postures`` a second table says of each pair that is stuck in
spite of detours how far the clearest postures that are found at both ends stay clear.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

from drake_rnn import Experiment, Many, load_experiment, run_many
from free_postures import add_free_postures, print_free_postures
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

# Error below which an arm is at the end of its path, and above which it is stuck [m].
BACK, STUCK = 1e-5, 0.02
DURATION = 9.0
BESIDE, DETOURS = "beside each other", "that make detours"
# Of postures of arms that know nothing of each other, each of so many is looked at.
EVERY = 10
# Cases that run side by side if they are compiled.
AT_ONCE = 20
BOUNDS = ("position", "velocity", "acceleration")


def document(seed: int, jerk: float | None, duration: float = DURATION) -> dict[str, Any]:
    """Return two arms that face each other, each of which is to cross the other's side."""
    rng = np.random.default_rng(seed)
    limits: dict[str, float] = {"velocity": 0.5, "acceleration": 1.0}

    def path() -> dict[str, Any]:
        side = rng.choice([-1.0, 1.0])
        by = [rng.uniform(0.05, 0.25), side * rng.uniform(0.2, 0.35), rng.uniform(-0.1, 0.1)]
        period = float(rng.uniform(3.5, 5.5))
        offset = [0.0, 0.5 * by[1], 0.0]
        return {"kind": "line", "by": by, "period": period, "timing": "quintic", "offset": offset}

    base = {
        "translation": [rng.uniform(0.8, 1.0), rng.uniform(-0.15, 0.15), 0.0],
        "rpy": [0.0, 0.0, float(np.pi + rng.uniform(-0.3, 0.3))],
    }
    return {
        "arm": "panda",
        "path": path(),
        "law": {"kind": "adaptive", "kappa": 1000},
        "limits": limits if jerk is None else limits | {"jerk": jerk},
        "obstacles": [],
        "second": {"base": base, "path": path()},
        "period": 1e-3,
        "duration": duration,
        "log_period": 0.05,
        "on_unreachable": "follow",
    }


def run(
    seeds: list[int], name: str, jerk: float | None, duration: float, compiled: bool
) -> list[dict[str, float]]:
    """Return what cases come to that run side by side, in the row of a name."""
    pairs = [loaded(seed, name, jerk, duration) for seed in seeds]
    if name in (BESIDE, DETOURS):
        many = run_many(pairs, compiled=compiled)
        assert many.second is not None
        sides = [(many, pairs), (many.second, [pair.second for pair in pairs])]
    else:
        arms = zip(
            *(map(load_experiment, alone(seed, jerk, duration)) for seed in seeds), strict=True
        )
        sides = [(run_many(each, record=["position"], compiled=compiled), each) for each in arms]
    return [
        {
            "distance": least_distance(pair, [many for many, _ in sides], k),
            "error": max(error(many, k, each[k]) for many, each in sides),
            "beyond": max(beyond(many.row(k), jerk) for many, _ in sides),
        }
        for k, pair in enumerate(pairs)
    ]


def loaded(seed: int, name: str, jerk: float | None, duration: float) -> Experiment:
    """Return a case in the row of a name."""
    more: dict[str, Any] = {"detour": {}} if name == DETOURS else {}
    return load_experiment(document(seed, jerk, duration) | more)


def alone(seed: int, jerk: float | None, duration: float) -> list[dict[str, Any]]:
    """Return both arms of a case as if the other one were not there."""
    own = document(seed, jerk, duration) | {"obstacles": None}
    other = own.pop("second")
    return [own, {**own, "path": other["path"]}]


def least_distance(pair: Experiment, sides: list[Many], number: int) -> float:
    """Return the least distance of the arms of a case, of themselves and each other [m]."""
    if not sides[0].series:
        return min(side.row(number)["distance_min_m"] for side in sides)
    # Of arms that know nothing of each other, from their postures.
    both = np.concatenate([side.series["position"][number] for side in sides], axis=1)
    assert pair.clearance is not None
    return float(pair.clearance.least_along(both[::EVERY]).min())


def error(many: Many, number: int, experiment: Experiment) -> float:
    """Return how far a tool is from the end of its path when a case ends [m]."""
    assert many.status[number] == "complete", many.failures[number]
    p_WE = experiment.arm.kinematics().p_WE(many.position[number])
    return float(
        np.linalg.norm(p_WE - experiment.desired.position(experiment.document.duration)[0])
    )


def beyond(metrics: dict[str, float], jerk: float | None) -> float:
    """Return by how much any bound is passed, in its own unit."""
    names = [f"{bound}_violation_max_" for bound in BOUNDS]
    names += [] if jerk is None else ["held_jerk_violation_max_"]
    return max(value for key, value in metrics.items() if key.startswith(tuple(names)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--jerk", type=float)
    parser.add_argument("--duration", type=float, default=DURATION, help="of each case [s]")
    parser.add_argument("--detour", action="store_true", help="arms that make detours besides")
    parser.add_argument("--rows", nargs="+", help="rows of the table; all without it")
    parser.add_argument("--compiled", action="store_true", help="laws step in C")
    add_case_options(parser)
    add_free_postures(parser)
    options = parser.parse_args()
    columns = ("collided", "least distance [mm]", "bounds beyond by")
    head("laws", "cases", *columns, "both at their ends", "one stuck")
    rows = ["that know nothing of each other", BESIDE, *[DETOURS] * options.detour]
    detouring: list[dict[str, Any]] = []
    for name in rows if options.rows is None else options.rows:
        task = partial(
            run,
            name=name,
            jerk=options.jerk,
            duration=options.duration,
            compiled=options.compiled,
        )
        key = f"{name}, jerk {options.jerk}" + ", compiled" * options.compiled
        key += f", {options.duration:g} s" * (options.duration != DURATION)
        at_once = AT_ONCE if options.compiled else 1
        found = cases(task, range(options.cases), options.jobs, options.kept, key, at_once)
        of = {key: np.array([each[key] for each in found]) for key in found[0]}
        row(
            name,
            len(found),
            int((of["distance"] < 0.0).sum()),
            f"{1e3 * of['distance'].min():.2f}",
            f"{of['beyond'].max():.0e}",
            int((of["error"] < BACK).sum()),
            int((of["error"] > STUCK).sum()),
        )
        if name == DETOURS:
            detouring = found
    if options.free_postures and detouring:
        load = partial(loaded, name=DETOURS, jerk=options.jerk, duration=options.duration)
        print_free_postures(range(options.cases), detouring, STUCK, load)


if __name__ == "__main__":
    main()
