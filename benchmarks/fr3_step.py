"""Print what a step of the law takes of an FR3's cycle, in its diagram and compiled by JAX.

Over the motions of `fr3_live.py`, of an arm that follows exactly. The diagram's step is what a
drive takes; the compiled one has the law and its kinematics alone, in a loop of one's own.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from drake_rnn import FR3, Array, CompiledStep
from drake_rnn.drive.approach import DrivenLaw
from drake_rnn.experiment import Experiment, make_experiment
from fr3_live import LAWS, document, experiments
from markdown_table import head, row

MOTIONS = 2


def in_diagram(law: dict[str, Any], experiment: Experiment) -> Iterator[float]:
    """Yield how long each step takes [s]."""
    task = DrivenLaw(experiment)
    q, still = task.start, np.zeros(task.start.size)
    samples = round(experiment.document.duration / FR3.period)
    for k in range(1, samples + 1):
        began = time.perf_counter()
        q = task.advance(k * FR3.period, q, still)
        yield time.perf_counter() - began


def compiled(law: dict[str, Any], experiment: Experiment) -> Iterator[float]:
    """Yield how long each compiled step takes [s]."""
    bounds = {name: x.tolist() for name, x in experiment.limits.bounds.items() if x is not None}
    stated = document(law, experiment.document.seed) | {"limits": bounds}
    step = CompiledStep(make_experiment(stated))
    robot, q = step.start(), step.home
    for _ in range(robot.samples):
        began = time.perf_counter()
        v = robot.step(q)
        yield time.perf_counter() - began
        q = q + robot.period * v


def told(times: Array) -> str:
    """Return median and 99th percentile [us] as a cell."""
    return " / ".join(f"{1e6 * t:.0f}" for t in np.quantile(times, [0.5, 0.99]))


def main() -> None:
    told_of = ("in its diagram [us]: median / p99", "compiled, likewise")
    head("law", *told_of, made_by="python benchmarks/fr3_step.py")
    gc.disable()
    for name, law in LAWS.items():
        motions = list(islice(experiments(law), MOTIONS))
        cells = [
            told(np.array([t for each in motions for t in way(law, each)]))
            for way in (in_diagram, compiled)
        ]
        row(name, *cells)


if __name__ == "__main__":
    main()
