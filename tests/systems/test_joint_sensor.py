"""Sensors of joints as they are: noisy, in steps, late, and with velocities from differences."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import InvalidInputError, SensingSettings, load_arm
from drake_rnn.features.sensing import JointSensor

ARM = load_arm("planar6")
N, PERIOD = ARM.n, 1e-3
SPEEDS = 0.1 * np.arange(1, N + 1)
START = np.linspace(-1.0, 1.0, N)
SAMPLES = np.arange(200)
TRUE = START + np.outer(SAMPLES * PERIOD, SPEEDS)


def measured(seed=0, samples=200, start=START, **settings):
    """What a sampled controller reads at each sample, from joints that move evenly."""
    end = start + 10.0 * SPEEDS
    path = PiecewisePolynomial.FirstOrderHold([0.0, 10.0], np.column_stack((start, end)))
    builder = DiagramBuilder()
    sensor = builder.AddSystem(JointSensor(SensingSettings(**settings), ARM, start, PERIOD, seed))
    simulator_parts = {}
    for name, trajectory in (("position", path), ("velocity", path.derivative())):
        source = builder.AddSystem(TrajectorySource(trajectory))
        builder.Connect(source.get_output_port(), sensor.GetInputPort(f"{name}_true"))
        # Reads at the times of the samples, as a sampled controller does.
        reader = builder.AddSystem(ZeroOrderHold(PERIOD, N))
        builder.Connect(sensor.GetOutputPort(name), reader.get_input_port())
        simulator_parts[name] = reader
    simulator = Simulator(builder.Build())
    said = {"position": [], "velocity": []}
    for k in range(samples):
        simulator.AdvanceTo((k + 0.5) * PERIOD)
        for name, reader in simulator_parts.items():
            context = reader.GetMyContextFromRoot(simulator.get_context())
            said[name].append(reader.get_output_port().Eval(context).copy())
    return SimpleNamespace(**{name: np.array(rows) for name, rows in said.items()})


def test_by_default_it_says_what_is_and_when_it_is():
    got = measured()
    np.testing.assert_allclose(got.position, TRUE, atol=1e-14)
    np.testing.assert_allclose(got.velocity, np.tile(SPEEDS, (200, 1)), atol=1e-12)


@pytest.mark.parametrize("late", [1, 2, 7, 50])
def test_each_sample_is_late_by_exactly_its_delay(late):
    """Before the first one the arm stood at its start."""
    got = measured(delay=late * PERIOD)
    np.testing.assert_allclose(got.position[late:], TRUE[:-late], atol=1e-14)
    np.testing.assert_allclose(got.velocity[late:], np.tile(SPEEDS, (200 - late, 1)), atol=1e-12)
    np.testing.assert_array_equal(got.position[:late], np.tile(START, (late, 1)))
    np.testing.assert_array_equal(got.velocity[:late], 0.0)


@pytest.mark.parametrize("late", [0, 3])
@pytest.mark.parametrize("over", [1, 4, 25])
def test_a_secant_is_the_difference_of_measured_positions(over, late):
    got = measured(secant_samples=over, delay=late * PERIOD, encoder_bits=14, position_noise=1e-4)
    at = slice(late + over, None)
    expected = (got.position[at] - got.position[late : 200 - over]) / (over * PERIOD)
    np.testing.assert_allclose(got.velocity[at], expected, rtol=1e-12, atol=1e-12)


def test_an_encoder_says_whole_steps_the_nearest():
    """Of 2 pi / 2^bits; 1e-12: of rounding."""
    step = 2.0 * np.pi / 2**12
    got = measured(encoder_bits=12).position
    steps = got / step
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert 0.45 * step < np.abs(got - TRUE).max() <= 0.5 * step + 1e-12
    np.testing.assert_array_equal(got, measured(resolution=step).position)


def test_what_an_encoder_costs_a_secant_falls_with_the_samples_it_is_taken_over():
    """Two roundings of half a step at most, over the secant's time."""
    step = 2.0 * np.pi / 2**14
    for over in (1, 10, 100):
        got = measured(encoder_bits=14, secant_samples=over).velocity[over:]
        assert np.abs(got - SPEEDS).max() <= step / (over * PERIOD) + 1e-9


def test_each_joint_has_its_own_noise_and_its_own_step():
    """A joint without noise or with a fine encoder is measured exactly."""
    noise = np.zeros(N)
    noise[2] = 1e-3
    got = measured(position_noise=noise)
    assert (np.abs(got.position - TRUE).max(axis=0) > 1e-9).tolist() == (noise > 0).tolist()
    step = np.full(N, 1e-9)
    step[4] = 1e-2
    off = np.abs(measured(resolution=step).position - TRUE).max(axis=0)
    assert off[4] > 4e-3
    assert np.delete(off, 4).max() <= 0.5e-9 + 1e-14


def test_noise_is_normal_white_and_as_large_as_is_said():
    """2 %: of 12000 values the standard deviation is known to 0.7 %."""
    noise = measured(samples=2000, position_noise=1e-3).position
    noise = noise - (START + np.outer(np.arange(2000) * PERIOD, SPEEDS))
    assert noise.std() == pytest.approx(1e-3, rel=0.02)
    assert abs(noise.mean()) < 3e-5
    assert np.abs(np.corrcoef(noise.T) - np.eye(N)).max() < 0.1
    assert np.abs((noise[1:] * noise[:-1]).mean(axis=0)).max() < 0.1e-6


def test_noise_is_that_of_the_seed_and_passes_the_delay():
    first, again, other = (measured(seed, position_noise=1e-3).position for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()
    late = measured(position_noise=1e-3, delay=3 * PERIOD).position
    np.testing.assert_array_equal(late[3:], first[:-3])


@pytest.mark.parametrize("delay", [0.4e-3, 1.5e-3])
def test_a_delay_between_two_samples_is_refused(delay):
    with pytest.raises(InvalidInputError, match=r"sensing\.delay: must be a multiple of .*0\.001"):
        JointSensor(SensingSettings(delay=delay), ARM, START, PERIOD)


@pytest.mark.parametrize("key", ["position_noise", "resolution"])
def test_numbers_for_other_joints_are_refused(key):
    message = rf"sensing\.{key}: must have 6 entries, one per joint of planar6, not 3"
    with pytest.raises(InvalidInputError, match=message):
        JointSensor(SensingSettings(**{key: [1e-3] * 3}), ARM, START, PERIOD)


def test_an_encoder_of_turns_is_not_for_a_joint_that_slides():
    sliding = copy(ARM.replace(joints=list(ARM.joints[:2])))
    sliding.joints, sliding.units = ("lift", "arm"), ("m", "rad")
    with pytest.raises(InvalidInputError, match=r"encoder_bits: .* and lift slides; give sensing"):
        JointSensor(SensingSettings(encoder_bits=12), sliding, np.zeros(2), PERIOD)
    JointSensor(SensingSettings(resolution=[1e-4, 1e-3]), sliding, np.zeros(2), PERIOD)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"position_noise": -0.1}, "position_noise: must be greater than or equal to 0"),
        ({"resolution": 0.0}, "resolution: must be greater than 0"),
        ({"encoder_bits": 0}, "encoder_bits: must be greater than or equal to 1, not 0"),
        ({"encoder_bits": 16.5}, "encoder_bits: must be an integer"),
        ({"encoder_bits": 12, "resolution": 1e-3}, "resolution: cannot be combined with encoder_b"),
        ({"delay": -1e-3}, r"delay: must be greater than or equal to 0, not -0\.001"),
        ({"delay": 6.0}, "delay: must be less than or equal to 5, not 6"),
        ({"secant_samples": -1}, "secant_samples: must be greater than or equal to 0"),
        ({"noise": 1e-3}, "noise: no such key; nearest: p_WE_noise, R_WE_noise, position_n"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        SensingSettings(**fields)
