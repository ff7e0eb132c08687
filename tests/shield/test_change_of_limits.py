"""Limits that change while the arm moves: no command is beyond those in force."""

from functools import partial

import numpy as np
import pytest
from test_shield import BALL_IN_THE_WAY, HELD, HOME, LIMITS, PANDA, PERIOD, storm, to

from drake_rnn import Guard, InvalidInputError, JointStream, Shield, ShieldSettings, load_arm
from process_helpers import wait_for


def other_limits(rng, q):
    """Limits that are wider or narrower, of position within 0.1 rad of where the arm is, too."""
    most = {"velocity": (0.15, 1.5), "acceleration": (1.0, 8.0), "jerk": (30.0, 600.0)}
    bounds = {name: rng.uniform(*ends) for name, ends in most.items()}
    if rng.random() < 0.3:
        bounds["jerk"] = None
    if rng.random() < 0.3:
        bounds |= {"velocity_lower": -rng.uniform(0.15, 1.5)}
        bounds |= {"acceleration_lower": -rng.uniform(1.0, 8.0)}
    if rng.random() < 0.5:
        lower, upper = PANDA.limits.position_lower, PANDA.limits.position_upper
        bounds["position_lower"] = np.maximum(lower, q - rng.uniform(0.1, 0.6, 7))
        bounds["position_upper"] = np.minimum(upper, q + rng.uniform(0.1, 0.6, 7))
    return PANDA.limits.replace(**bounds)


class Judge:
    """Judges each command by the limits in force when it was given."""

    def __init__(self, shield):
        self.shield, self.v, self.a = shield, np.zeros(7), np.zeros(7)
        self.pending = self.changes = self.refused = 0
        self.fastest = 0.0

    def __call__(self, q):
        h, limits, v = self.shield.period, self.shield.limits, self.shield.velocity
        a = (v - self.v) / h
        jerk = (a - self.a) / h
        self.v, self.a = v, a
        assert limits.violation(q).max() <= HELD
        for name, values in (("velocity", v), ("acceleration", a), ("jerk", jerk)):
            if (bound := limits.toward(name, values)) is not None:
                assert (np.abs(values) <= bound * (1.0 + HELD) + 1e-9).all(), name
        self.pending += self.shield.status.limits_pending
        self.fastest = max(self.fastest, np.abs(v).max())


def disturbed(seed, period, duration, kind, **options):
    """Judge a shield whose limits change at random while its source sends what it likes."""
    rng = np.random.default_rng(seed)
    shield = Shield(PANDA, period, limits=LIMITS, obstacles=[BALL_IN_THE_WAY], **options)
    judge, send = Judge(shield), storm(rng, kind)
    for k in range(round(duration / period)):
        send(shield, k * period)
        if rng.random() < period / 0.1:
            try:
                shield.change_limits(other_limits(rng, shield.position))
                judge.changes += 1
            except InvalidInputError:
                judge.refused += 1
        judge(shield.command(k * period))
        assert shield.clearance.least_along(shield.position[None]).min() >= 0.005
    assert shield.uncertified == 0
    return judge


@pytest.mark.parametrize(
    ("seed", "period", "kind"),
    [
        (0, 0.01, "positions"),
        pytest.param(1, 0.002, "twists", marks=pytest.mark.long),
        pytest.param(2, 0.005, "poses", marks=pytest.mark.long),
        pytest.param(3, 0.004, "velocities", marks=pytest.mark.long),
        *[
            pytest.param(seed, 1e-3 * (1 + seed % 10), kind, marks=pytest.mark.nightly)
            for seed, kind in enumerate(["positions", "velocities", "twists", "poses"] * 5, 4)
        ],
    ],
)
def test_no_command_is_beyond_the_limits_in_force(seed, period, kind):
    judge = disturbed(seed, period, 2.0, kind)
    assert judge.changes > 4 * (1 + judge.refused)
    assert judge.fastest > 0.1


@pytest.mark.nightly
def test_in_c_too_without_a_wait_for_the_compiler():
    judge = disturbed(5, 0.01, 2.0, "positions", settings=ShieldSettings(compiled=True))
    assert judge.changes > 4
    assert "NumPy until" in judge.shield.steps


def moving():
    """A shield whose first joint moves at 1 rad/s towards a target, and its judge."""
    shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
    judge = Judge(shield)
    for k in range(120):
        to(HOME + 1.5 * np.eye(7)[0])(shield, k * PERIOD)
        judge(shield.command(k * PERIOD))
    assert shield.velocity[0] == pytest.approx(1.0)
    return shield, judge


def test_narrower_limits_are_in_force_once_the_stop_is_within_them():
    """From 1 to 0.5 rad/s with 5 rad/s^2 and 100 rad/s^3: 0.15 s."""
    shield, judge = moving()
    narrow = LIMITS.replace(velocity=0.5)
    shield.change_limits(narrow)
    begin = shield.time
    for k in range(120, 350):
        judge(shield.command(k * PERIOD))
        if shield.status.limits_pending:
            assert shield.status.limited_by == ("change of limits",)
            assert shield.limits is LIMITS
            end = shield.time
    assert end - begin == pytest.approx(0.125, abs=0.03)
    assert shield.limits is narrow
    assert shield.velocity[0] == pytest.approx(0.5)


def test_wider_limits_are_in_force_at_the_next_command():
    shield, judge = moving()
    wide = LIMITS.replace(velocity=1.5, jerk=None)
    shield.change_limits(wide)
    judge(shield.command(120 * PERIOD))
    assert shield.limits is wide
    assert not judge.pending
    for k in range(121, 180):
        judge(shield.command(k * PERIOD))
    assert shield.velocity[0] == pytest.approx(1.5, abs=1e-3)


def test_a_place_where_the_arm_cannot_stop_is_refused_and_nothing_changes():
    shield, judge = moving()
    upper = LIMITS.position_upper.copy()
    upper[0] = shield.position[0] + 0.05
    with pytest.raises(InvalidInputError, match=r"limits: joint 1 comes to rest at 0\.\d+ rad"):
        shield.change_limits(LIMITS.replace(position_upper=upper))
    with pytest.raises(InvalidInputError, match="limits: are of 6 joints, but panda has 7"):
        shield.change_limits(LIMITS.select(range(6)))
    judge(shield.command(120 * PERIOD))
    assert shield.limits is LIMITS
    assert shield.velocity[0] == pytest.approx(1.0)


def test_a_guard_follows_targets_that_came_while_it_stopped_and_resumes_within_new_limits():
    law = JointStream(limits=LIMITS, home=HOME, timeout=5.0)
    guard = Guard(law, PERIOD, compiled=False)
    for _ in range(100):
        guard.command(HOME + np.eye(7)[0])
    narrow = LIMITS.replace(velocity=0.2, acceleration=1.0)
    guard.change_limits(narrow)
    target = HOME - 0.1 * np.eye(7)[0]
    guard.command(target)
    assert guard.limits_pending
    for _ in range(1500):
        guard.command()
    assert guard.law.limits is narrow
    np.testing.assert_allclose(guard.position, target, atol=1e-6)
    for _ in range(100):
        guard.command(HOME)
    guard.change_limits(narrow.replace(velocity=0.1))
    guard.resume(HOME, np.zeros(7), np.zeros(7))
    assert not guard.limits_pending


def test_limits_of_a_process_change_while_its_arm_moves(tmp_path):
    """Narrower, without a jerk, with one again: the state of the law has other sizes each time."""
    arm, file = load_arm("planar6"), tmp_path / "commands"
    limits = arm.limits.replace(velocity=1.0, acceleration=4.0, jerk=80.0)
    narrow, free = limits.replace(velocity=0.3, velocity_lower=-0.1), limits.replace(jerk=None)
    n, send = arm.n, partial(record, file)
    with Shield(arm, 0.01, limits=free, collisions=False, process=send) as shield:
        shield.follow_velocities(np.ones((200, n)), rate=10)
        assert wait_for(lambda: shield.velocity.max() > 0.99)
        shield.change_limits(limits)
        assert wait_for(lambda: not shield.status.limits_pending)
        begin = len(recorded(file, n))
        upper = np.minimum(limits.position_upper, shield.position + 0.01)
        with pytest.raises(InvalidInputError, match=r"^limits: joint \d comes to rest at "):
            shield.change_limits(narrow.replace(position_upper=upper))
        assert shield.limits.jerk is not None
        shield.change_limits(narrow)
        assert wait_for(lambda: not shield.status.limits_pending)
        end = len(recorded(file, n))
        np.testing.assert_array_equal(shield.limits.velocity, narrow.velocity)
        assert wait_for(lambda: abs(shield.velocity.max() - 0.3) < 1e-9)
        assert wait_for(lambda: f"{arm.joints[0]} velocity" in shield.status.limited_by)
        shield.follow_velocities(-np.ones((20, n)), rate=10)
        assert wait_for(lambda: shield.velocity.min() < -0.05)
    rows = recorded(file, n)
    v, late = rows[:, 1 + n :], np.diff(rows[:, 0]).max() > 0.02
    assert -0.1 - HELD <= v[end:].min() < -0.05
    assert v[end:].max() <= 0.3 + HELD
    if not late:
        a = np.diff(v, axis=0) / 0.01
        assert np.abs(a).max() <= 4.0 * (1.0 + HELD)
        assert np.abs(np.diff(a[begin:], axis=0) / 0.01).max() <= 80.0 * (1.0 + 1e-6)


def record(file, command):
    """Write a command into a file: its time, positions and velocities."""
    with open(file, "ab") as stream:
        stream.write(np.array([command.time, *command.position, *command.velocity]).tobytes())


def recorded(file, n):
    return np.fromfile(file).reshape(-1, 1 + 2 * n)
