"""What is certified of a stop is so between samples too, and the bounds that tell are bounds."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drake_rnn import load_arm, make_obstacles
from drake_rnn.laws.parts.obstacle_tracks import Places
from drake_rnn.laws.parts.world import BothStop, Certificate, World, samples_of
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.clearance import Neighbour, beside
from drake_rnn.robot.jerk_stop import HeldJerkStop, HeldStop
from drake_rnn.robot.sides import Sides

FLOOR, PERIOD = 0.005, 1e-3
OBSTACLES = [
    {"kind": "ball", "center": [0.5, 0.4, 0.5], "radius": 0.05},
    {"kind": "ball", "center": [0.4, -0.3, 0.7], "radius": 0.05},
    {"kind": "capsule", "ends": [[0.6, 0.0, 0.1], [0.6, 0.2, 0.4]], "radius": 0.04},
    {"kind": "box", "center": [0.0, 0.55, 0.5], "size": [0.2, 0.1, 0.3], "rpy": [0.3, 0.2, 1.0]},
    {"kind": "half_space", "point": [0.0, 0.0, -0.05], "normal": [0.05, 0.0, 1.0]},
    {
        "kind": "cylinder",
        "center": [-0.4, -0.3, 0.4],
        "rpy": [0.3, 0.2, 0.0],
        "radius": 0.06,
        "length": 0.3,
    },
]


@cache
def clearance_of(arm, speed=None):
    found = load_arm(arm)
    home = np.asarray(found.home)
    around = OBSTACLES if speed is None else [{**each, "speed": speed} for each in OBSTACLES]
    for number in range(len(around), 0, -1):
        clearance, _ = arm_clearance(found, make_obstacles(around[:number]), home)
        if clearance.gaps(home).min() > 0.0:
            return clearance, home
    raise AssertionError


def sliding(clearance):
    """The same arm, of which the second joint slides up to 0.5 m instead of turning."""
    poses = clearance.arm.poses
    slides = tuple(k == 1 for k in range(len(poses.slides)))
    poses = replace(poses, slides=slides, travels=np.where(slides, 0.5, 0.0))
    return replace(clearance, arm=replace(clearance.arm, poses=poses))


def two_arms():
    one, home = clearance_of("panda")
    arm = load_arm("panda")
    other = one.arm.move(np.diag([-1.0, -1.0, 1.0]), np.array([0.9, 0.1, 0.0]))
    limits = arm.limits.replace(acceleration=2.0, jerk=None)
    return beside(one, other), home, Neighbour(limits, has_chosen=True)


def stop_of(rng, n, jerk):
    """A stop with a random velocity, or acceleration, to begin with."""
    a, v = np.full(n, rng.choice([1.0, 5.0])), rng.uniform(-1, 1, n) * rng.choice([0.3, 1.0, 2.0])
    if jerk is None:
        return HeldStop(a, PERIOD), v
    stop = HeldJerkStop(v, a, np.full(n, jerk * a[0]), PERIOD)
    return stop, 0.5 * rng.uniform(-1, 1, n) * a


def certified_and_free(clearance, home, jerk, count, seed=0, neighbour=None, **places):
    """How many random stops are certified, and how many are free; the way alone tells of none."""
    rng, own = np.random.default_rng(seed), home.size
    both = {"certified": 0, "free": 0}
    for _ in range(12 * count):
        q = home + rng.uniform(-0.7, 0.7, own)
        stop, u = stop_of(rng, own, jerk)
        seen = {}
        if neighbour is not None:
            other = home + rng.uniform(-0.7, 0.7, own)
            seen = {"other_commanded": other, "other_v": rng.uniform(-0.5, 0.5, own)}
        world = World(clearance, neighbour, seen, PERIOD, **places)
        q, stop = world.posture(q), world.around(stop)
        left = world.gaps_now(q)
        way = clearance.reaches @ stop.way(u)
        if left.min() < FLOOR or left.min() > 0.3 or (left - way).min() >= FLOOR:
            continue
        if not (count := count - 1):
            break
        given = Certificate(clearance, FLOOR).is_given(u, q, left, None, stop, world)
        k = np.linspace(0.0, stop.samples(u), 240)
        shrinks = float(np.max(world.nearer(k[-1]))) if places else 0.0
        least = clearance.gaps(q + stop.travel(u, k)).min()
        both["certified"] += given
        both["free"] += least - shrinks >= FLOOR
        assert not given or least >= FLOOR
        if given and places:
            gaps = world.gaps(q + stop.travel(u, k), k, slice(None))
            assert gaps.min() >= FLOOR
    return both


@pytest.mark.parametrize(
    ("arm", "jerk"),
    [
        *(("panda", 20.0), ("ur5", None), ("planar6", 20.0)),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (("panda", None), ("ur5", 20.0), ("planar6", None))
        ),
    ],
)
def test_a_stop_that_is_certified_is_free_and_nearly_all_that_are_free_are(arm, jerk):
    found = certified_and_free(*clearance_of(arm), jerk, 60)
    assert 0.9 * found["free"] <= found["certified"] <= found["free"]
    assert found["free"] > 10


@pytest.mark.parametrize(
    ("arm", "jerk"),
    [
        pytest.param(arm, jerk, marks=mark)
        for mark, cases in (
            (pytest.mark.long, (("panda", None), ("ur5", 20.0), ("iiwa14", 20.0))),
            (pytest.mark.nightly, (("panda", 20.0), ("ur5", None), ("iiwa14", None))),
        )
        for arm, jerk in cases
    ],
)
def test_so_are_nearly_all_of_many_fast_and_long_stops(arm, jerk):
    found = certified_and_free(*clearance_of(arm), jerk, 400, seed=1)
    assert 0.965 * found["free"] <= found["certified"] <= found["free"]


@pytest.mark.parametrize("jerk", [None, 20.0])
def test_so_it_is_with_a_joint_that_slides(jerk):
    clearance, home = clearance_of("panda")
    found = certified_and_free(sliding(clearance), 0.2 * home, jerk, 40)
    assert found["certified"] > 5


def test_so_it_is_with_obstacles_that_move():
    clearance, home = clearance_of("panda", speed=0.2)
    places = Places(np.full((len(clearance.solids.moving), 3), 0.01))
    found = certified_and_free(clearance, home, None, 40, places=places, delay=0.5e-3)
    assert found["certified"] > 5


def test_so_it_is_of_two_arms():
    clearance, home, neighbour = two_arms()
    found = certified_and_free(clearance, home, None, 40, neighbour=neighbour)
    assert 0.95 * found["free"] <= found["certified"] <= found["free"]
    assert found["certified"] > 5


def bounds_and_least(clearance, home, jerk, seed):
    """What planes leave of chords, and of bows; how far these are off; how near pairs come."""
    rng = np.random.default_rng(seed)
    q = home + rng.uniform(-0.5, 0.5, home.size)
    stop, u = stop_of(rng, home.size, jerk)
    world = World(clearance, None, {}, PERIOD)
    k = samples_of(stop.samples(u))
    travel, way = stop.travel_and_way(u, k)
    way = np.diff(way, axis=0)
    _, planes = world.view(q + travel, k, slice(None))
    nearer, bend = clearance.way_and_bend(way)
    off = Certificate(clearance, FLOOR)._deviation(way, k, stop, world) @ clearance.reaches.T
    shares = np.linspace(0.0, 1.0, 21)
    dense = (k[:-1, None] + shares * np.diff(k)[:, None]).ravel()
    least = clearance.gaps(q + stop.travel(u, dense)).reshape(len(way), 21, -1).min(axis=1)
    return planes(0.0 * bend, nearer), planes(bend, nearer), off, least


@pytest.mark.parametrize("jerk", [None, 20.0])
@pytest.mark.parametrize("arm", ["panda", "ur5", "planar6", "sliding"])
def test_planes_bound_the_distance_and_both_parts_of_what_is_off_a_chord_are_needed(arm, jerk):
    clearance, home = clearance_of("panda" if arm == "sliding" else arm)
    clearance = sliding(clearance) if arm == "sliding" else clearance
    cases = [bounds_and_least(clearance, home, jerk, seed) for seed in range(12)]
    flat, bent, off, least = (np.concatenate(each) for each in zip(*cases, strict=True))
    assert (bent - off <= least + 1e-9).all()
    assert not (flat - 1e-6 <= least).all()
    assert (off >= 0.0).all()
    # It is a bound that tells: most pairs are not far above it.
    assert np.median(least - (bent - off)) < 0.03


@pytest.mark.parametrize("down", [3.0, 1.0])
def test_both_stops_change_their_velocities_by_no_more_than_is_said(down):
    clearance, home, neighbour = two_arms()
    seen = {"other_commanded": home, "other_v": np.full(home.size, 0.4)}
    world = World(clearance, neighbour, seen, PERIOD)
    stop = world.around(HeldStop(Sides(np.full(home.size, down), np.full(home.size, 3.0)), PERIOD))
    assert isinstance(stop, BothStop)
    u = np.linspace(-1.0, 1.0, home.size)
    k = np.arange(stop.samples(u) + 1.0)
    bend = np.diff(stop.travel(u, k), 2, axis=0)
    assert (np.abs(bend) <= stop.largest * PERIOD**2 + 1e-15).all()
