"""What of a robot's own limits a drive uses, and experiments for it."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, RobotError
from drake_rnn.drive import FR3, IIWA, connect, driven_experiment


def test_commands_stay_further_inside_than_what_is_measured():
    own, commanded, measured = IIWA.limits, IIWA.commanded, IIWA.measured
    np.testing.assert_allclose(own.position_upper - commanded.position_upper, 0.05)
    np.testing.assert_allclose(commanded.position_lower - own.position_lower, 0.05)
    np.testing.assert_allclose(own.position_upper - measured.position_upper, np.pi / 180)
    np.testing.assert_allclose(commanded.velocity, 0.9 * own.velocity)
    np.testing.assert_allclose(measured.velocity, own.velocity)


def test_the_stricter_limit_counts_and_the_arm_is_the_robots():
    found = driven_experiment("slc_nephroid_known", IIWA, {"limits": {"velocity": 1.4}})
    assert (found.arm.name, found.document.level) == ("iiwa14", "robot")
    own = IIWA.commanded
    np.testing.assert_array_equal(found.limits.velocity, np.minimum(1.4, own.velocity))
    np.testing.assert_array_equal(found.limits.acceleration, own.acceleration)
    np.testing.assert_array_equal(found.limits.position_lower, own.position_lower)
    assert found.limits.jerk is None
    assert driven_experiment("adaptive_jerk", IIWA).limits.jerk is not None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": [0.0] * 7}, "start: is a posture of panda; iiwa is an iiwa14"),
        (
            {"arm": "iiwa14", "start": [0.0, 2.06, 0.0, -1.0, 0.0, 0.5, 0.0]},
            "start: iiwa_joint_2 is at 2.06 rad; it may be -2.0444 to 2.0444",
        ),
    ],
)
def test_a_start_that_the_robot_must_not_take_is_refused(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        driven_experiment("slc_nephroid_known", IIWA, changes)


def test_an_fr3_is_commanded_inside_what_it_judges_at_its_measured_position():
    own, commanded = FR3.limits, FR3.commanded
    assert (IIWA.period, FR3.period) == (5e-3, 1e-3)
    np.testing.assert_allclose(own.velocity - commanded.velocity, 0.3)
    np.testing.assert_array_equal(commanded.acceleration, own.acceleration)
    np.testing.assert_array_equal(commanded.jerk, own.jerk)
    # Wherever a joint is, its envelope is at least as far inside.
    for q in np.linspace(commanded.position_lower, commanded.position_upper, 20):
        low, high = own.envelope.velocities(q, (own.position_lower, own.position_upper))
        lower, upper = commanded.envelope.velocities(
            q, (commanded.position_lower, commanded.position_upper)
        )
        assert (np.minimum(lower - low, high - upper) >= 0.3 - 1e-12).all()


def test_a_law_without_a_bound_of_the_jerk_is_slowed_down_on_an_fr3():
    assert driven_experiment("adaptive_fr3", FR3).limits.jerk is not None
    found = driven_experiment("slc_nephroid_known", FR3, {"limits": "fr3"}).limits
    assert found.jerk is None
    np.testing.assert_array_equal(found.acceleration, 2.4)


def test_a_law_of_another_period_than_its_cycle_does_not_fit_an_fr3():
    with pytest.raises(InvalidInputError, match=r"period: must be .* the cycle of the fr3"):
        driven_experiment("adaptive_fr3", FR3, {"period": 2e-3})


def test_an_fr3_has_no_address_of_its_own():
    with pytest.raises(RobotError, match="--url: must be given"):
        connect(FR3)
