"""Runs in which the law sees the joints as sensors measure them."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.laws.parts.jacobian import rank_one_update
from drake_rnn.robot.rotation import rotation_error

KINEMATIC, DYNAMIC = "slc_nephroid_known", "slc_nephroid_dynamic"
#: The arm has joined the path after some two seconds.
SHORT = {"duration": 4, "window": [3, 4], "accept": {}, "log_period": 1e-3}


def run(name=KINEMATIC, sensing=None, **changes):
    return simulate(load_experiment(name, {**SHORT, "sensing": sensing, **changes}))


def off(result):
    return result.metrics["position_error_max_m"]


@pytest.fixture(scope="module")
def true():
    return run()


@pytest.mark.parametrize("name", [KINEMATIC, DYNAMIC])
def test_perfect_sensors_change_nothing_to_the_last_bit(name):
    changes = {"duration": 0.5, "window": None}
    ideal, sensed = run(name, **changes), run(name, {}, **changes)
    for key, values in ideal.series.items():
        np.testing.assert_array_equal(sensed.series[key], values)
    np.testing.assert_array_equal(sensed.series["position_measured"], ideal.series["position"])
    assert "position_measured" not in ideal.series


@pytest.mark.long
def test_encoders_of_20_bits_track_as_well_and_of_10_bits_worse(true):
    """A step of 6 urad at each joint is some um at the end effector, one of 6 mrad some mm."""
    assert off(run(sensing={"encoder_bits": 20})) == pytest.approx(off(true), abs=2e-6)
    assert off(true) < 1e-3
    assert 1.5 * off(true) < off(run(sensing={"encoder_bits": 10})) < 1e-2


@pytest.mark.long
def test_so_it_is_with_an_arm_that_has_mass():
    changes = {"duration": 2.6, "window": [2.4, 2.6]}
    ideal = off(run(DYNAMIC, **changes))
    assert off(run(DYNAMIC, {"encoder_bits": 20}, **changes)) == pytest.approx(ideal, abs=2e-6)
    assert off(run(DYNAMIC, {"encoder_bits": 10}, **changes)) > 1.5 * ideal


def test_errors_and_series_are_those_of_the_true_arm():
    result = run(sensing={"encoder_bits": 10})
    q, said = result.series["position"], result.series["position_measured"]
    step = 2.0 * np.pi / 2**10
    assert 0.4 * step < np.abs(q - said).max() <= 0.5 * step + 1e-12
    kinematics = result.experiment.arm.kinematics()
    p_WE = np.array([kinematics.p_WE(each) for each in q])
    np.testing.assert_array_equal(result.series["p_WE"], p_WE)
    error = np.linalg.norm(p_WE - result.series["p_WE_desired"], axis=1)
    assert off(result) == pytest.approx(error[result.time >= 3.0 - 1e-9].max(), rel=1e-12)


def test_a_delay_is_that_delay():
    """The measured joints are the true ones of 20 samples before."""
    result = run(sensing={"delay": 0.02})
    late = {name: result.series[f"{name}_measured"][20:] for name in ("position", "velocity")}
    for name, values in late.items():
        # Velocities of a step are there at its end; the first of them is that of standing still.
        np.testing.assert_allclose(values, result.series[name][:-20], atol=1e-14)


def test_noise_repeats_with_the_seed_and_differs_with_another():
    sensing, changes = {"position_noise": 1e-4}, {"duration": 0.5, "window": None}
    first, again, other = (run(sensing=sensing, seed=seed, **changes) for seed in (1, 1, 2))
    for key, values in first.series.items():
        np.testing.assert_array_equal(again.series[key], values)
    assert (first.series["position_measured"] != other.series["position_measured"]).all()


def test_the_law_sees_kinematics_of_what_was_measured():
    """Its demand is recomputed after the run from those; with true joints it would differ."""
    result = run(sensing={"encoder_bits": 10}, duration=0.5, window=None)
    law, x = result.experiment.law, result.series
    lower, upper = law.limits.velocity_box(x["position_measured"], law.limit_stiffness)
    np.testing.assert_array_equal(x["velocity_lower"], lower)
    np.testing.assert_array_equal(x["velocity_upper"], upper)


def learned(sensing, **changes):
    return run("slc_nephroid", sensing, period=1e-3, **{"dither.hold": 1e-3, **changes})


def test_a_law_that_learns_learns_from_measured_velocities():
    """Its J_hat is what its own rule makes of them, sample by sample; 1e-12: of rounding."""
    sensing = {"encoder_bits": 12, "secant_samples": 5}
    result = learned(sensing, duration=0.3, window=None)
    law, x = result.experiment.law, result.series
    kinematics = result.experiment.arm.kinematics()
    for k in range(0, 299, 7):
        v = x["velocity_measured"][k]
        v_WE = kinematics.J(x["position_measured"][k]) @ v
        expected = rank_one_update(x["J_hat"][k], v, v_WE, law.rho, 1e-3)
        np.testing.assert_allclose(x["J_hat"][k + 1], expected, atol=1e-12)


@pytest.mark.long
def test_coarse_encoders_excite_a_law_that_learns():
    """v_WE follows from the measured velocities, so their errors teach as noise does.

    A robot whose v_WE is measured by other means than its encoders has no such help.
    """
    own, coarse = (
        learned(sensing).metrics["jacobian_error_median"]
        for sensing in ({"encoder_bits": 12}, {"encoder_bits": 12, "secant_samples": 1})
    )
    assert coarse < 0.8 * own


def test_perfect_sight_from_outside_changes_nothing_to_the_last_bit():
    """Of a law that knows J and sees no v_WE: its p_WE is then that of the true joints anyhow."""
    changes = {"duration": 0.5, "window": None}
    joints, outside = run(sensing={}, **changes), run(sensing={"p_WE_noise": 0.0}, **changes)
    for key, values in joints.series.items():
        np.testing.assert_array_equal(outside.series[key], values)
    np.testing.assert_array_equal(outside.series["p_WE_measured"], outside.series["p_WE"])


@pytest.mark.long
def test_a_camera_sees_what_encoders_cannot():
    """Encoders of 10 bits cost a mm, but little where p_WE is measured: J alone is off then."""
    coarse = {"encoder_bits": 10}
    assert off(run(sensing={**coarse, "p_WE_noise": 0.0})) < 0.6 * off(run(sensing=coarse))


def test_an_arm_seen_with_noise_follows_worse_and_errors_are_those_of_the_true_one():
    """The law's feedback filters the noise: the arm shakes by less than what is measured."""
    result = run(sensing={"p_WE_noise": 1e-3})
    noise = result.series["p_WE_measured"] - result.series["p_WE"]
    assert noise.std() == pytest.approx(1e-3, rel=0.02)
    error = np.linalg.norm(result.series["p_WE"] - result.series["p_WE_desired"], axis=1)
    assert off(result) == pytest.approx(error[result.time >= 3.0 - 1e-9].max(), rel=1e-12)
    assert off(result) < 3e-3


def test_a_pose_is_as_late_as_the_joints():
    result = run(sensing={"delay": 0.02, "p_WE_noise": 0.0}, duration=0.5, window=None)
    x = result.series
    np.testing.assert_array_equal(x["p_WE_measured"][20:], x["p_WE"][:-20])
    np.testing.assert_allclose(x["position_measured"][20:], x["position"][:-20], atol=1e-14)


def test_an_orientation_is_measured_with_the_noise_asked_for():
    """Of the true orientation, computed here from the true joints; 3 %: of 1500 values."""
    sensing, changes = {"R_WE_noise": 1e-3}, {"duration": 0.5, "window": None}
    result = run(sensing=sensing, **changes)
    kinematics = result.experiment.arm.kinematics()
    R_WE = np.array([kinematics.R_WE(q) for q in result.series["position"]])
    noise = rotation_error(R_WE, result.series["R_WE_measured"])
    assert noise.std() == pytest.approx(1e-3, rel=0.05)
    np.testing.assert_array_equal(result.series["p_WE_measured"], result.series["p_WE"])


def test_noise_from_outside_repeats_with_the_seed_and_leaves_that_of_the_joints():
    changes = {"duration": 0.2, "window": None}
    sensing = {"position_noise": 1e-4, "p_WE_noise": 1e-4}
    first, again, other = (run(sensing=sensing, seed=seed, **changes) for seed in (1, 1, 2))
    for key, values in first.series.items():
        np.testing.assert_array_equal(again.series[key], values)
    assert (first.series["p_WE_measured"] != other.series["p_WE_measured"]).any()
    joints = run(sensing={"position_noise": 1e-4}, seed=1, **changes).series
    noise = [x["position_measured"] - x["position"] for x in (first.series, joints)]
    np.testing.assert_allclose(*noise, atol=1e-14)


def test_a_law_that_learns_learns_from_what_a_camera_sees():
    """Its J_hat is what its own rule makes of secants of joints and of the measured p_WE."""
    sensing = {"secant_samples": 5, "p_WE_noise": 1e-5}
    result = learned(sensing, duration=0.3, window=None)
    law, x = result.experiment.law, result.series
    step = (x["p_WE_measured"][5:] - x["p_WE_measured"][:-5]) / 5e-3
    np.testing.assert_allclose(x["v_WE_measured"][5:], step, atol=1e-12)
    for k in range(0, 299, 7):
        v, v_WE = x["velocity_measured"][k], x["v_WE_measured"][k]
        expected = rank_one_update(x["J_hat"][k], v, v_WE, law.rho, 1e-3)
        np.testing.assert_allclose(x["J_hat"][k + 1], expected, atol=1e-12)


@pytest.mark.long
def test_noise_of_a_camera_spoils_what_is_learned():
    """It is in v_WE alone; noise of joints would be in both sides of v_WE = J v.

    With 0.1 mm the arm is led astray: its J_hat is wrong by more than J is large.
    """
    clean, noisy = (
        learned({"secant_samples": 5, "p_WE_noise": noise}).metrics["jacobian_error_median"]
        for noise in (0.0, 1e-4)
    )
    assert clean < 0.2
    assert noisy > 1.0


def test_an_arm_with_mass_is_seen_from_outside_too():
    result = run(DYNAMIC, {"p_WE_noise": 1e-4}, duration=0.2, window=None)
    noise = result.series["p_WE_measured"] - result.series["p_WE"]
    assert noise.std() == pytest.approx(1e-4, rel=0.1)


def test_a_law_that_sees_v_WE_needs_secants():
    message = (
        "sensing.secant_samples: must be at least 1 with p_WE_noise or R_WE_noise, because "
        "SimultaneousLearning sees v_WE, which is a difference of measured positions then"
    )
    with pytest.raises(InvalidInputError) as caught:
        load_experiment("slc_nephroid", {"period": 1e-3, "sensing": {"p_WE_noise": 1e-5}})
    assert str(caught.value) == message


def test_with_sensors_no_law_is_said_to_keep_positions():
    ideal, sensed = (
        load_experiment("state_adjustment", {"integrator": None, "period": 1e-3, **more})
        for more in ({}, {"sensing": {"position_noise": 1e-3}})
    )
    assert "position" in ideal.guarantees.arm.limits
    assert set(sensed.guarantees.arm.limits) == set(ideal.guarantees.arm.limits) - {"position"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feedback": "commanded"}, "sensing: only with feedback: measured, not commanded"),
        (
            {"period": None, "integrator": {"accuracy": 1e-6}},
            "sensing: needs a sampled law; give a period instead of an integrator",
        ),
        ({"sensing.bits": 3}, "sensing.bits: no such key; nearest: encoder_bits"),
        (
            {"sensing.delay": 0.3},
            "law.kappa: must be below 3.333 /s with the sensing's delay of 0.3 s in its loop, ",
        ),
        (
            {"law.jacobian": "learned", "dither": {"model": "virtual", "sigma": 0.1, "hold": 1e-3}},
            "dither.model: must be actuated with feedback: measured",
        ),
    ],
)
def test_what_does_not_fit_is_refused(changes, message):
    with pytest.raises(InvalidInputError) as caught:
        load_experiment(KINEMATIC, {"sensing": {}, **changes})
    assert str(caught.value).startswith(message)
