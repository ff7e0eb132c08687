"""Whether motors follow their command, and what a run says where they do not."""

import re

import numpy as np
import pytest

from drake_rnn import make_experiment, simulate

CIRCLE = {"kind": "circle", "size": 0.03, "period": 2.0, "timing": "sin2", "laps": 1}
LAWS = {
    "pseudoinverse": {"kind": "pseudoinverse"},
    "recursive": {"kind": "recursive", "gains": [300.0]},
    "simultaneous_learning": {"kind": "simultaneous_learning", "jacobian": "known"},
}
#: Those of every motor before they followed from the inertia.
EQUAL = {"stiffness": 2000.0, "damping": 60.0}


def run(law, level="dynamic", **changes):
    document = {
        "arm": "planar6",
        "task": "xy",
        "path": CIRCLE,
        "law": LAWS[law],
        "limits": {"acceleration": 2.0},
        "level": level,
        "period": 1e-3,
        "duration": 2.0,
    }
    return simulate(make_experiment({**document, **changes}))


def motor_warnings(result):
    return [warning for warning in result.warnings if warning.startswith("plant: ")]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.long
def test_an_arm_with_a_heavy_base_follows_as_it_does_without_mass(law):
    """0.3 mm: a sample of delay and the motors' lag, at up to 0.19 m/s."""
    dynamic, kinematic = (
        run(law, level).metrics["position_error_max_m"] for level in ("dynamic", "kinematic")
    )
    assert abs(dynamic - kinematic) < 3e-4


def test_motors_too_weak_for_the_arm_are_told_of():
    """The arm swings about a command that itself leaves the path, and farther and farther."""
    result = run("pseudoinverse", plant=EQUAL)
    (warning,) = motor_warnings(result)
    found = re.fullmatch(
        r"plant: the arm is far from its command: joint1 by up to (\S+) rad, at t = (\S+) s, and "
        r"the end effector by up to (\S+) m; leave out plant\.stiffness and plant\.damping, which "
        r"then follow from the arm's inertia",
        warning,
    )
    off, when, away = map(float, found.groups())
    assert off == pytest.approx(result.metrics["command_error_max_rad"], rel=0.01)
    assert away == pytest.approx(result.metrics["command_error_max_m"], rel=0.01)
    assert away > 0.02
    assert 1.0 < when <= 2.0


@pytest.mark.long
def test_motors_that_follow_are_not_warned_of():
    result = run("pseudoinverse")
    assert motor_warnings(result) == []
    assert result.metrics["command_error_max_m"] < 5e-4
    assert result.metrics["command_error_max_rad"] < 1e-3


def test_an_ideal_arm_has_no_motors():
    result = run("pseudoinverse", "kinematic")
    assert not [name for name in result.metrics if name.startswith("command_error")]


def test_a_path_too_fast_for_the_motors_is_told_of():
    """At up to 2.5 m/s, which joint 1 of 38 kg m^2 does not reach in half a second."""
    fast = {**CIRCLE, "size": 0.2, "period": 1.0}
    (warning,) = motor_warnings(run("pseudoinverse", path=fast, duration=0.5))
    assert re.search(r"more than its motor, of at most 200 Nm, can do; a slower path", warning)


def test_soft_motors_are_told_of_their_bandwidth():
    jump = {**CIRCLE, "timing": "uniform"}
    result = run("pseudoinverse", path=jump, duration=0.3, plant={"bandwidth": 3.0})
    (warning,) = motor_warnings(result)
    assert "; give a higher plant.bandwidth, or lower gains of the law" in warning


def test_gains_for_each_motor_are_those_for_all():
    one, each = (
        run("pseudoinverse", duration=0.2, plant={"stiffness": stiffness, "damping": 2e3})
        for stiffness in (2e4, [2e4] * 6)
    )
    np.testing.assert_array_equal(one.series["position"], each.series["position"])
    assert "stiffness: 20000.0" in one.experiment.document.to_yaml()
