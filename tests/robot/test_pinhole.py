"""Where points are in the image of a camera: as Drake has it, and how that changes."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from drake_rnn import CameraSwap, InvalidInputError, Pinhole, ToolCamera, load_arm

CAMERA = Pinhole(
    position=[1.6, 0.5, 0.9],
    look_at=[0.5, 0.1, 0.6],
    roll=0.4,
    focal_length=700.0,
    image_size=(800, 600),
    principal_point=(390.0, 310.0),
)
PANDA = load_arm("panda")
POINTS = [[0.1, 0.0, 0.0], [-0.05, 0.08, 0.02], [-0.05, -0.08, 0.04]]


def test_pixels_are_those_of_the_intrinsics_of_drake():
    """Its camera info has the matrix of the intrinsics, of an image's depth direction z."""
    info = CameraInfo(
        width=800, height=600, focal_x=700.0, focal_y=700.0, center_x=390.0, center_y=310.0
    )
    X_WC = RigidTransform(RotationMatrix(CAMERA.R_WC), CAMERA.position)
    rng = np.random.default_rng(0)
    for p_WP in CAMERA.look_at + rng.uniform(-0.3, 0.3, (20, 3)):
        seen = info.intrinsic_matrix() @ X_WC.inverse().multiply(p_WP)
        np.testing.assert_allclose(CAMERA.project(p_WP), seen[:2] / seen[2], rtol=0.0, atol=1e-9)


def test_it_looks_where_it_is_told_and_upright_unless_rolled():
    upright = Pinhole(position=[1.6, 0.5, 0.9], look_at=[0.5, 0.1, 0.6])
    np.testing.assert_allclose(upright.project(upright.look_at), [320.0, 240.0], atol=1e-9)
    above = upright.project(upright.look_at + np.array([0.0, 0.0, 0.1]))
    # Rows of an image count downwards.
    assert above[0] == pytest.approx(320.0)
    assert above[1] < 200.0
    assert np.linalg.det(upright.R_WC) == pytest.approx(1.0)


@pytest.mark.parametrize("height", [-1.0, 1.0])
def test_it_may_look_straight_down_or_up(height):
    camera = Pinhole(position=[0.5, 0.0, 0.5 + height], look_at=[0.5, 0.0, 0.5])
    np.testing.assert_allclose(camera.R_WC @ camera.R_WC.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(camera.project(camera.look_at), [320.0, 240.0], atol=1e-9)


def test_a_rolled_camera_turns_its_image_the_other_way():
    plain, rolled = (
        Pinhole(position=[1.6, 0.5, 0.9], look_at=[0.5, 0.1, 0.6], roll=roll) for roll in (0.0, 0.3)
    )
    p_WP = np.array([0.6, 0.2, 0.7])
    u, v = plain.project(p_WP) - plain.center
    c, s = np.cos(0.3), np.sin(0.3)
    turned = [c * u + s * v, c * v - s * u]
    np.testing.assert_allclose(rolled.project(p_WP) - rolled.center, turned, atol=1e-9)


def test_its_derivatives_are_those_of_differences():
    p_WP = np.array([[0.6, 0.2, 0.7], [0.4, -0.1, 0.5]])
    steps = 1e-6 * np.eye(3)
    differences = np.stack(
        [(CAMERA.project(p_WP + step) - CAMERA.project(p_WP - step)) / 2e-6 for step in steps],
        axis=-1,
    )
    np.testing.assert_allclose(CAMERA.J(p_WP), differences, rtol=1e-6, atol=1e-4)


def test_a_point_behind_a_camera_is_not_seen():
    with pytest.raises(InvalidInputError, match=r"camera: a point is -1 m in front of"):
        Pinhole(position=[0.0, 0.0, 0.0], look_at=[1.0, 0.0, 0.0]).project(
            np.array([-1.0, 0.0, 0.0])
        )


def test_a_point_out_of_the_image_is_told_from_its_margin():
    pixels = np.array([[10.0, 300.0], [400.0, 590.0], [-3.0, 20.0], [810.0, 300.0]])
    np.testing.assert_allclose(CAMERA.margin(pixels), [10.0, 10.0, -3.0, -10.0])


#: A camera on the tool, which sees points on the ground below it.
EYE = {"mount": "tool", "position": [0.06, 0.0, -0.05], "look_at": [0.0, 0.0, 0.3]}
BELOW = [[0.4, 0.1, 0.0], [0.22, -0.05, 0.05], [0.35, -0.12, 0.1]]


@pytest.mark.parametrize("points", [1, 2, 3])
@pytest.mark.parametrize("mount", ["world", "tool"])
def test_the_image_jacobian_is_that_of_differences(points, mount):
    """Of pixels of points that turn with the tool, or with the camera; of some 700 px/rad."""
    place = EYE if mount == "tool" else {"position": [1.6, 0.5, 0.9], "look_at": [0.5, 0, 0.6]}
    camera = ToolCamera(**place, points=(BELOW if mount == "tool" else POINTS)[:points])
    kinematics, q = PANDA.kinematics(), PANDA.home + 0.1

    def pixels(q):
        return camera.pixels(0.0, kinematics.p_WE(q), kinematics.R_WE(q))

    steps = 1e-6 * np.eye(PANDA.n)
    differences = np.stack([(pixels(q + e) - pixels(q - e)) / 2e-6 for e in steps], axis=-1)
    pose = kinematics.p_WE(q), kinematics.R_WE(q), kinematics.J_omega(q), kinematics.J(q)
    np.testing.assert_allclose(camera.tool_J(0.0, *pose), differences, rtol=0.0, atol=1e-3)


def test_a_camera_on_the_tool_sees_what_one_in_its_place_sees():
    """Where the tool is, a camera that stands there sees the same points of the world."""
    kinematics, q = PANDA.kinematics(), PANDA.home + 0.1
    p_WE, R_WE = kinematics.p_WE(q), kinematics.R_WE(q)
    eye = ToolCamera(**EYE, points=BELOW)
    stands = Pinhole(
        position=p_WE + R_WE @ eye.position, look_at=p_WE + R_WE @ eye.look_at, roll=0.0
    )
    # Of the same axis: both images differ by a turn about the principal point.
    seen, expected = eye.pixels(0.0, p_WE, R_WE).reshape(-1, 2), stands.project(np.array(BELOW))
    away = np.linalg.norm(seen - eye.center, axis=1)
    np.testing.assert_allclose(away, np.linalg.norm(expected - stands.center, axis=1), atol=1e-9)
    # Points and tool that move together are seen at the same pixels.
    shift = np.array([0.1, -0.2, 0.05])
    moved = ToolCamera(**EYE, points=(np.array(BELOW) + shift).tolist())
    np.testing.assert_allclose(moved.pixels(0.0, p_WE + shift, R_WE), seen.ravel(), atol=1e-9)


def test_a_camera_on_the_tool_needs_points():
    with pytest.raises(InvalidInputError, match=r"camera\.points: must be given with mount: tool"):
        ToolCamera(**EYE)


def test_each_camera_sees_in_its_time():
    swaps = [
        CameraSwap(time=time, position=[x, 0.5, 0.9], look_at=[0.5, 0, 0.6])
        for time, x in ((1.0, 1.5), (2.0, 1.4))
    ]
    camera = ToolCamera(position=[1.6, 0.5, 0.9], look_at=[0.5, 0, 0.6], swaps=swaps)
    seeing = [camera.at(t).position[0] for t in (0.0, 0.99, 1.0 - 1e-12, 1.0, 1.99, 2.0, 9.0)]
    assert seeing == [1.6, 1.6, 1.5, 1.5, 1.5, 1.4, 1.4]
    assert camera.swap_times == (1.0, 2.0)
