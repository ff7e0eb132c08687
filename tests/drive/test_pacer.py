"""The pacer: a late law costs steps of a stop, and never a bound."""

import json
import os
import signal
import subprocess
import sys
from functools import cache, partial
from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from fr3_stand_in import RefusedError, StandIn

import drake_rnn.drive.pacer
from drake_rnn import FR3, Motion, driven_experiment
from drake_rnn.compiled.library import build_library
from drake_rnn.drive.approach import DrivenLaw
from drake_rnn.drive.pacer import PacedLaw, Pacer, State, law_bytes
from drake_rnn.drive.shared_cycles import LawCommand
from fr3_lost_cycles import ROUNDING, Robot
from fr3_lost_cycles import moved as moved_for
from process_helpers import PATIENCE

H = FR3.period
#: A cycle in which joints move at full acceleration, and the bounds there.
AT, ACCELERATION, JERK = 130, 10.0 * (1 + ROUNDING), 5000.0 * (1 + ROUNDING)
#: A motion that ends when what happens there is long over.
moved = partial(moved_for, cycles=200)
REACHING = {
    "arm": "fr3",
    "path": {"kind": "rest", "offset": [0.2, 0.3, -0.2]},
    "law": {"kind": "adaptive", "braking": 2.0, "feedback_limit": 1.0},
    "period": H,
    "duration": 1.0,
}
SLC = {"kind": "simultaneous_learning", "jacobian": "known"}
LAWS = {
    "SLC": SLC,
    "J known": REACHING["law"],
    "J learned": REACHING["law"] | {"jacobian": "learned"},
}
#: Balls: one in the way of the arm, and one beside it.
BALLS = {
    place: [{"kind": "ball", "center": center, "radius": 0.05, "name": place}]
    for place, center in {"in the way": [0.21, -0.146, 0.687], "beside": [0.5, -0.4, 0.4]}.items()
}
DOCUMENTS = {kind: REACHING | {"law": law} for kind, law in LAWS.items()} | {
    place: REACHING | {"obstacles": balls} for place, balls in BALLS.items()
}


def told(motion, limits):
    jerk = None if limits.jerk is None else tuple(limits.jerk.tolist())
    moved = (tuple(part.tolist()) for part in motion)
    return LawCommand(0, *moved, tuple(limits.acceleration.tolist()), jerk)


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


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """A busy machine makes no step in C late."""
    monkeypatch.setattr(drake_rnn.drive.pacer, "LONGEST", PATIENCE)


@cache
def law_in_c(kind):
    return DrivenLaw(driven_experiment(DOCUMENTS[kind], FR3), True, paced=True)


def law_file(content):
    """A file as a pacer is handed a law in C."""
    file = os.memfd_create("law")
    os.ftruncate(file, len(content))
    os.pwrite(file, content, 0)
    return file


def paced_in_c(law, is_late, cycles=600):
    """What `paced` returns, of a law that the pacer calls itself, and its memory."""
    content = law.law_in_c.memory(law.limits, FR3.command_limits, 100)
    in_c, pacer = PacedLaw(law_file(content)), Pacer(law.start.tolist())
    sent, rest = [law.start], [0.0] * 7
    for k in range(1, cycles):
        in_c.pass_cycles(1, k)
        if is_late(k):
            pacer.stop()
        else:
            assert pacer.take(in_c.command(pacer.motion, State(k * H, rest, rest, rest, 1.0)))
            in_c.keep(pacer.motion, k)
        sent.append(np.array(pacer.motion.position))
    return np.array(sent), in_c.memory


@pytest.mark.parametrize(
    ("kind", "cycles"),
    [
        ("SLC", 600),
        pytest.param("J known", 300, marks=pytest.mark.long),
        pytest.param("J learned", 150, marks=pytest.mark.long),
        pytest.param("in the way", 600, marks=pytest.mark.long),
    ],
)
def test_a_law_in_c_goes_on_as_in_numpy_where_cycles_are_missed(kind, cycles):
    pytest.importorskip("jax")
    missed = np.repeat(np.random.default_rng(3).random(60) < 0.3, 10)
    law = law_in_c(kind)
    sent, memory = paced_in_c(law, lambda k: missed[k], cycles)
    own, _ = paced(DOCUMENTS[kind], lambda k: missed[k], cycles)
    assert np.abs(sent - sent[0]).max() > 0.01
    assert 20 < missed[:cycles].sum() < 400
    np.testing.assert_allclose(sent, own, rtol=0, atol=1e-8)
    assert (memory.first, memory.over, memory.why) == (1, None, "")


@pytest.mark.long
def test_one_build_serves_a_pacer_wherever_its_obstacle_is():
    """The pacer is given where it is, and its arm goes elsewhere."""
    laws = [law_in_c(place) for place in BALLS]
    sent, memories = zip(*(paced_in_c(law, lambda k: False) for law in laws), strict=True)
    assert memories[0].about["library"] == memories[1].about["library"]
    assert memories[0].about["numbers"] != memories[1].about["numbers"]
    assert np.abs(sent[0] - sent[1]).max() > 0.01


def test_a_law_in_c_ends_after_its_last_sample():
    pytest.importorskip("jax")
    law = law_in_c("SLC")
    content = law.law_in_c.memory(law.limits, FR3.command_limits, 100)
    in_c, rest = PacedLaw(law_file(content)), [0.0] * 7
    in_c.pass_cycles(1, 7)
    in_c.pass_cycles(998, 1005)
    pacer = Pacer(law.start.tolist())
    for cycle, is_over in ((1006, False), (1007, True), (1008, True)):
        in_c.pass_cycles(1, cycle)
        command = in_c.command(pacer.motion, State(cycle * H, rest, rest, rest, 1.0))
        assert (command is None, in_c.memory.over) == (is_over, 1007 if is_over else None)


#: Steps in C that go wrong from the 50th sample on.
WRONG_STEPS = {
    "fault": ("*(volatile int *)8 = 1;", "law: its step in C was ended by SIGSEGV"),
    "no stack": ("return deep(row);", "law: its step in C "),
    "illegal": ("__builtin_trap();", "law: its step in C was ended by SIGILL"),
    "endless": ("for (volatile int k = 0;; ++k) { }", "law: its step in C takes longer than 0.0"),
    "not finite": ("return 1;", "law: its step in C is not finite"),
}
STEP = """
static int deep(const double *row)
{{
    volatile double room[512];
    room[0] = row[0];
    return row[0] > 0.0 ? deep((const double *)room) + (int)room[1] : 0;
}}
int law_sample(const double *x, const double *given, const double *row, double *after);
int law_sample(const double *x, const double *given, const double *row, double *after)
{{
    if (row[0] > 0.0495) {{
        {wrong}
    }}
    for (int k = 0; k < {size}; ++k) {{
        after[k] = x[k];
    }}
    (void)given;
    return deep != 0 ? 0 : 1;
}}
"""


@pytest.mark.parametrize("kind", WRONG_STEPS)
def test_a_step_in_c_that_goes_wrong_ends_nothing_but_itself(kind, monkeypatch):
    """What it is called from goes on, and says why it has ended; so does the next call."""
    pytest.importorskip("jax")
    wrong, why = WRONG_STEPS[kind]
    law = law_in_c("SLC")
    content = law.law_in_c.memory(law.limits, FR3.command_limits, 100)
    size = int.from_bytes(content[:8], "little")
    about = json.loads(content[1024 : 1024 + size])
    size = len(about["start"])
    about["library"] = str(build_library(STEP.format(wrong=wrong, size=size)))
    table = np.zeros((about["samples"], about["columns"]))
    table[:, 0] = H * np.arange(about["samples"])
    in_c = PacedLaw(law_file(law_bytes(about, table.tobytes())))
    pacer, rest = Pacer(law.start.tolist()), [0.0] * 7
    for k in range(60):
        if k == 50 and kind == "endless":
            monkeypatch.setattr(drake_rnn.drive.pacer, "LONGEST", 0.05)
        in_c.pass_cycles(1, k)
        command = in_c.command(pacer.motion, State(k * H, rest, rest, rest, 1.0))
        assert (command is not None) == (k < 50)
        if command is None:
            pacer.stop()
        else:
            assert pacer.take(command)
            in_c.keep(pacer.motion, k)
    assert in_c.memory.why.startswith(why)
    # Another fault of this process is what it was.
    code = "import ctypes, os; ctypes.string_at(8)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == -signal.SIGSEGV


def test_a_command_of_a_law_in_c_is_looked_at_once_more():
    pytest.importorskip("jax")
    law = law_in_c("SLC")
    slow = FR3.command_limits.replace(velocity=0.01 * FR3.command_limits.velocity)
    near = FR3.command_limits.replace(position_upper=law.start + 1e-4)
    for limits, why in ((slow, "is to move by"), (near, "rad; it may be")):
        in_c = PacedLaw(law_file(law.law_in_c.memory(law.limits, limits, 100)))
        pacer, rest, count = Pacer(law.start.tolist()), [0.0] * 7, 0
        for k in range(400):
            in_c.pass_cycles(1, k)
            command = in_c.command(pacer.motion, State(k * H, rest, rest, rest, 1.0))
            if command is None:
                break
            assert pacer.take(command)
            in_c.keep(pacer.motion, k)
            count += 1
        assert 0 < count < 300
        assert in_c.memory.why.startswith("command: fr3_joint")
        assert why in in_c.memory.why


def test_a_law_without_a_bound_of_the_jerk_stays_below_half_a_change_of_it():
    sent, law = paced(REACHING | {"law": SLC}, lambda k: k % 7 == 0)
    assert law.limits.jerk is None
    np.testing.assert_array_equal(law.limits.acceleration, 2.4)
    jerk = np.diff(sent, n=3, axis=0) / H**3
    assert np.abs(jerk).max() <= FR3.limits.jerk.min()


def test_what_does_not_go_on_from_the_motion_is_not_taken():
    pacer, still = Pacer([0.0] * 7), np.zeros(7)
    limits = FR3.command_limits
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


#: What a robot may tell that is no state.
WRONG = {
    "a position that is no number": lambda s: s._replace(q=[nan, *s.q[1:]]),
    "infinite velocities": lambda s: s._replace(dq=[inf] * 7),
    "six joints": lambda s: s._replace(q=s.q[:6], dq=s.dq[:6], held=s.held[:6]),
    "no joints": lambda s: s._replace(q=[]),
    "positions held that are no numbers": lambda s: s._replace(held=[nan] * 7),
    "a time that is no number": lambda s: s._replace(time=nan),
    "an infinite time": lambda s: s._replace(time=inf),
    "a time long before": lambda s: s._replace(time=s.time - 1e6),
    "a time long after": lambda s: s._replace(time=s.time + 1e6),
}


@pytest.mark.parametrize("name", WRONG)
def test_whatever_a_robot_tells_it_is_answered_within_its_bounds(name, monkeypatch):
    """Of the states some are wrong; an exception would end the motion without a stop."""

    class Wild(Robot):
        def read(self):
            state = super().read()
            return WRONG[name](state) if AT <= round(state.time / H) < AT + 3 else state

        def look(self):
            return super().read()

    monkeypatch.setattr("fr3_lost_cycles.Robot", Wild)
    robot = moved(AT, 0, "waiting")
    acceleration, jerk = robot.worst
    assert 9.9 < acceleration <= ACCELERATION
    assert jerk <= JERK
    assert robot.lost <= 4
    assert not any(robot.v)


# Before a motion a clock may be anywhere.
@pytest.mark.parametrize("name", [name for name in WRONG if "long" not in name])
def test_a_robot_that_tells_what_is_no_state_is_not_taken_over(name, monkeypatch):
    class Wild(Robot):
        def look(self):
            return WRONG[name](super().read())

        def begin(self):
            pytest.fail("it was taken over")

    monkeypatch.setattr("fr3_lost_cycles.Robot", Wild)
    with pytest.raises(ValueError, match=r"^a state has "):
        moved(AT, 0, "waiting")


def test_commands_that_are_no_numbers_are_not_taken():
    pacer, still = Pacer([0.0] * 7), np.zeros(7)
    right = told(Motion(still + H * 0.004, still + 0.004, still + 4.0), FR3.command_limits)
    for field in ("position", "velocity", "acceleration", "most", "jerk"):
        for wrong in (nan, inf, -inf, 0.0):
            values = (wrong, *getattr(right, field)[1:])
            taken = pacer.take(right._replace(**{field: values}))
            assert not taken or (field in ("most", "jerk") and wrong == inf)
            pacer = Pacer([0.0] * 7)
    assert pacer.take(right)
