"""The measures of the varying-parameter network's claims, on what is known in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn.claims.papers import varying_parameter as measures


def test_no_start_has_the_times_of_table_1():
    """0.2 exp(7.804 + 7.804^2/2) and 0.2 exp(15 0.1341) are 16 orders apart."""
    apart = measures.starts_apart(None)
    assert apart == pytest.approx(np.exp(7.804 + 7.804**2 / 2 - 15 * 0.1341), rel=1e-6)
    assert measures.starts_apart(None, [10.0, 15.0]) < 1.2
    # The integral of 1/e^3 from 0.2/sqrt 3 on is 37.5, which t + t^2/2 is at 7.72 s.
    assert measures.longest_time(None, "power", 1.0) == pytest.approx(np.sqrt(76.0) - 1.0, rel=1e-6)


def test_of_a_linear_activation_times_are_those_of_its_exponent():
    """t + t^2/2 = ln 7.5 against t = ln 7.5."""
    needed = np.log(7.5)
    ratio = (np.sqrt(1.0 + 2.0 * needed) - 1.0) / needed
    assert measures.time_to_fixed(None, "linear") == pytest.approx(ratio, rel=1e-6)


def test_sinh_has_the_solution_without_its_sign():
    assert measures.formula_apart(None, "hyperbolic_sine", 1.0) < 1e-6
    assert measures.formula_apart(None, "hyperbolic_sine", 1.0, -1.0) > 1.0


def test_a_small_error_takes_longer_than_the_bound():
    assert measures.time_over_bound(None, 1.0, 0.5, 0.5) > 1.05
    assert measures.time_over_bound(None, 1.0, 2.0, 0.5) < 1.0
    assert measures.time_over_bound(None, 1.0, 0.5, 0.5, "fixed") < 1.0


def test_on_problem_66_the_network_leaves_nothing_in_the_end():
    left = measures.residual_left(None, "linear", 5.0, 1.0)
    # exp(-(5 + 1/6)) of a residual of order 1.
    assert 1e-4 < left < 0.2


def test_sampled_the_varying_network_breaks_where_its_gain_is_unstable():
    """10 + t^10 is 2000 at 2.138 s; the run here is off from 2.2 s on."""

    def run(name, changes):
        time = np.arange(0.0, 3.0, 0.01)
        p_WE = np.zeros((time.size, 3))
        p_WE[time > 2.195] = 1.0
        return SimpleNamespace(time=time, series={"p_WE": p_WE, "p_WE_desired": 0.0 * p_WE})

    assert measures.broken_over_stable(run, "any", 10.0, 2.5) == pytest.approx(
        2.2 / 2.138, rel=1e-3
    )


def test_of_a_linear_activation_the_share_left_is_that_of_its_exponent():
    """exp(-t - t^2/2) per exp(-t)."""
    assert measures.error_left(None, 1.0, 3.0) == pytest.approx(np.exp(-4.5))


def test_the_jacobian_of_the_jaco_is_that_of_its_tip():
    q, d = measures._JACO_START, 1e-6
    columns = [
        (measures._tip(q + d * e)[0] - measures._tip(q - d * e)[0]) / (2.0 * d) for e in np.eye(6)
    ]
    np.testing.assert_allclose(np.transpose(columns), measures._tip(q)[1], atol=1e-8)


def test_on_the_butterfly_what_the_network_begins_with_makes_the_error():
    """At a gain of 80 a velocity of 0.1 rad/s adds less than a millimetre."""
    assert abs(measures.butterfly_error(None, "smallest")) < 1e-8
    assert 1e-4 < measures.butterfly_error(None, "largest", 0.1) < 1e-3
