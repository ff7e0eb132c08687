"""A tool that gets no further wants less of its speed, and rests, also while its J is learned."""

import numpy as np
import pytest

from drake_rnn import load_arm
from drake_rnn.experiment import make_experiment
from drake_rnn.laws.parts.progress import (
    LEAST,
    NO_PROGRESS,
    Look,
    ShareOfSpeed,
    advance,
    fastest_tool,
)
from drake_rnn.live.session import Session

PERIOD, SLICE = 5e-3, 0.02


def share_after(V_tool, seconds=3.0, fastest=lambda age: np.inf):
    """Return the progress of a tool that is to go 0.1 m/s along x, of its velocities over time."""
    progress, b = NO_PROGRESS, np.array([0.1, 0.0])
    for k in range(round(seconds / PERIOD)):
        progress = advance(progress, b, V_tool(k * PERIOD), PERIOD, 0.8, fastest)
    return progress


def test_motion_to_and_fro_is_no_progress_and_motion_along_what_is_wanted_is():
    swinging = share_after(lambda t: np.array([0.1 * np.sin(20.0 * t), 0.1]))
    assert swinging.share == LEAST
    assert swinging.blocked > 2.0
    assert share_after(lambda t: np.array([0.05, 0.1])).share == 1.0


def test_a_tool_whose_joints_are_slow_gets_on_as_well_as_they_let_it():
    slow = np.array([2e-3, 0.0])
    assert share_after(lambda t: slow).share < 0.25
    assert share_after(lambda t: slow, fastest=lambda age: 4e-3).share == 1.0


def test_once_the_way_is_free_a_tool_is_soon_as_fast_as_before():
    progress, b = NO_PROGRESS, np.array([0.1, 0.0])
    for k in range(800):
        V = np.zeros(2) if k < 600 else progress.share * b
        progress = advance(progress, b, V, PERIOD, 0.8, lambda age: np.inf)
        if k in (599, 719):
            assert progress.share == (LEAST if k == 599 else 1.0)


def test_the_fastest_tool_of_joints_that_start_from_rest():
    arm = load_arm("panda")
    limits = arm.limits.replace(velocity=1.0, acceleration=2.0)
    J = arm.kinematics().J(arm.home)
    v = np.array([fastest_tool(J, limits, age) for age in (0.1, 0.5, 9.0)])
    assert v == pytest.approx(np.array([0.2, 1.0, 1.0]) * np.linalg.norm(J, axis=0).sum())


def test_many_robots_get_on_as_each_of_them_does():
    arm, rng, count = load_arm("panda"), np.random.default_rng(0), 8
    each = ShareOfSpeed(arm.limits, True, 1.0)
    state = {"progress": np.tile(np.array(NO_PROGRESS), (count, 1))}
    alone = [{"progress": np.array(NO_PROGRESS)} for _ in range(count)]
    J = rng.normal(size=(count, 3, arm.n))
    for k in range(400):
        b, V = rng.normal(0.05, 0.02, (count, 3)), rng.normal(0.0, 0.02, (count, 3))
        V[:2], b[2:4] = b[:2], 0.0 if k % 9 else b[2:4]
        rests = rng.random((count, 1)) < 0.999
        share, state = each.step(state, {}, PERIOD, rests, lambda: Look(b, 0.5 * b, V, J))  # noqa: B023
        for i, one in enumerate(alone):
            look = Look(b[i], 0.5 * b[i], V[i], J[i])
            s, after = each.step(one, {}, PERIOD, rests[i], lambda: look)  # noqa: B023
            one |= after
            assert share[i, 0] == pytest.approx(s, rel=1e-12)
    assert share.min() == LEAST
    assert share[:2].min() == 1.0


class Hand:
    """A session of an arm that learns its Jacobian, which a hand leads out of reach."""

    def __init__(self, arm, jerk, task):
        limits = {"velocity": 1.0, "acceleration": 5.0, "jerk": jerk}
        document = {"name": "far", "arm": arm, "path": {"kind": "rest"}, "limits": limits}
        document |= {"law": {"kind": "adaptive", "jacobian": "learned"}, "period": PERIOD}
        document |= {"duration": 1.0} | ({"task": "pose"} if task == "pose" else {})
        self.session, self.speeds, self.errors = Session(make_experiment(document)), [], []
        self.begin = self.session.kinematics.p_WE(self.session.position())

    def lead(self, target, seconds):
        """Lead the target to a place [m], and note speeds [rad/s] and errors [m] of slices."""
        self.session.set("target", np.asarray(target).tolist())
        for _ in range(round(seconds / SLICE)):
            q = self.session.position()
            self.session.advance()
            self.speeds.append(np.abs(self.session.position() - q).max() / SLICE)
            self.errors.append(self.session.numbers()["position_error"])

    def time_to_rest(self):
        """Return how long joints are faster than 0.01 rad/s once the error falls no more [s]."""
        most = int(np.argmax(self.errors))
        gains = np.array(self.errors[most:]) > min(self.errors[most:]) + 1e-3
        ends = most + int(np.flatnonzero(gains).max(initial=0))
        return SLICE * (int(np.flatnonzero(np.array(self.speeds) > 0.01)[-1]) - ends)


UP, ASIDE = (
    1.6 * np.array(away) / np.linalg.norm(away) for away in ([-0.3, 0.6, 1.0], [0.2, -1.0, 0.5])
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("arm", "jerk", "task", "away", "seconds"),
    [
        ("panda", 50.0, "pose", UP, 14.0),
        ("panda", 100.0, "position", ASIDE, 8.0),
        ("panda", 5000.0, "position", ASIDE, 8.0),
        ("iiwa14", 50.0, "position", ASIDE, 10.0),
        ("iiwa14", 100.0, "pose", UP, 14.0),
        ("iiwa14", 5000.0, "pose", UP, 10.0),
    ],
)
def test_an_arm_that_learns_its_jacobian_rests_where_a_hand_leads_it_out_of_reach(
    arm, jerk, task, away, seconds
):
    """One joint or another moved at up to 0.67 rad/s for ever."""
    hand = Hand(arm, jerk, task)
    hand.lead(away, seconds)
    assert hand.errors[-1] > 0.1
    assert hand.time_to_rest() < 2.0
    assert max(hand.speeds[-50:]) < 0.01
    # It comes at once where the target comes back, and has all of its speed.
    hand.lead(hand.begin, 0.2)
    assert max(hand.speeds[-10:]) > 0.05
    hand.lead(hand.begin, 1.0)
    assert max(hand.speeds[-50:]) > 0.9


def _all_of_it(part, state, *seen):
    return 1.0, {"progress": state["progress"]}


@pytest.mark.long
def test_without_a_measure_of_progress_it_swings(monkeypatch):
    monkeypatch.setattr(ShareOfSpeed, "step", _all_of_it)
    last = []
    for case in (("iiwa14", 100.0, "pose"), ("panda", 50.0, "position")):
        hand = Hand(*case)
        hand.lead(UP, 14.0)
        last.append(max(hand.speeds[-50:]))
    assert max(last) > 0.3
