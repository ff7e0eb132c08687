"""RNN (16), (19), (20) as functions of arrays, and what holds of the paper's Theorem 2."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drake_rnn import Circumstances, InvalidInputError, JointLimits, SimultaneousLearning

LIMITS = JointLimits(
    position_lower=-np.full(7, 2.0),
    position_upper=np.full(7, 2.0),
    velocity=np.full(7, 0.5),
    acceleration=np.array([1.2, 1.6, 1.4, 1.4, 1.5, 1.8, 1.0]),
)
RNG = np.random.default_rng(0)
# As large as an arm's of a metre: Euler's method needs rate * step * |J|^2 below 1.
J = 0.3 * RNG.normal(size=(3, 7))
Q = RNG.uniform(-0.5, 0.5, size=7)


def law(**gains):
    return SimultaneousLearning(**{"limits": LIMITS, "home": np.zeros(7), **gains})


def signals(speed=0.05, **others):
    return {
        "position": Q,
        "p_WE": np.zeros(3),
        "p_WE_desired": np.zeros(3),
        "v_WE_desired": np.full(3, speed),
        "J": J,
        **others,
    }


def settle(network, u, time, step=1e-3):
    """The state after a long time with everything it sees held."""
    x = network.initial_state(np.random.default_rng(0), u)
    for _ in range(round(time / step)):
        x = x + step * network.derivatives(0.0, x, u)
    return network.state.split(x)


def test_at_rest_it_is_where_the_quadratic_program_is():
    """Theorem 2: unbounded, v = J^+ b + (I - J^+ J)(-pull), the program's closed form."""
    fast = LIMITS.replace(velocity=10.0)
    network = law(jacobian="known", rate=200.0, acceleration_bound="none", limits=fast)
    u = signals()
    v, _ = settle(network, u, time=5.0)
    inverse = np.linalg.pinv(J)
    expected = inverse @ u["v_WE_desired"] - (np.eye(7) - inverse @ J) @ Q
    np.testing.assert_allclose(v, expected, atol=1e-9)


def test_at_rest_on_a_bound_it_meets_the_optimality_conditions():
    """With bounds active: J v = b, and v is the projection of J^T multipliers - pull."""
    network = law(jacobian="known", rate=200.0, acceleration_bound="none", return_gain=2.0)
    u = signals(speed=0.1)
    v, multipliers = settle(network, u, time=20.0)
    lower, upper = LIMITS.velocity_box(Q, network.limit_stiffness)
    np.testing.assert_allclose(J @ v, u["v_WE_desired"], atol=1e-8)
    np.testing.assert_allclose(v, np.clip(multipliers @ J - 2.0 * Q, lower, upper), atol=1e-8)
    assert np.isclose(np.abs(v), 0.5).any(), "the case is meant to have an active bound"


states = arrays(float, 10, elements=st.floats(-5, 5))


@given(states)
def test_the_acceleration_bound_holds_at_every_state_and_breaks_without_it(x):
    """Largest entry over the smallest bound, as the paper's scalar c_max."""
    u = signals()
    bounded = law(jacobian="known").derivatives(0.0, x, u)
    free = law(jacobian="known", acceleration_bound="none").derivatives(0.0, x, u)
    assert np.abs(bounded[:7]).max() <= 1.0 + 1e-12
    if np.abs(free[:7]).max() > 1.0:
        assert np.abs(bounded[:7]).max() == pytest.approx(1.0)


@given(states)
def test_each_joint_keeps_its_own_bound(x):
    rates = law(jacobian="known", acceleration_bound="per_joint").derivatives(0.0, x, signals())
    assert (np.abs(rates[:7]) <= LIMITS.acceleration * (1 + 1e-12)).all()


@given(states)
def test_slowing_down_changes_no_direction(x):
    """v and the multipliers share one eta; slowing only one of them winds up the other."""
    u = signals()
    slow = law(jacobian="known", position_bound="printed").derivatives(0.0, x, u)
    free = law(jacobian="known", acceleration_bound="none").derivatives(0.0, x, u)
    scale = np.linalg.norm(slow) / max(np.linalg.norm(free), 1e-300)
    np.testing.assert_allclose(slow, scale * free, atol=1e-9 * np.abs(free).max())


@given(states, arrays(float, 3, elements=st.floats(-0.5, 0.5)))
def test_the_feedback_never_asks_for_more_than_its_limit(x, error):
    """Seen through the multipliers' rate, which is rate (b - J v)."""
    network = law(jacobian="known", feedback_limit=0.1, kappa=15.0, acceleration_bound="none")
    u = signals(speed=0.0, p_WE=error)
    v, _ = network.state.split(x)
    _, rates = network.state.split(network.derivatives(0.0, x, u))
    asked = rates / network.rate + J @ v
    assert np.linalg.norm(asked) <= 0.1 + 1e-9
    if np.linalg.norm(15.0 * error) <= 0.1:
        np.testing.assert_allclose(asked, -15.0 * error, atol=1e-9)


many_states = RNG.uniform(-1.0, 1.0, size=(20, 10))


def told(network, x, u):
    """What the law tells of itself at many states, while all that it sees stands still."""
    held = {name: np.broadcast_to(value, (len(x), *value.shape)) for name, value in u.items()}
    return network.diagnostics(np.zeros(len(x)), x, held)


@pytest.mark.parametrize("jacobian", ["known", "learned"])
def test_where_nothing_bounds_it_an_arm_accelerates_as_the_law_says_it_demands(jacobian):
    """Pulled by its task and towards a home on the other side of where it is."""
    network = law(jacobian=jacobian, acceleration_bound="none", return_gain=2.0, home=-2.0 * Q)
    u = signals(velocity=np.zeros(7), v_WE=np.zeros(3))
    x = many_states
    if jacobian == "learned":
        x = np.hstack((x, RNG.uniform(-0.3, 0.3, size=(20, 21))))
    found = told(network, x, u)
    for state, demand in zip(x, found["acceleration_demand"], strict=True):
        v_dot = network.state.part(network.derivatives(0.0, state, u), "v")
        np.testing.assert_allclose(demand, v_dot, rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(found["saturated"], np.zeros((20, 1)))


@pytest.mark.parametrize("bound", ["scalar", "per_joint"])
def test_it_says_that_it_is_saturated_just_where_it_accelerates_less_than_it_demands(bound):
    """At states from near rest, where nothing is asked for, to far from it."""
    network = law(jacobian="known", acceleration_bound=bound, position_bound="printed")
    u = signals(speed=0.0, position=np.zeros(7))
    x = many_states * np.logspace(-5, 0, 20)[:, np.newaxis]
    found = told(network, x, u)
    less = []
    for state, demand in zip(x, found["acceleration_demand"], strict=True):
        v_dot = network.state.part(network.derivatives(0.0, state, u), "v")
        less.append(not np.allclose(v_dot, demand, rtol=1e-9, atol=0))
    np.testing.assert_array_equal(found["saturated"][:, 0], less)
    assert 3 < sum(less) < 17


@pytest.mark.parametrize("jacobian", ["known", "learned"])
def test_a_sample_approaches_the_differential_equation(jacobian):
    """Both readings are one algebra: the step's rate tends to the derivative, at first order."""
    network = law(jacobian=jacobian, rho=1e-2)
    v, v_WE = RNG.uniform(-0.2, 0.2, 7), RNG.uniform(-0.2, 0.2, 3)
    u = signals(velocity=v, v_WE=v_WE)
    x = RNG.uniform(-0.2, 0.2, network.state.size)
    derivative = network.derivatives(0.0, x, u)
    errors = [np.abs((network.step(0.0, x, u, h) - x) / h - derivative).max() for h in (1e-5, 5e-6)]
    assert errors[1] < 0.51 * errors[0] + 1e-6


def test_substeps_keep_a_long_period_stable():
    """Euler's method needs rate times step below 2; four milliseconds would be twice that."""
    u = signals()
    x = law().state.join(np.full(7, 0.1), np.zeros(3), J)
    network = law(jacobian="known", acceleration_bound="none")
    for _ in range(500):
        x = network.step(0.0, x[:10], u, 4e-3)
    assert np.abs(x).max() < 10
    unstable = law(jacobian="known", acceleration_bound="none", multiplier_limit="none", substeps=1)
    for _ in range(500):
        x = unstable.step(0.0, x[:10], u, 4e-3)
    assert np.abs(x).max() > 1e3


@pytest.mark.parametrize(("rate", "period"), [(1e6, 0.02), (1e9, 1e-3)])
def test_a_network_too_fast_for_its_samples_is_refused(rate, period):
    """Its Euler steps are at most 1 / rate long, and a sample may take 10 000 of them."""
    with pytest.raises(InvalidInputError, match=r"^law\.rate: .* substeps per period"):
        law(rate=rate).sampled(period)
    law(rate=rate).sampled(1e4 / rate)


@pytest.mark.parametrize(("rate", "period", "fewest"), [(1000.0, 4e-3, 4), (50.0, 0.1, 5)])
def test_substeps_too_few_for_the_velocity_limits_are_refused(rate, period, fewest):
    """A step longer than 1 / rate takes v beyond the velocity that it tends to."""
    law(rate=rate, substeps=fewest).sampled(period)
    with pytest.raises(InvalidInputError, match=f"must be at least {fewest} "):
        law(rate=rate, substeps=fewest - 1).sampled(period)


boxes = arrays(float, 7, elements=st.floats(0.01, 1.0))
points = arrays(float, 7, elements=st.floats(-3, 3))
shares = arrays(float, 7, elements=st.floats(-1, 1))


class TestLemma1:
    """Projection P onto a box, as the law clips: what holds of the lemma, and what does not."""

    @given(points, boxes, shares)
    def test_the_inequality_holds(self, m, upper, share):
        """(m - P(m))^T (P(m) - w) >= 0 for every w in the box; and (24), which is stronger."""
        P_m, w = np.clip(m, -upper, upper), share * upper
        assert (m - P_m) @ (P_m - w) >= 0.0
        assert (m - P_m) @ (m - w) >= (1 - 1e-12) * (m - P_m) @ (m - P_m)

    def test_it_is_an_equality_outside_of_the_set_too(self):
        """Against the lemma's last clause: at w = P(m), and at any w of the same face."""
        m, upper = np.array([2.0, 0.0, 0.0]), np.ones(3)
        P_m = np.clip(m, -upper, upper)
        assert (P_m != m).any()
        for w in (P_m, np.array([1.0, 0.7, -0.3])):
            assert (m - P_m) @ (P_m - w) == 0.0


def test_its_network_never_comes_to_rest_while_the_path_it_is_to_join_is_too_far():
    """Against Theorem 2's convergence: the proof holds the posture still, and here it moves.

    One joint that slides, 1 m/s^2 and kappa 15, from 0.1 m off. With the speed of the feedback
    bounded it comes to rest; without, the loop is never settled in 20 s, though it has no path to
    follow. Steps of 1 ms.
    """
    limits = JointLimits(
        position_lower=[-10.0], position_upper=[10.0], velocity=[0.5], acceleration=[1.0]
    )
    still = {"p_WE_desired": np.zeros(2), "v_WE_desired": np.zeros(2)}
    arm = np.array([[1.0], [0.0]])

    def late_errors(**gains):
        network = SimultaneousLearning(
            limits=limits, home=np.zeros(1), task_size=2, jacobian="known", return_gain=0.0, **gains
        )
        x, q, errors = np.zeros(3), 0.1, []
        for _ in range(20_000):
            u = {"position": np.array([q]), "p_WE": np.array([q, 0.0]), "J": arm, **still}
            x = network.step(0.0, x, u, 1e-3)
            q += 1e-3 * x[0]
            errors.append(abs(q))
        return errors[-5_000:]

    assert max(late_errors(kappa=15.0, feedback_limit=0.1)) < 1e-3
    assert max(late_errors(kappa=15.0)) > 0.05


def test_it_sees_the_jacobian_only_if_it_is_known():
    assert "J" in law(jacobian="known").inputs
    assert "J" not in law(jacobian="learned").inputs
    assert not {"velocity", "v_WE"} & set(law(jacobian="known").inputs.parts)


@pytest.mark.parametrize(
    ("start", "value"), [("zero", np.zeros((3, 7))), ("exact", J), ("uniform", None)]
)
def test_the_learned_jacobian_starts_as_asked(start, value):
    network = law(J_hat_initial=start)
    x = network.initial_state(np.random.default_rng(3), signals())
    J_hat = network.state.part(x, "J_hat")
    if value is None:
        assert ((J_hat >= 0) & (J_hat <= 1)).all()
        again = network.initial_state(np.random.default_rng(3), signals())
        np.testing.assert_array_equal(x, again)
    else:
        np.testing.assert_array_equal(J_hat, value)
    np.testing.assert_array_equal(x[:10], 0.0)


def test_a_blind_law_says_that_it_cannot_start_exactly():
    u = {name: value for name, value in signals().items() if name != "J"}
    with pytest.raises(InvalidInputError, match="J_hat_initial: exact needs the arm's J"):
        law(J_hat_initial="exact").initial_state(np.random.default_rng(0), u)


def test_an_acceleration_bound_needs_one():
    limits = JointLimits.unlimited(7)
    with pytest.raises(InvalidInputError, match=r"limits\.acceleration"):
        law(limits=limits)
    law(limits=limits, acceleration_bound="none")


@pytest.mark.parametrize(
    "gains",
    [{"kappa": 0}, {"rate": -1}, {"rho": float("nan")}, {"substeps": 0}, {"home": np.zeros(6)}],
)
def test_bad_gains_are_refused(gains):
    with pytest.raises(InvalidInputError):
        law(**gains)


def test_a_law_never_changes():
    with pytest.raises(AttributeError):
        law().kappa = 3.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("fields", "delay", "reference_is_delayed", "doubted"),
    [
        ({}, 0.1, False, True),
        ({"acceleration_bound": "per_joint"}, 0.1, False, True),
        ({"acceleration_bound": "none"}, 0.1, False, False),
        ({}, 0.1, True, False),
        ({}, 0.0, False, False),
    ],
)
def test_its_bound_beside_a_filter_in_its_loop_is_doubted(
    fields, delay, reference_is_delayed, doubted
):
    said = law(**fields).doubts(Circumstances(delay, reference_is_delayed))
    assert len(said) == doubted
    assert all(sentence.startswith("law.acceleration_bound: ") for sentence in said)


def test_a_delay_limits_the_gain_of_its_position_feedback():
    assert law(kappa=3.0).loop_gains == {"kappa": 3.0}
