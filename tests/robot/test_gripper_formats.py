"""Grippers and arms of other formats than URDF, which are joined with others."""

import math

import numpy as np
import pytest
import yaml
from pydrake.geometry import Role, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from typer.testing import CliRunner

from drake_rnn import InvalidInputError, arm_clearance, load_arm
from drake_rnn.cli.commands import app
from drake_rnn.robot.model.model import in_urdf, quiet_drake, read_model

# A tetrahedron.
MESH = "v 0 0 0\nv .03 0 0\nv 0 .02 0\nv 0 0 .04\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
INERTIA = {"ixx": 1e-3, "iyy": 2e-3, "izz": 1.5e-3, "ixy": 1e-4, "ixz": -2e-4, "iyz": 5e-5}


def urdf() -> str:
    moments = " ".join(f'{name}="{value}"' for name, value in INERTIA.items())
    thin = 'ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"'
    finger = f'<inertial><origin xyz="0 0 .02"/><mass value=".05"/><inertia {thin}/></inertial>'
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    return f"""<robot name="hand"><link name="hand">
  <inertial><origin xyz="0 .01 .03"/><mass value=".6"/><inertia {moments}/></inertial>
  <visual><origin xyz="0 0 .03"/><geometry><box size=".2 .05 .06"/></geometry>{red}</visual>
  <collision><origin xyz="0 0 .03"/><geometry><box size=".2 .05 .06"/></geometry></collision>
</link><link name="left">{finger}
  <visual><geometry><mesh filename="tip.obj" scale="1 2 1"/></geometry>{red}</visual>
  <collision><geometry><mesh filename="tip.obj" scale="1 2 1"/></geometry></collision>
</link><link name="right">{finger}
  <visual><origin xyz="0 0 .03"/>
    <geometry><drake:capsule radius=".01" length=".04"/></geometry>{red}</visual>
  <collision><origin xyz="0 0 .03"/>
    <geometry><drake:capsule radius=".01" length=".04"/></geometry></collision>
</link><link name="between"/>
<joint name="opens" type="prismatic"><parent link="hand"/><child link="left"/>
  <origin xyz="0 0 .06"/><axis xyz="1 0 0"/><dynamics damping="2"/>
  <limit lower="0" upper=".05" effort="20"/></joint>
<joint name="follows" type="revolute"><parent link="hand"/><child link="right"/>
  <origin xyz="0 .02 .06" rpy="0 0 3"/><axis xyz="0 1 0"/>
  <limit lower="0" upper=".5" effort="20"/><mimic joint="opens" multiplier="8"/></joint>
<joint name="at_between" type="fixed"><parent link="hand"/><child link="between"/>
  <origin xyz="0 0 .1"/></joint></robot>"""


def sdf() -> str:
    def inertial(z: float, mass: float, y: float = 0.0, **moments: float) -> str:
        text = "".join(f"<{name}>{value}</{name}>" for name, value in moments.items())
        return (
            f"<inertial><pose>0 {y} {z} 0 0 0</pose><mass>{mass}</mass>"
            f"<inertia>{text}</inertia></inertial>"
        )

    def shapes(geometry: str, z: float = 0.0) -> str:
        inside = f"<pose>0 0 {z} 0 0 0</pose><geometry>{geometry}</geometry>"
        red = "<material><diffuse>1 0 0 1</diffuse></material>"
        return f'<visual name="v">{inside}{red}</visual><collision name="c">{inside}</collision>'

    def joint(name: str, kind: str, child: str, axis: str, upper: float, rest: str = "") -> str:
        return (
            f'<joint name="{name}" type="{kind}"><parent>hand</parent><child>{child}</child>'
            f"<axis><xyz>{axis}</xyz><limit><lower>0</lower><upper>{upper}</upper>"
            f"<effort>20</effort></limit>{rest}</axis></joint>"
        )

    finger = inertial(0.02, 0.05, ixx=1e-5, iyy=1e-5, izz=1e-5)
    capsule = "<capsule><radius>.01</radius><length>.04</length></capsule>"
    mesh = "<mesh><uri>tip.obj</uri><scale>1 2 1</scale></mesh>"
    follows = '<mimic joint="opens"><multiplier>8</multiplier><offset>0</offset></mimic>'
    follows = follows.replace("</offset>", "</offset><reference>0</reference>")
    damping = "<dynamics><damping>2</damping></dynamics>"
    return f"""<sdf version="1.11"><model name="hand">
<link name="hand">{inertial(0.03, 0.6, 0.01, **INERTIA)}
  {shapes("<box><size>.2 .05 .06</size></box>", 0.03)}</link>
<link name="left"><pose>0 0 .06 0 0 0</pose>{finger}{shapes(mesh)}</link>
<link name="right"><pose>0 .02 .06 0 0 3</pose>{finger}{shapes(capsule, 0.03)}</link>
{joint("opens", "prismatic", "left", "1 0 0", 0.05, damping)}
{joint("follows", "revolute", "right", "0 1 0", 0.5, follows)}
<frame name="between" attached_to="hand"><pose>0 0 .1 0 0 0</pose></frame></model></sdf>"""


def mjcf(top: str = "", first: str = "", kind: str = "hinge") -> str:
    order = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    moments = " ".join(str(INERTIA[name]) for name in order)
    finger = '<inertial pos="0 0 .02" mass=".05" diaginertia="1e-5 1e-5 1e-5"/>'
    half = 1.5
    turned = f"{math.cos(half)!r} 0 0 {math.sin(half)!r}"
    limits = "" if kind == "ball" else 'axis="0 1 0" range="0 .5"'
    return f"""<mujoco model="hand"><compiler angle="radian"/>
<default><geom rgba="1 0 0 1"/></default>
<asset><mesh name="tip" file="tip.obj" scale="1 2 1"/></asset>
<worldbody>{top}<body name="hand">{first}
  <inertial pos="0 .01 .03" mass=".6" fullinertia="{moments}"/>
  <geom type="box" pos="0 0 .03" size=".1 .025 .03"/><site name="between" pos="0 0 .1"/>
  <body name="left" pos="0 0 .06">{finger}
    <joint name="opens" type="slide" axis="1 0 0" range="0 .05" damping="2"/>
    <geom type="mesh" mesh="tip"/></body>
  <body name="right" pos="0 .02 .06" quat="{turned}">{finger}
    <joint name="follows" type="{kind}" {limits}/>
    <geom type="capsule" pos="0 0 .03" size=".01 .02"/></body>
</body></worldbody>
<equality><joint joint1="follows" joint2="opens" polycoef="0 8 0 0 0"/></equality>
<actuator><motor joint="opens" ctrllimited="true" ctrlrange="-20 20"/>
  <motor joint="follows" ctrllimited="true" ctrlrange="-20 20"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def hands(tmp_path_factory):
    """The files of one gripper, by format."""
    folder = tmp_path_factory.mktemp("hands")
    (folder / "tip.obj").write_text(MESH)
    files = {}
    for ending, text in (("urdf", urdf()), ("sdf", sdf()), ("xml", mjcf())):
        files[ending] = folder / f"hand.{ending}"
        files[ending].write_text(text)
    return files


def held(hand, arm="ur5", **changes):
    """An arm with a gripper, whose fingers are open by 3 cm."""
    settings = {"model": str(hand), "frame": "between", "lock": {"opens": 0.03}, **changes}
    place = {"translation": [0, 0.01, 0.02], "rpy": [0.1, 0, 0.5]}
    return load_arm(arm, frame="tool0", gripper={**place, **settings})


def bodies(plant):
    """Inertia, and pose at three postures, of each body of a gripper."""
    context, found = plant.CreateDefaultContext(), {}
    for name in ("hand", "left", "right"):
        body = plant.GetBodyByName(f"gripper_{name}")
        rows = [body.default_spatial_inertia().CopyToFullMatrix6()]
        for q in np.random.default_rng(1).uniform(-2, 2, (3, plant.num_positions())):
            plant.SetPositions(context, q)
            rows.append(body.EvalPoseInWorld(context).GetAsMatrix34())
        found[name] = np.vstack([row.ravel()[:, None] for row in rows])
    return found


def shapes(arm, role):
    """The shapes of a gripper: of which body and kind; pose, size and colour."""
    plant, scene_graph, found = MultibodyPlant(0.0), SceneGraph(), []
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_shapes_to(plant) if role == Role.kProximity else arm.add_to(plant)
    inspector = scene_graph.model_inspector()
    for name in ("hand", "left", "right"):
        frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(f"gripper_{name}").index())
        for geometry in inspector.GetGeometries(frame, role):
            shape = inspector.GetShape(geometry)
            kind = str(shape).split("(")[0].replace("Mesh", "Convex")
            box = inspector.GetObbInGeometryFrame(geometry)
            corner = () if box is None else np.abs(box.half_width()).tolist()
            X = inspector.GetPoseInFrame(geometry).GetAsMatrix34()
            colour = ()
            if role == Role.kIllustration:
                colour = inspector.GetProperties(geometry, role).GetProperty("phong", "diffuse")
                colour = colour.rgba.tolist()
            found.append((name, kind, np.array([*np.ravel(X), *corner, *colour])))
    del plant
    return found


@pytest.fixture(scope="module")
def grips(hands):
    """The same arm with the gripper of each format."""
    return {ending: held(file) for ending, file in hands.items()}


@pytest.mark.parametrize("ending", ["sdf", "xml"])
def test_a_gripper_moves_and_weighs_the_same_in_each_format(grips, ending):
    one, other = grips["urdf"], grips[ending]
    assert (other.frame, other.joints) == (one.frame, one.joints)
    first, second = bodies(one.plant()), bodies(other.plant())
    for name, rows in first.items():
        np.testing.assert_allclose(second[name], rows, rtol=0, atol=1e-12)
    kinematics = one.kinematics(), other.kinematics()
    for q in np.random.default_rng(0).uniform(-2, 2, (3, 6)):
        for of in ("p_WE", "R_WE", "M", "gravity"):
            values = [np.asarray(vars(type(each))[of](each, q)) for each in kinematics]
            np.testing.assert_allclose(*values, rtol=0, atol=1e-9)


@pytest.mark.parametrize("ending", ["sdf", "xml"])
def test_a_gripper_has_the_same_shapes_in_each_format(grips, ending):
    """Those that are drawn, those of distances, and the capsules about them."""
    one, other = grips["urdf"], grips[ending]
    for role in (Role.kIllustration, Role.kProximity):
        for mine, its in zip(shapes(one, role), shapes(other, role), strict=True):
            assert its[:2] == mine[:2]
            np.testing.assert_allclose(its[2], mine[2], rtol=0, atol=1e-9)
    gaps = [arm_clearance(arm, [], one.home)[0].gaps(one.home) for arm in (one, other)]
    np.testing.assert_allclose(*gaps, rtol=0, atol=1e-9)


@pytest.mark.parametrize("ending", ["sdf", "xml"])
def test_fingers_have_the_same_limits_and_damping_in_each_format(grips, ending):
    one, other = grips["urdf"].gripper_plant, grips[ending].gripper_plant
    for name in ("gripper_opens", "gripper_follows"):
        same = [plant.GetJointByName(name) for plant in (one, other)]
        for of in ("position_lower_limit", "position_upper_limit", "default_damping"):
            mine, its = (vars(type(joint))[of](joint) for joint in same)
            assert its == pytest.approx(mine, abs=1e-12)
        efforts = [
            next(
                motor.effort_limit()
                for motor in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
                if motor.joint().name() == name
            )
            for plant in (one, other)
        ]
        assert efforts == [20.0, 20.0]


# An arm of two joints in other formats, whose second joint is not where its link is.
ARM_XML = """<mujoco model="two"><worldbody><body name="base" pos="0 0 .3">
<body name="upper" pos="0 0 .1" euler="0 30 0"><inertial pos="0 .1 .2" mass="2"
    fullinertia=".1 .2 .15 .01 .02 .03"/>
  <joint name="a" axis="0 1 0" range="-100 100" damping=".5"/>
  <body name="lower" pos="0 0 .4"><inertial pos="0 .1 .2" mass="1" diaginertia=".1 .1 .1"/>
    <joint name="b" axis="1 0 1" pos=".05 0 0" range="-100 100"/>
    <geom type="capsule" size=".04 .1" pos="0 0 .2" contype="0" conaffinity="0"/>
    <body name="tool0" pos="0 0 .4" quat=".9 .1 .2 .3"/></body></body></body></worldbody></mujoco>
"""
ARM_SDF = """<sdf version="1.8"><model name="two">
<link name="base"><pose>0 0 .3 0 0 0</pose></link>
<link name="upper"><pose>0 0 .4 .2 .5 0</pose><inertial><pose>0 .1 .2 .1 .2 .3</pose>
  <mass>2</mass><inertia><ixx>.1</ixx><iyy>.2</iyy><izz>.15</izz><ixy>.01</ixy></inertia>
</inertial></link>
<link name="tool0"><pose>.1 0 .9 .3 1.2 .4</pose><inertial><mass>1</mass>
  <inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz></inertia></inertial></link>
<joint name="a" type="revolute"><parent>base</parent><child>upper</child>
  <axis><xyz>0 1 0</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint>
<joint name="b" type="prismatic"><pose>.1 0 -.2 .3 .1 0</pose><parent>upper</parent>
  <child>tool0</child><axis><xyz>1 0 1</xyz>
  <limit><lower>-2</lower><upper>2</upper></limit></axis></joint></model></sdf>
"""
ARMS = {"xml": ARM_XML, "sdf": ARM_SDF}


def own_plant(*files, welds=()):
    """A plant of models as Drake reads them, their bases welded as stated."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    models = []
    for file in files:
        with quiet_drake(50):
            models += parser.AddModels(str(file))
    for one, frame, two, base, X in welds:
        first = plant.world_frame() if one is None else plant.GetFrameByName(frame, models[one])
        plant.WeldFrames(first, plant.GetFrameByName(base, models[two]), X)
    for constraint in plant.GetConstraintIds():
        plant.RemoveConstraint(constraint)
    plant.Finalize()
    return plant


def matrices(plant, names, q):
    """Mass matrix and gravity of joints, by name."""
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in names]
    positions = np.zeros(plant.num_positions())
    positions[[joint.position_start() for joint in joints]] = q
    plant.SetPositions(context, positions)
    order = [joint.velocity_start() for joint in joints]
    M = plant.CalcMassMatrix(context)[np.ix_(order, order)]
    return np.vstack((M, plant.CalcGravityGeneralizedForces(context)[order]))


@pytest.mark.parametrize("ending", ["xml", "sdf"])
def test_an_arm_of_another_format_carries_a_gripper_as_drake_welds_it(ending, hands, tmp_path):
    file = tmp_path / f"arm.{ending}"
    file.write_text(ARMS[ending])
    arm = held(hands["urdf"], file, lock={})
    X = RigidTransform(RollPitchYaw(0.1, 0, 0.5), [0, 0.01, 0.02])
    welds = [(0, "tool0", 1, "hand", X)]
    if ending == "sdf":
        welds.append((None, "", 0, "base", RigidTransform([0, 0, 0.3])))
    bare = hands["urdf"].with_name("bare.urdf")
    bare.write_text(
        hands["urdf"]
        .read_text()
        .replace("<mesh", "<box size='1 1 1'/><!--")
        .replace('scale="1 2 1"/>', "-->")
    )
    plant = own_plant(file, bare, welds=welds)
    for q in np.random.default_rng(2).uniform(-1, 1, (3, 4)):
        one = matrices(plant, ("a", "b", "opens", "follows"), q)
        same = matrices(arm.gripper_plant, ("a", "b", "gripper_opens", "gripper_follows"), q)
        np.testing.assert_allclose(same, one, rtol=0, atol=1e-9)
        assert np.abs(one).max() > 1.0


def test_a_pair_of_an_arm_in_mjcf_and_one_in_urdf_is_as_each_alone(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(ARM_XML)
    one, other = load_arm(file, frame="tool0"), load_arm("ur5")
    base = {"translation": [0.9, 0.1, 0.05], "rpy": [0.1, -0.2, 3.0]}
    pairs = (
        (one, other, load_arm(file, frame="tool0", pair={"arm": "ur5", "base": base})),
        (
            other,
            one,
            load_arm("ur5", pair={"arm": {"model": str(file), "frame": "tool0"}, "base": base}),
        ),
    )
    X_AB = RigidTransform(RollPitchYaw(base["rpy"]), base["translation"])
    for first, second, pair in pairs:
        q = np.linspace(-0.8, 0.7, 8)
        plant = pair.plant()
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, q)
        for arm, name, part, X_WA in (
            (first, first.frame, q[: first.n], RigidTransform()),
            (second, f"second_{second.frame}", q[first.n :], X_AB),
        ):
            X = plant.GetFrameByName(name).CalcPoseInWorld(context)
            kinematics = arm.kinematics()
            np.testing.assert_allclose(X.translation(), X_WA @ kinematics.p_WE(part), atol=1e-12)
        M = plant.CalcMassMatrix(context)
        n = first.n
        np.testing.assert_allclose(M[:n, :n], first.kinematics().M(q[:n]), rtol=0, atol=1e-9)
        np.testing.assert_allclose(M[n:, n:], second.kinematics().M(q[n:]), rtol=0, atol=1e-9)
        np.testing.assert_array_equal(M[:n, n:], 0.0)


def test_links_of_a_model_in_mjcf_are_displaced_by_what_is_drawn(tmp_path):
    """By up to 2 mm at each of two joints, and the other axes stay straight."""
    (tmp_path / "arm.xml").write_text(ARM_XML)
    arm = load_arm(tmp_path / "arm.xml", frame="tool0")
    errors = {"seed": 1, "translation": 0.002, "rotation": 0.0}
    moved = arm.replace(link_errors=errors)
    q = np.array([0.3, -0.4])
    far = np.linalg.norm(moved.kinematics().p_WE(q) - arm.kinematics().p_WE(q))
    assert 1e-4 < far < 2 * np.sqrt(3) * 0.002
    np.testing.assert_allclose(moved.kinematics().R_WE(q), arm.kinematics().R_WE(q), atol=1e-12)


@pytest.mark.parametrize(
    ("ending", "text", "message"),
    [
        ("xml", mjcf(first="<freejoint/>", top='<body name="other"/>'),
         r"arm\.gripper: hand.xml must have one base, not 2: "),
        ("sdf", sdf().replace("</model>", '<link name="other"/></model>'),
         r"arm\.gripper: hand.sdf must have one base, not 2: hand, other"),
        ("xml", mjcf(kind="ball"),
         r"arm\.gripper: hand.xml: its joint 'follows' is ball_rpy; it may be revolute, "),
        ("sdf", sdf().replace("</model>", '<model name="in"><link name="x"/></model></model>'),
         r"arm\.gripper\.model: .*hand.sdf holds 2 models"),
        ("xml", "<mujoco><worldbody><body></worldbody></mujoco>",
         r"arm\.gripper\.model: .*hand.xml cannot be read"),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_refused_by_its_key(ending, text, message, tmp_path):
    (tmp_path / "tip.obj").write_text(MESH)
    (tmp_path / f"hand.{ending}").write_text(text)
    with pytest.raises(InvalidInputError, match="^" + message):
        held(tmp_path / f"hand.{ending}")


def test_a_link_that_is_none_is_refused(hands):
    with pytest.raises(InvalidInputError, match=r"^arm\.gripper\.mount: no link 'flange'"):
        held(hands["xml"], mount="flange")


def test_a_base_that_floats_stands_where_the_file_places_it(hands, grips):
    """As in an arm by itself; that it does not float here is said, and so is a floor left out."""
    floor = '<geom type="plane" size="1 1 1"/>'
    floats = hands["xml"].with_name("floats.xml")
    floats.write_text(mjcf(first="<freejoint/>", top=floor))
    arm = held(floats)
    first, second = bodies(grips["urdf"].plant()), bodies(arm.plant())
    np.testing.assert_allclose(second["right"], first["right"], rtol=0, atol=1e-12)
    told = [warning for warning in arm.warnings if "floats.xml" in warning]
    assert told[-2:] == [
        "arm.gripper: floats.xml: shapes that no body has, such as a floor, are left out",
        "arm.gripper: floats.xml: bodies that float are fixed where the file has them: hand",
    ]


def test_a_frame_that_carries_a_joint_in_sdf_is_a_frame_still(hands):
    """Its finger is where it was, and the frame where the joint is."""
    file = hands["sdf"].with_name("frame.sdf")
    text = hands["sdf"].read_text()
    old = '<joint name="opens" type="prismatic"><parent>hand</parent>'
    assert old in text
    frame = '<frame name="rail" attached_to="hand"><pose>0 0 .06 0 0 0</pose></frame>'
    file.write_text(text.replace(old, frame + old.replace("hand<", "rail<")))
    plant = held(file, frame="rail").gripper_plant
    context = plant.CreateDefaultContext()
    hand = plant.GetFrameByName("gripper_hand")
    for name in ("rail", "left"):
        X = plant.GetFrameByName(f"gripper_{name}").CalcPose(context, hand)
        np.testing.assert_allclose(X.translation(), [0, 0, 0.06], atol=1e-12)


CONTACT = """<sdf version="1.8"><model name="m"><link name="a">
<visual name="v"><geometry><sphere><radius>.1</radius></sphere></geometry>
  <material><drake:diffuse_map>look.png</drake:diffuse_map></material></visual>
<collision name="c"><geometry><sphere><radius>.1</radius></sphere></geometry>
<drake:proximity_properties><drake:rigid_hydroelastic/>
  <drake:mesh_resolution_hint>.02</drake:mesh_resolution_hint><drake:mu_dynamic>.3</drake:mu_dynamic>
  <drake:mu_static>.4</drake:mu_static></drake:proximity_properties></collision>
<collision name="d"><geometry><box><size>.1 .2 .3</size></box></geometry>
<drake:proximity_properties><drake:compliant_hydroelastic/>
  <drake:hydroelastic_modulus>1e6</drake:hydroelastic_modulus>
  <drake:hunt_crossley_dissipation>2</drake:hunt_crossley_dissipation>
</drake:proximity_properties></collision></link></model></sdf>"""


def test_contacts_and_textures_of_a_body_are_the_same_in_urdf(tmp_path):
    (tmp_path / "look.png").write_bytes(b"")
    (tmp_path / "body.sdf").write_text(CONTACT)
    model, found = read_model(tmp_path / "body.sdf", {}), []
    for each in (model, in_urdf(model)):
        plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        each.add_to(plant)
        plant.Finalize()
        inspector, known = scene_graph.model_inspector(), []
        for geometry in inspector.GetAllGeometryIds(Role.kProximity):
            properties = inspector.GetProximityProperties(geometry)
            friction = properties.GetProperty("material", "coulomb_friction")
            known.append([friction.static_friction(), friction.dynamic_friction()])
            for group in sorted(properties.GetGroupNames()):
                for name, value in sorted(properties.GetPropertiesInGroup(group).items()):
                    known.append((group, name))
                    if name not in {"compliance_type", "coulomb_friction"}:
                        known.append(value.get_value())
        for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
            looks = inspector.GetIllustrationProperties(geometry)
            known.append(looks.GetProperty("phong", "diffuse_map"))
        found.append(known)
        del plant
    assert found[1] == found[0]
    assert found[0][-1] == str(tmp_path / "look.png")


def command(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.long
def test_fingers_of_a_gripper_in_mjcf_move_at_goals(hands, tmp_path):
    document = {
        "arm": {"model": "ur5", "gripper": {"model": str(hands["xml"]), "frame": "between"}},
        "law": {"kind": "joint_stream", "avoidance": {"approach": 50.0}},
        "goals": [{"q": [0.1, -1.5, 1.5, 0, 0.5, 0], "opening": {"opens": 0.03}}],
        "start": [0, -1.5, 1.5, 0, 0.5, 0],
        "limits": {"velocity": 1.5, "acceleration": 6.0, "jerk": 200.0},
        "obstacles": [{"kind": "ball", "center": [2, 0, 0], "radius": 0.1}],
        "period": 4e-3,
        "duration": 2.0,
    }
    (tmp_path / "grip.yaml").write_text(yaml.safe_dump(document))
    file = tmp_path / "grip.yaml"
    command("run", file, "--out", tmp_path, "--no-figures", "--no-playback")
    with np.load(tmp_path / "grip" / "result.npz") as series:
        at = series["gripper_position"]
    np.testing.assert_allclose([at[0, 0], at[-1, 0]], [0.0, 0.03], atol=1e-9)


@pytest.mark.long
def test_an_arm_is_described_and_capsules_are_fitted_with_a_gripper_in_mjcf(hands, tmp_path):
    setting = f"gripper.model={hands['xml']}"
    told = command("arm", "ur5", "--set", setting, "--no-picture")
    assert "arm.gripper" not in told
    assert "wrist_3_joint" in told
    file = tmp_path / "hand.capsules.yaml"
    command("arm", "ur5", "--set", setting, "--no-picture", "--fit", file, "--most", 1)
    fitted = {capsule["body"] for capsule in yaml.safe_load(file.read_text())["capsules"]}
    assert fitted == {"hand", "left", "right"}


def test_a_body_without_its_mesh_asks_for_the_capsules_of_the_gripper(hands):
    file = hands["urdf"].with_name("lost.urdf")
    file.write_text(hands["urdf"].read_text().replace("tip.obj", "nope.obj"))
    arm = held(file)
    with pytest.raises(
        InvalidInputError, match=r"'gripper_left' .* in a file: arm\.gripper\.capsules"
    ):
        arm_clearance(arm, [], arm.home)


def test_a_second_arm_far_away_asks_for_millimetres():
    with pytest.raises(InvalidInputError, match=r"^arm.pair.base.translation: .*millimetres\?"):
        load_arm("panda", pair={"arm": "ur5", "base": {"translation": [1200, 0, 0]}})
