"""Runs along paths that turn the end effector: laws that see the orientation follow it."""

import numpy as np
import pytest

from drake_rnn import (
    PATHS,
    Circle,
    InvalidInputError,
    load_experiment,
    make_experiment,
    simulate,
    validated,
)
from drake_rnn.figures import drawable
from drake_rnn.robot.rotation import rotation_error


@validated
class Nodding(Circle):
    """A circle along which the end effector turns about an axis by ``tilt`` and back."""

    tilt: float = 0.3
    axis: int = 0

    @property
    def turns(self):
        return True

    def evaluate_rotation(self, t):
        rate = 2.0 * np.pi / self.period
        moves = 0.0 <= t <= self.duration
        angle, speed, growth = (
            moves
            * 0.5
            * self.tilt
            * np.array(
                (1.0 - np.cos(rate * t), np.sin(rate * t) * rate, np.cos(rate * t) * rate**2)
            )
        )
        a, b = (self.axis + 1) % 3, (self.axis + 2) % 3
        R, along = np.eye(3), np.eye(3)[self.axis]
        R[[a, a, b, b], [a, b, a, b]] = (
            np.cos(angle),
            -np.sin(angle),
            np.sin(angle),
            np.cos(angle),
        )
        return R, speed * along, growth * along


@pytest.fixture(autouse=True)
def named(monkeypatch):
    monkeypatch.setitem(PATHS, "nodding", Nodding)


PATH = {"kind": "nodding", "size": 0.03, "period": 4.0, "plane": "yz"}


def document(arm="panda", **changes):
    contents = {
        "arm": arm,
        "task": "pose",
        "path": PATH,
        "law": {"kind": "pseudoinverse"},
        "period": 1e-3,
        "duration": 2.5,
        # Away from the start, where a path of constant speed begins with a jump.
        "window": [0.5, 2.5],
        "start": [0.0, -1.9, -1.8, -1.0, 1.57, 0.0] if arm == "ur5" else None,
        **changes,
    }
    return {key: value for key, value in contents.items() if value is not None}


def newton(kinematics, q, p_WE, R_WE):
    """Return the posture of a six-joint arm next to ``q`` that has the pose, to 1e-12."""
    for _ in range(30):
        error = np.concatenate(
            (rotation_error(kinematics.R_WE(q), R_WE), p_WE - kinematics.p_WE(q))
        )
        if np.abs(error).max() < 1e-12:
            return q
        q = q + np.linalg.solve(np.vstack((kinematics.J_omega(q), kinematics.J(q))), error)
    raise AssertionError("no posture found")


def test_six_joints_have_no_choice():
    """The joint angles against inverse kinematics solved to 1e-12 at every sample.

    5e-6 rad: the pose is 3e-6 off at most, of second order in the period; J is well conditioned.
    """
    experiment = make_experiment(document("ur5"))
    result = simulate(experiment)
    kinematics, q = experiment.arm.kinematics(), experiment.start
    off = []
    for t, reached in zip(result.time.tolist(), result.series["position"], strict=True):
        p, R = experiment.desired.position(t)[0], experiment.desired.orientation(t)[0]
        q = newton(kinematics, q, p, R)
        off.append(np.abs(reached - q).max())
    assert max(off) < 5e-6


@pytest.mark.parametrize("arm", ["panda", "iiwa14", "ur5"])
def test_position_and_orientation_are_followed(arm):
    """The secant meets the poses but for what J turns within a sample; a lag would be 0.02 rad."""
    found = simulate(make_experiment(document(arm))).metrics
    assert found["position_error_max_m"] < 7.5e-7
    assert 1e-6 < found["orientation_error_max_rad"] < 5e-6
    assert found["orientation_error_rms_rad"] < found["orientation_error_max_rad"]


@pytest.mark.long
def test_the_error_falls_with_the_period():
    error = {}
    for period in (1e-3, 2e-3):
        found = simulate(make_experiment(document(period=period))).metrics
        error[period] = found["orientation_error_max_rad"]
    assert error[2e-3] == pytest.approx(2.0 * error[1e-3], rel=0.1)


def test_without_feed_forward_it_lags():
    """By the angular speed over the gain: 0.15 rad * 2 pi / 4 s / 10 / s at the fastest."""
    law = {"kind": "pseudoinverse", "feed_forward": False}
    found = simulate(make_experiment(document(law=law))).metrics
    assert found["orientation_error_max_rad"] == pytest.approx(0.15 * np.pi / 2 / 10, rel=0.05)


@pytest.mark.long
def test_with_full_dynamics_it_follows_by_a_sample():
    """At most 0.24 rad/s and 0.05 m/s, a sample of 1 ms late; bounds 1.5 times what is measured."""
    found = simulate(make_experiment(document(level="dynamic"))).metrics
    assert found["position_error_max_m"] < 7e-5
    assert found["orientation_error_max_rad"] < 3.5e-4


@pytest.mark.long
def test_a_tool_that_presses_turns_about_the_normal():
    """The feed-forward of motion-force control; without it the lag would be 0.025 rad.

    The network itself lags by its time constant, 1 ms, at 0.03 m/s and 0.24 rad/s: 63 urad and
    0.11 mm. The bounds are 1.5 times that.
    """
    path = {"kind": "nodding", "size": 0.02, "period": 4.0, "axis": 2, "tilt": 0.3}
    changes = {"path": path, "duration": 2.5, "window": [1.0, 2.5], "accept": None}
    experiment = load_experiment("motion_force_tricuspid", changes)
    assert np.abs(experiment.contact.surface.normal_W) == pytest.approx([0, 0, 1])
    found = simulate(experiment).metrics
    assert found["orientation_error_max_rad"] < 1e-4
    assert found["lateral_error_max_m"] < 1.7e-4
    assert found["force_error_max_N"] < 9e-4


def test_the_printed_rows_can_only_hold_an_orientation():
    changes = {"path": {"kind": "nodding", "size": 0.02, "period": 4.0}, "accept": None}
    with pytest.raises(InvalidInputError, match=r"^law\.orientation: must be rotation for a path"):
        load_experiment("motion_force_tricuspid_w", changes)


def test_an_orientation_that_the_law_does_not_see_is_refused():
    with pytest.raises(InvalidInputError, match=r"^path: carries an orientation, which this"):
        make_experiment(document(task="xyz"))


def test_it_has_a_figure():
    result = simulate(make_experiment(document(duration=0.5, window=None)))
    assert "orientation_error" in drawable(result)
    free = document(task="xyz", path={"kind": "circle", "size": 0.03, "period": 4.0}, window=None)
    assert "orientation_error" not in drawable(simulate(make_experiment({**free, "duration": 0.5})))
