import numpy as np
import pytest

from drake_rnn import Circle
from drake_rnn.live.hands import Course, HandledPath, ShapedPoint

STEP = 0.02


def circle():
    return Circle(size=0.05, period=4.0).placed(np.array([0.4, 0.0, 0.5]))


def test_what_was_written_never_changes_and_joins_without_a_jump():
    rng, course = np.random.default_rng(0), Course(np.zeros(2))
    seen = []
    for k in range(50):
        course.go_on((k + 1) * STEP, rng.normal(size=2))
        seen.append(course.at((k + 0.5) * STEP))
        p, v, _ = course.at((k + 1) * STEP - 1e-12)
        p_after, v_after, _ = course.at((k + 1) * STEP)
        assert np.allclose(p, p_after, atol=1e-11)
        assert np.allclose(v, v_after, atol=1e-9)
    for k, known in enumerate(seen):
        assert all(map(np.array_equal, known, course.at((k + 0.5) * STEP)))


def test_a_shaped_point_keeps_its_bounds_and_stops_where_it_is_wished():
    rng, point = np.random.default_rng(1), ShapedPoint(np.zeros(3), 0.25, 1.0)
    speeds, accelerations = [], []
    for k in range(3000):
        if k % 37 == 0 and k < 2700:
            point.wish = rng.uniform(-0.5, 0.5, 3)
        point.go_on((k + 1) * STEP)
        _, v, a = point.course.at((k + 1) * STEP)
        speeds.append(np.linalg.norm(v))
        accelerations.append(np.linalg.norm(a))
    assert max(speeds) <= 0.25 * (1.0 + 1e-12)
    assert max(accelerations) <= 1.0 + 1e-12
    p, v, _ = point.course.at(3000 * STEP)
    assert np.allclose(p, point.wish, atol=1e-12)
    assert np.allclose(v, 0.0, atol=1e-12)


def test_untouched_it_is_the_path_to_the_last_bit():
    own = circle()
    path = HandledPath(own, 0.25, 1.0)
    for k in range(100):
        path.go_on((k + 1) * STEP)
    for t in (0.0, 0.3, 1.234):
        assert all(map(np.array_equal, path.position(t), own.position(t)))


def test_held_it_leaves_its_path_smoothly_and_comes_back_to_it():
    own = circle()
    path = HandledPath(own, 0.25, 1.0)
    for k in range(1000):
        if k == 50:
            path.hold(np.array([0.5, 0.2, 0.4]))
        if k == 300:
            assert np.allclose(path.position(path.until)[0], [0.5, 0.2, 0.4], atol=1e-9)
            path.follow()
        path.go_on((k + 1) * STEP)
    times = np.arange(0.0, 20.0, 1e-3)
    p, v, _ = (np.array(each) for each in zip(*map(path.position, times), strict=True))
    # The velocity is the derivative of the position, and never jumps.
    assert np.abs(np.diff(p, axis=0) / 1e-3 - 0.5 * (v[1:] + v[:-1])).max() < 1e-5
    assert np.linalg.norm(np.diff(v, axis=0), axis=1).max() / 1e-3 < 1.0 + 0.6
    # The same path, later.
    away = [np.linalg.norm(own.position(s)[0] - p[-1]) for s in np.arange(0.0, 4.0, 1e-3)]
    assert min(away) < 1e-4


def test_by_turns_it_is_never_faster_than_its_path_or_the_hand():
    own = circle()
    peak = max(np.linalg.norm(own.position(t)[1]) for t in np.arange(0.0, 4.0, 0.01))
    path = HandledPath(own, 0.9 * peak, 2.0, by_turns=True)
    rng = np.random.default_rng(2)
    for k in range(2000):
        if k % 60 == 0:
            path.hold(rng.uniform(-0.5, 0.5, 3)) if rng.random() < 0.6 else path.follow()
        path.go_on((k + 1) * STEP)
    speeds = [np.linalg.norm(path.position(t)[1]) for t in np.arange(0.0, 40.0, 0.005)]
    assert max(speeds) <= peak * (1.0 + 1e-9)


def test_what_is_forgotten_was_long_before():
    path = HandledPath(circle(), 0.25, 1.0)
    rng = np.random.default_rng(3)
    for k in range(1000):
        path.hold(rng.uniform(-0.5, 0.5, 3))
        path.go_on((k + 1) * STEP)
    known = path.position(19.5)[0]
    path.forget(19.0)
    assert np.array_equal(path.position(19.5)[0], known)
    assert path.position(20.0)[0] == pytest.approx(path.position(path.until)[0])
