"""How measurements of a given quality are treated."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from drake_rnn.laws.parts.jacobian import EXACT, KAPPA, Measurement, feedback_gain, learning_for

H = 1e-3


def test_exact_measurements_are_differences_of_one_sample():
    assert learning_for(Measurement(), H) == EXACT
    assert learning_for(Measurement(delay=5e-3), H) == EXACT
    assert learning_for(Measurement(secant_samples=7), H) == EXACT._replace(samples=7)


def test_10_um_take_secants_of_10_ms_whatever_the_period():
    for period in (1e-4, 1e-3, 5e-3):
        assert learning_for(Measurement(error=1e-5), period).samples == round(1e-2 / period)
    assert learning_for(Measurement(error=1e-5), 0.1).samples == 1
    assert learning_for(Measurement(error=1e-2), 1e-4).samples == 500


def test_larger_errors_take_longer_secants_and_softer_tasks():
    found = [learning_for(Measurement(error=e), H) for e in (1e-6, 1e-5, 1e-4, 1e-3)]
    samples, softness = [f.samples for f in found], [f.softness for f in found]
    assert samples == sorted(set(samples))
    np.testing.assert_allclose(softness, [1e-5, 1e-4, 1e-3, 1e-2])


def test_larger_errors_take_a_slower_feedback():
    for learned in (False, True):
        assert feedback_gain(Measurement(delay=5e-3), learned) == KAPPA
    known = [feedback_gain(Measurement(error=e), False) for e in (1e-9, 1e-7, 1e-5, 1e-3, 1e-2)]
    np.testing.assert_allclose(known, [KAPPA, 60.0, 6.0, 2.0, 2.0])
    # A learned Jacobian is wrong in places, and needs the feedback to make up for that.
    assert feedback_gain(Measurement(error=1e-3), True) == 30.0


def test_the_variance_is_a_hundred_times_that_of_a_secant_and_never_less_than_the_exact():
    """Against drawn noise; 5 %: of 10^5 draws the variance is known to a percent."""
    noise = 1e-5 * np.random.default_rng(0).normal(size=(2, 100_000))
    secants = (noise[1] - noise[0]) / (10 * H)
    found = learning_for(Measurement(error=1e-5), H)
    assert found.variance == pytest.approx(100 * secants.var(), rel=0.05)
    assert learning_for(Measurement(error=1e-9), H).variance == EXACT.variance
    given = learning_for(Measurement(error=1e-5, secant_samples=20), H)
    assert given.samples == 20
    assert given.variance == pytest.approx(found.variance / 4)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"error": -1e-5}, "error: must be greater than or equal to 0"),
        ({"delay": -1e-3}, "delay: must be greater than or equal to 0"),
        ({"secant_samples": 0}, "secant_samples: must be greater than or equal to 1"),
        ({"secant_samples": 2.5}, "secant_samples: must be a"),
        ({"secant_samples": 10**6}, "secant_samples: may be at most 1000|must be less"),
        ({"eror": 1.0}, "eror: no such key; nearest: error"),
    ],
)
def test_what_no_measurement_has_is_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        Measurement(**fields)
