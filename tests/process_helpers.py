"""Processes that tests start and stop."""

import os
import signal
import time
from contextlib import contextmanager

import pytest


@contextmanager
def within(seconds, late):
    """Fail with a text if what is done within takes more time of the processor than this [s].

    How busy the machine is makes no difference; what waits for ever meets the limit of all tests.
    """

    def stop(number, frame):
        raise TimeoutError(late)

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def wait_until_kept(process, *folders):
    """Wait until runs of a process have kept a state to go on from, however busy the machine is."""
    states = [folder / "checkpoint" / "state.npz" for folder in folders]
    while not all(state.exists() for state in states):
        assert process.poll() is None
        time.sleep(0.05)


def assert_gone(group):
    """No process of the group is left, a moment later at most."""
    for _ in range(200):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("a process is left")
