"""The null-space law as plain arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, JointLimits, NullSpaceAdjustment
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.laws.state_adjustment import smooth_rise

N = 7
LIMITS = JointLimits(
    position_lower=np.full(N, -3.0), position_upper=np.full(N, 3.0), velocity=np.full(N, 1.5)
)


def make(**fields):
    return NullSpaceAdjustment(**{"target": np.zeros(N), "limits": LIMITS, **fields})


def step(law, q, J, error=None, t=10.0):
    error = np.zeros(3) if error is None else error
    u = {"position": q, "J": J, "p_WE": np.zeros(3), "p_WE_desired": error}
    return law.step(t, np.zeros(N), u, 1e-3)


def jacobian(seed, size=0.5):
    return size * np.linalg.qr(np.random.default_rng(seed).standard_normal((N, 3)))[0].T


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"rate": 0.0}, "rate: must be greater than 0"),
        ({"ramp_time": 0.0}, "ramp_time: must be greater than 0"),
        ({"feedback": -1.0}, "feedback: must be greater than or equal to 0"),
        ({"damping": 0.0}, "damping: must be greater than 0"),
        ({"target": np.zeros(8)}, "target: must have 7 entries"),
        ({"target": np.full(N, 4.0)}, "target: joint 1 is at 4 rad; it may be -3 to 3"),
    ],
)
def test_what_it_cannot_be_is_refused(fields, message):
    with pytest.raises(InvalidInputError) as caught:
        make(**fields)
    assert message in str(caught.value)


def test_the_pull_moves_the_joints_and_not_the_end_effector():
    J, q = jacobian(0), np.full(N, 0.1)
    v = step(make(), q, J)
    pull = 4.0 * -q
    np.testing.assert_allclose(v, pull - np.linalg.pinv(J) @ J @ pull, atol=1e-5)
    assert np.abs(J @ v).max() < 1e-6


def test_a_displacement_is_fed_back():
    J, error = jacobian(1), np.array([1e-3, -2e-3, 5e-4])
    v = step(make(), np.zeros(N), J, error)
    np.testing.assert_allclose(J @ v, 50 * error, rtol=1e-4)


def test_it_starts_from_rest():
    assert np.abs(step(make(), np.ones(N), jacobian(2), t=0.0)).max() == 0.0


@given(
    q=st.lists(st.floats(-3.1, 3.1), min_size=N, max_size=N).map(np.array),
    target=st.lists(st.floats(-3, 3), min_size=N, max_size=N).map(np.array),
    error=st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3).map(np.array),
    seed=st.integers(0, 1000),
    size=st.sampled_from([1e-3, 0.5, 3.0]),
    t=st.floats(0, 2),
)
def test_every_bound_holds_whatever_is_asked(q, target, error, seed, size, t):
    """Rounding only; near-singular J, postures outside of their limits and all."""
    law = make(target=target)
    v = step(law, q, jacobian(seed, size), error, t)
    lower, upper = law.velocity_box(t, q)
    assert (v >= lower - 1e-12).all()
    assert (v <= upper + 1e-12).all()


def test_a_joint_at_its_limit_is_held_and_the_others_go_on():
    """Scaling all joints down until that one rests would stop the arm for good."""
    J, q = jacobian(3), np.full(N, 0.5)
    q[2] = 3.0
    # A target for the others that the end effector can only stay for if this one goes on.
    coupling = (np.linalg.pinv(J) @ J)[2]
    pull = np.where(np.arange(N) == 2, 0.0, -0.3 * np.sign(coupling))
    assert pull[2] - coupling @ pull > 0.1
    v = step(make(target=q + pull), q, J, np.zeros(3))
    assert v[2] <= 0.0
    assert np.abs(np.delete(v, 2)).max() > 0.5
    assert np.abs(J @ v).max() < 1e-5


def test_at_a_singular_posture_its_velocities_stay_small():
    J = jacobian(4)
    J[2] = J[1]
    v = step(make(limits=LIMITS.replace(velocity=np.inf)), np.zeros(N), J, np.array([0, 0, 1e-3]))
    assert np.abs(v).max() < 1.0


def test_feedback_limits_the_period():
    law = make(feedback=50.0)
    assert law.sampled(0.019) is law
    with pytest.raises(InvalidInputError, match=r"below 0.02 s with law.feedback at 50 /s"):
        law.sampled(0.02)


def test_so_do_its_rate_and_the_stiffness_of_its_limits():
    with pytest.raises(InvalidInputError, match=r"below 0.05 s with law.limit_stiffness"):
        make(feedback=0.0).sampled(0.05)
    with pytest.raises(InvalidInputError, match=r"below 0.001 s with law.rate at 1000 /s"):
        make(rate=1000.0).sampled(0.01)


@pytest.mark.parametrize("name", ["position", "J", "p_WE"])
def test_what_is_not_finite_comes_back_as_such(name):
    """It is for the controller to say so; no loop may wait for it."""
    u = {"position": np.zeros(N), "J": jacobian(0), "p_WE": np.zeros(3)}
    u["p_WE_desired"] = np.zeros(3)
    u[name] = np.full(u[name].shape, np.nan)
    step = without_checks(make().step)
    assert not np.isfinite(step(1.0, np.zeros(N), u, 1e-3)).all()


def test_outside_its_limits_a_joint_is_brought_back_as_the_pull_sets_in():
    law, q = make(ramp_time=1.0), np.zeros(N)
    q[0] = 3.05
    for t in (0.0, 0.3, 0.7, 1.0):
        v = step(law, q, jacobian(5), t=t)
        assert v[0] <= -smooth_rise(t, 1.0) * 20 * 0.05 + 1e-12
    assert step(law, q, jacobian(5), t=0.0)[0] == 0.0


@pytest.mark.parametrize("t", [0.0, 0.3, 10.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_only_joints_outside_their_limits_wait_for_the_pull(t, side):
    """Inside, and where a joint outside may go anyway, the box is that of the limits at once."""
    law, q = make(ramp_time=1.0), side * np.array([3.5, 3.0, 2.9, 0.0, -1.0, -2.9, 2.0])
    box = np.array(law.velocity_box(t, q))
    whole = np.array(LIMITS.velocity_box(q, law.limit_stiffness))
    back = 1 if side > 0 else 0
    assert box[back, 0] == pytest.approx(smooth_rise(t, 1.0) * whole[back, 0], abs=1e-15)
    assert abs(whole[back, 0]) == 1.5
    box[back, 0] = whole[back, 0]
    np.testing.assert_array_equal(box, whole)


def test_diagnostics_of_many_instants_are_those_of_each():
    rng = np.random.default_rng(6)
    law = make(target=rng.uniform(-2, 2, N))
    t, x = np.linspace(0, 2, 5), rng.standard_normal((5, N))
    q = rng.uniform(-3.1, 3.1, (5, N))
    together = law.diagnostics(t, x, {"position": q})
    for k in range(5):
        alone = law.diagnostics(t[k], x[k], {"position": q[k]})
        assert alone.keys() == together.keys() == law.observables.parts.keys()
        for name, value in alone.items():
            assert value.shape == law.observables.parts[name][1]
            np.testing.assert_array_equal(together[name][k], value)
