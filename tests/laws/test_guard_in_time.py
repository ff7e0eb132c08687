"""A guard whose calls come late, and whose obstacles are not where they were: it touches nothing.

A Panda turns its first joint by 1.4 rad. A ball stands, or comes to stand, in its way.
"""

import warnings

import numpy as np
import pytest

from drake_rnn import (
    Guard,
    InvalidInputError,
    JointStream,
    SampledController,
    load_arm,
    load_experiment,
    make_obstacles,
)
from drake_rnn.laws.parts.obstacle_tracks import LONGEST, SHORTEST, ObstacleTracks
from drake_rnn.laws.parts.safe_velocity import NO_STOP
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.capsules import Solids
from drake_rnn.runs.simulation import recorded_simulator, start_laws

PANDA = load_arm("panda")
HOME = np.asarray(PANDA.home)
PERIOD, SPEED, ERROR = 0.01, 0.4, 0.002
GOAL, ALONG = HOME + 1.4 * np.eye(7)[0], np.eye(7)[0]
#: Where the tool is once it has turned by 0.8 rad: there the ball stands in its way.
IN_THE_WAY = PANDA.kinematics().p_WE(HOME + 0.8 * ALONG) + np.array([0.0, 0.0, 0.08])
ASIDE = np.array([0.0, 0.0, 1.5])


def ball(center):
    place = {"kind": "ball", "center": center.tolist(), "radius": 0.04}
    return {**place, "speed": SPEED, "error": ERROR}


def made(center, jerk=None, **guard):
    clearance, _ = arm_clearance(PANDA, make_obstacles([ball(center)]), HOME)
    limits = PANDA.limits.replace(velocity=0.8, acceleration=3.0, jerk=jerk)
    law = JointStream(limits=limits, home=HOME, clearance=clearance)
    return clearance, Guard(law, PERIOD, **guard)


def swept(clearance, guard, p_WO, measured=None, late=(), pause=None, count=110):
    """The least distance while the arm moves, and where it ends.

    Where the ball is from a call on, and where it is measured then, are functions of its number;
    calls are late by so much [s], by number; before that of a pause the guard is resumed at rest.
    """
    t, q, least, late = 0.0, guard.position, np.inf, dict(late)
    for k in range(count):
        t += late.get(k, 0.0)
        if k == pause:
            guard.resume(q, np.zeros(7), np.zeros(7), t)
        seen = (p_WO if measured is None else measured)(k)
        q_next = guard.command(GOAL, np.array([seen]), t)
        if np.abs(q_next - q).max() > 1e-12:
            p = np.array([[p_WO(k)]] * 2)
            least = min(least, clearance.least_along(np.array([q, q_next]), p).min())
        q, t = q_next, t + PERIOD
    return least, q


def comes(k):
    """A ball that stands aside and, by the call of number 35, in the way."""
    return np.zeros(3) if k < 35 else -ASIDE


JERKS = pytest.mark.parametrize("jerk", [None, 100.0])


@JERKS
def test_a_late_call_finds_the_arm_at_rest_and_the_ball_in_its_way(jerk):
    clearance, guard = made(IN_THE_WAY + ASIDE, jerk, t=0.0)
    with warnings.catch_warnings(action="error"):
        least, q = swept(clearance, guard, comes, late={35: 4.0})
    assert least >= 0.005
    assert guard.late_stops == 1
    # It stands before the ball, where it would have gone on to 1.4 rad.
    assert q[0] < HOME[0] + 0.8
    assert guard.jumps == {"ball 1": 0}


@JERKS
def test_a_guard_that_goes_on_after_a_pause_knows_how_long_it_was(jerk):
    clearance, guard = made(IN_THE_WAY + ASIDE, jerk, t=0.0)
    least, _ = swept(clearance, guard, comes, late={35: 4.0}, pause=35)
    assert least >= 0.005
    assert guard.jumps == {"ball 1": 0}
    assert guard.part("uncertified").item() == 0.0
    with pytest.raises(InvalidInputError, match=r"name: no part 'late'; there are .*uncertified"):
        guard.part("late")


def test_without_the_time_a_pause_forgets_where_obstacles_were():
    clearance, guard = made(IN_THE_WAY + ASIDE)
    least, q = np.inf, guard.position
    for k in range(110):
        if k == 35:
            guard.resume(q, np.zeros(7), np.zeros(7))
        q_next = guard.command(GOAL, comes(k)[None])
        if np.abs(q_next - q).max() > 1e-12:
            pair = np.array([q, q_next])
            least = min(least, clearance.least_along(pair, np.array([[comes(k)]] * 2)).min())
        q = q_next
    assert least >= 0.005
    assert guard.jumps == {"ball 1": 0}


@pytest.mark.parametrize("told", [True, False])
def test_the_first_measurement_counts_and_not_the_place_that_is_stated(told):
    clearance, guard = made(IN_THE_WAY + ASIDE, p_WO=-ASIDE[None] if told else None, t=0.0)
    least, q = swept(clearance, guard, lambda k: -ASIDE)
    assert least >= 0.005
    assert q[0] < HOME[0] + 0.8
    assert guard.jumps == {"ball 1": 0}


def test_a_start_too_near_to_the_first_measured_place_is_refused():
    tool = PANDA.kinematics().p_WE(HOME)
    onto = tool - IN_THE_WAY - ASIDE
    with pytest.raises(InvalidInputError, match=r"start: .* and ball 1 are -0\.\d+ m apart"):
        made(IN_THE_WAY + ASIDE, p_WO=onto[None])
    _, guard = made(IN_THE_WAY + ASIDE)
    with pytest.raises(InvalidInputError, match=r"start: .* and ball 1 are -0\.\d+ m apart"):
        guard.command(GOAL, onto[None])


@JERKS
@pytest.mark.parametrize("lasts", [1, pytest.param(15, marks=pytest.mark.long)])
def test_an_outlier_away_from_the_arm_frees_nothing(lasts, jerk):
    clearance, guard = made(IN_THE_WAY, jerk, t=0.0)

    def measured(k):
        return np.array([0.6, 0.0, 0.8]) if 30 <= k < 30 + lasts else np.zeros(3)

    with pytest.warns(UserWarning, match="p_WO: ball 1 was measured farther away than its speed"):
        least, q = swept(clearance, guard, lambda k: np.zeros(3), measured)
    assert least >= 0.005
    assert q[0] < HOME[0] + 0.8
    assert guard.jumps == {"ball 1": 1}


def test_an_outlier_towards_the_arm_is_believed_and_then_forgotten():
    clearance, guard = made(IN_THE_WAY + ASIDE, t=0.0)

    swept(clearance, guard, lambda k: np.zeros(3), count=30)
    fast = guard.velocity[0]
    with pytest.warns(UserWarning, match="ball 1"):
        guard.command(GOAL, -ASIDE[None], 30 * PERIOD)
    assert guard.velocity[0] < fast - 0.9 * 3.0 * PERIOD
    for k in range(31, 250):
        guard.command(GOAL, np.zeros((1, 3)), k * PERIOD)
    assert guard.position == pytest.approx(GOAL, abs=1e-6)


def test_a_ball_that_is_not_measured_may_have_come_at_its_speed():
    clearance, guard = made(IN_THE_WAY + np.array([0.0, 0.0, 0.3]), t=0.0)

    def place(k):
        return np.array([0.0, 0.0, -min(SPEED * PERIOD * max(k - 10, 0), 0.3)])

    def measured(k):
        return place(k) if k <= 10 else np.full(3, np.nan)

    least, _ = swept(clearance, guard, place, measured)
    assert least >= 0.005
    assert guard.jumps == {"ball 1": 0}


def test_a_few_measurements_that_are_missing_change_nothing():
    _, all_of_them = made(IN_THE_WAY + ASIDE, t=0.0)
    _, some = made(IN_THE_WAY + ASIDE, t=0.0)
    for k in range(60):
        q = all_of_them.command(GOAL, np.zeros((1, 3)), k * PERIOD)
        p_WO = np.full((1, 3), np.nan if k % 10 > 6 else 0.0)
        assert np.array_equal(some.command(GOAL, p_WO, k * PERIOD), q)


def test_a_ball_that_is_faster_than_its_speed_is_told():
    _, guard = made(IN_THE_WAY + ASIDE, t=0.0)
    way = 1.5 * SPEED * PERIOD * np.eye(3)[:1]
    # 2 errors of its measured place, and rounding, hide it until then.
    hidden = int(2.0 * ERROR / (0.5 * SPEED * PERIOD))
    for k in range(hidden + 1):
        guard.command(None, k * way, k * PERIOD)
    assert guard.jumps == {"ball 1": 0}
    with pytest.warns(UserWarning, match="ball 1"):
        guard.command(None, (hidden + 2) * way, (hidden + 1) * PERIOD)
    assert guard.jumps == {"ball 1": 1}


def test_calls_that_jitter_within_the_tolerance_go_on_with_the_velocity():
    _, on_time = made(IN_THE_WAY + ASIDE, t=0.0)
    _, guard = made(IN_THE_WAY + ASIDE, t=0.0)
    rng, t = np.random.default_rng(0), 0.0
    for k in range(80):
        q = on_time.command(GOAL, np.zeros((1, 3)), k * PERIOD)
        assert np.array_equal(guard.command(GOAL, np.zeros((1, 3)), t), q)
        t += PERIOD * rng.uniform(0.6, 1.4)
    assert guard.late_stops == 0


def test_without_obstacles_a_late_call_begins_from_rest_as_well():
    limits = PANDA.limits.replace(velocity=0.8, acceleration=3.0)
    guard = Guard(JointStream(limits=limits, home=HOME), PERIOD)
    for k in range(20):
        q = guard.command(GOAL, t=k * PERIOD)
    assert guard.velocity[0] == pytest.approx(0.6)
    late = guard.command(GOAL, t=1.0)
    assert guard.velocity[0] == pytest.approx(3.0 * PERIOD)
    assert late[0] - q[0] == pytest.approx(3.0 * PERIOD**2)
    # A target that came before a pause is as old as that.
    guard.command(t=2.0)
    assert not guard.velocity.any()


@pytest.mark.parametrize(
    ("t", "message"),
    [
        (np.nan, "t: must be a finite time [s], not nan"),
        ("now", "t: must be a finite time [s], not 'now'"),
        (True, "t: must be a finite time [s], not True"),
        (3.0, "t: must be after that of the last call, 3 s, not 3"),
        (-1.0, "t: must be after that of the last call, 3 s, not -1"),
        (3.001, "t: is 0.001 s after the last call; must be a period of 0.01 s after it, or at"),
        (1.7e9, "t: is 1.7e+09 s after the last call, more than a day; must be in seconds, on"),
        (None, "t: must be given in all calls of a guard or in none"),
    ],
)
def test_a_time_that_cannot_be_is_refused_and_changes_nothing(t, message):
    guard = Guard(JointStream(limits=PANDA.limits.replace(acceleration=3.0), home=HOME), PERIOD)
    q = guard.command(GOAL, t=3.0)
    with pytest.raises(InvalidInputError) as refusal:
        guard.command(GOAL, t=t)
    assert str(refusal.value).startswith(message)
    if t != 3.0 and t != 3.001:
        with pytest.raises(InvalidInputError):
            guard.resume(q, np.zeros(7), np.zeros(7), t)
    assert np.array_equal(guard.position, q)
    guard.command(GOAL, t=3.01)


def test_other_arguments_that_cannot_be_are_refused():
    _, guard = made(IN_THE_WAY + ASIDE)
    with pytest.raises(InvalidInputError, match="p_WO: must be real numbers, not 'here'"):
        guard.command(GOAL, "here")
    with pytest.raises(InvalidInputError, match="v: must be finite"):
        guard.resume(HOME, np.full(7, np.nan), np.zeros(7))
    with pytest.raises(InvalidInputError, match="a: must be 7 numbers, one per joint"):
        guard.resume(HOME, np.zeros(7), np.zeros(3))
    with pytest.raises(InvalidInputError, match="tolerance: must be a time from 0 to the period"):
        made(IN_THE_WAY, tolerance=0.02)


def tracked(*places, time=PERIOD):
    """The state after places were measured, the first of them at the start."""
    tracks = ObstacleTracks(Solids.of(make_obstacles([ball(np.zeros(3))])))
    kept = tracks.init({"p_WO": np.array([places[0]], dtype=float)}, None)
    for p in places[1:]:
        kept = kept | tracks.step(kept, {"p_WO": np.array([p], dtype=float)}, time)[1]
    return tracks, kept


def test_both_places_of_a_jump_count_until_one_is_settled():
    here, there = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]
    tracks, kept = tracked(*[here] * 40, there)
    p_WO, _, others, radii = tracks.places(kept)
    assert p_WO.tolist() == [there]
    assert others.tolist() == [here]
    # It may have gone on from there since it was measured there last.
    assert radii == pytest.approx([SPEED * PERIOD])
    # As long as it had been measured before, and no longer.
    tracks, kept = tracked(*[here] * 40, *[there] * 38)
    assert tracks.places(kept).others is not None
    tracks, kept = tracked(*[here] * 40, *[there] * 42)
    assert tracks.places(kept).others is None
    # A wrong one of a sample is forgotten soon.
    tracks, kept = tracked(*[here] * 40, there, *[here] * round(1.2 * SHORTEST / PERIOD))
    assert tracks.places(kept).others is None
    assert kept["jumps"].tolist() == [1.0]
    # No longer than it takes to go from one to the other.
    near = [0.1, 0.0, 0.0]
    tracks, kept = tracked(*[here] * 200, *[near] * round(0.1 / SPEED / PERIOD + 1))
    assert tracks.places(kept).others is None


def test_a_place_counts_for_no_longer_than_is_remembered():
    here, there = [0.0, 0.0, 0.0], [9.0, 0.0, 0.0]
    tracks, kept = tracked(*[here] * 20, *[there] * 8, time=1.0)
    assert LONGEST == 5.0
    assert tracks.places(kept).others is None


def test_at_two_jumps_a_ball_holds_both_former_places():
    here, there, last = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    tracks, kept = tracked(*[here] * 40, there, last)
    _, _, others, radii = tracks.places(kept)
    way = SPEED * PERIOD
    for place, grown in ((here, 2 * way), (there, way)):
        assert np.linalg.norm(others[0] - place) + grown <= radii[0] + 1e-12


@pytest.mark.parametrize("law", [{}, {"law": {"kind": "pseudoinverse"}, "safety": {}}])
def test_a_law_that_goes_on_after_a_while_knows_less_of_distances(law):
    """As a drive does after cycles in which the law was not asked."""
    changes = {"duration": 1.0, **law}
    if law:
        changes |= {"safety": {"collisions": True}, "accept": None}
    experiment = load_experiment("adaptive_moving_obstacle", changes)
    simulator, loops, _ = recorded_simulator(experiment)
    start_laws(loops, simulator.get_mutable_context())
    simulator.AdvanceTo(0.02)
    (loop,) = loops
    controller = loop.controller
    assert isinstance(controller, SampledController)
    x = controller.state(controller.GetMyContextFromRoot(simulator.get_context()))
    layout, prefix = controller.reading.state, "safe_" if law else ""
    q, v = layout.part(x, f"{prefix}commanded"), layout.part(x, "v")
    later = controller.reading.resumed(x, q + 1e-3, v, np.zeros(v.size), 0.5)
    fewer = layout.part(x, f"{prefix}gaps") - layout.part(later, f"{prefix}gaps")
    assert fewer == pytest.approx(0.5 * experiment.clearance.speeds, abs=1e-12)
    assert layout.part(later, f"{prefix}stop_delay").item() == NO_STOP
    assert layout.part(later, f"{prefix}obstacle_radius") == pytest.approx(
        0.5 * experiment.clearance.solids.speeds
    )
