"""What joints do while their target rests."""

import numpy as np
from motions import columns, cut, metrics, metrics_of_parts, motion

TIME = np.arange(0.0, 10.0, 1e-3)
NAMES = ("rest_swing_max_rad_s", "rest_velocity_max_rad_s")


def of(position, until=2.0, **fields):
    """Metrics of joints whose target moves until a time."""
    desired = columns(np.minimum(TIME, until))
    return metrics(motion(TIME, position=columns(position), p_WE_desired=desired, **fields))


def test_a_joint_that_swings_is_told_from_one_that_goes_to_its_posture():
    """A sine of amplitude A and frequency w has the mean speed 2 A w / pi, rms A w / sqrt(2)."""
    swings = of(0.05 * np.sin(20.0 * np.pi * TIME))
    assert abs(swings[NAMES[0]] - 0.1 * 20.0) < 0.01
    assert abs(swings[NAMES[1]] - 0.05 * 20.0 * np.pi / 2**0.5) < 0.03
    goes = of(np.exp(-0.3 * TIME))
    assert goes[NAMES[0]] < 1e-12
    assert 0.3 * np.exp(-3.0) < goes[NAMES[1]] < 0.3 * np.exp(-2.7)


def test_a_target_that_has_just_stopped_does_not_count():
    swing = 0.05 * np.sin(20.0 * np.pi * TIME)
    assert not set(NAMES) & of(swing, until=6.5).keys()
    assert set(NAMES) <= of(swing, until=5.5).keys()
    # Joint targets count likewise.
    target = columns(np.minimum(TIME, 7.0))
    assert not set(NAMES) & of(swing, target=target).keys()


def test_parts_of_a_run_give_the_same():
    whole = motion(
        TIME,
        position=columns(0.05 * np.sin(7.0 * TIME)),
        p_WE_desired=columns(np.minimum(TIME, 3.0)),
    )
    once, parts = metrics(whole), metrics_of_parts(cut(whole, 5600))
    for name in NAMES:
        np.testing.assert_allclose(parts[name], once[name], rtol=1e-9)
