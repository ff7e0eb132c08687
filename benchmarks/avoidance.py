"""How an arm fares among random obstacles, with avoidance and without.

Scenes hold five balls of 3 to 8 cm round the path; the arm keeps clear of itself as well::

    python benchmarks/avoidance.py --scenes 200
    python benchmarks/avoidance.py --scenes 100 --arm ur5 --speed 2
    python benchmarks/avoidance.py --scenes 20 --jerk 20
    python benchmarks/avoidance.py --scenes 40 --experiment slc_nephroid_known
    python benchmarks/avoidance.py --scenes 100 --model my.urdf --frame tool --home 0 -0.3 0 0.9 0

    python benchmarks/avoidance.py --scenes 10 --experiment motion_force_cat --own

With ``--own`` the experiment keeps its own arm, path and limits, and only obstacles are added.
A law that avoids nothing itself gets ``safety: {collisions: true}``. ``--rows with`` leaves out the
others. With ``--kept FILE`` what is found of each scene is kept, and not run again. With
``--compiled`` scenes run side by side, `AT_ONCE` at a time, by one build of the law in C::

    python benchmarks/avoidance.py --scenes 1000 --speed 2 --rows with --compiled --kept FILE

With ``--rest SECONDS`` the path rests after its 1.25 laps, at its end, for so long; with
``--detour`` there is a row of a law that makes detours::

    python benchmarks/avoidance.py --scenes 100 --speed 2 --rest 5 --detour --compiled \
        --rows with "with, makes detours"

With ``--free-postures`` a second table says of each scene that is stuck in spite of detours how far
the clearest posture that is found at the path's end stays clear.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import Experiment, Many, load_experiment, run_many, simulate
from drake_rnn.experiment import Arms
from free_postures import add_free_postures, print_free_postures
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

# The path of each arm: its plane, and its size [m].
PATHS = {"panda": ("yz", 0.04), "iiwa14": ("yz", 0.02), "ur5": ("yz", 0.01)}
OTHERS_PATH = ("yz", 0.02)
# Error below which an arm is on its path at the end, with an adaptive law and with another one, and
# above which it is stuck [m].
BACK, BACK_OTHERS, STUCK = 1e-5, 1e-3, 0.02
LIMITS = ("position", "velocity", "acceleration", "jerk")
BALLS, RADII, ROUND, APART = 5, (0.03, 0.08), 0.35, 0.03
LAPS = 10.0
# Scenes that run side by side if they are compiled.
AT_ONCE = 50


def document(
    arm: str | dict[str, Any], speed: float = 1.0, jerk: float | None = None, rest: float = 0.0
) -> dict[str, Any]:
    """Return the changes of an experiment that all scenes share."""
    plane, size = PATHS[arm] if isinstance(arm, str) else OTHERS_PATH
    limits = {"velocity": 0.5 * speed, "acceleration": 1.0 * speed**2}
    path: dict[str, Any] = {
        "kind": "nephroid",
        "plane": plane,
        "size": size,
        "period": 8.0 / speed,
        "offset": [0.1 if arm == "panda" else 0.05, 0, 0],
    }
    if rest:
        end = {"path": {"kind": "rest"}, "bridge": 0.02 / speed}
        path = {"kind": "sequence", "parts": [{"path": path, "lasts": LAPS / speed}, end]}
    return {
        "arm": arm,
        "start": None,
        "path": path,
        "limits": limits if jerk is None else limits | {"jerk": jerk},
        "duration": LAPS / speed + rest,
        "window": [8.0 / speed, LAPS / speed],
        "log_period": 0.05,
        "accept": None,
    }


def own(name: str) -> dict[str, Any]:
    """Return the changes of an experiment that keeps its arm, path and limits."""
    changes = {"duration": LAPS, "window": [0.0, LAPS], "log_period": 0.05, "accept": None}
    # Of a motion that a dither adds behind the law nothing can be certified.
    return changes if load_experiment(name).document.dither is None else changes | {"dither": None}


def scene(
    seed: int, changes: dict[str, Any], name: str = "adaptive_nephroid_known"
) -> list[dict[str, Any]]:
    """Return random balls round the path that the arm does not touch at the start."""
    rng = np.random.default_rng(seed)
    empty = load_experiment(name, {**changes, **clear_of(name), "obstacles": []})
    assert empty.clearance is not None
    middle = empty.arm.kinematics().p_WE(empty.start)
    if empty.document.path is not None:
        middle = empty.desired.position(0.0)[0]
    ends = empty.clearance.arm.segments_in_world(empty.clearance.arm.poses.at(empty.start))
    found: list[dict[str, Any]] = []
    while len(found) < BALLS:
        center, radius = middle + rng.uniform(-ROUND, ROUND, 3), float(rng.uniform(*RADII))
        p, d = ends[:, 0], ends[:, 1] - ends[:, 0]
        length = np.maximum((d * d).sum(axis=1), 1e-12)
        along = np.clip(((center - p) * d).sum(axis=1) / length, 0.0, 1.0)
        gaps = np.linalg.norm(center - p - along[:, None] * d, axis=1) - radius
        if (gaps - empty.clearance.arm.radii).min() > APART:
            found.append({"kind": "ball", "center": center.tolist(), "radius": radius})
    return found


def clear_of(name: str) -> dict[str, Any]:
    """Return what an experiment needs to keep clear of obstacles."""
    return {} if name.startswith("adaptive") else {"safety": {"collisions": True}}


def rows_of(name: str, *, detour: bool) -> dict[str, dict[str, Any]]:
    """Return the rows of the table, what each changes of the experiment of that name."""
    if detour:
        return rows_of(name, detour=False) | {"with, makes detours": {"detour": {}}}
    if not name.startswith("adaptive"):
        return {"without avoidance": {}, "with": clear_of(name)}
    return {
        "without avoidance": {"law.avoidance": "none"},
        "with, joints do not make way": {"law.secondary.obstacles": 0.0},
        "with": {},
    }


def loaded(name: str, changes: dict[str, Any], law: dict[str, Any], seed: int) -> Experiment:
    """Return the experiment of a scene."""
    return load_experiment(name, {**changes, "obstacles": scene(seed, changes, name), **law})


def run(seed: int, name: str, changes: dict[str, Any], law: dict[str, Any]) -> dict[str, float]:
    """Return what a scene comes to."""
    experiment = loaded(name, changes, law, seed)
    began = time.process_time()
    result = simulate(experiment)
    took = time.process_time() - began
    metrics = result.metrics
    counts = [n for n in result.series if n in ("held_back", "safe_held_back")]
    held_back = sum(float(result.series[n][-1, 0]) for n in counts)
    return {
        "distance": metrics["distance_min_m"],
        "error": float(result.position_error[-1]),
        "acceleration": metrics.get("acceleration_violation_max_rad_s2", 0.0),
        "velocity": metrics["velocity_violation_max_rad_s"],
        "position": metrics["position_violation_max_rad"],
        "jerk": metrics.get("held_jerk_violation_max_rad_s3", 0.0) if jerk_given(changes) else 0.0,
        "held_back": held_back,
        "at_bound": metrics.get("acceleration_bound_fraction", np.nan),
        "seconds": took / float(result.time[-1]),
    }


def run_compiled(
    seeds: list[int], name: str, changes: dict[str, Any], law: dict[str, Any]
) -> list[dict[str, float]]:
    """Return what scenes come to that run side by side, with compiled steps."""
    began, arms = time.process_time(), Arms()
    scenes = [
        load_experiment(
            name, {**changes, "obstacles": scene(seed, changes, name), **law}, arms=arms
        )
        for seed in seeds
    ]
    many = run_many(scenes, compiled=True)
    took = (time.process_time() - began) / sum(each.document.duration for each in scenes)
    return [outcome_of(many, k, each, jerk_given(changes), took) for k, each in enumerate(scenes)]


def outcome_of(
    many: Many, number: int, experiment: Experiment, jerk: bool, took: float
) -> dict[str, float]:
    """Return what one of many scenes has come to."""
    assert many.status[number] == "complete", many.failures[number]
    metrics, parts = many.row(number), many.state[number]
    off = experiment.arm.kinematics().p_WE(many.position[number])
    off = off - experiment.desired.position(experiment.document.duration)[0]
    counts = [parts[name] for name in ("held_back", "safe_held_back") if name in parts]
    return {
        "distance": metrics["distance_min_m"],
        "error": float(np.linalg.norm(off)),
        "acceleration": metrics.get("acceleration_violation_max_rad_s2", 0.0),
        "velocity": metrics["velocity_violation_max_rad_s"],
        "position": metrics["position_violation_max_rad"],
        "jerk": metrics.get("held_jerk_violation_max_rad_s3", 0.0) if jerk else 0.0,
        "held_back": float(sum(count[0] for count in counts)),
        "at_bound": metrics.get("acceleration_bound_fraction", np.nan),
        "seconds": took,
    }


def jerk_given(changes: dict[str, Any]) -> bool:
    """Return whether the jerk of the scenes' arms is bounded."""
    return "jerk" in changes.get("limits", {})


def print_rows(options: argparse.Namespace, experiment: str, arm: str | dict[str, Any]) -> None:
    """Print the rows of an experiment on an arm."""
    changes = document(arm, options.speed, options.jerk, options.rest)
    if options.own:
        changes = own(experiment)
    back = BACK if experiment.startswith("adaptive") else BACK_OTHERS
    seeds, stuck = range(options.first, options.first + options.scenes), None
    for name, law in rows_of(experiment, detour=options.detour).items():
        if options.rows is not None and name not in options.rows:
            continue
        task = partial(
            run_compiled if options.compiled else run, name=experiment, changes=changes, law=law
        )
        key = f"{name}, {experiment}, {options.model or arm}, {options.speed}, {options.jerk}"
        key += f", rest {options.rest:g}" if options.rest else ""
        at_once = AT_ONCE if options.compiled else 0
        found = cases(task, seeds, options.jobs, options.kept, key, at_once)
        of = {key: np.array([each[key] for each in found]) for key in found[0]}
        beyond = max(of[limit].max() for limit in LIMITS)
        several = [experiment] * (len(options.experiment) > 1) + [arm] * (len(options.arm) > 1)
        row(
            " ".join([name, *map(str, several)]),
            len(found),
            int((of["distance"] < 0.0).sum()),
            f"{1e3 * of['distance'].min():.2f}",
            int(of["held_back"].sum()),
            f"{beyond:.0e}",
            int((of["error"] < back).sum()),
            int((of["error"] > STUCK).sum()),
            "-" if np.isnan(of["at_bound"]).any() else f"{of['at_bound'].mean():.2f}",
            f"{np.median(of['seconds']):.2f}",
        )
        if "detour" in law and options.free_postures:
            stuck = partial(
                print_free_postures, seeds, found, STUCK, partial(loaded, experiment, changes, law)
            )
    if stuck is not None:
        stuck()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--arm", nargs="+", choices=sorted(PATHS), default=["panda"])
    parser.add_argument("--model", type=Path, help="an arm of your own instead")
    parser.add_argument("--frame", help="its end effector")
    parser.add_argument("--home", type=float, nargs="+", help="where it starts [rad]")
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--jerk", type=float)
    parser.add_argument("--rest", type=float, default=0.0, help="rest at the path's end [s]")
    parser.add_argument("--detour", action="store_true", help="a law that makes detours besides")
    parser.add_argument("--experiment", nargs="+", default=["adaptive_nephroid_known"])
    parser.add_argument("--own", action="store_true", help="keep its arm, path and limits")
    parser.add_argument("--rows", nargs="+", help="rows of the table; all without it")
    parser.add_argument("--compiled", action="store_true", help="side by side, in C")
    add_case_options(parser)
    add_free_postures(parser)
    options = parser.parse_args()
    arms: list[str | dict[str, Any]] = options.arm
    if options.model is not None:
        arms = [{"model": str(options.model), "frame": options.frame, "home": options.home}]
    columns = ("collided", "least distance [mm]", "samples held back", "bounds beyond by")
    ends = ("on the path at the end", "stuck", "share of time at a bound of a")
    head("law", "scenes", *columns, *ends, "s of work a second")
    for experiment in options.experiment:
        for arm in arms:
            print_rows(options, experiment, arm)


if __name__ == "__main__":
    main()
