"""Commands for an FR3 are judged by its constants, and by a third party's checker of its limits."""

import os

import numpy as np
import pytest

import fr3_conformance
from drake_rnn import load_arm
from fr3_conformance import Errand, adaptive, by_constants, by_franka_sim

MOTIONS, STEPS = 20, 300


@pytest.fixture(scope="module")
def motions():
    """Short motions and their commands."""
    arm = load_arm("fr3")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fr3_conformance, "STEPS", STEPS)
        errands = [Errand(arm, arm.limits, seed, known=seed % 5 > 0) for seed in range(MOTIONS)]
        commands = np.array([adaptive(errand) for errand in errands])
    assert np.abs(commands).max() > 1.0
    return errands, commands


@pytest.mark.long
def test_the_constants_object_to_nothing(motions):
    for errand, velocity in zip(*motions, strict=True):
        found = by_constants(errand.start, velocity)
        assert (found.count, found.kinds) == (0, [])
        assert found.distance > 0.0


@pytest.mark.long
def test_a_third_partys_checker_objects_to_nothing(motions):
    if not (python := os.environ.get("FRANKA_SIM_PYTHON")):
        pytest.skip("FRANKA_SIM_PYTHON names no Python that has franka-sim")
    for found in by_franka_sim(python, *motions):
        assert found["velocity"] == found["position"] == [0, ""]
