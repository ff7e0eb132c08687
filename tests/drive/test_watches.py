"""A watch on commands: nothing beyond the limits is sent, but for what lost cycles have led to."""

import numpy as np
import pytest

from drake_rnn import JointLimits
from drake_rnn.drive.cycles import (
    StopError,
    Watches,
)
from drake_rnn.drive.robots import Motion

H, FASTEST, HARDEST, JERK = 1e-3, 1.0, 10.0, 5000.0
LIMITS = JointLimits(position_lower=[-1.0], position_upper=[1.0], velocity=[FASTEST])
WATCHES = Watches(["elbow"], LIMITS, LIMITS, lag=0.1, jump=0.1)


def sent(velocity, *, after):
    """Send a joint's command for one cycle, after a cycle with a velocity and an acceleration."""
    motion = Motion(np.zeros(1), *(np.array([value]) for value in after))
    WATCHES.may_be_sent(np.array([H * velocity]), motion.position, H, motion)


def test_a_joint_that_lost_cycles_have_made_too_fast_is_slowed_down():
    # It accelerates as a law with a bound of the jerk may, and keeps on while a cycle is lost.
    velocity, acceleration = FASTEST + H * HARDEST, HARDEST
    fastest = velocity
    while velocity > FASTEST:
        before = velocity, acceleration
        acceleration = max(acceleration - H * JERK, -HARDEST)
        velocity += H * acceleration
        sent(velocity, after=before)
        fastest = max(fastest, velocity)
    assert fastest == pytest.approx(FASTEST + 0.015)


@pytest.mark.parametrize("after", [(FASTEST, 0.0), (FASTEST + H * HARDEST, 0.0), (0.0, HARDEST)])
def test_a_joint_is_never_made_too_fast(after):
    fastest = max(FASTEST, after[0])
    sent(fastest, after=after)
    with pytest.raises(StopError, match=r"command: elbow is to move by .* rad in 0.001 s; it may"):
        sent(fastest + 1e-4, after=after)


def test_a_robot_that_waits_for_its_commands_is_never_let_beyond():
    """It holds its place where none comes, so nothing but the command could make it too fast."""
    with pytest.raises(StopError, match="command: elbow is to move"):
        WATCHES.may_be_sent(np.array([H * (FASTEST + 1e-4)]), np.zeros(1), H)
