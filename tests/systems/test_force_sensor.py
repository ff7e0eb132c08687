"""A force sensor as it is: noisy, late, slow, and sometimes broken."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import InvalidInputError, SensorSettings, SimulationError
from drake_rnn.features.contact import ForceSensor

PERIOD = 1e-3


def said(until=0.2, seed=0, force=None, name="sensor", **settings):
    """What it says, by sample: entry k is what is there to be seen just after sample k."""
    builder = DiagramBuilder()
    source = ConstantVectorSource([1.0]) if force is None else TrajectorySource(force)
    builder.AddSystem(source)
    sensor = ForceSensor(SensorSettings(**settings), PERIOD, seed)
    builder.AddNamedSystem(name, sensor)
    builder.Connect(source.get_output_port(), sensor.get_input_port())
    # Half a period late, so that each entry lies between two samples.
    log = LogVectorOutput(sensor.get_output_port(), builder, publish_period=PERIOD / 2)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(until)
    return log.FindLog(simulator.get_context()).data()[0, 1::2]


# Ten newtons a second, from 0.
RAMP = PiecewisePolynomial.FirstOrderHold([0.0, 10.0], [[0.0, 100.0]])


@pytest.mark.parametrize("late", [0, 1, 2, 7, 50])
def test_each_sample_is_late_by_exactly_its_delay(late):
    """Of a ramp: sample k is what was there ``late`` samples before, and 0 before the first."""
    samples = np.arange(200)
    expected = 10.0 * PERIOD * np.maximum(samples - late, 0)
    np.testing.assert_allclose(said(force=RAMP, delay=late * PERIOD), expected, atol=1e-12)


@pytest.mark.parametrize("delay", [0.4e-3, 1.5e-3])
def test_a_delay_between_two_samples_is_refused(delay):
    with pytest.raises(InvalidInputError, match=r"sensor\.delay: must be a multiple of .*0\.001"):
        ForceSensor(SensorSettings(delay=delay), PERIOD)


@pytest.mark.parametrize("corner", [5.0, 20.0, 100.0])
def test_a_step_answers_as_a_first_order_filter_of_its_corner_frequency(corner):
    """1 - exp(-2 pi f t), at the end of each sample."""
    t = PERIOD * np.arange(1, 201)
    expected = 1.0 - np.exp(-2.0 * np.pi * corner * t)
    np.testing.assert_allclose(said(low_pass=corner), expected, atol=1e-12)


def test_noise_is_normal_white_and_as_large_as_is_said():
    """4 %: of 5000 samples, the standard deviation is known to 1 %."""
    noise = said(until=5.0, noise=0.03) - 1.0
    assert noise.std() == pytest.approx(0.03, rel=0.04)
    assert abs(noise.mean()) < 0.002
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05
    share = np.mean(np.abs(noise) < 0.03)
    assert share == pytest.approx(0.683, abs=0.03)


def test_noise_is_that_of_the_seed():
    first, again, other = (said(noise=0.03, seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


def test_noise_goes_through_delay_and_filter_too():
    late = said(noise=0.03, delay=3 * PERIOD)
    np.testing.assert_array_equal(late[3:], said(noise=0.03)[:-3])
    assert said(until=2.0, noise=0.03, low_pass=10.0)[500:].std() < 0.01


def test_a_frozen_sensor_says_what_it_last_said():
    data = said(force=RAMP, failure="frozen", fails_at=0.0505)
    np.testing.assert_array_equal(data[:51], said(force=RAMP)[:51])
    assert (data[51:] == data[50]).all()
    assert data[50] > 0.0


def test_a_dead_sensor_stops_the_run_at_its_next_sample_and_says_why():
    with pytest.raises(SimulationError, match="dead: the force sensor reads nan") as caught:
        said(name="dead", failure="nan", fails_at=0.0505)
    assert caught.value.time == pytest.approx(0.051)


@pytest.mark.parametrize("late", [0, 3])
def test_a_force_that_is_no_number_stops_the_run_once_it_is_to_be_said(late):
    force = PiecewisePolynomial.ZeroOrderHold([0.0, 0.0505, 1.0], [[1.0, np.nan, np.nan]])
    with pytest.raises(SimulationError, match="the force sensor reads nan") as caught:
        said(force=force, delay=late * PERIOD)
    assert caught.value.time == pytest.approx(0.051 + late * PERIOD)


def test_by_default_it_says_what_is():
    np.testing.assert_array_equal(said(), 1.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"noise": -0.1}, "noise"),
        ({"delay": float("inf")}, "delay"),
        ({"delay": -1e-3}, r"delay: must be greater than or equal to 0, not -0\.001"),
        ({"delay": 1e7}, "delay: must be less than or equal to 5, not 10000000"),
        ({"low_pass": 0.0}, "low_pass"),
        ({"failure": "melted", "fails_at": 1.0}, "failure"),
        ({"failure": "nan"}, "failure: must be given together with fails_at"),
        ({"fails_at": 1.0}, "failure: must be given together with fails_at"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        SensorSettings(**fields)
