"""Cycles that a robot loses since its pacer stands still: the next command goes on from them."""

import os
from functools import partial
from math import inf

import pytest

from drake_rnn.drive import pacer
from fr3_judge_packets import judged_by
from fr3_lost_cycles import ROUNDING
from fr3_lost_cycles import moved as moved_for

#: A cycle in which joints move at full acceleration.
AT = 130
ACCELERATION, JERK = 10.0 * (1 + ROUNDING), 5000.0 * (1 + ROUNDING)
#: A motion that ends when the cycles that are lost are long over.
moved = partial(moved_for, cycles=200)


@pytest.mark.parametrize("place", ["waiting", "answering", "sending"])
@pytest.mark.parametrize("lost", [1, 18])
def test_a_robot_that_drops_what_is_late_is_commanded_within_its_bounds(place, lost):
    robot = moved(AT, lost, place)
    acceleration, jerk = robot.worst
    # After a stall while it sent, the state that tells whether it was taken is the next one.
    assert robot.lost == lost + (place == "sending")
    assert 9.9 < acceleration <= ACCELERATION
    assert jerk <= JERK


def test_a_robot_that_applies_what_is_late_tells_so_and_is_commanded_within_its_bounds(
    monkeypatch,
):
    robot = moved(AT, 1, "sending", applies_late=True)
    acceleration, jerk = robot.worst
    assert robot.lost == 2
    assert 9.9 < acceleration <= ACCELERATION
    assert jerk <= JERK
    # Without what it tells, the motion goes on from one that the robot never made.
    monkeypatch.setattr(pacer.Pacing, "_settle", lambda *_: False)
    assert moved(AT, 1, "sending", applies_late=True).worst[1] > 2 * JERK


@pytest.mark.parametrize("place", ["waiting", "answering"])
@pytest.mark.parametrize(
    "lost", [1.95, *(pytest.param(lost, marks=pytest.mark.long) for lost in (1.6, 1.85, 4.9, 17.9))]
)
def test_the_newest_state_is_not_answered_either_when_it_is_nearly_a_cycle_old(place, lost):
    """The answer would come a moment after the next state, and be dropped."""
    robot = moved(AT, lost, place)
    acceleration, jerk = robot.worst
    assert lost - 1 <= robot.lost <= lost + 1
    assert acceleration <= ACCELERATION
    assert jerk <= JERK


@pytest.mark.long
def test_a_robot_at_half_its_pace_is_answered_in_every_other_cycle():
    """As a simulated one on a busy machine: its states seem to have waited."""
    robot = moved(AT, 0, "waiting", pace=2e-3)
    acceleration, jerk = robot.worst
    assert 0 < robot.lost <= 350
    assert acceleration <= ACCELERATION
    assert jerk <= JERK


@pytest.mark.parametrize("place", ["waiting", "sending"])
def test_who_takes_what_is_late_for_taken_commands_a_discontinuity(place, monkeypatch):
    monkeypatch.setattr(pacer, "LATE", inf)
    monkeypatch.setattr(pacer, "DROPPED", inf)
    assert moved(AT, 3, place).worst[1] > JERK


@pytest.mark.long
def test_a_third_partys_checker_takes_what_follows_lost_cycles():
    if not (python := os.environ.get("FRANKA_SIM_PYTHON")):
        pytest.skip("FRANKA_SIM_PYTHON names no Python that has franka-sim")
    silent = [moved(AT, lost, "waiting").packets for lost in (1, 3, 18)]
    assert judged_by(python, silent) == [""] * 3
    # It applies what comes late, which a robot drops, and tells so, unless more cycles have passed.
    late = [moved(AT, lost, "sending", applies_late=True).packets for lost in (1, 1.5)]
    assert judged_by(python, late) == [""] * 2
    (why,) = judged_by(python, [moved(AT, 3, "sending", applies_late=True).packets])
    assert "discontinuity" in why
