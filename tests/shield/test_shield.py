"""A shield: whatever a source sends, every bound holds; and what it sends well is followed well."""

from collections import Counter

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from drake_rnn import (
    Guard,
    InvalidInputError,
    JointStream,
    Shield,
    ShieldSettings,
    UnprotectedWarning,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from drake_rnn.laws.guard import StepInPlace
from drake_rnn.shield.chunks import Chunk, ChunkPath, SourceClock
from drake_rnn.shield.pursuit import Pursuit, WayPursuit

PERIOD, HELD = 5e-3, 1e-9
PANDA = load_arm("panda")
LIMITS = PANDA.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
HOME, KINEMATICS = PANDA.home, PANDA.kinematics()
POSE = np.concatenate(
    (KINEMATICS.p_WE(HOME), RotationMatrix(KINEMATICS.R_WE(HOME)).ToQuaternion().wxyz())
)
WAYS = np.array([1.0, -0.5, 0.3, 0.2, 0.1, 0.4, 0.6])


def ball_beside(p_EB, radius):
    """A ball beside the tool where the arm is at home."""
    center = (POSE[:3] + np.array(p_EB)).tolist()
    return {"kind": "ball", "center": center, "radius": radius}


def wave(t):
    return HOME + 0.3 * np.sin(1.5 * t) * WAYS


def motion(shield, duration, send, before=None):
    """Positions and velocities that a shield commands; ``send`` is called before each command."""
    rows = [(shield.position, shield.velocity)]
    for k in range(round(duration / shield.period)):
        send(shield, k * shield.period)
        rows.append((shield.command(k * shield.period), shield.velocity))
        if before is not None:
            before(shield)
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def chunks_of(values, every=0.2, rate=20.0, rows=16):
    """Send chunks of a function of time that agree with each other."""

    def send(shield, t):
        if round(t / PERIOD) % round(every / PERIOD) == 0:
            times = t + np.arange(rows) / rate
            shield.follow_positions([values(x) for x in times], rate=rate, start=t, t=t)

    return send


def storm(rng, kind):
    """Send chunks that disagree, come late, overtake each other and hold NaN."""

    def send(shield, t):
        if rng.random() > 20 * shield.period:
            return
        rows = int(rng.integers(1, 50))
        if kind == "positions":
            x = HOME + rng.uniform(-0.3, 0.3, 7) + np.cumsum(rng.normal(0, 0.05, (rows, 7)), axis=0)
        elif kind == "velocities":
            x = rng.normal(0.0, 1.0, (rows, 7)).clip(-3, 3)
        elif kind == "twists":
            x = rng.normal(0.0, 0.4, (rows, 6))
        else:
            x = np.tile(POSE, (rows, 1))
            x[:, :3] += np.cumsum(rng.normal(0, 0.03, (rows, 3)), axis=0)
            x[:, 3:] += rng.normal(0.0, 0.2, (rows, 4))
            x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1)[:, None]
        if rng.random() < 0.2:
            x[rng.integers(rows)] = np.nan
        follow = getattr(shield, f"follow_{kind}")
        follow(x, rate=rng.uniform(10, 50), start=t - rng.uniform(0.0, 0.8), t=t)

    return send


@pytest.mark.parametrize(
    "kind", ["positions", "velocities", pytest.param("twists", marks=pytest.mark.long), "poses"]
)
@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.nightly)]
)
def test_whatever_a_source_sends_every_bound_holds_and_nothing_is_touched(kind, seed):
    rng = np.random.default_rng(seed)
    limits = LIMITS if seed % 2 == 0 else LIMITS.replace(jerk=None)
    ball = {
        "kind": "ball",
        "center": (POSE[:3] + np.array([0.1, 0.2, 0.0])).tolist(),
        "radius": 0.05,
    }
    shield = Shield(
        PANDA,
        PERIOD,
        ShieldSettings(on_path=bool(seed % 2)),
        limits=limits,
        obstacles=[ball],
    )
    q, v = motion(shield, 2.5, storm(rng, kind))
    a = np.diff(v, axis=0) / PERIOD
    assert limits.violation(q).max() <= HELD
    assert np.abs(v).max() <= 1.0 + HELD
    assert np.abs(a).max() <= 5.0 * (1 + HELD)
    if limits.jerk is not None:
        assert np.abs(np.diff(a, axis=0)).max() <= 100.0 * PERIOD * (1 + HELD)
    assert shield.clearance.least_along(q).min() >= 0.005
    assert np.abs(v).max() > 0.1


def test_chunks_that_agree_are_followed_without_lag():
    """1.2 mrad rms; one target each 0.05 s, of the time at which it is sent, leaves 24 mrad."""
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    q, _ = motion(shield, 4.0, chunks_of(wave))
    t = PERIOD * np.arange(len(q))[:, None]
    assert np.sqrt(np.mean((q - wave(t))[400:] ** 2)) < 1.5e-3
    assert shield.status.behind < 5e-3
    assert shield.status.delay <= 0.02

    def one_by_one(shield, t):
        if round(t / PERIOD) % 10 == 0:
            shield.follow_positions(wave(t), t=t)

    held, _ = motion(Shield(PANDA, PERIOD, limits=LIMITS, collisions=False), 4.0, one_by_one)
    assert np.sqrt(np.mean((held - wave(t))[400:] ** 2)) > 0.02


def test_poses_and_twists_move_the_tool():
    """A circle of 10 cm: to 1 mm by poses; by twists, which name no place, to 1 cm."""
    wide = np.array([0.0, 1.0, 1.0])

    def place(t):
        return POSE[:3] + 0.1 * wide * [0.0, np.sin(1.5 * t), 1.0 - np.cos(1.5 * t)]

    def by_poses(shield, t):
        if round(t / PERIOD) % 40 == 0:
            rows = [[*place(t + k / 20), *POSE[3:]] for k in range(16)]
            shield.follow_poses(rows, rate=20.0, start=t, t=t)

    def by_twists(shield, t):
        if round(t / PERIOD) % 40 == 0:
            angles = 1.5 * (t + np.arange(16) / 20)
            zero = np.zeros_like(angles)
            rows = np.stack((zero, zero, zero, zero, np.cos(angles), np.sin(angles)), axis=1)
            shield.follow_twists(0.15 * rows, rate=20.0, start=t, t=t)

    for send, bound in ((by_poses, 1e-3), (by_twists, 0.01)):
        shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
        q, _ = motion(shield, 2.0, send)
        away = [KINEMATICS.p_WE(x) - place(PERIOD * k) for k, x in enumerate(q)]
        assert np.linalg.norm(away[100:], axis=1).max() < bound


def test_on_path_the_way_waits_for_an_arm_that_is_behind():
    """A corner of joints 1 and 2, too fast for the bounds: cut by 0.13 rad or by 0.043 rad."""
    off = {}
    for on_path in (False, True):
        settings = ShieldSettings(on_path=on_path)
        shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, collisions=False)
        corner = np.zeros((3, 7))
        corner[1:, 0], corner[2, 1] = 0.5, 0.5
        shield.follow_positions(HOME + corner, rate=3.0, start=0.0, t=0.0)
        q, _ = motion(shield, 4.0, lambda shield, t: None)
        one, two = (q - HOME)[:, :2].T
        # From the nearest point of the corner.
        off[on_path] = np.minimum(np.abs(two), np.abs(one - 0.5)).max()
        np.testing.assert_allclose(q[-1], HOME + corner[-1], atol=1e-3)
    assert off[True] < 0.4 * off[False]


@pytest.mark.parametrize(
    "settings",
    [ShieldSettings(), pytest.param(ShieldSettings(on_path=True), marks=pytest.mark.long)],
)
def test_no_joint_passes_what_its_source_asks_for(settings):
    """Not even where it is far, or where a chunk ends faster than the arm can stop."""
    slow = LIMITS.replace(acceleration=2.0)
    ways = {
        "far": (HOME + np.eye(7)[:1], None),
        "ends at once": (HOME + np.outer(np.linspace(0.0, 1.0, 11), np.eye(7)[0]), 10.0),
        "turns back": (HOME + np.outer([0.0, 0.5, 0.0], np.eye(7)[0]), 1.0),
    }
    for name, (targets, rate) in ways.items():
        shield = Shield(PANDA, PERIOD, settings, limits=slow, collisions=False)
        shield.follow_positions(targets, rate=rate, start=0.0, t=0.0)
        q, _ = motion(shield, 4.0, lambda *_: None)
        assert (q - HOME)[:, 0].max() <= (targets - HOME)[:, 0].max() + 1e-9, name
        assert (q - HOME)[:, 0].max() >= 0.4, name
        np.testing.assert_allclose(q[-1], targets[-1], atol=1e-3)
    # The law alone, to which each target is one to pass, does.
    law = JointStream(limits=slow, home=HOME, interval=0.1, pursues=True, timeout=0.2)
    guard = Guard(law, PERIOD)
    passed = max(guard.command(ways["far"][0][0])[0] - HOME[0] - 1.0 for _ in range(800))
    assert passed > 0.1


def test_an_arm_that_comes_late_to_a_way_that_moves_does_not_run_ahead_of_it():
    """It comes from 0.5 rad behind, at a quarter of its largest speed after that."""
    slow = LIMITS.replace(acceleration=2.0)
    shield = Shield(PANDA, PERIOD, limits=slow, collisions=False)
    times = np.arange(0.0, 4.0, 0.1)
    way = HOME + np.outer(0.5 + 0.25 * times, np.eye(7)[0])
    shield.follow_positions(way, rate=10.0, start=0.0, t=0.0)
    q, _ = motion(shield, 3.5, lambda *_: None)
    ahead = (q - HOME)[:, 0] - 0.5 - 0.25 * PERIOD * np.arange(len(q))
    assert ahead.max() < 0.002
    assert np.abs(ahead[-200:]).max() < 0.002


@pytest.mark.long
def test_on_path_poses_wait_for_the_tool_and_a_source_is_told_how_far_behind_it_is():
    """A corner of the tool, too fast for the bounds: cut by 28 mm, or by 12 mm."""
    off = {}
    for on_path in (False, True):
        settings, behind = ShieldSettings(on_path=on_path), list[float]()
        shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, collisions=False)
        corner = np.tile(POSE, (3, 1))
        corner[1:, 1], corner[2, 2] = POSE[1] + 0.2, POSE[2] - 0.2
        shield.follow_poses(corner, rate=3.0, start=0.0, t=0.0)

        def look(shield, behind=behind):
            behind.append(shield.status.behind)

        q, _ = motion(shield, 4.0, lambda *_: None, look)
        p = np.array([KINEMATICS.p_WE(x) for x in q]) - POSE[:3]
        off[on_path] = np.minimum(np.abs(p[:, 2]), np.abs(p[:, 1] - 0.2)).max()
        np.testing.assert_allclose(p[-1], [0.0, 0.2, -0.2], atol=1e-6)
        assert behind[-1] < 1e-5 < 0.1 < max(behind)
    assert off[True] < 0.45 * off[False]


def test_poses_go_on_where_the_last_ones_end_though_the_tool_is_far_behind():
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    away, farther = np.array(POSE), np.array(POSE)
    away[1], farther[:2] = POSE[1] + 0.4, (POSE[0] - 0.2, POSE[1] + 0.6)
    with pytest.raises(InvalidInputError, match=r"X_WE: begins 0.632 m from the tool"):
        shield.follow_poses(farther, t=0.0)
    assert shield.follow_poses(away, t=0.0)
    assert shield.follow_poses(farther, t=0.0)


def test_a_source_is_told_what_blocks_the_arm_and_for_how_long():
    ball = {
        "kind": "ball",
        "center": (POSE[:3] + np.array([0.0, 0.3, 0.0])).tolist(),
        "radius": 0.15,
    }
    shield = Shield(PANDA, PERIOD, limits=LIMITS, obstacles=[ball])
    target = HOME + 0.8 * np.eye(7)[0]
    seen = list[tuple[float, bool]]()

    def note(shield):
        if shield.time > 0.5 and round(shield.time / PERIOD) % 10 == 0:
            status = shield.status
            seen.append((status.blocked_for, any("ball" in name for name in status.limited_by)))

    motion(shield, 3.0, lambda shield, t: shield.follow_positions(target, t=t), note)
    assert shield.status.behind > 0.05
    assert max(blocked for blocked, _ in seen) > 0.4
    assert np.mean([by_ball for _, by_ball in seen]) > 0.5


def test_it_says_which_limit_holds_the_arm_back():
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    seen = set()
    target = HOME + 1.5 * np.eye(7)[0]
    motion(
        shield,
        2.0,
        lambda shield, t: shield.follow_positions(target, t=t),
        lambda shield: seen.update(shield.status.limited_by),
    )
    assert {f"panda_joint1 {name}" for name in ("velocity", "acceleration", "jerk")} <= seen
    assert not any(name.startswith("panda_joint3 velocity") for name in seen)


def recorded(duration, send, **options):
    """A shield that records, after a motion."""
    settings = ShieldSettings(record=True, compiled=options.pop("compiled", False))
    shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, **options)
    motion(shield, duration, send)
    return shield


def to(target):
    return lambda shield, t: shield.follow_positions(target, t=t)


def test_of_a_target_that_jumps_the_record_tells_jerk_then_acceleration_then_velocity():
    """With a = 5, J = 100 and v = 1: 0.05 s of jerk, then until v - a^2 / 2J = 0.875 rad/s."""
    for sign, side in ((1.0, "upper"), (-1.0, "lower")):
        target = HOME + 1.2 * sign * np.eye(7)[0]
        record = recorded(0.5, to(target), collisions=False).record
        told = [record.at(k) for k in range(len(record.time))]
        assert {len(each) for each in told} == {1}
        assert {(each[0].joint, each[0].side) for each in told} == {("panda_joint1", side)}
        limits = [each[0].limit for each in told]
        ends = [limits.index(name) * PERIOD for name in ("acceleration", "velocity")]
        assert limits == sorted(limits, key=["jerk", "acceleration", "velocity"].index)
        assert ends[0] == pytest.approx(0.05, abs=1.01 * PERIOD)
        assert ends[1] == pytest.approx(0.05 + (0.875 - 0.125) / 5.0, abs=2 * PERIOD)


@pytest.mark.long
def test_a_target_beyond_a_position_limit_is_told_as_that():
    """Joint 6 is asked for 0.2 rad more than its upper limit, and rests there."""
    target = HOME.copy()
    target[5] = LIMITS.position_upper[5] + 0.2
    record = recorded(4.0, to(target), collisions=False).record
    assert record.at(-1) == (("panda_joint6", "position", "upper"),)
    assert record.deviation[-1] == pytest.approx(0.2, abs=1e-4)
    assert record.summary.limit_time["position"][1, 5] > 0.5


def test_of_targets_within_all_bounds_nothing_is_told():
    def gently(shield, t):
        if round(t / PERIOD) % 40 == 0:
            x = t + np.arange(400) / 200
            rows = HOME + 0.1 * np.outer(1.0 - np.cos(1.5 * x), WAYS)
            shield.follow_positions(rows, rate=200.0, start=t, t=t)

    record = recorded(2.0, gently).record
    assert not record.limits[20:].any()
    assert not record.pairs.any()
    assert record.summary.stopped == 0.0


BALL_IN_THE_WAY = ball_beside([0.0, 0.25, 0.0], 0.12)


def test_a_ball_in_the_way_is_told_by_name_and_sums_agree_with_samples():
    shield = recorded(1.5, to(HOME + 0.8 * np.eye(7)[0]), obstacles=[BALL_IN_THE_WAY])
    record = shield.record
    told = [record.at(k) for k in range(len(record.time))]
    assert not any("ball 1" in each for each in told[0])
    last = {str(each) for each in told[-1]}
    assert last & {"panda_link7 and ball 1", "tool and ball 1"}
    assert set(shield.status.limited_by) == last
    # Of 57 pairs those alone that come to what is kept between bodies, 10 mm, in the next moments.
    clearance, _ = arm_clearance(shield.arm, make_obstacles(shield.obstacles), HOME)
    gaps = clearance.gaps(record.command[-1])
    pairs = {
        f"{a} and {b}" for (a, b), gap in zip(clearance.names, gaps, strict=True) if gap < 0.015
    }
    assert {each for each in last if " and " in each} <= pairs
    summary = record.summary
    times = dict(summary.rows(record.joints))
    count = Counter(str(each) for row in told for each in row)
    assert times == pytest.approx({name: PERIOD * number for name, number in count.items()})
    assert summary.intervened == pytest.approx(PERIOD * sum(bool(each) for each in told))
    away = np.abs(record.wanted - record.command).max(axis=1)
    assert summary.largest_deviation == away.max()
    assert summary.rms_deviation == pytest.approx(np.sqrt(np.mean(away**2)))
    assert len(set(record.pair_names)) == len(record.pair_names)


@pytest.mark.long
@pytest.mark.parametrize("collides", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_a_compiled_step_is_told_as_that_of_numpy_from_the_same_state(collides):
    """By rounding two motions past a ball part; so each step is made again from where it began."""
    around = {"obstacles": [BALL_IN_THE_WAY]} if collides else {"collisions": False}
    shield = recorded(1.5, to(HOME + 0.8 * np.eye(7)[0]), compiled=True, **around)
    seen = 0
    for sample in list(shield._samples)[::5]:
        step = sample.step
        after = step.reading.step(0.0, step.x, step.u, PERIOD)
        v = step.reading.state.part(after, "v")
        again, causes = step.reading.causes(step.x, step.u, v), step.causes
        np.testing.assert_array_equal(again.limits, causes.limits)
        np.testing.assert_array_equal(again.pairs, causes.pairs)
        seen += bool(causes.limits.any() or len(causes.pairs))
        # Nothing holds back what brakes for its target.
        assert causes.limits.any() or collides or sample.wanted_velocity[0] < LIMITS.velocity[0]
    assert seen > 20


def test_an_arm_that_rests_where_it_is_wanted_is_not_late():
    """It was wanted there for a second; it comes 0.3 s later than wanted, and is there then."""
    record = recorded(2.0, to(HOME + 0.1 * np.eye(7)[0]), collisions=False).record
    assert record.delay[-1] < 0.02
    assert record.deviation[-1] < 1e-3


def test_poses_are_followed_where_no_jerk_is_reached():
    """A jerk of 1e5 bounds nothing at 5 ms and 5 rad/s^2."""
    limits = LIMITS.replace(jerk=1e5)
    shield = Shield(PANDA, PERIOD, ShieldSettings(record=True), limits=limits, collisions=False)
    target = POSE + 0.05 * np.eye(7)[1]
    motion(shield, 1.0, lambda shield, t: shield.follow_poses(target, t=t))
    assert np.linalg.norm(KINEMATICS.p_WE(shield.position) - target[:3]) < 2e-3
    told = {str(each) for k in range(20) for each in shield.record.at(k)}
    assert any(name.endswith("acceleration") for name in told)
    assert not any(name.endswith("jerk") for name in told)


@pytest.mark.parametrize("kind", ["positions", pytest.param("twists", marks=pytest.mark.long)])
def test_whatever_keeps_a_command_from_what_is_wanted_is_told(kind):
    """Beside a ball that moves, with a bound of the jerk and without: no difference has none."""
    ball = {**ball_beside([0.1, 0.2, 0.0], 0.05), "speed": 0.2, "error": 2e-3}
    limits = LIMITS if kind == "positions" else LIMITS.replace(jerk=None)
    settings = ShieldSettings(record=True)
    shield = Shield(PANDA, PERIOD, settings, limits=limits, obstacles=[ball])
    send, by_pairs = storm(np.random.default_rng(1), kind), 0
    for k in range(200):
        send(shield, k * PERIOD)
        shield.command(k * PERIOD, np.array([[0.0, -0.1 * np.sin(k * PERIOD), 0.0]]))
    record = shield.record
    for k, sample in enumerate(shield._samples):
        v = sample.step.v
        differs = np.abs(sample.step.wanted - v) > 1e-6 + 1e-3 * np.abs(v)
        assert not differs.any() or record.at(k)
        by_pairs += bool(record.pairs[k].any())
    assert by_pairs > 5


def test_the_last_commands_are_recorded_or_none():
    shield = Shield(PANDA, PERIOD, ShieldSettings(record=20), limits=LIMITS, collisions=False)
    motion(shield, 0.5, to(HOME))
    np.testing.assert_allclose(shield.record.time, PERIOD * np.arange(80, 100))
    with pytest.raises(InvalidInputError, match=r"make it with ShieldSettings\(record=True\)"):
        _ = Shield(PANDA, PERIOD, collisions=False).record


def test_without_velocities_or_twists_the_arm_comes_to_rest():
    """After the timeout of 0.2 s and v / a + a / J: 0.25 s."""
    for kind, target in (("velocities", 0.5 * np.eye(7)[0]), ("twists", [0, 0, 0, 0.1, 0, 0])):
        shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)

        def send(shield, t, kind=kind, target=target):
            if t < 1.0:
                getattr(shield, f"follow_{kind}")(target, t=t)

        _, v = motion(shield, 2.0, send)
        assert np.abs(v[200]).max() > 0.05
        assert np.abs(v[round(1.5 / PERIOD) :]).max() < 1e-3


def hold(shield, V_WE, duration, t=0.0):
    """Hold a twist, and return the positions, shape (k, n), and the time then."""
    motion = [shield.position]
    for _ in range(round(duration / shield.period)):
        shield.follow_twists(V_WE, t=t)
        motion.append(shield.command(t))
        t += shield.period
    return np.array(motion), t


def check_it_rests_and_leaves(name, period, bounds, V_WE, ways, duration=4.5):
    """Hold a twist past the end of reach: rest is exact, and each other way is gone at once."""
    arm = load_arm(name)
    limits = arm.limits.replace(velocity=1.0, acceleration=bounds[0], jerk=bounds[1])
    kinematics = arm.kinematics()
    for way in ways:
        shield = Shield(arm, period, limits=limits, collisions=False)
        motion, t = hold(shield, V_WE, duration)
        assert np.abs(np.diff(motion, axis=0)).max() <= period * (1.0 + 1e-9)
        last = motion[-round(1.0 / period) :]
        p_end = kinematics.p_WE(shield.position)
        if V_WE[:3].any():
            # A tool that gets no further may turn on.
            assert np.linalg.norm(p_end - kinematics.p_WE(last[0])) < 5e-3
        else:
            assert np.abs(np.diff(last, axis=0)).max() < 0.01 * period
        away, _ = hold(shield, way, 0.5, t)
        assert np.linalg.norm(kinematics.p_WE(away[-1]) - p_end) > 1e-3


FORWARD, UP = np.array([0, 0, 0, 0.2, 0, 0]), np.array([0, 0, 0, 0, 0, 0.2])


@pytest.mark.parametrize(
    ("name", "jerk"), [("panda", 50.0), pytest.param("iiwa14", 100.0, marks=pytest.mark.long)]
)
def test_a_twist_held_past_the_end_of_reach_comes_to_rest_and_is_left_at_once(name, jerk):
    """As a velocity, such a twist swings these arms at their limits of velocity for ever."""
    check_it_rests_and_leaves(name, 1e-2, (5.0, jerk), FORWARD, [-FORWARD])


@pytest.mark.long
@pytest.mark.parametrize("name", ["panda", "fr3", "iiwa14", "ur5", "planar6"])
@pytest.mark.parametrize(
    ("period", "jerk"),
    [
        pytest.param(1e-3, 50.0, marks=pytest.mark.nightly),
        pytest.param(5e-3, 300.0, marks=pytest.mark.nightly),
        (1e-2, 5000.0),
    ],
)
def test_twists_past_the_end_of_reach_come_to_rest_at_all_periods_and_jerks(name, period, jerk):
    is_flat = name == "planar6"
    ways = [-FORWARD, np.roll(FORWARD, 1) if is_flat else UP]
    check_it_rests_and_leaves(name, period, (5.0, jerk), FORWARD, ways, 9.0)
    if not is_flat:
        turning = np.array([0, 0, 0.3, 0.2, 0, 0])
        check_it_rests_and_leaves(name, period, (10.0, jerk), turning, [-turning], 9.0)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["twists", "poses"])
def test_a_tool_led_into_a_table_rests_names_it_calls_back_and_leaves_at_once(kind):
    """What is safe slides aside, and the law leads back: without a remedy that swings for ever."""
    table = {"kind": "box", "center": [0.55, 0.0, 0.35], "size": [0.6, 0.8, 0.1]}
    calls, period = [], 1e-2
    shield = Shield(
        PANDA, period, limits=LIMITS, obstacles=[table], on_blocked=lambda s: calls.append(s)
    )
    target = np.concatenate((POSE[:3] - [0.0, 0.0, 0.4], POSE[3:]))
    for k in range(320):
        if kind == "twists" or not k:
            shield.follow(kind, target if kind == "poses" else -UP, t=k * period)
        shield.command(k * period)
        if k > 270:
            assert np.abs(shield.velocity).max() < 0.01
    (call,) = calls
    assert 0.3 <= call.blocked_for < 0.32
    assert "tool and box 1" in call.limited_by
    assert "tool and box 1" in shield.status.limited_by
    p_end = KINEMATICS.p_WE(shield.position)
    hold(shield, UP, 0.5, 3.2)
    assert KINEMATICS.p_WE(shield.position)[2] > p_end[2] + 1e-3
    assert shield.status.blocked_for == 0.0


@pytest.mark.long
def test_what_is_told_of_a_blockage_does_not_depend_on_who_has_asked_before():
    table = {"kind": "box", "center": [0.55, 0.0, 0.35], "size": [0.6, 0.8, 0.1]}
    often, once = (Shield(PANDA, 1e-2, limits=LIMITS, obstacles=[table]) for _ in range(2))
    for k in range(270):
        for shield in (often, once):
            shield.follow_twists(-UP, t=1e-2 * k)
            shield.command(1e-2 * k)
        assert often.status is not None
    assert once.status == often.status
    assert "tool and box 1" in once.status.limited_by


@pytest.mark.long
def test_velocities_held_at_a_limit_and_poses_out_of_reach_are_told():
    cases = {
        "velocities": ([0, 0, 0, -0.6, 0, 0, 0], ("panda_joint4 position",)),
        "poses": (POSE + np.array([0.45, 0, 0, 0, 0, 0, 0]), ("reach",)),
    }
    for kind, (target, limits) in cases.items():
        shield = Shield(PANDA, 1e-2, limits=LIMITS, collisions=False)
        for k in range(350):
            if kind == "velocities" or not k:
                shield.follow(kind, target, t=1e-2 * k)
            shield.command(1e-2 * k)
        status = shield.status
        assert np.abs(shield.velocity).max() < 0.01
        assert status.blocked_for > 0.5
        assert status.limited_by == limits
        assert status.arrived == 0


def test_it_is_told_when_the_arm_has_come_to_rest_at_the_end_of_a_chunk():
    shield = Shield(PANDA, 1e-2, limits=LIMITS, collisions=False)
    assert shield.follow_positions([HOME, HOME + 0.1], rate=5.0, start=0.0, t=0.0) == 1
    for k in range(150):
        if k == 30:  # before the first one has ended
            assert shield.follow_positions(HOME + 0.05, t=0.3) == 2
        q = shield.command(1e-2 * k)
        if shield.status.arrived:
            assert np.abs(q - HOME - 0.05).max() < 2e-3
    assert shield.status.arrived == 2
    assert shield.follow_positions(np.full(7, np.nan), t=1.5) == 0


def test_what_is_called_of_a_blockage_must_be_a_function_and_what_it_raises_is_told():
    with pytest.raises(InvalidInputError, match=r"on_blocked: must be a function"):
        Shield(PANDA, 1e-2, on_blocked="stop")
    shield = Shield(PANDA, 1e-2, limits=LIMITS, collisions=False, on_blocked=lambda s: 1 / 0)

    def hold_a_velocity():
        for k in range(250):
            shield.follow_velocities([0, 0, 0, -0.6, 0, 0, 0], t=1e-2 * k)
            shield.command(1e-2 * k)

    with pytest.warns(UserWarning, match=r"on_blocked: ZeroDivisionError"):
        hold_a_velocity()


@pytest.mark.parametrize("kind", ["positions", "poses"])
def test_an_arm_that_was_brought_to_rest_stays_where_it_is_wanted(kind):
    """Also led by its tool, whose law wants what it wanted before no more."""
    shield = Shield(PANDA, 1e-2, limits=LIMITS, collisions=False)
    target = POSE + np.array([0.2, 0, 0, 0, 0, 0, 0]) if kind == "poses" else HOME + 0.5
    shield.follow(kind, target, t=0.0)
    for k in range(40):
        shield.command(1e-2 * k)
    assert np.abs(shield.velocity).max() > 0.05
    shield.resume(HOME, t=0.5)
    np.testing.assert_array_equal(shield.command(0.5), HOME)
    shield.follow(kind, POSE if kind == "poses" else HOME, t=0.51)
    for k in range(51, 90):
        assert np.abs(shield.command(1e-2 * k) - HOME).max() < 1e-9


def test_it_goes_on_from_where_others_have_moved_the_arm():
    shield = Shield(PANDA, 1e-2, limits=LIMITS)
    shield.follow_positions(HOME + 0.1, t=0.0)
    for k in range(20):
        shield.command(1e-2 * k)
    q, way = HOME - 0.1, np.full(7, -0.05)
    shield.resume(q, t=1.0)
    np.testing.assert_array_equal(shield.position, q)
    np.testing.assert_allclose(shield.command(1.0), q, atol=1e-3)
    shield.follow_positions(q + way, t=1.0)
    rows = [q] + [shield.command(1.0 + 1e-2 * k) for k in range(1, 150)]
    assert np.abs(np.diff(rows, axis=0)).max() < 1e-2 * 1.0
    np.testing.assert_allclose(rows[-1], q + way, atol=1e-4)
    assert shield.uncertified == 0
    with pytest.raises(InvalidInputError, match=r"q: must be 7 numbers"):
        shield.resume(HOME[:6], t=3.0)
    with pytest.raises(InvalidInputError, match=r"q: .* outside"):
        shield.resume(HOME + 9.0 * np.eye(7)[1], t=3.0)


@pytest.mark.long
def test_a_twist_faster_than_any_feedback_is_followed_and_rests_too():
    """0.9 m/s: the tool gets there, and comes to rest where it cannot go on."""
    arm = load_arm("panda")
    limits = arm.limits.replace(acceleration=20.0, jerk=2000.0)
    shield = Shield(arm, 1e-2, limits=limits, collisions=False)
    V_WE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -0.9])
    motion, t = hold(shield, V_WE, 0.22)
    v_tool = arm.kinematics().J(motion[-1]) @ shield.velocity
    assert abs(v_tool[2] + 0.9) < 0.02
    motion, _ = hold(shield, V_WE, 3.0, t)
    assert np.abs(np.diff(motion[-50:], axis=0)).max() < 1e-2 * 0.01


def test_a_joint_that_turns_without_end_goes_the_shorter_way_and_no_other():
    arm = load_arm("gen3")
    (endless,) = np.flatnonzero(arm.endless[:1])
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=None)
    target = arm.home + (2.0 * np.pi - 0.3) * np.eye(arm.n)[endless]
    shield = Shield(arm, PERIOD, limits=limits, collisions=False)
    q, _ = motion(shield, 1.5, lambda shield, t: shield.follow_positions(target, t=t))
    assert q[-1, endless] - arm.home[endless] == pytest.approx(-0.3, abs=1e-3)


# Clocks and orders of messages.


@pytest.mark.parametrize(("offset", "drift"), [(1.7e9, 0.0), (-30.0, 0.0), (5.0, 1e-3)])
def test_a_source_with_a_clock_of_its_own_is_followed_as_one_without(offset, drift):
    """Messages take 2 to 30 ms on their way: of the least of these the way comes later."""
    rng, shield = (
        np.random.default_rng(0),
        Shield(PANDA, PERIOD, limits=LIMITS, collisions=False),
    )

    def send(shield, t):
        if round(t / PERIOD) % 20 == 0:
            before = t - rng.uniform(0.002, 0.03)
            rows = [wave(before + k / 20) for k in range(16)]
            clock = offset + (1.0 + drift) * before
            shield.follow_positions(rows, rate=20.0, start=clock, sent=clock, t=t)

    q, _ = motion(shield, 3.0, send)
    t = PERIOD * np.arange(len(q))[:, None]
    assert np.sqrt(np.mean((q - wave(t))[200:] ** 2)) < 4e-3
    assert shield.counts.expired == shield.counts.overtaken == 0


def test_a_clock_that_is_set_back_stops_the_arm_for_10_s_at_most():
    clock = SourceClock()
    for k in range(200):
        t = 0.1 * k
        behind = 0.0 if t < 5.0 else 3.0
        offset = clock.offset(t - behind - 0.01, t)
        if t >= 15.1:
            assert offset == pytest.approx(3.01)
    assert clock.offset(100.0, 20.0) == pytest.approx(-80.0)


def test_a_chunk_far_ahead_does_not_have_later_ones_dropped():
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    shield.follow_positions(HOME - 0.3, start=50.0, t=0.0)
    target = HOME + 0.2
    motion(shield, 2.0, lambda shield, t: shield.follow_positions(target, t=t))
    np.testing.assert_allclose(shield.position, target, atol=1e-3)
    assert (shield.counts.early, shield.counts.overtaken) == (1, 0)


def test_what_comes_before_the_first_command_counts_from_then_on():
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    shield.follow_positions(HOME + np.array([[0.0], [0.2]]), rate=1.0)
    for k in range(300):
        shield.command(1e3 + k * PERIOD)
    np.testing.assert_allclose(shield.position, HOME + 0.2, atol=5e-3)


def test_it_comes_to_rest_when_it_is_told_to():
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    motion(shield, 0.5, lambda shield, t: shield.follow_positions(HOME + 0.5, t=t))
    assert np.abs(shield.velocity).max() > 0.3
    shield.rest()
    for k in range(round(0.25 / PERIOD) + 2):
        shield.command(0.5 + k * PERIOD)
    assert np.abs(shield.velocity).max() < 1e-9


# The way through chunks.


def path_of(*starts, switch="blend"):
    """A path through chunks of one number, each 1 s of ones, twos, threes at 10 Hz."""
    path = ChunkPath(switch=switch)
    for k, start in enumerate(starts):
        path.put(Chunk(start + 0.1 * np.arange(11), np.full((11, 1), k + 1.0)), start)
    return path


def test_chunks_that_disagree_are_blended_without_a_jump():
    path = path_of(0.0, 0.5)
    values = [path.at(t)[0] for t in np.arange(0.5, 0.65, 1e-3)]
    assert values[0] == 1.0
    assert values[-1] == 2.0
    assert np.abs(np.diff(values)).max() < 0.011
    assert path_of(0.0, 0.5, switch="now").at(0.501)[0] == 2.0


def test_the_way_of_a_stick_at_1_khz_is_the_blend_of_what_was_wanted_and_its_newest_target():
    """At all times at which the way may bend, also if it waits in between."""
    rng, path = np.random.default_rng(0), ChunkPath()
    for k in range(300):
        now, before, target = 1e-3 * k, path.path, rng.normal(size=(1, 2))
        path.put(Chunk(np.array([now]), target), now)
        if k % 50 == 49:
            path.put_off(5e-4)
        elif before is not None:
            times, weight = path.path.times, np.clip((path.path.times - now) / 0.1, 0.0, 1.0)
            wanted = (1.0 - weight)[:, None] * before.at(times) + weight[:, None] * target
            assert (np.diff(times) > 0.0).all()
            assert path.path.values == pytest.approx(wanted, abs=1e-14)
            assert set(before.times[(before.times > now) & (before.times < now + 0.1)]) <= {*times}


def test_an_ensemble_is_the_weighted_mean_of_what_covers_a_time():
    path = path_of(0.0, 0.5, 0.6, switch="ensemble")
    w = np.exp(-0.1 * np.arange(3))
    assert path.at(0.8)[0] == pytest.approx(w @ [1.0, 2.0, 3.0] / w.sum())
    assert path.at(1.6)[0] == pytest.approx(3.0)


@pytest.mark.parametrize("switch", ["blend", "now", "ensemble"])
def test_whatever_chunks_come_the_way_stays_between_their_targets(switch):
    """Late, short and overtaken ones, some over when they come, with rows of NaN, and pauses."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        path, now, sent = ChunkPath(switch=switch), 0.0, list[np.ndarray]()
        for _ in range(12):
            now += rng.exponential(0.4)
            rows = int(rng.integers(1, 12))
            times = now - rng.uniform(-0.3, 1.2) + np.arange(rows) / rng.uniform(10.0, 50.0)
            values = rng.uniform(-1.0, 1.0, (rows, 2))
            values[rng.random(rows) < 0.2, 0] = np.nan
            if path.put(Chunk(times, values), now):
                sent.append(values)
            if not sent:
                continue
            if rng.random() < 0.3:
                path.put_off(0.1)
            assert np.isfinite(path.end)
            rows = np.concatenate(sent)
            lower, upper = np.nanmin(rows, axis=0), np.nanmax(rows, axis=0)
            for value in (*map(path.at, now + rng.uniform(0.0, 2.0, 4)), path.mean(now, now + 1)):
                assert (value >= lower - 1e-9).all()
                assert (value <= upper + 1e-9).all()


def test_of_an_ensemble_that_is_over_the_newest_target_is_held():
    path = path_of(0.0, switch="ensemble")
    assert path.put(Chunk(np.array([1.0, 1.1]), np.array([[4.0], [5.0]])), 1.5)
    assert path.at(1.6)[0] == 5.0


def test_what_is_no_number_late_or_overtaken_is_counted_and_not_followed():
    path = ChunkPath(stale=0.2)
    values = np.arange(10.0)[:, None]
    values[4] = np.nan
    assert path.put(Chunk(0.1 * np.arange(10), values), 0.25)
    assert path.at(0.4)[0] == pytest.approx(4.0)
    assert not path.put(Chunk(-0.1 + 0.1 * np.arange(10), values), 0.3)
    assert not path.put(Chunk(np.array([0.05]), np.array([[9.0]])), 0.35)
    assert not path.put(Chunk(np.array([0.5]), np.array([[np.nan]])), 0.4)
    counts = path.counts
    assert (counts.chunks, counts.overtaken, counts.expired, counts.empty) == (4, 1, 1, 1)
    assert (counts.invalid_rows, counts.late_rows) == (3, 8)


DEGREES, ROWS, TIMES = np.rad2deg(HOME), np.tile(HOME, (16, 1)), np.arange(16) / 20.0
W_LAST = [*POSE[:3], *POSE[4:], POSE[3]]


def timed(shield):
    """One whose commands tell the time."""
    shield.command(100.0)
    return shield


def by_milliseconds(shield):
    for k in range(100):
        shield.follow_positions(HOME, t=float(k), sent=1e3 * k)


REFUSALS = [
    (lambda s: s.follow_positions(HOME[:6]), "q: must be one target of 7 numbers or rows of them"),
    (lambda s: s.follow_positions(np.append(HOME, 0.04)), "the gripper is to do is no target"),
    (lambda s: s.follow_positions(ROWS.T, rate=20), "it looks transposed"),
    (lambda s: s.follow_positions(ROWS[None], rate=20), "it has an axis too many, such as that of"),
    (lambda s: s.follow_positions([None] * 7), "q: must be real numbers, not"),
    (
        lambda s: s.follow_positions(np.tile(HOME, (3, 1))),
        "of 3 targets the rate, or times, must",
    ),
    (lambda s: s.follow_positions(DEGREES), "angles are in radians, and these look like degrees"),
    (lambda s: s.follow_positions(0.1 * DEGREES), "radians, and these look like degrees"),
    (lambda s: s.follow_velocities(30.0 * np.ones(7)), "must be in rad/s, not degrees a second"),
    (
        lambda s: s.follow_positions(HOME, start=1.7e9),
        "in seconds since 1970; before the first command, t tells the time now",
    ),
    (lambda s: s.follow_poses(POSE[:3]), "a pose has a quaternion too, after the position"),
    (lambda s: s.follow_positions(HOME, start=1.7e12), "milli- or nanoseconds since 1970"),
    (lambda s: s.follow_positions(HOME, start=1e5, t=100.0), "it looks like milliseconds"),
    (lambda s: s.follow_positions(HOME, start=1e10, t=10.0), "it looks like nanoseconds"),
    (lambda s: s.follow_positions(HOME, start=1.0, t=1e3), "a time since the begin of something"),
    (lambda s: s.follow_positions(HOME, start=1e5), "before the first command, t tells the time"),
    (lambda s: s.follow_positions(ROWS, start=TIMES), "times of all targets are given as times"),
    (lambda s: s.follow_positions(ROWS, rate=TIMES), "times of all targets are given as times"),
    (lambda s: s.follow_positions(HOME, rate=0.05), "must be a rate in Hz, not a time between two"),
    (lambda s: s.follow_positions(ROWS, rate=20e3), "5e-05 s apart; must be a rate in Hz"),
    (lambda s: s.follow_positions(ROWS, times=1e3 * TIMES), "in seconds, not milliseconds"),
    (
        lambda s: s.follow_positions(ROWS, times=1.0 - TIMES),
        "times: must increase; 1 s is ",
    ),
    (lambda s: s.follow_positions(ROWS, times=TIMES[1:]), "times: must be of shape \\(16,\\), one"),
    (lambda s: s.follow_positions(ROWS, rate=20, times=TIMES), "in place of rate and start"),
    (lambda s: timed(s).follow_positions(HOME, t=1e5), "must be in seconds, on the clock of comm"),
    (lambda s: timed(s).follow_positions(HOME, t="now"), "t: must be a time"),
    (lambda s: (s.command(), s.follow_positions(HOME, t=5.0)), "t: must be left out where comma"),
    (lambda s: (s.follow_positions(HOME, t=5.0), s.command()), "t: must be given to command as it"),
    (by_milliseconds, "sent: has changed by 1e\\+03 s in 1 s; must be in seconds, on one clock"),
    (lambda s: s.follow_poses([*POSE[:3], 2, 0, 0, 0]), "quaternion of length 2; must be of"),
    (lambda s: s.follow_poses([1e300] * 7), "quaternion of length 2e\\+100; must be of"),
    (lambda s: s.follow_poses([*POSE[3:], *POSE[:3]]), "it comes first, and must come after"),
    (lambda s: s.follow_poses(W_LAST), "looks as if w came last, and must have it first"),
    (lambda s: s.follow_poses(np.eye(4)), "a position and a quaternion, not a matrix"),
    (lambda s: s.follow_poses(np.zeros(6)), "a pose has a quaternion, not angles"),
    (lambda s: s.follow_poses(POSE + np.eye(7)[0] * 5), "positions are in metres, in W"),
    (lambda s: s.follow_poses([*1e3 * POSE[:3], *POSE[3:]]), "they look like millimetres"),
    (lambda s: s.follow_poses([0, 0, 0.05, 1, 0, 0, 0]), "It looks like a step from the tool"),
    (lambda s: s.follow_twists([0, 0, 0.1]), "a twist has an angular velocity too, first"),
    (lambda s: s.follow_twists([0, 0, 0, 100, 0, 0]), "not in millimetres"),
    (lambda s: s.follow("torques", HOME), "kind: may be positions, velocities, poses, twists, not"),
    (lambda s: ShieldSettings(switch="mix"), "switch: "),
    (lambda s: ShieldSettings(lookahead=0.0), "lookahead: "),
    (lambda s: Shield(PANDA, 5), "must be the seconds between two commands, neither millisec"),
    (lambda s: Shield(PANDA, 1000.0), "nor a rate; 1000 Hz would be 0.001"),
    (lambda s: Shield("panda", PERIOD), "arm: must be an Arm, such as load_arm\\('panda'\\)"),
    (lambda s: Shield(PANDA, PERIOD, start=DEGREES), "and these look like degrees"),
    (
        lambda s: Shield(PANDA, PERIOD, limits=load_arm("ur5").limits),
        "limits: are of 6 joints, but",
    ),
]


@pytest.mark.parametrize(("use", "text"), REFUSALS, ids=range(len(REFUSALS)))
def test_what_cannot_be_meant_is_refused_with_the_likely_mistake(use, text):
    with pytest.raises(InvalidInputError, match=text):
        use(Shield(PANDA, PERIOD, limits=LIMITS, collisions=False))


def test_what_its_promises_rest_on_is_data():
    """Obstacles as stated, calls within the tolerance; of a robot nothing is known to hold."""
    arm = load_arm("panda")
    ball = {"kind": "ball", "center": [0.6, 0.4, 0.5], "radius": 0.05, "speed": 0.2, "error": 1e-3}
    shield = Shield(arm, 1e-2, obstacles=[ball])
    found = {each.what: (each.most, each.unit) for each in shield.assumptions}
    assert found["lateness of a call"] == (shield.settings.tolerance or 5e-3, "s")
    assert found["speed of an obstacle"] == (0.2, "m/s")
    assert found["error of an obstacle's place"] == (1e-3, "m")
    assert found["error of the kinematics of the arm's model"] == (0.0, "m")
    assert all(each.holds is None for each in shield.assumptions)
    guard = Guard.within(arm.limits, arm.home, 1e-2)
    assert [each.what for each in guard.assumptions] == [
        "lateness of a call",
        "deviation of the arm from its command",
    ]


def test_a_shield_without_accelerations_says_that_velocities_jump():
    limits = PANDA.limits.replace(acceleration=None, jerk=None)
    text = r"^limits: no acceleration is known of panda"
    with pytest.warns(UnprotectedWarning, match=text) as told:
        shield = Shield(PANDA, PERIOD, limits=limits)
    assert [each.filename for each in told] == [__file__]
    assert str(told[0].message) in shield.warnings


def test_a_way_is_pursued_as_if_its_pieces_were_looked_for_at_each_sample():
    def pursuit():
        law = Pursuit(0.1, 0.005, np.array([5.0, np.inf]))
        return WayPursuit(law, lambda law, h: StepInPlace.by(law.step, law, h))

    rng, kept = np.random.default_rng(0), pursuit()
    way = ChunkPath()
    for k in range(600):
        now = 0.005 * k
        if k % 37 == 0:
            times = now + np.array([-0.01, 0.02, 0.02, 0.13, 0.3])[: rng.integers(1, 6)]
            way.put(Chunk(times, rng.normal(size=(times.size, 2))), now)
        if k % 50 == 0:
            way.put_off(0.004)
        q, rate = rng.normal(size=2), 1.0 if k % 3 else 0.4
        anew = pursuit()
        for each in (kept, anew):
            each.step(way, now, q, rate)
        assert kept.wanted.tobytes() == anew.wanted.tobytes()
        assert kept.target.tobytes() == (q + 0.1 * kept.wanted).tobytes()
