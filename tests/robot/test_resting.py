"""Where joints may rest under the envelope of their velocity, and starts that are refused."""

import numpy as np
import pytest

from drake_rnn import Adaptive, InvalidInputError, JointLimits, load_arm
from drake_rnn.robot.limits import require_resting
from drake_rnn.systems import start_posture

LIMITS = JointLimits(
    position_lower=np.array([-1.0, -2.0]),
    position_upper=np.array([1.0, 2.0]),
    velocity=np.array([1.0, 1.0]),
    acceleration=np.array([5.0, 5.0]),
    envelope_offset=np.array([0.2, 0.4]),
    envelope_deceleration=np.array([2.0, np.inf]),
)


def test_where_there_is_an_envelope_a_joint_rests_farther_inside():
    """0.01 = 0.2^2 / (2 * 2) rad; a joint with an infinite deceleration has no envelope."""
    lower, upper = LIMITS.resting
    np.testing.assert_allclose(lower, [-0.99, -2.0])
    np.testing.assert_allclose(upper, [0.99, 2.0])


@pytest.mark.parametrize("q", [[0.99, 2.0], [-0.99, -2.0]])
def test_a_posture_at_the_end_of_that_is_accepted(q):
    require_resting(LIMITS, np.array(q), "start")


def test_a_posture_beyond_it_is_refused_by_name():
    message = r"^start: joint 1 is at 0\.995 rad; .* may rest at -0\.99 to 0\.99 rad$"
    with pytest.raises(InvalidInputError, match=message):
        require_resting(LIMITS, np.array([0.995, 0.0]), "start")
    with pytest.raises(InvalidInputError, match=r"home: joint 1 is at -0\.995 rad"):
        Adaptive(limits=LIMITS, home=np.array([-0.995, 0.0]))
    without = LIMITS.replace(envelope_offset=None, envelope_deceleration=None)
    require_resting(without, np.array([0.995, 0.0]), "start")


def test_a_start_of_an_arm_is_refused_with_the_name_of_its_joint():
    arm = load_arm("panda")
    limits = arm.limits.replace(envelope_offset=0.3, envelope_deceleration=6.0)
    start = arm.home.copy()
    start[3] = arm.limits.position_upper[3] - 0.005
    assert start_posture(arm, start) is not None
    with pytest.raises(InvalidInputError, match=r"^start: panda_joint4 is at -0\.0748 rad; under"):
        start_posture(arm.with_limits(limits), start)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (
            {"envelope_offset": None},
            r"^JointLimits\.envelope_offset: must be given where envelope_dec",
        ),
        (
            {"envelope_deceleration": None},
            r"^JointLimits\.envelope_deceleration: must be given where envelope",
        ),
        (
            {"envelope_offset": -0.1},
            r"^JointLimits\.envelope_offset: must be finite and at least 0, not",
        ),
        ({"envelope_offset": np.inf}, r"^JointLimits\.envelope_offset: must be finite"),
        ({"envelope_deceleration": 0.0}, r"^JointLimits\.envelope_deceleration: must be positive"),
        (
            {"envelope_offset": [0.2, 0.2, 0.2]},
            r"^JointLimits\.envelope_offset: must have 2 entries",
        ),
        (
            {"envelope_offset": 3.0},
            r"^JointLimits\.envelope_offset: leaves joint 1 no position to rest at",
        ),
    ],
)
def test_an_envelope_that_cannot_be_is_refused(bounds, message):
    with pytest.raises(ValueError, match=message):
        LIMITS.replace(**bounds)
