"""The measures of the claims of noise-suppressing neural dynamics: their parts, and short runs."""

import numpy as np
import pytest

from drake_rnn.claims.papers import noise_suppressing as ns


def state(seed=0):
    """Return a random state of the network, with its integral off zero."""
    y = np.random.default_rng(seed).normal(size=6 + 2 * 21)
    y[-21:] *= 1e-3
    return y


def first_state():
    start = np.append(ns._SETTINGS["code"].start, np.zeros(6))
    return np.concatenate((start, np.full(15, 1e-3), np.zeros(21)))


def test_the_jacobian_of_axes_and_links_is_that_of_the_chain():
    q, v = np.random.default_rng(1).normal(size=(2, 6))
    J, rate = ns._jacobian(q, v)
    np.testing.assert_allclose(J, ns._tip(q)[1], atol=1e-14)
    ahead, behind = (ns._tip(q + sign * 1e-5 * v)[1] for sign in (1.0, -1.0))
    np.testing.assert_allclose(rate, (ahead - behind) / 2e-5, atol=1e-9)


def test_the_path_begins_at_the_tip_and_its_rates_are_its_derivatives():
    assert not ns._path(0.0, 0.3)[0].any()
    for of, rate in ((0, 1), (1, 2)):
        change = (ns._path(2.0 + 1e-5, 0.3)[of] - ns._path(2.0 - 1e-5, 0.3)[of]) / 2e-5
        np.testing.assert_allclose(ns._path(2.0, 0.3)[rate], change, atol=1e-9)


@pytest.mark.parametrize("disturbance", [0.0, 5.0])
def test_the_residual_vanishes_as_the_design_formula_says(disturbance):
    """Whatever the state is: E' = -1000 (s(E) + s(E + 1000 s(Y))) + n, and Y' = E."""
    y, dt = state(), 1e-8
    rates, E = ns._network(1.0, y, 0.3, disturbance)
    np.testing.assert_array_equal(rates[-21:], E)
    ahead, behind = (
        ns._network(1.0 + sign * dt, y + sign * dt * rates, 0.3, disturbance)[1]
        for sign in (1.0, -1.0)
    )
    expected = -1e3 * (ns._cut(E) + ns._cut(E + 1e3 * ns._cut(y[-21:]))) + disturbance
    np.testing.assert_allclose((ahead - behind) / (2.0 * dt), expected, rtol=1e-5, atol=1e-2)


@pytest.mark.parametrize("disturbance", [0.0, 5.0])
def test_a_constant_disturbance_leaves_the_residual_zero_and_the_tip_aside(disturbance):
    """Its integral balances it: 1e6 of that are the disturbance, and of velocity it is a way."""
    course = ns._solve(first_state(), 0.3, 0.05, disturbance)
    assert np.linalg.norm(course.residual) < 1e-10
    apart = ns._tip(course.position[-1])[0] - ns._tip(course.position[0])[0]
    np.testing.assert_allclose(apart - ns._path(0.05, 0.3)[0], disturbance / 1e6, atol=1e-9)


def test_the_network_is_at_the_optimum_soon():
    course = ns._solve(first_state(), 0.3, 0.05, 5.0)
    J, onward = ns._tip(course.position[-1])[1], ns._path(0.05, 0.3)[1]
    np.testing.assert_allclose(course.velocity[-1], ns._optimum(J, onward), atol=1e-6)


def test_an_optimum_whose_bounds_act_still_does_the_task():
    J = ns._tip(np.array(ns._SETTINGS["data"].start))[1]
    onward = J @ np.array([0.5, -0.5, 0.5, -0.5, 0.2, 0.0])
    v = ns._optimum(J, onward)
    np.testing.assert_allclose(J @ v, onward, atol=1e-9)
    assert np.abs(v).max() <= 0.5 + 1e-9


@pytest.mark.parametrize(("seed", "diverges"), [(0, False), (1, True), (2, False)])
def test_from_some_starts_the_network_diverges(seed, diverges):
    """In finer steps too."""
    y = np.random.default_rng(seed).normal(size=6 + 2 * 21)
    y[:6], y[-21:] = ns._SETTINGS["code"].start, 0.0
    largest = 0.0
    for k in range(5):
        with np.errstate(over="ignore", invalid="ignore"):
            y = ns._onward(lambda t, y: ns._network(t, y, 0.3, 5.0)[0], k * 1e-3, y, 50)
        largest = np.maximum(largest, np.abs(y).max())  # not a number if that is none
    assert bool(largest < 100.0) is not diverges
