"""Log barriers that hold velocities within bounds and the task's residual within a funnel."""

import numpy as np
import pytest
from scipy.optimize import brentq

from drake_rnn import Circumstances, InvalidInputError, JointLimits, Zeroing
from drake_rnn.laws.parts.programs import (
    Program,
    Rates,
)
from drake_rnn.laws.zeroing import Barriers, Funnel
from drake_rnn.laws.zeroing_design import FORMULAS

N, H = 7, 1e-3
LIMITS = JointLimits.unlimited(N).replace(velocity=np.linspace(0.2, 1.5, N))
FUNNEL = Funnel(start=0.5, end=0.05, decay=2.0)
WIDE = Funnel(start=20.0, end=5.0, decay=2.0)


def law(**fields):
    made = {"limits": LIMITS, "home": np.zeros(N), "prescribed": Funnel(), **fields}
    return Zeroing(**made)


def moving_conditions(t):
    """Conditions of a program whose terms all move, and its rates; bounds are not symmetric."""
    rng = np.random.default_rng(1)
    k, m = 5, 2
    parts = {}
    for name, shape in (("c", k), ("A", (m, k)), ("b", m), ("lower", k), ("upper", k)):
        size, phase = rng.normal(size=shape), rng.uniform(0.0, 6.0, shape)
        size += {"lower": -3.0, "upper": 3.0}.get(name, 0.0)
        parts[name] = size + 0.3 * np.sin(3.0 * t + phase), 0.9 * np.cos(3.0 * t + phase)
    now = {name: value for name, (value, _) in parts.items()}
    rate = {name: change for name, (_, change) in parts.items()}
    box = now.pop("lower"), now.pop("upper")
    rates = Rates(box=(rate.pop("lower"), rate.pop("upper")), **rate)
    return Barriers(Program(W=np.eye(k), box=box, **now), 1e-3, WIDE, t), rates


def test_slope_and_drift_are_the_derivatives_of_the_error():
    y, t, h = np.random.default_rng(2).normal(size=7), 0.4, 1e-6
    conditions, rates = moving_conditions(t)
    columns = [conditions.error(y + h * e) - conditions.error(y - h * e) for e in np.eye(7)]
    np.testing.assert_allclose(conditions.slope(y), np.array(columns).T / (2 * h), atol=1e-6)
    apart = moving_conditions(t + h)[0].error(y) - moving_conditions(t - h)[0].error(y)
    np.testing.assert_allclose(conditions.drift(y, rates), apart / (2 * h), atol=1e-6)


def test_the_funnel_narrows_and_its_barrier_is_the_logit_of_the_place_in_it():
    """chi = ln(xi / (1 - xi)) with xi = (e + rho) / 2 rho, up to a share of 0.99."""
    t, inside = 0.3, np.array([-0.2, 0.0, 0.1, 0.25])
    rho = 0.5 * np.exp(-0.6) + 0.05
    share = (inside + rho) / (2.0 * rho)
    chi, slope, _ = FUNNEL.barrier(inside, t)
    np.testing.assert_allclose(chi, np.log(share / (1.0 - share)), atol=1e-12)
    np.testing.assert_allclose(slope, 1.0 / (2.0 * rho * share * (1.0 - share)))
    beyond = FUNNEL.barrier(np.array([2.0 * rho, 3.0 * rho]), t)[0]
    assert np.isfinite(beyond).all()
    assert beyond[1] > beyond[0] > 5.0
    assert FUNNEL.used(inside, t) == pytest.approx(0.25 / rho)


@pytest.mark.parametrize("form", ["implicit", *FORMULAS])
def test_at_rest_it_is_at_the_optimum_of_the_barriers(form):
    """Least sum of squared logits with J v = b: along one joint's way, found by bisection."""
    made = law(gain=200.0, feedback=0.0, return_gain=0.0, discretization=form, damping=1e-7)
    J = np.zeros((3, N))
    # The first axis is moved by joints 1 and 7 together; the other two by joints that rest.
    J[0, [0, 6]], J[1, 1], J[2, 2] = (0.4, 0.7), 1.0, 1.0
    u = {name: np.zeros(s) for name, (_, s) in made.inputs.parts.items()} | {"J": J}
    u["v_WE_desired"] = np.array([0.6, 0.0, 0.0])
    reading = made.sampled(H)
    x = reading.initial_state(np.random.default_rng(0), u)
    for k in range(150):
        x = reading.step(0.5 + k * H, x, u, H)
    fastest = LIMITS.velocity[[0, 6]]

    def slope(v):
        share = (v / fastest + 1.0) / 2.0
        return np.log(share / (1.0 - share)) / (2.0 * fastest * share * (1.0 - share))

    def pull(first):
        along = slope(np.array([first, (0.6 - 0.4 * first) / 0.7]))
        return along[0] - along[1] * 0.4 / 0.7

    first = brentq(pull, -0.19, 0.199)
    wanted = np.array([first, 0, 0, 0, 0, 0, (0.6 - 0.4 * first) / 0.7])
    np.testing.assert_allclose(reading.commanded_velocity(1.0, x), wanted, atol=1e-6)


@pytest.mark.parametrize("form", ["implicit", *FORMULAS])
def test_velocities_are_within_their_limits_whatever_comes(form):
    """A task that wants a hundred times more; explicit steps may end, but not out of bounds."""
    made = law(gain=300.0, discretization=form, prescribed=Funnel(end=0.01))
    reading, rng = made.sampled(H), np.random.default_rng(4)
    u = {name: rng.normal(size=s) for name, (_, s) in made.inputs.parts.items()}
    x, largest = reading.initial_state(rng, u), 0.0
    for k in range(200):
        if k % 20 == 0:
            u = {name: 10.0 * rng.normal(size=s) for name, (_, s) in made.inputs.parts.items()}
            u["position"] = np.zeros(N)
        x = reading.step(k * H, x, u, H)
        if not np.isfinite(x).all():
            break
        v = reading.commanded_velocity(k * H, x)
        largest = max(largest, float((np.abs(v) / LIMITS.velocity).max()))
    assert k > 3
    assert 0.5 < largest <= 1.0 + 1e-12
    assert form != "implicit" or k == 199


def test_at_first_it_rests_though_its_bounds_are_not_symmetric():
    """Near a position limit the middle of the bounds is a velocity away from it."""
    limits = LIMITS.replace(position_lower=-1.0, position_upper=1.0)
    made = law(limits=limits, home=np.full(N, 0.99), return_gain=0.0)
    u = {name: np.zeros(s) for name, (_, s) in made.inputs.parts.items()}
    u |= {"position": np.full(N, 0.99), "J": np.eye(3, N)}
    reading = made.sampled(H)
    x = reading.step(0.0, reading.initial_state(np.random.default_rng(0), u), u, H)
    assert np.abs(reading.commanded_velocity(0.0, x)).max() < 0.01


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"bounds": "velocity"}, "bounds: prescribed has bounds of its own"),
        ({"cost": "kinetic_energy"}, "cost: prescribed has a cost of its own"),
        ({"manipulability": 0.1}, "manipulability: prescribed has a cost of its own"),
        ({"jacobian": "learned"}, "jacobian: prescribed needs jacobian: known"),
        ({"limits": JointLimits.unlimited(N)}, "prescribed: needs a velocity limit for every"),
    ],
)
def test_what_it_cannot_have_is_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        law(**fields)


def test_a_start_outside_of_the_funnel_is_refused_before_the_run():
    """At rest J v - b is -(v_d + K e)."""
    made = law(feedback=10.0, prescribed=Funnel(start=0.3, end=0.1))
    seen = Circumstances(start_offset=np.array([0.0, -0.03, 0.0]), start_velocity=np.zeros(3))
    assert made.doubts(seen) == []
    faster = seen._replace(start_velocity=np.array([0.0, -0.11, 0.0]))
    with pytest.raises(InvalidInputError, match=r"is 0\.41 m/s along an axis, and start \+ end = "):
        made.doubts(faster)
