"""A guard whose calls come late, of a robot that goes on along the certified stop of each command.

What a robot is sent that reads commands at times of its own clock keeps every bound, by finite
differences of the positions alone.
"""

import warnings

import numpy as np
import pytest

from drake_rnn import Guard, InvalidInputError, JointStream, load_arm, make_obstacles
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.joint_stop import stop_after, stop_step

PANDA = load_arm("panda")
HOME = np.asarray(PANDA.home)
V, A = 1.0, 5.0
SPEED, ERROR = 0.4, 0.002


def limits_with(jerk):
    return PANDA.limits.replace(velocity=V, acceleration=A, jerk=jerk)


def sent(commands, h, phase):
    """Positions that a robot is sent, a period apart, from before the first command to rest."""
    rows, last, t = [], 0, commands[0].time - (2.0 - phase) * h
    while t < commands[-1].time + 1.0:
        # Those whose time has come.
        while last + 1 < len(commands) and commands[last + 1].time <= t + 1e-6 * h:
            last += 1
        rows.append(commands[last].position_at(t))
        t += h
    return np.array(rows)


def assert_within_bounds(q, h, jerk):
    v, a, j = (np.diff(q, n=n, axis=0) / h**n for n in (1, 2, 3))
    # Positions of some rad, rounded, and times.
    rounding = 4e-15
    assert np.abs(v).max() <= V * (1.0 + 1e-9)
    assert np.abs(a).max() <= A * (1.0 + 1e-9) + 4.0 * rounding / h**2
    if jerk is not None:
        assert np.abs(j).max() <= jerk * (1.0 + 1e-9) + 8.0 * rounding / h**3
    np.testing.assert_array_equal(q[-1], q[-2])


def calls(seed):
    """A guard and its commands: jitter, delays of parts of a period, of 5, 50 and 500 ms."""
    rng = np.random.default_rng(seed)
    h, jerk = float(rng.choice([1e-3, 5e-3, 1e-2])), (None, 100.0, 2000.0)[seed % 3]
    tolerance = h * (0.0, 0.5, 1.0)[seed // 3 % 3]
    law = JointStream(limits=limits_with(jerk), home=HOME)
    guard = Guard(law, h, t=0.0, tolerance=tolerance, late="stop")
    t, goal, commands = 0.0, HOME, []
    for k in range(150):
        if k % 30 == 0:
            goal = HOME + rng.uniform(-1.0, 1.0, 7)
        guard.command(goal, t=t)
        commands.append(guard.newest)
        elapsed = h * rng.choice(
            [1.0, rng.uniform(0.6, 1.4), rng.uniform(1.0, 3.0)], p=[0.6, 0.3, 0.1]
        )
        if rng.random() < 0.03:
            elapsed += rng.choice([5e-3, 5e-2, 5e-1])
        # No earlier than the last one begins to hold.
        t = max(t + elapsed, commands[-1].time)
    return guard, commands, h, jerk, rng.random()


@pytest.mark.parametrize("first", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (9, 300))])
def test_what_a_robot_is_sent_keeps_every_bound_however_late_calls_are(first):
    late = 0
    for seed in range(first, first + (9 if first < 300 else 200)):
        guard, commands, h, jerk, phase = calls(seed)
        assert_within_bounds(sent(commands, h, phase), h, jerk)
        assert guard.late_stops == 0
        late += guard.late_samples
    assert late > 100


def test_calls_in_time_are_followed_as_without_a_word_of_lateness():
    law = JointStream(limits=limits_with(100.0), home=HOME)
    plain, guard = Guard(law, 0.01), Guard(law, 0.01, t=0.0, late="stop")
    for k in range(60):
        q = plain.command(HOME + 0.3)
        assert np.array_equal(guard.command(HOME + 0.3, t=0.01 * k), q)
        # It begins to hold half a period later, the tolerance.
        assert guard.newest.time == pytest.approx(0.01 * k + 0.005)
    assert guard.late_samples == 0


@pytest.mark.parametrize("jerk", [None, 100.0])
def test_a_command_that_is_withdrawn_was_never_given(jerk):
    law = JointStream(limits=limits_with(jerk), home=HOME)
    guard, other = (Guard(law, 0.01, t=0.0, late="stop") for _ in range(2))
    for k in range(40):
        for each in (guard, other):
            each.command(HOME + 0.5, t=0.01 * k)
    guard.command(HOME + 0.5, t=0.4)
    guard.withdraw()
    assert guard.newest.number == 40
    for k in range(43, 60):
        q = other.command(HOME + 0.5, t=0.01 * k)
        np.testing.assert_allclose(guard.command(HOME + 0.5, t=0.01 * k), q, atol=1e-12)
        assert guard.newest.time == other.newest.time
    assert guard.newest.after == guard.newest.number - 1


@pytest.mark.parametrize("jerk", [pytest.param(None, marks=pytest.mark.long), 100.0])
def test_a_ball_that_comes_while_calls_are_late_is_never_touched(jerk):
    """Late by up to 0.5 s, the arm on its stop; the ball goes at its speed to where its tool is."""
    h, rng = 0.01, np.random.default_rng(0 if jerk is None else 1)
    tool = PANDA.kinematics().p_WE(HOME + 0.8 * np.eye(7)[0]) + np.array([0.0, 0.0, 0.08])
    center = tool + np.array([0.0, 0.0, 0.6])
    place = {"kind": "ball", "center": center.tolist(), "radius": 0.04}
    obstacles = make_obstacles([{**place, "speed": SPEED, "error": ERROR}])
    clearance, _ = arm_clearance(PANDA, obstacles, HOME)
    law = JointStream(
        limits=limits_with(jerk).replace(velocity=0.8), home=HOME, clearance=clearance
    )
    p, t, least = np.zeros(3), 0.0, np.inf
    guard = Guard(law, h, t=0.0, p_WO=p[None], late="stop")
    command, clock = None, 0.0
    for k in range(140):
        with warnings.catch_warnings(action="error"):
            seen = p + ERROR * np.array([0.0, 0.0, 1.0])
            guard.command(HOME + 1.4 * np.eye(7)[0] * (-1.0) ** (k // 70), seen[None], t)
        new = guard.newest
        until = t + h * rng.uniform(0.7, 1.3) + (rng.uniform(0.0, 0.5) if rng.random() < 0.1 else 0)
        until = max(until, new.time)
        # What happens until the next call, a tenth of a period after the other.
        while clock < until:
            command = new if command is None or new.time <= clock else command
            q = [command.position_at(clock), command.position_at(clock + h / 10)]
            if np.abs(q[1] - q[0]).max() > 1e-12:
                least = min(least, clearance.gaps(q[1], p[None]).min())
            # It waits in the way, where the arm would be stopped by nothing else.
            if p[2] > -0.6:
                p = p - np.array([0.0, 0.0, SPEED * h / 10])
            clock += h / 10
        t = until
    assert least >= 0.005
    assert guard.jumps == {"ball 1": 0}
    assert guard.part("uncertified").item() == 0.0
    assert guard.late_samples > 20


def test_where_a_stop_has_led_is_what_its_steps_lead_to():
    rng = np.random.default_rng(0)
    for case in range(100):
        h, most = float(rng.choice([1e-3, 1e-2])), rng.uniform(0.5, 20.0)
        jerk = None if case % 4 == 0 else min(np.exp(rng.uniform(2.0, 9.0)), 2.0 * most / h)
        v, a = rng.uniform(-2.0, 2.0), rng.uniform(-most, most) * (case % 3 > 0)
        q, steps = 0.0, ([v], [a])
        for k in range(1, 60):
            steps = stop_step(*steps, [most], None if jerk is None else [jerk], h)
            q += h * steps[0][0]
            found = stop_after(v, a, most, jerk, h, k)
            np.testing.assert_allclose(found, (q, steps[0][0], steps[1][0]), rtol=1e-9, atol=1e-9)
        end = stop_after(v, a, most, jerk, h, 1e6)
        assert end == stop_after(v, a, most, jerk, h, 2e6)
        assert end[1:] == (0.0, 0.0)


def test_what_cannot_be_is_refused():
    law = JointStream(limits=limits_with(100.0), home=HOME)
    for late in ("go on", True, 1, [], "Stop"):
        with pytest.raises(InvalidInputError, match=r"^late: may be hold or stop, not "):
            Guard(law, 0.01, late=late)
    guard = Guard(law, 0.01, late="stop", tolerance=0.01)
    with pytest.raises(InvalidInputError, match="newest: there was no command yet"):
        _ = guard.newest
    guard.command(t=1.0)
    with pytest.raises(
        InvalidInputError, match=r"must be 0\.004 s later, when the last command begins"
    ):
        guard.command(t=1.006)


@pytest.mark.parametrize("late", ["hold", "stop"])
def test_an_arm_that_was_brought_to_rest_elsewhere_stays_there_to_the_last_bit(late):
    """Whatever was wanted before: that it is not any more is no change of what is wanted."""
    law = JointStream(limits=limits_with(100.0), home=HOME)
    guard = Guard(law, 0.01, t=0.0, late=late)
    for k in range(40):
        guard.command(HOME + 0.8, t=0.01 * k)
    assert np.abs(guard.velocity).max() > 0.2
    q, still = HOME - 0.2, np.zeros(7)
    guard.resume(q, still, still, t=0.5)
    guard.rest()
    for k in range(30):
        np.testing.assert_array_equal(guard.command(t=0.5 + 0.01 * k), q)


def test_a_robot_that_goes_on_along_stops_goes_on_from_where_others_have_brought_it():
    """What it is sent from then on begins there, and keeps every bound, however late calls are."""
    h, jerk, goal, rng = 0.01, 100.0, HOME + 0.5, np.random.default_rng(3)
    guard = Guard(JointStream(limits=limits_with(jerk), home=HOME), h, t=0.0, late="stop")
    for k in range(30):
        guard.command(goal, t=h * k)
    for q in (HOME - 0.1, HOME + 0.2):
        still, t, commands = np.zeros(7), guard.newest.time + 1.0, []
        guard.resume(q, still, still, t=t)
        before, number = guard.late_samples, guard.newest.number
        for _ in range(60):
            guard.command(goal, t=t)
            commands.append(guard.newest)
            t = max(t + h * rng.choice([1.0, 1.7, 7.0], p=[0.8, 0.1, 0.1]), commands[-1].time)
        assert commands[0].number == number + 1
        rows = sent(commands, h, 0.3)
        np.testing.assert_array_equal(rows[0], q)
        assert_within_bounds(rows, h, jerk)
        assert np.abs(rows[-1] - q).max() > 0.05
        assert guard.late_samples > before
        assert guard.late_stops == 0
