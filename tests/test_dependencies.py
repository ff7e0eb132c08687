"""What is installed: bounds in pyproject.toml, and the lock that `make` uses."""

import tomllib
from importlib.metadata import requires
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from drake_rnn.inputs.packages import packages_of

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
#: Extras of the environments that the Makefile and `.ci/run` make.
LOCKED = ("dev", "docs", "jax", "looks", "mutants")


def lock():
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    return [Requirement(line) for line in lines if not line.startswith("#")]


@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
def test_the_lock_has_what_the_bounds_admit(python):
    environment = {"python_version": python, "python_full_version": f"{python}.0"}
    pins = {
        pin.name: next(iter(pin.specifier)).version
        for pin in lock()
        if pin.marker is None or pin.marker.evaluate(environment)
    }
    extras = PROJECT["optional-dependencies"]
    stated = [*PROJECT["dependencies"], *(line for name in LOCKED for line in extras[name])]
    for requirement in map(Requirement, stated):
        name = requirement.name.lower().replace(".", "-").replace("_", "-")
        assert name in pins, f"{requirement}: run make lock"
        assert requirement.specifier.contains(pins[name]), f"{requirement}: run make lock"


def test_every_bound_is_a_lower_one():
    extras = PROJECT["optional-dependencies"].values()
    for requirement in map(Requirement, chain(PROJECT["dependencies"], *extras)):
        (bound,) = requirement.specifier
        assert bound.operator == ">=", requirement


def test_a_missing_package_is_installed_by_its_own_name():
    """Never as an extra of this package: its name on PyPI may be somebody else's."""
    for extra, lines in PROJECT["optional-dependencies"].items():
        assert packages_of(extra) == " ".join(f"'{line.partition(';')[0]}'" for line in lines)
    assert packages_of("pandas") == "pandas"
    assert requires("drake-rnn")
