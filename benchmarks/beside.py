"""Compare ticks and whole runs with those of another checkout, in turn on the same machine.

Each checkout runs the same experiments with its own Python, in a process that stays. A run is a
whole `simulate`; its cost is the CPU time of its process, user and system. A tick is the time from
one sample of the law to the next within that run, recorder included: the tenth of its ticks that
are fastest end below the figure, so that it does not tell of other work on the machine.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_rnn import InvalidInputError, load_experiment, simulate

#: Largest cost, as a share of that in the other checkout.
AT_MOST = 1.0


def table(folder: Path, durations: Mapping[str, float], rounds: int) -> list[str]:
    """Return the rows of a table that compares this checkout with the one in a folder.

    Args:
        folder: The other checkout, with an installed ``.venv`` of its own.
        durations: Duration of a run by experiment [s]; those that the other checkout does not have
            are left out.
        rounds: Number of runs of each.
    """
    here = Path(__file__).resolve().parent.parent
    workers = [_started(checkout) for checkout in (here, folder.resolve())]
    rows = [
        "| experiment | tick [us] | there | ratio | run [s] | there | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, duration in durations.items():
        if any(_asked(worker, name, duration) is None for worker in workers):
            continue
        asked = [[_asked(worker, name, duration) for worker in workers] for _ in range(rounds)]
        costs = np.array(asked, dtype=float)
        (tick, run), (tick_there, run_there) = costs.min(axis=0)
        cells = (
            *(f"{tick:.1f}", f"{tick_there:.1f}", f"{tick / tick_there:.3f}"),
            *(f"{run:.2f}", f"{run_there:.2f}", f"{run / run_there:.3f}"),
        )
        rows.append(f"| `{name}` | {' | '.join(cells)} |")
    for worker in workers:
        worker.communicate()
    return rows


def _started(checkout: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [checkout / ".venv" / "bin" / "python", __file__],
        cwd=checkout,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _asked(worker: subprocess.Popen[str], name: str, duration: float) -> list[float] | None:
    """Return the cost of a tick [us] and of a run [s]; None for an unknown experiment."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    print(name, duration, file=worker.stdin, flush=True)
    return json.loads(worker.stdout.readline())


def _work() -> None:
    """Run the experiments that are named on the standard input; print what each has cost as JSON.

    This runs in older checkouts too: of the package it uses what is public in all of them.
    """
    samples: list[int] = []
    declare = LeafSystem.DeclarePeriodicDiscreteUpdateEvent

    def declare_stamped(self, period, offset, update):
        def stamped(*arguments):
            samples.append(time.perf_counter_ns())
            return update(*arguments)

        is_law = type(self).__name__ == "SampledController"
        return declare(self, period, offset, stamped if is_law else update)

    LeafSystem.DeclarePeriodicDiscreteUpdateEvent = declare_stamped
    for line in sys.stdin:
        name, duration = line.split()
        try:
            experiment = load_experiment(name, {"duration": float(duration), "accept": None})
        except InvalidInputError:
            print("null", flush=True)
            continue
        samples.clear()
        began = time.process_time()
        simulate(experiment)
        run = time.process_time() - began
        print([float(np.percentile(np.diff(samples), 10)) / 1e3, run], flush=True)


if __name__ == "__main__":
    _work()
