"""Joint targets as they came, and where they have the tool."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.paths import JointTargets, RecordedTargets, TargetPath

TIMES = np.array([0.05, 0.1, 0.2])
TARGETS = JointTargets(TIMES, np.array([[0.1, 0.2], [np.nan, 0.3], [0.3, 0.4]]))
START = np.zeros(2)


def test_the_newest_target_is_followed_and_one_without_a_number_is_not():
    goals = TARGETS.goals(np.array([0.0, 0.05, 0.1, 0.19, 0.2, 9.0]), START)
    assert goals.tolist() == [[0, 0], [0.1, 0.2], [0.1, 0.2], [0.1, 0.2], [0.3, 0.4], [0.3, 0.4]]
    assert TARGETS.newest(np.array([0.0, 0.1])).tolist() == [-1, 1]


@pytest.mark.parametrize("count", [10, 333, 4567])
def test_a_time_that_is_a_sum_of_periods_is_the_time(count):
    """In floating point a sum of periods is not the product, and either may come out below."""
    period = 1e-3
    summed = sum([period] * count)
    targets = JointTargets(np.array([count * period]), np.zeros((1, 2)))
    assert targets.newest(np.array([summed, summed - 0.5 * period])).tolist() == [0, -1]


@pytest.mark.parametrize(
    ("names", "order"), [("t,q1,q2", (1, 2)), ("time,elbow,hip", (2, 1)), ("", (1, 2))]
)
def test_a_file_may_name_its_joints_in_any_order(tmp_path, names, order):
    file = tmp_path / "targets.csv"
    file.write_text(f"{names}\n0.5,1,2\n")
    found = RecordedTargets(file=str(file)).of_arm(["hip", "elbow"])
    assert found.time.tolist() == [0.5]
    assert found.position.tolist() == [list(order)]


def test_the_path_is_where_the_newest_target_has_the_tool():
    arm = load_arm("panda")
    home = np.asarray(arm.home)
    kinematics = arm.kinematics()
    postures = home + np.array([[0.1], [np.nan], [0.2]])
    placed = TargetPath(JointTargets(TIMES, postures)).placed_on(arm, home)
    for t, q in ((0.0, home), (0.06, postures[0]), (0.15, postures[0]), (5.0, postures[2])):
        p, v, a = placed.position(t)
        assert p == pytest.approx(kinematics.p_WE(q), abs=1e-15)
        assert not np.any((v, a))
    assert placed.duration == 0.2
    assert not placed.closed
    assert placed.knots(1.0).tolist() == [0.0, *TIMES]
    with pytest.raises(InvalidInputError, match="placed by an arm"):
        TargetPath(TARGETS).placed(np.zeros(3))
    with pytest.raises(InvalidInputError, match="t: must be finite"):
        placed.position(np.nan)
