"""A stick that is held: the arm rests where it gets no further, and goes on as soon as it can."""

import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from drake_rnn import Shield, ShieldSettings, load_arm

ARM, PERIOD = load_arm("panda", tool=None), 1e-2
KINEMATICS = ARM.kinematics()
P_HOME = KINEMATICS.p_WE(ARM.home)
WXYZ = RotationMatrix(KINEMATICS.R_WE(ARM.home)).ToQuaternion().wxyz()
ASIDE = np.array([0.0, -1.0, 0.0])


def shield_of(velocity=1.0, acceleration=2.0, jerk=50.0, **world):
    limits = ARM.limits.replace(velocity=velocity, acceleration=acceleration, jerk=jerk)
    return Shield(ARM, PERIOD, ShieldSettings(compiled=False), limits=limits, **world)


def hold(shield, kind, speed, seconds, p_WO=None):
    """Hold a stick aside, as a twist or a pose that goes on; return how far the tool has come."""
    begin = 0.0 if shield.time == 0.0 else shield.time + PERIOD
    if kind == "poses" and not begin:
        rows = [[*(P_HOME + 0.05 * speed * k * ASIDE), *WXYZ] for k in range(round(20 * seconds))]
        shield.follow_poses(rows, rate=20.0, start=0.0, t=0.0)
    for k in range(round(seconds / PERIOD)):
        if kind == "twists":
            shield.follow_twists([0.0, 0.0, 0.0, *(speed * ASIDE)], t=begin + k * PERIOD)
        places = () if p_WO is None else (p_WO(k * PERIOD),)
        shield.command(begin + k * PERIOD, *places)
    return float((KINEMATICS.p_WE(shield.position) - P_HOME) @ ASIDE)


@pytest.mark.parametrize("kind", ["twists", "poses"])
@pytest.mark.parametrize("slow", [{"velocity": 0.02}, {"acceleration": 0.05, "jerk": 1.0}])
def test_slow_joints_are_no_blockage(kind, slow):
    """The tool wanted less and less speed, and reach was named, where joints were slow alone."""
    shield = shield_of(collisions=False, **slow)
    middle = hold(shield, kind, 0.3, 2.0)
    way = hold(shield, "none" if kind == "poses" else kind, 0.3, 2.0) - middle
    assert way > 0.8 * middle > 0.0
    assert "reach" not in shield.status.limited_by
    assert shield.status.blocked_for == 0.0


@pytest.mark.parametrize("kind", ["twists", "poses"])
def test_an_arm_rests_before_a_ball_and_goes_on_once_that_has_gone(kind):
    """Poses that go on behind the ball led it to and fro, and what had rested stayed there."""
    center = (P_HOME + 0.2 * ASIDE).tolist()
    ball = {"kind": "ball", "name": "cup", "center": center, "radius": 0.06, "speed": 0.6}
    shield = shield_of(obstacles=[ball])
    hold(shield, kind, 0.1, 4.5, lambda t: {"cup": np.zeros(3)})
    before = hold(
        shield, "none" if kind == "poses" else kind, 0.1, 0.2, lambda t: {"cup": [0, 0, 0]}
    )
    assert np.abs(shield.velocity).max() < 0.01
    status = shield.status
    assert status.blocked_for > 0.5
    assert any("cup" in cause for cause in status.limited_by)
    assert before < 0.14

    def gone(t):
        return {"cup": [0.0, 0.0, min(0.5 * t, 1.0)]}

    after = hold(shield, "none" if kind == "poses" else kind, 0.1, 2.5, gone)
    assert after > before + 0.02


def test_a_stick_moved_back_leaves_by_the_way_it_came():
    """What the arm strayed while it was held up led it back: the tool stayed, or went further."""
    arm, way = load_arm("ur5", tool=None), np.array([-0.921, 0.001, 0.391])
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=500.0)
    start = np.array([0.155, 3.598, 0.518, 0.671, 1.949, 0.141])
    settings = ShieldSettings(compiled=False)
    shield = Shield(arm, PERIOD, settings, start=start, limits=limits, collisions=False)
    along = []
    for k in range(280):
        twist = np.append(np.zeros(3), (0.24 if k < 180 else -0.24) * way)
        shield.follow_twists(twist, t=k * PERIOD)
        along.append(float(way @ arm.kinematics().p_WE(shield.command(k * PERIOD))))
        if k == 179:
            assert shield.status.blocked_for > 0.5
    assert max(along[:180]) > along[179] + 0.005
    assert along[-1] < along[179] - 0.08


def test_joints_that_get_no_further_rest_and_others_go_on():
    """The tool was pushed along the table for ever; its last joint may turn there."""
    below = [*P_HOME[:2], float(P_HOME[2]) - 0.25]
    table = {"kind": "box", "name": "table", "center": below, "size": [0.3, 1.0, 0.1]}
    shield = shield_of(acceleration=5.0, jerk=500.0, obstacles=[table])
    asked = np.array([0.0, 0.32, 0.0, -0.78, 0.0, 0.0, 0.05])
    for k in range(430):
        shield.follow_velocities(asked, t=k * PERIOD)
        shield.command(k * PERIOD)
    assert np.abs(shield.velocity[:6]).max() < 0.01
    assert shield.velocity[6] == pytest.approx(0.05, abs=1e-3)
    status, before = shield.status, shield.position
    assert status.blocked_for > 0.5
    assert any("table" in cause for cause in status.limited_by)
    for k in range(430, 460):
        shield.follow_velocities(-asked, t=k * PERIOD)
        shield.command(k * PERIOD)
    assert (shield.position - before)[1] < -0.02
    assert (shield.position - before)[3] > 0.1


def test_what_is_in_the_way_is_what_would_hold_velocities_back():
    """Away from a ball nothing holds them back, and towards it as much as is left allows."""
    center = (P_HOME + np.array([0.0, 0.0, -0.19])).tolist()
    shield = shield_of(
        obstacles=[{"kind": "ball", "name": "cup", "center": center, "radius": 0.05}]
    )
    shield.command()
    step, clearance = shield.last_step, shield.clearance
    near = clearance.near(shield.position[None])
    place = next(k for k in near.gaps[0].argsort() if "cup" in clearance.names[k])
    gap, slope = near.gaps[0, place], near.slopes[0, place]
    avoidance = shield._guard.law.avoidance
    fastest = avoidance.approach * (gap - avoidance.distance)
    towards = -slope * fastest / float(slope @ slope)
    assert place in step.pairs_in_the_way(1.1 * towards)
    assert place not in step.pairs_in_the_way(0.8 * towards)
    assert place not in step.pairs_in_the_way(-1.1 * towards)
    assert place in step.pairs_in_the_way(-towards, [place], 1.1 * gap)
    assert place not in step.pairs_in_the_way(-towards, [place], 0.9 * gap)


@pytest.mark.long
def test_episodes_of_a_held_stick(monkeypatch):
    """Limits hold, nothing touches, arms come to rest, say why, and leave by the way they came."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2] / "benchmarks")])
    import held_stick

    monkeypatch.setattr(held_stick, "ARMS", ("panda", "fr3", "iiwa14", "ur5"))
    monkeypatch.setattr(held_stick, "PERIODS", 3 * (1e-2,))
    for seed in range(12):
        found = held_stick.episode(seed, compiled=False)
        assert max(found["beyond"], found["outside"]) <= held_stick.EXACT
        assert found["distance"] > 0.0
        assert min(found["moved"], found["left"]) >= held_stick.LEAVES
        assert "slides" in found or (found["told"] and found["speed"] < held_stick.REST)
