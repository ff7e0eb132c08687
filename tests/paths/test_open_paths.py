"""Paths that end elsewhere than they began."""

import numpy as np
import pytest
from path_helpers import assert_derivatives
from pydrake.common.eigen_geometry import AngleAxis

from drake_rnn import Circle, InvalidInputError, Line, Points, Spline
from drake_rnn.paths import PATHS
from row_helpers import each

TIMINGS = ["uniform", "sin2", "quintic", "cycloid", "ramps"]
BY = np.array([0.1, -0.2, 0.05])
ROW = [[0.1 * k, 0.0, 0.0] for k in range(6)]
BEND = [[0, 0, 0], [0.1, 0.05, 0], [0.2, 0, 0.05], [0.2, -0.1, 0.1], [0.1, -0.2, 0.1]]


def at_times(path, times):
    return np.array([path.evaluate(t)[0] for t in times])


@pytest.mark.parametrize("timing", TIMINGS)
def test_a_line_is_straight_and_rests_where_it_ends(timing):
    path = Line(by=BY, period=2.0, timing=timing)
    assert path.duration == path.traversal == 2.0
    assert not path.closed
    for p in at_times(path, np.linspace(0, 2, 21)):
        assert np.linalg.norm(np.cross(p, BY)) < 1e-15
    np.testing.assert_allclose(path.evaluate(1.0)[0], BY / 2, atol=1e-15)
    for t in (2.0, 2.0 - 1e-13, 2.3, 1e6):
        p, v, a = path.evaluate(t)
        np.testing.assert_allclose(p, BY, atol=1e-15)
        assert not v.any()
        assert not a.any()
    for t in (-1.0, -1e-13):
        assert not np.any(path.evaluate(t)[:2]) or t > -1e-12
    np.testing.assert_array_equal(path.knots(5.0), [0.0, 2.0])


@each("timing", TIMINGS)
@each(
    "path",
    [
        lambda **more: Line(by=BY, turn=[0.3, 0.4, 2.0], **more),
        lambda **more: Line(by=[0, 0, 0], turn=[0, 0, 1.0], **more),
        lambda **more: Spline(points=BEND, **more),
        lambda **more: Points(points=BEND, **more),
    ],
    ids=["line", "turn", "spline", "points"],
)
def test_velocity_and_acceleration_are_the_derivatives(path, timing):
    assert_derivatives(path(period=2.0, timing=timing))


def test_a_turn_follows_the_time_law_of_its_line():
    path = Line(by=BY, turn=[0, 0, 1.2], period=2.0, timing="quintic")
    for t in (0.0, 0.4, 1.0, 1.7, 2.0, 3.0):
        share = path.evaluate(t)[0] @ BY / (BY @ BY)
        R = AngleAxis(1.2 * share, [0, 0, 1]).rotation()
        np.testing.assert_allclose(path.evaluate_rotation(t)[0], R, atol=1e-14)
    assert not np.any(path.evaluate_rotation(2.5)[1:])


def test_a_line_to_a_point_ends_there_wherever_it_begins():
    path = Line(to=[0.5, 0.1, 0.4], period=2.0)
    for p_WE in ([0.3, 0.0, 0.6], [0.5, 0.5, 0.5]):
        placed = path.placed(np.array(p_WE))
        np.testing.assert_allclose(placed.position(0.0)[0], p_WE, atol=1e-15)
        np.testing.assert_allclose(placed.position(9.0)[0], [0.5, 0.1, 0.4], atol=1e-15)
    aside = Line(to=[0.5, 0.1, 0.4], period=2.0, offset=[0.1, 0, 0]).placed(np.array(p_WE))
    np.testing.assert_allclose(aside.position(0.0)[0], np.array(p_WE) - [0.1, 0, 0])
    np.testing.assert_allclose(aside.position(2.0)[0], [0.5, 0.1, 0.4], atol=1e-15)
    with pytest.raises(InvalidInputError, match="place the path first"):
        path.evaluate(0.5)


def test_six_points_in_a_row_lead_there_and_not_back():
    """They once were a loop there and back, without a word."""
    path = Points(points=ROW, period=5.0)
    np.testing.assert_allclose(path.evaluate(5.0)[0], [0.5, 0, 0], atol=1e-15)
    x = at_times(path, np.linspace(0, 5, 51))[:, 0]
    assert (np.diff(x) > 0).all()
    np.testing.assert_allclose(x, np.linspace(0, 0.5, 51), atol=1e-12)
    loop = Points(points=ROW, period=5.0, closed=True)
    assert np.linalg.norm(loop.evaluate(5.0 - 1e-9)[0]) < 1e-8


@pytest.mark.parametrize("kind", ["spline", "points"])
def test_a_spline_passes_its_points_and_ends_at_the_last(kind):
    path = PATHS[kind](points=BEND, period=4.0)
    way = np.cumsum([0, *np.linalg.norm(np.diff(BEND, axis=0), axis=1)])
    np.testing.assert_allclose(at_times(path, 4.0 * way / way[-1]), BEND, atol=1e-12)
    np.testing.assert_allclose(path.sample(9)[-1], BEND[-1], atol=1e-12)
    inner = 4.0 * way[1:-1] / way[-1]
    for t in inner:
        for before, after in zip(path.evaluate(t - 1e-9), path.evaluate(t + 1e-9), strict=True):
            np.testing.assert_allclose(before, after, atol=1e-7)


def test_two_points_are_a_line():
    spline, line = (
        Spline(points=[[1, 2, 3], np.add(BY, [1, 2, 3])], period=2.0),
        Line(by=BY, period=2.0),
    )
    times = np.linspace(0, 2.5, 21)
    np.testing.assert_allclose(at_times(spline, times), at_times(line, times), atol=1e-15)


def test_a_pause_follows_each_lap_but_the_last():
    path = Circle(size=0.1, period=2.0, timing="sin2", laps=3, pause=0.5)
    plain = Circle(size=0.1, period=2.0, timing="sin2")
    assert path.duration == 7.0
    for lap in range(3):
        begin = 2.5 * lap
        for t in (0.0, 0.3, 1.2, 1.999):
            for value, same in zip(path.evaluate(begin + t), plain.evaluate(t), strict=True):
                np.testing.assert_allclose(value, same, atol=1e-12)
        for t in (2.0, 2.2, 2.499):
            assert not np.any(path.evaluate(begin + t))
    np.testing.assert_allclose(path.knots(99.0), [0, 2, 2.5, 4.5, 5, 7])
    np.testing.assert_allclose(path.knots(3.0), [0, 2, 2.5])


def test_a_pause_without_end_goes_on():
    path = Circle(size=0.1, period=2.0, timing="quintic", pause=1.0)
    np.testing.assert_allclose(path.evaluate(300.7)[0], path.evaluate(0.7)[0], atol=1e-10)
    assert not np.any(path.evaluate(302.5))


@pytest.mark.parametrize(
    ("kind", "fields", "message"),
    [
        ("line", {}, "give either by or to"),
        ("line", {"by": [1, 0, 0], "to": [1, 0, 0]}, "give either by or to"),
        ("line", {"by": [0, 0, 0]}, "by: must not be zero without a turn"),
        ("line", {"by": [1, 0, 0], "laps": 2}, "laps: an open path is passed once"),
        ("line", {"by": [1, 0, 0], "pause": 1}, "pause: an open path is passed once"),
        ("circle", {"size": 0.1, "pause": 1}, "pause: needs a timing that comes to rest"),
        ("circle", {"size": 0.1, "pause": -1}, "pause: .*greater than or equal to 0"),
        ("spline", {"points": [[0, 0, 0]]}, "needs at least 2 points, not 1"),
        ("spline", {"points": []}, "needs at least 2 points, not 0"),
        ("spline", {"points": ROW, "closed": True}, "closed: no such key"),
        ("points", {"points": ROW, "laps": 3}, "laps: an open path is passed once"),
        ("points", {"points": ROW[:3], "closed": True}, "at least 4 distinct points, not 3"),
    ],
)
def test_what_an_open_path_cannot_be_is_refused(kind, fields, message):
    with pytest.raises(InvalidInputError, match=message):
        PATHS[kind](**{"period": 2.0, **fields})
