"""Velocities that an arm makes besides those commanded."""

import numpy as np
import pytest

from drake_rnn import DisturbanceSettings, DitherSettings, load_experiment, run_many, simulate
from drake_rnn.features.obstacles import ObstacleMotions, ObstacleSource
from drake_rnn.features.sensing import Stream, WhiteNoise
from drake_rnn.robot.arm_description import _STREAM

REST = {
    "arm": "panda",
    "path": {"kind": "rest"},
    "law": {"kind": "pseudoinverse", "feedback": 10.0},
    "period": 1e-3,
    "duration": 1.0,
}


def off(**disturbance):
    """Return how far off the tool ends, and how far J times the disturbance over the gain is."""
    result = simulate(load_experiment({**REST, "disturbance": {"size": 0.02, **disturbance}}))
    error = result.series["p_WE"][-1] - result.series["p_WE_desired"][-1]
    expected = result.series["J"][-1] @ np.full(7, 0.02) / REST["law"]["feedback"]
    return error, expected


def test_a_constant_one_leaves_its_share_of_the_gain():
    """With dp/dt = -K p + J d at rest; e^-10 is left of the start, and J turns slowly."""
    error, expected = off(kind="constant")
    assert error == pytest.approx(expected, rel=0.02, abs=1e-5)


def test_a_ramp_is_a_tenth_of_a_second_late():
    """The same d = 0.02 t, late by the time constant 1/K: at one second nine tenths."""
    error, expected = off(kind="ramp")
    assert error == pytest.approx(0.9 * expected, rel=0.03, abs=1e-5)


def test_a_random_one_has_its_deviation_and_no_mean():
    values = DisturbanceSettings(kind="random", size=0.1).samples(7, seed=3).block(2)
    assert np.std(values) == pytest.approx(1.0, rel=0.05)
    assert abs(np.mean(values)) < 0.05
    assert np.abs(values).max() <= 3.0


def test_noises_of_one_seed_are_not_the_same():
    """A disturbance, a dither, errors of obstacles, sensors and links, a law's first state."""
    seed, drawn = 3, {}
    for stream in Stream:
        drawn[stream] = WhiteNoise(2, seed, stream).block(0)[0, 0]
    for stream, noise in (
        (Stream.DISTURBANCE, DisturbanceSettings(kind="random", size=0.1)),
        (Stream.DITHER, DitherSettings(sigma=0.1, hold=1e-3)),
    ):
        assert noise.samples(2, seed).block(0)[0, 0] == drawn[stream]
    moving = ObstacleMotions(paths=(None,), errors=np.ones(1))
    source = ObstacleSource(moving, 1e-3, seed)
    away = source.get_output_port().Eval(source.CreateDefaultContext())
    first = WhiteNoise(3, seed, Stream.OBSTACLES).block(0)[0]
    np.testing.assert_allclose(away, first / np.linalg.norm(first), rtol=1e-12)
    # A generator of fewer numbers is the one whose last numbers are zero.
    drawn["law"] = np.random.default_rng([seed, 0]).standard_normal()
    drawn["links"] = np.random.default_rng([seed, _STREAM]).standard_normal()
    assert len({*drawn.values()}) == len(drawn)


@pytest.mark.parametrize(
    "changes",
    [
        {"disturbance": {"kind": "ramp", "size": 0.02, "hold": 3e-3}},
        {"disturbance": {"kind": "random", "size": 0.02, "hold": 2e-3}},
        {"sensing": {"p_WE_noise": 1e-4}},
    ],
)
def test_it_is_the_same_in_a_batch(changes):
    documents = [{**REST, "duration": 0.05, **changes, "seed": seed} for seed in (1, 2)]
    many = run_many(documents).metrics["position_error_max_m"]
    for number, document in enumerate(documents):
        alone = simulate(load_experiment(document)).metrics["position_error_max_m"]
        assert many[number] == pytest.approx(alone, rel=1e-9)
