"""The law around a zeroing network: what it commands, refuses and says before a run."""

import numpy as np
import pytest

from drake_rnn import (
    Circumstances,
    InvalidInputError,
    JointLimits,
    Zeroing,
    load_experiment,
    simulate,
)

N, H = 7, 1e-3
LIMITS = JointLimits.unlimited(N).replace(velocity=2.0)


def law(**fields):
    return Zeroing(**{"limits": LIMITS, "home": np.zeros(N), **fields})


def still(made, seed=0):
    """Signals that stay as they are, of the size of an arm's."""
    rng = np.random.default_rng(seed)
    return {name: 0.3 * rng.normal(size=s) for name, (_, s) in made.inputs.parts.items()}


def settled(made, u, count=60):
    reading = made.sampled(H)
    x = reading.initial_state(np.random.default_rng(0), u)
    for k in range(count):
        x = reading.step(k * H, x, u, H)
    return reading.state.by_name(x)


def document(**changes):
    law = {"kind": "zeroing", "gain": 200, **changes.pop("law", {})}
    circle = {"kind": "circle", "plane": "yz", "size": 0.05, "period": 4, "timing": "sin2"}
    base = {"name": "z", "arm": "panda", "path": {**circle, "laps": 1}, "period": 1e-3}
    return {**base, "duration": 4, **changes, "law": law}


@pytest.mark.parametrize("task_size", [2, 3])
def test_with_signals_that_stay_it_is_the_velocity_of_the_damped_pseudoinverse(task_size):
    """v = J^+ b - (I - J^+ J) k (q - q_0), to 1e-9, once v_dot and the rates are zero."""
    made = law(task_size=task_size, return_gain=0.7, feedback=4.0, gain=1e6, damping=1e-5)
    u = still(made)
    u["a_WE_desired"] = np.zeros(task_size)
    # What moves would move p_WE: it is held, so that b stays only if the feedback's rate is zero.
    b = u["v_WE_desired"] + 4.0 * (u["p_WE_desired"] - u["p_WE"])
    inverse = np.linalg.pinv(u["J"])
    pull = -0.7 * u["position"]
    wanted = inverse @ b + pull - inverse @ u["J"] @ pull
    v = settled(made, u)["v"]
    # The rates of feedback and pull, times the period: what moves in a sample.
    assert np.abs(v - wanted).max() < 5.0 * H * np.abs(wanted).max()
    still_made = law(task_size=task_size, return_gain=0.0, feedback=0.0, gain=1e6, damping=1e-5)
    v = settled(still_made, u)["v"]
    np.testing.assert_allclose(v, inverse @ u["v_WE_desired"], atol=1e-8)


def test_it_commands_the_mean_of_the_networks_velocities_at_both_ends_of_a_sample():
    made = law(gain=50.0)
    u, reading = still(made), made.sampled(H)
    x = reading.initial_state(np.random.default_rng(0), u)
    for k in range(3):
        before = reading.state.part(x, "optimum")
        x = reading.step(k * H, x, u, H)
        mean = 0.5 * (before + reading.state.part(x, "optimum"))
        np.testing.assert_allclose(reading.commanded_velocity(k * H, x), mean, rtol=1e-15)
    assert reading.diagnostics(0.0, x, u)["residual"] == reading.state.part(x, "residual_largest")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"discretization": "euler", "gain": 2000.0}, r"law\.gain: must be below 2000 /s at a p"),
        (
            {"discretization": "taylor", "gain": 1001.0},
            r"law\.gain: must be below 1000 /s",
        ),
        (
            {"discretization": "four_step", "integral_gain": 1e4},
            r"law\.integral_gain: must be below 1000 /s .*; or give discretization: implicit",
        ),
        (
            {"discretization": "euler", "gain": 999.0, "activation": "hyperbolic_sine"},
            None,
        ),
        (
            {"discretization": "euler", "gain": 1001.0, "activation": "hyperbolic_sine"},
            r"law\.gain: must be below 1000 /s .*hyperbolic_sine",
        ),
        ({"gain": 1e8, "integral_gain": 1e8}, None),
        ({"feedback": 1000.0}, r"period: must be below 0\.001 s with law\.feedback"),
        ({"return_gain": 1000.0}, r"period: must be below 0\.001 s with law\.return_gain"),
    ],
)
def test_a_gain_that_is_unstable_at_a_period_is_refused_with_what_to_give(fields, message):
    made = law(**fields)
    if message is None:
        made.sampled(H)
        return
    with pytest.raises(InvalidInputError, match=message):
        made.sampled(H)


def test_bounds_need_limits():
    with pytest.raises(InvalidInputError, match="bounds: velocity needs a velocity limit for ev"):
        law(limits=JointLimits.unlimited(N), bounds="velocity")
    with pytest.raises(InvalidInputError, match=r"limit_stiffness at 1000 /s"):
        law(bounds="velocity", limit_stiffness=1000.0).sampled(H)
    assert law(limit_stiffness=1000.0).sampled(H)


def test_a_gain_that_grows_says_until_when_its_sampling_is_stable():
    """gamma e^t h = 2 at t = ln(2 / (gamma h)) = ln 20 s."""
    seen = Circumstances(period=H, duration=4.0)
    grows = law(growth="exponential", discretization="euler")
    said = grows.doubts(seen)
    assert said[0].startswith("law.growth: from 3 s on the gain exceeds 2e+03 /s")
    assert "implicit" in said[0]
    assert grows.doubts(seen._replace(duration=2.9)) == []
    assert law(growth="exponential").doubts(seen) == []
    assert grows.doubts(Circumstances()) == []
    with pytest.raises(InvalidInputError, match=r"law\.growth: exponential .* after 575\.646 s"):
        law(growth="exponential").doubts(seen._replace(duration=600.0))


def test_a_gain_of_e_to_the_t_does_not_survive_sampling_once_gain_times_period_exceeds_two():
    """From ln 2 = 0.69 s on; before, and in implicit steps, it tracks to a micrometre."""
    left = {}
    for form, until in (("euler", 0.65), ("euler", 0.95), ("implicit", 0.95)):
        gains = {"gain": 1000, "growth": "exponential", "discretization": form}
        found = simulate(load_experiment(document(law=gains, duration=until))).metrics
        left[form, until] = found["position_error_max_m"]
    assert left["euler", 0.65] < 1e-6
    assert left["implicit", 0.95] < 1e-6
    assert left["euler", 0.95] > 1e-2


@pytest.mark.parametrize(
    ("arm", "task"),
    [("panda", "xyz"), ("iiwa14", "pose"), ("ur5", "xyz"), ("ur5", "pose"), ("planar6", "xy")],
)
def test_it_follows_paths_on_every_arm(arm, task):
    plane = "xy" if task == "xy" else "yz"
    circle = {"kind": "circle", "plane": plane, "size": 0.05, "period": 2, "timing": "sin2"}
    contents = document(arm=arm, task=task, path={**circle, "laps": 1}, duration=0.5)
    found = simulate(load_experiment(contents)).metrics
    assert found["position_error_max_m"] < 2e-6
    assert found.get("orientation_error_max_rad", 0.0) < 2e-6


@pytest.mark.long
def test_the_box_behind_it_keeps_bounds_that_the_network_alone_breaks():
    """Where the path needs more than 0.15 rad/s allow; 1e-9."""
    limits = {"velocity": 0.15, "acceleration": 5.0}
    broken, kept = (
        simulate(
            load_experiment(document(law={"bounds": "velocity"}, limits=limits, safety=safety))
        ).metrics
        for safety in (None, {"bounds": True})
    )
    assert broken["velocity_violation_max_rad_s"] > 1e-3
    for name in ("position_violation_max_rad", "velocity_violation_max_rad_s"):
        assert kept[name] <= 1e-9
    assert kept["acceleration_violation_max_rad_s2"] <= 1e-9
    assert kept["end_effector_drift_end_m"] < 1e-6


@pytest.mark.long
@pytest.mark.parametrize(("form", "fold"), [("implicit", 4.0), ("euler", 4.0), ("four_step", 8.0)])
def test_along_a_path_halving_the_period_divides_the_residual_by_four_or_eight(form, fold):
    """At gain times period 0.3; the position's error by four, for a velocity is held."""
    residuals, errors = [], []
    for period in (8e-3, 4e-3, 2e-3, 1e-3):
        gains = {"gain": 0.3 / period, "discretization": form, "damping": 1e-6}
        contents = document(law=gains, period=period, window=[0.5, 4.0])
        result = simulate(load_experiment(contents))
        residuals.append(result.series["residual"][result.time > 0.5].max())
        errors.append(result.metrics["position_error_max_m"])
    np.testing.assert_allclose(np.array(residuals[:-1]) / residuals[1:], fold, rtol=0.05)
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.15)


@pytest.mark.long
@pytest.mark.parametrize("arm", ["panda", "iiwa14", "ur5"])
def test_it_moves_arms_with_motors(arm):
    contents = document(arm=arm, level="dynamic", feedback="commanded", duration=2.0)
    assert simulate(load_experiment(contents)).metrics["position_error_max_m"] < 1e-3


def test_in_a_singular_posture_it_stays_finite():
    made = law(gain=1e4)
    u = {**still(made), "J": np.zeros((3, N))}
    found = settled(made, u)
    np.testing.assert_allclose(found["v"], -u["position"], atol=1e-2)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_a_learned_jacobian_brings_it_to_its_path(seed):
    """From a random estimate 0.1 m off; to 0.1 mm, a third of which is measured on the lap."""
    changes = {"seed": seed, "duration": 4, "window": [2, 4], "accept": None}
    found = simulate(load_experiment("zeroing_learned", changes)).metrics
    assert found["settling_time_s"] < 1.5
    assert found["position_error_max_m"] < 3e-4
