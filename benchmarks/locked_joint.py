"""Print what is left of a path when a joint locks, for each law that follows one, as Markdown.

`python benchmarks/locked_joint.py` runs every law on the same path of a Panda, whose second joint
locks on the way: once where the law is told, and once where it is not.
"""

from __future__ import annotations

import argparse
from typing import Any

from drake_rnn import Result, SimulationError, simulate
from markdown_table import broken_limits, head, row

JOINT, TIME = 2, 4.0
#: What all runs have in common.
DOCUMENT: dict[str, Any] = {
    "arm": "panda",
    "path": {"kind": "nephroid", "plane": "yz", "size": 0.04, "period": 8.0},
    "limits": {"velocity": 0.5, "acceleration": 2.0},
    "period": 1e-3,
    "duration": 10.0,
    "window": [2.5, 10.0],
}
SLC = {"kind": "simultaneous_learning", "kappa": 15.0, "feedback_limit": 0.1}
WARM_UP = {"pulse": 0.2, "acceleration": 0.5, "rho": 1e-6}
#: Laws, with the gains of the experiments that are shipped of them.
LAWS: dict[str, dict[str, Any]] = {
    "adaptive": {"kind": "adaptive"},
    "adaptive, learned": {"kind": "adaptive", "jacobian": "learned"},
    "simultaneous_learning": {**SLC, "jacobian": "known"},
    "simultaneous_learning, learned": {
        **SLC,
        "jacobian": "learned",
        "rho": 1e-3,
        "J_hat_initial": "uniform",
        "warm_up": WARM_UP,
    },
    "joint_drift_free": {
        "kind": "joint_drift_free",
        "scheme": "naljdf",
        "composite_gain": 3.0,
        "velocity_gain": 1e7,
        "return_weight": 1.0,
        "bounds": "all",
    },
    "zeroing": {"kind": "zeroing", "gain": 80.0, "feedback": 10.0},
    "recursive": {
        "kind": "recursive",
        "reading": "filters",
        "gains": [100.0],
        "time_constants": [1e-4],
    },
    "pseudoinverse": {"kind": "pseudoinverse"},
    "receding_horizon": {"kind": "receding_horizon"},
}


def measured(law: dict[str, Any], told: bool) -> Result | str:
    """Return the result of a run in which the joint locks, or why there is none."""
    lock = {"joint": JOINT, "time": TIME, "told": told}
    changes = {"period": 1e-2} if law["kind"] == "receding_horizon" else {}
    try:
        return simulate({**DOCUMENT, "law": law, "faults": [lock], **changes}, series="none")
    except SimulationError as error:
        return str(error)


def errors(result: Result | str) -> list[str]:
    """Return the errors before, after and long after the lock [mm], and the limits exceeded."""
    if isinstance(result, str):
        return [result, "", "", ""]
    names = ("before_lock", "after_lock", "lasting")
    found = [result.metrics[f"position_error_{name}_max_m"] * 1e3 for name in names]
    kept = {name: y for name, y in result.metrics.items() if "held" not in name}
    return [*(f"{error:.2g}" for error in found), broken_limits(kept)]


def main() -> None:
    """Print a row for each law, told and not told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("laws", nargs="*", default=list(LAWS), help="Laws of the table.")
    head("law", "told", "before [mm]", "after [mm]", "lasting [mm]", "limits exceeded")
    for name in parser.parse_args().laws:
        for told in (True, False):
            row(name, "yes" if told else "no", *errors(measured(LAWS[name], told)))


if __name__ == "__main__":
    main()
