"""`drake-rnn shield`: what a recorded stream asks for, and what a guard makes of it."""

import json

import numpy as np
import pytest
from cli_helpers import call, sentence

from drake_rnn import JointLimits
from drake_rnn.diagrams import EXPERIMENTS
from drake_rnn.shield.report import report_stream
from drake_rnn.shield.report import rows_of as table_of

OPERATOR = EXPERIMENTS / "joint_stream" / "operator.csv"
BALL = "obstacles=[{kind: ball, center: [0.307, -0.24, 0.59], radius: 0.04, name: on the way}]"
LIMITS = "limits={velocity: 0.8, acceleration: 3.0, jerk: 60.0}"


def test_it_says_what_would_have_stopped_the_robot_and_commands_none_of_it(tmp_path):
    options = ("--set", LIMITS, "--set", BALL, "--set", "duration=5", "--period", "8e-3")
    pictures = ("--no-figures", "--no-playback")
    result = call("shield", OPERATOR, "--out", tmp_path, *options, *pictures)
    assert result.exit_code == 0, result.stderr
    assert "velocity, acceleration, jerk, contact would have stopped the robot" in result.stdout
    report = json.loads((tmp_path / "operator" / "stream.json").read_text())
    assert [use["is_broken"] for use in report["source"]] == [False, True, True, True]
    assert not any(use["is_broken"] for use in report["command"])
    assert report["source_nearest"]["distance"] < 0.0
    assert "on the way" in report["source_nearest"]["pair"]
    assert report["command_nearest"]["distance"] >= 0.005
    assert report["invalid"] > 0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["/nowhere.csv"], "FILE: no file '/nowhere.csv'"),
        ([OPERATOR, "--arm", "pandora"], "arm: no arm 'pandora'"),
        ([OPERATOR, "--arm", "ur5"], "targets: file "),
        ([OPERATOR, "--set", "limits.jerk=-1"], "limits.jerk: "),
    ],
)
def test_what_it_cannot_read_is_refused(arguments, text, tmp_path):
    assert sentence(call("shield", *arguments, "--out", tmp_path)).startswith(text)


def test_a_stream_is_judged_as_it_would_be_commanded():
    """A joint that jumps by 0.1 rad in 0.1 s needs 1 rad/s, and 10 rad/s^2 to begin with it."""
    limits = JointLimits(
        position_lower=[-1.0], position_upper=[1.0], velocity=[0.5], acceleration=[20.0]
    )
    t = 0.1 * np.arange(4)
    q = np.array([[0.0], [0.0], [0.1], [0.1]])
    rest = (np.array([0.0, 0.3]), np.zeros((2, 1)))
    report = report_stream((t, q), rest, np.zeros(1), limits)
    uses = {use.name: use for use in report.source}
    assert uses["velocity"].largest == pytest.approx(2.0)
    assert uses["velocity"].at == pytest.approx(0.15)
    assert uses["acceleration"].largest == pytest.approx(0.5)
    assert report.would_trip == ("velocity",)
    assert report.rate == pytest.approx(10.0)
    assert report.stopped == pytest.approx(0.3)


def test_an_arm_that_starts_outside_and_is_brought_back_breaks_no_limit():
    """One that goes farther outside first, or leaves again, does."""
    limits = JointLimits(position_lower=[-1.0], position_upper=[1.0], velocity=[0.5])
    t, target = 0.1 * np.arange(5), (np.zeros(1), np.zeros((1, 1)))
    for way, is_broken, largest in (
        ([1.1, 1.08, 1.05, 1.0, 0.97], False, 0.0),
        ([1.1, 1.12, 1.08, 1.04, 1.0], True, 0.02),
        ([1.1, 1.05, 0.99, 1.03, 1.0], True, 0.03),
    ):
        q = np.array(way)[:, None]
        report = report_stream(target, (t, q), q[0], limits)
        position = report.command[0]
        assert (position.name, position.is_broken) == ("position", is_broken)
        assert position.largest == pytest.approx(largest, abs=1e-9)
        assert report.outside == pytest.approx(0.1)
        (cell,) = (row[2] for row in table_of(report, ("a",)) if row[0] == "position")
        assert cell.startswith("kept") is not is_broken
    # A source that asks for what is outside is told so.
    outside = (np.zeros(1), np.full((1, 1), 1.1))
    report = report_stream(outside, (t, np.full((5, 1), 1.1)), np.full(1, 1.1), limits)
    assert "position" in report.would_trip
