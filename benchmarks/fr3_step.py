"""Print what a step of the law takes of an FR3's cycle: in its diagram, in C, and in the pacer.

Over the motions of `fr3_live.py`, of an arm that follows exactly. The diagram's step is what a
drive takes whose law is beside the pacer; the one in C has the law and its kinematics alone, in a
loop of one's own; that of the pacer has what guards and checks it besides.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from drake_rnn import FR3, Array, CompiledStep
from drake_rnn.drive.approach import DrivenLaw
from drake_rnn.drive.pacer import PacedLaw, Pacer, State
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


def in_pacer(law: dict[str, Any], experiment: Experiment) -> Iterator[float]:
    """Yield how long each step takes in a pacer [s]."""
    task = DrivenLaw(experiment, True, paced=True)
    assert task.law_in_c is not None
    content = task.law_in_c.memory(task.limits, FR3.command_limits, 100)
    file = os.memfd_create("law")
    os.ftruncate(file, len(content))
    os.pwrite(file, content, 0)
    in_c, pacer, rest = PacedLaw(file), Pacer(task.start.tolist()), [0.0] * task.start.size
    for k in range(task.law_in_c.samples):
        state = State(k * FR3.period, pacer.motion.position, rest, rest, 1.0)
        began = time.perf_counter()
        in_c.pass_cycles(1, k)
        command = in_c.command(pacer.motion, state)
        if command is not None and pacer.take(command):
            in_c.keep(pacer.motion, k)
        yield time.perf_counter() - began
    os.close(file)


def told(times: Array) -> str:
    """Return median and 99th percentile [us] as a cell."""
    return " / ".join(f"{1e6 * t:.0f}" for t in np.quantile(times, [0.5, 0.99]))


def main() -> None:
    told_of = ("in its diagram [us]: median / p99", "in C, likewise", "in the pacer, likewise")
    head("law", *told_of, made_by="python benchmarks/fr3_step.py")
    gc.disable()
    for name, law in LAWS.items():
        motions = list(islice(experiments(law), MOTIONS))
        cells = [
            told(np.array([t for each in motions for t in way(law, each)]))
            for way in (in_diagram, compiled, in_pacer)
        ]
        row(name, *cells)


if __name__ == "__main__":
    main()
