"""Motions through waypoints, with times and orientations."""

import numpy as np
import pytest
from path_helpers import assert_derivatives
from pydrake.math import RollPitchYaw, RotationMatrix

from drake_rnn import InvalidInputError, Waypoints
from drake_rnn.robot.rotation import rotation_error
from row_helpers import each

RNG = np.random.default_rng(0)
POSITIONS = RNG.normal(size=(7, 3)) * 0.1
TIMES = np.cumsum([0.3, *RNG.uniform(0.5, 1.5, 6)])
RPY = RNG.normal(size=(7, 3)) * 0.5
QUATERNIONS = np.array([RollPitchYaw(*row).ToQuaternion().wxyz() for row in RPY])
KINDS = {
    "quintic": {},
    "cubic": {"through": "cubic"},
    "straight": {"through": "straight"},
    "blended": {"through": "straight", "blend_time": 0.2},
    "parabolic": {"through": "straight", "blend_time": 0.2, "blend": "parabolic"},
    "round": {"through": "straight", "blend_radius": 0.02},
}
EXACT = ["quintic", "cubic", "straight"]


def make(kind="quintic", **more):
    fields = {"positions": POSITIONS, "times": TIMES, **KINDS[kind], **more}
    return Waypoints(**{key: value for key, value in fields.items() if value is not None})


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_and_acceleration_are_the_derivatives(kind):
    assert_derivatives(make(kind, quaternions=QUATERNIONS))


@pytest.mark.parametrize("kind", EXACT)
def test_each_waypoint_is_passed_on_time_with_its_orientation(kind):
    path = make(kind, rpy=RPY)
    first = RotationMatrix(RollPitchYaw(*RPY[0])).matrix()
    for t, point, turn in zip(TIMES, POSITIONS, RPY, strict=True):
        np.testing.assert_allclose(path.evaluate(t)[0], point - POSITIONS[0], atol=1e-12)
        R = path.evaluate_rotation(t)[0] @ first
        np.testing.assert_allclose(R, RotationMatrix(RollPitchYaw(*turn)).matrix(), atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_it_runs_from_rest_to_rest_and_waits_before_and_after(kind):
    path = make(kind, quaternions=QUATERNIONS)
    assert path.duration == TIMES[-1]
    end = path.evaluate(TIMES[-1])[0]
    for t, place in ((0.0, np.zeros(3)), (0.29, np.zeros(3)), (TIMES[-1], end), (99.0, end)):
        p, v, a = path.evaluate(t)
        np.testing.assert_array_equal(p, place)
        assert not v.any()
        assert not a.any()
        assert not np.any(path.evaluate_rotation(t)[1:])
    for t in (TIMES[0] + 1e-7, TIMES[-1] - 1e-7):
        assert np.linalg.norm(path.evaluate(t)[1]) < 1e-5
        assert np.linalg.norm(path.evaluate_rotation(t)[1]) < 1e-5
        if kind not in {"cubic", "parabolic"}:
            assert np.linalg.norm(path.evaluate(t)[2]) < 1e-3


@pytest.mark.parametrize(
    ("kind", "orders"),
    [("quintic", 5), ("cubic", 3), ("straight", 3), ("blended", 3), ("parabolic", 2)],
)
def test_so_many_derivatives_are_continuous_at_the_inner_waypoints(kind, orders):
    trajectory = make(kind)._positions
    for t in TIMES[1:-1]:
        for order in range(orders):
            before, after = (trajectory.EvalDerivative(t + d, order) for d in (-1e-9, 1e-9))
            np.testing.assert_allclose(before, after, atol=1e-6)


def test_straight_legs_are_straight_and_rest_at_each_waypoint():
    path = make("straight")
    for k, t in enumerate(TIMES[:-1]):
        way = POSITIONS[k + 1] - POSITIONS[k]
        assert np.linalg.norm(path.evaluate(t + 1e-9)[1]) < 1e-12
        for share in (0.2, 0.5, 0.9):
            p = path.evaluate(t + share * (TIMES[k + 1] - t))[0] + POSITIONS[0] - POSITIONS[k]
            assert np.linalg.norm(np.cross(p, way)) < 1e-15


@pytest.mark.parametrize(("blend", "share"), [("parabolic", 1 / 8), ("quintic", 3 / 32)])
def test_a_blend_cuts_its_corner_by_what_the_formula_says(blend, share):
    path = make("blended", blend=blend)
    for k in range(2, 5):
        before, after = (path.evaluate(TIMES[k] + d)[1] for d in (-0.11, 0.11))
        missed = np.linalg.norm(path.evaluate(TIMES[k])[0] + POSITIONS[0] - POSITIONS[k])
        assert missed == pytest.approx(share * 0.2 * np.linalg.norm(after - before), rel=1e-9)


def test_a_parabolic_blend_has_a_constant_acceleration():
    path = make("parabolic")
    a = [path.evaluate(TIMES[3] + d)[2] for d in (-0.09, 0.0, 0.09)]
    np.testing.assert_allclose(a[0], a[1], atol=1e-12)
    np.testing.assert_allclose(a[0], a[2], atol=1e-12)
    assert np.linalg.norm(a[0]) > 0.1
    assert np.linalg.norm(path.evaluate(TIMES[3] + 0.11)[2]) < 1e-12


def test_a_blend_stays_within_its_radius():
    """Between the blends it is on the legs; the faster side of each begins at the radius."""
    path = make("round")
    ends = path.knots(99.0)
    for k in range(1, 6):
        near = [
            np.linalg.norm(path.evaluate(t)[0] + POSITIONS[0] - POSITIONS[k])
            for t in ends[np.argsort(abs(ends - TIMES[k]))[:2]]
        ]
        assert max(near) == pytest.approx(0.02, rel=1e-9)


def test_times_follow_from_a_speed_or_a_period():
    way = np.cumsum([0, *np.linalg.norm(np.diff(POSITIONS, axis=0), axis=1)])
    for given, times in (({"speed": 0.1}, way / 0.1), ({"period": 5.0}, 5.0 * way / way[-1])):
        path = make(times=None, **given)
        assert path.duration == pytest.approx(times[-1])
        for t, point in zip(times, POSITIONS, strict=True):
            np.testing.assert_allclose(path.evaluate(t)[0], point - POSITIONS[0], atol=1e-12)


def test_a_waypoint_may_only_turn():
    path = Waypoints(
        positions=[[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0]],
        times=[0, 1, 2],
        rpy=[[0, 0, 0], [0, 0, 0], [0, 0, 1]],
        through="straight",
    )
    np.testing.assert_allclose(path.evaluate(1.5)[0], [0.1, 0, 0], atol=1e-15)
    assert path.evaluate_rotation(1.5)[1][2] > 0.5


def test_orientations_turn_by_the_shorter_way_whatever_the_signs():
    signs = np.array([1, -1, 1, 1, -1, -1, 1])[:, None]
    one, other = make(quaternions=QUATERNIONS), make(quaternions=signs * QUATERNIONS)
    for t in np.linspace(TIMES[0], TIMES[-1], 31):
        np.testing.assert_allclose(
            one.evaluate_rotation(t)[0], other.evaluate_rotation(t)[0], atol=1e-12
        )


def test_two_orientations_are_joined_by_one_turn():
    """Between two of them the axis stays."""
    path = make(positions=POSITIONS[:2], times=[0, 2], rpy=[[0, 0, 0], [0.3, -0.2, 1.0]])
    whole = rotation_error(np.eye(3), path.evaluate_rotation(2.0)[0])
    for t in (0.3, 1.0, 1.6):
        part = rotation_error(np.eye(3), path.evaluate_rotation(t)[0])
        assert np.linalg.norm(np.cross(part, whole)) < 1e-12


@pytest.mark.parametrize("absolute", [False, True])
def test_waypoints_stay_where_they_are_or_are_moved_to_the_arm(absolute):
    path = make(quaternions=QUATERNIONS, absolute=absolute)
    p_WE, R_WE = np.array([0.3, 0.1, 0.6]), RotationMatrix(RollPitchYaw(0.3, 0.2, 0.1)).matrix()
    placed = path.placed(p_WE, R_WE)
    R = [RotationMatrix(RollPitchYaw(*turn)).matrix() for turn in RPY]
    start = (POSITIONS[0], R[0]) if absolute else (p_WE, R_WE)
    for t, point, orientation in zip(TIMES, POSITIONS, R, strict=True):
        np.testing.assert_allclose(
            placed.position(t)[0], start[0] + point - POSITIONS[0], atol=1e-12
        )
        np.testing.assert_allclose(
            placed.orientation(t)[0], orientation @ R[0].T @ start[1], atol=1e-12
        )
    if absolute:
        np.testing.assert_array_equal(path.placed().position(1.0)[0], placed.position(1.0)[0])


@each(
    ("fields", "message"),
    [
        ({"positions": None}, "give either a file or positions"),
        ({"positions": POSITIONS[:1], "times": [0]}, "needs at least 2 waypoints, not 1"),
        ({"positions": [[0, 0, 0], [1, 0]]}, "row 2: must be 3 numbers"),
        ({"positions": [[0, 0, 0], [1, 0, np.nan]]}, "row 2, column 3: nan is not a finite number"),
        ({"times": None}, "give one of times, period and speed"),
        ({"period": 3.0}, "give one of times, period and speed, no more"),
        ({"times": TIMES[:6]}, "times: must be 7, one for each waypoint, not 6"),
        ({"times": [0, 1, 2, 2, 3, 4, 5]}, "row 4: repeats the time 2 of the row before it"),
        ({"times": [0, 1, 2, 1.5, 3, 4, 5]}, "row 4: times must increase; 1.5 comes after 2"),
        ({"times": [-1, 1, 2, 2.5, 3, 4, 5]}, "row 1: the time must be 0 or more, not -1"),
        ({"times": [0, 1, 2, np.nan, 3, 4, 5]}, "times: .*none of them NaN"),
        ({"quaternions": QUATERNIONS[:6]}, "quaternions: must be 7, one for each waypoint, not 6"),
        (
            {"quaternions": 1.01 * QUATERNIONS},
            "row 1: a quaternion must have the length 1, not 1.01",
        ),
        ({"quaternions": QUATERNIONS[:, :3]}, "quaternions: .*rows of 4 finite numbers"),
        ({"quaternions": QUATERNIONS, "rpy": RPY}, "give either quaternions or rpy"),
        ({"rpy": [*RPY[:6], [0, 0, np.inf]]}, "rpy: .*rows of 3 finite numbers"),
        (
            {"rpy": [[0, 0, 0], [np.pi, 0, 0], *RPY[2:]]},
            "orientation 2: is half a turn from the one before",
        ),
        ({"blend_time": 0.1}, "blend_time: only with through: straight"),
        ({"blend": "quintic", "through": "straight"}, "blend: goes with a blend_time"),
        ({"through": "straight", "blend_time": 0.1, "blend_radius": 0.1}, "give either blend_time"),
        ({"through": "straight", "blend_time": 2.0}, "blend_time: the blends of leg . take"),
        ({"through": "straight", "blend_radius": 0.2}, "blend_radius: the blends of leg . take"),
        ({"through": "linear"}, "through: .*'quintic', 'cubic' or 'straight'"),
        ({"absolute": True, "offset": [0.1, 0, 0]}, "offset: cannot be combined with absolute"),
        (
            {"positions": [[0, 0, 0], [0, 0, 0]], "times": None, "speed": 1.0},
            "speed: gives row 2 no time",
        ),
    ],
)
def test_bad_waypoints_are_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        make(**fields)
    assert "\n" not in str(caught.value)


def test_rounding_of_a_quaternion_is_no_fault():
    path = make(quaternions=QUATERNIONS.round(4))
    R = path.placed(np.zeros(3), np.eye(3)).orientation(TIMES[3])[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)


def test_waypoints_that_all_but_coincide_in_time_are_refused():
    with pytest.raises(InvalidInputError, match=r"row 3: must be at least 0\.001 s after the row"):
        Waypoints(positions=[[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]], times=[0.0, 1.0, 1.0 + 1e-12])
