"""Drake's own trajectories as paths."""

import numpy as np
import pytest
from path_helpers import assert_derivatives
from pydrake.math import BsplineBasis, RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.trajectories import (
    BsplineTrajectory,
    FunctionHandleTrajectory,
    PiecewisePolynomial,
    PiecewisePose,
    PiecewiseQuaternionSlerp,
    StackedTrajectory,
)

from drake_rnn import InvalidInputError, PathSource, TrajectoryPath

TIMES = [0.5, 1.5, 2.0, 4.0]
POINTS = np.array([[0.3, 0, 0.5], [0.4, 0.1, 0.5], [0.4, 0.2, 0.6], [0.3, 0.1, 0.7]])
TURNS = [RotationMatrix(RollPitchYaw(*row)) for row in np.diag([0.4, 0.3, 0.6])]
TURNS = [RotationMatrix(RollPitchYaw(0.1, 0.2, 0.3)), *TURNS]
CUBIC = PiecewisePolynomial.CubicShapePreserving(TIMES, POINTS.T, True)
SLERP = PiecewiseQuaternionSlerp(TIMES, TURNS)
POSE = PiecewisePose.MakeLinear(
    TIMES, [RigidTransform(R, p) for R, p in zip(TURNS, POINTS, strict=True)]
)
SPLINE = BsplineTrajectory(
    BsplineBasis(4, 7, initial_parameter_value=0.0, final_parameter_value=2.0),
    [np.array([[np.cos(k)], [np.sin(2 * k)], [0.1 * k]]) for k in range(7)],
)
STACKED = StackedTrajectory(True)
for row in range(3):
    STACKED.Append(PiecewisePolynomial.CubicShapePreserving(TIMES, POINTS.T[row : row + 1], True))
QUATERNIONS = PiecewisePolynomial.CubicShapePreserving(
    TIMES, 1.3 * np.column_stack([R.ToQuaternion().wxyz() for R in TURNS]), True
)


@pytest.mark.parametrize(
    "fields",
    [
        {"trajectory": CUBIC},
        {"trajectory": SPLINE},
        {"trajectory": STACKED},
        {"trajectory": POSE},
        {"trajectory": CUBIC, "orientation": SLERP},
        {"trajectory": CUBIC, "orientation": QUATERNIONS},
    ],
    ids=["polynomial", "b-spline", "stacked", "pose", "slerp", "quaternions"],
)
def test_velocity_and_acceleration_are_the_derivatives(fields):
    assert_derivatives(TrajectoryPath(**fields))


@pytest.mark.parametrize("trajectory", [CUBIC, STACKED, POSE])
def test_it_is_at_the_trajectorys_value_at_its_time(trajectory):
    placed = TrajectoryPath(trajectory=trajectory).placed()
    for t, point in zip(TIMES, POINTS, strict=True):
        np.testing.assert_allclose(placed.position(t)[0], point, atol=1e-15)
    for t, edge in ((0.0, 0), (0.3, 0), (4.0, -1), (9.0, -1)):
        np.testing.assert_allclose(placed.position(t)[0], POINTS[edge], atol=1e-15)
        assert not np.any(placed.position(t)[1:])
    assert placed.duration == 4.0
    assert not placed.closed


def test_a_pose_gives_orientation_angular_velocity_and_none_of_its_own_elsewhere():
    placed = TrajectoryPath(trajectory=POSE).placed()
    assert placed.turns
    for t in (0.6, 1.7, 3.3):
        R, w, alpha = placed.orientation(t)
        np.testing.assert_allclose(R, POSE.GetPose(t).rotation().matrix(), atol=1e-14)
        np.testing.assert_allclose(w, POSE.GetVelocity(t)[:3], atol=1e-14)
        assert not alpha.any()
    for t in (0.2, 4.0):
        assert not np.any(placed.orientation(t)[1:])
    plain = TrajectoryPath(trajectory=CUBIC)
    assert not plain.turns
    np.testing.assert_array_equal(plain.placed(R_WE=np.eye(3)).orientation(2.0)[0], np.eye(3))


def test_moved_to_the_arm_it_begins_with_its_pose():
    p_WE, R_WE = np.array([1.0, 2.0, 3.0]), TURNS[2].matrix()
    placed = TrajectoryPath(trajectory=POSE, absolute=False).placed(p_WE, R_WE)
    np.testing.assert_allclose(placed.position(0.0)[0], p_WE)
    np.testing.assert_allclose(placed.position(4.0)[0], p_WE + POINTS[-1] - POINTS[0])
    np.testing.assert_allclose(placed.orientation(0.0)[0], R_WE, atol=1e-14)
    turned = (TURNS[-1] @ TURNS[0].inverse()).matrix()
    np.testing.assert_allclose(placed.orientation(4.0)[0], turned @ R_WE, atol=1e-14)


def test_its_breaks_are_knots():
    np.testing.assert_array_equal(TrajectoryPath(trajectory=CUBIC).knots(9), [0, *TIMES])
    np.testing.assert_array_equal(TrajectoryPath(trajectory=CUBIC).knots(1.7), [0, 0.5, 1.5])
    np.testing.assert_allclose(TrajectoryPath(trajectory=SPLINE).knots(9), [0, 0.5, 1, 1.5, 2])


def test_a_source_takes_it_as_it_is():
    source = PathSource(POSE, preview=0.1)
    context = source.CreateDefaultContext()
    context.SetTime(1.7)
    pose, later = POSE.GetPose(1.7), POSE.GetPose(1.8)
    value = {
        name: source.GetOutputPort(name).Eval(context)
        for name in (
            "p_WE_desired",
            "R_WE_desired",
            "w_WE_desired",
            "alpha_WE_desired",
            "p_preview",
            "R_preview",
        )
    }
    np.testing.assert_allclose(value["p_WE_desired"], pose.translation(), atol=1e-15)
    np.testing.assert_allclose(value["R_WE_desired"], pose.rotation().matrix().ravel(), atol=1e-14)
    np.testing.assert_allclose(value["w_WE_desired"], POSE.GetVelocity(1.7)[:3], atol=1e-14)
    np.testing.assert_array_equal(value["alpha_WE_desired"], np.zeros(3))
    np.testing.assert_allclose(value["p_preview"], later.translation(), atol=1e-15)
    np.testing.assert_allclose(value["R_preview"], later.rotation().matrix().ravel(), atol=1e-14)


def wide(rows, columns):
    return PiecewisePolynomial.FirstOrderHold(TIMES, [np.zeros((rows, columns))] * 4)


HANDLE = FunctionHandleTrajectory(lambda t: np.full((3, 1), t), 3, 1, 0.0, 1.0)
EARLY = PiecewisePolynomial.CubicShapePreserving([-1.0, 0.0, 1.0], POINTS[:3].T, True)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"trajectory": wide(2, 1)}, "trajectory: must have 3 rows and 1 column, not 2 and 1"),
        ({"trajectory": wide(3, 2)}, "trajectory: must have 3 rows and 1 column, not 3 and 2"),
        ({"trajectory": SLERP}, "trajectory: must have 3 rows and 1 column, not 4 and 1"),
        ({"trajectory": PiecewisePolynomial()}, "trajectory: this PiecewisePolynomial cannot be"),
        ({"trajectory": HANDLE}, "trajectory: a FunctionHandleTrajectory has no derivatives"),
        ({"trajectory": EARLY}, "trajectory: must begin at 0 s or later .* from -1 to 1 s"),
        ({"trajectory": 3.0}, "trajectory: .*instance of Trajectory"),
        ({"trajectory": CUBIC, "orientation": CUBIC}, "orientation: must have 4 rows and 1 column"),
        (
            {"trajectory": SPLINE, "orientation": SLERP},
            r"orientation: must begin and end with the trajectory, at \(0.0, 2.0\) s",
        ),
        ({"trajectory": POSE, "orientation": SLERP}, "orientation: a PiecewisePose has its own"),
        ({"trajectory": CUBIC, "offset": [0.1, 0, 0]}, "offset: cannot be combined with absolute"),
    ],
)
def test_a_trajectory_that_is_no_path_is_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        TrajectoryPath(**fields)
    assert "\n" not in str(caught.value)
