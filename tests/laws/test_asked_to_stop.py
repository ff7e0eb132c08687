"""A warning before a run whose feedback asks an arm to stop faster than it can."""

import re

import numpy as np
import pytest

from drake_rnn import (
    Circumstances,
    InvalidInputError,
    JointLimits,
    SimultaneousLearning,
    load_experiment,
    shipped_experiments,
)

LIMITS = JointLimits.unlimited(3).replace(velocity=1.0, acceleration=np.array([1.0, 2.0, 4.0]))
# Each axis has a joint of its own, which moves it by 0.5 m a radian.
CIRCUMSTANCES = Circumstances(start_offset=np.array([0.1, 0.0, 0.0]), J=0.5 * np.eye(3))


def doubts(circumstances=CIRCUMSTANCES, **fields):
    law = SimultaneousLearning(limits=LIMITS, home=np.zeros(3), jacobian="known", **fields)
    return law.doubts(circumstances)


def test_the_gain_at_which_it_warns_is_that_of_eight_times_what_the_arm_can_do():
    """kappa^2 0.1 m against 8 times 0.5 m/s^2."""
    assert doubts(kappa=6.3) == []
    (said,) = doubts(kappa=6.4)
    assert re.match(
        r"law\.kappa: the arm starts 0\.1 m off its path, so 6\.4 /s asks for 0\.64 m/s and, to "
        r"stop again, 4\.1 m/s\^2; .* about 0\.5 .*; consider law\.feedback_limit: 0\.3$",
        said,
    )
    assert doubts(kappa=6.4, feedback_limit=0.3) == []


def test_each_joint_counts_with_its_own_bound():
    other = CIRCUMSTANCES._replace(start_offset=np.array([0.0, 0.0, 0.1]))
    assert len(doubts(other, kappa=7.0)) == 1
    assert doubts(other, kappa=7.0, acceleration_bound="per_joint") == []


@pytest.mark.parametrize(
    "circumstances",
    [Circumstances(), CIRCUMSTANCES._replace(start_offset=np.zeros(3))],
)
def test_without_an_offset_there_is_nothing_to_doubt(circumstances):
    assert doubts(circumstances, kappa=1000.0) == []


def test_without_a_bound_there_is_nothing_to_doubt():
    assert doubts(kappa=1000.0, acceleration_bound="none") == []


def test_no_shipped_experiment_is_in_doubt():
    for name in shipped_experiments():
        if name.startswith("slc_"):
            warnings = load_experiment(name).warnings
            assert not any("cycle for ever" in said for said in warnings), name


@pytest.mark.parametrize("changes", [{"law.kappa": 15}, {"path.offset": [0.25, 0, 0]}])
def test_an_experiment_that_cycles_for_ever_is(changes):
    experiment = load_experiment("slc_nephroid_known", changes | {"limits.acceleration": 0.7})
    assert any("cycle for ever" in said for said in experiment.warnings)


def test_substeps_that_overshoot_are_refused():
    law = SimultaneousLearning(limits=LIMITS, home=np.zeros(3), rate=1000.0, substeps=3)
    assert law.sampled(3e-3) is law
    with pytest.raises(InvalidInputError, match=r"^law\.substeps: must be at least 4 at rate 1000"):
        law.sampled(4e-3)
