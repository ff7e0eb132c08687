"""The measures of networks whose authors' code alone could be read: their algorithms."""

import pytest

from drake_rnn.claims.papers import noise_suppressing, unknown_kinematics


@pytest.mark.parametrize("case", ["base", "offset"])
def test_an_unknown_arm_stays_within_bounds_and_funnels(case):
    assert unknown_kinematics.lasts(None, case) == 10.0
    for measure in ("velocity_share", "position_share", "funnel_share", "observer_share"):
        assert 0.0 < getattr(unknown_kinematics, measure)(None, case) < 1.0
    assert unknown_kinematics.error(None, case) < 1e-4


def test_a_disturbance_is_suppressed_by_one_network_and_not_by_the_other():
    """Of 5 in every equation; what is left of the first instants stays, without feedback."""
    assert noise_suppressing.error(None, "noise_suppressing", 5.0, 1.0) < 5e-5
    assert noise_suppressing.error(None, "dual", 5.0, 1.0) > 0.1
    assert noise_suppressing.error(None, "dual", 0.0, 1.0) < 0.02
    assert noise_suppressing.residual_at_end(None, 1e-3, 1.0) < 1e-7
    assert noise_suppressing.speed_share(None, "noise_suppressing", 5.0, 1.0) < 1.0
    assert noise_suppressing.speed_share(None, "dual", 5.0, 1.0) > 2.0


def test_the_network_starts_from_multipliers_of_any_sign():
    assert noise_suppressing.residual_at_end(None, 0.1, 2.0) < 2e-8
