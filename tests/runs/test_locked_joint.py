"""Runs in which joints lock: what rests, what goes on, what is kept, and what is left of a task."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.batch.grouping import why_not
from drake_rnn.drive import ROBOTS
from drake_rnn.drive.robots import driven_experiment
from drake_rnn.live.controls import Variants

LOCK = 1.0
#: A circle that begins at full speed, for a Panda, whose second joint is not needed for it.
DOCUMENT = {
    "arm": "panda",
    "path": {"kind": "circle", "plane": "yz", "size": 0.05, "period": 3.0},
    "law": {"kind": "adaptive"},
    "limits": {"velocity": 0.5, "acceleration": 2.0, "jerk": 40.0},
    "period": 4e-3,
    "log_period": 4e-3,
    "duration": 4.0,
    "window": [0.8, 4.0],
}
SLC = {"kind": "simultaneous_learning", "jacobian": "known", "kappa": 15.0}


def run(*, joint=2, time=LOCK, stop="braked", told=True, duration=4.0, **changes):
    lock = {"joint": joint, "time": time, "stop": stop, "told": told}
    window = None if duration < 4.0 else DOCUMENT["window"]
    changes |= {"duration": duration, "window": window, "faults": [lock]}
    return simulate({**DOCUMENT, **changes})


@pytest.fixture(scope="module")
def locked():
    return run()


@pytest.fixture(scope="module")
def sound():
    return simulate(DOCUMENT)


@pytest.mark.long
def test_until_a_joint_locks_the_run_is_that_of_a_sound_arm_to_the_bit(locked, sound):
    before = locked.time <= LOCK
    for name in ("position", "commanded", "p_WE"):
        np.testing.assert_array_equal(locked.series[name][before], sound.series[name][before])
    after = np.abs(locked.series["position"] - sound.series["position"])[~before]
    assert after.max() > 1e-3


def test_a_locked_joint_comes_to_rest_and_stays_to_the_bit(locked):
    q = locked.series["position"][:, 1]
    at = int(np.searchsorted(locked.time, LOCK))
    speed = abs(q[at] - q[at - 1]) / 4e-3
    assert speed > 0.01
    # The stop of its bounds: v / a and, with the jerk bounded, at most 2 a / j more.
    rest = LOCK + speed / 2.0 + 2.0 * 2.0 / 40.0 + 8e-3
    assert np.ptp(q[locked.time >= rest]) == 0.0
    assert np.abs(np.diff(locked.series["position"][locked.time >= rest][:, 0])).max() > 0.0


def test_a_law_that_is_told_still_follows_the_path(locked):
    metrics = locked.metrics
    # What it wants of the others is right at once; the joint's stop is what it does not count with.
    assert metrics["position_error_before_lock_max_m"] < 1e-6
    assert 1e-4 < metrics["position_error_after_lock_max_m"] < 1e-3
    assert metrics["position_error_lasting_max_m"] < 1e-7
    assert metrics["resettling_time_s"] == pytest.approx(LOCK)


def test_a_law_that_is_not_told_leaves_the_path(locked):
    """The law goes on to want velocities of the joint that it never gets."""
    untold = run(told=False).metrics
    lasting = untold["position_error_lasting_max_m"]
    assert lasting > 1e5 * locked.metrics["position_error_lasting_max_m"]
    assert lasting == pytest.approx(10e-3, rel=0.2)


def test_metrics_are_those_of_the_steps_before_and_after(locked):
    error = np.linalg.norm(locked.series["p_WE"] - locked.series["p_WE_desired"], axis=1)
    for name, within in (
        ("before_lock", (locked.time >= 0.8) & (locked.time <= LOCK)),
        ("after_lock", locked.time >= LOCK),
        ("lasting", locked.time >= LOCK + 2.0),
    ):
        found = locked.metrics[f"position_error_{name}_max_m"]
        assert found == pytest.approx(error[within].max(), rel=1e-12)


def test_without_faults_there_are_none_of_their_metrics(sound):
    names = [name for name in sound.metrics if "lock" in name or "lasting" in name]
    assert names == []
    assert "resettling_time_s" not in sound.metrics


@pytest.mark.parametrize(("joint", "told"), [(1, True), (4, True), (3, False), (6, False)])
def test_every_bound_is_held_through_the_lock(joint, told):
    result = run(joint=joint, told=told, time=0.4 + 0.1 * joint, duration=1.6)
    kept = {"position", "velocity", "acceleration", "jerk"}
    assert kept <= set(result.experiment.guarantees.arm.limits)
    metrics = result.metrics
    assert metrics["position_violation_max_rad"] == 0.0
    assert metrics["velocity_violation_max_rad_s"] <= 0.5e-9
    assert metrics["acceleration_violation_max_rad_s2"] <= 2e-9
    assert metrics["held_jerk_violation_max_rad_s3"] <= 40e-9


def test_a_stop_at_once_breaks_acceleration_and_jerk_and_is_known_to():
    result = run(stop="at_once", duration=1.2)
    assert result.metrics["acceleration_violation_max_rad_s2"] > 1.0
    assert result.metrics["velocity_violation_max_rad_s"] == 0.0
    assert {"acceleration", "jerk"}.isdisjoint(result.experiment.guarantees.arm.limits)


def test_a_stop_that_a_law_did_not_leave_room_for_promises_no_position():
    """A law that keeps no jerk may be told to stop with one, which takes a longer way."""
    faults = [{"joint": 2, "time": LOCK}]
    limits = {"velocity": 0.5, "acceleration": 2.0, "jerk": None}
    with_room = load_experiment({**DOCUMENT, "law": SLC, "limits": limits, "faults": faults})
    without = load_experiment({**DOCUMENT, "law": SLC, "faults": faults})
    assert "position" in with_room.guarantees.command.limits
    assert "position" in with_room.guarantees.arm.limits
    assert "position" not in without.guarantees.arm.limits


def test_two_joints_may_lock_one_after_the_other():
    faults = [{"joint": 1, "time": 1.5}, {"joint": "panda_joint7", "time": 0.5}]
    result = simulate({**DOCUMENT, "duration": 2.5, "window": None, "faults": faults})
    q = result.series["position"]
    assert np.ptp(q[result.time >= 0.8][:, 6]) == 0.0
    assert np.ptp(q[result.time >= 2.0][:, 0]) == 0.0
    assert result.experiment.locks.span == (0.5, 1.5)
    assert result.metrics["held_jerk_violation_max_rad_s3"] <= 40e-9


def test_a_joint_may_be_locked_from_the_start():
    result = run(time=0.0, duration=0.4)
    assert np.ptp(result.series["position"][:, 1]) == 0.0


@pytest.mark.long
def test_a_learned_jacobian_does_not_notice_but_is_right_when_told():
    """It learns from measured joint velocities: of a joint that rests it learns nothing."""
    law = {"kind": "adaptive", "jacobian": "learned", "J_hat_initial": "exact", "kappa": 30.0}
    told, untold = (run(law=law, told=told) for told in (True, False))
    column = untold.series["J_hat"].reshape(-1, 3, 7)[:, :, 1]
    at_lock, end = column[untold.time <= LOCK][-1], column[-1]
    assert np.linalg.norm(end - at_lock) < 0.3 * np.linalg.norm(at_lock)
    lasting = [each.metrics["position_error_lasting_max_m"] for each in (told, untold)]
    assert lasting[0] < 1e-4
    assert lasting[1] > 1e-3


@pytest.mark.long
def test_an_arm_with_motors_holds_a_locked_joint():
    sound, locked = (
        simulate({**DOCUMENT, "level": "dynamic", "period": 2e-3, **change})
        for change in ({}, {"faults": [{"joint": 2, "time": LOCK}]})
    )
    rest = locked.time >= LOCK + 1.0
    # Its motor gives way by what gravity's model and the moving links ask of it.
    assert np.ptp(locked.series["position"][rest][:, 1]) < 1e-4
    assert np.ptp(sound.series["position"][rest][:, 1]) > 1e-2
    assert locked.metrics["position_error_lasting_max_m"] < 2e-3
    assert locked.experiment.guarantees.arm.limits == ()


def test_a_filter_and_noise_that_moves_the_arm_pass_through_the_brakes():
    limits = {"velocity": 0.5, "acceleration": 2.0, "jerk": 400.0}
    filtered = {"law": {"kind": "pseudoinverse", "feedback": 2.0}, "filter": {}, "limits": limits}
    result = run(duration=1.8, **filtered)
    assert np.ptp(result.series["position"][result.time >= 1.5][:, 1]) == 0.0
    assert "acceleration" in result.experiment.guarantees.arm.limits
    assert result.metrics["acceleration_violation_max_rad_s2"] <= 2e-9
    dither = {"model": "actuated", "sigma": 0.02, "hold": 4e-3}
    shaken = run(duration=1.6, dither=dither, law={**SLC, "jacobian": "learned"})
    assert np.ptp(shaken.series["position"][shaken.time >= 1.5][:, 1]) == 0.0
    assert np.ptp(shaken.series["position"][shaken.time >= 1.5][:, 2]) > 0.0


def test_what_cannot_lock_joints_says_so():
    document = {**DOCUMENT, "name": "locked", "faults": [{"joint": 2, "time": LOCK}]}
    assert why_not(document) == "faults: a batch has none; simulate has"
    with pytest.raises(InvalidInputError, match="faults: no joint locks while one plays"):
        Variants(load_experiment(document))
    with pytest.raises(InvalidInputError, match="faults: must be left out; the joints of a robot"):
        driven_experiment({**document, "arm": "iiwa14"}, ROBOTS["iiwa"])


def test_few_joints_left_and_postures_out_of_reach_are_warned_of():
    faults = [{"joint": k, "time": 1.0} for k in (1, 2, 3, 5, 7)]
    warned = load_experiment({**DOCUMENT, "faults": faults}).warnings
    assert any("2 joints remain for the 3 dimensions of the task" in text for text in warned)
    posture = load_experiment("null_space_adjustment", {"faults": [{"joint": 3, "time": 1.0}]})
    assert any("will not reach the target posture" in text for text in posture.warnings)


def test_the_document_of_a_run_with_faults_reads_back():
    document = {**DOCUMENT, "faults": [{"joint": 2, "time": LOCK, "told": False}]}
    made = load_experiment(document)
    again = load_experiment(made.document.contents())
    assert again.document.faults[0].told is False
    assert again.document.to_yaml() == made.document.to_yaml()
