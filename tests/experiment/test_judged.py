"""Warnings about laws whose commands a robot's own controller would refuse."""

import pytest

from drake_rnn import load_arm
from drake_rnn.experiment.experiment import judged_doubts

FR3 = load_arm("fr3").limits
ALL = ("position", "velocity", "acceleration", "jerk", "envelope")


def test_a_law_that_keeps_all_is_not_doubted():
    assert judged_doubts(FR3, ALL, 1e-3) == []


def test_without_a_bound_of_the_jerk_the_acceleration_is_named():
    """4999.9 rad/s^3 for 1 ms are 5 rad/s^2, from +2.5 to -2.5."""
    (doubt,) = judged_doubts(FR3, ("velocity", "acceleration", "envelope"), 1e-3)
    assert "by more than 2.5 rad/s^2" in doubt
    assert judged_doubts(FR3.replace(acceleration=2.4), ("envelope",), 1e-3) == []
    assert judged_doubts(FR3, ("envelope",), None) == []


@pytest.mark.parametrize("period", [1e-3, None])
def test_a_law_that_does_not_know_the_envelope_is_told_of(period):
    doubts = judged_doubts(FR3.replace(acceleration=2.4), ("velocity",), period)
    assert ["does not keep the envelope" in doubt for doubt in doubts] == [True]


def test_an_arm_without_an_envelope_is_not_judged():
    assert judged_doubts(load_arm("panda").limits, (), 1e-3) == []
