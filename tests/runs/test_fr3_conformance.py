"""Commands for an FR3 are judged by its constants, and by a third party's checker of its limits."""

import os

import numpy as np
import pytest

import fr3_motions
from drake_rnn import load_arm
from fr3_conformance import by_constants, by_franka_sim
from fr3_motions import Errand, adaptive, adaptive_alone

MOTIONS, STEPS = 24, 300


@pytest.fixture(scope="module")
def motions():
    """Short motions and their commands, every third with a learned J."""
    arm = load_arm("fr3")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fr3_motions, "STEPS", STEPS)
        errands = [Errand(arm, arm.limits, seed, known=seed % 3 > 0) for seed in range(MOTIONS)]
        commands = np.empty((MOTIONS, STEPS, arm.n))
        for known in (True, False):
            which = [k for k, errand in enumerate(errands) if errand.known == known]
            commands[which] = adaptive([errands[k] for k in which])
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


@pytest.mark.long
def test_side_by_side_they_move_as_alone(motions, monkeypatch):
    # Sums are added in another order. While J is learned at full limits, the motion enlarges
    # rounding without bound, so that only its beginning can be compared.
    monkeypatch.setattr(fr3_motions, "STEPS", STEPS)
    for errand, velocity in list(zip(*motions, strict=True))[:3]:
        compared, within = (STEPS, 1e-8) if errand.known else (50, 1e-5)
        alone = adaptive_alone(errand)[:compared]
        np.testing.assert_allclose(velocity[:compared], alone, rtol=0.0, atol=within)
        np.testing.assert_array_equal(adaptive([errand])[0], velocity)
