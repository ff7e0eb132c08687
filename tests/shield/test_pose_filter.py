"""Measured poses: what is wrong of them is dropped and told, and moves the arm nowhere."""

import time
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from drake_rnn import InvalidInputError, PoseFilter, Shield, ShieldSettings, load_arm
from drake_rnn.shield.chunks import Chunk, Counts
from drake_rnn.shield.pose_filter import Tracking

PERIOD, FRAME = 0.01, 1 / 30
PANDA = load_arm("panda")
LIMITS = PANDA.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
KINEMATICS = PANDA.kinematics()
POSE = np.concatenate(
    (KINEMATICS.p_WE(PANDA.home), RotationMatrix(KINEMATICS.R_WE(PANDA.home)).ToQuaternion().wxyz())
)
AWAY = np.array([0.0, 0.25, 0.1, 0, 0, 0, 0])


def hand(t, rng):
    """A pose of a hand on a circle, with the noise of a camera, of either sign."""
    circle = 0.1 * np.array([0.0, np.sin(2.0 * t), 1.0 - np.cos(2.0 * t)])
    turn = RotationMatrix.MakeYRotation(0.3 * np.sin(2.0 * t)).ToQuaternion().wxyz()
    noisy = product(turn, POSE[3:]) + rng.normal(0.0, 1e-3, 4)
    sign = rng.choice([-1.0, 1.0])
    place = POSE[:3] + circle + rng.normal(0.0, 5e-4, 3)
    return np.concatenate((place, sign * noisy / np.linalg.norm(noisy)))


def product(p, q):
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([w, *v])


def spoiled(pose, rng):
    """A pose that no hand has, and whose number of `Counts` tells it."""
    pose, which = pose.copy(), rng.integers(6)
    if which == 0:
        pose[:3] += rng.choice([-1.0, 1.0], 3) * rng.uniform(0.15, 0.5, 3)
    elif which == 1:
        pose[3:] = product(
            RotationMatrix.MakeXRotation(rng.uniform(1, 3)).ToQuaternion().wxyz(), pose[3:]
        )
    elif which == 2:
        pose[:] = np.nan
    elif which == 3:
        pose[:] = 0.0
    elif which == 4:
        pose[3:] *= rng.uniform(1.01, 3.0)
    else:
        pose[:3] *= 1e3
    return pose, ("jumped", "jumped", "invalid_rows", "not_unit", "not_unit", "far")[which]


def stream(rng, duration, share=0.05):
    """Times and poses, and those of them that are right."""
    rows, reasons = [], []
    for t in np.arange(0.0, duration, FRAME):
        pose, reason = hand(t, rng), ""
        if t > 0.1 and rng.random() < share:
            pose, reason = spoiled(pose, rng)
        rows.append((t, pose))
        reasons.append(reason)
    return rows, reasons


def follow(rows, poses=None, duration=2.5, **settings):
    """A shield that was sent poses, each when it was measured; its commands and velocities."""
    settings = ShieldSettings(poses=poses, compiled=False, **settings)
    shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, collisions=False)
    rest, q, v, told = list(rows), [], [], []
    with catch_warnings():
        simplefilter("ignore")
        for k in range(round(duration / PERIOD)):
            while rest and rest[0][0] <= k * PERIOD + 1e-9:
                t, pose = rest.pop(0)
                shield.follow_poses(pose, start=t, t=k * PERIOD)
            q.append(shield.command(k * PERIOD))
            v.append(shield.velocity)
            told.append(shield.status.tracking)
    return shield, np.array(q), np.array(v), told


def test_outliers_move_the_arm_nowhere_and_each_is_counted():
    rows, reasons = stream(np.random.default_rng(2), 1.5, share=0.2)
    shield, q, *_ = follow(rows, PoseFilter(), 1.5, record=True)
    right = [row for row, reason in zip(rows, reasons, strict=True) if not reason]
    np.testing.assert_array_equal(q, follow(right, PoseFilter(), 1.5)[1])
    np.testing.assert_array_equal(q, follow(right, None, 1.5)[1])
    assert len(right) < len(rows) - 4
    counts = vars(shield.counts)
    for reason in ("jumped", "invalid_rows", "not_unit", "far"):
        assert counts[reason] == reasons.count(reason), reason
    dropped = shield.record.dropped
    assert [pose.reason for pose in dropped] == [
        r for r in reasons if r not in ("", "invalid_rows")
    ]
    assert all(pose.text and pose.time < 1.5 for pose in dropped)


@pytest.mark.parametrize("seed", range(20))
def test_of_any_stream_what_is_wrong_is_dropped_and_nothing_else(seed):
    rng, counts = np.random.default_rng(seed), Counts()
    rows, reasons = stream(rng, 20.0)
    tracking = Tracking(PoseFilter(), counts, None)
    with catch_warnings():
        simplefilter("ignore")
        for (t, pose), reason in zip(rows, reasons, strict=True):
            assert not tracking.is_lost(t)
            chunk = tracking.believed(Chunk(np.array([t]), pose[None]), t, POSE[:3], "")
            assert len(chunk.times) == (reason in ("", "invalid_rows")), (t, reason)
            tracking.take(None if reason else chunk, t)


def test_an_arm_rests_when_tracking_is_lost_and_follows_where_it_is_found():
    """Lost for 0.6 s and found 0.27 m away, where one pose is not believed and three are."""
    rng = np.random.default_rng(3)
    times = np.arange(0.0, 4.0, FRAME)
    rows = [(t, hand(t, rng)) for t in times if t < 1.0]
    rows += [(t, hand(t, rng) + AWAY) for t in times if t > 1.6]
    filtered = PoseFilter()
    shield, q, v, told = follow(rows, filtered, 4.0)
    speeds = np.abs(v).max(axis=1)
    lost = told.index("lost")
    last = max(t for t, _ in rows if t < 1.0)
    assert lost * PERIOD == pytest.approx(last + filtered.lost_after, abs=2.1 * PERIOD)
    # The stop of a joint takes v/a + a/J at most.
    stop = speeds[lost] / 5.0 + 5.0 / 100.0 + 3 * PERIOD
    found = told.index("tracked", lost)
    assert speeds[lost + int(stop / PERIOD) : found].max() < 1e-9
    assert found * PERIOD == pytest.approx(1.6 + filtered.believed_after, abs=2.0 * FRAME)
    assert shield.counts.losses == 1
    assert 3 <= shield.counts.unconfirmed <= 4
    a = np.diff(v, axis=0) / PERIOD
    assert speeds.max() <= 1.0 + 1e-9
    assert np.abs(a).max() <= 5.0 * (1 + 1e-9)
    assert np.abs(np.diff(a, axis=0)).max() <= 100.0 * PERIOD * (1 + 1e-9)
    wanted = (hand(4.0 - PERIOD, rng) + AWAY)[:3]
    assert np.linalg.norm(KINEMATICS.p_WE(q[-1]) - wanted) < 0.03


def test_a_place_on_which_poses_agree_is_followed_without_a_loss():
    """Of a jump of the origin all poses are dropped for a tenth of a second, and no longer."""
    rng = np.random.default_rng(4)
    rows = [(t, hand(t, rng) + (t > 0.5) * AWAY) for t in np.arange(0.0, 1.0, FRAME)]
    shield, _, _, told = follow(rows, PoseFilter(), 1.0)
    assert 3 <= shield.counts.jumped <= 4
    assert shield.counts.losses == 0
    assert told[-1] == "tracked"


def test_poses_that_are_the_same_for_long_are_a_loss_and_may_be_allowed():
    rng = np.random.default_rng(5)
    rows = [(t, hand(min(t, 0.3), np.random.default_rng(1))) for t in np.arange(0.0, 2.0, FRAME)]
    shield, *_, told = follow(rows, PoseFilter(), 2.0)
    assert shield.counts.frozen > 10
    assert (shield.counts.losses, told[-1]) == (1, "lost")
    rows[-1] = rows[-1][0], hand(0.3, rng)
    shield, *_, told = follow(rows, PoseFilter(frozen_after=None), 2.0)
    assert vars(shield.counts)["frozen"] == shield.counts.losses == 0


def test_chunks_that_are_consistent_are_followed_as_without_a_filter():
    """A policy may change its mind by 0.27 m; a row that no hand has is left out."""

    def run(poses, spoil):
        settings = ShieldSettings(poses=poses, compiled=False)
        shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, collisions=False)
        rng, q = np.random.default_rng(6), []
        for k in range(120):
            t = k * PERIOD
            if k % 20 == 0:
                rows = [hand(t + j / 20, rng) + (k >= 60) * AWAY for j in range(16)]
                times = t + np.arange(16) / 20
                if spoil is not None:
                    rows[5] = rows[5] + spoil
                else:
                    rows, times = np.delete(rows, 5, axis=0), np.delete(times, 5)
                shield.follow_poses(rows, times=times, t=t)
            q.append(shield.command(t))
        return np.array(q), shield.counts

    plain, _ = run(None, 0.0 * AWAY)
    filtered, counts = run(PoseFilter(), 0.0 * AWAY)
    np.testing.assert_array_equal(filtered, plain)
    assert counts.jumped == 0
    without, _ = run(None, None)
    with pytest.warns(
        UserWarning, match=r"X_WE: the pose of 0.25 s is dropped: 0\.\d+ m in 0.05 s"
    ):
        filtered, counts = run(PoseFilter(), 2.0 * AWAY)
    np.testing.assert_array_equal(filtered, without)
    assert counts.jumped == 6


def test_poses_that_can_hardly_be_meant_are_told_and_not_followed():
    """What is refused without a filter, such as millimetres, leads nowhere with one."""
    settings = ShieldSettings(poses=PoseFilter(), compiled=False)
    shield = Shield(PANDA, PERIOD, settings, limits=LIMITS, collisions=False)
    with pytest.warns(UserWarning, match=r"begins .* from the tool, .* look like millimetres"):
        assert shield.follow_poses([*1e3 * POSE[:3], *POSE[3:]]) == 0
    assert (shield.counts.far, shield.status.tracking) == (1, "far")
    assert shield.follow_poses(POSE) == 2
    assert shield.status.tracking == "tracked"
    with pytest.raises(InvalidInputError, match=r"PoseFilter\.speed: must be greater than 0"):
        ShieldSettings(poses=PoseFilter(speed=0.0))


@pytest.mark.long
def test_a_process_tells_what_it_has_dropped():
    settings = ShieldSettings(poses=PoseFilter(), compiled=False)
    with Shield(PANDA, PERIOD, settings, limits=LIMITS, process=True) as shield:

        def until(condition):
            end = time.monotonic() + 20.0
            while not condition() and time.monotonic() < end:
                time.sleep(0.02)
            assert condition()

        shield.follow_poses(POSE)
        until(lambda: shield.status.tracking == "tracked")
        shield.follow_poses(np.zeros(7))
        until(lambda: shield.counts.not_unit == 1)
        until(lambda: shield.status.tracking == "lost")
        assert shield.counts.losses == 1
        for _ in range(8):
            shield.follow_poses(POSE + np.array([0, 0.1, 0, 0, 0, 0, 0]))
            time.sleep(0.04)
        until(lambda: shield.status.tracking in ("tracked", "lost"))
        assert shield.counts.unconfirmed >= 2
