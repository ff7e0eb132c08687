"""What the tests of bad inputs share: nothing may run."""

import pytest

from drake_rnn.runs import simulation


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch):
    """A run that is started is a failure: its input should have been refused."""

    def start(*arguments):
        raise AssertionError("a run was started")

    monkeypatch.setattr(simulation, "_advance", start)
