"""The blocks of a camera: pixels of the true arm, noisy and late, and those that are desired."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import Circle, ImageSource, SensingSettings, ToolCamera, load_arm
from drake_rnn.features.camera import Camera

ARM = load_arm("panda")
KINEMATICS = ARM.kinematics()
PERIOD, COUNT = 1e-2, 60
SPEEDS = 0.1 * np.arange(1, ARM.n + 1)
POSTURES = ARM.home + np.outer(np.arange(COUNT) * PERIOD, SPEEDS)
PLACE = {"position": [1.6, 0.5, 0.9], "look_at": [0.5, 0.0, 0.6]}
OTHER = {"time": 0.3, "position": [1.4, -0.6, 0.8], "look_at": [0.5, 0.0, 0.6]}
POINTS = [[0.1, 0.0, 0.0], [-0.05, 0.08, 0.02]]
SWAPPED = ToolCamera(**PLACE, points=POINTS, swaps=[OTHER])


def true(camera, late=0):
    """Pixels of each sample; before the first one the arm rests at its start."""
    at = [max(k - late, 0) for k in range(COUNT)]
    poses = [(KINEMATICS.p_WE(POSTURES[k]), KINEMATICS.R_WE(POSTURES[k])) for k in at]
    return np.array([camera.pixels(k * PERIOD, *pose) for k, pose in zip(at, poses, strict=True)])


def seen(camera, seed=0, **settings):
    """What a sampled controller reads at each sample, while the joints move evenly."""
    ends = np.column_stack((ARM.home, ARM.home + 10.0 * SPEEDS))
    path = PiecewisePolynomial.FirstOrderHold([0.0, 10.0], ends)
    builder = DiagramBuilder()
    sensing = SensingSettings(**settings)
    block = builder.AddSystem(Camera(camera, sensing, ARM.kinematics(), ARM.home, PERIOD, seed))
    source = builder.AddSystem(TrajectorySource(path))
    builder.Connect(source.get_output_port(), block.get_input_port())
    reader = builder.AddSystem(ZeroOrderHold(PERIOD, camera.size))
    builder.Connect(block.get_output_port(), reader.get_input_port())
    simulator = Simulator(builder.Build())
    rows = []
    for k in range(COUNT):
        simulator.AdvanceTo((k + 0.5) * PERIOD)
        context = reader.GetMyContextFromRoot(simulator.get_context())
        rows.append(reader.get_output_port().Eval(context).copy())
    return np.array(rows)


def test_it_sees_the_points_by_the_camera_that_is_there():
    got = seen(SWAPPED)
    np.testing.assert_allclose(got, true(SWAPPED), rtol=0.0, atol=1e-9)
    # At 0.3 s the pixels leap; the arm itself moves them by a few.
    steps = np.abs(np.diff(got, axis=0)).max(axis=1)
    assert steps.argmax() == 29
    assert steps[29] > 10.0 * np.delete(steps, 29).max()


def test_a_late_picture_is_that_of_the_camera_of_its_time():
    np.testing.assert_allclose(
        seen(SWAPPED, delay=3 * PERIOD), true(SWAPPED, late=3), rtol=0.0, atol=1e-9
    )


def test_noise_is_that_of_the_seed_and_as_large_as_it_should_be():
    noisy = ToolCamera(**PLACE, points=POINTS, noise=0.2)
    errors = seen(noisy) - true(noisy)
    assert 0.16 < errors.std() < 0.24
    # Each coordinate errs by itself.
    assert abs(np.corrcoef(errors.T) - np.eye(4)).max() < 0.5
    np.testing.assert_array_equal(seen(noisy), seen(noisy))
    assert np.abs(seen(noisy, seed=1) - seen(noisy)).max() > 0.1


@pytest.mark.parametrize(("t", "now"), [(0.1, 0.1), (0.29, 0.29), (0.3, 0.3)])
def test_what_is_desired_ahead_is_as_the_camera_of_now_sees_it(t, now):
    """One sample before the swap nothing is known of the camera that comes."""
    path = Circle(plane="yz", size=0.05, period=2.0)
    placed = path.placed(KINEMATICS.p_WE(ARM.home), KINEMATICS.R_WE(ARM.home))
    source = ImageSource(placed, SWAPPED, PERIOD)
    context = source.CreateDefaultContext()
    context.SetTime(t)
    for name, ahead in (("pixels_desired", 0.0), ("pixels_preview", PERIOD)):
        p_WE, R_WE = placed.position(t + ahead)[0], placed.orientation(t + ahead)[0]
        expected = SWAPPED.at(now).project(SWAPPED.points_in_world(p_WE, R_WE)).ravel()
        got = source.GetOutputPort(name).Eval(context)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12)
