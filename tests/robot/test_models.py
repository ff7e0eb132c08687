"""The arms: are their models the robots that they say they are?"""

from __future__ import annotations

import math
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.geometry import Role, Sphere, VolumeMesh
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import load_arm
from drake_rnn.inputs.documents import read_yaml
from drake_rnn.robot.limits_file import LIMIT_UNITS

ARMS = ("panda", "fr3", "iiwa14", "ur5", "gen3", "puma560", "planar6")
LIMITS = ("position_lower", "position_upper", "velocity", "acceleration", "jerk", "effort")
ENVELOPE = ("envelope_offset", "envelope_deceleration")
PI = math.pi

# (a, d, alpha) of each joint.
PANDA_MODIFIED_DH = (
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -PI / 2),
    (0.0, 0.316, PI / 2),
    (0.0825, 0.0, PI / 2),
    (-0.0825, 0.384, -PI / 2),
    (0.0, 0.0, PI / 2),
    (0.088, 0.0, PI / 2),
)
PANDA_FLANGE = 0.107
IIWA14_DH = (
    (0.0, 0.36, -PI / 2),
    (0.0, 0.0, PI / 2),
    (0.0, 0.42, PI / 2),
    (0.0, 0.0, -PI / 2),
    (0.0, 0.40, -PI / 2),
    (0.0, 0.0, PI / 2),
    (0.0, 0.126, 0.0),
)
UR5_DH = (
    (0.0, 0.089159, PI / 2),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, 0.10915, PI / 2),
    (0.0, 0.09465, -PI / 2),
    (0.0, 0.0823, 0.0),
)
# Of the frames of the maker's description; theta of the last six begins at pi, the base looks down.
GEN3_DH = (
    (0.0, -(0.15643 + 0.12838), PI / 2),
    (0.0, -(0.005375 + 0.006375), PI / 2),
    (0.0, -(0.21038 + 0.21038), PI / 2),
    (0.0, -(0.006375 + 0.006375), PI / 2),
    (0.0, -(0.20843 + 0.10593), PI / 2),
    (0.0, -(0.00017505 + 0.00017505), PI / 2),
    (0.0, -(0.10593 + 0.061525), PI),
)
GEN3_THETA = np.array([0.0, PI, PI, PI, PI, PI, PI])
# The same in the User Guide.
GEN3_GUIDE_DH = (
    (0.0, -(0.1564 + 0.1284), PI / 2),
    (0.0, -(0.0054 + 0.0064), PI / 2),
    (0.0, -(0.2104 + 0.2104), PI / 2),
    (0.0, -(0.0064 + 0.0064), PI / 2),
    (0.0, -(0.2084 + 0.1059), PI / 2),
    (0.0, 0.0, PI / 2),
    (0.0, -(0.1059 + 0.0615), PI),
)
PUMA560_DH = (
    (0.0, 26.45 * 0.0254, PI / 2),
    (0.4318, 0.0, 0.0),
    (0.0203, 0.15005, -PI / 2),
    (0.0, 0.4318, PI / 2),
    (0.0, 0.0, -PI / 2),
    (0.0, 0.0, 0.0),
)
# Armstrong, Khatib and Burdick: base at the shoulder, joints 1 to 3 count from half a turn off.
PUMA560_AKB_MODIFIED_DH = (
    (0.0, 0.0, 0.0),
    (0.0, 0.2435, -PI / 2),
    (0.4318, -0.0934, 0.0),
    (-0.0203, 0.4331, PI / 2),
    (0.0, 0.0, -PI / 2),
    (0.0, 0.0, PI / 2),
)
PLANAR6_LENGTH = 0.2

PUBLISHED = {
    "panda": {
        "position_lower": [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        "position_upper": [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
        "velocity": [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61],
        "acceleration": [15, 7.5, 10, 12.5, 15, 20, 20],
        "jerk": [7500, 3750, 5000, 6250, 7500, 10000, 10000],
        "effort": [87, 87, 87, 87, 12, 12, 12],
    },
    "fr3": {
        "position_lower": [-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196],
        "position_upper": [2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196],
        "velocity": [2.6189, 2.6189, 2.6189, 2.6189, 5.2589, 4.1789, 5.2589],
        "acceleration": [9.999] * 7,
        "jerk": [4999.9] * 7,
        "envelope_offset": [0.3011, 0.2011, 0.2011, 0.3011, 0.3511, 0.3511, 0.3511],
        "envelope_deceleration": [6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0],
        "effort": [87, 87, 87, 87, 12, 12, 12],
    },
    "iiwa14": {
        "position_lower": np.radians([-170, -120, -170, -120, -170, -120, -175]),
        "position_upper": np.radians([170, 120, 170, 120, 170, 120, 175]),
        "velocity": np.radians([85, 85, 100, 75, 130, 135, 135]),
        "acceleration": [8.57, 8.57, 8.74, 11.36, 12.23, 15.72, 15.72],
        "jerk": None,
        "effort": [320, 320, 176, 176, 110, 40, 40],
    },
    "ur5": {
        "position_lower": np.radians([-360, -360, -180, -360, -360, -360]),
        "position_upper": np.radians([360, 360, 180, 360, 360, 360]),
        "velocity": np.radians([180] * 6),
        "acceleration": None,
        "jerk": None,
        "effort": [150, 150, 150, 28, 28, 28],
    },
    "gen3": {
        "position_lower": -np.radians([720, 128.9, 720, 147.8, 720, 120.3, 720]),
        "position_upper": np.radians([720, 128.9, 720, 147.8, 720, 120.3, 720]),
        "velocity": [1.3963, 1.3963, 1.3963, 1.3963, 1.2218, 1.2218, 1.2218],
        "acceleration": [5.2, 5.2, 5.2, 5.2, 10, 10, 10],
        "jerk": None,
        "effort": [39, 39, 39, 39, 9, 9, 9],
    },
    "puma560": {
        "position_lower": np.radians([-160, -45, -225, -110, -100, -266]),
        "position_upper": np.radians([160, 225, 45, 170, 100, 266]),
        "velocity": None,
        "acceleration": None,
        "jerk": None,
        "effort": None,
    },
    "planar6": {
        "position_lower": [-PI] * 6,
        "position_upper": [PI] * 6,
        "velocity": [3] * 6,
        "acceleration": None,
        "jerk": None,
        "effort": [200] * 6,
    },
}

HOME = {
    "panda": [0, -PI / 4, 0, -3 * PI / 4, 0, PI / 2, PI / 4],
    "fr3": [0, -PI / 4, 0, -3 * PI / 4, 0, PI / 2, PI / 4],
    "iiwa14": [0, 0.6, 0, -1.75, 0, 0.7916, 0],
    "ur5": [0, 3.6, 0.5, 0.5, 2, 0],
    "gen3": np.radians([0, 15, 180, -130, 0, 55, 90]),
    "puma560": np.radians([0, 45, -180, 0, 45, 0]),
    "planar6": [PI / 12] * 6,
}


loaded = cache(load_arm)


@pytest.fixture(params=ARMS)
def arm(request):
    return loaded(request.param)


def postures(arm, count=20):
    rng = np.random.default_rng(1)
    return rng.uniform(arm.limits.position_lower, arm.limits.position_upper, (count, arm.n))


def motions(arm, count=20):
    """Postures, each with a velocity of norm 1 rad/s."""
    velocities = np.random.default_rng(2).standard_normal((count, arm.n))
    velocities /= np.linalg.norm(velocities, axis=1, keepdims=True)
    return zip(postures(arm, count), velocities, strict=True)


def read_limits(arm):
    """limits.yaml as it stands, None where a limit is unpublished."""
    sheet = read_yaml(arm.model.parent / "limits.yaml")
    values = {key: entry["value"] for key, entry in sheet.items() if key != "joints"}
    return {key: None if value == "unpublished" else value for key, value in values.items()}


# Kinematics once more, from the tables of the makers.


def rotation(axis, angle):
    """A homogeneous rotation about x (0) or z (2)."""
    c, s = math.cos(angle), math.sin(angle)
    T = np.eye(4)
    i, j = {0: (1, 2), 2: (0, 1)}[axis]
    T[i, i], T[i, j], T[j, i], T[j, j] = c, -s, s, c
    return T


def translation(axis, distance):
    T = np.eye(4)
    T[axis, 3] = distance
    return T


def along_standard_dh(table, q, base):
    """Pose of the last frame, and the frames whose z axes the joints turn about."""
    T, joints = base, []
    for (a, d, alpha), angle in zip(table, q, strict=True):
        joints.append(T)
        T = T @ rotation(2, angle) @ translation(2, d) @ translation(0, a) @ rotation(0, alpha)
    return T, joints


def along_modified_dh(table, q, flange):
    T, joints = np.eye(4), []
    for (a, d, alpha), angle in zip(table, q, strict=True):
        T = T @ rotation(0, alpha) @ translation(0, a) @ rotation(2, angle) @ translation(2, d)
        joints.append(T)
    return T @ translation(2, flange), joints


def along_rods(length, q):
    T, joints = np.eye(4), []
    for angle in np.cumsum(q):
        origin = np.eye(4)
        origin[:3, 3] = T[:3, 3]
        joints.append(origin)
        T = rotation(2, angle)
        T[:2, 3] = origin[:2, 3] + length * np.array([math.cos(angle), math.sin(angle)])
    return T, joints


def closed_form(name, q):
    """Position, orientation, translational and angular Jacobian of the flange."""
    if name in ("panda", "fr3"):
        T, joints = along_modified_dh(PANDA_MODIFIED_DH, q, PANDA_FLANGE)
    elif name == "iiwa14":
        T, joints = along_standard_dh(IIWA14_DH, q, np.eye(4))
    elif name == "ur5":
        T, joints = along_standard_dh(UR5_DH, q, rotation(2, PI))
    elif name == "gen3":
        T, joints = along_standard_dh(GEN3_DH, q + GEN3_THETA, rotation(0, PI))
    elif name == "puma560":
        T, joints = along_standard_dh(PUMA560_DH, q, np.eye(4))
    else:
        T, joints = along_rods(PLANAR6_LENGTH, q)
    p, R = T[:3, 3], T[:3, :3]
    J_omega = np.column_stack([joint[:3, 2] for joint in joints])
    J = np.column_stack([np.cross(joint[:3, 2], p - joint[:3, 3]) for joint in joints])
    return p, R, J, J_omega


def test_flange_pose_follows_from_the_makers_dh_table(arm):
    """1e-12: rounding is 1e-15, and angles typed with 9 digits instead of 17 are off by 1e-9."""
    kinematics = arm.kinematics()
    for q in postures(arm):
        p, R, *_ = closed_form(arm.name, q)
        np.testing.assert_allclose(kinematics.p_WE(q), p, rtol=0, atol=1e-12)
        np.testing.assert_allclose(kinematics.R_WE(q), R, rtol=0, atol=1e-12)


def test_flange_jacobian_follows_from_the_makers_dh_table(arm):
    """1e-12: rounding is 1e-15, and angles typed with 9 digits instead of 17 are off by 1e-9."""
    kinematics = arm.kinematics()
    for q in postures(arm):
        _, _, J, J_omega = closed_form(arm.name, q)
        np.testing.assert_allclose(kinematics.J(q), J, rtol=0, atol=1e-12)
        np.testing.assert_allclose(kinematics.J_omega(q), J_omega, rtol=0, atol=1e-12)


def test_the_gen3_is_that_of_its_user_guide():
    """0.5 mm: the guide's numbers are rounded to 0.1 mm, and it leaves out 0.35 mm."""
    arm = load_arm("gen3")
    for q in postures(arm):
        T, _ = along_standard_dh(GEN3_GUIDE_DH, q + GEN3_THETA, rotation(0, PI))
        np.testing.assert_allclose(arm.kinematics().p_WE(q), T[:3, 3], rtol=0, atol=5e-4)


def test_the_puma_is_that_of_another_source():
    """1.5 mm: the two differ by 1.3 mm in the length of the forearm."""
    arm = load_arm("puma560")
    for q in postures(arm):
        turned = q + PI * np.array([1, 1, 1, 0, 0, 0])
        T, _ = along_modified_dh(PUMA560_AKB_MODIFIED_DH, turned, 0.0)
        p = T[:3, 3] + [0.0, 0.0, 26.45 * 0.0254]
        np.testing.assert_allclose(arm.kinematics().p_WE(q), p, rtol=0, atol=1.5e-3)


@pytest.mark.parametrize("name", ["panda", "fr3", "iiwa14", "ur5", "gen3"])
def test_ball_centre_lies_a_tenth_of_a_metre_before_the_flange(name):
    """Rounding alone: both frames are on one link."""
    flange, tip = load_arm(name).kinematics(), load_arm(name, frame="tip").kinematics()
    for q in postures(load_arm(name), 5):
        expected = flange.p_WE(q) + 0.1 * flange.R_WE(q)[:, 2]
        np.testing.assert_allclose(tip.p_WE(q), expected, rtol=0, atol=1e-14)


# Dynamics once more, from the same file by another library.


class Pinocchio:
    def __init__(self, arm):
        self.pin = pytest.importorskip("pinocchio")
        # Shapes are of no interest here, and URDF proper knows neither capsules nor drake: tags.
        robot = ElementTree.parse(arm.model).getroot()
        for link in robot.iter("link"):
            for shape in link.findall("visual") + link.findall("collision"):
                link.remove(shape)
        # Nor limits of which none is published.
        for limit in robot.iter("limit"):
            for name in ("velocity", "effort"):
                limit.set(name, limit.get(name, "1e9"))
        self.model = self.pin.buildModelFromXML(ElementTree.tostring(robot, encoding="unicode"))
        assert tuple(self.model.names)[1:] == arm.joints
        if arm.tool is not None:
            self.hold(arm.tool)
        self.model.gravity.linear = np.array(arm.gravity)
        self.data = self.model.createData()
        self.frame = self.model.getFrameId(arm.frame)

    def hold(self, tool):
        """The arm's file has no tool: its numbers are those of the description."""
        mount = self.model.frames[self.model.getFrameId(tool.mount)]
        middle = np.array([0.0, 0.0, tool.length / 2])
        inertia = self.pin.Inertia(tool.mass, middle, np.diag(tool.inertia))
        self.model.appendBodyToJoint(mount.parentJoint, inertia, mount.placement)

    def pose(self, q):
        self.pin.framesForwardKinematics(self.model, self.data, q)
        pose = self.data.oMf[self.frame]
        return pose.translation.copy(), pose.rotation.copy()

    def jacobians(self, q):
        J = self.pin.computeFrameJacobian(
            self.model, self.data, q, self.frame, self.pin.LOCAL_WORLD_ALIGNED
        )
        return J[:3], J[3:]

    def bias_acceleration(self, q, v):
        self.pin.forwardKinematics(self.model, self.data, q, v, np.zeros_like(v))
        return self.pin.getFrameClassicalAcceleration(
            self.model, self.data, self.frame, self.pin.LOCAL_WORLD_ALIGNED
        ).linear

    def mass_matrix(self, q):
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T

    def gravity(self, q):
        """The torques that gravity exerts; pinocchio's own are those that resist it."""
        return -self.pin.computeGeneralizedGravity(self.model, self.data, q)

    def bias(self, q, v):
        return self.pin.nonLinearEffects(self.model, self.data, q, v) + self.gravity(q)


def assert_close(actual, expected, relative=1e-9):
    """Relative to the largest entry, since an entry may be 0 by symmetry."""
    scale = np.abs(expected).max()
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * scale)


def test_pinocchio_places_and_moves_the_flange_alike(arm):
    """Same file, same numbers: 1e-12 leaves room for rounding only."""
    kinematics, pinocchio = arm.kinematics(), Pinocchio(arm)
    for q, v in motions(arm):
        for actual, expected in zip(
            (kinematics.p_WE(q), kinematics.R_WE(q), kinematics.J(q), kinematics.J_omega(q)),
            (*pinocchio.pose(q), *pinocchio.jacobians(q)),
            strict=True,
        ):
            np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12)
        expected = pinocchio.bias_acceleration(q, v)
        np.testing.assert_allclose(kinematics.Jdot_v(q, v), expected, rtol=0, atol=1e-12)


def test_pinocchio_finds_the_same_mass_matrix(arm):
    """Same file, same numbers: 1e-9 leaves room for rounding only."""
    kinematics, pinocchio = arm.kinematics(), Pinocchio(arm)
    for q in postures(arm):
        assert_close(kinematics.M(q), pinocchio.mass_matrix(q))


def test_pinocchio_finds_the_same_coriolis_and_centrifugal_torques(arm):
    """Same file, same numbers: 1e-9 leaves room for rounding only."""
    kinematics, pinocchio = arm.kinematics(), Pinocchio(arm)
    for q, v in motions(arm):
        assert_close(kinematics.bias(q, v), pinocchio.bias(q, v))


def test_pinocchio_finds_the_same_gravity_torques(arm):
    """Same file, same numbers: 1e-9 leaves room for rounding only."""
    kinematics, pinocchio = arm.kinematics(), Pinocchio(arm)
    for q in postures(arm):
        assert_close(kinematics.gravity(q), pinocchio.gravity(q))


# Derivatives are those of what they are said to derive.

STEP = 1e-5  # truncation about STEP^2/6 = 2e-11, rounding about 1e-16/STEP = 1e-11


def central_difference(function, q, direction):
    return (function(q + STEP * direction) - function(q - STEP * direction)) / (2 * STEP)


def test_jacobian_is_the_derivative_of_position(arm):
    """1e-9 m: some tens of the error of a central difference."""
    kinematics = arm.kinematics()
    for q in postures(arm):
        J = np.column_stack([central_difference(kinematics.p_WE, q, e) for e in np.eye(arm.n)])
        np.testing.assert_allclose(kinematics.J(q), J, rtol=0, atol=1e-9)


def test_angular_jacobian_is_the_derivative_of_orientation(arm):
    """1e-9: some tens of the error of a central difference."""
    kinematics = arm.kinematics()
    for q in postures(arm):
        for column, e in zip(kinematics.J_omega(q).T, np.eye(arm.n), strict=True):
            spin = central_difference(kinematics.R_WE, q, e) @ kinematics.R_WE(q).T
            omega = [spin[2, 1], spin[0, 2], spin[1, 0]]
            np.testing.assert_allclose(column, omega, rtol=0, atol=1e-9)


def test_bias_acceleration_is_the_change_of_the_jacobian_along_a_motion(arm):
    """1e-9 m/s^2: several times the error of a central difference, at 1 rad/s in all."""
    kinematics = arm.kinematics()
    for q, v in motions(arm):
        change = central_difference(lambda q, v=v: kinematics.J(q) @ v, q, v)
        np.testing.assert_allclose(kinematics.Jdot_v(q, v), change, rtol=0, atol=1e-9)


def test_gravity_torques_are_the_slope_of_potential_energy(arm):
    """1e-7 of the largest: the energy, some 100 J, rounds at 1e-14 J, so the slope at 1e-9."""
    kinematics, plant = arm.kinematics(), arm.plant()
    context = plant.CreateDefaultContext()

    def potential_energy(q):
        plant.SetPositions(context, q)
        return plant.CalcPotentialEnergy(context)

    for q in postures(arm, 5):
        slope = np.array([central_difference(potential_energy, q, e) for e in np.eye(arm.n)])
        assert_close(kinematics.gravity(q), -slope, relative=1e-7)


# Limits and posture.


def test_limits_sheet_gives_value_unit_and_source_of_every_limit(arm):
    sheet = read_yaml(arm.model.parent / "limits.yaml")
    assert tuple(sheet.pop("joints")) == arm.joints
    envelope = ENVELOPE if arm.name == "fr3" else ()
    assert set(sheet) == {*LIMITS, *envelope}
    for name, entry in sheet.items():
        assert set(entry) == {"value", "unit", "source"}
        assert entry["unit"] == LIMIT_UNITS[name]
        assert len(entry["source"]) > 20


def test_limits_are_the_published_ones_to_the_last_bit(arm):
    """Exact, since degrees are typed as radians with 17 digits."""
    for key, value in read_limits(arm).items():
        expected = PUBLISHED[arm.name][key]
        if expected is None:
            assert value is None, key
        else:
            np.testing.assert_array_equal(value, expected, err_msg=key)


def test_model_file_states_the_same_limits_as_the_sheet(arm):
    """Exact: both are typed from one source."""
    limits, plant = read_limits(arm), arm.plant()
    joints = [plant.GetJointByName(name) for name in arm.joints]
    stated = {
        "position_lower": [joint.position_lower_limits()[0] for joint in joints],
        "position_upper": [joint.position_upper_limits()[0] for joint in joints],
        "velocity": [joint.velocity_upper_limits()[0] for joint in joints],
        "acceleration": [joint.acceleration_upper_limits()[0] for joint in joints],
        "effort": [
            plant.GetJointActuatorByName(f"{name}_act").effort_limit() for name in arm.joints
        ],
    }
    for key, value in stated.items():
        expected = np.full(arm.n, np.inf) if limits[key] is None else limits[key]
        np.testing.assert_array_equal(value, expected, err_msg=key)


def test_unpublished_limits_are_said_to_be_missing(arm):
    for key in ("position_lower", "position_upper", "velocity", "acceleration", "jerk"):
        expected, value = PUBLISHED[arm.name][key], getattr(arm.limits, key)
        if expected is None:
            assert value is None or np.isinf(value).all(), key
        else:
            np.testing.assert_array_equal(value, expected, err_msg=key)


def test_home_posture_is_the_documented_one_and_strictly_inside_the_limits(arm):
    np.testing.assert_array_equal(arm.home, HOME[arm.name])
    assert (arm.home > arm.limits.position_lower).all()
    assert (arm.home < arm.limits.position_upper).all()


# Bodies and shapes.


@pytest.fixture
def scene(arm):
    """The arm's plant with geometry, and what inspects that geometry."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    arm.add_to(plant)
    plant.Finalize()
    diagram = builder.Build()
    yield plant, scene_graph.model_inspector()
    del diagram  # owns both until here


def test_every_body_has_a_mass_distribution_that_can_exist(arm):
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    for index in plant.GetBodyIndices(plant.GetModelInstanceByName(arm.name)):
        body = plant.get_body(index)
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        assert inertia.IsPhysicallyValid(), body.name()


def test_mass_matrix_is_positive_definite_even_at_the_wrist(arm):
    """1e-5 kg m^2: a lighter last joint would make contact runs stiff beyond use."""
    kinematics = arm.kinematics()
    assert min(np.linalg.eigvalsh(kinematics.M(q)).min() for q in postures(arm)) > 1e-5


def test_rods_of_the_planar_arm_are_thin_and_uniform():
    """Rounding alone: the chain bent straight is a rod of 1.2 m and 30 kg about its end."""
    arm = load_arm("planar6")
    straight = np.zeros(6)
    inertia = arm.kinematics().M(straight)[0, 0]
    assert inertia == pytest.approx(30 * 1.2**2 / 3, rel=1e-14)
    weight = arm.kinematics().gravity(straight)[0]
    assert weight == pytest.approx(-30 * 9.81 * 0.6, rel=1e-14)


def test_only_a_compliant_hydroelastic_ball_at_the_tip_collides(arm, scene):
    plant, inspector = scene
    (ball,) = inspector.GetAllGeometryIds(Role.kProximity)
    shape = inspector.GetShape(ball)
    assert isinstance(shape, Sphere)
    assert shape.radius() == 0.012
    # A compliant body is meshed throughout, a rigid one on its surface.
    assert isinstance(inspector.maybe_get_hydroelastic_mesh(ball), VolumeMesh)
    properties = inspector.GetProximityProperties(ball)
    assert properties.GetProperty("hydroelastic", "hydroelastic_modulus") == 1e6
    assert properties.GetProperty("hydroelastic", "resolution_hint") == 0.005
    context = plant.CreateDefaultContext()
    body = plant.GetBodyFromFrameId(inspector.GetFrameId(ball))
    centre = body.EvalPoseInWorld(context) @ inspector.GetPoseInFrame(ball).translation()
    tip = plant.GetFrameByName("tip").CalcPoseInWorld(context).translation()
    np.testing.assert_allclose(centre, tip, rtol=0, atol=1e-15)


def test_every_body_with_mass_can_be_seen(arm, scene):
    plant, inspector = scene
    for index in plant.GetBodyIndices(plant.GetModelInstanceByName(arm.name)):
        body = plant.get_body(index)
        frame = plant.GetBodyFrameIdOrThrow(index)
        shapes = inspector.GetGeometries(frame, Role.kIllustration)
        assert shapes or body.default_mass() == 0, body.name()


def test_every_joint_can_be_driven(arm):
    plant = arm.plant()
    assert plant.num_actuators() == plant.num_positions() == arm.n


def test_models_are_found_by_their_package_name():
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    folder = load_arm("ur5").model.parents[1]
    parser.package_map().AddPackageXml(str(folder / "package.xml"))
    for name in ARMS:
        assert parser.AddModelsFromUrl(f"package://drake_rnn_models/{name}/{name}.urdf")
