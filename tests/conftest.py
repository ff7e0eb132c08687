"""What all tests share."""

import os

import pytest
from hypothesis import settings

# The same examples in each run, and none refused for the machine being busy.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session", autouse=True)
def surroundings(tmp_path_factory):
    """A cache folder of the tests' own, and no ROS: results depend on nobody's machine."""
    before = os.environ.copy()
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        os.environ.pop(name, None)
    yield
    os.environ.clear()
    os.environ.update(before)
