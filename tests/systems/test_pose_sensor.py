"""Sensors that see the end effector from outside: noisy, late, with velocities from differences."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import InvalidInputError, SensingSettings, load_arm
from drake_rnn.features.sensing import JointSensor, PoseSensor
from drake_rnn.robot.rotation import rotation_by, rotation_error

ARM = load_arm("panda")
KINEMATICS = ARM.kinematics()
PERIOD, COUNT = 1e-3, 200
SPEEDS = 0.1 * np.arange(1, ARM.n + 1)
POSTURES = ARM.home + np.outer(np.arange(2000) * PERIOD, SPEEDS)
P_WE = np.array([KINEMATICS.p_WE(q) for q in POSTURES])
R_WE = np.array([KINEMATICS.R_WE(q) for q in POSTURES])
AT_HOME = KINEMATICS.p_WE(ARM.home)


def measured(seed=0, samples=COUNT, task="xyz", **settings):
    """What a sampled controller reads at each sample, while the joints move evenly."""
    path = PiecewisePolynomial.FirstOrderHold(
        [0.0, 10.0], np.column_stack((ARM.home, ARM.home + 10.0 * SPEEDS))
    )
    builder = DiagramBuilder()
    sensor = builder.AddSystem(
        PoseSensor(SensingSettings(**settings), ARM.kinematics(), task, ARM.home, PERIOD, seed)
    )
    source = builder.AddSystem(TrajectorySource(path))
    builder.Connect(source.get_output_port(), sensor.get_input_port())
    readers = {}
    for index in range(sensor.num_output_ports()):
        port = sensor.get_output_port(index)
        # Reads at the times of the samples, as a sampled controller does.
        readers[port.get_name()] = builder.AddSystem(ZeroOrderHold(PERIOD, port.size()))
        builder.Connect(port, readers[port.get_name()].get_input_port())
    simulator = Simulator(builder.Build())
    said = {name: [] for name in readers}
    for k in range(samples):
        simulator.AdvanceTo((k + 0.5) * PERIOD)
        for name, reader in readers.items():
            context = reader.GetMyContextFromRoot(simulator.get_context())
            said[name].append(reader.get_output_port().Eval(context).copy())
    return SimpleNamespace(**{name: np.array(rows) for name, rows in said.items()})


def turned(got, true=R_WE):
    """Rotation vectors from the true orientations to the measured ones."""
    return rotation_error(true[: len(got.R_WE)], got.R_WE.reshape(-1, 3, 3))


def test_without_noise_it_says_where_the_end_effector_is():
    """1e-12: the source's joints are those of POSTURES but for rounding."""
    got = measured(p_WE_noise=0.0)
    np.testing.assert_allclose(got.p_WE, P_WE[:COUNT], atol=1e-12)
    np.testing.assert_allclose(got.R_WE.reshape(-1, 3, 3), R_WE[:COUNT], atol=1e-12)
    assert not hasattr(got, "v_WE")


@pytest.mark.parametrize("late", [1, 7])
def test_each_sample_is_late_by_exactly_its_delay(late):
    """Before the first one the arm stood at its start; noise passes the delay as well."""
    settings = {"p_WE_noise": 1e-4, "R_WE_noise": 1e-3}
    got, at_once = measured(delay=late * PERIOD, **settings), measured(**settings)
    np.testing.assert_array_equal(got.p_WE[late:], at_once.p_WE[:-late])
    np.testing.assert_array_equal(got.R_WE[late:], at_once.R_WE[:-late])
    np.testing.assert_array_equal(got.p_WE[:late], np.tile(AT_HOME, (late, 1)))


def test_its_noise_is_normal_white_and_as_large_as_is_said():
    """2.5 %: of 6000 values the standard deviation is known to 0.9 %."""
    got = measured(samples=2000, p_WE_noise=1e-4, R_WE_noise=5e-5)
    for noise, sigma in ((got.p_WE - P_WE, 1e-4), (turned(got), 5e-5)):
        assert noise.std() == pytest.approx(sigma, rel=0.025)
        assert abs(noise.mean()) < 0.05 * sigma
        assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.1
        assert np.abs((noise[1:] * noise[:-1]).mean(axis=0)).max() < 0.1 * sigma**2
    joint = np.column_stack((got.p_WE - P_WE, turned(got)))
    assert np.abs(np.corrcoef(joint.T) - np.eye(6)).max() < 0.1


def test_a_turned_orientation_is_a_rotation():
    got = measured(R_WE_noise=0.3).R_WE.reshape(-1, 3, 3)
    np.testing.assert_allclose(
        got @ got.transpose(0, 2, 1), np.tile(np.eye(3), (COUNT, 1, 1)), atol=1e-14
    )
    assert (np.linalg.det(got) > 0.0).all()


def test_noise_of_one_leaves_the_other_exact():
    exact = measured(p_WE_noise=0.0)
    np.testing.assert_array_equal(measured(R_WE_noise=1e-3).p_WE, exact.p_WE)
    np.testing.assert_array_equal(measured(p_WE_noise=1e-3).R_WE, exact.R_WE)


def test_noise_is_that_of_the_seed_and_not_that_of_the_joints():
    first, again, other = (measured(seed, p_WE_noise=1e-3).p_WE for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()
    settings = SensingSettings(p_WE_noise=1.0, position_noise=1.0)
    pose = PoseSensor(settings, KINEMATICS, "xyz", ARM.home, PERIOD)
    joints = JointSensor(settings, ARM, ARM.home, PERIOD)
    at = {"position_true": ARM.home, "velocity_true": np.zeros(ARM.n)}
    said = []
    for sensor in (pose, joints):
        context = sensor.CreateDefaultContext()
        for index in range(sensor.num_input_ports()):
            port = sensor.get_input_port(index)
            port.FixValue(context, at[port.get_name()])
        said.append(sensor.get_output_port(0).Eval(context))
    assert not np.isin(said[0] - AT_HOME, said[1] - ARM.home).any()


@pytest.mark.parametrize("late", [0, 3])
@pytest.mark.parametrize("over", [1, 25])
def test_a_velocity_is_the_difference_of_measured_positions(over, late):
    got = measured(secant_samples=over, delay=late * PERIOD, p_WE_noise=1e-4)
    at = slice(late + over, None)
    expected = (got.p_WE[at] - got.p_WE[late : COUNT - over]) / (over * PERIOD)
    np.testing.assert_allclose(got.v_WE[at], expected, rtol=1e-12, atol=1e-12)


def test_it_sees_the_axes_of_the_task():
    """A planar task sees the first two coordinates, with the noise that they have in space."""
    flat = measured(task="xy", p_WE_noise=1e-3, secant_samples=2)
    space = measured(p_WE_noise=1e-3, secant_samples=2)
    np.testing.assert_array_equal(flat.p_WE, space.p_WE[:, :2])
    np.testing.assert_array_equal(flat.v_WE, space.v_WE[:, :2])


def test_the_noise_turns_about_axes_of_the_world():
    """Rotation vectors of the noise do not depend on the posture: the same sample, two postures."""
    settings, at = SensingSettings(R_WE_noise=1e-2), []
    for q in (ARM.home, ARM.home + 0.3):
        sensor = PoseSensor(settings, KINEMATICS, "xyz", q, PERIOD)
        context = sensor.CreateDefaultContext()
        sensor.get_input_port().FixValue(context, q)
        R = sensor.GetOutputPort("R_WE").Eval(context).reshape(3, 3)
        at.append(rotation_error(KINEMATICS.R_WE(q), R))
    np.testing.assert_allclose(at[0], at[1], atol=1e-12)
    np.testing.assert_allclose(rotation_by(at[0]) @ KINEMATICS.R_WE(q), R, atol=1e-12)


def test_a_delay_between_two_samples_is_refused():
    settings = SensingSettings(p_WE_noise=0.0, delay=1.5e-3)
    with pytest.raises(InvalidInputError, match=r"sensing\.delay: must be a multiple of .*0\.001"):
        PoseSensor(settings, KINEMATICS, "xyz", ARM.home, PERIOD)


@pytest.mark.parametrize("key", ["p_WE_noise", "R_WE_noise"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-1e-4, "must be greater than or equal to 0, not -0.0001"),
        (2.0, "may be at most 1, not 2"),
        ([1e-4] * 3, "must be a "),
        (True, "must be a "),
    ],
)
def test_what_its_noise_cannot_be_is_refused_by_name(key, value, message):
    with pytest.raises(InvalidInputError, match=rf"{key}: {message}"):
        SensingSettings(**{key: value})
