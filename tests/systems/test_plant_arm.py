"""An arm with mass: it holds, it presses, it slides, and it is not stronger than it is."""

import re

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.systems.analysis import Simulator

from drake_rnn import (
    Contact,
    ForceProfile,
    IdealArm,
    InvalidInputError,
    ModelSurface,
    PlantArm,
    PlantSettings,
    Plate,
    TipMaterial,
    load_arm,
    shipped_arms,
)
from drake_rnn.models import MODELS
from drake_rnn.systems.plant import motor_gains

UP = np.array([0.0, 0.0, 1.0])
RADIUS = 0.012
FORCE = ForceProfile(value=5.0)
IIWA = load_arm("iiwa14", frame="tip")


def with_tip(name):
    arm = load_arm(name)
    return arm.replace(frame=arm.tip)


class Driven:
    """A PlantArm told to stand still, or to move on at a constant velocity."""

    def __init__(self, arm, start, *plant):
        self.arm, self.body = arm, PlantArm(arm, start, *plant)
        self.simulator = Simulator(self.body)
        self.context = self.simulator.get_mutable_context()
        self.command(start, np.zeros(arm.n))

    def command(self, q, v):
        self.body.GetInputPort("position_commanded").FixValue(self.context, q)
        self.body.GetInputPort("velocity_commanded").FixValue(self.context, v)

    def after(self, t):
        self.simulator.AdvanceTo(t)
        return self

    def __getitem__(self, name):
        return self.body.GetOutputPort(name).Eval(self.context)

    @property
    def torque(self):
        plant = self.body.plant
        port = plant.get_net_actuation_output_port()
        return port.Eval(plant.GetMyContextFromRoot(self.context))

    @property
    def effort_limits(self):
        plant = self.body.plant
        motors = map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
        return np.array([motor.effort_limit() for motor in motors])


def pressed(depth, arm=IIWA, until=1.0, settings=None, **plate):
    """Told to stand where the tool is ``depth`` inside a plate."""
    contact = Contact(Plate(gap=-depth, **plate), FORCE)
    return Driven(arm, arm.home, contact, settings).after(until)


@pytest.mark.parametrize("name", shipped_arms())
def test_it_holds_its_posture_under_gravity(name):
    """Which would sag by g / stiffness, 0.4 to 1.3 mrad, if the motors did not know it."""
    arm = with_tip(name)
    driven = Driven(arm, arm.home).after(1.0)
    np.testing.assert_allclose(driven["position"], arm.home, atol=1e-9)
    np.testing.assert_allclose(driven["velocity"], 0.0, atol=1e-9)
    stiffness = motor_gains(arm, PlantSettings()).stiffness
    sag = np.abs(arm.kinematics().gravity(arm.home)) / stiffness
    assert sag.max() > 3e-4


@pytest.mark.parametrize(
    ("name", "time"), [("iiwa14", 1), ("panda", 1), ("ur5", 1), ("planar6", 3)]
)
def test_it_goes_where_it_is_told_and_stays_there(name, time):
    arm = with_tip(name)
    driven = Driven(arm, arm.home)
    driven.command(arm.home + 0.02, np.zeros(arm.n))
    np.testing.assert_allclose(driven.after(time)["position"], arm.home + 0.02, atol=1e-3)


def test_without_a_plate_there_is_no_force_to_ask_for():
    body = PlantArm(IIWA, IIWA.home)
    assert not any(body.HasOutputPort(name) for name in ("tool_force", "contact_force"))


def test_above_the_plate_there_is_no_force():
    """1e-9 N: the tool's weight is taken off."""
    driven = pressed(-1e-3)
    np.testing.assert_allclose(driven["tool_force"], 0.0, atol=1e-9)
    np.testing.assert_array_equal(driven["contact_force"], 0.0)


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
@pytest.mark.parametrize("normal", [pytest.param(UP, marks=pytest.mark.long), [0.3, 0.0, 1.0]])
def test_at_rest_the_sensor_feels_what_the_contact_knows(name, normal):
    driven = pressed(1e-3, with_tip(name), normal=normal)
    n = np.asarray(normal) / np.linalg.norm(normal)
    assert driven["contact_force"].dot(n) > 0.1
    np.testing.assert_allclose(driven["tool_force"], driven["contact_force"], atol=1e-3)


@pytest.mark.long
def test_the_deeper_it_is_told_to_be_the_harder_it_presses():
    forces = [pressed(depth)["contact_force"][2] for depth in (2e-4, 5e-4, 1e-3, 2e-3)]
    assert (np.diff(forces) > 0).all()
    # A ball on a plane: doubling the depth makes more than twice the force.
    assert forces[2] > 2 * forces[1]
    assert forces[3] > 2 * forces[2]


@pytest.mark.parametrize(
    "friction", [0.3, *(pytest.param(value, marks=pytest.mark.long) for value in (0.0, 0.1))]
)
def test_sliding_the_plate_pulls_by_friction_times_what_presses(friction):
    """And never more; 1 %: of Drake's regularised friction."""
    driven = pressed(1e-3, until=0.3, friction=friction)
    v = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    shares = []
    for k in range(50):
        driven.command(IIWA.home + v * k * 0.01, v)
        F = driven.after(0.3 + 0.01 * (k + 1))["contact_force"]
        assert F[2] > 0.1
        shares.append(np.hypot(*F[:2]) / F[2])
    assert max(shares) <= 1.01 * friction + 1e-9
    assert shares[-1] == pytest.approx(friction, rel=0.01, abs=1e-9)


@pytest.mark.long
def test_a_softer_ball_presses_less():
    forces = [
        pressed(1e-3, tip=TipMaterial(hydroelastic_modulus=modulus))["contact_force"][2]
        for modulus in (1e5, 3e5, 1e6, 1e7)
    ]
    assert (np.diff(forces) > 0).all()


@pytest.mark.long
def test_a_softer_plate_presses_less():
    forces = [
        pressed(1e-3, hydroelastic_modulus=modulus)["contact_force"][2] for modulus in (1e5, 1e6)
    ]
    forces.append(pressed(1e-3)["contact_force"][2])
    assert (np.diff(forces) > 0).all()


PAD = """<robot name="pad"><link name="pad"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0 0 -0.05"/><geometry><box size="0.4 0.4 0.1"/></geometry>{extra}
  </collision></link></robot>"""
RIGID = """<drake:proximity_properties><drake:rigid_hydroelastic/>
  </drake:proximity_properties>"""


@pytest.mark.parametrize("extra", [RIGID, pytest.param("", marks=pytest.mark.long)])
def test_a_model_is_pressed_like_a_plate(tmp_path, extra):
    """Also one without hydroelastic properties, which Drake treats as contact in a point."""
    file = tmp_path / "pad.urdf"
    xmlns = 'xmlns:drake="http://drake.mit.edu"'
    file.write_text(PAD.format(extra=extra).replace("<robot", f"<robot {xmlns}"))
    contact = Contact(ModelSurface(model=str(file), gap=-5e-4), FORCE)
    driven = Driven(IIWA, IIWA.home, contact).after(1.0)
    assert driven["contact_force"][2] > 0.05
    np.testing.assert_allclose(driven["tool_force"], driven["contact_force"], atol=1e-3)
    if extra:
        plate = pressed(5e-4)["contact_force"][2]
        assert driven["contact_force"][2] == pytest.approx(plate, rel=0.05)


@pytest.mark.parametrize("friction", [0.1, pytest.param(None, marks=pytest.mark.long)])
def test_friction_is_that_of_ball_and_model_both(tmp_path, friction):
    """Of 1 for the model and 0.3 for the ball Drake makes 2 * 0.3 * 1 / 1.3."""
    rough = RIGID.replace(
        "</drake", '<drake:mu_dynamic value="1"/><drake:mu_static value="1"/></drake'
    )
    file = tmp_path / "pad.urdf"
    xmlns = 'xmlns:drake="http://drake.mit.edu"'
    file.write_text(PAD.format(extra=rough).replace("<robot", f"<robot {xmlns}"))
    model = ModelSurface(model=str(file), friction=friction, gap=-1e-3)
    driven = Driven(IIWA, IIWA.home, Contact(model, FORCE)).after(0.3)
    v = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for k in range(50):
        driven.command(IIWA.home + v * k * 0.01, v)
        F = driven.after(0.3 + 0.01 * (k + 1))["contact_force"]
    expected = 0.6 / 1.3 if friction is None else friction
    assert np.hypot(*F[:2]) / F[2] == pytest.approx(expected, rel=0.01)


# One link, and a tool whose joint's frame may lie anywhere on it.
PENDULUM = """<sdf version="1.7" xmlns:drake="http://drake.mit.edu"><model name="pendulum">
<link name="base"/>
<joint name="foot" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="link"><pose>0 0 0.5 0 0 0</pose>{inertial}</link>
<joint name="hinge" type="revolute"><parent>base</parent><child>link</child><axis>
  <xyz>0 1 0</xyz><limit><lower>-3</lower><upper>3</upper><effort>100</effort></limit>
</axis></joint>
<link name="tool"><pose>0.3 0 0.5 0 0 0</pose>{inertial}<collision name="ball">
  <geometry><sphere><radius>0.02</radius></sphere></geometry></collision></link>
<joint name="weld" type="fixed"><pose>{pose}</pose>
  <parent>link</parent><child>tool</child></joint>
</model></sdf>""".replace(
    "{inertial}",
    "<inertial><mass>0.7</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia>"
    "</inertial>",
)


@pytest.mark.parametrize("pose", ["0 0 0 0 0 0", "0.05 0 0 0.4 1.2 0"])
def test_wherever_the_tools_joint_has_its_frame_a_tool_in_the_air_feels_nothing(tmp_path, pose):
    """Drake tells a reaction in the joint's frame, which need not be the tool's."""
    file = tmp_path / "pendulum.sdf"
    file.write_text(PENDULUM.format(pose=pose))
    arm = load_arm(str(file), frame="tool")
    q = np.array([0.2])
    # Its ball has a radius of 0.02 m.
    driven = Driven(arm, q, Contact(Plate(gap=0.08), FORCE)).after(1.0)
    np.testing.assert_allclose(driven["tool_force"], 0.0, atol=1e-6)


def rewritten(tmp_path, change):
    file = tmp_path / "iiwa.urdf"
    file.write_text(change((MODELS / "iiwa14" / "iiwa14.urdf").read_text()))
    return file


def without_motors(text):
    return re.sub(r"<transmission.*?</transmission>", "", text, flags=re.S)


def motors_reversed(text):
    motors = re.findall(r"<transmission.*?</transmission>", text, flags=re.S)
    return without_motors(text).replace("</robot>", "".join(reversed(motors)) + "</robot>")


@pytest.mark.parametrize("change", [str, without_motors, motors_reversed])
@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 5, 6], [3, 0, 6, 1, 2, 5, 4]])
def test_whatever_the_order_of_joints_and_motors_each_does_what_it_is_told(tmp_path, change, order):
    """In that of the arm's description; motors that the model lacks are added."""
    file = rewritten(tmp_path, change)
    joints = [IIWA.joints[i] for i in order]
    home = IIWA.home[order]
    arm = load_arm(file, frame="iiwa_link_ee", tool=IIWA.tool, joints=joints, home=home)
    driven = Driven(arm, home)
    goal = home + 0.02 * (1 + np.array(order))
    driven.command(goal, np.zeros(7))
    np.testing.assert_allclose(driven.after(1.0)["position"], goal, atol=1e-4)


def test_torques_end_at_the_effort_limits():
    """Told to be two radians farther at once, all but the last joint would need more."""
    driven = Driven(IIWA, IIWA.home)
    driven.command(IIWA.home + 2.0, np.zeros(7))
    most = np.max([np.abs(driven.after(0.005 * k).torque) for k in range(1, 20)], axis=0)
    limits = driven.effort_limits
    assert (most <= limits * (1 + 1e-9)).all()
    np.testing.assert_allclose(most[:6], limits[:6], rtol=1e-6)


def test_two_runs_are_the_same_to_the_last_bit():
    first, again = (pressed(1e-3, until=0.3, normal=[0.1, 0.0, 1.0]) for _ in range(2))
    for name in ("position", "velocity", "tool_force", "contact_force"):
        np.testing.assert_array_equal(first[name], again[name])


@pytest.mark.long
def test_drakes_ways_to_compute_contact_agree_at_rest():
    """``sap`` within 10 %: the joints creep while the tool sticks."""
    forces = [
        pressed(1e-3, settings=PlantSettings(contact_approximation=way))["contact_force"][2]
        for way in ("lagged", "similar", "sap")
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-3)
    assert forces[2] == pytest.approx(forces[0], rel=0.1)


def test_a_rotor_makes_an_arm_slower():
    light, heavy = (
        Driven(
            IIWA,
            IIWA.home,
            None,
            PlantSettings(stiffness=2000.0, damping=60.0, reflected_inertia=inertia),
        )
        for inertia in (0.0, 5.0)
    )
    for driven in (light, heavy):
        driven.command(IIWA.home + 0.02, np.zeros(7))
        driven.after(0.02)
    assert (np.abs(heavy["velocity"]) < np.abs(light["velocity"]))[[0, 4, 5, 6]].all()


def test_a_scaled_mass_is_refused():
    arm = IIWA.replace(mass_scale=1.5)
    with pytest.raises(
        InvalidInputError, match=r"arm\.mass_scale: must be 1 at level: dynamic, not 1\.5"
    ):
        PlantArm(arm, arm.home)


@pytest.mark.parametrize("standoff", [None, RADIUS])
def test_a_plate_without_a_tool_is_refused(standoff):
    """Also where it need not be asked how far the tool reaches."""
    flange = load_arm("iiwa14")
    with pytest.raises(InvalidInputError, match=r"arm\.frame: nothing that moves with"):
        PlantArm(flange, contact=Contact(Plate(standoff=standoff), FORCE))


def test_a_plate_that_nobody_presses_is_refused():
    with pytest.raises(InvalidInputError, match=r"contact: must be of class Contact .* not Plate"):
        PlantArm(IIWA, IIWA.home, Plate())


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
@pytest.mark.parametrize("normal", [UP, [0.3, 0.0, 1.0]])
def test_the_surface_is_a_gap_below_the_ball_at_the_start(name, normal):
    """1e-9 m: rounding."""
    arm, plate = with_tip(name), Plate(normal=normal, gap=0.03, thickness=0.02)
    q, n = arm.home + 0.1, plate.normal_W
    p_WE = arm.kinematics().p_WE(q)
    contact = Contact(plate, FORCE)
    np.testing.assert_allclose(contact.place(arm, q), p_WE - (0.03 + RADIUS) * n, atol=1e-9)
    inspector = PlantArm(arm, q, contact).scene_graph.model_inspector()
    (where,) = (
        inspector.GetPoseInFrame(geometry)
        for geometry in inspector.GetAllGeometryIds(Role.kProximity)
        if inspector.GetName(geometry).endswith("plate")
    )
    face = where.multiply(np.array([0.0, 0.0, 0.01]))
    np.testing.assert_allclose(face, p_WE - (0.03 + RADIUS) * n, atol=1e-9)


def test_it_starts_at_home_unless_it_is_told_another_posture():
    q = IIWA.home + 0.1
    for body, start in ((PlantArm(IIWA), IIWA.home), (PlantArm(IIWA, q), q)):
        context = body.CreateDefaultContext()
        np.testing.assert_allclose(body.GetOutputPort("position").Eval(context), start, atol=1e-15)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"time_step": 0.0}, "time_step"),
        ({"stiffness": 0.0}, "stiffness: must be greater than 0, not 0"),
        ({"stiffness": [1.0, -1.0]}, r"stiffness: must be greater than 0, not \[1\.0, -1\.0\]"),
        ({"stiffness": "hard"}, "stiffness: must be a number or a list of numbers, not 'hard'"),
        ({"stiffness": True}, "stiffness: must be a number or a list of numbers, not True"),
        ({"damping": -1.0}, "damping: must be greater than or equal to 0, not -1"),
        ({"damping": [-1.0]}, r"damping: must be greater than or equal to 0, not \[-1\.0\]"),
        ({"bandwidth": 0.0}, "bandwidth: must be greater than 0, not 0"),
        ({"bandwidth": 100.0, "stiffness": 1.0}, "bandwidth: cannot be combined with stiffness"),
        ({"reflected_inertia": -1.0}, "reflected_inertia"),
        ({"contact_approximation": "tamsi"}, "contact_approximation.*lagged"),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        PlantSettings(**fields)


def test_with_a_contact_all_three_axes_of_the_position_are_asked_for():
    body = PlantArm(load_arm("iiwa14").replace(frame="tip"), contact=Contact(Plate(), FORCE))
    with pytest.raises(InvalidInputError, match="task: may be xyz, pose with a contact, not xy"):
        body.check_task("xy")


def test_further_forces_act_on_an_arm_that_is_to_be_pushed():
    assert PlantArm(load_arm("panda"), takes_force=True).HasInputPort("applied_spatial_force")
    with pytest.raises(InvalidInputError, match="takes_force: only at level: dynamic"):
        IdealArm(load_arm("panda"), takes_force=True)
