"""Processes that tests start and stop."""

import os
import time

import pytest


def assert_gone(group):
    """No process of the group is left, a moment later at most."""
    for _ in range(200):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("a process is left")
