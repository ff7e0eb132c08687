"""Modules under their names of version 0.3: the same objects, for one release, with a warning."""

from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

from drake_rnn import (
    JointLimits,
    Layout,
    Pseudoinverse,
    SampledController,
    make_obstacles,
    moved_modules,
)
from drake_rnn.features.base import DifferentialDrive
from drake_rnn.inputs.fields import checked, vector
from drake_rnn.moved_modules import PLACES

ROWS = [row.partition(":") for row in PLACES.replace("\n    ", " ").splitlines() if row]


def test_every_new_name_is_a_module_and_no_old_one_is():
    assert sum(len(olds.split()) for _, _, olds in ROWS) > 250
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


@pytest.mark.parametrize(
    ("package", "old", "new"),
    [
        ("drake_rnn", "Tuned", "TuningOutcome"),
        ("drake_rnn", "Driven", "DriveOutcome"),
        ("drake_rnn.drive", "connected", "open_lcm"),
    ],
)
def test_an_old_name_of_a_package_lends_the_same_object(package, old, new):
    module = import_module(package)
    with pytest.warns(DeprecationWarning, match=rf"{package}\.{old} is now drake_rnn\..*\.{new};"):
        assert getattr(module, old) is getattr(module, new)
    assert old not in module.__all__


def test_old_names_of_methods_and_arguments_work_and_warn():
    layout = Layout(a=(2,), b=(1,))
    x = np.array([1.0, 2.0, 3.0])
    with pytest.warns(DeprecationWarning, match=r"Layout\.named is now by_name; its old name"):
        assert layout.named(x)["b"] == 3.0
    with pytest.warns(DeprecationWarning, match=r"make_obstacles: given is now sections;"):
        assert make_obstacles(given=[]) == make_obstacles([])
    with pytest.raises(TypeError, match="unexpected keyword argument 'gave'"):
        make_obstacles(gave=[])


def test_a_controller_takes_its_wrapper_under_the_old_name():
    law = Pseudoinverse(limits=JointLimits.unlimited(7))
    with pytest.warns(DeprecationWarning, match="locks is now wrapper; its old name works"):
        controller = SampledController(law, 1e-3, locks=DifferentialDrive())
    assert isinstance(controller.wrapper, DifferentialDrive)
    with pytest.warns(DeprecationWarning, match="locks is now wrapper; its old name works"):
        assert controller.locks is controller.wrapper


def test_what_is_checked_is_an_argument():
    with pytest.raises(TypeError, match=r"step has no argument 'size' to check"):

        @checked(size=vector)
        def step(q):
            return q
