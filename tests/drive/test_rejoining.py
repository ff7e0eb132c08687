"""A robot that has lost cycles comes back to its commanded motion within its limits."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from drake_rnn.drive.lost_cycles import LostCycles

H, A, J = 1e-3, 10.0, 5000.0
#: Acceleration and jerk of what is commanded.
OWN_A, OWN_J = 3.0, 50.0


def motion(rng, cycles):
    """Positions within bounds of the acceleration and the jerk, of three joints."""
    a, v, q, rows = np.zeros(3), np.zeros(3), np.zeros(3), []
    wanted = np.zeros(3)
    for k in range(cycles):
        if k % 60 == 0:
            wanted = rng.choice([-OWN_A, 0.0, OWN_A], 3)
        a = a + np.clip(wanted - a, -OWN_J * H, OWN_J * H)
        v = v + H * a
        q = q + H * v
        rows.append(q)
    return np.array(rows)


class Robot:
    """It takes an answer, or drops it, and goes on with its acceleration where none came."""

    def __init__(self):
        self.rows = [np.zeros(3)] * 3

    def lose(self, count):
        for _ in range(count):
            self.rows.append(3 * self.rows[-1] - 3 * self.rows[-2] + self.rows[-3])


@pytest.mark.parametrize("most", [2, 8, 18])
def test_it_stays_within_its_limits_however_many_cycles_it_loses(most):
    """Also where an answer came too late, and was dropped, which it tells by what it holds."""
    rng = np.random.default_rng(most)
    for _ in range(5):
        commanded, robot = motion(rng, 1000), Robot()
        follower, k, lost, expected = LostCycles(np.zeros(3)), 0, 0, 0
        while k < len(commanded) - 40:
            rows = commanded[k : k + lost + 1]
            q = follower.answer(rows, robot.rows[-1])
            expected += lost
            k, lost = k + lost + 1, 0
            if rng.random() < 0.3:
                robot.rows.append(q)
                lost = int(rng.integers(1, most + 1)) if rng.random() < 0.1 else 0
                robot.lose(lost)
            elif rng.random() < 0.02:
                # It has sent it late: dropped, and with it further cycles.
                lost = int(rng.integers(1, most + 1))
                robot.lose(lost + 1)
            else:
                robot.rows.append(q)
        q = np.array(robot.rows)
        a, jerk = np.diff(q, n=2, axis=0) / H**2, np.diff(q, n=3, axis=0) / H**3
        assert np.abs(a).max() < A
        assert np.abs(jerk).max() < J
        assert follower.lost == expected > 0
    # It is on the motion again once no more are lost.
    for row in commanded[k : k + 1].repeat(400, axis=0):
        robot.rows.append(follower.answer(row[None], robot.rows[-1]))
    np.testing.assert_allclose(robot.rows[-1], commanded[k], atol=1e-6)


def test_without_lost_cycles_it_is_sent_what_is_commanded():
    commanded, follower = motion(np.random.default_rng(0), 500), LostCycles(np.zeros(3))
    held = np.zeros(3)
    for row in commanded:
        held = follower.answer(row[None], held)
        np.testing.assert_array_equal(held, row)


def test_what_is_no_motion_is_refused():
    with pytest.raises(InvalidInputError, match=r"^q: must be finite positions"):
        LostCycles([[0.0]])
    follower = LostCycles(np.zeros(3))
    for commands, held, key in (
        (np.zeros(3), np.zeros(3), "commands"),
        (np.zeros((0, 3)), np.zeros(3), "commands"),
        (np.full((1, 3), np.nan), np.zeros(3), "commands"),
        (np.zeros((1, 3)), np.zeros(2), "held"),
    ):
        with pytest.raises(InvalidInputError, match=rf"^{key}: must be finite"):
            follower.answer(commands, held)
