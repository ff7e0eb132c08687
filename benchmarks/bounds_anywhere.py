"""Print what the campaign `bounds_anywhere` has shown: bounds, who arrives, and why others do not.

Of the rows that do not arrive, some are asked what the check before a run says of them.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import InvalidInputError, load_experiment, run_many
from drake_rnn.experiment import Arms, check_reach
from markdown_table import head, row

#: Largest errors in the window of a row that has arrived [m, rad].
ARRIVED = {"position_error_max_m": 100e-6, "orientation_error_max_rad": 1e-3}
BOUNDS = {
    "position": "rad",
    "velocity": "rad_s",
    "acceleration": "rad_s2",
    "held_jerk": "rad_s3",
}
#: Words of a warning before a run, by what it foresees; the first that applies counts.
CLASSES = {
    "the target is out of reach": "out of reach",
    "a joint would have to pass its limit": "beyond its limit",
    "the posture becomes nearly singular": "near-singular",
    "the path asks for more velocity or acceleration": "asks ",
    "a joint comes close to its limit": "of its limit",
}
NOTHING = "nothing is foreseen"

Line = dict[str, str]


def value(text: str) -> Any:
    """Return a cell of the table as what it stands for."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def changes_of(line: Line) -> dict[str, Any]:
    """Return the values of a row's varied keys."""
    return {key: value(line[key]) for key in list(line)[1 : list(line).index("status")]}


def twin(line: Line) -> str:
    """Return what a row has in common with that whose Jacobian is known, or learned."""
    return json.dumps({k: v for k, v in changes_of(line).items() if k != "law.jacobian"})


def arrived(line: Line) -> bool:
    """Return whether a row ends on its path."""
    return all(not line[name] or float(line[name]) < most for name, most in ARRIVED.items())


def foreseen(folder: Path, line: Line) -> str:
    """Return what the check before a run says of a row."""
    try:
        experiment = load_experiment(str(folder / "experiment.yaml"), changes_of(line))
        said = " ".join(check_reach(experiment))
    except InvalidInputError as error:
        said = str(error)
    return next((name for name, words in CLASSES.items() if words in said), NOTHING)


def what_of(path: str) -> str:
    """Return a short name of a row's path."""
    given = value(path)
    size = given.get("offset", given.get("positions"))
    return f"{given['kind']} {given.get('size', '')} {size if given['kind'] != 'nephroid' else ''}"


def tell_bounds(lines: list[Line]) -> None:
    """Print the largest violation of each limit."""
    head("limit", "rows", "broken by 1e-9", "largest violation")
    for name, unit in BOUNDS.items():
        column = f"{name}_violation_max_{unit}"
        found = np.array([float(line[column]) for line in lines if line[column]])
        row(name.removeprefix("held_"), found.size, int((found > 1e-9).sum()), f"{found.max():.2g}")


def tell_paths(lines: list[Line]) -> None:
    """Print the shares that arrive, by path and Jacobian."""
    head("path", "rows each", "arrive, J known", "J learned", "median error [um]: known", "learned")
    for path in dict.fromkeys(line["path"] for line in lines):
        told: list[str] = []
        for column in ("shares", "errors"):
            for kind in ("known", "learned"):
                some = [x for x in lines if (x["path"], x["law.jacobian"]) == (path, kind)]
                errors = [float(x["position_error_max_m"]) for x in some if arrived(x)]
                share = len(errors) / max(len(some), 1)
                middle = f"{np.median(errors) * 1e6:.2g}" if errors else "-"
                told.append(f"{share:.1%}" if column == "shares" else middle)
        row(what_of(path), len(some), *told)


def tell_failures(folder: Path, lines: list[Line], count: int) -> None:
    """Print the classes of the rows that do not arrive, of ``count`` of them."""
    fine = {twin(line) for line in lines if line["law.jacobian"] == "known" and arrived(line)}
    lost = [line for line in lines if not arrived(line)]
    alone = [x for x in lost if x["law.jacobian"] == "learned" and twin(x) in fine]
    known = [line for line in lost if line["law.jacobian"] == "known"]
    print(f"\n{len(lost)} of {len(lines)} rows do not arrive: {len(known)} with J known, ", end="")
    print(f"and {len(alone)} with J learned whose twin with J known does.\n")
    rng = np.random.default_rng(1)
    head("foreseen before the run", "J known", "J learned, the twin arrives")
    classes = []
    for some in (known, alone):
        chosen = rng.permutation(len(some))[:count]
        classes.append(Counter(foreseen(folder, some[k]) for k in chosen))
    for name in (*CLASSES, NOTHING):
        row(name, *(f"{of[name]} of {sum(of.values())}" for of in classes))


def tell_returns(folder: Path, lines: list[Line], count: int) -> None:
    """Print how many of those that followed a target out of reach are back some time later."""
    away = [x for x in lines if "[3, 2, 0]" in x["path"] and x["law.jacobian"] == "known"]
    late = [line for line in away if not arrived(line)]
    chosen = np.random.default_rng(0).permutation(len(late))[:count]
    longer = {"duration": 20, "window": [19, 20], "accept": None}
    shared = Arms()
    many = run_many(
        [
            load_experiment(
                str(folder / "experiment.yaml"), changes_of(late[k]) | longer, arms=shared
            )
            for k in chosen
        ]
    )
    metrics = {name: many.metrics[name] for name in ARRIVED if name in many.metrics}
    back = np.all([~(values >= ARRIVED[name]) for name, values in metrics.items()], axis=0)
    least = many.metrics["singular_value_min"][~back].max(initial=0.0)
    print(
        f"\nOf {back.size} with J known that followed what ran away and were not back after 6 s, "
    )
    print(f"{back.sum()} are after 20; the others came to a singular value of {least:.2g} or less.")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the campaign")
    parser.add_argument("--asked", type=int, default=200, help="rows of each class that are asked")
    arguments = parser.parse_args()
    folder = arguments.out / "campaign_bounds_anywhere"
    with (folder / "table.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    statuses = Counter(line["status"] for line in lines)
    print(", ".join(f"{count} {status}" for status, count in statuses.items()))
    lines = [line for line in lines if line["status"] == "complete"]
    tell_bounds(lines)
    tell_paths(lines)
    tell_failures(folder, lines, arguments.asked)
    tell_returns(folder, lines, 100)


if __name__ == "__main__":
    main()
