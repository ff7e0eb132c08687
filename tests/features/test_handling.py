"""Things that an arm attaches and releases on its way: what is kept apart when."""

import sys

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    arm_clearance,
    load_arm,
    load_experiment,
    make_experiment,
    run_many,
    simulate,
    write_playback,
)
from drake_rnn.features.handling import payload_obstacles
from drake_rnn.robot.clearance.arm_clearance import clearance_between
from drake_rnn.robot.clearance.capsules import off_segment

PERIOD = 0.02
DOWN = np.array([-0.9, -0.7, 1.2, -2.07, -1.57, 0.0])
RAISED = DOWN - [0.0, 0.35, 0.0, -0.35, 0.0, 0.0]
TURN = np.array([1.8, 0.0, 0.0, 0.0, 0.0, 0.0])
BOX = {"kind": "box", "center": [0, 0, 0.09], "size": [0.06, 0.06, 0.12]}
TABLES = [
    {"kind": "box", "center": [0.56, y, -0.109], "size": [0.3, 0.3, 0.1], "name": name}
    for name, y in (("table", -0.53), ("shelf", 0.53))
]
WALL = {"kind": "box", "center": [0.77, 0, 0.0], "size": [0.3, 0.02, 0.24], "name": "wall"}
DOCUMENT = {
    "arm": {"model": "ur5", "tool": None, "payload": {"name": "box", "shapes": [BOX]}},
    "law": {"kind": "joint_stream", "avoidance": {"approach": 50.0}},
    "limits": {"velocity": 1.5, "acceleration": 6.0, "jerk": 200.0},
    "obstacles": [*TABLES, WALL],
    "start": RAISED.tolist(),
    "goals": [
        {"q": DOWN.tolist(), "action": "attach", "supports": ["table"]},
        {"q": RAISED.tolist()},
        {"q": (RAISED + TURN).tolist()},
        {"q": (DOWN + TURN).tolist(), "action": "release", "supports": ["shelf"]},
        {"q": (RAISED + TURN).tolist(), "wait": 0.1},
    ],
    "period": PERIOD,
    "duration": 8.0,
}


@pytest.fixture(scope="module")
def moved():
    pytest.importorskip("ompl")
    return make_experiment(DOCUMENT)


@pytest.fixture(scope="module")
def run(moved):
    return simulate(moved)


def named(clearance):
    return {name for pair in clearance.names for name in pair}


def test_the_payload_is_one_of_the_arms_bodies_while_it_is_held_and_an_obstacle_else(moved):
    free, lifted, held, lowered, left = (each.clearance for each in moved.handling.phases)
    assert [each.event for each in moved.handling.phases] == [None, "attach", None, None, "release"]
    for clearance in (lifted, held, lowered):
        assert "box" in named(clearance)
        assert "box 1" not in named(clearance)
    for clearance in (free, left):
        assert "box" not in named(clearance)
        assert ("forearm_link", "box 1") in clearance.names
        # What closes a gripper touches it.
        assert ("wrist_3_link", "box 1") not in clearance.names
    supports = {("box", "table"): (held, lowered), ("box", "shelf"): (lifted, held)}
    for pair, where in supports.items():
        assert [pair in each.names for each in (lifted, held, lowered)] == [
            each in where for each in (lifted, held, lowered)
        ]


def test_it_lies_where_it_is_attached_and_where_it_was_released(moved):
    kinematics, handling = moved.arm.kinematics(), moved.handling
    for q, X_WH in ((DOWN, handling.before), (DOWN + TURN, handling.after)):
        assert np.abs(X_WH.translation() - kinematics.p_WE(q)).max() < 1e-12
        assert np.abs(X_WH.rotation().matrix() - kinematics.R_WE(q)).max() < 1e-12
        [box] = payload_obstacles(handling.payload, X_WH)
        assert np.abs(box.center - X_WH @ [0, 0, 0.09]).max() < 1e-12
        assert np.abs(box.R_WO - X_WH.rotation().matrix()).max() < 1e-12


def test_all_is_kept_apart_that_is_to_be_within_every_bound(moved, run):
    metrics = run.metrics
    assert metrics["distance_min_m"] >= 0.01
    assert metrics["joint_error_max_rad"] < 1e-12
    for name in ("position", "velocity", "acceleration", "held_jerk"):
        [metric] = [key for key in metrics if key.startswith(f"{name}_violation_max")]
        assert metrics[metric] <= 1e-9
    # At each step the least distance is that of the pairs which count then.
    q, time, phases = run.series["position"], run.time, moved.handling.phases
    ends = [*(each.begin for each in phases[1:]), np.inf]
    own = np.full(len(time), np.inf)
    for phase, end in zip(phases, ends, strict=True):
        inside = (time >= phase.begin - 1e-9) & (time <= end + 1e-9)
        own[inside] = np.minimum(own[inside], phase.clearance.gaps(q[inside]).min(axis=1))
    assert (run.series["distance"] <= own + 1e-12).all()
    assert (run.series["uncertified"] == 0.0).all()


def test_without_its_geometry_it_collides_with_the_wall(moved):
    bare = make_experiment(
        {
            **DOCUMENT,
            "arm": {"model": "ur5", "tool": None},
            "goals": [{"q": goal["q"]} for goal in DOCUMENT["goals"]],
        }
    )
    held = moved.handling.phases[2].clearance
    assert held.gaps(bare.targets.position).min() < -0.01
    assert bare.handling is None
    assert len(bare.document.goals[2].via) == 1


@pytest.mark.long
def test_a_result_is_repeated_bit_for_bit_without_a_search(moved, run, monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl.base", None)
    again = simulate(make_experiment(moved.document.contents()))
    assert again.series["position"].tobytes() == run.series["position"].tobytes()
    assert again.series["distance"].tobytes() == run.series["distance"].tobytes()


def test_an_arm_that_is_not_at_rest_at_its_goal_attaches_nothing(moved):
    """Without targets the arm waits where it started."""
    reading = moved.handling.around(moved.law.sampled(PERIOD))
    u = {"position": RAISED, "target": np.full(6, np.nan)}
    x = reading.initial_state(np.random.default_rng(0), u)
    begin = moved.handling.phases[1].begin
    x = reading.step(begin - PERIOD, x, u, PERIOD)
    with pytest.raises(InvalidInputError, match=r"goals.0: the arm is not at rest there at 1.08 s"):
        reading.step(begin, x, u, PERIOD)


def test_what_is_handed_over_is_gone(moved):
    goals = [{**goal} for goal in run_goals(moved)]
    goals[3]["action"] = "hand_over"
    handling = make_experiment({**DOCUMENT, "goals": goals}).handling
    assert handling.after is None
    assert "box 1" not in named(handling.phases[-1].clearance)
    # What is held from the start is released without being attached.
    del goals[0]["action"], goals[0]["supports"]
    supports = [*TABLES, WALL][1:]
    held = make_experiment({**DOCUMENT, "obstacles": supports, "goals": goals}).handling
    assert held.before is None
    assert "box" in named(held.phases[0].clearance)


def run_goals(moved):
    """Return the goals with the plans that were found."""
    return moved.document.contents()["goals"]


def changed(number, **keys):
    goals = [{**goal} for goal in DOCUMENT["goals"]]
    goals[number] |= keys
    return {"goals": [{k: v for k, v in goal.items() if v is not None} for goal in goals]}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"goals": []}, "goals: must have one goal or more"),
        (
            {"goal": {"q": DOWN.tolist()}},
            "goal: cannot be combined with goals; give one of them",
        ),
        (
            {"goals": None, "goal": {"q": DOWN.tolist(), "action": "attach"}},
            "goal.action: is for several goals",
        ),
        (
            {"arm": {"model": "ur5", "tool": None}},
            "goals.0.action: attach needs arm.payload, what the arm holds",
        ),
        (
            changed(1, action="attach"),
            "goals.3.action: a payload is attached once, and then released or handed over once",
        ),
        (
            changed(0, action="release"),
            "goals.3.action: a payload is attached once",
        ),
        (changed(1, supports=["table"]), "goals.1.supports: only with an action"),
        (changed(3, supports=["shlf"]), "goals.3.supports: no obstacle 'shlf'; nearest: shelf"),
        # Where it is attached, it rests on the support on the way to the goal after that.
        (changed(0, supports=["tabel"]), "goals.0.supports: no obstacle 'tabel'; nearest: table"),
        (
            changed(0, supports=None),
            r"goals.0: box and table (overlap by|are) .* there, where 0.005 m are kept",
        ),
        (
            changed(0, q=None, p_WE=[0.56, -0.53, 0.09]),
            "goals.0.rpy: must be given where it attaches",
        ),
        (changed(2, q=[9.0, 0, 0, 0, 0, 0]), "goals.2.q: shoulder_pan_joint is at 9 rad"),
        ({"level": "dynamic"}, "goals: must attach, release and grip nothing at level: dynamic"),
        ({"safety": {}}, "safety: must be left out where goals attach, release or grip"),
        ({"obstacles": None}, "obstacles: must be given where goals attach, release or grip"),
        (
            {"obstacles": [*TABLES, {**WALL, "name": "box 1"}]},
            "obstacles: 'box 1' is the name of a part of the payload",
        ),
    ],
)
def test_what_cannot_be_is_refused_before_a_run(changes, text):
    document = {k: v for k, v in {**DOCUMENT, **changes}.items() if v is not None}
    with pytest.raises(InvalidInputError, match=text):
        make_experiment(document)


def test_hosts_that_keep_the_same_pairs_apart_refuse_it(moved):
    with pytest.raises(
        InvalidInputError, match="goals: must attach, release and grip nothing here"
    ):
        run_many([moved])
    with pytest.raises(
        InvalidInputError, match="goals: must attach, release and grip nothing here"
    ):
        simulate(moved, compiled=True)


HAND = {"model": "franka_hand", "lock": {"finger_joint1": 0.04}}
CLOSES = {"opening": {"finger_joint1": 0.01}, "opening_time": 0.2, "wait": 0.2}
# A finger that turns by 1.2 rad at the end of a link that slides, as a mimic of it.
TURNING = """<robot name="turning"><link name="base"/>
<joint name="slides" type="prismatic"><parent link="base"/><child link="slide"/>
  <origin xyz="0 0 0.05"/><axis xyz="0 1 0"/>
  <limit lower="0" upper="0.04" velocity="1" effort="9"/></joint>
<link name="slide"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><box size="0.02 0.02 0.02"/></geometry></visual></link>
<joint name="turns" type="revolute"><parent link="slide"/><child link="finger"/>
  <origin xyz="0 0 0.01"/><axis xyz="1 0 0"/>
  <limit lower="-2" upper="2" velocity="99" effort="9"/>
  <mimic joint="slides" multiplier="30"/></joint>
<link name="finger"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0 0 0.05"/><geometry><box size="0.02 0.02 0.1"/></geometry></visual></link>
</robot>"""


def gripping(*goals, gripper=HAND, obstacles=(), **changes):
    """A document of a UR5 with a hand that holds nothing, which rests at its start."""
    own = [{"q": RAISED.tolist(), **goal} for goal in goals]
    arm = {"model": "ur5", "gripper": gripper}
    return {**DOCUMENT, "arm": arm, "goals": own, "obstacles": list(obstacles), **changes}


def points_of(arm, names):
    """Points all over capsules of some bodies, all joints of the arm at zero."""
    clearance, _ = arm_clearance(arm, [], RAISED)
    directions = np.random.default_rng(0).normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = []
    for k, body in enumerate(clearance.arm.bodies):
        if body in names:
            one, other = clearance.arm.ends[k]
            for share in (0.0, 0.3, 0.7, 1.0):
                middle = (1.0 - share) * one + share * other
                found.append(middle + clearance.arm.radii[k] * directions)
    return np.concatenate(found)


@pytest.mark.parametrize("shapes", ["franka_hand", pytest.param("turning", marks=pytest.mark.long)])
def test_what_is_kept_clear_while_a_gripper_moves_contains_it_all_along(shapes, tmp_path):
    """At 12 openings that are none of those looked at; sliding fingers, and one that turns too."""
    gripper, joint, ends = HAND, "finger_joint1", (0.04, 0.003)
    if shapes == "turning":
        (tmp_path / "turning.urdf").write_text(TURNING)
        gripper, joint = {"model": str(tmp_path / "turning.urdf")}, "slides"
        ends = (0.0, 0.04)
    arm = load_arm("ur5", gripper=gripper)
    arms = [arm.with_gripper_at({joint: end}) for end in ends]
    one, other = (arm_clearance(each, [], RAISED)[0] for each in arms)
    locks = tuple({joint: end} for end in ends)
    moving = clearance_between(arm, one, other, locks).arm
    counts = one.arm.bodies.count
    names = {body for body in moving.bodies if moving.bodies.count(body) > counts(body)}
    assert (
        names
        == {
            "franka_hand": {"gripper_leftfinger", "gripper_rightfinger"},
            "turning": {"gripper_slide", "gripper_finger"},
        }[shapes]
    )
    for share in np.random.default_rng(1).uniform(0.0, 1.0, 12):
        at = (1.0 - share) * ends[0] + share * ends[1]
        points = points_of(arm.with_gripper_at({joint: at}), names)
        own = [k for k, body in enumerate(moving.bodies) if body in names]
        away = [off_segment(points, moving.ends[k]) - moving.radii[k] for k in own]
        # A way of 40 mm is cut in stretches, each of which has a capsule that is 5 mm wider.
        assert np.min(away, axis=0).max() <= 1e-9
    assert moving.radii[own].max() < one.arm.radii.max() + 0.02


def test_a_finger_that_turns_by_more_than_a_turn_at_one_goal_is_refused(tmp_path):
    text = TURNING.replace('"30"', '"300"').replace('"-2" upper="2"', '"-20" upper="20"')
    (tmp_path / "turning.urdf").write_text(text)
    arm = load_arm("ur5", gripper={"model": str(tmp_path / "turning.urdf")})
    clearance, _ = arm_clearance(arm, [], RAISED)
    with pytest.raises(InvalidInputError, match="turns finger by 12 rad; at one goal it may by 8"):
        clearance_between(arm, clearance, clearance, ({"slides": 0.0}, {"slides": 0.04}))


@pytest.fixture(scope="module")
def gripped():
    goals = ({**CLOSES}, {"wait": 0.1}, {"opening": {"finger_joint1": 0.03}})
    return make_experiment(gripping(*goals, duration=2.5))


def test_fingers_move_while_the_arm_rests_with_other_shapes_before_meanwhile_and_after(gripped):
    handling = gripped.handling
    times = [t for each in handling.openings for t in (each.begin, each.end)]
    assert [each.begin for each in handling.phases] == [0.0, *times]
    np.testing.assert_allclose(np.diff(times)[::2], [0.2, 0.5], atol=1e-9)
    sizes = [len(each.clearance.arm.bodies) for each in handling.phases]
    assert sizes[0] == sizes[2] == sizes[4] < sizes[1] == sizes[3]
    at = [handling.opening_at(t)["finger_joint1"] for t in (0, *times, np.mean(times[:2]), 9.0)]
    np.testing.assert_allclose(at, [0.04, 0.04, 0.01, 0.01, 0.03, 0.025, 0.03], atol=1e-9)
    for phase, opening in zip(handling.phases[::2], (0.04, 0.01, 0.03), strict=True):
        same, _ = arm_clearance(
            gripped.arm.with_gripper_at({"finger_joint1": opening}), [], gripped.start
        )
        np.testing.assert_array_equal(phase.clearance.arm.ends, same.arm.ends)


def test_a_run_with_a_gripper_that_moves_keeps_all_and_its_playback_shows_when(gripped, tmp_path):
    result = simulate(gripped)
    assert result.metrics["joint_error_max_rad"] < 1e-12
    assert result.metrics["distance_min_m"] > 0.01
    page = write_playback(result, tmp_path / "playback.html").read_text()
    assert "moves its gripper: finger_joint1 to 0.01" in page
    assert "moves its gripper: finger_joint1 to 0.03" in page
    # Where the finger is at each time, as it was asked: 0.03 m in 0.2 s, and 0.02 m in 0.5 s.
    finger = result.series["gripper_position"][:, 0]
    assert (finger[0], finger.min(), finger[-1]) == pytest.approx((0.04, 0.01, 0.03), abs=1e-12)
    speed = np.diff(finger) / np.diff(result.time)
    assert (speed.min(), speed.max()) == pytest.approx((-0.15, 0.04), rel=1e-6)


def test_what_is_between_two_openings_is_seen_though_both_ends_are_free():
    """A wire beside a fingertip that passes it: 5 mm of room at both ends, none between."""
    arm = load_arm("ur5", gripper=HAND)
    body = arm.gripper_plant.GetBodyByName("gripper_leftfinger")
    [wide, closed] = arm.gripper_contexts([{"finger_joint1": x} for x in (0.04, 0.0)])
    mount = arm.gripper_plant.GetFrameByName("tool0")
    tips = [body.body_frame().CalcPose(each, mount) @ [0.0, 0.01, 0.06] for each in (wide, closed)]
    kinematics = arm.kinematics()
    p = kinematics.p_WE(RAISED) + kinematics.R_WE(RAISED) @ np.mean(tips, axis=0)
    law = {"kind": "joint_stream", "avoidance": {"floor": 0.003, "distance": 0.005}}
    goal = {**CLOSES, "opening": {"finger_joint1": 0.0}}
    wire = {"kind": "ball", "center": p.tolist(), "radius": 0.001, "name": "wire"}
    with pytest.raises(InvalidInputError, match=r"goals.0.opening: gripper_.*finger and wire"):
        make_experiment(gripping(goal, obstacles=[wire], law=law))
    # The arm may be there with either opening.
    for opening in (0.04, 0.0):
        hand = {**HAND, "lock": {"finger_joint1": opening}}
        make_experiment(gripping({}, gripper=hand, obstacles=[wire], law=law))


@pytest.mark.parametrize(
    ("goal", "gripper", "text"),
    [
        (CLOSES, None, "goals.0.opening: needs arm.gripper"),
        ({"opening": {"finger_join": 0.0}}, HAND, "goals.0.opening: no joint 'finger_join'"),
        (
            {"opening": {"finger_joint1": 0.05}},
            HAND,
            "goals.0.opening.finger_joint1: may be 0 to 0.04, not 0.05",
        ),
        (
            {**CLOSES, "opening_time": 0.1},
            HAND,
            "goals.0.opening_time: finger_joint1 takes at least 0.15 s for 0.03",
        ),
        (CLOSES, {**HAND, "frame": "leftfinger"}, "goals.0.opening: moves 'leftfinger', the task"),
        ({"opening": {}}, HAND, "goals.0.opening: must name joints of the gripper"),
        ({**CLOSES, "opening_time": 1e9}, HAND, "goals.0.opening_time: may be at most 3600"),
        ({**CLOSES, "wait": 1e9}, HAND, "goals.0.wait: may be at most 3600"),
        ({"opening_time": 1.0}, HAND, "goals.0.opening_time: only with opening"),
    ],
)
def test_a_gripper_that_cannot_move_so_is_refused(goal, gripper, text):
    with pytest.raises(InvalidInputError, match=text):
        make_experiment(gripping(goal, gripper=gripper))


def test_a_joint_that_arm_lock_holds_moves_from_there():
    hand = {"model": "franka_hand"}
    document = gripping({**CLOSES}, gripper=hand, duration=2.5)
    document["arm"]["lock"] = {"gripper_finger_joint1": 0.04}
    (opening,) = make_experiment(document).handling.openings
    assert (opening.first, opening.last) == ({"finger_joint1": 0.04}, {"finger_joint1": 0.01})


def test_it_takes_whole_samples_that_are_not_shorter_than_its_limit_of_speed_allows():
    goal = {"opening": {"finger_joint1": 0.04 - 0.0308}, "opening_time": 0.154}
    (opening,) = make_experiment(gripping(goal, duration=2.5)).handling.openings
    assert opening.end - opening.begin >= 0.0308 / 0.2


# A finger that turns farther, by itself.
FOLDING = TURNING.replace('lower="-2" upper="2"', 'lower="-9" upper="9"')
FOLDING = FOLDING.replace('<mimic joint="slides" multiplier="30"/>', "")


def test_a_whole_turn_of_what_carries_the_task_frame_is_refused_too(tmp_path):
    (tmp_path / "folding.urdf").write_text(FOLDING)
    gripper = {"model": str(tmp_path / "folding.urdf"), "frame": "finger"}
    goal = {"opening": {"turns": 2.0 * np.pi}, "opening_time": 2.0}
    with pytest.raises(InvalidInputError, match=r"goals.0.opening: moves 'finger', the task"):
        make_experiment(gripping(goal, gripper=gripper))


def test_what_is_kept_apart_no_more_with_the_new_opening_is_told(tmp_path):
    """A finger that folds back on the arm, of which its place at the start says nothing."""
    (tmp_path / "folding.urdf").write_text(FOLDING)
    gripper = {"model": str(tmp_path / "folding.urdf")}
    goal = {"opening": {"turns": np.pi}, "opening_time": 2.0}
    folded = make_experiment(gripping(goal, gripper=gripper, duration=6.0))
    assert not make_experiment(gripping({}, gripper=gripper)).warnings
    assert any("gripper_finger are not kept apart" in text for text in folded.warnings)


def test_a_payload_may_be_named_like_a_part_of_a_gripper():
    payload = {"mass": 0.1, "name": "gripper_box", "frame": "gripper_hand", "shapes": [BOX]}
    document = gripping({**CLOSES}, duration=2.5)
    document["arm"]["payload"] = payload
    handling = make_experiment(document).handling
    assert "gripper_box" in handling.phases[1].clearance.arm.bodies


@pytest.mark.long
def test_what_a_hand_takes_out_of_a_shelf_would_hit_a_pole_without_its_geometry():
    """The shipped scene: the box as it is, not its capsules, 9 mm into the pole, or 5 cm clear."""
    pytest.importorskip("ompl")
    held = load_experiment("shelf_grip")
    contents = held.document.contents()
    del contents["arm"]["payload"]
    keep = ("p_WE", "rpy", "opening")
    contents["goals"] = [{k: goal[k] for k in keep if k in goal} for goal in contents["goals"]]
    kinematics, pole = held.arm.kinematics(), np.full((200, 3), [0.45, 0.48, 0.0])
    pole[:, 2] = np.linspace(0.0, 0.48, len(pole))
    least = []
    for each in (held, make_experiment(contents)):
        q = each.targets.position
        ends = [np.abs(q - goal.via[-1]).max(axis=1).argmin() for goal in each.document.goals]
        gaps = []
        for posture in q[ends[1] : ends[2] + 1 : 2]:
            p = (pole - kinematics.p_WE(posture)) @ kinematics.R_WE(posture) - [0, 0, 0.01]
            out = np.abs(p) - 0.5 * np.array([0.16, 0.03, 0.06])
            away = np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0)
            gaps.append(away.min() - 0.015)
        least.append(min(gaps))
    assert least[0] > 0.01
    assert least[1] < -0.005
    result = simulate(held)
    assert result.metrics["distance_min_m"] >= 0.01
    assert result.metrics["joint_error_max_rad"] < 1e-6


def test_its_playback_shows_the_payload_where_it_lies_and_when(run, tmp_path):
    page = write_playback(run, tmp_path / "playback.html").read_text()
    assert "attaches box" in page
    assert "releases box" in page
