"""Measure what a sample of each scheme costs, in units of the arm's bare p_WE and J.

The law alone, on signals of a running diagram, and the whole step of the diagram without recorder.
All of a row are measured in turn, several times; the smallest of each counts.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from bench import law_step, tick, unit
from drake_rnn import load_experiment

ROOT = Path(__file__).parents[1]

#: Experiments, one for each scheme of the table of traits.
EXPERIMENTS = re.findall(r"<br>`(\w+)` \|", (ROOT / "docs" / "choosing.md").read_text())
#: What is changed of some.
CHANGES: dict[str, dict[str, Any]] = {
    # Made for Drake's integrators; sampled, a step is one of 1 ms.
    "state_adjustment": {"integrator": None, "period": 1e-3},
    "modified_state_adjustment": {"integrator": None, "period": 1e-3},
    # Longer than its filter is late.
    "chain_circle": {"duration": 6.0},
}
_STEPS = 1500


def main() -> None:
    """Print a row for each experiment."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=EXPERIMENTS, help="Experiments.")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print("| experiment | law | whole step | unit [us] |")
    print("|---|---|---|---|")
    for name in options.names:
        changes = {"window": None, "accept": None, **CHANGES.get(name, {})}
        period = load_experiment(name, changes).document.period
        assert period is not None
        experiment = load_experiment(name, {"duration": _STEPS * period, **changes})
        costs = [
            (unit(experiment), law_step(experiment), tick(experiment, recorded=False))
            for _ in range(options.rounds)
        ]
        one, law, whole = (min(each) for each in zip(*costs, strict=True))
        print(f"| `{name}` | {law / one:.1f} | {whole / one:.0f} | {one:.1f} |", flush=True)


if __name__ == "__main__":
    main()
