"""Print what is left of a Panda's path when a joint locks, as Markdown.

::

    python benchmarks/locked_joint.py circle      # adaptive_locked_joint, joint by joint
    python benchmarks/locked_joint.py nephroid    # adaptive_jerk and its learned variant, likewise
    python benchmarks/locked_joint.py laws        # each law that follows a path, the second joint

In the last two each run is made twice: the law is told of the lock, or it is not.
"""

from __future__ import annotations

import argparse
from typing import Any

from drake_rnn import Result, SimulationError, load_experiment, simulate
from markdown_table import broken_limits, head, row

_COMMAND = "python benchmarks/locked_joint.py"
_ERRORS = ("before [mm]", "after [mm]", "from 2 s later [mm]", "limits exceeded")
#: Experiments of the second table, and what is changed in them.
NEPHROIDS = {"adaptive_jerk": {"law.kappa": 1000.0}, "adaptive_jerk_learned": {}}
JOINT, TIME = 2, 4.0
# Excess of a limit that counts as none.
_ROUNDING = 1e-9
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
}


def measured(law: dict[str, Any], told: bool) -> Result | str:
    """Return the result of a run in which the joint locks, or why there is none."""
    lock = {"joint": JOINT, "time": TIME, "told": told}
    try:
        return simulate({**DOCUMENT, "law": law, "faults": [lock]}, series="none")
    except SimulationError as error:
        return str(error)


def errors(result: Result | str) -> list[str]:
    """Return the errors before, after and long after the lock [mm], and the limits exceeded."""
    if isinstance(result, str):
        return [result, "", "", ""]
    names = ("before_lock", "after_lock", "lasting")
    found = [1e3 * result.metrics[f"position_error_{name}_max_m"] for name in names]
    broken = {
        name: by for name, by in result.metrics.items() if "held" not in name and by > _ROUNDING
    }
    return [*(f"{error:.2g}" for error in found), broken_limits(broken)]


def print_circle() -> None:
    """Print a row for each joint that locks on the circle of the shipped experiment."""
    head("locked joint", *_ERRORS, made_by=f"{_COMMAND} circle")
    for joint in range(1, 8):
        changes = {"faults": [{"joint": joint, "time": 1.0}], "accept": None}
        row(joint, *errors(simulate(load_experiment("adaptive_locked_joint", changes))))


def print_nephroid() -> None:
    """Print a row for each of the first joints, J known and learned, told and not told."""
    head("locked joint", "J", "told", *_ERRORS, made_by=f"{_COMMAND} nephroid")
    for joint in range(1, 6):
        for name, changes in NEPHROIDS.items():
            for told in (True, False):
                lock = {"joint": joint, "time": 9.0, "told": told}
                given = {"duration": 16.0, "window": [4.0, 16.0], "accept": None, "faults": [lock]}
                result = simulate(load_experiment(name, {**given, **changes}))
                learned = "learned" if name.endswith("learned") else "known"
                row(joint, learned, _said(told), *errors(result))


def print_laws() -> None:
    """Print a row for each law, told and not told."""
    head("law", "told", *_ERRORS, made_by=f"{_COMMAND} laws")
    for name, law in LAWS.items():
        for told in (True, False):
            row(name, _said(told), *errors(measured(law, told)))


def _said(told: bool) -> str:
    return "yes" if told else "no"


TABLES = {"circle": print_circle, "nephroid": print_nephroid, "laws": print_laws}


def main() -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", default=[*TABLES])
    for name in parser.parse_args().tables:
        TABLES[name]()


if __name__ == "__main__":
    main()
