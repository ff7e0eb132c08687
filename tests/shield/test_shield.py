"""A shield: whatever a source sends, every bound holds; and what it sends well is followed well."""

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from drake_rnn import InvalidInputError, Shield, ShieldSettings, load_arm
from drake_rnn.shield.chunks import Chunk, ChunkPath

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


@pytest.mark.parametrize("kind", ["positions", "velocities", "twists", "poses"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
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
    """A circle of 10 cm: to 1 mm by poses; by twists, which no feedback corrects, to 1 cm."""
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


def test_a_source_is_told_what_blocks_the_arm_and_for_how_long():
    ball = {
        "kind": "ball",
        "center": (POSE[:3] + np.array([0.0, 0.25, 0.0])).tolist(),
        "radius": 0.12,
    }
    shield = Shield(PANDA, PERIOD, limits=LIMITS, obstacles=[ball])
    target = HOME + 0.8 * np.eye(7)[0]
    seen = list[tuple[float, bool]]()

    def note(shield):
        status = shield.status
        seen.append((status.blocked_for, any("ball" in name for name in status.limited_by)))

    motion(shield, 3.0, lambda shield, t: shield.follow_positions(target, t=t), note)
    assert shield.status.behind > 0.05
    assert max(blocked for blocked, _ in seen) > 0.4
    assert np.mean([by_ball for _, by_ball in seen[100:]]) > 0.5


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


def test_a_joint_that_turns_without_end_goes_the_shorter_way_and_no_other():
    arm = load_arm("gen3")
    (endless,) = np.flatnonzero(arm.endless[:1])
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=None)
    target = arm.home + (2.0 * np.pi - 0.3) * np.eye(arm.n)[endless]
    shield = Shield(arm, PERIOD, limits=limits, collisions=False)
    q, _ = motion(shield, 1.5, lambda shield, t: shield.follow_positions(target, t=t))
    assert q[-1, endless] - arm.home[endless] == pytest.approx(-0.3, abs=1e-3)


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


DEGREES = np.rad2deg(HOME)
REFUSALS = [
    (lambda s: s.follow_positions(HOME[:6]), "q: must be one target of 7 numbers or rows of them"),
    (lambda s: s.follow_positions(np.tile(HOME, (3, 1))), "q: of 3 targets the rate must be given"),
    (lambda s: s.follow_positions(DEGREES), "angles are in radians, and these look like degrees"),
    (lambda s: s.follow_velocities(30.0 * np.ones(7)), "must be in rad/s, not degrees a second"),
    (lambda s: s.follow_positions(HOME, start=1.7e9), "one of them is in seconds since 1970"),
    (lambda s: s.follow_positions(HOME, start=1e5, t=100.0), "it looks like milliseconds"),
    (lambda s: s.follow_positions(HOME, rate=0.05), "must be a rate in Hz, not a time between two"),
    (lambda s: s.follow_poses([*POSE[:3], 2, 0, 0, 0]), "quaternion of length 2; must be of"),
    (lambda s: s.follow_poses(POSE + np.eye(7)[0] * 5), "positions are in metres, in W"),
    (lambda s: ShieldSettings(switch="mix"), "switch: "),
    (lambda s: ShieldSettings(lookahead=0.0), "lookahead: "),
]


@pytest.mark.parametrize(("use", "text"), REFUSALS, ids=[text[:30] for _, text in REFUSALS])
def test_what_cannot_be_meant_is_refused_with_the_likely_mistake(use, text):
    with pytest.raises(InvalidInputError, match=text):
        use(Shield(PANDA, PERIOD, limits=LIMITS, collisions=False))
