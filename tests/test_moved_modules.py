"""Modules under their names of version 0.3: the same objects, for one release, with a warning."""

from importlib import import_module
from importlib.util import find_spec

import pytest

from drake_rnn import moved_modules
from drake_rnn.moved_modules import MOVED

ROWS = [row.partition(":") for row in MOVED.replace("\n    ", " ").splitlines() if row]


def test_every_new_name_is_a_module_and_no_old_one_is():
    assert len(ROWS) > 150
    for new, _, olds in ROWS:
        assert find_spec(f"drake_rnn.{new}"), new
        for old in olds.split():
            with pytest.warns(DeprecationWarning, match="its old name works") as told:
                spec = find_spec(f"drake_rnn.{old}")
            assert f"drake_rnn.{old} is now drake_rnn.{new};" in str(told[-1].message)
            assert type(spec.loader).__module__ == moved_modules.__name__


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("environments.plate", "environments", "Plate"),
        ("robot.task", "robot.kinematics", "Task"),
        ("laws.networks.design", "laws.zeroing_design", "Design"),
        ("cli.asked.running", "cli.arguments", "Run"),
    ],
)
def test_an_old_name_lends_the_same_objects(old, new, name):
    with pytest.warns(DeprecationWarning, match="its old name works until the next release"):
        module = import_module(f"drake_rnn.{old}")
    assert getattr(module, name) is getattr(import_module(f"drake_rnn.{new}"), name)


def test_a_module_that_never_was_is_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'drake_rnn\.robot\.tasks'"):
        import_module("drake_rnn.robot.tasks")
