"""An experiment that is played with keeps its bounds, and is itself while nobody touches it."""

import gc
import json
import os
import re
import resource
from contextlib import contextmanager
from itertools import count
from urllib.request import Request, urlopen

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.laws.parts.safe_velocity import NO_STOP
from drake_rnn.live.play import Play
from drake_rnn.live.session import Session
from drake_rnn.playback import write_playback
from drake_rnn.robot.model import Model
from drake_rnn.runs.result import Result
from live_stranger import Watched, play


def played(name, changes=None, **options):
    return Session(load_experiment(name, changes), **options)


def advanced(session, seconds):
    for _ in range(round(seconds / 0.02)):
        session.advance()
    return session


@pytest.mark.parametrize("name", ["slc_nephroid_known", "adaptive_nephroid"])
def test_untouched_it_is_the_run_to_the_last_bit(name):
    session, found = played(name), []
    session.watch = lambda segment, steps: found.append((steps.time[1:], steps.series("position")))
    advanced(session, 0.4)
    run = simulate(load_experiment(name, {"duration": 0.4, "log_period": 1e-3}))
    q = np.concatenate([each[1:] for _, each in found])
    assert np.array_equal(q, run.series["position"][1:])


def kept(session, watched):
    assert watched.jump == 0.0
    assert watched.excess["position"] <= 1e-9
    assert watched.excess["velocity"] <= 1e-9
    assert watched.excess["acceleration"] <= 1e-9
    assert watched.excess["jerk"] <= 1e-9


@pytest.mark.parametrize(
    "name", [pytest.param("slc_nephroid_known", marks=pytest.mark.long), "adaptive_jerk"]
)
def test_bounds_hold_whatever_is_set(name):
    session = played(name)
    watched = Watched(session)
    assert play(session, 1.6, seed=5, switches=1.0) >= 5
    kept(session, watched)


@pytest.mark.long
@pytest.mark.parametrize(
    ("seconds", "seed", "switches"),
    # In the short one everything is switched often, and velocities and accelerations reach bounds.
    [(4.0, 1, 1.0), *(pytest.param(10.0, seed, 0.4, marks=pytest.mark.nightly) for seed in (0, 1))],
)
@pytest.mark.parametrize(
    "name", ["slc_nephroid_known", "adaptive_nephroid", "adaptive_pose", "adaptive_jerk"]
)
def test_bounds_hold_for_long_whatever_is_set(name, seconds, seed, switches):
    session = played(name)
    watched = Watched(session)
    play(session, seconds, seed, switches)
    kept(session, watched)


@pytest.mark.long
@pytest.mark.parametrize("seconds", [4.0, pytest.param(8.0, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", ["adaptive_moving_obstacle", "slc_nephroid_guarded"])
def test_nothing_touches_the_moving_arm_wherever_obstacles_are_dragged(name, seconds):
    session = played(name)
    watched = Watched(session)
    play(session, seconds, seed=1)
    kept(session, watched)
    assert watched.distance >= 0.005 - 1e-9


def test_a_law_takes_over_with_the_velocity_of_the_last_one():
    session = played("slc_nephroid_known")
    watched = Watched(session)
    session.set("target", [0.4, 0.3, 0.4])
    advanced(session, 0.6)
    before = session.controls()["law"].value
    other = next(law for law in session.controls()["law"].options if law != before)
    assert session.set("law", other).text == f"law: {other}"
    assert session.controls()["law"].value == other
    session.set("level", "dynamic")
    advanced(session, 0.2)
    kept(session, watched)
    # The arm with motors went on with the command's velocity.
    assert session.numbers()["velocity_ratio"] > 0.1


def test_a_learned_jacobian_is_forgotten_and_learned_again_in_flight():
    session = advanced(played("adaptive_nephroid"), 1.0)
    watched = Watched(session)
    assert session.numbers()["jacobian_error"] < 1.0
    session.set("reset J", None)
    assert session.numbers()["jacobian_error"] > 1.0
    session.set("target", [0.3, 0.1, 0.5])
    advanced(session, 1.0)
    assert session.numbers()["jacobian_error"] < 1.0
    kept(session, watched)


@pytest.mark.long
def test_the_force_is_led_to_what_is_set():
    session = advanced(played("motion_force_cat"), 0.1)
    session.set("force", 0.2)
    advanced(session, 0.8)
    assert session.numbers()["force_desired"] == pytest.approx(0.2)
    assert session.numbers()["force"] == pytest.approx(0.2, rel=0.05)
    session.set("target", [0.5, 0.5, 1.0])
    advanced(session, 0.3)
    # The target is dragged along the surface alone.
    p = session.hands.target.position(session.time)[0]
    assert p[2] == pytest.approx(session.hands.target.own.position(0.0)[0][2], abs=1e-12)


def test_gains_change_between_samples_and_reset_brings_them_back():
    session = played("slc_nephroid_known")
    session.set("law.kappa", 20.0)
    advanced(session, 0.1)
    assert session.controls()["law.kappa"].value == 20.0
    session.set("reset", None)
    assert session.controls()["law.kappa"].value == 4.0
    assert session.time == 0.0
    assert np.array_equal(session.position(), session.experiment.start)


def test_what_is_saved_is_a_result_that_loads_and_plays(tmp_path):
    session = advanced(played("slc_nephroid_known"), 0.2)
    with pytest.raises(InvalidInputError, match="record first"):
        session.end_recording()
    session.set("record", True)
    session.set("target", [0.25, 0.1, 0.5])
    advanced(session, 0.4)
    session.set("law.kappa", 8.0)
    advanced(session, 0.2)
    begin = session.recording.begin
    q = session.position().copy()
    saved = session.end_recording()
    saved.save(tmp_path / "live")
    loaded = Result.load(tmp_path / "live")
    assert loaded.time[0] == 0.0
    assert loaded.time[-1] == pytest.approx(0.6)
    assert np.array_equal(loaded.series["position"][-1], q)
    assert loaded.metrics["acceleration_violation_max_rad_s2"] < 1e-9
    assert any("law.kappa = 8" in warning for warning in loaded.warnings)
    desired = session.hands.target.position(begin + 0.3)[0]
    assert loaded.series["p_WE_desired"][30] == pytest.approx(desired, abs=1e-12)
    # Its document leads along the same points.
    assert loaded.experiment.desired.position(0.3)[0] == pytest.approx(desired, abs=1e-4)
    assert write_playback(loaded, tmp_path / "playback.html").stat().st_size > 1e6


def test_a_switch_ends_the_recording_which_is_kept():
    session = played("adaptive_nephroid")
    session.set("record", True)
    advanced(session, 0.1)
    ended = session.set("noise", True)
    assert ended.notice == "the recording has ended, after 0.1 s; it can be saved"
    assert session.recording.ended
    assert not session.controls()["record"].value
    advanced(session, 0.1)
    assert session.end_recording().time[-1] == pytest.approx(0.1)
    assert not session.set("noise", False).notice
    session.set("record", True)
    advanced(session, 0.1)
    assert session.set("reset", None).notice == "the recording of 0.1 s is discarded"


def test_a_pause_stops_time_and_nothing_else():
    session = advanced(played("slc_nephroid_known"), 0.1)
    session.set("pause", True)
    advanced(session, 1.0)
    assert session.time == pytest.approx(0.1)
    session.set("pause", False)
    advanced(session, 0.02)
    assert session.time == pytest.approx(0.12)


@pytest.mark.parametrize(
    ("name", "changes", "why"),
    [
        ("slc_nephroid_continuous", None, "give a period"),
        ("adaptive_two_arms", None, "a single arm"),
        ("horizon_circle", None, "known ahead"),
    ],
)
def test_what_cannot_be_played_with_is_refused(name, changes, why):
    with pytest.raises(InvalidInputError, match=why):
        played(name, changes)


def test_where_nothing_keeps_the_bounds_nothing_is_switched():
    session = played("chain_circle")
    assert not {"law", "level", "learned", "noise"} & session.controls().keys()
    assert any("live:" in warning for warning in session.warnings)


@contextmanager
def no_more_files():
    """Leave this process no file to open."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    # A file gets the lowest number that is free.
    free = os.open("/dev/null", os.O_RDONLY)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_time_starts_with_the_first_page_which_frames_the_hand_along_the_path():
    session = played("adaptive_jerk")
    play, looks = Play(session, "localhost", 0, lambda result: "", waits=True), count(1)
    play.run(lambda: next(looks) > 20)
    assert session.time == 0.0
    page = urlopen(play.url).read().decode()
    urlopen(Request(f"{play.url}controls", b"null", {"Content-Type": "application/json"}))
    play.run(lambda: session.time > 0.0)
    play.close()
    data = json.loads(re.search(r'id="playback-data"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    seen = np.array(data["views"]["arm"]["points"])
    experiment = session.experiment
    skeleton = experiment.arm.kinematics().skeleton(experiment.start)
    path = experiment.desired.sample(100)
    # The wrist, which is above the tool, is in the frame at the path's highest point too.
    assert seen[:, 2].max() > path[:, 2].max() + np.ptp(skeleton[-3:, 2])
    assert (seen.max(axis=0) > path.max(axis=0) + 0.05).all()
    assert (seen.min(axis=0) < path.min(axis=0) - 0.05).all()


def test_its_pictures_end_with_it_and_not_where_garbage_is_collected():
    """Drake ends the process where another thread than its own deletes a Meshcat."""
    session, before = played("slc_nephroid_known"), len(os.listdir("/proc/self/task"))
    gc.disable()
    try:
        play = Play(session, "localhost", 0, lambda result: "")
        play.run(lambda: session.time > 0.02)
        assert len(os.listdir("/proc/self/task")) >= before + 2
        play.close()
        play.close()
        assert len(os.listdir("/proc/self/task")) == before
    finally:
        gc.enable()


@pytest.mark.long
def test_nothing_is_read_from_files_while_it_plays(monkeypatch):
    session = played("slc_nephroid_known")
    play = Play(session, "localhost", 0, lambda result: "")
    other = session.controls()["law"].options[-1]
    monkeypatch.setattr(Model, "add_to", lambda model, plant: pytest.fail("a model is parsed"))
    play.run(lambda: session.time > 0.1)
    for name, value in (("law", other), ("noise", True), ("target", [0.4, 0.1, 0.4])):
        assert not session.set(name, value).refused
        play.run(lambda until=session.time + 0.05: session.time > until)
    assert session.set("reset", None).text == "reset"
    play.run(lambda: session.time > 0.05)
    play.close()


@pytest.mark.long
def test_a_session_goes_on_without_a_file_to_open():
    session = played("slc_nephroid_known")
    play = Play(session, "localhost", 0, lambda result: os.listdir("."))
    other = session.controls()["law"].options[-1]
    play.run(lambda: session.time > 0.02)
    with no_more_files():
        with pytest.raises(OSError, match="Too many open files"):
            os.open("/dev/null", os.O_RDONLY)
        assert session.set("record", True).text == "recording"
        play.run(lambda: session.time > 0.2)
        assert play._save_recording().refused
        # Motors need a plant of their own: refused, and nothing changes, unless the arm has one.
        reply = session.set("level", "dynamic")
        assert session.controls()["level"].value == ("kinematic" if reply.refused else "dynamic")
        session.set("level", "kinematic")
        assert session.controls()["level"].value == "kinematic"
        assert session.set("law", other).text == f"law: {other}"
        play.run(lambda: session.time > 0.3)
    assert play._save_recording().text.startswith("saved")
    assert session.set("level", "dynamic").text == "level: dynamic"
    play.run(lambda: session.time > 0.32)
    assert not session.failure
    play.close()


def test_a_reset_that_fails_changes_nothing(monkeypatch):
    session = advanced(played("slc_nephroid_known"), 0.1)
    session.set("level", "dynamic")
    advanced(session, 0.1)
    time, hands = session.time, session.hands

    def unread(model, plant):
        raise RuntimeError("no such file")

    with monkeypatch.context() as patched:
        patched.setattr(Model, "add_to", unread)
        assert session.set("reset", None).refused
    assert session.hands is hands
    advanced(session, 0.1)
    assert session.time == pytest.approx(time + 0.1)
    assert session.set("reset", None).text == "reset"


def test_a_recording_outlives_its_simulation_and_others_do_not():
    session = played("slc_nephroid_known")
    laws = session.controls()["law"].options
    session.set("record", True)
    advanced(session, 0.1)
    for law in (laws[0], laws[-1], laws[0]):
        session.set("law", law)
        advanced(session, 0.04)
    assert session.end_recording().time[-1] == pytest.approx(0.1)
    assert len(session._segments) == 2
    session.set("record", True)
    assert len(session._segments) == 1


def test_a_law_that_takes_over_knows_where_obstacles_were_and_has_certified_nothing():
    session = advanced(played("adaptive_moving_obstacle"), 0.1)
    segment = session._segment
    layout = segment.controller.reading.state
    x = segment.carry_over(session._law).into(layout, segment.x, type(session._law), anew=True)
    for name in ("gaps", "obstacle_p", "obstacle_time", "anchor_p"):
        assert np.array_equal(layout.part(x, name), layout.part(segment.x, name))
    assert layout.part(x, "stop_delay").item() == NO_STOP


def test_it_says_that_the_target_is_out_of_reach_while_it_is():
    """The tool stops short of it, and says by how much; on the way back it says nothing."""
    session = played("adaptive_jerk", {"period": 0.01})
    assert advanced(session, 0.5).remark() == ""
    session.set("target", [1.2, 0.1, 0.8])
    advanced(session, 7.0)
    target, _, _ = session.hands.target.position(session.time)
    beyond = np.linalg.norm(target - session.kinematics.p_WE(session.position()))
    assert beyond > 0.2
    assert session.remark() == f"target out of reach: {beyond:.2g} m beyond"
    session.set("target", [0.7, 0.1, 0.8])
    assert advanced(session, 3.0).remark() == ""
