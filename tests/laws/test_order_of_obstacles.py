"""The order of a list of obstacles changes no command, and rows of p_WO have that order."""

import shutil

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from obstacle_lists import (
    ERROR,
    HOME,
    PANDA,
    PERIOD,
    arm_distance,
    law_among,
    random_list,
)

from drake_rnn import (
    Avoidance,
    Guard,
    InvalidInputError,
    Shield,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from drake_rnn.models import MODELS
from drake_rnn.robot.clearance.obstacles import BallObstacle, Obstacle

PANDA_FILES = ("capsules", "limits")
FLOOR = Avoidance().floor
SEEDS = st.integers(0, 2**32 - 1)
# Of positions after 80 samples [rad]: 480 permutations differed by 1.3e-15 at most.
ROUNDING = 1e-14


def swept(obstacles, seed, *, by_name, jerk=None, samples=40, compiled=False):
    """Commands towards random targets, among obstacles that go straight on at full speed.

    Their places are given by name or in rows in the order of the list.
    """
    guard = Guard(law_among(obstacles, jerk), PERIOD, compiled=compiled)
    rng, speeds = np.random.default_rng(seed), {o["name"]: o.get("speed") for o in obstacles}
    names = [name for name, speed in speeds.items() if speed]
    assert guard.moving_obstacles == tuple(names)
    ways = {name: rng.normal(size=3) for name in sorted(names)}
    commands = []
    for k in range(samples):
        if k % 20 == 0:
            goal = HOME + rng.uniform(-1.0, 1.0, 7)
        seen = {}
        for name, way in ways.items():
            away = rng.normal(size=3)
            gone = PERIOD * (k + 1) * speeds[name] * way / np.linalg.norm(way)
            seen[name] = gone + ERROR * away / np.linalg.norm(away)
        rows = seen if by_name else np.array([seen[name] for name in names])
        commands.append(guard.command(goal, rows))
    return np.array(commands), guard


def check_permutation(seed, *, rounding=0.0, **options):
    """Commands have the same bits, but for the rounding of sums over rows of several pairs.

    These a program is solved with where several pairs are in the way at once.
    """
    rng = np.random.default_rng(seed)
    obstacles = random_list(rng)
    other = [obstacles[k] for k in rng.permutation(len(obstacles))]
    options["jerk"] = (None, 60.0)[seed % 2]
    commands, guard = swept(obstacles, seed, by_name=False, **options)
    for by_name in (False, True):
        again, other_guard = swept(other, seed, by_name=by_name, **options)
        np.testing.assert_allclose(again, commands, rtol=0.0, atol=rounding)
        assert other_guard.jumps == guard.jumps
    return guard


@settings(max_examples=2)
@given(SEEDS)
def test_no_permutation_of_a_list_of_obstacles_changes_a_bit_of_a_command(seed):
    check_permutation(seed)


@pytest.mark.long
@settings(max_examples=15)
@given(SEEDS)
def test_none_of_several_permutations_does(seed):
    check_permutation(seed, samples=80, rounding=ROUNDING)


@pytest.mark.nightly
@settings(max_examples=1000)
@given(SEEDS)
def test_none_of_a_thousand_permutations_does(seed):
    check_permutation(seed, samples=80, rounding=ROUNDING)


def test_no_permutation_of_a_list_of_capsules_or_of_limits_changes_a_command(tmp_path):
    """Pairs of the arm with itself are in another order then, and so are sums over them."""
    files = [yaml.safe_load((MODELS / "panda" / f"{n}.yaml").read_text()) for n in PANDA_FILES]
    rng, commands = np.random.default_rng(5), []
    for k in range(2):
        capsules, limits = files[0]["capsules"], dict(files[1])
        value = np.minimum(PANDA.limits.velocity, 1.0).tolist()
        order = rng.permutation(7) if k else np.arange(7)
        limits["velocity"] = {"value": {PANDA.joints[i]: value[i] for i in order}}
        if k:
            capsules = [capsules[i] for i in rng.permutation(len(capsules))]
        place = tmp_path / f"{k}.yaml", tmp_path / f"limits{k}.yaml"
        place[0].write_text(yaml.safe_dump({"capsules": capsules}))
        place[1].write_text(yaml.safe_dump(limits, sort_keys=False))
        arm = load_arm("panda", capsules=str(place[0]), limits=str(place[1]))
        shield = Shield(arm, PERIOD, obstacles=LIST[1:2])
        goals = np.random.default_rng(6)
        for sample in range(40):
            if sample % 20 == 0:
                shield.follow_positions(HOME + goals.uniform(-1.5, 1.5, 7))
            commands.append(shield.command())
    first, other = np.array(commands).reshape(2, 40, 7)
    assert np.abs(np.diff(first, axis=0)).max() > 0.5 * PERIOD
    np.testing.assert_allclose(other, first, rtol=0.0, atol=1e-12)


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")
def test_no_permutation_does_in_c():
    """To rounding, as a compiler may keep another product for a sum."""
    rng = np.random.default_rng(3)
    obstacles = random_list(rng, 5)
    other = obstacles[::-1]
    commands, _ = swept(obstacles, 3, by_name=False, compiled=True)
    for by_name in (False, True):
        again, _ = swept(other, 3, by_name=by_name, compiled=True)
        np.testing.assert_allclose(again, commands, rtol=0.0, atol=1e-12)
    in_numpy, _ = swept(obstacles, 3, by_name=True)
    np.testing.assert_allclose(commands, in_numpy, rtol=0.0, atol=1e-9)


class Hunters:
    """Obstacles in random order, of which those that may move go at the tool for random whiles.

    Each begins up to 0.3 m from where it is stated, free of the arm.
    """

    def __init__(self, obstacles, arm, rng):
        self.obstacles, self.arm, self.rng = obstacles, arm, rng
        self.moving = [o for o in obstacles if "speed" in o]
        self.gone, self.until = {}, dict.fromkeys((o["name"] for o in self.moving), 0)
        self.v = {name: np.zeros(3) for name in self.until}
        for o in self.moving:
            p = rng.uniform(-0.2, 0.2, 3)
            while arm_distance(arm, HOME, o, p) < 0.05:
                p = 0.5 * p + rng.uniform(-0.02, 0.02, 3)
            self.gone[o["name"]] = p

    def go_on(self, time):
        """Go on straight for a time [s]."""
        for name, v in self.v.items():
            self.gone[name] = self.gone[name] + time * v

    def turn(self, k, q):
        """At sample k, some begin to hunt, and those that do go at the tool."""
        tool = self.arm.segments_in_world(self.arm.poses.at(q))[-1].mean(axis=0)
        for o in self.moving:
            name = o["name"]
            if self.rng.random() < 0.05:
                self.until[name] = k + self.rng.integers(5, 60)
            center = o.get("center", o.get("point", np.mean(o.get("ends", [[0.0] * 3]), axis=0)))
            way = tool - center - self.gone[name]
            v = o["speed"] * way / max(np.linalg.norm(way), 1e-9)
            self.v[name] = v if k < self.until[name] else np.zeros(3)

    def measured(self):
        """By name, with errors; some are missing, and some elsewhere."""
        seen = {}
        for name, p in self.gone.items():
            away, chance = self.rng.normal(size=3), self.rng.random()
            off = self.rng.uniform(-1.0, 1.0, 3) if chance < 0.05 else np.zeros(3)
            if chance < 0.9:
                seen[name] = p + ERROR * away / np.linalg.norm(away) + off
        return seen

    def rows(self, seen):
        """The same in the order of the list."""
        return np.array([seen.get(o["name"], np.full(3, np.nan)) for o in self.moving])

    def least(self, q, q_next):
        """The least distance in the next period, at five instants of it [m]."""
        gaps = []
        for share in np.linspace(0.0, 1.0, 5):
            for o in self.obstacles:
                p = np.zeros(3)
                if "speed" in o:
                    p = self.gone[o["name"]] + share * PERIOD * self.v[o["name"]]
                gaps.append(arm_distance(self.arm, q + share * (q_next - q), o, p))
        return min(gaps)


def door_of(name, law, obstacles, hunters):
    """A function of a target, places and the time that returns the next command."""
    first = hunters.rows(hunters.gone)
    if name == "guard":
        return Guard(law, PERIOD, p_WO=first, t=0.0).command
    shield = Shield(PANDA, PERIOD, start=HOME, limits=law.limits, obstacles=obstacles)
    shield.command(0.0, first)

    def command(goal, rows, t):
        shield.follow_positions(goal, t=t)
        return shield.command(t, rows)

    return command


def hunted(seed, *, door, samples=150):
    """The least distance of an arm, while it moves, from obstacles that hunt it.

    Calls come late, and places are by name in every fourth. Distances are those of the numbers of
    the document.
    """
    rng = np.random.default_rng(seed)
    obstacles = random_list(rng)
    law = law_among(obstacles, (None, 80.0)[seed % 2])
    hunters = Hunters(obstacles, law.clearance.arm, rng)
    command = door_of(door, law, obstacles, hunters)
    t, q, goal, least = 0.0, HOME, HOME, np.inf
    for k in range(samples):
        late = rng.uniform(0.0, 3.0 * PERIOD) if rng.random() < 0.05 else 0.0
        t += PERIOD + late
        hunters.go_on(late)
        if k % 25 == 0:
            goal = HOME + rng.uniform(-1.2, 1.2, 7)
        hunters.turn(k, q)
        seen = hunters.measured()
        q_next = command(goal, seen if k % 4 == 3 else hunters.rows(seen), t)
        if np.abs(q_next - q).max() > 1e-12:
            least = min(least, hunters.least(q, q_next))
        hunters.go_on(PERIOD)
        q = q_next
    return least


@pytest.mark.filterwarnings("ignore:p_WO. thing")
@pytest.mark.parametrize("door", ["guard", "shield"])
def test_a_moving_arm_is_never_nearer_than_the_floor_in_any_order(door):
    assert hunted(1, door=door, samples=40) >= FLOOR


@pytest.mark.filterwarnings("ignore:p_WO. thing")
@pytest.mark.parametrize("door", ["guard", "shield"])
@pytest.mark.parametrize(
    "count",
    [pytest.param(12, marks=pytest.mark.long), pytest.param(250, marks=pytest.mark.nightly)],
)
def test_it_never_is_in_many_lists(door, count):
    """Most of them move, so that this is no test of arms that stand."""
    least = np.array([hunted(seed, door=door) for seed in range(2, 2 + count)])
    assert least.min() >= FLOOR
    assert np.isfinite(least).mean() > 0.9


LIST = [
    {"kind": "box", "name": "cup", "center": [-2, 0, 1], "size": [0.1] * 3, "speed": 0.3},
    {"kind": "ball", "name": "table", "center": [2, 0, 1], "radius": 0.1},
    {"kind": "ball", "center": [0, 2, 1], "radius": 0.1, "speed": 0.3},
]


def test_places_by_name_are_rows_and_what_is_left_out_is_not_measured():
    shield = Shield(PANDA, PERIOD, obstacles=LIST)
    assert shield.moving_obstacles == ("cup", "ball 3")
    shield.command(p_WO={"ball 3": [0, 0.1, 0], "cup": [0.2, 0, 0]})
    assert shield.p_WO.tolist() == [[0.2, 0, 0], [0, 0.1, 0]]
    shield.command(p_WO={"ball 3": [0, 0.1, 0]})
    np.testing.assert_array_equal(shield.p_WO, [[np.nan] * 3, [0, 0.1, 0]])


@pytest.mark.parametrize(
    ("p_WO", "message"),
    [
        ({"cap": [0, 0, 0]}, "'cap' is the name of no obstacle that may move; nearest: cup"),
        ({3: [0, 0, 0]}, "3 is the name of no obstacle that may move; it may be cup, ball 3"),
        ({"table": [0, 0, 0]}, "p_WO: 'table' may not move; give it its largest speed"),
        ({"cup": [0, 0]}, r"p_WO\['cup'\]: must be three numbers \[m\], how far it has gone in W"),
        ({"cup": "left"}, r"p_WO\['cup'\]: must be real numbers, not 'left'"),
        (np.zeros((3, 3)), r"must be of shape \(2, 3\), one row .* not \(3, 3\): cup, ball 3"),
    ],
)
def test_a_name_that_there_is_not_is_refused_with_those_that_there_are(p_WO, message):
    guard = Guard(law_among(LIST), PERIOD)
    with pytest.raises(InvalidInputError, match=message):
        guard.command(HOME, p_WO)


class Shelf(Obstacle):
    """Two boards, one thing."""

    @property
    def parts(self):
        boards = [{**LIST[0], "name": f"{self.name}/{k}", "center": [2, 0, k]} for k in (1, 2)]
        return make_obstacles(boards)


def test_what_consists_of_several_shapes_has_a_row_for_each_and_one_name():
    obstacles = [*make_obstacles(LIST), Shelf(name="shelf", speed=0.3)]
    clearance, _ = arm_clearance(PANDA, obstacles, HOME)
    solids = clearance.solids
    assert solids.moving_names == ("cup", "ball 3", "shelf/1", "shelf/2")
    rows = solids.places({"shelf": [0, 0, 0.1], "cup": np.ones(3)})
    np.testing.assert_array_equal(rows, [[1.0] * 3, [np.nan] * 3, [0, 0, 0.1], [0, 0, 0.1]])


def test_obstacles_without_a_name_get_one_and_no_name_is_given_twice():
    ball = BallObstacle(center=[0, 2, 1], radius=0.1, speed=0.2)
    clearance, _ = arm_clearance(PANDA, [ball, ball], HOME)
    assert clearance.solids.moving_names == ("ball 1", "ball 2")
    with pytest.raises(InvalidInputError, match="obstacles: 'cup' is the name of 2; must be of"):
        arm_clearance(PANDA, [*make_obstacles(LIST[:1])] * 2, HOME)
    with pytest.raises(InvalidInputError, match="obstacles: 'fog' must be a ball, capsule, box"):
        arm_clearance(PANDA, [Obstacle(name="fog", speed=0.2)], HOME)
