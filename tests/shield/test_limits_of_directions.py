"""Bounds that differ for the two directions, behind a shield and in an experiment."""

import numpy as np
import pytest
from test_shield import BALL_IN_THE_WAY, HELD, HOME, PANDA, PERIOD, motion, storm, to

from drake_rnn import InvalidInputError, Shield, ShieldSettings, load_experiment, simulate

LIMITS = PANDA.limits.replace(
    velocity=1.0, velocity_lower=-0.3, acceleration=2.0, acceleration_lower=-6.0, jerk=100.0
)


def beyond(limits, q, v):
    """Return the largest shares of the bounds of a motion in each direction."""
    a = np.diff(v, axis=0) / PERIOD
    shares = [1.0 + limits.violation(q).max()]
    for name, values in (("velocity", v), ("acceleration", a)):
        shares += [
            (values / limits.sides(name).up).max(),
            (-values / limits.sides(name).down).max(),
        ]
    if limits.jerk is not None:
        shares.append(np.abs(np.diff(a, axis=0) / PERIOD / limits.jerk).max())
    return np.array(shares)


@pytest.mark.parametrize(
    ("kind", "jerk"),
    [
        ("positions", 100.0),
        pytest.param("velocities", None, marks=pytest.mark.long),
        pytest.param("twists", 100.0, marks=pytest.mark.long),
        pytest.param("poses", None, marks=pytest.mark.long),
    ],
)
def test_whatever_a_source_sends_each_direction_has_its_bound(kind, jerk):
    limits = LIMITS.replace(jerk=jerk)
    shield = Shield(PANDA, PERIOD, limits=limits, obstacles=[BALL_IN_THE_WAY])
    q, v = motion(shield, 1.5, storm(np.random.default_rng(3), kind))
    shares = beyond(limits, q, v)
    assert shares.max() <= 1.0 + HELD
    assert shield.clearance.least_along(q).min() >= 0.005
    assert shield.uncertified == 0
    if kind == "positions":
        assert shares[1] > 0.5
        np.testing.assert_allclose(shares[2:5], 1.0, rtol=1e-6)


def test_a_stop_brakes_with_the_bound_against_its_motion():
    """Downwards it may lose 2 rad/s^2 of its speed, upwards 6."""
    for sign, most in ((1.0, 6.0), (-1.0, 2.0)):
        shield = Shield(PANDA, PERIOD, limits=LIMITS, collisions=False)
        motion(shield, 0.6, to(HOME + sign * np.eye(7)[0]))
        assert shield.newest.most[0] == most
        rows = [shield.newest.stop(k) for k in range(400)]
        q, v = (np.array([getattr(row, name) for row in rows]) for name in ("position", "velocity"))
        assert beyond(LIMITS, q, v).max() <= 1.0 + HELD
        assert np.abs(v[-1]).max() == 0.0
        assert np.abs(np.diff(v[:, 0]) / PERIOD).max() == pytest.approx(most)


@pytest.mark.long
def test_steps_in_c_are_those_of_numpy():
    settings = ShieldSettings(record=True, compiled=True)
    around = {"limits": LIMITS, "obstacles": [BALL_IN_THE_WAY]}
    shield = Shield(PANDA, PERIOD, settings, **around)
    q, v = motion(shield, 1.0, storm(np.random.default_rng(3), "positions"))
    assert beyond(LIMITS, q, v).max() <= 1.0 + HELD
    for sample in list(shield._samples)[::10]:
        step = sample.step
        after = step.reading.step(0.0, step.x, step.u, PERIOD)
        v_numpy = step.reading.state.part(after, "v")
        np.testing.assert_allclose(step.v, v_numpy, rtol=0, atol=1e-9)


DIRECTED = {
    "duration": 1.0,
    "window": None,
    "limits.velocity": 0.4,
    "limits.velocity_lower": -0.1,
    "limits.acceleration": 3.0,
    "limits.acceleration_lower": -1.0,
}


def test_an_experiment_is_judged_by_the_bound_of_each_direction():
    result = simulate(load_experiment("adaptive_nephroid_known", DIRECTED))
    v, limits = result.series["velocity"], result.experiment.limits
    share = np.abs(v / limits.toward("velocity", v)).max()
    assert result.metrics["limit_ratio_1_max"] == pytest.approx(share)
    assert 0.9 < share <= 1.0 + HELD
    assert np.abs(v).max() < 0.4
    assert result.metrics["limit_ratio_2_max"] <= 1.0 + HELD


@pytest.mark.parametrize(
    ("name", "changes", "what"),
    [
        ("pinv_circle", {}, "the law Pseudoinverse"),
        (
            "adaptive_nephroid_known",
            {"filter": {"kind": "moving_average"}},
            "filter: moving_average",
        ),
    ],
)
def test_what_has_one_bound_refuses_two(name, changes, what):
    with pytest.raises(
        InvalidInputError, match=f"limits.velocity_lower: must be left out for {what}"
    ):
        simulate(load_experiment(name, DIRECTED | changes))
