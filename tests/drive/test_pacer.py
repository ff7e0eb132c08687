"""The pacer: a late law costs steps of a stop, and never a bound."""

from itertools import pairwise

import numpy as np
import pytest
from fr3_stand_in import RefusedError, StandIn

from drake_rnn import FR3, Motion, driven_experiment
from drake_rnn.drive.driven_law import DrivenLaw
from drake_rnn.drive.pacer import Pacer
from drake_rnn.drive.shared_cycles import Told

H = FR3.period
REACHING = {
    "arm": "fr3",
    "path": {"kind": "rest", "offset": [0.2, 0.3, -0.2]},
    "law": {"kind": "adaptive", "braking": 2.0, "feedback_limit": 1.0},
    "period": H,
    "duration": 1.0,
}


def told(motion, limits):
    jerk = None if limits.jerk is None else tuple(limits.jerk.tolist())
    moved = (tuple(part.tolist()) for part in motion)
    return Told(0, *moved, tuple(limits.acceleration.tolist()), jerk)


def paced(document, is_late, cycles=600):
    """Positions that are commanded while the law answers some cycles late, and the limits."""
    law = DrivenLaw(driven_experiment(document, FR3))
    pacer, sent, rest = Pacer(law.start.tolist()), [law.start], np.zeros(7)
    for k in range(1, cycles):
        if is_late(k):
            pacer.stop()
        else:
            motion = Motion(*map(np.array, pacer.motion))
            law.resume((k - 1) * H, motion)
            law.advance(k * H, law.start, rest)
            assert pacer.take(told(law.motion(), law.limits))
        sent.append(np.array(pacer.motion.position))
    return np.array(sent), law


@pytest.mark.parametrize("seed", range(2))
def test_a_late_law_breaks_no_bound_and_goes_on(seed):
    rng = np.random.default_rng(seed)
    late = np.repeat(rng.random(60) < 0.3, 10)
    sent, law = paced(REACHING, lambda k: late[k])
    v = np.diff(sent, axis=0, prepend=sent[:1]) / H
    a = np.diff(v, axis=0, prepend=0 * v[:1]) / H
    jerk = np.diff(a, axis=0, prepend=0 * a[:1]) / H
    limits = law.limits
    assert np.abs(v).max() > 0.3
    assert (np.abs(v) <= limits.velocity * (1 + 1e-9)).all()
    # Positions are rounded to 4e-16 rad, which is 4e-10 rad/s^2 and 1e-6 rad/s^3.
    assert (np.abs(a) <= limits.acceleration + 4e-9).all()
    assert (np.abs(jerk) <= limits.jerk + 4e-6).all()


def test_a_law_without_a_bound_of_the_jerk_stays_below_half_a_change_of_it():
    slc = REACHING | {"law": {"kind": "simultaneous_learning", "jacobian": "known"}}
    sent, law = paced(slc, lambda k: k % 7 == 0)
    assert law.limits.jerk is None
    np.testing.assert_array_equal(law.limits.acceleration, 2.4)
    jerk = np.diff(sent, n=3, axis=0) / H**3
    assert np.abs(jerk).max() <= FR3.limits.jerk.min()


def test_what_does_not_go_on_from_the_motion_is_not_taken():
    pacer, still = Pacer([0.0] * 7), np.zeros(7)
    limits = FR3.commanded
    jump = Motion(still + 0.1, still, still)
    fast = Motion(still + H * 0.02, still + 0.02, still + 20.0)
    sudden = Motion(still + H * 0.009, still + 0.009, still + 9.0)
    untrue = Motion(still + H * 0.001, still + 0.001, still + 4.0)
    for wrong in (jump, fast, sudden, untrue):
        assert not pacer.take(told(wrong, limits))
        assert pacer.motion.position == (0.0,) * 7
    assert pacer.take(told(Motion(still + H * 0.004, still + 0.004, still + 4.0), limits))
    assert not pacer.rests


def test_cycles_that_the_robot_loses_are_mirrored():
    """The robot goes on with its acceleration, and objects to whoever does not know."""
    sent, law = paced(REACHING, lambda k: False, cycles=150)
    for knows in (True, False):
        pacer, robot = Pacer(law.start.tolist()), StandIn("none")
        for before, q in pairwise(sent):
            v = (q - before) / H
            a = (v - np.array(pacer.motion.velocity)) / H
            pacer.take(told(Motion(q, v, a), law.limits))
            robot.answer(pacer.motion.position, is_last=False)
        for _ in range(3):
            robot._move([v + H * a for v, a in zip(robot.v, robot.a, strict=True)])
        pacer.lose(3 if knows else 0)
        pacer.stop()
        if knows:
            robot.answer(pacer.motion.position, is_last=False)
        else:
            with pytest.raises(RefusedError, match=r"rad/s\^3"):
                robot.answer(pacer.motion.position, is_last=False)
