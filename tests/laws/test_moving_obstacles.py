"""Obstacles that move: whatever they do, an arm has come to rest before they touch it."""

import numpy as np
import pytest

from drake_rnn import Avoidance, Guard, InvalidInputError, JointStream, load_arm, make_obstacles
from drake_rnn.laws.parts.obstacle_tracks import Places
from drake_rnn.laws.parts.world import World
from drake_rnn.robot.clearance.arm_clearance import arm_clearance

PANDA = load_arm("panda")
HOME = np.asarray(PANDA.home)
PERIOD, SPEED, ERROR = 5e-3, 0.4, 0.004
FLOOR = Avoidance().floor
CENTER = np.array([0.75, 0.25, 0.5])
BALL = {"kind": "ball", "center": CENTER.tolist(), "radius": 0.05, "speed": SPEED, "error": ERROR}


def guarded(jerk=None, **ball):
    clearance, _ = arm_clearance(PANDA, make_obstacles([{**BALL, **ball}]), HOME)
    limits = PANDA.limits.replace(velocity=0.8, acceleration=3.0, jerk=jerk)
    return clearance, Guard(JointStream(limits=limits, home=HOME, clearance=clearance), PERIOD)


def chased(jerk, seed, speed=SPEED, counted=SPEED, samples=400):
    """The least distances while the arm moves, of a ball that changes its mind and hunts its tool.

    The arm is told to swing to and fro; the ball waits, and goes at the flange at full speed from
    random times on for a random while.
    """
    rng = np.random.default_rng(seed)
    clearance, guard = guarded(jerk, speed=counted)
    place, goes, least = np.zeros(3), 0, []
    q = guard.position
    for k in range(samples):
        aim = HOME + np.array([0.5, 0.3, 0, 0.3, 0, 0, 0]) * np.sign(np.sin(0.02 * k + seed))
        away = rng.normal(size=3)
        measured = place + ERROR * away / np.linalg.norm(away)
        q_next = guard.command(aim, measured[None])
        X = clearance.arm.poses.at(q)
        tool = clearance.arm.segments_in_world(X)[-1].mean(axis=0)
        goes = rng.integers(20, 120) if not goes and rng.uniform() < 0.05 else max(goes - 1, 0)
        way = tool - (CENTER + place)
        step = speed * PERIOD * way / np.linalg.norm(way) if goes else np.zeros(3)
        both = np.array([place, place + step])[:, None]
        gap = clearance.least_along(np.array([q, q_next]), both)[-1]
        if np.abs(q_next - q).max() > 1e-12:
            least.append(gap)
        if gap < 0.0:
            break
        q, place = q_next, place + step
    return np.array(least), clearance, guard


@pytest.mark.parametrize("seed", range(2))
def test_it_rests_before_it_is_touched_whatever_the_obstacle_does(seed):
    least, *_ = chased(None, seed)
    assert least.min() >= FLOOR


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2, 12))
@pytest.mark.parametrize("jerk", [None, 60.0])
def test_with_the_jerk_bounded_it_does_so_too(seed, jerk):
    least, *_ = chased(jerk, seed)
    assert least.min() >= FLOOR


def test_an_obstacle_faster_than_counted_on_touches_an_arm_that_moves():
    with pytest.warns(UserWarning, match="p_WO: ball 1 was measured farther away than its speed"):
        assert any(chased(None, seed, counted=0.01)[0].min() < FLOOR for seed in range(4))


def test_what_may_happen_until_an_arm_rests_is_taken_off_the_distance():
    clearance, _ = guarded()
    world = World(clearance, None, {}, PERIOD, Places(np.zeros((1, 3))))
    k = np.array([0.0, 10.0])
    now, later = world.gaps(np.tile(HOME, (2, 1)), k, np.arange(clearance.count))
    own = len(clearance.own)
    np.testing.assert_allclose(now[:own], clearance.gaps(HOME)[:own], atol=1e-15)
    np.testing.assert_allclose(now[own:], clearance.gaps(HOME)[own:] - ERROR, atol=1e-15)
    np.testing.assert_allclose(now[own:] - later[own:], 10 * PERIOD * SPEED, atol=1e-15)
    np.testing.assert_array_equal(now[:own], later[:own])


def test_a_place_that_is_not_a_number_brings_the_arm_to_rest_and_it_goes_on_later():
    _, guard = guarded()
    near = HOME + np.array([0.2, 0, 0, 0, 0, 0, 0])
    for _ in range(20):
        guard.command(near, np.zeros((1, 3)))
    assert np.abs(guard.velocity).max() > 0.1
    for _ in range(100):
        guard.command(near, np.full((1, 3), np.nan))
    assert not guard.velocity.any()
    for _ in range(300):
        guard.command(near, np.zeros((1, 3)))
    np.testing.assert_allclose(guard.position, near, atol=1e-6)


@pytest.mark.parametrize("p_WO", [None, np.zeros((2, 3)), np.zeros(3)])
def test_where_obstacles_are_must_be_told(p_WO):
    _, guard = guarded()
    with pytest.raises(InvalidInputError, match="p_WO: must be of shape"):
        guard.command(HOME, p_WO)


def test_an_obstacle_that_is_not_measured_is_told_once_each_time(recwarn):
    _, guard = guarded()
    unknown, known = np.full((1, 3), np.nan), np.zeros((1, 3))

    def texts():
        every = [str(each.message).split(",")[0] for each in recwarn]
        return [text for text in every if "measured" in text]

    for _ in range(300):
        guard.command(HOME, unknown)
    assert texts() == ["p_WO: ball 1 has not been measured yet"]
    for k in range(600):
        guard.command(HOME, known if k % 100 == 0 and k < 300 else unknown)
        assert len(texts()) == 1 or k >= 400
    assert texts()[1:] == ["p_WO: ball 1 has not been measured for 1 s"]
