"""The design formula: activations, implicit steps, and times within which errors vanish."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Zeroing
from drake_rnn.laws.zeroing_design import (
    FIXED_TIME,
    Design,
    GrowingGain,
    activation,
)
from drake_rnn.robot.limits import JointLimits

X = np.array([0.0, 1e-6, 0.1, 0.5, 0.999999, 1.000001, 2.0])
#: phi at X by a second way of writing it, as public code does.
WRITTEN = {
    "linear": lambda x: x,
    "power": lambda x: x * x * x,
    "bipolar_sigmoid": lambda x: (
        (1 + np.exp(-2)) / (1 - np.exp(-2)) * (1 - np.exp(-2 * x)) / (1 + np.exp(-2 * x))
    ),
    "power_sigmoid": lambda x: np.where(
        x < 1,
        (1 + np.exp(-4)) / (1 - np.exp(-4)) * (1 - np.exp(-4 * x)) / (1 + np.exp(-4 * x)),
        x**3,
    ),
    "hyperbolic_sine": lambda x: (np.exp(2 * x) - np.exp(-2 * x)) / 2,
    "power_sum": lambda x: x + x**3,
    "sign_bi_power": lambda x: np.sqrt(x) / 2 + x**2 / 2,
    "fixed_time": lambda x: np.sqrt(x) + x**2 + x,
}


@pytest.mark.parametrize("shape", WRITTEN)
def test_an_activation_is_what_is_printed_odd_and_increasing(shape):
    phi = activation(shape, None, None)
    np.testing.assert_allclose(phi(X), WRITTEN[shape](X), rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(phi(-X), -phi(X))
    assert (np.diff(phi(np.linspace(-3.0, 3.0, 601))) > 0.0).all()
    slope = float(phi(np.array([1e-9]))[0] / 1e-9)
    assert slope > 1e4 if np.isinf(phi.slope_at_zero) else slope == pytest.approx(phi.slope_at_zero)


@pytest.mark.parametrize("integral", [0.0, 80.0])
@pytest.mark.parametrize("shape", WRITTEN)
def test_an_implicit_step_solves_its_equation_at_any_gain(shape, integral):
    rng = np.random.default_rng(0)
    design = Design(activation(shape, None, None), integral)
    E, noise = 3.0 * rng.normal(size=8), rng.normal(size=8)
    E[0] = noise[0] = 0.0
    z = 0.02 * rng.normal(size=8) if integral else None
    for gain, h in ((50.0, 1e-3), (1e6, 1e-3), (200.0, 0.1)):
        e = design.after(E, z, gain, noise, h)
        rate = design.rate(e, None if z is None else z + h * e, gain) + noise
        scale = np.abs(E) + h * np.abs(rate) + 1e-12
        # Near zero the slope of a root is steep: it is e that is found to rounding, not its rate.
        steep = 1e-6 if shape in FIXED_TIME else 1e-9
        assert (np.abs(E + h * rate - e) <= steep * np.maximum(scale, h * gain * 1e-6)).all()
        assert integral or (np.abs(e) <= np.abs(E + h * noise) + 1e-15).all()


@pytest.mark.parametrize("shape", FIXED_TIME)
@pytest.mark.parametrize("size", [1e-2, 1.0, 1e6])
def test_errors_of_any_size_vanish_within_the_fixed_time(shape, size):
    """In steps of a thousandth of the bound; at 1 ms, with a gain of 100, likewise."""
    design, gain = Design(activation(shape, None, None), 0.0), 100.0
    bound = activation(shape, None, None).time_bound(gain)
    assert bound == pytest.approx({"fixed_time": 0.03, "sign_bi_power": 0.06}[shape])
    for h in (bound / 1000.0, 1e-3):
        E, t = np.array([size, -size]), 0.0
        while t < bound - 1e-9:
            E, t = design.after(E, None, gain, 0.0, h), t + h
        assert np.abs(E).max() < (1e-12 if h < 1e-3 else 1e-9)


@pytest.mark.parametrize("shape", FIXED_TIME)
def test_a_bound_of_few_samples_is_not_held(shape):
    """With a gain of one over the period the bound is 3 or 6 samples; 8 to 13 are needed."""
    design, gain, h = Design(activation(shape, None, None), 0.0), 1000.0, 1e-3
    E, bound = np.array([1e6]), activation(shape, None, None).time_bound(gain)
    left = []
    for _ in range(14):
        E = design.after(E, None, gain, 0.0, h)
        left.append(abs(E[0]))
    assert left[round(bound / h) - 1] > 1e-3
    assert left[-1] < 1e-9


def test_a_linear_error_does_not_vanish_in_that_time():
    assert np.isinf(activation("linear", None, None).time_bound(1.0))
    E, design = np.array([1.0]), Design(activation("linear", None, None), 0.0)
    for _ in range(1000):
        E = design.after(E, None, 100.0, 0.0, 3e-5)
    assert E[0] == pytest.approx(np.exp(-3.0), rel=0.01)


def test_gains_grow_as_they_say_and_reach_what_they_say():
    factors = {"none": 1.0, "exponential": np.exp(1.2), "power": 2.2**3}
    factors["power_of_gain"] = 1.0 + 1.2**50 / 50.0
    for growth, factor in factors.items():
        gain = GrowingGain(50.0, growth, 0.6)
        assert gain.at(2.0) == pytest.approx(50.0 * factor)
        assert gain.reaches(40.0) == 0.0
        if growth != "none":
            assert gain.at(gain.reaches(777.0)) == pytest.approx(777.0)
    assert np.isinf(GrowingGain(50.0, "none", 1.0).reaches(51.0))
    assert GrowingGain(2.0, "exponential", 1.0).lasts == pytest.approx(250.0 * np.log(10.0))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"steepness": 2.0}, "steepness: is a number of bipolar_sigmoid, power_sigmoid, hyper"),
        ({"activation": "power", "exponent": 2.0}, "exponent: must be odd, 1 to 19, .* not 2"),
        ({"activation": "fixed_time", "exponent": 1.0}, "exponent: must be between 0 and 1"),
        ({"activation": "power_sum", "exponent": 1.5}, "exponent: must be 1 to 9, the number of"),
        ({"activation": "tanh"}, "activation: must be "),
    ],
)
def test_numbers_that_an_activation_does_not_have_are_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        Zeroing(limits=JointLimits.unlimited(2), home=np.zeros(2), **fields)


@pytest.mark.parametrize("first", [0.01, 0.5, 3.0])
def test_a_gain_that_grows_by_its_own_power_says_when_it_is_reached(first):
    gain = GrowingGain(first, "power_of_gain", 2.0)
    # A gain this small grows for longer than any run lasts.
    assert gain.lasts > 1e50
    assert gain.at(gain.reaches(10.0)) == pytest.approx(10.0)
