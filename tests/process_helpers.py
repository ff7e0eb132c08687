"""Processes that tests start and stop."""

import os
import signal
import time
from contextlib import contextmanager

#: Time after which a process or page hangs [s]: the busiest machine is quicker, and nothing that
#: works waits for it.
PATIENCE = 600.0


def wait_for(condition, patience=PATIENCE):
    """Return whether a condition comes to hold, which a busy machine may take long to."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.02)
    return False


def wait_until_delivered(process, number):
    """Wait until a signal has come to a process: the same one, sent before, would be lost."""

    def is_delivered():
        with open(f"/proc/{process.pid}/status") as lines:
            fields = dict(line.split(":", 1) for line in lines)
        waiting = int(fields["SigPnd"], 16) | int(fields["ShdPnd"], 16)
        return not waiting >> (number - 1) & 1

    assert wait_for(is_delivered)


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
    """No process of the group is left, once those that were told to end have been scheduled."""

    def is_gone():
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        return False

    assert wait_for(is_gone, 120.0), "a process is left"
