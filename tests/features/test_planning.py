"""Plans: a way round what a local law waits before, within every bound; what cannot be planned."""

import sys

import numpy as np
import pytest

from drake_rnn import (
    Avoidance,
    Goal,
    Guard,
    InvalidInputError,
    JointStream,
    arm_clearance,
    load_arm,
    load_experiment,
    make_experiment,
    make_obstacles,
    plan_motion,
)
from drake_rnn.experiment import watch_planning
from drake_rnn.features.planning import (
    Bounds,
    BSpline,
    FreeSpace,
    Stops,
    round_corners,
    time_curve,
)

UR5 = load_arm("ur5", tool=None)
ARM = UR5.with_limits(UR5.limits.replace(velocity=1.5, acceleration=6.0, jerk=200.0))
START = np.array([-0.9, -0.7, 1.2, -0.5, 1.57, 0.0])
END = np.array([0.9, -0.7, 1.2, -0.5, 1.57, 0.0])
PERIOD = 0.02
PILLAR = {"kind": "box", "center": [0.6, 0.0, 0.4], "size": [0.1, 0.1, 0.8], "name": "pillar"}
KEPT = 1e-9
# Rows that slow an approach bend the way; without them it is that of the plan.
AT_ONCE = Avoidance(approach=50.0)


def clearance_of(*obstacles):
    return arm_clearance(ARM, make_obstacles(list(obstacles)), START)[0]


def excess(q):
    """By how much a motion from rest to rest is beyond its bounds, of each order."""
    v = np.diff(np.vstack((q[:1], q[:1], q[:1], q, q[-1:], q[-1:])), axis=0) / PERIOD
    a, limits = np.diff(v, axis=0) / PERIOD, ARM.limits
    j = np.diff(a, axis=0) / PERIOD
    sizes = zip((v, a, j), (limits.velocity, limits.acceleration, limits.jerk), strict=True)
    return [float((np.abs(size) - most).max()) for size, most in sizes]


def followed(clearance, targets, **settings):
    law = JointStream(limits=ARM.limits, home=START, clearance=clearance, **settings)
    guard = Guard(law, PERIOD)
    return np.array([START, *(guard.command(target) for target in targets)]), guard


@pytest.fixture(scope="module")
def round_the_pillar():
    pytest.importorskip("ompl")
    clearance = clearance_of(PILLAR)
    return clearance, plan_motion(ARM, Goal(q=END), START, PERIOD, clearance)


def test_a_law_without_a_plan_waits_before_a_pillar():
    clearance = clearance_of(PILLAR)
    q, _ = followed(clearance, [END] * 200)
    assert np.abs(q[-1] - END).max() > 0.5
    assert np.abs(q[-1] - q[-20]).max() < 1e-2


def test_with_a_plan_it_arrives_clear_of_everything_and_within_every_bound(round_the_pillar):
    clearance, plan = round_the_pillar
    settings = {**plan.stream, "avoidance": AT_ONCE}
    q, guard = followed(clearance, plan.targets(plan.duration).position, **settings)
    # The law commands the plan itself: no stop of it was refused.
    assert np.abs(q[: len(plan.position)] - plan.position).max() < 1e-9
    assert guard.part("held_back") == 0.0
    assert guard.part("uncertified") == 0.0
    assert np.abs(q[-1] - END).max() < 1e-9
    assert max(excess(q)) < KEPT
    assert clearance.least_along(q).min() >= 0.01
    # Without the pillar's geometry the straight way leads through it.
    straight = START + np.linspace(0.0, 1.0, 50)[:, None] * (END - START)
    assert clearance.least_along(straight).min() < 0.0


def test_with_the_usual_approach_it_arrives_too(round_the_pillar):
    """The law bends the way where it approaches more slowly, by less than the plan's margin."""
    clearance, plan = round_the_pillar
    q, guard = followed(clearance, plan.targets(plan.duration + 0.5).position, **plan.stream)
    assert np.abs(q[-1] - END).max() < 1e-6
    assert clearance.least_along(q).min() >= 0.01
    assert max(excess(q)) < KEPT
    assert guard.part("uncertified") == 0.0


def test_a_plan_is_repeated_bit_for_bit(round_the_pillar):
    clearance, plan = round_the_pillar
    again = plan_motion(ARM, Goal(q=END), START, PERIOD, clearance)
    assert again.position.tobytes() == plan.position.tobytes()
    assert again.steps == plan.steps > 0
    other = plan_motion(ARM, Goal(q=END), START, PERIOD, clearance, seed=1)
    assert other.position.tobytes() != plan.position.tobytes()


def test_its_waypoints_are_a_plan_without_a_search(round_the_pillar, monkeypatch):
    clearance, plan = round_the_pillar
    monkeypatch.setitem(sys.modules, "ompl.base", None)
    goal = Goal(q=END, via=list(plan.waypoints[1:]))
    assert plan_motion(ARM, goal, START, PERIOD, clearance).position.tobytes() == (
        plan.position.tobytes()
    )


def test_a_pose_is_reached(round_the_pillar):
    clearance, _ = round_the_pillar
    kinematics = ARM.kinematics()
    goal = Goal(p_WE=kinematics.p_WE(END))
    plan = plan_motion(ARM, goal, START, PERIOD, clearance)
    assert np.linalg.norm(kinematics.p_WE(plan.position[-1]) - goal.p_WE) < 1e-6
    known = Goal(p_WE=goal.p_WE, via=list(plan.waypoints[1:]))
    again = plan_motion(ARM, known, START, PERIOD, clearance)
    assert again.position.tobytes() == plan.position.tobytes()


@pytest.mark.parametrize(
    ("goal", "obstacles", "start", "text"),
    [
        (
            Goal(q=END),
            [{**PILLAR, "center": [0.35, 0.5, 0.3], "size": [0.3, 0.3, 0.9]}],
            START,
            r"goal: \w+ and pillar overlap by 0\.\d+ m there; more than 0.01 m, avoidance.distance",
        ),
        (
            Goal(q=END),
            [{**PILLAR, "center": [0.35, -0.5, 0.3], "size": [0.3, 0.3, 0.9]}],
            START,
            r"start: \w+ and pillar overlap by 0\.\d+ m there, where 0.005 m are kept",
        ),
        (
            Goal(p_WE=[0.9, 0.9, 0.9]),
            [],
            START,
            r"goal.p_WE: \(0.9, 0.9, 0.9\) m is out of reach: ur5 misses it by 0\.\d+ m",
        ),
        (Goal(p_WE=[300, 400, 500]), [], START, r"m; lengths are in metres: are these millimetres"),
        (Goal(q=[9.0, 0, 0, 0, 0, 0]), [], START, "goal.q: shoulder_pan_joint is at 9 rad"),
        (Goal(q=[0.0]), [], START, "goal.q: has 1 entries for 6 joints"),
    ],
)
def test_what_cannot_be_planned_is_told(goal, obstacles, start, text):
    with pytest.raises(InvalidInputError, match=text):
        plan_motion(ARM, goal, start, PERIOD, clearance_of(*obstacles))


def test_without_a_way_the_search_ends():
    """A wall parts start and goal; the gap in which the base stands is lower than the upper arm."""
    pytest.importorskip("ompl")
    walls = [
        {"kind": "box", "center": center, "size": size, "name": name}
        for center, size, name in (
            ([1.3, 0.0, 0.0], [2.0, 0.02, 6.0], "before"),
            ([-1.3, 0.0, 0.0], [2.0, 0.02, 6.0], "behind"),
            ([0.0, 0.0, 1.3], [0.8, 0.02, 2.0], "above"),
        )
    ]
    with pytest.raises(InvalidInputError, match="no path found within 100 steps, goal"):
        plan_motion(ARM, Goal(q=END, steps=100), START, PERIOD, clearance_of(*walls))


def test_ctrl_c_ends_the_search(round_the_pillar):
    clearance, _ = round_the_pillar
    told = []

    def interrupt(text, is_end):
        told.append(text)
        raise KeyboardInterrupt

    with watch_planning(interrupt), pytest.raises(KeyboardInterrupt):
        plan_motion(ARM, Goal(q=END), START, PERIOD, clearance)
    assert len(told) == 1
    assert told[0].startswith("searches: 5 of 20000 steps")


def test_without_the_package_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl.base", None)
    with pytest.raises(
        InvalidInputError, match="goal: needs ompl, which is not installed: pip install"
    ):
        plan_motion(ARM, Goal(q=END), START, PERIOD, clearance_of(PILLAR))


@pytest.mark.parametrize("period", [0.001, 0.01, 0.05])
def test_any_way_is_timed_within_all_bounds(period):
    """From rest to rest through random points, some near to each other and some far."""
    rng = np.random.default_rng(0)
    waypoints = START + np.cumsum(rng.normal(0.0, 0.5, (6, 6)), axis=0)
    bounds = Bounds.of(ARM.limits, period)
    q, _ = time_curve(BSpline.through(waypoints, 0.2), bounds, None)
    assert bounds.use(q).max() <= 1.0
    assert np.abs(q[0] - waypoints[0]).max() < 1e-9
    assert np.abs(q[-1] - waypoints[-1]).max() < 1e-9


def test_a_way_is_free_only_if_all_of_it_is():
    """Of a thin plate between two postures that are free, and of one beside them."""
    plate = {"kind": "box", "center": [0.6, 0.0, 0.4], "size": [0.5, 0.002, 0.8], "name": "plate"}
    ends = np.array([START, END])
    for obstacles, is_free in (([plate], False), ([], True)):
        free = FreeSpace.between(clearance_of(*obstacles), ends, 0.015, 0.005)
        assert free.holds(START)
        assert free.way(START, END) == is_free


DOCUMENT = {
    "arm": {"model": "ur5", "tool": None},
    "law": {"kind": "joint_stream"},
    "limits": {"velocity": 1.5, "acceleration": 6.0, "jerk": 200.0},
    "obstacles": [PILLAR],
    "start": START.tolist(),
    "period": PERIOD,
    "duration": 4.0,
}


def test_a_document_has_its_plan(round_the_pillar, monkeypatch):
    _, plan = round_the_pillar
    made = make_experiment({**DOCUMENT, "goal": {"q": END.tolist()}})
    assert np.array_equal(made.targets.position, plan.targets(4.0).position)
    assert np.array_equal(made.document.goal.via, plan.waypoints[1:])
    monkeypatch.setitem(sys.modules, "ompl.base", None)
    again = make_experiment(made.document.contents())
    assert again.targets.position.tobytes() == made.targets.position.tobytes()


@pytest.mark.long
def test_a_plan_that_knows_nothing_of_a_held_box_leads_it_through_a_board():
    pytest.importorskip("ompl")
    held = load_experiment("shelf_pick")
    bare = load_experiment("shelf_pick", {"arm.payload": None})
    assert held.clearance.gaps(held.targets.position).min() > 0.0
    assert held.clearance.gaps(bare.targets.position).min() < -0.01


def test_a_curve_that_is_not_free_is_no_plan():
    """A way straight through the pillar has no free curve near it."""
    clearance = clearance_of(PILLAR)
    free = FreeSpace.between(clearance, np.array([START, END]), 0.01, 0.005)
    with pytest.raises(InvalidInputError, match="no curve near it is free"):
        round_corners(free, np.array([START, END]))


def test_stops_that_are_free_at_no_speed_are_counted():
    clearance, bounds = clearance_of(PILLAR), Bounds.of(ARM.limits, PERIOD)
    curve = BSpline.through(np.array([START, START + 0.2]), 0.2)
    near, far = (
        time_curve(
            curve,
            bounds,
            Stops(clearance, np.full(len(clearance.names), least), least, 50.0, bounds),
        )
        for least in (10.0, -10.0)
    )
    assert near[1] > 0
    assert far[1] == 0
    # What is slowed in vain is within its bounds all the same, and slower.
    assert max(excess(near[0])) < KEPT
    assert len(near[0]) > 10 * len(far[0])
