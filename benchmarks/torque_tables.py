"""Print the tables of docs/schemes/joint_torque.md.

``computed`` is the closed form of computed torque, and the networks stand beside it, on one path of
a Panda: with the model known, with a tool of 2 kg of which 0.1 kg are believed, and with limits of
torque that the closed form would exceed. ``--cases N`` prints the second table instead: random
paths, gains and shares of torque, on which limits of torque are looked at.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from drake_rnn import Array, SimulationError, load_experiment, simulate
from drake_rnn.experiment import Arms
from markdown_table import head, row

_BOUNDED = {"bounds": "joints"}
_LEARNED = {"mass": "learned", "excitation": 0.001}
#: Laws of the tables, by name.
LAWS: dict[str, dict[str, Any]] = {
    "computed torque": {"network": "none", "torque_weight": 0.0},
    "least torques": {"torque_weight": 1.0, **_BOUNDED},
    "least torques, all": {"torque_weight": 1.0, "weighed": "all", **_BOUNDED},
    "dual criteria": {"torque_weight": 0.3, **_BOUNDED},
    "computed torque, M learned": {"network": "none", "torque_weight": 0.0, **_LEARNED},
    "dual criteria, M learned": {"torque_weight": 0.3, **_BOUNDED, **_LEARNED},
}
#: What is varied, and on which path.
_FAST, _SLOW = "computed_torque", "torque_payload_learned"
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "model known": (_FAST, {}),
    "0.25 of the torque": (_FAST, {"torque_share": 0.25}),
    "2 kg for 0.1 kg": (_SLOW, {}),
}
_ARMS = Arms()


def of_motion(result: Any) -> Array:
    """Return the torques beside those that hold the weight, shape (k, n) [Nm]."""
    kinematics, position = result.experiment.arm.kinematics(), result.series["position"]
    return np.array(result.series["torque"] + [kinematics.gravity(q) for q in position])


def print_comparison() -> None:
    """Print the table of all laws in all cases."""
    columns = ["law", "error [mm]", "largest torque / limit", "torque of the motion, rms [N m]"]
    head("case", *columns, "work [J]", "largest speed [rad/s]", "limits act")
    for case, (base, also) in CASES.items():
        for name, keys in LAWS.items():
            law = {"kind": "joint_torque", **keys, **also}
            changes = {"law": law, "accept": None}
            result = simulate(load_experiment(base, changes, arms=_ARMS))
            m, torque = result.metrics, of_motion(result)
            size = float(np.sqrt((torque**2).sum(axis=1).mean()))
            numbers = [1e3 * m["position_error_max_m"], m["torque_ratio_max"], size]
            numbers += [m["joint_work_J"], m["joint_velocity_max_rad_s"]]
            share = f"{m['saturated_fraction']:.1%}"
            row(case, name, *(f"{number:.3g}" for number in numbers), share)


def random_case(seed: int) -> dict[str, Any]:
    """Return changes of an experiment: a path, gains, and limits of torque that mostly act."""
    rng = np.random.default_rng(seed)
    law = {
        "kind": "joint_torque",
        "network": str(rng.choice(["simplified_lvi", "lvi", "none"])),
        "torque_weight": float(rng.choice([0.0, 0.1, 0.5, 1.0])),
        "torque_share": float(rng.uniform(0.05, 0.6)),
        "feedback": float(10.0 ** rng.uniform(0.5, 2.0)),
        "mass": str(rng.choice(["known", "learned"])),
        "excitation": float(rng.choice([0.0, 0.01, 0.2])),
    }
    if law["network"] != "none":
        law |= {"bounds": str(rng.choice(["none", "joints"]))}
        law |= {"gain": float(10.0 ** rng.uniform(1.0, 8.0))}
    path = {"kind": "circle", "plane": "yz", "size": float(rng.uniform(0.02, 0.2)), "laps": 1}
    path |= {"period": float(rng.uniform(0.2, 2.0)), "timing": "sin2"}
    arm = str(rng.choice(["panda", "iiwa14", "fr3", "gen3"]))
    return {"arm": arm, "law": law, "path": path, "duration": 0.2, "accept": None}


def excess(seed: int) -> tuple[float, bool]:
    """Return by how much a torque exceeds its limit, as a share of it, and whether limits act."""
    changes = random_case(seed)
    try:
        metrics = simulate(load_experiment(_FAST, changes, arms=_ARMS)).metrics
    except SimulationError as error:
        # The arm has left every bound of numbers; what it was told until then counts.
        metrics = getattr(error.result, "metrics", {"torque_ratio_max": 0.0})
    share = changes["law"]["torque_share"]
    return metrics["torque_ratio_max"] / share - 1.0, metrics.get("saturated_fraction", 0.0) > 0.0


def print_cases(count: int) -> None:
    """Print the table of random cases."""
    found = [excess(seed) for seed in range(count)]
    worst = max(0.0, *(beyond for beyond, _ in found))
    acting = sum(acts for _, acts in found)
    head("cases", "in which a limit of torque acts", "largest excess", "beyond 1e-9")
    row(count, acting, f"{worst:.1g}", sum(beyond > 1e-9 for beyond, _ in found))


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, help="number of random cases")
    options = parser.parse_args()
    if options.cases is None:
        print_comparison()
    else:
        print_cases(options.cases)


if __name__ == "__main__":
    main()
