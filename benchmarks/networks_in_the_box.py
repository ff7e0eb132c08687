"""Print which bounds networks break in random cases with the box behind them.

`python benchmarks/networks_in_the_box.py --kept FILE` keeps each case, and goes on if interrupted.
A case is 1 s at 10 ms of an ideal arm: a random shipped arm and task, a circle up to 5 cm aside
that is mostly faster than its random bounds allow, and random gains; what is commanded is judged.
"""

from __future__ import annotations

import argparse
from functools import cache, partial
from typing import Any

import numpy as np

from drake_rnn import (
    ArmKinematics,
    Array,
    Experiment,
    InvalidInputError,
    Layout,
    load_arm,
    load_experiment,
)
from drake_rnn.experiment import Arms
from kept_cases import Found, cases
from markdown_table import head, row
from shared_options import add_case_options

#: Networks with the box behind them, by name: what each has besides its random gains.
NETWORKS: dict[str, dict[str, Any]] = {
    "lvi": {"kind": "projection", "network": "lvi"},
    "simplified_lvi": {"kind": "projection", "network": "simplified_lvi"},
    "dual": {"kind": "projection", "network": "dual"},
    "simplified_dual": {"kind": "projection", "network": "simplified_dual"},
    "zeroing": {"kind": "zeroing"},
    "iterated": {"kind": "projection", "discretization": "iterated"},
    "learned": {"kind": "projection", "jacobian": "learned"},
    "zeroing, four_step": {"kind": "zeroing", "discretization": "four_step"},
    "zeroing, noise": {
        "kind": "zeroing",
        "integral_gain": 20.0,
        "noise": {"kind": "random", "size": 5.0},
    },
    "zeroing, fixed_time": {"kind": "zeroing", "activation": "fixed_time"},
    "zeroing, growing": {"kind": "zeroing", "growth": "exponential"},
}
#: The bounds that the box keeps, with their units.
BOUNDS = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s^2"}
_PERIOD, _DURATION = 10e-3, 1.0
_ARMS = Arms()
#: What counts as broken.
BROKEN = 1e-9


def document(name: str, seed: int, boxed: bool = True) -> dict[str, Any]:
    """Return a random case of a network.

    Args:
        name: The network.
        seed: Number of the case; that of one number is alike for all networks.
        boxed: Whether the box is behind it.
    """
    rng = np.random.default_rng(seed)
    arm = str(rng.choice(["panda", "iiwa14", "ur5", "gen3"]))
    circle = {"kind": "circle", "plane": str(rng.choice(["xy", "yz", "xz"])), "timing": "sin2"}
    circle |= {"size": float(rng.uniform(0.02, 0.1)), "period": float(rng.uniform(0.8, 3.0))}
    home = _home(arm)
    limits = {
        "position_lower": (home - rng.uniform(0.01, 0.3, home.size)).tolist(),
        "position_upper": (home + rng.uniform(0.01, 0.3, home.size)).tolist(),
        "velocity": float(rng.uniform(0.05, 0.6)),
        "acceleration": float(rng.uniform(0.5, 8.0)),
    }
    gain = float(10.0 ** rng.uniform(1.0, 1.9 if "zeroing" in name else 8.0))
    law: dict[str, Any] = {
        **NETWORKS[name],
        "feedback": float(rng.uniform(1.0, 30.0)),
        "return_gain": float(rng.uniform(0.0, 5.0)),
        "bounds": str(rng.choice(["velocity", "none"])),
    }
    if name != "iterated":
        law["gain"] = gain
    if name == "simplified_dual":
        law["bounds"] = "velocity"
    return {
        "name": "case",
        "arm": arm,
        "task": str(rng.choice(["xyz", "pose"])),
        "path": {**circle, "laps": 1, "offset": list(rng.uniform(-0.03, 0.03, 3))},
        "law": law,
        "limits": limits,
        **({"safety": {"bounds": True}} if boxed else {}),
        "period": _PERIOD,
        "duration": _DURATION,
        "seed": seed,
    }


@cache
def _home(arm: str) -> Array:
    return load_arm(arm).home


def found_in(seed: int, name: str, boxed: bool) -> Found:
    """Return how far what is commanded in a case breaks each bound, or when it ended early."""
    experiment = load_experiment(document(name, seed, boxed), arms=_ARMS)
    reading = experiment.law.sampled(_PERIOD)
    if experiment.safety is not None:
        reading = experiment.safety.around(reading, _PERIOD)
    limits, arm = experiment.limits, experiment.arm
    kinematics = _ARMS.share("kinematics", experiment.document.arm, arm.kinematics)
    q, v, x = experiment.start, np.zeros(limits.size), None
    worst = dict.fromkeys(BOUNDS, 0.0)
    for k in range(round(_DURATION / _PERIOD)):
        t = k * _PERIOD
        u = seen(experiment, kinematics, reading.inputs, q, t)
        if x is None:
            x = reading.initial_state(np.random.default_rng(seed), u)
        try:
            x = reading.step(t, x, u, _PERIOD)
        except (np.linalg.LinAlgError, InvalidInputError) as failure:
            return {"ended": t, "why": str(failure), **worst}
        before, v = v, reading.commanded_velocity(t, x)
        if not np.isfinite(x).all():
            return {"ended": t, "why": "not finite", **worst}
        q = q + _PERIOD * v
        beyond = (
            np.maximum(limits.position_lower - q, q - limits.position_upper),
            np.abs(v) - limits.velocity,
            np.abs(v - before) / _PERIOD - limits.acceleration,
        )
        for bound, by in zip(BOUNDS, beyond, strict=True):
            worst[bound] = max(worst[bound], float(by.max()))
    return {"ended": None, **worst}


def seen(
    experiment: Experiment, kinematics: ArmKinematics, inputs: Layout, q: Array, t: float
) -> dict[str, Array]:
    """Return the signals that a law sees of an ideal arm and of its path."""
    p, v, a = experiment.desired.position(t)
    seen = {"position": q, "p_WE": kinematics.p_WE(q), "J": kinematics.J(q)}
    seen |= {"p_WE_desired": p, "v_WE_desired": v, "a_WE_desired": a}
    if "R_WE" in inputs:
        R, w, alpha = experiment.desired.orientation(t)
        seen["R_WE"] = kinematics.R_WE(q)
        seen |= {"R_WE_desired": R, "w_WE_desired": w, "alpha_WE_desired": alpha}
        seen["J"] = np.vstack((kinematics.J_omega(q), seen["J"]))
    return {name: seen[name] for name in inputs.parts}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000, help="number of cases a network")
    add_case_options(parser, jobs=1)
    parser.add_argument("--only", nargs="*", choices=NETWORKS, help="networks; by default all")
    arguments = parser.parse_args()
    found = {}
    for name in arguments.only or NETWORKS:
        for boxed in (True, False):
            count = arguments.cases if boxed else arguments.cases // 10
            told = name if boxed else f"{name}, alone"
            task = partial(found_in, name=name, boxed=boxed)
            found[name, boxed] = cases(task, range(count), arguments.jobs, arguments.kept, told)
    worst = [f"{unit}, at most" for unit in BOUNDS.values()]
    head("network", "cases", "ended early", *worst, "broken", "broken without the box")
    for name in arguments.only or NETWORKS:
        ran, alone = found[name, True], found[name, False]
        early = sum(each["ended"] is not None for each in ran)
        worst = [f"{max(each[bound] for each in ran):.2g}" for bound in BOUNDS]
        row(f"`{name}`", len(ran), early, *worst, _broken(ran), f"{_broken(alone)} of {len(alone)}")


def _broken(found: list[Found]) -> int:
    return sum(any(each[bound] > BROKEN for bound in BOUNDS) for each in found)


if __name__ == "__main__":
    main()
