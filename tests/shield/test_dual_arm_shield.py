"""Two arms behind one shield: they keep clear of each other, and each follows its own source."""

import numpy as np
import pytest
from pydrake.geometry import (
    Capsule,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix

from drake_rnn import (
    CommandReader,
    DualArmShield,
    Guard,
    InvalidInputError,
    JointStream,
    ShieldSettings,
    ShieldView,
    arm_clearance,
    load_arm,
)
from drake_rnn.robot.clearance.arm_capsules import capsules_of
from process_helpers import wait_for

PERIOD, FLOOR = 0.02, 0.006
FACING = {"translation": [1.1, 0.0, 0.0], "rpy": [0.0, 0.0, np.pi]}
BARE = {"model": "panda", "tool": None}
ARM = load_arm("panda", tool=None, pair={"arm": BARE, "base": FACING})
LIMITS = ARM.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
HOME = ARM.home
# Each tool comes to where the other arm's wrist is.
REACH = np.array([0.0, 0.55, 0.0, 0.45, 0.0, 0.1, 0.0])


def shield(arm=ARM, **changes):
    return DualArmShield(arm, PERIOD, **{"limits": LIMITS, **changes})


def led():
    both = shield()
    both.follow_positions(HOME)
    return both


def capsule_distance(arm, motion):
    """Least distance of bodies of the two arms, by Drake's kinematics and its capsules [m]."""
    graph, plant = SceneGraph(), arm.plant()
    source, frames, sides = graph.RegisterSource("arms"), [], ([], [])
    capsules = capsules_of(arm)[0]
    first, second = ({joint.name() for joint in _ways(arm, plant, k)} for k in (0, 1))
    for k, capsule in enumerate(capsules):
        body = plant.GetBodyByName(capsule.body)
        ends = np.array(capsule.ends)
        length = float(np.linalg.norm(ends[1] - ends[0]))
        axis = (ends[1] - ends[0]) / length if length else np.array([0.0, 0.0, 1.0])
        X = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), ends.mean(axis=0))
        frame = graph.RegisterFrame(source, GeometryFrame(f"{k}"))
        shape = Capsule(capsule.radius, max(length, 1e-9))
        geometry = graph.RegisterGeometry(source, frame, GeometryInstance(X, shape, f"{k}"))
        graph.AssignRole(source, geometry, ProximityProperties())
        frames.append((frame, body))
        names = {joint.name() for joint in _joints_to(plant, body)}
        sides[0].append(geometry) if names & first else None
        sides[1].append(geometry) if names & second else None
    scene, context = graph.CreateDefaultContext(), plant.CreateDefaultContext()
    least = np.inf
    for q in motion:
        plant.SetPositions(context, arm.posture(plant, q))
        poses = FramePoseVector()
        for frame, body in frames:
            poses.set_value(frame, body.EvalPoseInWorld(context))
        graph.get_source_pose_port(source).FixValue(scene, poses)
        query = graph.get_query_output_port().Eval(scene)
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(0.05):
            ids = {pair.id_A, pair.id_B}
            if ids & set(sides[0]) and ids & set(sides[1]):
                least = min(least, pair.distance)
    return least


def _joints_to(plant, body):
    holders = {
        plant.get_joint(k).child_body().index(): plant.get_joint(k) for k in plant.GetJointIndices()
    }
    while (joint := holders.get(body.index())) is not None:
        if joint.num_positions():
            yield joint
        body = joint.parent_body()


def _ways(arm, plant, k):
    return _joints_to(plant, plant.GetFrameByName(arm.frames[k]).body())


def run(shield, duration, send=None):
    """Positions that a shield commands, shape (k, n), and the share of each limit that is used."""
    q, v = [shield.position], [shield.velocity] * 3
    for k in range(round(duration / PERIOD)):
        if send is not None:
            send(shield, k)
        q.append(shield.command())
        v.append(shield.velocity)
    limits, orders = (
        shield.limits,
        (shield.limits.velocity, shield.limits.acceleration, shield.limits.jerk),
    )
    used = [
        float((np.abs(np.diff(v, n=k, axis=0)) / PERIOD**k / bound).max())
        for k, bound in enumerate(orders)
    ]
    assert limits.violation(np.array(q)).max() <= 0.0
    assert max(used) <= 1.0 + 1e-9
    assert shield.uncertified == 0
    return np.array(q)


def reach(shield, k):
    """Have both arms reach through each other."""
    if k == 0:
        shares = np.linspace(0.0, 1.0, 10)[:, None]
        shield.follow_positions(HOME + shares * np.tile(REACH, 2), 10.0)


@pytest.fixture(scope="module")
def met():
    """Motions of arms that reach through each other, by the arm that yields."""
    found = {}
    for yields in (None, "left", "right"):
        both = shield(yields=yields)
        found[yields] = run(both, 2.4, reach), both
    return found


def test_arms_that_reach_through_each_other_meet_and_stop_at_their_distance(met):
    """Without the shield they collide; with it, by distances of Drake's own, never below."""
    q, both = met[None]
    straight = HOME + np.linspace(0.0, 1.0, 40)[:, None] * np.tile(REACH, 2)
    assert capsule_distance(ARM, straight) < -0.02
    least = capsule_distance(ARM, q)
    assert FLOOR - 1e-9 <= least <= 0.02
    assert all(
        "second_" in pair
        for arm in ("left", "right")
        for pair in both[arm].status.limited_by
        if " and " in pair
    )


def test_the_arm_that_yields_is_the_one_that_leaves_its_way(met):
    goals = HOME + np.tile(REACH, 2)
    off = {y: np.abs(q[-1] - goals).reshape(2, 7).max(axis=1) for y, (q, _) in met.items()}
    assert off["left"][0] > 2.0 * off["left"][1]
    assert off["right"][1] > 2.0 * off["right"][0]
    # The other one does better than where both give way.
    assert off["left"][1] < off[None][1]
    assert off["right"][0] < off[None][0]
    for q, _ in met.values():
        assert capsule_distance(ARM, q) >= FLOOR - 1e-9


def test_which_arm_comes_first_changes_nothing():
    """The world frame is then another one, so that sums differ by rounding, which grows later."""
    yaw, p_AB = np.pi + 0.3, np.array([1.0, 0.15, 0.02])
    back = -RotationMatrix.MakeZRotation(-yaw).matrix() @ p_AB
    starts = HOME + 0.1 * np.random.default_rng(3).normal(size=14)
    motions = []
    for base, angle, order in ((p_AB, yaw, [0, 1]), (back, -yaw, [1, 0])):
        place = {"translation": base.tolist(), "rpy": [0.0, 0.0, angle]}
        arm = load_arm("panda", tool=None, pair={"arm": BARE, "base": place})
        names = [("left", "right")[k] for k in order]
        start = starts.reshape(2, 7)[order].ravel()
        both = shield(arm, names=names, yields="right", start=start)
        motions.append(run(both, 1.1, reach).reshape(-1, 2, 7)[:, order])
        assert " and second_" in ", ".join(both["right"].status.limited_by)
    np.testing.assert_allclose(*motions, atol=1e-9)


def test_an_arm_without_targets_rests_and_is_not_moved_by_the_other_one():
    """Until it is to yield: then it makes way."""
    start, goal = HOME + np.concatenate((np.zeros(7), REACH)), HOME[:7] + REACH

    def send(both, k):
        if k == 0:
            both.follow_positions({"left": np.linspace(HOME[:7], goal, 10)}, 10.0)

    q = run(still := shield(start=start), 2.4, send)
    np.testing.assert_array_equal(q[:, 7:], np.tile(start[7:], (len(q), 1)))
    assert "second_" in still["left"].status.limited_by[0]
    assert still["left"].status.blocked_for > 0.0
    assert still["right"].status.silent_for == np.inf
    assert still["right"].status.blocked_for == 0.0
    q_yield = run(shield(start=start, yields="right"), 2.4, send)
    assert np.abs(q_yield[-1, 7:] - start[7:]).max() > 0.05
    assert np.abs(q_yield[-1, :7] - goal).max() < np.abs(q[-1, :7] - goal).max()


def test_a_silent_arm_comes_to_rest_and_the_other_one_goes_on():
    """Velocities of one end; those of the other one come all the time. Each has its own kind."""

    def send(both, k):
        both["left"].follow_velocities(0.2 * np.ones(7))
        if k == 0:
            both["right"].follow_twists([0.0, 0.0, 0.0, 0.0, 0.0, 0.1])
        if k == 60:
            both["left"].rest()
            both["right"].follow_positions(HOME[7:])

    both = shield(settings=ShieldSettings(record=True))
    p_WE = both["right"].arm.kinematics().p_WE
    q = run(both, 1.0, send)
    v = np.diff(q, axis=0)[-1] / PERIOD
    np.testing.assert_allclose(v[:7], 0.2, atol=1e-6)
    np.testing.assert_array_equal(v[7:], 0.0)
    # The twist is in the world: up, as long as it was followed.
    rose = p_WE(q[-1, 7:]) - p_WE(HOME[7:])
    assert rose[2] > 0.01
    assert np.abs(rose[:2]).max() < 2e-3
    record = both["right"].record
    np.testing.assert_array_equal(record.command, q[1:, 7:])
    assert record.joints == ARM.joints[7:]


def test_a_view_and_a_record_show_both_arms_and_what_is_in_the_way_of_each():
    both = shield(settings=ShieldSettings(record=True))
    with ShieldView(both) as view:
        q = run(both, 1.4, lambda both, k: (reach(both, k), k % 10 or view.show()))
    record = both.record
    np.testing.assert_array_equal(record.command, q[1:])
    assert record.joints == both.joints == ARM.joints
    one, other = (both[name].record for name in both.names)
    np.testing.assert_array_equal(record.wanted, np.hstack((one.wanted, other.wanted)))
    assert any(
        b.startswith("second_") and not a.startswith("second_") for a, b in record.summary.pair_time
    )


@pytest.mark.long
def test_steps_in_c_are_those_of_numpy():
    """Where arms are in each other's way, and one yields; rounding grows there."""
    motions = []
    for compiled in (False, True):
        both = shield(yields="left", settings=ShieldSettings(compiled=compiled))
        motions.append(run(both, 1.1, reach))
        assert any(" and second_" in name for name in both["left"].status.limited_by)
    np.testing.assert_allclose(*motions, atol=1e-8)


@pytest.fixture(scope="module")
def far():
    """Two arms that cannot reach each other."""
    base = {**FACING, "translation": [2.6, 0.0, 0.0]}
    return load_arm("panda", tool=None, pair={"arm": BARE, "base": base})


def beside_a_table_that_rises(far, presses, compiled):
    """Velocities, shape (k, 14), and how often what was wanted was not free; see the next test."""
    p_WE = far.parts[0].kinematics().p_WE(far.home[:7])
    table = {
        "kind": "box",
        "name": "table",
        "speed": 0.26,
        "error": 0.001,
        "size": [0.4, 0.4, 0.05],
    }
    table["center"] = np.add(p_WE, [0.2, 0.0, -0.25]).tolist()
    limits = far.limits.replace(velocity=1.0, acceleration=4.0, jerk=50.0)
    settings = ShieldSettings(compiled=compiled)
    both, v = shield(far, limits=limits, obstacles=[table], settings=settings), []
    for t in PERIOD * np.arange(125):
        if presses:
            press = [0.5 * np.sin(4.0 * t), 0.7, 0.0, 0.5, 0.0, 0.5 * np.sin(3.0 * t), 0.0]
            both["left"].follow_velocities(press)
        wave = [np.cos(3.0 * t), 0.0, 0.0, 0.0, np.cos(4.0 * t), 0.0, np.sin(5.0 * t)]
        both["right"].follow_velocities(0.9 * np.array(wave))
        both.command(None, {"table": [0.0, 0.0, 0.1 * np.sin(2.5 * t)]})
        v.append(both.velocity)
    assert both.uncertified == 0
    return np.array(v), both._guard.part("held_back").item()


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.long)])
def test_an_arm_on_its_own_table_does_not_slow_the_other_one(far, compiled):
    """The left one is pressed on a table that rises: it stops, the right one goes on as ever."""
    v, held_back = beside_a_table_that_rises(far, True, compiled)
    alone, never = beside_a_table_that_rises(far, False, compiled)
    assert held_back > 10
    assert never == 0
    np.testing.assert_allclose(v[:, 7:], alone[:, 7:], atol=1e-9)
    if compiled:
        np.testing.assert_allclose(v, beside_a_table_that_rises(far, True, False)[0], atol=1e-6)


def test_the_arm_whose_pairs_fail_is_slowed_and_of_both_the_one_that_yields_first():
    sharing = shield()._guard._reading._within._sharing_of_arms
    left, right = sharing.members
    np.testing.assert_array_equal(sharing.certificate.groups.sum(axis=0), 1)
    last, no = 6.0, np.zeros(2)

    def steps(number, fails, compliance):
        return sharing.steps(np.array(number), np.array(fails), compliance).tolist()

    alike, yields = left + right, left + 0.03 * right
    assert steps(no, [True, False, True], alike) == [1.0, 0.0]
    assert steps(no, [False, False, True], alike) == [1.0, 1.0]
    assert steps(no, [False, False, True], yields) == [1.0, 0.0]
    assert steps([last, 0.0], [False, False, True], yields) == [0.0, 1.0]
    # A stop that is late and not free cannot be mended; the other arm is to stop for it then.
    assert steps([last, 0.0], [True, False, True], yields) == [0.0, 1.0]
    assert steps([last, last], [True, True, True], yields) == [0.0, 0.0]


def test_a_refused_call_for_both_arms_changes_nothing():
    both = shield()
    with pytest.raises(InvalidInputError, match="right: q: "):
        both.follow_positions({"left": HOME[:7] + 0.2, "right": np.full(7, 90.0)})
    np.testing.assert_array_equal(run(both, 0.2), np.tile(HOME, (11, 1)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DualArmShield(load_arm("panda"), PERIOD), "arm: panda has one tool; give pair"),
        (lambda: DualArmShield([ARM, ARM], PERIOD), "arm: must be one Arm with pair"),
        (lambda: shield(names=("a", "a")), "names: must be two different names"),
        (lambda: shield(names="ab"), "names: must be two names"),
        (lambda: shield(yields="middle"), "yields: must be 'left', 'right' or None"),
        (lambda: shield()["up"], "arm: no arm 'up'"),
        (lambda: shield()["left"].command(), "command: is that of both arms"),
        (lambda: shield().follow_positions(HOME[:7]), r"targets: must be of shape \(14,\)"),
        (lambda: led().command("now"), "t: must be a finite time"),
        (lambda: shield().follow_positions({}), "targets: must be of left or right"),
        (lambda: shield(limits=load_arm("panda").limits), "limits: are of 7 joints, but both"),
    ],
)
def test_what_does_not_go_is_refused(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


def test_a_guard_of_two_arms_keeps_them_apart():
    """The base of the shield: joint targets of both at once."""
    clearance, _ = arm_clearance(ARM, [], HOME)
    guard = Guard(JointStream(limits=LIMITS, home=HOME, clearance=clearance), PERIOD)
    q = np.array([guard.command(HOME + np.tile(REACH, 2)) for _ in range(80)])
    assert FLOOR - 1e-9 <= capsule_distance(ARM, q) <= 0.02


def chain(side, y):
    """A chain of six joints on a torso, in URDF."""
    text, parent = "", "torso"
    for k, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"), start=1):
        origin = f"0 {y} 0.3" if k == 1 else "0.15 0 0"
        text += f"""
  <joint name="{side}_{k}" type="revolute"><parent link="{parent}"/><child link="{side}{k}"/>
    <origin xyz="{origin}"/><axis xyz="{axis}"/>
    <limit lower="-2.5" upper="2.5" velocity="2" effort="50"/></joint>
  <link name="{side}{k}"><inertial><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.07 0 0" rpy="0 1.5708 0"/>
      <geometry><cylinder radius="0.03" length="0.1"/></geometry></collision></link>"""
        parent = f"{side}{k}"
    return text


@pytest.fixture(scope="module")
def bimanual(tmp_path_factory):
    """A model with a torso that turns, and two arms on it."""
    file = tmp_path_factory.mktemp("bimanual") / "bimanual.urdf"
    file.write_text(f"""<robot name="bimanual">
  <link name="base"/>
  <joint name="waist" type="revolute"><parent link="base"/><child link="torso"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="50"/></joint>
  <link name="torso"><inertial><mass value="5"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.1 0.2 0.5"/></geometry></collision></link>
  {chain("left", 0.2)}{chain("right", -0.2)}
</robot>""")
    return file


@pytest.mark.long
def test_both_arms_of_one_model_follow_poses_on_a_torso_that_is_held(bimanual):
    """The torso counts once, and for both; it stands where it is locked."""
    home = [0.2, 0.6, -1.2, 0.1, 0.9, 0.0, -0.2, 0.6, -1.2, -0.1, 0.9, 0.0]
    changes = {"frame": "left6", "pair": {"frame": "right6"}, "home": home}
    arm = load_arm(bimanual, lock={"waist": 0.3}, **changes)
    limits = arm.limits.replace(acceleration=5.0, jerk=100.0)
    both = shield(arm, limits=limits)
    names = {body for pair in both.clearance.names for body in pair}
    assert names == {"torso", *(f"{side}{k}" for side in ("left", "right") for k in range(1, 7))}
    assert any({"left6", "right6"} == set(pair) for pair in both.clearance.names)
    # Both tools are to come to one place.
    kinematics = {name: both[name].arm.kinematics() for name in both.names}
    middle = np.mean([k.p_WE(both[n].position) for n, k in kinematics.items()], axis=0)

    def send(both, step):
        if step == 0:
            for name, k in kinematics.items():
                R = RotationMatrix(k.R_WE(both[name].position)).ToQuaternion().wxyz()
                both[name].follow_poses(np.concatenate((middle, R)))

    q = run(both, 2.0, send)
    assert FLOOR - 1e-9 <= capsule_distance(arm, q) <= 0.02
    with pytest.raises(InvalidInputError, match=r"'waist' moves both tools .* arm\.lock"):
        shield(load_arm(bimanual, **{**changes, "home": [0.0, *home]}), limits=None)


def test_both_arms_go_on_from_where_they_were_pushed_and_one_alone_does_not():
    both = shield()
    q = both.position + 0.05
    both.resume(q)
    np.testing.assert_allclose(both.command(), q, atol=1e-3)
    with pytest.raises(InvalidInputError, match="resume: is that of both arms"):
        both["left"].resume(q[:7])
    with pytest.raises(InvalidInputError, match=r"q: is .* outside the position limits"):
        both.resume(q + 10.0)


def test_each_arm_tells_of_its_own_joints_all_that_both_tell():
    both = led()
    q = both.command(0.0)
    for name, block in (("left", slice(7)), ("right", slice(7, 14))):
        side = both[name]
        assert np.array_equal(side.newest.position, q[block])
        assert np.array_equal(side.newest.stop(1).position, both.newest.stop(1).position[block])
        assert (side.assumptions, side.overruns) == (both.assumptions, both.overruns)
        assert (side.late_samples, side.late_stops, side.uncertified) == (0, 0, 0)


def test_limits_of_both_change_while_they_move():
    both = led()
    left, right = both["left"], both["right"]
    narrow = LIMITS.replace(velocity=0.3, velocity_lower=-0.1)
    left.follow_positions(left.position + 0.3)
    right.follow_velocities([[-0.5] + [0.0] * 6] * 2, rate=0.5)
    with pytest.raises(InvalidInputError, match="change_limits: is that of both arms"):
        left.change_limits(narrow.select(range(7)))
    pending = []
    for k in range(90):
        if k == 25:
            both.change_limits(narrow)
        both.command()
        pending.append(both.status["right"].limits_pending)
        v, limits = both.velocity, both.limits
        assert (np.abs(v) <= limits.toward("velocity", v) + 1e-9).all()
    assert 0 < sum(pending) < 20
    np.testing.assert_array_equal(right.limits.velocity_lower, np.full(7, -0.1))
    assert right.velocity[0] == pytest.approx(-0.1)


def served(arm, **changes):
    """A shield of two arms in a process of its own."""
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
    return DualArmShield(arm, PERIOD, **{"limits": limits, "process": True, **changes})


def test_a_process_commands_both_arms_and_tells_of_each():
    """One stop of all joints is published; targets, counts and statuses are of each arm."""
    base = {"translation": [6.0, 0.0, 0.0]}
    arm = load_arm("planar6", pair={"arm": "planar6", "base": base})
    cup = {"kind": "ball", "name": "cup", "center": [0, 9, 0], "radius": 0.1, "speed": 0.1}
    with served(arm, names=("a", "b"), obstacles=[cup]) as shield:
        home, (a, b) = shield.position, (shield["a"], shield["b"])
        assert a.follow_positions(a.position + 0.2) == 1
        shield.place_obstacles({"cup": [0.0, 0.0, 0.0]})
        assert wait_for(lambda: a.status.arrived == 1)
        np.testing.assert_allclose(shield.position[:6], home[:6] + 0.2, atol=2e-3)
        # The other one rests, and has followed nothing.
        np.testing.assert_array_equal(shield.position[6:], home[6:])
        assert b.status.silent_for == np.inf
        assert (a.counts.chunks, b.counts.chunks) == (1, 0)
        moves = np.repeat([np.full(6, 0.5)], 100, axis=0)
        both = shield.follow_velocities({"a": 0.0 * moves, "b": moves}, rate=10)
        assert both == {"a": 2, "b": 1}
        reader = CommandReader(shield.path)
        assert wait_for(lambda: b.velocity.max() > 0.49)
        command = reader.at()
        assert command.position.shape == command.stop(50).velocity.shape == (12,)
        assert not command.stop(50).velocity.any()
        shield.change_limits(shield.limits.replace(velocity=0.2))
        assert wait_for(lambda: "change of limits" not in b.status.limited_by)
        assert wait_for(lambda: f"{b.arm.joints[0]} velocity" in b.status.limited_by)
        np.testing.assert_array_equal(b.limits.velocity, np.full(6, 0.2))
        assert not shield.uncertified
        # Each arm has its own alarm, and records in the memory.
        with pytest.raises(InvalidInputError, match=r"^b: q: must be"):
            shield.follow_positions({"a": home[:6], "b": home[:5]})
        with pytest.raises(InvalidInputError, match="command: is called by the shield's own"):
            shield.command()
        assert shield.status["a"].arrived == 1
    assert not shield.velocity.any()


@pytest.mark.long
def test_arms_of_a_process_keep_clear_and_one_yields_as_soon_as_it_is_told():
    start = HOME + np.concatenate((np.zeros(7), REACH))
    with served(ARM, start=start) as shield:
        left, right, least = shield["left"], shield["right"], []
        left.follow_positions(np.linspace(HOME[:7], HOME[:7] + REACH, 10), rate=10)

        def comes_to(is_there):
            least.append(shield.clearance.least_along(shield.position[None]).min())
            return is_there()

        assert wait_for(lambda: comes_to(lambda: left.status.blocked_for > 0.3))
        assert "second_" in left.status.limited_by[0]
        np.testing.assert_array_equal(right.position, start[7:])
        shield.yields = "right"
        assert wait_for(lambda: comes_to(lambda: np.abs(right.position - start[7:]).max() > 0.05))
        assert min(least) >= 0.005 - 1e-9
        assert not shield.uncertified
