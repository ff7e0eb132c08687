"""Check whether a change to the code changes a run, by hashes of all arrays and metrics.

Record in both checkouts, each with its own Python, and compare::

    python benchmarks/bits.py record before.json
    python benchmarks/bits.py record after.json
    python benchmarks/bits.py compare before.json after.json

The script goes with the package's functions: across a change of these, each checkout runs its own.
Runs are cut to 2 s unless ``--longest`` says otherwise; what happens later is not compared then.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from drake_rnn import (
    InvalidInputError,
    Result,
    SimulationError,
    load_experiment,
    shipped_experiments,
    simulate,
)


def hashes(name: str, longest: float) -> dict[str, str]:
    """Return the hash of each array and metric of a shipped experiment, by name.

    Args:
        name: Name of the experiment.
        longest: A longer run is cut to this duration [s], unless it is refused then.
    """
    try:
        result = _result(name, longest)
    except InvalidInputError:
        return {"refused": "yes"}
    arrays = {"time": result.time, **result.series}
    found = {
        key: _hash(str((array.dtype, array.shape)).encode() + np.ascontiguousarray(array).tobytes())
        for key, array in arrays.items()
    }
    return found | {f"metrics.{key}": value.hex() for key, value in result.metrics.items()}


def _result(name: str, longest: float) -> Result:
    experiment = load_experiment(name)
    if experiment.document.duration > longest:
        # A filter may delay its arm by more than that.
        with suppress(InvalidInputError):
            experiment = load_experiment(name, {"duration": longest})
    try:
        return simulate(experiment)
    except SimulationError as error:
        return error.result


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def record(file: Path, longest: float, jobs: int, names: list[str]) -> None:
    """Write the hashes of the named experiments, or of all if none are named."""
    names = names or shipped_experiments()
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        found = dict(zip(names, pool.map(hashes, names, [longest] * len(names)), strict=True))
    file.write_text(json.dumps(found, indent=1) + "\n")
    print(f"{len(found)} experiments, {sum(map(len, found.values()))} arrays and metrics")


def compare(before: Path, after: Path) -> int:
    """Print the differences; return the number of experiments that differ."""
    old, new = json.loads(before.read_text()), json.loads(after.read_text())
    differing = 0
    for name in sorted(old.keys() & new.keys()):
        keys = sorted(old[name].keys() | new[name].keys())
        pairs = {key: (old[name].get(key), new[name].get(key)) for key in keys}
        changed = [f"{key}{_apart(key, *pair)}" for key, pair in pairs.items() if len({*pair}) > 1]
        differing += bool(changed)
        if changed:
            print(f"{name}: {', '.join(changed)}")
    for name in sorted(old.keys() ^ new.keys()):
        print(f"{name}: only in {'the first' if name in old else 'the second'} record")
        differing += 1
    print(f"{len(old.keys() & new.keys())} experiments compared, {differing} differ")
    return differing


def _apart(key: str, before: str | None, after: str | None) -> str:
    """Return the relative difference of a metric, in brackets; empty for anything else."""
    if not key.startswith("metrics.") or before is None or after is None:
        return ""
    first, second = float.fromhex(before), float.fromhex(after)
    return f" ({abs(second - first) / max(abs(first), abs(second)):.1g})"


def main() -> None:
    """Record or compare, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record")
    recording.add_argument("file", type=Path)
    recording.add_argument("names", nargs="*", help="experiments; all of them by default")
    recording.add_argument("--longest", type=float, default=2.0, help="cut longer runs to this [s]")
    recording.add_argument("--jobs", type=int, default=2)
    comparing = commands.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.command == "record":
        record(given.file, given.longest, given.jobs, given.names)
    else:
        sys.exit(compare(given.before, given.after) > 0)


if __name__ == "__main__":
    main()
