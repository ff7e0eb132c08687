"""Paths one after another, with and without bridges."""

import numpy as np
import pytest
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import Circle, InvalidInputError, Line, Part, Rest, Sequence, Waypoints
from drake_rnn.paths import PATHS

P_WE, R_WE = np.array([0.3, 0.1, 0.6]), np.diag([1.0, -1.0, -1.0])
AHEAD = P_WE + np.array([0.1, 0.0, 0.0])
THERE = Line(by=[0.1, 0, 0], period=2.0, timing="quintic")
TURN = Line(by=[0, 0.1, 0], turn=[0, 0, 0.5], period=1.0, timing="quintic")
ENDLESS = Circle(size=0.1, period=4.0)


def placed(*parts):
    return Sequence(parts=parts).placed(P_WE, R_WE)


def assert_smooth(path, times, orders=3):
    """Position, velocity and acceleration, also those of the orientation, do not jump."""
    for t in times:
        for motion in (path.position, path.orientation):
            before, after = motion(t - 1e-7), motion(t + 1e-7)
            for order in range(orders):
                np.testing.assert_allclose(after[order], before[order], atol=2e-5)


def assert_derivatives(path, times, h=1e-5):
    for t in times:
        before, now, after = (path.position(t + d) for d in (-h, 0.0, h))
        for order in (0, 1):
            secant = (after[order] - before[order]) / (2 * h)
            np.testing.assert_allclose(now[order + 1], secant, atol=1e-5)
        before, now, after = (path.orientation(t + d) for d in (-h, 0.0, h))
        spin = (after[0] - before[0]) / (2 * h) @ now[0].T
        w = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(now[1], w, atol=1e-6)
        np.testing.assert_allclose(now[2], (after[1] - before[1]) / (2 * h), atol=1e-5)


def test_each_part_begins_where_the_one_before_ends():
    path = placed(THERE, TURN, THERE)
    assert path.duration == path.traversal == 5.0
    for t, way in ((0, (0, 0)), (2, (0.1, 0)), (3, (0.1, 0.1)), (5, (0.2, 0.1)), (9, (0.2, 0.1))):
        np.testing.assert_allclose(path.position(t)[0] - P_WE, [*way, 0], atol=1e-12)
    np.testing.assert_array_equal(path.orientation(1.0)[0], R_WE)
    R = path.orientation(3.0)[0] @ R_WE.T
    np.testing.assert_allclose(R[0], [np.cos(0.5), -np.sin(0.5), 0], atol=1e-12)
    np.testing.assert_allclose(path.orientation(4.0)[0], path.orientation(3.0)[0], atol=1e-12)
    assert path.turns
    assert not path.closed
    np.testing.assert_allclose(path.knots(99.0), [0, 2, 3, 5])
    np.testing.assert_allclose(path.knots(2.5), [0, 2])


def test_there_and_back_is_closed():
    assert placed(THERE, Line(by=[-0.1, 0, 0], period=1.0, timing="sin2")).closed


def test_a_part_may_be_left_before_its_end_or_wait_after_it():
    path = placed(Part(path=THERE, lasts=3.0), Rest(laps=1), THERE)
    assert path.duration == 6.0
    np.testing.assert_allclose(path.position(3.5)[0] - P_WE, [0.1, 0, 0], atol=1e-12)
    left = Sequence(parts=[Part(path=ENDLESS, lasts=5.0), Part(path=THERE, bridge=1.0)])
    path = left.placed(P_WE, R_WE)
    assert path.duration == 8.0
    np.testing.assert_allclose(path.position(4.9)[0], P_WE + ENDLESS.evaluate(4.9)[0])


def test_a_bridge_joins_motions_up_to_the_acceleration():
    path = placed(
        Part(path=ENDLESS, bridge=1.0, lasts=2.5),
        Part(path=THERE, bridge=0.7),
        Part(path=Circle(size=0.05, period=3.0, plane="xz"), bridge=0.5),
    )
    joints = [1.0, 3.5, 4.2, 6.2, 6.7]
    assert_smooth(path, joints)
    assert_smooth(path, [1e-6], orders=2)
    assert_derivatives(path, np.arange(0.05, 9.0, 0.117))
    assert path.duration == np.inf
    assert path.traversal == pytest.approx(6.7 + 3.0)
    np.testing.assert_allclose(path.knots(5.0), [0, 1.0, 3.5, 4.2])


def test_a_bridge_without_turning_runs_straight_on():
    """From v to w in b seconds it leads b (v + w) / 2 further: no loop back to where it began."""
    path = placed(
        Part(path=Line(by=[0.4, 0, 0], period=4.0), lasts=2.0),
        Part(path=Line(by=[0.6, 0, 0], period=3.0), bridge=1.0),
    )
    x = np.array([path.position(t)[0][0] for t in np.linspace(0, 6, 301)])
    assert (np.diff(x) > 0).all()
    assert path.position(3.0)[0][0] - path.position(2.0)[0][0] == pytest.approx(0.15)


def test_orientations_are_bridged_too():
    turning = Line(by=[0.1, 0, 0], turn=[0.3, 0.4, 1.0], period=2.0)
    other = Waypoints(
        positions=[[0.5, 0, 0.5], [0.5, 0.1, 0.5]],
        times=[0, 1],
        rpy=[[2.0, 0.3, 1.5], [2.5, 0.3, 1.5]],
        absolute=True,
    )
    path = placed(Part(path=turning, lasts=1.2), Part(path=other, bridge=0.8))
    assert_smooth(path, [1.2, 2.0])
    assert_derivatives(path, np.arange(0.05, 3.0, 0.117))
    np.testing.assert_allclose(path.position(2.0)[0], [0.5, 0, 0.5], atol=1e-12)


def test_the_frame_of_the_tool_is_the_one_that_is_desired_when_the_part_begins():
    quarter = Line(by=[0.1, 0, 0], turn=[0, 0, np.pi / 2], period=1.0, timing="quintic")
    onward = Line(by=[0.1, 0, 0], period=1.0, timing="quintic", frame="tool")
    path = placed(quarter, onward)
    # The tool's x-axis was the base's, and is its y-axis after the quarter turn.
    np.testing.assert_allclose(path.position(2.0)[0] - P_WE, [0.1, 0.1, 0], atol=1e-12)


def test_a_sequence_may_be_a_part():
    inner = Sequence(parts=[THERE, TURN])
    one, other = placed(inner, THERE), placed(THERE, TURN, THERE)
    for t in np.linspace(0, 6, 25):
        np.testing.assert_allclose(one.position(t), other.position(t), atol=1e-12)


def test_a_trajectory_of_drakes_may_be_a_part():
    points = np.column_stack([P_WE, AHEAD])
    there = PiecewisePolynomial.CubicShapePreserving([0.0, 2.0], points, True)
    path = placed(there, TURN)
    np.testing.assert_allclose(path.position(3.0)[0] - P_WE, [0.1, 0.1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            [Part(path=ENDLESS, lasts=1.0), THERE],
            "path.parts.1: begins 0.157 m/s from what is desired just before; give .* a bridge",
        ),
        (
            [THERE, Circle(size=0.1, period=4.0, centre=[0.5, 0.1, 0.6], timing="sin2")],
            "path.parts.1: begins 0.2 m from what is desired just before",
        ),
        (
            [THERE, Circle(size=0.1, period=4.0, offset=[0.02, 0, 0], timing="sin2")],
            "path.parts.1: begins 0.02 m from what is desired just before",
        ),
        ([THERE, Line(by=[0.1, 0, 0], period=2.0)], "path.parts.1: begins 0.05 m/s from"),
        ([ENDLESS, THERE], "path.parts.0: has no end; give it lasts, or laps to its path"),
    ],
)
def test_parts_that_do_not_meet_are_refused(parts, message):
    path = Sequence(parts=parts)
    with pytest.raises(InvalidInputError, match=message):
        path.placed(P_WE, R_WE)


def test_orientations_that_do_not_meet_are_refused():
    other = Waypoints(
        positions=[P_WE, AHEAD],
        times=[0, 1],
        rpy=[[0, 0, 0], [0, 0, 1]],
        absolute=True,
    )
    with pytest.raises(InvalidInputError, match=r"begins 0\.1 m and 3\.14 rad from what"):
        placed(THERE, other)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "parts: must be given"),
        ({"parts": []}, "parts: must be a list of one part or more"),
        ({"parts": [3]}, "parts"),
        ({"parts": [THERE], "bridge": 1}, "bridge: no such key"),
    ],
)
def test_bad_parts_are_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        PATHS["sequence"](**fields)
    for wrong, key in (
        ({"path": 3}, "path: must be a path"),
        ({"path": THERE, "lasts": 0}, "lasts"),
    ):
        with pytest.raises(InvalidInputError, match=key):
            Part(**wrong)
