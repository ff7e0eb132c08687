"""The baseline without a network: what it asks for, and what its feed-forward is worth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drake_rnn import InvalidInputError, JointLimits, Pseudoinverse, load_experiment, simulate

N, H = 7, 1e-3


def make(**fields):
    return Pseudoinverse(**{"limits": JointLimits.unlimited(N), **fields})


def signals(seed=0, m=3):
    rng = np.random.default_rng(seed)
    names = ("p_WE", "p_WE_desired", "p_preview")
    return {"J": rng.standard_normal((m, N)), **{n: 0.1 * rng.standard_normal(m) for n in names}}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"feedback": -1.0}, "feedback: must be greater than or equal to 0, not -1.0"),
        ({"damping": 0.0}, "damping: must be greater than 0, not 0.0"),
        ({"task_size": 7}, "task_size: must be 1, 2, 3, 4, 5 or 6, not 7"),
        ({"feed_forward": 2}, "feed_forward: "),
    ],
)
def test_what_it_cannot_be_is_refused(fields, message):
    with pytest.raises(InvalidInputError) as caught:
        make(**fields)
    assert message in str(caught.value)


def test_a_period_for_which_the_feedback_overshoots_is_refused():
    for feedback, period in ((10.0, 0.09), (0.0, 10.0)):
        law = make(feedback=feedback)
        assert law.sampled(period) is law
    with pytest.raises(InvalidInputError, match=r"period: must be below 0\.1 s .* not 0\.1"):
        make(feedback=10.0).sampled(0.1)


@pytest.mark.parametrize("m", [2, 3])
def test_it_is_the_shortest_velocity_that_does_what_is_asked(m):
    """1e-9: what the damping of 1e-6 m leaves of it, J being of size 1."""
    law, u = make(task_size=m, feedback=4.0), signals(m=m)
    v = law.step(0.0, law.initial_state(np.random.default_rng(0), u), u, H)
    asked = (u["p_preview"] - u["p_WE_desired"]) / H + 4.0 * (u["p_WE_desired"] - u["p_WE"])
    np.testing.assert_allclose(v, np.linalg.pinv(u["J"]) @ asked, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(law.commanded_velocity(0.0, v), v)
    assert law.diagnostics(0.0, v, u) == {}


def test_of_a_pose_it_turns_as_is_asked_too():
    """The rotation rows come first; rotation vectors by SciPy, 1e-9 for the damping."""
    now, wanted, later = Rotation.random(3, rng=1)
    u = signals()
    u["J"] = np.random.default_rng(2).standard_normal((6, N))
    u["R_WE"], u["R_WE_desired"], u["R_preview"] = (R.as_matrix() for R in (now, wanted, later))
    law = make(task_size=6, feedback=4.0)
    assert law.inputs.parts.keys() == u.keys()
    turn = (later * wanted.inv()).as_rotvec() / H + 4.0 * (wanted * now.inv()).as_rotvec()
    move = (u["p_preview"] - u["p_WE_desired"]) / H + 4.0 * (u["p_WE_desired"] - u["p_WE"])
    v = law.step(0.0, np.zeros(N), u, H)
    asked = np.concatenate((turn, move))
    np.testing.assert_allclose(v, np.linalg.pinv(u["J"]) @ asked, rtol=1e-9, atol=1e-9)
    held = make(task_size=6, feedback=4.0, feed_forward=False)
    assert held.inputs.parts.keys() == u.keys() - {"p_preview", "R_preview"}
    turn, move = 4.0 * (wanted * now.inv()).as_rotvec(), 4.0 * (u["p_WE_desired"] - u["p_WE"])
    v = held.step(0.0, np.zeros(N), u, H)
    np.testing.assert_allclose(u["J"] @ v, np.concatenate((turn, move)), rtol=1e-9, atol=1e-9)


def test_without_feed_forward_it_does_not_look_ahead():
    law, u = make(feed_forward=False), signals()
    assert "p_preview" not in law.inputs
    assert "p_preview" in make().inputs
    v = law.step(0.0, np.zeros(N), {name: u[name] for name in law.inputs.parts}, H)
    np.testing.assert_allclose(u["J"] @ v, 10.0 * (u["p_WE_desired"] - u["p_WE"]), rtol=1e-9)


def test_in_a_singular_posture_it_stays_finite():
    u = {**signals(), "J": np.zeros((3, N))}
    np.testing.assert_array_equal(make().step(0.0, np.zeros(N), u, H), 0.0)


def test_feed_forward_takes_away_the_lag():
    """Without it the error is speed / feedback = 3.1 mm; with it 1e-7 m, of the held command.

    The secant meets the path's points but for what J turns within a sample: of second order in the
    period, of which the feedback lets 1 / (feedback period) samples' worth add up.
    """
    error = {}
    for name, changes in {
        "none": {"law.feed_forward": False},
        "secant": {},
        "slower": {"period": 2e-3},
    }.items():
        short = {"duration": 3.0, "accept": None, **changes}
        found = simulate(load_experiment("pinv_circle", short)).metrics
        error[name] = found["position_error_max_m"]
    assert error["none"] == pytest.approx(0.15 * 2 * np.pi / 30 / 10, rel=0.01)
    assert 1e-8 < error["secant"] < 1.5e-7
    assert error["slower"] == pytest.approx(2 * error["secant"], rel=0.1)


def test_a_delay_limits_the_gain_of_its_position_feedback():
    assert make(feedback=3.0).loop_gains == {"feedback": 3.0}
