"""A shield that is looked at while it runs: of a loop of one's own, and led by a hand."""

import time
from functools import partial
from urllib.request import urlopen

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Shield, ShieldView, load_arm
from drake_rnn.live.shielded import DraggedShield, ShieldSession, experiment_of
from drake_rnn.shield.report import look_ahead

PANDA = load_arm("panda")
LIMITS = PANDA.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
P_WE = PANDA.kinematics().p_WE(PANDA.home)
ASIDE, UP = np.eye(3)[1:]
BETWEEN = P_WE + 0.15 * ASIDE
BALL = {"kind": "ball", "center": BETWEEN.tolist(), "radius": 0.03, "name": "lamp", "speed": 0.1}


def dragged(*obstacles):
    make = partial(Shield, PANDA, 5e-3, limits=LIMITS, obstacles=list(obstacles))
    return DraggedShield(make, experiment_of(make()))


def tool_of(session):
    return session.kinematics.p_WE(session.position())


def play(session, seconds):
    while session.time < seconds:
        session.advance()
    assert not session.failure


def test_the_tool_goes_where_a_hand_drags_the_target():
    """It arrives within the time that the source's speed needs, and a second."""
    session = dragged()
    assert not session.set("target", (P_WE + 0.1 * ASIDE + 0.05 * UP).tolist()).refused
    play(session, 0.3)
    assert 0.0 < session.numbers()["velocity_ratio"] <= 1.0 + 1e-9
    play(session, 1.3)
    np.testing.assert_allclose(tool_of(session), P_WE + 0.1 * ASIDE + 0.05 * UP, atol=2e-3)
    session.set("targets", "poses")
    session.set("target", P_WE.tolist())
    play(session, 3.0)
    np.testing.assert_allclose(tool_of(session), P_WE, atol=2e-3)
    session.set("reset", None)
    assert session.time == 0.0


@pytest.mark.long
def test_what_is_in_the_way_is_told_ahead_and_kept_clear_of():
    session = dragged(BALL)
    session.set("target", (P_WE + 0.3 * ASIDE).tolist())
    told, restrained, least = [], "", np.inf
    while session.time < 1.5:
        session.advance()
        numbers, record = session.numbers(), session.record
        least = min(least, numbers["distance"])
        assert max(numbers[f"{name}_ratio"] for name in ("acceleration", "jerk")) <= 1.0 + 1e-6
        around = (session.kinematics, LIMITS), session.shield.clearance, session.p_WO
        restrained += str(record.at(0))
        told.append(look_ahead(record, session.time, *around).first)
    assert any("in lamp" in each for each in told)
    assert least >= 5e-3
    assert "lamp" in restrained
    session.set("obstacle 0", (BETWEEN + 0.3 * UP).tolist())
    until = session.time + 2.0
    play(session, until)
    (p_WO,) = session.moved_obstacles.values()
    assert 0.1 < p_WO[2] <= 0.2


def test_what_a_page_cannot_set_is_refused():
    session = dragged()
    for name, value in (("law.kappa", 1.0), ("delay", "long"), ("targets", "twists")):
        assert session.set(name, value).refused
    session.set("pause", True)
    session.advance()
    assert session.time == 0.0


def test_a_loop_of_ones_own_is_shown():
    shield = Shield(PANDA, 5e-3, limits=LIMITS, obstacles=[{**BALL, "speed": None}])
    with ShieldView(shield) as view:
        for k in range(40):
            t = 5e-3 * k
            if k % 20 == 0:
                way = PANDA.home + np.linspace(0, 0.4, 16)[:, None]
                shield.follow_positions(way, rate=20, start=t, t=t)
            shield.command(t)
            view.show()
        page = urlopen(view.url).read().decode()
        assert "wanted by the source" in page
        assert "drag me" not in page
        session = ShieldSession(shield, experiment_of(shield))
        numbers = session.numbers()
        assert numbers["behind"] == pytest.approx(shield.status.behind)
        assert numbers["distance"] == pytest.approx(shield.clearance.gaps(shield.position).min())
        assert session.set("target", [0, 0, 0]).refused


def test_what_is_no_shield_is_refused():
    with pytest.raises(InvalidInputError, match="shield: must be"):
        ShieldView(PANDA)


@pytest.mark.long
def test_a_shield_of_another_process_is_shown():
    ball = {**BALL, "speed": None}
    with (
        Shield(PANDA, 5e-3, limits=LIMITS, obstacles=[ball], process=True) as shield,
        ShieldView(shield) as view,
    ):
        way = PANDA.home + np.linspace(0, 0.4, 16)[:, None]
        begin = time.monotonic()
        shield.follow_positions(way, rate=20, start=begin)
        while time.monotonic() < begin + 0.4:
            view.show()
            time.sleep(0.01)
        record = shield.last_record
        # What is left of the way is that of the chunk.
        ((since, kind, ahead),) = record.ways
        assert kind == "positions"
        assert since == pytest.approx(shield.time, abs=0.2)
        assert ahead.times[-1] == pytest.approx(begin + 15 / 20)
        assert ahead.values[-1] == pytest.approx(PANDA.home + 0.4)
        wanted = PANDA.home + 0.4 * (since - begin) / 0.75
        assert record.wanted[0] == pytest.approx(wanted, abs=0.02)
        assert record.command[0] == pytest.approx(shield.position, abs=0.1)
        session = ShieldSession(shield, experiment_of(shield))
        assert session.numbers()["distance"] > 5e-3
