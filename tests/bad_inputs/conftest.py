"""What the tests of bad inputs share: nothing may run."""

from functools import cache

import pytest

from drake_rnn import load_arm
from drake_rnn.experiment import experiment
from drake_rnn.runs import simulation

_shipped = cache(load_arm)


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch):
    """A run that is started is a failure: its input should have been refused."""

    def start(*arguments):
        raise AssertionError("a run was started")

    monkeypatch.setattr(simulation, "_advance", start)


@pytest.fixture(autouse=True)
def arms_are_read_once(monkeypatch):
    """It takes a tenth of a second, hundreds of times."""

    def known(model, **fields):
        return load_arm(model, **fields) if fields else _shipped(model)

    monkeypatch.setattr(experiment, "load_arm", known)
