"""What of a robot's own limits a drive uses, and experiments for it."""

import re

import numpy as np
import pytest

from drake_rnn import InvalidInputError, RobotError
from drake_rnn.drive import FR3, IIWA, address_of, connect, driven_experiment
from row_helpers import each


def test_commands_stay_further_inside_than_what_is_measured():
    own, commanded, measured = IIWA.limits, IIWA.command_limits, IIWA.measurement_limits
    np.testing.assert_allclose(own.position_upper - commanded.position_upper, 0.05)
    np.testing.assert_allclose(commanded.position_lower - own.position_lower, 0.05)
    np.testing.assert_allclose(own.position_upper - measured.position_upper, np.pi / 180)
    np.testing.assert_allclose(commanded.velocity, 0.9 * own.velocity)
    np.testing.assert_allclose(measured.velocity, own.velocity)


def test_the_stricter_limit_counts_and_the_arm_is_the_robots():
    found = driven_experiment("slc_nephroid_known", IIWA, {"limits": {"velocity": 1.4}})
    assert (found.arm.name, found.document.level) == ("iiwa14", "robot")
    own = IIWA.command_limits
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
        (
            {"arm": {"model": "iiwa14", "joints": IIWA.joints[::-1], "home": [0.1] * 7}},
            "arm.joints: must be those of the iiwa, in its order: .* not iiwa_joint_7",
        ),
    ],
)
def test_a_start_that_the_robot_must_not_take_is_refused(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        driven_experiment("slc_nephroid_known", IIWA, changes)


def test_an_fr3_is_commanded_inside_what_it_judges_at_its_measured_position():
    own, commanded = FR3.limits, FR3.command_limits
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


NO_GROUP = "the address must be an IPv4 address of multicast, 224.0.0.0 to 239.255.255.255, not "
NO_PORT = "the port must be a number from 1 to 65535, not "
#: Addresses, each with the beginning of why an iiwa has none such.
ADDRESSES = {
    "": "must be given, such as udpm://239.255.76.67:7699?ttl=0",
    "  ": "must be given, such as udpm://",
    "nonsense": "must begin with udpm://, not be 'nonsense'",
    "tcpq://10.0.0.1:7700": "must begin with udpm://, not be 'tcpq://10.0.0.1:7700'",
    "file:///dev/null": "must begin with udpm://, not be",
    "memq://": "'memq://' keeps messages within one process",
    "memq://x": "'memq://x' keeps messages within one process",
    "udpm://": f"{NO_GROUP}''",
    "udpm://nope": f"{NO_GROUP}'nope'",
    "udpm://nope:7699": f"{NO_GROUP}'nope'",
    "udpm://127.0.0.1:7699": f"{NO_GROUP}'127.0.0.1'",
    "udpm://[::1]:7699": f"{NO_GROUP}'[::1]'",
    "udpm://[ff02::1]:7699": f"{NO_GROUP}'[ff02::1]'",
    "udpm://239.255.076.67:7699": f"{NO_GROUP}'239.255.076.67'",
    "udpm://239.255.76.67 :7699": f"{NO_GROUP}'239.255.76.67 '",
    "udpm://239.255.76.67": f"{NO_PORT}''",
    "udpm://239.255.76.67:0": f"{NO_PORT}'0'",
    "udpm://239.255.76.67:-1": f"{NO_PORT}'-1'",
    "udpm://239.255.76.67:99999": f"{NO_PORT}'99999'",
    "udpm://239.255.76.67:77x9": f"{NO_PORT}'77x9'",
    "udpm://239.255.76.67:\N{ARABIC-INDIC DIGIT THREE}": NO_PORT,
    "udpm://239.255.76.67:7699#x": f"{NO_PORT}'7699#x'",
    "udpm://239.255.76.67:7699?ttl=abc": "ttl must be a number from 0 to 255, not 'abc'",
    "udpm://239.255.76.67:7699?ttl=256": "ttl must be a number from 0 to 255, not '256'",
    "udpm://239.255.76.67:7699?hops=1": "the options may be ttl and recv_buf_size, not 'hops'",
    "udpm://239.255.76.67:7699?": "'udpm://239.255.76.67:7699?' has no option behind its ?",
}


@each("address", ADDRESSES)
def test_an_address_that_lcm_would_take_for_another_is_refused(address):
    with pytest.raises(RobotError, match=rf"^--url: {re.escape(ADDRESSES[address])}"):
        address_of(IIWA, address)


def test_an_address_is_taken_as_it_is():
    for address in (IIWA.url, "udpm://224.0.0.1:1?ttl=255&recv_buf_size=100000"):
        assert address_of(IIWA, address) == address
    assert address_of(IIWA, None) == IIWA.url
    assert address_of(FR3, "172.16.0.2") == "172.16.0.2"


@pytest.mark.parametrize("address", ["udpm://239.255.76.67:7699", "172.16.0.2:1337", "a b", "/x"])
def test_an_fr3_is_at_a_name_alone(address):
    with pytest.raises(RobotError, match=r"^--url: must be the name or IP address of the fr3"):
        address_of(FR3, address)


def test_obstacles_that_move_are_not_told_to_a_robot():
    with pytest.raises(InvalidInputError, match=r"^obstacles: none may move"):
        driven_experiment("adaptive_moving_obstacle", IIWA)
