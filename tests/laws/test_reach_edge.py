"""Rest where a target is out of reach, and what can be braked before the edge of reach."""

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, adaptive

from drake_rnn import load_experiment, run_many
from drake_rnn.laws.parts import reach_edge
from drake_rnn.laws.parts.jacobian import Measurement
from drake_rnn.laws.parts.path_task import approach
from drake_rnn.laws.parts.reach_edge import Change, ReachEdge, RestPosture, bend, pose_after
from drake_rnn.robot.load_arm import load_arm, screws_of
from drake_rnn.robot.rotation import rotation_error
from drake_rnn.runs.evaluation import rest_caveats

JERKY = LIMITS.replace(jerk=20.0)
EDGE = ReachEdge(JERKY, np.ones(3), 1e-3)
# Of an arm that is stretched out but for 0.08 rad.
_LEFT, _RIGHT = (np.linalg.qr(np.random.default_rng(k).normal(size=(k, k)))[0] for k in (3, 7))
STRETCHED = _LEFT @ np.diag([0.04, 0.5, 0.6]) @ _RIGHT[:3]
OUT = {
    "arm": "iiwa14",
    "path": {"kind": "line", "by": [0.9, 0.0, 0.2], "period": 3, "timing": "quintic"},
    "on_unreachable": "follow",
    "limits": {"velocity": 1.0, "acceleration": 3.0, "jerk": 60.0},
    "period": 1e-2,
    "duration": 9,
    "window": None,
    "accept": None,
}


def runs(*changes):
    many = run_many([load_experiment("adaptive_nephroid_known", OUT | each) for each in changes])
    return many, many.metrics["rest_swing_max_rad_s"], many.metrics["rest_velocity_max_rad_s"]


def law(**fields):
    return {"law": {"kind": "adaptive", **fields}}


@pytest.mark.long
@pytest.mark.parametrize("case", [{}, {"task": "pose"}, {"arm": "panda"}])
def test_an_arm_comes_to_rest_where_its_target_is_out_of_reach(case):
    """Without the bound of the jerk it did so before."""
    many, swing, last = runs(law() | case)
    assert swing[0] < 1e-3
    assert last[0] < 0.01
    for name in ("position", "velocity", "acceleration"):
        unit = {"position": "rad", "velocity": "rad_s", "acceleration": "rad_s2"}[name]
        assert many.metrics[f"{name}_violation_max_{unit}"][0] < 1e-9
    assert many.metrics["held_jerk_violation_max_rad_s3"][0] < 1e-9


@pytest.mark.long
def test_without_braking_before_the_edge_it_swings(monkeypatch):
    monkeypatch.setattr(ReachEdge, "at", lambda *_: None)
    _, swing, last = runs(law())
    assert swing[0] > 0.2
    assert last[0] > 0.2


@pytest.mark.long
def test_a_joint_that_its_envelope_stops_before_the_limit_counts_as_one_at_it(monkeypatch):
    """An FR3's velocity envelope has joint 2 rest 8 mrad before its position limit."""
    way = {"kind": "line", "by": [0.162, 0.091, -1.037], "period": 3, "timing": "quintic"}
    limits = {"velocity": 1.0, "acceleration": 3.0}
    case = {"arm": "fr3", "path": way, "limits": limits}
    _, swing, last = runs(law() | case)
    assert swing[0] < 1e-3
    assert last[0] < 0.005
    monkeypatch.setattr(ReachEdge, "_room", _room_at_limits)
    _, swing, _ = runs(law() | case)
    assert swing[0] > 0.1


def _room_at_limits(edge, toward, q):
    limits = edge.limits
    room = np.where(toward > 0.0, limits.position_upper - q, q - limits.position_lower)
    return np.clip(room / 0.01, 0.0, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("jerk", [60.0, None])
def test_with_a_learned_jacobian_it_comes_to_rest_too(jerk):
    limits = {"velocity": 1.0, "acceleration": 3.0} | ({"jerk": jerk} if jerk else {})
    # With a longer period it learns more slowly, and comes to rest later.
    _, swing, last = runs(law(jacobian="learned") | {"limits": limits, "period": 4e-3})
    assert swing[0] < 0.01
    assert last[0] < 0.02


@pytest.mark.nightly
@pytest.mark.parametrize(
    "kind", ["pseudoinverse", "simultaneous_learning", "projection", "zeroing"]
)
def test_what_moves_on_behind_a_safety_is_warned_of(kind):
    """Where it is not warned of, no joint is faster than 0.02 rad/s in the end."""
    given = OUT | {"law": {"kind": kind}, "safety": {"bounds": True}, "period": 2e-3}
    limits = [{"velocity": 1.0, "acceleration": 3.0}, OUT["limits"]]
    experiments = [
        load_experiment("adaptive_nephroid_known", given | {"limits": x}) for x in limits
    ]
    many = run_many(experiments, record=["position"])
    for row, experiment in enumerate(experiments):
        fastest = abs(np.diff(many.series["position"][row][-500:], axis=0)).max() / 2e-3
        assert fastest < 0.02 or rest_caveats(experiment, many.row(row))


def test_what_is_left_of_a_way_can_be_braked():
    """At most a third of the acceleration is needed, and an eighth of the jerk."""
    way = np.geomspace(1e-4, 3.0, 4000)
    speed = EDGE.stoppable(way)
    assert (np.diff(speed) > 0.0).all()
    acceleration = np.gradient(speed, way) * speed
    jerk = np.gradient(acceleration, way) * speed
    assert acceleration.max() <= JERKY.acceleration.min() / 3.0
    assert np.quantile(abs(jerk), 0.99) <= 0.125 * JERKY.jerk.min() * 1.01


def test_where_a_motion_brings_next_to_nothing_the_arm_rests():
    speed = EDGE.speed(np.array([0.0, 1e-3, 2.5e-3, 5e-3]), 0.1)
    assert (np.diff(speed) > 0.0).all()
    assert speed[0] == 0.0
    assert speed[2] <= 4e-3 < 0.03 < speed[3]


def planar(q):
    """Return the Jacobian of two links of 0.4 and 0.3 m, shape (2, 2)."""
    first, second = 0.4 * np.exp(1j * q[0]), 0.3 * np.exp(1j * (q[0] + q[1]))
    columns = 1j * np.array([first + second, second])
    return np.array([columns.real, columns.imag])


def test_the_way_left_is_told_from_the_last_motion():
    """Stretched by an elbow, the singular value falls by 0.12 m for each radian."""
    edge = ReachEdge(JERKY, np.ones(2), 1e-3)
    q, moved = np.array([-0.043, 0.1]), np.array([3e-4, -7e-4])
    J = planar(q)
    change = Change(J - planar(q - moved), moved)
    error, wanted = np.array([0.3, 0.0]), np.array([0.1, 0.0])
    least = np.linalg.svd(J)[1][-1]
    growth = least / np.linalg.norm(q)
    beyond = 1.0 - least**2 / (2.0 * edge.reach * 0.3)
    known = edge.at(J, error, wanted, lambda: change).most[0]
    np.testing.assert_allclose(known, edge.speed(least, growth) / beyond, rtol=0.05)
    # A motion along the path tells nothing of it.
    aside = Change(change.J, np.array([7e-4, 3e-4]))
    for other in (None, aside):
        most = edge.at(J, error, wanted, lambda other=other: other).most[0]
        np.testing.assert_allclose(most, edge.speed(least, edge.reach) / beyond, rtol=0.05)


def test_far_out_of_reach_the_other_directions_are_slower():
    """There a joint turns them as well: the same error needs a smaller motion."""
    axes, S = np.linalg.eigh(STRETCHED @ STRETCHED.T)[1], 1e-6 * np.eye(3)
    near, far = (
        axes[:, 1] @ met(EDGE, STRETCHED, out * axes[:, 0] + 0.02 * axes[:, 1], HOME, S)
        for out in (0.05, 0.8)
    )
    assert 0.0 < far < 0.7 * near


def test_the_task_is_softer_where_joints_are_fast_and_their_jerk_is_low():
    slow = ReachEdge(JERKY.replace(jerk=0.3), np.ones(3), 1e-3)
    S, feedback, v = 1e-6 * np.eye(3), np.array([0.1, 0.0, 0.0]), np.full(7, 0.3)
    softer = slow.softness(S, feedback, v)
    assert softer[0, 0] > 1e-3
    many = slow.softness(np.array([S, S]), np.array([feedback] * 2), np.array([v, 0.0 * v]))
    np.testing.assert_allclose(many, [softer, S])
    # Neither at rest, nor on a path, nor with a jerk that turns the acceleration soon.
    for edge, back, joints in ((slow, feedback, 0.0 * v), (slow, 0.0 * feedback, v)):
        np.testing.assert_array_equal(edge.softness(S, back, joints), S)
    np.testing.assert_array_equal(EDGE.softness(S, 0.9 * feedback, v), S)


def met(edge, J, error, q, softness, change=None):
    whole = approach(error, 100.0, 0.05, 0.1)
    at = edge.at(edge.free(J, error, q), error, whole, lambda: change)
    if at is None:
        return whole
    return edge.feedback(
        at, whole, error, lambda e: approach(e, 100.0, 0.05, 0.1), lambda v: v, softness
    )[0]


def test_the_feedback_is_braked_in_the_direction_out_of_reach_alone():
    J, S = STRETCHED, 1e-6 * np.eye(3)
    squares, axes = np.linalg.eigh(J @ J.T)
    error = 0.5 * axes[:, 0] + 0.01 * axes[:, 2]
    back = met(EDGE, J, error, HOME, S)
    least = squares[0] ** 0.5
    joints = least * abs(axes[:, 0] @ back) / (squares[0] + 1e-6)
    most = EDGE.speed(np.array([least]), EDGE.reach)[0]
    assert joints <= 1.2 * most
    # The other direction is no longer slowed by what cannot be taken back.
    whole = approach(error, 100.0, 0.05, 0.1)
    assert axes[:, 2] @ back > 4.0 * axes[:, 2] @ whole > 0.0
    np.testing.assert_array_equal(met(EDGE, PANDA.J(HOME), error, HOME, S), whole)


def test_many_robots_get_what_each_gets_alone():
    postures = np.array([HOME, HOME, HOME + 0.02, HOME + 0.1])
    J = np.array([PANDA.J(HOME), STRETCHED, 0.9 * STRETCHED, PANDA.J(HOME + 0.1)])
    error = np.array([[0.5, 0.1, 0.0]] * 4)
    S = 1e-6 * np.eye(3)
    change = Change(0.01 * J[[1, 2, 3, 0]], 0.02 * J[:, 0])
    many = met(EDGE, J, error, postures, np.broadcast_to(S, (4, 3, 3)), change)
    for robot in range(4):
        one = slice(robot, robot + 1)
        alone = met(
            EDGE, J[one], error[one], postures[one], S[None], Change(*(x[one] for x in change[:2]))
        )
        np.testing.assert_array_equal(alone[0], many[robot])
        own = Change(*(x[robot] for x in change[:2]))
        single = met(EDGE, J[robot], error[robot], postures[robot], S, own)
        np.testing.assert_allclose(single, many[robot], rtol=1e-9, atol=1e-12)


def test_a_learned_growth_counts_only_where_joints_turn_late():
    """J known: always. 3 rad/s^2 within 60 rad/s^3 turn in 0.05 s, within 6 in half a second."""
    J, S = STRETCHED, 1e-6 * np.eye(3)
    error = np.array([0.5, 0.1, 0.0])
    change = Change(1e-4 * PANDA.J(HOME), np.full(7, 1e-3))
    for jerk, counts in ((60.0, False), (6.0, True)):
        edge = ReachEdge(JERKY.replace(jerk=jerk), np.ones(3), 1e-3)
        usual = met(edge, J, error, HOME, S)
        assert (met(edge, J, error, HOME, S, change) != usual).any()
        learned = met(edge, J, error, HOME, S, change._replace(learned=True))
        assert (learned != usual).any() == counts


def test_a_joint_at_its_limit_brings_nothing():
    limits = JERKY.replace(position_upper=np.append(HOME[:1] + 1e-12, JERKY.position_upper[1:]))
    J = PANDA.J(HOME)
    for way, brings in ((0.1, False), (-0.1, True)):
        error = way * J[:, 0]
        free = ReachEdge(limits, np.ones(3), 1e-3).free(J, error, HOME)
        assert (abs(free[:, 0]).max() > 1e-6) == brings
        np.testing.assert_array_equal(free[:, 1:], J[:, 1:])


def test_a_target_within_reach_is_not_braked_for():
    """The direction has 0.0016 m before its edge, by the growth of 0.5 m/rad."""
    _, axes = np.linalg.eigh(STRETCHED @ STRETCHED.T)
    S = 1e-6 * np.eye(3)
    for way, inside in ((0.0015, True), (0.02, False)):
        error = way * axes[:, 0]
        whole = approach(error, 100.0, 0.05, 0.1)
        assert (met(EDGE, STRETCHED, error, HOME, S) == whole).all() == inside


def test_preferred_velocities_fade_at_the_edge_and_can_be_braked():
    g = np.array([3.0, -3.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(EDGE.brake_preferred(g, 1.0, 1.0), g)
    most = 0.5 * EDGE.stoppable(np.array([3.0]))[0]
    assert most < 1.0
    near = EDGE.brake_preferred(g, 1.0, 1e-3)
    np.testing.assert_allclose(near[:3], 1e-6 * np.array([most, -most, 0.1]), rtol=5e-3)
    np.testing.assert_array_equal(EDGE.brake_preferred(g, 0.0, 0.5), 0.25 * g)


def test_a_learned_edge_counts_near_singular_postures_alone():
    """What is not learned yet looks like an edge; with the jerk bounded it is too late there."""
    learned = [
        adaptive(jacobian="learned", task_size=m, limits=limits).sampled(2e-3)._edge
        for m, limits in ((3, LIMITS), (6, LIMITS), (3, JERKY))
    ]
    assert [edge.begin for edge in learned] == [0.05, 0.3 * 0.05, np.inf]
    assert adaptive().sampled(2e-3)._edge.begin == np.inf
    error, wanted = np.array([0.5, 0.1, 0.0]), np.array([0.1, 0.0, 0.0])
    for factor, near in ((1.0, True), (1.4, False)):
        J = _LEFT @ np.diag([factor * 0.04, 0.5, 0.6]) @ _RIGHT[:3]
        for edge, is_near in ((learned[0], near), (learned[2], True)):
            assert (edge.at(J, error, wanted) is not None) == is_near
            many = edge.at(np.array([J, J]), np.array([error] * 2), np.array([wanted] * 2))
            assert (many is not None) == is_near


def test_what_a_law_wants_behind_a_safety_is_braked_near_the_edge_alone():
    wild, aside = 3.0 * _RIGHT[0] + 2.0 * _RIGHT[1], 5.0 * _RIGHT[4]
    out = np.linalg.eigh(STRETCHED @ STRETCHED.T)[1][:, 0]
    v = EDGE.brake(wild + aside, STRETCHED, 0.5 * out, HOME)
    most = EDGE.speed(np.array([0.04]), EDGE.reach)[0]
    assert 0.0 < _RIGHT[0] @ v < 1.2 * most < 0.3
    np.testing.assert_allclose(_RIGHT[1:4] @ v, [2.0, 0.0, 0.0], atol=1e-9)
    assert 0.0 < _RIGHT[4] @ v < 0.05
    calm = 1e-4 * _RIGHT[0]
    assert EDGE.brake(calm, STRETCHED, 0.5 * out, HOME) is calm
    assert EDGE.brake(wild, STRETCHED, 0.001 * out, HOME) is wild
    assert EDGE.brake(wild, PANDA.J(HOME), 0.001 * out, HOME) is wild


def test_the_numbers_that_a_law_gives():
    edge = adaptive(task_size=6, lever=0.2, limits=JERKY).sampled(2e-3)._edge
    np.testing.assert_array_equal(edge.scales, [0.2, 0.2, 0.2, 1.0, 1.0, 1.0])
    assert edge.seen_after == 2e-3


@pytest.mark.parametrize("arm", ["panda", "ur5"])
def test_the_slope_of_a_poses_error_turns_as_its_second_derivatives_say(arm):
    """Differences of the slope, whose Gauss-Newton part is right but for a small rotation error."""
    kinematics = load_arm(arm).kinematics()
    n = 7 if arm == "panda" else 6
    rng = np.random.default_rng(4)
    q = 0.7 * rng.normal(size=n)
    R_desired = kinematics.R_WE(q + 0.01 * rng.normal(size=n))
    p_desired = kinematics.p_WE(q) + np.array([0.3, -0.2, 0.4])
    weights = np.array([0.09, 0.09, 0.09, 1.0, 1.0, 1.0])

    def slope(q):
        J = np.vstack((kinematics.J_omega(q), kinematics.J(q)))
        rotation = rotation_error(kinematics.R_WE(q), R_desired)
        pull = weights * np.append(rotation, p_desired - kinematics.p_WE(q))
        return pull @ J, J, pull

    _, J, pull = slope(q)
    turns = np.array([(slope(q + d)[0] - slope(q - d)[0]) / 2e-6 for d in 1e-6 * np.eye(n)])
    gauss_newton = J.T @ (weights[:, None] * J)
    np.testing.assert_allclose(bend(J, pull), turns + gauss_newton, atol=1e-4)
    assert abs(bend(J, pull)).max() > 0.1


@pytest.mark.parametrize("arm", ["panda", "ur5"])
def test_a_jacobian_tells_the_pose_after_any_motion(arm):
    screws, rng = screws_of(load_arm(arm)), np.random.default_rng(5)
    q, d = rng.uniform(-2.0, 2.0, (2, 4, screws.n))
    before, after = screws.at(q), screws.at(q + d)
    J, J_after = (np.concatenate((x.J_omega, x.J), axis=-2) for x in (before, after))
    R, p, J_moved = pose_after(J, d)
    np.testing.assert_allclose(R @ before.R_WE, after.R_WE, atol=1e-13)
    np.testing.assert_allclose(before.p_WE + p, after.p_WE, atol=1e-13)
    np.testing.assert_allclose(J_moved, J_after, atol=1e-13)


def test_a_joint_that_slides_moves_the_pose_along_its_axis():
    """Of a joint that slides in front of one that turns, along and about the same axis."""
    J = np.zeros((6, 2))
    J[5, 0] = J[2, 1] = J[4, 1] = 1.0
    R, p, J_moved = pose_after(J, np.array([0.3, np.pi / 2.0]))
    np.testing.assert_allclose(p, [-1.0, 1.0, 0.3], atol=1e-15)
    np.testing.assert_allclose(R, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(J_moved[:, 0], J[:, 0], atol=1e-15)
    np.testing.assert_allclose(J_moved[3:, 1], [-1.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.long
def test_an_arm_is_led_to_a_least_error_and_not_to_a_saddle():
    kinematics = load_arm("ur5").kinematics()
    limits = load_arm("ur5").limits.replace(velocity=1.0, acceleration=0.3)
    edge = ReachEdge(limits, np.array([0.3, 0.3, 0.3, 1.0, 1.0, 1.0]), 4e-3)
    q = np.array([0.3, -0.8, 1.9, -0.9, -1.2, 0.4])
    v, R_desired, p_desired = 0.0 * q, kinematics.R_WE(q), -3.0 * kinematics.p_WE(q)

    def look(q):
        J = np.vstack((kinematics.J_omega(q), kinematics.J(q)))
        rotation = rotation_error(kinematics.R_WE(q), R_desired)
        return J, np.append(rotation, p_desired - kinematics.p_WE(q))

    start = edge.length(look(q)[1])
    # For 12 s, with joints that keep their bounds.
    for _ in range(600):
        J, error = look(q)
        R = kinematics.R_WE(q), R_desired
        way, found = edge.to_rest(True, J, R, error[3:], q, edge.stops(v))
        lower, upper = limits.held_velocity_box(q, v, 0.02)
        v = np.clip(np.where(found, edge.reach_posture(way, v, None), 0.0), lower, upper)
        q = q + 0.02 * v
    J, error = look(q)
    pull = edge.scales**2 * error
    bends = np.linalg.eigvalsh((J.T * edge.scales**2) @ J - bend(J, pull))
    assert abs(v).max() < 1e-3
    assert abs(pull @ J).max() < 1e-3
    assert bends[0] > 0.0
    assert edge.length(error) < start - 0.1


def test_what_is_within_reach_leads_nowhere():
    q = HOME
    edge = ReachEdge(LIMITS, np.array([0.3, 0.3, 0.3, 1.0, 1.0, 1.0]), 1e-3)
    J, R = np.vstack((PANDA.J_omega(q), PANDA.J(q))), PANDA.R_WE(q)
    there = q + 0.1
    away = PANDA.p_WE(there) - PANDA.p_WE(q)
    assert not edge.to_rest(True, J, (R, PANDA.R_WE(there)), away, q, 0.0 * q)[1]
    position = ReachEdge(LIMITS, np.ones(3), 1e-3)
    assert not position.to_rest(True, J, None, away, q, 0.0 * q)[1]


@pytest.mark.long
def test_a_pose_out_of_reach_does_not_keep_the_arm_near_a_saddle(monkeypatch):
    """The UR5's swings by 0.1 rad/s ten seconds after its target rests, if it is not led off."""
    way = {"kind": "line", "by": [0.744, -0.2, 0.755], "period": 3, "timing": "quintic"}
    limits = {"velocity": 1.0, "acceleration": 3.0}
    case = {"arm": "ur5", "task": "pose", "path": way, "limits": limits}
    case |= {"duration": 13, "period": 0.02}
    assert runs(law() | case)[2][0] < 1e-3
    monkeypatch.setattr(reach_edge, "_OUT", np.inf)
    assert runs(law() | case)[2][0] > 0.02


@pytest.mark.long
def test_slow_joints_come_to_rest_where_the_axes_tell(monkeypatch):
    """They overshoot the edge by a radian, and would come back to it again and again."""
    limits = {"velocity": 1.0, "acceleration": 0.3}
    case = OUT | law() | {"limits": limits, "duration": 12.5, "period": 0.02}

    def last_speed():
        experiment = load_experiment("adaptive_nephroid_known", case)
        (q,) = run_many([experiment], record=["position"]).series["position"]
        return abs(q[-1] - q[-26]).max() / 0.5

    assert last_speed() < 1e-6
    monkeypatch.setattr(reach_edge, "_OUT", np.inf)
    assert last_speed() > 0.02


def test_a_joint_with_a_low_jerk_rests_without_swinging():
    """Told where it is once its acceleration is 0, it passes its posture by 1 % of the way."""
    limits = LIMITS.replace(acceleration=3.0, jerk=3.0, velocity=1.0)
    edge, h = ReachEdge(limits, np.ones(6), 1e-3), 0.01
    for looks_ahead, passes in ((True, False), (False, True)):
        q, v, a = np.full(7, -1.0), np.zeros(7), np.zeros(7)
        q_most = q
        for _ in range(600):
            goal = edge.reach_posture(-q, v, a if looks_ahead else None)
            # The acceleration that leads to this velocity, once it can be 0 again.
            to = np.sign(goal - v) * np.sqrt(2.0 * 3.0 * abs(goal - v))
            a = np.clip(np.clip(to, -3.0, 3.0), a - 3.0 * h, a + 3.0 * h)
            v = v + h * a
            q = q + h * v
            q_most = np.maximum(q_most, q)
        assert (q_most.max() > 0.01) == passes


def test_the_axes_tell_where_a_position_is_nearest():
    """A Panda's finger tip that is wanted 3 m away rests where no joint brings it nearer."""
    edge, q = ReachEdge(LIMITS, np.ones(3), 1e-3), HOME
    J, away = np.vstack((PANDA.J_omega(q), PANDA.J(q))), np.array([3.0, 0.5, 0.8])
    way, found = edge.to_rest(True, J, None, away, q, 0.0 * q)
    assert found
    there = q + way
    left = PANDA.p_WE(q) + away - PANDA.p_WE(there)
    slope = left @ PANDA.J(there)
    free = np.minimum(there - LIMITS.position_lower, LIMITS.position_upper - there) > 1e-6
    assert abs(slope[free]).max() < 1e-6
    for bent in there + 0.02 * np.random.default_rng(0).normal(size=(20, 7)):
        bent = np.clip(bent, LIMITS.position_lower, LIMITS.position_upper)
        near = np.linalg.norm(PANDA.p_WE(q) + away - PANDA.p_WE(bent))
        assert near >= np.linalg.norm(left)


def resting(**changes):
    """Return where an arm rests whose target is 3 m away, with signals and a state."""
    edge = ReachEdge(LIMITS, np.ones(3), 1e-3)
    u = {"position": HOME, "J": PANDA.J(HOME), "J_omega": PANDA.J_omega(HOME)}
    u |= {"p_WE": PANDA.p_WE(HOME), "p_WE_desired": PANDA.p_WE(HOME) + np.array([3.0, 0.5, 0.8])}
    part = RestPosture(edge, 7, turns=False, exact=1.0)
    return part, u, {"v": np.zeros(7), **part.init(u, np.random.default_rng(0))} | changes


def test_the_posture_is_remembered_while_the_target_rests():
    """Joints that are fast somewhere else would otherwise be led to another one."""
    part, u, state = resting()
    velocity, first = part.step(state, u, 1e-3, np.zeros(3), True)
    assert first["leads"] == 1.0
    fast = state | first | {"v": np.array([2.0, -2.0, 2.0, 2.0, 2.0, 2.0, 2.0])}
    again, second = part.step(fast, u, 1e-3, np.zeros(3), False)
    np.testing.assert_allclose(second["rest"], first["rest"], atol=1e-6)
    np.testing.assert_allclose(again, velocity, atol=1e-5)
    moving, third = part.step(fast, u, 1e-3, np.array([1e-3, 0.0, 0.0]), True)
    assert moving is None
    assert third["leads"] == 0.0
    assert part.resumed(first)["leads"] == 0.0


def test_an_arm_that_can_stop_at_once_is_led_near_the_edge_alone():
    part, u, state = resting()
    assert part.step(state, u, 1e-3, np.zeros(3), False)[0] is None
    fast = state | {"v": np.full(7, 2.0)}
    assert abs(part.step(fast, u, 1e-3, np.zeros(3), False)[0]).max() > 0.0


def test_many_robots_are_led_to_rest_as_each_is_alone():
    edge = ReachEdge(JERKY, np.array([0.3, 0.3, 0.3, 1.0, 1.0, 1.0]), 1e-3)
    q = np.array([HOME, HOME + 0.02, HOME + 0.1])
    J = np.array([np.vstack((PANDA.J_omega(each), PANDA.J(each))) for each in q])
    R = np.array([PANDA.R_WE(each) for each in q])
    R_desired, away, v = R[::-1] + 0.0, np.array([[0.5, 0.1, 0.9]] * 3), 0.1 * (q - HOME)
    near = np.ones((3, 1), dtype=bool)
    begin = edge.stops(v)
    many, found = edge.to_rest(near, J, (R, R_desired), away, q, begin)
    assert found.all()
    assert abs(many).max(axis=1).min() > 0.05
    for robot in range(3):
        one = slice(robot, robot + 1)
        turns = R[one], R_desired[one]
        alone, _ = edge.to_rest(near[one], J[one], turns, away[one], q[one], begin[one])
        np.testing.assert_array_equal(alone[0], many[robot])
        turns = R[robot], R_desired[robot]
        single, _ = edge.to_rest(True, J[robot], turns, away[robot], q[robot], begin[robot])
        # The descent stops where it gains little, which rounding moves; versions of NumPy differ.
        np.testing.assert_allclose(single, many[robot], rtol=1e-6, atol=5e-8)


def test_only_laws_that_know_their_way_are_led_to_rest():
    pose, position = {"task_size": 6, "lever": 0.3}, {"sees_axes": True}
    for changes, knows in (
        (pose, True),
        (position, True),
        ({}, False),
        (pose | {"jacobian": "learned"}, False),
        (position | {"jacobian": "learned"}, False),
    ):
        law = adaptive(**changes)
        assert ("rest" in law.sampled(2e-3).state) == knows
        assert ("J_omega" in law.inputs) == (knows and "sees_axes" in changes)
    noisy = adaptive(**pose, measurement=Measurement(error=1e-5)).sampled(2e-3)
    assert noisy._rest.exact == 0.0
    assert adaptive(**pose).sampled(2e-3)._rest.exact == 1.0
