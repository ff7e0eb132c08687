"""Print where the time of a tick goes: each call from Drake into Python, and what it computes.

A row is the median time that one call spends in itself, without the rows that it calls, of all
calls in a run; medians leave out what other work on the machine takes. The last row is the rest of
the median tick: what Drake does outside of these calls. The clock adds some 0.2 us to each call.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_rnn import load_experiment
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.measures import Recorder
from drake_rnn.robot.kinematics import ArmKinematics
from drake_rnn.runs.simulation import recorded_simulator
from drake_rnn.systems import Controller

_TICKS = 4000

_times: dict[str, list[int]] = defaultdict(list)
# Time that was spent in the rows called by each call that goes on.
_inner: list[int] = [0]
# Times at which the law's samples begin.
_samples: list[int] = []


def timed(row: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that does the same, and notes how long each call spends in itself."""

    def call(*arguments: Any) -> Any:
        _inner.append(0)
        began = time.perf_counter_ns()
        try:
            return function(*arguments)
        finally:
            taken = time.perf_counter_ns() - began
            _times[row].append(taken - _inner.pop())
            _inner[-1] += taken

    return call


def _time_callbacks() -> None:
    """Have what Drake is told to call from now on timed, and the recorder's monitor."""
    declare_port = LeafSystem.DeclareVectorOutputPort
    declare_update = LeafSystem.DeclarePeriodicDiscreteUpdateEvent

    def port(self: Any, name: str, size: int, calc: Any, *tickets: Any) -> Any:
        return declare_port(self, name, size, timed(f"port {name}", calc), *tickets)

    def update(self: Any, period: float, offset: float, function: Any) -> Any:
        call = timed(f"update of {type(self).__name__}", function)

        def stamped(*arguments: Any) -> Any:
            if isinstance(self, Controller):
                _samples.append(time.perf_counter_ns())
            return call(*arguments)

        return declare_update(self, period, offset, stamped)

    LeafSystem.DeclareVectorOutputPort = port
    LeafSystem.DeclarePeriodicDiscreteUpdateEvent = update
    Recorder.__call__ = timed("monitor of the recorder", Recorder.__call__)
    Controller.signals = timed("reading the law's inputs, with the C++ behind", Controller.signals)
    for name in ("p_WE", "R_WE", "J", "J_omega", "Jdot_v"):
        setattr(ArmKinematics, name, timed(f"kinematics {name}", getattr(ArmKinematics, name)))


def rows(name: str) -> list[tuple[str, float, float]]:
    """Return name, calls a tick and time a tick [us] of each row, the longest first."""
    period = load_experiment(name).document.period
    assert period is not None
    changes = {"duration": _TICKS * period, "window": None, "accept": None}
    experiment = load_experiment(name, changes)
    kind = type(experiment.desired)
    for part in ("position", "orientation"):
        setattr(kind, part, timed(f"path {part}", getattr(kind, part)))
    simulator, (loop, *_), recorder = recorded_simulator(experiment)
    recorder.watch(simulator)
    loop.controller._step = timed("law", without_checks(loop.controller.reading.step))
    simulator.Initialize()
    _times.clear()
    simulator.AdvanceTo(_TICKS * period)
    found = [
        (row, len(times) / _TICKS, float(np.median(times)) * len(times) / _TICKS / 1e3)
        for row, times in _times.items()
    ]
    rest = float(np.median(np.diff(_samples))) / 1e3 - sum(cost for _, _, cost in found)
    return [*sorted(found, key=lambda row: -row[2]), ("the rest: Drake's loop, in C++", 1.0, rest)]


def main() -> None:
    """Print the rows of an experiment."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", help="a shipped experiment with a period")
    _time_callbacks()
    print("| call | a tick | us a tick |")
    print("|---|---|---|")
    for row, calls, cost in rows(parser.parse_args().name):
        print(f"| {row} | {calls:.2g} | {cost:.1f} |")


if __name__ == "__main__":
    main()
