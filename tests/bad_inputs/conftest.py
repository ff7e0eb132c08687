"""What the tests of bad inputs share: nothing may run, and what never changes is read once."""

from functools import cache

import pytest

from drake_rnn import load_arm
from drake_rnn.experiment import arms
from drake_rnn.inputs import kinds
from drake_rnn.runs import simulation

_shipped, _offered = cache(load_arm), cache(kinds.entry_points)


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch):
    """A run that is started is a failure: its input should have been refused."""

    def start(*arguments):
        raise AssertionError("a run was started")

    monkeypatch.setattr(simulation, "_advance", start)


@pytest.fixture(autouse=True)
def arms_and_packages_are_looked_for_once(monkeypatch):
    """It takes a tenth of a second, a thousand times."""

    def known(model, **fields):
        return load_arm(model, **fields) if fields else _shipped(model)

    monkeypatch.setattr(arms, "load_arm", known)
    monkeypatch.setattr(kinds, "entry_points", _offered)
