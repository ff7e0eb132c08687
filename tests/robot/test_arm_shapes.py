"""What of a model's shapes an arm's capsules hold, and what is said of those it does not have."""

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Role
from typer.testing import CliRunner

from drake_rnn import (
    DrakeRnnError,
    InvalidInputError,
    load_arm,
    make_experiment,
    make_obstacles,
)
from drake_rnn.cli.commands import app
from drake_rnn.robot.clearance.arm_capsules import (
    capsules_in_box,
    capsules_of,
    covering_capsules,
    fits_of,
    outside_of,
    union_volume,
)
from drake_rnn.robot.clearance.arm_clearance import arm_clearance, least_distance
from drake_rnn.robot.clearance.arm_shapes import (
    Enclosing,
    arm_shapes,
    arm_surfaces,
    enclosing_capsule,
    kept_capsule,
)
from drake_rnn.robot.clearance.capsules import Capsule, off_segment
from enclosed_vertices import outside
from robots import ROBOTS, package_folder
from scene_helpers import extents

LINK, SMALL = (0.08, 0.08, 0.4), (0.02, 0.02, 0.02)
BODY = (
    '<inertial><mass value="1"/><inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>"
)


def shape(kind, mesh, more="", scale=""):
    scaled = f' scale="{scale}"' if scale else ""
    return f'<{kind}>{more}<geometry><mesh filename="{mesh}"{scaled}/></geometry></{kind}>'


BOTH = shape("visual", "link.stl") + shape("collision", "link.stl")
BALL = '<{0}><geometry><sphere radius="{1}"/></geometry></{0}>'


def write_meshes(folder):
    for name, size, up in (("link.stl", LINK, 0.2), ("small.stl", SMALL, 0.2)):
        box = trimesh.creation.box(size)
        box.apply_translation([0.0, 0.0, up])
        box.export(folder / name)


def urdf(l2, more="", l1=BOTH, l3=BOTH):
    """An arm of three joints with links of 0.4 m."""
    links = "".join(
        f'<link name="{name}">{BODY}{inside}</link>'
        for name, inside in (("l1", l1), ("l2", l2), ("l3", l3))
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><origin xyz="0 0 {up}"/><parent link="{parent}"/>'
        f'<child link="l{k}"/><axis xyz="{axis}"/>'
        '<limit lower="-2.5" upper="2.5" velocity="2" effort="50"/></joint>'
        for k, parent, up, axis in (
            (1, "base", 0, "0 0 1"),
            (2, "l1", 0.4, "0 1 0"),
            (3, "l2", 0.4, "0 1 0"),
        )
    )
    tip = (
        '<link name="tip"/><joint name="jt" type="fixed"><origin xyz="0 0 .4"/>'
        '<parent link="l3"/><child link="tip"/></joint>'
    )
    return f'<robot name="r"><link name="base"/>{links}{joints}{tip}{more}</robot>'


def sdf(l2):
    """The same arm."""
    mesh = "<geometry><mesh><uri>{}</uri></mesh></geometry>"
    inside = {
        "both": f'<visual name="v">{mesh.format("link.stl")}</visual>',
        "collision": "",
        "small": f'<visual name="v">{mesh.format("small.stl")}</visual>',
    }
    links = "".join(
        f'<link name="{name}"><pose>0 0 {up} 0 0 0</pose>{inside[l2 if name == "l2" else "both"]}'
        f'<collision name="c">{mesh.format("link.stl")}</collision></link>'
        for name, up in (("l1", 0), ("l2", 0.4), ("l3", 0.8))
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent>{parent}</parent><child>l{k}</child><axis>'
        f"<xyz>{axis}</xyz><limit><lower>-2.5</lower><upper>2.5</upper><velocity>2</velocity>"
        "</limit></axis></joint>"
        for k, parent, axis in ((1, "world", "0 0 1"), (2, "l1", "0 1 0"), (3, "l2", "0 1 0"))
    )
    return (
        f'<sdf version="1.9"><model name="r">{links}{joints}<frame name="tip" attached_to="l3">'
        "<pose>0 0 0.4 0 0 0</pose></frame></model></sdf>"
    )


def mjcf(l2):
    """The same arm, with classes for what is drawn and what collides."""
    drawn, solid = '<geom class="visual" mesh="{}"/>', '<geom class="collision" mesh="link"/>'
    inside = {
        "both": drawn.format("link") + solid,
        "collision": solid,
        "small": drawn.format("small") + solid,
    }
    bodies = "".join(
        f'<body name="l{k}" pos="0 0 {up}">'
        '<inertial pos="0 0 .2" mass="1" diaginertia=".02 .02 .01"/>'
        f'<joint name="j{k}" axis="{axis}" range="-2.5 2.5"/>' + inside[l2 if k == 2 else "both"]
        for k, up, axis in ((1, 0, "0 0 1"), (2, 0.4, "0 1 0"), (3, 0.4, "0 1 0"))
    )
    return (
        '<mujoco model="r"><compiler angle="radian"/><default><default class="visual">'
        '<geom type="mesh" contype="0" conaffinity="0" group="2"/></default>'
        '<default class="collision"><geom type="mesh" group="3"/></default></default><asset>'
        '<mesh name="link" file="link.stl"/><mesh name="small" file="small.stl"/></asset>'
        f'<worldbody><body name="base">{bodies}<site name="tip" pos="0 0 .4"/></body></body></body>'
        "</body></worldbody></mujoco>"
    )


L2 = {
    "both": BOTH,
    "collision": shape("collision", "link.stl"),
    "small": shape("visual", "small.stl") + shape("collision", "link.stl"),
}


@pytest.mark.parametrize("l2", L2)
@pytest.mark.parametrize("form", ["urdf", "sdf", "xml"])
def test_a_ball_in_a_link_is_refused_whether_or_not_the_link_is_drawn(tmp_path, form, l2):
    """The collision mesh is a bar of 0.4 m in the middle of which the ball is; 0.05 + 0.0566 m."""
    write_meshes(tmp_path)
    text = {"urdf": urdf(L2[l2]), "sdf": sdf(l2), "xml": mjcf(l2)}[form]
    (tmp_path / f"r.{form}").write_text(text)
    at = [0.2 * np.sin(0.8), 0.0, 0.4 + 0.2 * np.cos(0.8)]
    document = {
        "arm": {"model": str(tmp_path / f"r.{form}"), "frame": "tip"},
        "start": [0, 0.8, 0.9],
        "path": {"kind": "circle", "plane": "xz", "size": 0.02, "period": 2, "timing": "quintic"},
        "law": {"kind": "adaptive"},
        "limits": {"velocity": 0.8, "acceleration": 4.0},
        "obstacles": [{"kind": "ball", "center": [float(x) for x in at], "radius": 0.05}],
        "period": 1e-3,
        "duration": 0.5,
    }
    with pytest.raises(DrakeRnnError, match=r"^start: l2 and ball 1 are -0\.107 m apart there"):
        make_experiment(document)


def arm_with(folder, l2, more="", **fields):
    write_meshes(folder)
    (folder / "r.urdf").write_text(urdf(l2, more))
    return load_arm(folder / "r.urdf", frame="tip", **fields)


def box_of(arm, body):
    """The least and the largest coordinates of what is known of a body."""
    (part,) = (part for part in arm_shapes(arm).parts if part.body == body)
    return np.stack((part.points.min(axis=0), part.points.max(axis=0)))


@pytest.mark.parametrize(
    ("more", "scale", "low", "high"),
    [
        ("", "1 1 1", [-0.04, -0.04, 0.0], [0.04, 0.04, 0.4]),
        ("", "2", [-0.08, -0.08, 0.0], [0.08, 0.08, 0.8]),
        ("", "1 2 -0.5", [-0.04, -0.08, -0.2], [0.04, 0.08, 0.0]),
        (
            '<origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>',
            "",
            [0.1, -0.04, -0.04],
            [0.5, 0.04, 0.04],
        ),
    ],
)
def test_scale_and_place_of_a_collision_mesh_are_kept(tmp_path, more, scale, low, high):
    """Single precision of STL; 1e-7 m."""
    arm = arm_with(tmp_path, shape("collision", "link.stl", more, scale))
    np.testing.assert_allclose(box_of(arm, "l2"), [low, high], atol=1e-7)
    # A run has nothing of it that could touch.
    assert extents(arm, Role.kProximity) == []


@pytest.mark.parametrize("ending", ["stl", "dae", "obj", "ply", "glb", "off"])
def test_a_collision_mesh_may_have_any_format(tmp_path, ending):
    box = trimesh.creation.box(LINK)
    box.export(tmp_path / f"bar.{ending}")
    found = box_of(arm_with(tmp_path, shape("collision", f"bar.{ending}")), "l2")
    np.testing.assert_allclose(found, [[-0.04, -0.04, -0.2], [0.04, 0.04, 0.2]], atol=1e-7)


def test_a_body_is_held_with_all_of_its_shapes_and_what_is_welded_to_it(tmp_path):
    """Two collision meshes and a ball of one name each, a drawn one, and a hand that is fixed."""
    shapes = (
        shape("collision", "small.stl").replace("<collision>", '<collision name="a">')
        + shape("collision", "small.stl", '<origin xyz="0.3 0 0"/>')
        + BALL.format('collision name="a"', 0.05).replace('</collision name="a">', "</collision>")
        + shape("visual", "link.stl")
    )
    hand = (
        f'<link name="hand">{BODY}{shape("collision", "link.stl")}</link><joint name="jh" '
        'type="fixed"><origin xyz="0 0 0.4"/><parent link="l3"/><child link="hand"/></joint>'
    )
    arm = arm_with(tmp_path, shapes, hand)
    low, high = box_of(arm, "l2")
    assert low[0] < -0.05
    assert high[0] == pytest.approx(0.31, abs=1e-6)
    assert high[2] == pytest.approx(0.4, abs=1e-6)
    capsules, _ = capsules_of(arm)
    assert [capsule.body for capsule in capsules] == ["l1", "l2", "l3", "hand"]
    clearance, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert ("l1", "hand") in clearance.names
    # 0.3 m and 10 mm, less the ball's, 50 mm, at the other side: Pythagoras with the height.
    (doubt,) = (text for text in doubts if "collision shapes hold less" in text)
    assert doubt.startswith(
        "obstacles: the model's collision shapes hold less than it draws; both "
    )


def test_what_is_drawn_beyond_the_collision_shapes_is_said_in_millimetres(tmp_path):
    """A ball of 0.05 m at the link's begin; the bar's corners are 0.0566 m aside and 0.4 m up."""
    arm = arm_with(tmp_path, BALL.format("collision", 0.05) + shape("visual", "link.stl"))
    (part,) = (part for part in arm_shapes(arm).parts if part.body == "l2")
    assert part.beyond == pytest.approx(np.hypot(0.4, 0.04 * np.sqrt(2.0)) - 0.05, abs=2e-3)
    _, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert doubts == (
        f"obstacles: the model's collision shapes hold less than it draws; both are kept clear: l2 "
        f"by {1e3 * part.beyond:.0f} mm",
    )
    assert all(
        c.holds(p.points) for c, p in zip(capsules_of(arm)[0], arm_shapes(arm).parts, strict=True)
    )


def test_a_ball_or_a_capsule_that_holds_what_is_drawn_is_taken_as_it_is(tmp_path):
    drawn = shape("visual", "small.stl", '<origin xyz="0 0 -0.2"/>')
    arm = arm_with(tmp_path, BALL.format("collision", 0.05) + drawn)
    (ball,) = (capsule for capsule in capsules_of(arm)[0] if capsule.body == "l2")
    assert ball.radius == 0.05
    assert not np.ptp(ball.ends, axis=0).any()


def test_bodies_without_a_shape_are_named(tmp_path):
    """Not the tip, which is a frame without mass; l2 has both."""
    arm = arm_with(tmp_path, "")
    _, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert doubts == (
        "obstacles: nothing keeps these bodies of r.urdf clear, which have no shape: l2; give them "
        "capsules in a file, arm.capsules",
    )
    (tmp_path / "c.yaml").write_text(
        "capsules: [{body: l2, ends: [[0,0,0],[0,0,0.4]], radius: 0.1}]"
    )
    with_file = arm_with(tmp_path, "", capsules=str(tmp_path / "c.yaml"))
    assert arm_clearance(with_file, [], np.array([0.0, 0.5, 0.5]))[1] == ()


def test_an_arm_that_has_a_shape_of_its_base_or_its_tool_alone_is_refused(tmp_path):
    (tmp_path / "r.urdf").write_text(
        urdf("", l1="", l3="").replace(
            '<link name="base"/>', f'<link name="base">{BALL.format("collision", 0.1)}</link>'
        )
    )
    for tool in (None, {"length": 0.1, "tip": "end"}):
        arm = load_arm(tmp_path / "r.urdf", frame="tip", tool=tool)
        with pytest.raises(InvalidInputError, match=r"^obstacles: r.urdf has no geometry to keep"):
            arm_clearance(arm, [], np.zeros(3))


@pytest.mark.parametrize(
    ("mesh", "scale", "fault", "warned"),
    [
        ("nowhere.stl", "", "is missing", "collision meshes are missing: nowhere.stl of 'l2'"),
        ("broken.stl", "", "cannot be read: ValueError: it contains no faces", ""),
        ("broken.obj", "", "cannot be read: ValueError: it contains no faces", ""),
        ("line.obj", "", "cannot be read: RuntimeError: MakeConvexHull failed because all ", ""),
    ],
)
def test_a_collision_mesh_that_cannot_be_read_is_refused_or_told(
    tmp_path, mesh, scale, fault, warned
):
    """It was left out before; a body that has nothing else cannot be kept clear."""
    for name in ("broken.stl", "broken.obj"):
        (tmp_path / name).write_text("this is no mesh")
    (tmp_path / "line.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    arm = arm_with(tmp_path, shape("collision", mesh, scale=scale))
    assert any(warned in warning for warning in arm.warnings)
    with pytest.raises(InvalidInputError) as caught:
        arm_clearance(arm, [], np.zeros(3))
    text = f"obstacles: 'l2' has no shape to keep clear: its mesh {mesh} {fault}"
    assert str(caught.value).startswith(text)
    arm = arm_with(tmp_path, shape("collision", mesh, scale=scale) + BALL.format("visual", 0.05))
    _, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert doubts[0].startswith(f"obstacles: the mesh {mesh} of 'l2' {fault}")
    assert doubts[0].endswith("; only the body's other shapes are kept clear")


def test_a_mesh_that_is_scaled_flat_is_kept_clear_and_told(tmp_path):
    write_meshes(tmp_path)
    arm = arm_with(tmp_path, shape("collision", "link.stl", scale="1 0 1"))
    assert any("without thickness" in each and "'l2'" in each for each in arm.warnings)
    clearance, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert clearance.count
    assert not doubts


def test_a_model_that_is_gone_is_refused_by_its_name(tmp_path):
    arm = arm_with(tmp_path, BOTH)
    (tmp_path / "r.urdf").unlink()
    with pytest.raises(InvalidInputError, match=r"^arm.model: no file '.*r\.urdf'$"):
        arm_clearance(arm, [], np.zeros(3))


def test_a_missing_mesh_of_mjcf_is_refused_by_its_body(tmp_path):
    write_meshes(tmp_path)
    text = mjcf("both").replace('mesh="link"/><geom', 'mesh="gone"/><geom', 1)
    text = text.replace("<asset>", '<asset><mesh name="gone" file="gone.stl"/>')
    text = text.replace('mesh="link"', 'mesh="gone"', 1)
    (tmp_path / "r.xml").write_text(text)
    with pytest.raises(InvalidInputError, match="'l1' has no shape to keep clear: its mesh gone"):
        arm_clearance(load_arm(tmp_path / "r.xml", frame="tip"), [], np.zeros(3))


def test_a_shape_without_bounds_needs_a_capsule(tmp_path):
    write_meshes(tmp_path)
    text = mjcf("both").replace("<geom class", '<geom type="plane" size="1 1 1"/><geom class', 1)
    (tmp_path / "r.xml").write_text(text)
    with pytest.raises(
        InvalidInputError, match="arm: 'l1' has a HalfSpace, round which no capsule"
    ):
        arm_clearance(load_arm(tmp_path / "r.xml", frame="tip"), [], np.zeros(3))
    (tmp_path / "c.yaml").write_text(
        "capsules: [{body: l1, ends: [[0,0,0],[0,0,0.3]], radius: 0.1}]"
    )
    arm = load_arm(tmp_path / "r.xml", frame="tip", capsules=str(tmp_path / "c.yaml"))
    assert len(arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))[0].arm.bodies) == 3


# Which pairs of bodies can touch.


def test_the_least_distance_is_that_of_known_shapes(tmp_path):
    """Bars of 0.4 m that fold: two joints on, a ball of 0.05 m at the end of the last one.

    The joint between the first and the second goes to 2.5 rad, so that the ball of the third comes
    to the first bar's side; hulls are exact, of 1e-6 m. Straight on it is farthest.
    """
    hand = (
        f'<link name="hand">{BODY}{BALL.format("collision", 0.05)}</link><joint name="jh" '
        'type="fixed"><origin xyz="0 0 0.4"/><parent link="l3"/><child link="hand"/></joint>'
    )
    arm = arm_with(tmp_path, BOTH, hand)
    found = least_distance(arm, ("l1", "l3"))
    assert found.joints == ("j2", "j3")
    assert found.touch
    # One joint moves the hand beside l2: at 2.5 rad its centre is 0.4 sin(2.5) from l2's axis, and
    # l2 ends 0.4 cos(2.5) before; the corner of a bar is 0.04 m off the axis.
    found = least_distance(arm, ("l2", "hand"))
    assert found.joints == ("j3",)
    assert found.postures > 361
    assert abs(found.posture[2]) == pytest.approx(2.5)
    assert found.distance == pytest.approx(0.4 * np.sin(2.5) - 0.04 - 0.05, abs=1e-3)
    assert not found.touch
    with pytest.raises(
        InvalidInputError, match="bodies: 'base' has no shape; it may be hand, l1, l"
    ):
        least_distance(arm, ("base", "l3"))
    with pytest.raises(InvalidInputError, match="bodies: no joint is between 'l3' and 'hand'"):
        least_distance(arm, ("l3", "hand"))


def test_what_is_welded_to_a_link_is_kept_clear_of_the_link_before(tmp_path):
    """The same hand on l3 beside l2, of which l3's joint makes a pair; with a shorter bar none."""
    place = '<origin xyz="0 0 {}"/>'
    hand = (
        f'<link name="hand">{BODY}{BALL.format("collision", 0.19)}</link><joint name="jh" '
        f'type="fixed">{place.format(0.4)}<parent link="l3"/><child link="hand"/></joint>'
    )
    arm = arm_with(tmp_path, BOTH, hand)
    clearance, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert doubts == ()
    assert clearance.names == (("l1", "l3"), ("l1", "hand"), ("l2", "hand"))
    small = hand.replace('radius="0.19"', 'radius="0.05"')
    clearance, _ = arm_clearance(arm_with(tmp_path, BOTH, small), [], np.array([0.0, 0.5, 0.5]))
    assert clearance.names == (("l1", "l3"), ("l1", "hand"))


def test_pairs_that_touch_at_home_are_named_if_they_may_touch(tmp_path):
    """Folded, l1 and l3 are beside each other; a fat hand at l3's begin is in l2 in any posture."""
    hand = (
        f'<link name="hand">{BODY}{BALL.format("collision", 0.1)}</link><joint name="jh" '
        'type="fixed"><parent link="l3"/><child link="hand"/></joint>'
    )
    arm = arm_with(tmp_path, BOTH, hand)
    clearance, doubts = arm_clearance(arm, [], np.array([0.0, 2.4, 2.4]))
    assert clearance.names == (("l1", "hand"),)
    assert doubts == (
        "obstacles: l1 and l3, l2 and hand are not kept apart from each other, although they may "
        "touch: their capsules do where the arm is at home; give capsules that do not in a file, "
        "arm.capsules",
    )


@pytest.mark.long
@pytest.mark.parametrize("name", ["UR3", "UR5", "UR10", "Panda", "xArm7", "Jaco 2", "Z1"])
def test_no_vertex_of_a_makers_model_is_outside_its_capsules(name):
    """Drawn and collision shapes, read by trimesh alone; 1e-6 m is asked for, 3e-16 m found."""
    try:
        folder = package_folder()
    except InvalidInputError:
        pytest.skip("needs example-robot-data")
    (robot,) = (robot for robot in ROBOTS if robot.name == name)
    far = outside(load_arm(folder / robot.file, frame=robot.frame))
    assert len(far) > 6
    assert max(far.values()) < 1e-9


@pytest.mark.parametrize(("kind", "aside"), [("box", 0.03), ("ellipsoid", 0.0305)])
def test_boxes_and_ellipsoids_of_mjcf_may_go_from_one_point_to_another(tmp_path, kind, aside):
    """Drake left them out. A quarter turn: z of the shape is the body's x."""
    write_meshes(tmp_path)
    geometry = f'<geom type="{kind}" fromto="0.1 0 0 0.5 0 0" size="0.03"/>'
    text = mjcf("both").replace('<geom class="visual" mesh="link"/>', geometry, 1)
    (tmp_path / "r.xml").write_text(text.replace('<geom class="collision" mesh="link"/>', "", 1))
    low, high = box_of(load_arm(tmp_path / "r.xml", frame="tip"), "l1")
    np.testing.assert_allclose(low, [0.1, -aside, -aside], atol=4e-3)
    np.testing.assert_allclose(high, [0.5, aside, aside], atol=4e-3)


def test_a_broken_obj_file_of_mjcf_is_left_out_by_name(tmp_path):
    """Before, the arm was refused with a message of Drake."""
    write_meshes(tmp_path)
    (tmp_path / "bad.obj").write_text("no mesh")
    drawn = '<geom class="visual" mesh="link"/>'
    more = '<default class="bad"><geom type="mesh" mesh="bad"/></default></default><asset>'
    text = mjcf("both").replace("</default><asset>", more + '<mesh name="bad" file="bad.obj"/>')
    (tmp_path / "r.xml").write_text(text.replace(drawn, '<geom class="bad"/>' + drawn, 1))
    arm = load_arm(tmp_path / "r.xml", frame="tip")
    assert "bad.obj cannot be read: ValueError: it contains no faces; the arm" in arm.warnings[0]
    _, doubts = arm_clearance(arm, [], np.array([0.0, 0.5, 0.5]))
    assert doubts[0].startswith(
        "obstacles: the mesh bad.obj of 'l1' cannot be read: ValueError: it"
    )


def box(size, middle):
    shape = trimesh.creation.box(size)
    shape.apply_translation(middle)
    return np.asarray(shape.triangles)


ELBOW = np.concatenate(
    (box((0.08, 0.08, 0.4), (0.0, 0.0, 0.2)), box((0.3, 0.08, 0.08), (0.15, 0.0, 0.36)))
)


@pytest.fixture(scope="module")
def elbow_capsules():
    return covering_capsules(ELBOW)


@pytest.mark.long
def test_fine_capsules_contain_every_face(elbow_capsules):
    """Points all over the faces of an elbow; one capsule takes twice the space."""
    rng = np.random.default_rng(0)
    shares = rng.dirichlet((0.5, 0.5, 0.5), (len(ELBOW), 2000))
    points = (shares @ ELBOW).reshape(-1, 3)
    away = [off_segment(points, c.ends) - c.radius for c in elbow_capsules]
    assert np.min(away, axis=0).max() <= 1e-9
    assert outside_of(ELBOW, elbow_capsules) == 0.0
    fine = [Capsule(body="elbow", ends=(*c.ends,), radius=c.radius) for c in elbow_capsules]
    assert len(fine) in (2, 3)
    assert union_volume(fine) < 0.55 * enclosing_capsule(ELBOW.reshape(-1, 3)).volume


@pytest.mark.long
def test_more_searches_find_capsules_that_take_less_space(elbow_capsules):
    """The same number of capsules; they contain every face as well."""
    closer = covering_capsules(ELBOW, effort=2)
    assert outside_of(ELBOW, closer) == 0.0
    assert len(closer) <= len(elbow_capsules)
    assert union_volume(closer) < 0.95 * union_volume(elbow_capsules)


def test_a_face_between_capsules_that_hold_its_corners_is_outside():
    """Two balls hold the corners of a strip of 2 m; its middle is 0.5 m away from both."""
    strip = box((2.0, 0.02, 0.02), (0.0, 0.0, 0.0))
    balls = [Enclosing(np.full((2, 3), [x, 0.0, 0.0]), 0.5) for x in (-1.0, 1.0)]
    assert np.min([off_segment(strip.reshape(-1, 3), b.ends) for b in balls]) < 0.5
    assert outside_of(strip, balls) == pytest.approx(np.hypot(1.0, 0.0141) - 0.5, rel=0.1)


def test_a_hole_between_capsules_is_seen():
    """A wall of 0.2 m between two capsules of 0.09 m, side by side and 0.2 m apart."""
    wall = box((0.2, 0.001, 0.4), (0.0, 0.0, 0.0))
    ends = np.array([[-0.1, 0.0, -0.2], [-0.1, 0.0, 0.2]])
    sides = [Enclosing(ends, 0.09), Enclosing(ends * [-1.0, 1.0, 1.0], 0.09)]
    assert outside_of(wall, sides) == pytest.approx(0.01, rel=0.1)
    wider = [Enclosing(each.ends, 0.1001) for each in sides]
    assert outside_of(wall, wider) == 0.0


@pytest.mark.long
def test_an_arm_of_ones_own_is_fitted_by_a_command(tmp_path, monkeypatch):
    """A cube as the collision mesh of a link: its fine capsules contain the mesh, and are used."""
    write_meshes(tmp_path)
    (tmp_path / "r.urdf").write_text(urdf(BALL.format("visual", 0.02) + BOTH))
    monkeypatch.chdir(tmp_path)
    command = ["arm", "r.urdf", "--frame", "tip", "--fit", "r.yaml", "--most", "2", "--effort", "2"]
    assert CliRunner().invoke(app, command).exit_code == 0
    bare = load_arm("r.urdf", frame="tip", shapes="fine")
    with pytest.raises(InvalidInputError, match="no fine capsules of r are known: no file of caps"):
        arm_clearance(bare, [], np.zeros(3))
    arm = bare.replace(capsules="r.yaml")
    clearance, doubts = arm_clearance(arm, [], np.zeros(3))
    assert doubts == ()
    surfaces = arm_surfaces(arm)
    assert set(clearance.arm.bodies) == set(surfaces) == {"l1", "l2", "l3"}
    for fit in fits_of(surfaces, capsules_of(arm)[0]):
        assert fit.outside == 0.0
        assert fit.volume < 2.0 * fit.hull
    text = (tmp_path / "r.yaml").read_text()
    assert "made_by: drake-rnn arm r.urdf --frame tip --fit r.yaml --most 2 --effort 2" in text
    (tmp_path / "r.yaml").write_text(text.partition("fine:")[0])
    with pytest.raises(InvalidInputError, match=r"r\.yaml has none; drake-rnn arm r\.urdf --fit"):
        arm_clearance(arm.replace(gravity=[0, 0, 0]), [], np.zeros(3))


HELD = {"kind": "box", "center": [0.0, 0.0, 0.11], "size": [0.1, 0.2, 0.1]}


def test_a_payload_moves_with_the_tool_and_is_kept_clear():
    """A ball 5 mm beside a box of 0.2 m that the flange holds: near it, far without it."""
    arm = load_arm("panda", tool=None)
    held = arm.replace(payload={"shapes": [HELD], "mass": 0.5})
    X_WE = arm.kinematics()
    for q in (arm.home, arm.home + 0.2):
        at = X_WE.p_WE(q) + X_WE.R_WE(q) @ np.array([0.0, 0.155, 0.11])
        ball = make_obstacles([{"kind": "ball", "center": at.tolist(), "radius": 0.05}])
        without, _ = arm_clearance(arm, ball, arm.home)
        with_box, doubts = arm_clearance(held, ball, arm.home)
        assert doubts == ()
        [k] = (k for k, names in enumerate(with_box.names) if names == ("payload", "ball 1"))
        assert with_box.gaps(q)[k] <= 0.005
        assert without.gaps(q).min() > 0.01
    heavier = held.kinematics().gravity(arm.home) - arm.kinematics().gravity(arm.home)
    lever = 0.5 * 9.81 * (X_WE.p_WE(arm.home) + X_WE.R_WE(arm.home) @ HELD["center"])[0]
    assert abs(heavier[1]) == pytest.approx(lever, rel=1e-9)


@pytest.mark.long
def test_capsules_in_a_box_contain_all_of_it_and_reach_as_far_out_whichever_way_it_lies():
    size = np.array([0.1, 0.1, 0.2])
    triangles = box(size, np.zeros(3))
    capsules = capsules_in_box(size, 4)
    assert len(capsules) == 4
    assert outside_of(triangles, capsules) == 0.0
    assert outside_of(triangles, [c._replace(radius=c.radius - 1e-4) for c in capsules]) > 5e-5
    for turn in (0.0, 0.3, 0.785):
        held = {**HELD, "size": size.tolist(), "rpy": [0.0, 0.0, turn]}
        arm = load_arm("panda", tool=None, shapes="fine", payload={"shapes": [held]})
        own = [c for c in capsules_of(arm)[0] if c.body == "payload"]
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        reach = max(float((np.array(c.ends) @ out).max()) + c.radius for c in own)
        # From the middle to that of a cell, and half of its diagonal.
        assert reach == pytest.approx(0.025 + 0.0353553, abs=5e-5)


def test_fine_capsules_of_a_payload_take_less_space():
    panda = load_arm("panda", tool=None, payload={"shapes": [HELD]})
    one, fine = (
        [c for c in capsules_of(panda.replace(shapes=shapes))[0] if c.body == "payload"]
        for shapes in ("coarse", "fine")
    )
    assert len(one) == 1
    assert union_volume(fine) < 0.8 * union_volume(one)
    corners = box(HELD["size"], HELD["center"])
    assert outside_of(corners, [Enclosing(np.array(c.ends), c.radius) for c in fine]) == 0.0


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        ({"shapes": []}, "arm.payload.shapes: must have at least one shape"),
        ({"shapes": [{"kind": "cone", "center": [0, 0, 0]}]}, "arm.payload.shapes.0.kind: "),
        (
            {"shapes": [{"kind": "ball", "center": [0, 0, 0]}]},
            "arm.payload.shapes.0.radius: must be given of a ball",
        ),
        (
            {"shapes": [{**HELD, "radius": 0.1}]},
            "arm.payload.shapes.0.radius: is not one of a box",
        ),
        (
            {"shapes": [{**HELD, "size": [0.1, 0.1, -0.1]}]},
            "arm.payload.shapes.0.size: must be three edges above 0",
        ),
        (
            {"shapes": [{**HELD, "center": [0, 0, 100]}]},
            "arm.payload.shapes.0: must be within 10 m of the frame that holds it, not 100",
        ),
        (
            {"shapes": [HELD], "name": "panda_link1"},
            "arm.payload.name: the arm has a body 'panda_link1' already; give another name",
        ),
        ({"shapes": [HELD], "frame": "pnda_link7"}, "arm.payload.frame: no frame 'pnda_link7'"),
    ],
)
def test_a_payload_that_cannot_be_is_refused(payload, message):
    with pytest.raises(InvalidInputError) as error:
        load_arm("panda", tool=None, payload=payload)
    assert message in str(error.value)


def test_a_capsule_is_fitted_once_for_all_processes(tmp_path, monkeypatch):
    """Whatever becomes of the file that keeps it, and of the folder."""
    points = np.random.default_rng(0).normal(0.0, 0.1, (30, 3))
    ends, radius = enclosing_capsule(points)

    def is_kept():
        kept = kept_capsule(points)
        return np.array_equal(kept.ends, ends) and kept.radius == radius

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "drake_rnn" / "fits"
    assert is_kept()
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    assert is_kept()
    for broken in (whole[:-8], b"", whole[::-1], whole + whole):
        file.write_bytes(broken)
        assert is_kept()
        assert [each.read_bytes() for each in folder.iterdir()] == [whole]
    points[0, 0] = np.nextafter(points[0, 0], 1.0)
    ends, radius = enclosing_capsule(points)
    assert is_kept()
    assert len(list(folder.iterdir())) == 2
    # Where nothing can be kept it is fitted each time.
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))
    assert is_kept()
