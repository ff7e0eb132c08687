"""Compare runs of many at once with Drake's diagrams: every shipped experiment, every step.

Prints as Markdown, for each experiment, the largest difference of a joint's position between
`run_many` and `simulate` at any step, and the largest relative one of a metric; or why a batch
cannot run it::

    python benchmarks/agreement.py [NAME ...] [--duration SECONDS]
"""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple

import numpy as np

from drake_rnn import (
    Experiment,
    InvalidInputError,
    load_experiment,
    run_many,
    shipped_experiments,
    simulate,
    why_not,
)
from markdown_table import head, row


class Agreement(NamedTuple):
    """A run in a batch, compared with one in a diagram.

    Attributes:
        steps: Number of steps.
        position: Largest difference of a joint's position at any step [rad].
        many: Metrics of the batch, by name.
        drake: Metrics of the diagram, by name.
    """

    steps: int
    position: float
    many: dict[str, float]
    drake: dict[str, float]

    @property
    def apart(self) -> tuple[float, str]:
        """Largest difference of a metric, relative to its value where that exceeds 1e-6."""
        both = self.many.keys() & self.drake.keys()
        found = [(_apart(self.many[name], self.drake[name]), name) for name in both]
        return max(found, default=(0.0, ""))


def _apart(a: float, b: float) -> float:
    return abs(a - b) / max(abs(b), 1e-6)


def every_step(name: str, duration: float | None = None) -> Experiment:
    """Return a shipped experiment of which every step is stored.

    Args:
        name: Its name.
        duration: Its duration [s]; None for its own.
    """
    changes: dict[str, Any] = {}
    document = load_experiment(name).document
    if duration is not None and duration < document.duration:
        changes = {"duration": duration, "window": None}
    steps = [document.period or document.log_period]
    if document.dither is not None:
        steps.append(document.dither.hold)
    return load_experiment(name, {**changes, "log_period": min(steps)})


def agreement(experiment: Experiment) -> Agreement:
    """Run an experiment both ways.

    Args:
        experiment: The experiment, of which every step is stored.
    """
    drake = simulate(experiment, anyway=True)
    many = run_many([experiment], record=["position"])
    # Two steps a rounding error apart are stored as one.
    at = np.searchsorted(many.time[0], drake.time - 1e-9)
    difference = np.abs(many.series["position"][0][at] - drake.series["position"])
    return Agreement(drake.time.size, float(difference.max()), many.row(0), drake.metrics)


def _why_not(name: str) -> str | None:
    try:
        return why_not(load_experiment(name))
    except InvalidInputError as error:
        return str(error)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--duration", type=float)
    options = parser.parse_args()
    head("experiment", "steps", "joints apart [rad]", "metrics apart", "which or why not")
    for name in options.names or shipped_experiments():
        if (reason := _why_not(name)) is not None:
            row(f"`{name}`", "", "", "", reason)
            continue
        found = agreement(every_step(name, options.duration))
        apart, which = found.apart
        cells = (f"{found.steps}", f"{found.position:.1e}", f"{apart:.1e}", f"`{which}`")
        row(f"`{name}`", *cells)


if __name__ == "__main__":
    main()
