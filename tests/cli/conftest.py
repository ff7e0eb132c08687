"""Fixtures of the tests of the command line."""

import math

import pytest

from drake_rnn import SimultaneousLearning
from drake_rnn.runs import simulation as diagram


@pytest.fixture
def drawn():
    """For tests in which figures are drawn; it takes seconds."""


@pytest.fixture
def undrawn(request, monkeypatch):
    """No figures, except in tests that ask for them; they take seconds."""
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr("drake_rnn.cli.saving.draw_figures", lambda result, folder: [])


@pytest.fixture
def breaks(monkeypatch):
    """A law whose numbers end at a time."""

    def at(when):
        step = SimultaneousLearning.step

        def broken(self, t, x, u, period):
            x = step(self, t, x, u, period)
            return x * math.nan if t >= when - 1e-9 else x

        monkeypatch.setattr(SimultaneousLearning, "step", broken)

    return at


@pytest.fixture
def simulated(monkeypatch):
    """Whether anything has been simulated."""
    times = []
    simulator = diagram.Simulator

    def watched(each):
        times.append(1)
        return simulator(each)

    monkeypatch.setattr(diagram, "Simulator", watched)
    return times
