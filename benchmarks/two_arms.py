"""How two arms fare whose paths lead through the same place, from random places and in random time.

python benchmarks/two_arms.py --cases 100 --compiled
python benchmarks/two_arms.py --cases 20 --jerk 20

With ``--compiled`` laws step in C, by one build for all pairs.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

from drake_rnn import load_experiment, simulate
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

# Error below which an arm is at the end of its path, and above which it is stuck [m].
BACK, STUCK = 1e-5, 0.02
DURATION = 9.0
BOUNDS = ("position", "velocity", "acceleration")


def document(seed: int, jerk: float | None) -> dict[str, Any]:
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
        "duration": DURATION,
        "log_period": 0.05,
        "on_unreachable": "follow",
    }


def run(seed: int, avoids: bool, jerk: float | None, compiled: bool) -> dict[str, float]:
    """Return what a case comes to."""
    given = document(seed, jerk)
    if avoids:
        results = [simulate(load_experiment(given), compiled=compiled)]
        second = results[0].second
        assert second is not None
        results.append(second)
        least = min(result.metrics["distance_min_m"] for result in results)
    else:
        # Two arms that know nothing of each other: their distance, from their postures.
        experiment = load_experiment(given)
        own, other = given.copy(), given.pop("second")
        own.pop("second")
        other.pop("base")
        alone = {"obstacles": None}
        documents = [{**own, **part, **alone} for part in ({}, other)]
        results = [simulate(load_experiment(each), compiled=compiled) for each in documents]
        both = np.concatenate([result.series["position"] for result in results], axis=1)
        assert experiment.clearance is not None
        least = float(experiment.clearance.least_along(both).min())
    names = [f"{bound}_violation_max_" for bound in BOUNDS]
    if jerk is not None:
        names.append("held_jerk_violation_max_")
    return {
        "distance": least,
        "error": max(float(result.position_error[-1]) for result in results),
        "beyond": max(
            value
            for result in results
            for key, value in result.metrics.items()
            if key.startswith(tuple(names))
        ),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--jerk", type=float)
    parser.add_argument("--compiled", action="store_true", help="laws step in C")
    add_case_options(parser)
    options = parser.parse_args()
    columns = ("collided", "least distance [mm]", "bounds beyond by")
    head("laws", "cases", *columns, "both at their ends", "one stuck")
    for name, avoids in (
        ("that know nothing of each other", False),
        ("beside each other", True),
    ):
        task = partial(run, avoids=avoids, jerk=options.jerk, compiled=options.compiled)
        key = f"{name}, jerk {options.jerk}" + ", compiled" * options.compiled
        found = cases(task, range(options.cases), options.jobs, options.kept, key)
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


if __name__ == "__main__":
    main()
