"""Is a path within reach, and what does it come close to?"""

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    check_reach,
    load_arm,
    load_experiment,
    make_experiment,
    shipped_experiments,
)
from drake_rnn.experiment import follow

KNOWN = "slc_nephroid_known"
TWO_RODS = """<robot name="rods">
  <link name="base"/><link name="upper"/><link name="lower"/><link name="tip"/>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tip"/>
    <origin xyz="0.5 0 0"/></joint>
</robot>
"""


@pytest.fixture
def rods(tmp_path):
    """Two rods of half a metre; a circle about their base is as far away all along."""
    (tmp_path / "rods.urdf").write_text(TWO_RODS)

    def circle(radius, start=(0.1, 0.9), **more):
        path = {"kind": "circle", "size": radius, "centre": [0, 0, 0], "period": 8, **more}
        return make_experiment(
            {
                "arm": {"model": str(tmp_path / "rods.urdf"), "frame": "tip"},
                "task": "xy",
                "start": list(start),
                "path": path,
                "law": {
                    "kind": "simultaneous_learning",
                    "jacobian": "known",
                    "acceleration_bound": "none",
                },
                "period": 1e-3,
                "duration": 8,
            }
        )

    return circle


def has_a_smooth_path(name):
    """Not those with a target, with corners taken at speed, or at a limit on purpose."""
    raw = {"recursive_square", "recursive_square_printed", "pinv_square", "rnn_square"}
    raw |= {"horizon_square"}
    # It leads over the plate's edge, to show what happens then.
    raw |= {"contact_edge"}
    # They ask for 1.12 rad/s^2 where 1.1 is allowed, to show that the law stays at its bound.
    raw |= {"slc_four_ring_fast", "slc_four_ring_fast_dynamic"}
    # It asks for 2.55 rad/s^2 where 2.5 is allowed, as the paper's figure does.
    raw |= {"galjdf_clover_bound"}
    return "adjustment" not in name and name not in raw


@pytest.mark.nightly
@pytest.mark.parametrize("name", [*filter(has_a_smooth_path, shipped_experiments())])
def test_the_paths_of_shipped_experiments_come_close_to_nothing(name):
    """But for those of which it is known what they come close to, or ask for beyond a bound."""
    assert [
        " ".join(text.split()[1:5]) for text in check_reach(load_experiment(name))
    ] == CLOSE.get(name, [])


# The first words of what is said: three have bounds below what the path asks for, as `expect` says.
CLOSE = {
    "simplified_dual_bounds": ["asks joint_2 for a"],
    "zeroing_bounds": ["asks panda_joint4 for a"],
    "zeroing_fixed_time": ["near-singular posture near t"],
    "zeroing_prescribed": ["asks iiwa_joint_1 for a"],
}


def test_a_path_out_of_reach_is_refused_with_the_place():
    with pytest.raises(InvalidInputError) as caught:
        check_reach(load_experiment(KNOWN, {"path.size": 2}))
    message = str(caught.value)
    assert message.startswith("path: out of reach: panda misses the point (0.2069, ")
    for part in (") m, at t = ", " mm; the largest miss is ", " m at t = "):
        assert part in message
    assert "\n" not in message


def test_the_place_of_a_miss_is_where_the_path_leaves_the_reach(rods):
    """A circle of 0.5 m about (0.55, 0, 0): 0.05 m too far at its start, near x = 1.05."""
    with pytest.raises(InvalidInputError, match=r"misses the point \(1\.05, 0\) m, at t = 0 s, by"):
        check_reach(rods(0.5, centre=[0.55, 0, 0]))


@pytest.mark.parametrize("radius", [0.9, 0.999, 0.99999, pytest.param(1.0, marks=pytest.mark.long)])
def test_a_path_just_within_reach_is_found(rods, radius):
    """1e-7 m: where the arm is straight, J is singular, and Newton's method merely halves."""
    assert follow(rods(radius)).miss.max() < 1e-7


@pytest.mark.long
def test_a_path_beyond_reach_by_less_than_a_millimetre_is_followed_as_near_as_can_be(rods):
    """Of 1.0005 m one can reach 1 m; the 1e-6 m are an elbow that is not quite straight."""
    np.testing.assert_allclose(follow(rods(1.0005)).miss, 0.0005, atol=1e-6)
    check_reach(rods(1.0005))
    with pytest.raises(InvalidInputError, match=r"by (1\.99|2) mm"):
        check_reach(rods(1.002))


def test_an_outstretched_arm_finds_its_way_back(rods):
    """J is singular in just the direction to the path."""
    experiment = rods(0.9, start=(0.0, 0.0))
    assert follow(experiment).miss.max() < 1e-7


def test_a_path_past_a_singular_posture_is_warned_of(rods):
    away, near = check_reach(rods(0.99999))
    assert away.startswith("path: begins 0.525 m from where the tool is at the start")
    assert near.startswith("path: near-singular posture near t = ")
    assert "smallest singular value of J 0.00" in near
    (away,) = check_reach(rods(0.8))
    assert away.startswith("path: begins 0.472 m from where the tool is at the start")


def test_a_path_in_another_plane_is_warned_of_with_figures():
    """The nephroid of the xz plane leads past the shoulder's limit, and too fast."""
    warnings = check_reach(load_experiment(KNOWN, {"path.plane": "xz"}))
    text = "\n".join(warnings)
    assert "panda_joint2 goes 0.1" in text
    assert "rad beyond its limit near t = 5." in text
    assert "for a velocity of 0.9" in text
    assert "its limit is 0.5" in text
    assert "for an acceleration of 2." in text


def test_speed_asked_for_is_that_of_the_least_squares_motion(rods):
    """1e-4: the circle's turn of 2 pi in 8 s is the shoulder's alone if the elbow is still.

    The elbow is still, as the radius stays; least squares spreads nothing, J being square.
    """
    reach = follow(rods(0.8))
    np.testing.assert_allclose(reach.velocity[:, 0], 2 * np.pi / 8, rtol=1e-4)
    np.testing.assert_allclose(reach.velocity[:, 1], 0, atol=1e-4)
    np.testing.assert_allclose(reach.acceleration, 0, atol=1e-3)


def test_only_as_much_of_the_path_is_followed_as_the_run_is_long():
    reach = follow(load_experiment(KNOWN, {"duration": 2}))
    assert reach.time[-1] == 2
    assert follow(load_experiment(KNOWN)).time[-1] == 8


# Open paths, sequences and orientations.

POSED = {
    "arm": "panda",
    "law": {"kind": "pseudoinverse"},
    "period": 1e-3,
    "duration": 10,
}


def test_an_open_path_is_followed_to_its_end_and_not_further():
    path = {"kind": "line", "by": [0.0, 0.2, 0.0], "period": 4}
    reach = follow(make_experiment({**POSED, "path": path}))
    assert reach.time[-1] == 4
    np.testing.assert_allclose(reach.desired[-1] - reach.desired[0], [0, 0.2, 0], atol=1e-12)
    too_far = {**path, "by": [0.0, 1.2, 0.0]}
    with pytest.raises(InvalidInputError, match=r"path: out of reach: .* at t = 2\.\d* s"):
        check_reach(make_experiment({**POSED, "path": too_far}))


def test_every_part_of_a_sequence_must_be_within_reach():
    near = {"path": {"kind": "circle", "size": 0.05, "period": 2, "timing": "sin2", "laps": 1}}
    far = {"path": {"kind": "line", "by": [0.8, 0, 0], "period": 2, "timing": "sin2"}}
    experiment = make_experiment({**POSED, "path": {"kind": "sequence", "parts": [near, far]}})
    with pytest.raises(InvalidInputError, match=r"path: out of reach: .* at t = [23]\.\d* s"):
        check_reach(experiment)
    parts = [near, far]
    short = make_experiment({**POSED, "duration": 2, "path": {"kind": "sequence", "parts": parts}})
    assert check_reach(short) == []


def test_a_bridge_must_be_within_reach_too():
    """Both ends are; the way between, 0.4 m/s outwards at first, leads 0.8 m away."""
    out = {"path": {"kind": "line", "by": [0.4, 0, 0], "period": 1}}
    back = {"kind": "circle", "size": 0.02, "period": 2, "timing": "sin2", "centre": [0.4, 0, 0.6]}
    path = {"kind": "sequence", "parts": [out, {"path": back, "bridge": 2.0}]}
    with pytest.raises(InvalidInputError, match=r"path: out of reach.* at t = 1\.\d* s, by"):
        check_reach(make_experiment({**POSED, "path": path}))


def test_an_orientation_along_the_path_must_be_within_reach():
    turn = {"kind": "line", "by": [0, 0, 0], "turn": [0, 0, 1.0], "period": 2, "timing": "quintic"}
    document = {**POSED, "task": "pose", "path": turn}
    reach = follow(make_experiment(document))
    assert reach.miss.max() < 1e-6
    assert np.ptp(reach.position, axis=0).max() > 0.5
    np.testing.assert_allclose(reach.desired, np.tile(reach.desired[0], (400, 1)))
    over = {**turn, "turn": [0, 0, 6.0]}
    with pytest.raises(InvalidInputError, match="path: out of reach"):
        check_reach(
            make_experiment({**document, "arm": "planar6", "path": {**over, "turn": [1, 0, 0]}})
        )


def test_a_long_path_is_followed_in_steps_of_a_centimetre():
    laps = [{"path": {"kind": "circle", "size": 0.15, "period": 4, "timing": "sin2", "laps": 6}}]
    experiment = make_experiment(
        {**POSED, "duration": 30, "path": {"kind": "sequence", "parts": laps * 2}}
    )
    reach = follow(experiment)
    step = np.linalg.norm(np.diff(reach.desired, axis=0), axis=1)
    assert len(reach.time) > 400
    assert step.max() < 0.02


UPRIGHT = {"kind": "axis", "axis": [0, 0, 1]}
POSITION = {"kind": "position"}


def a_circle_of_a_ur5(*objectives, **more):
    """With the home posture's tilt of the tool, half of it is out of reach."""
    path = {"kind": "circle", "size": 0.0397, "period": 4, "timing": "sin2"}
    law = {"kind": "adaptive", "jacobian": "known"}
    limits = {"velocity": 0.5, "acceleration": 1.0}
    document = {"arm": "ur5", "task": list(objectives), "path": path, "law": law, "limits": limits}
    return make_experiment({**document, "period": 1e-3, "duration": 4, **more})


@pytest.mark.long
def test_objectives_that_cannot_all_be_met_are_told_with_what_is_missed():
    """Beside the point where they cannot, each is met alone; they have prices, so it runs."""
    (text,) = check_reach(a_circle_of_a_ur5(POSITION, UPRIGHT))
    assert text.startswith("task: followed from the start, it cannot all be met from t = 1.1")
    assert "misses position xyz by 0.0" in text
    assert "axis by 0." in text
    reach = follow(a_circle_of_a_ur5(POSITION, UPRIGHT))
    assert reach.miss[reach.time < 1.0].max() < 1e-6 < 0.02 < reach.miss.max()
    assert text.endswith("another start may lead all along it")
    assert "task: " not in " ".join(check_reach(a_circle_of_a_ur5(POSITION)))


def test_from_another_start_the_same_objectives_are_met():
    """The tool is where it is at home, with its axis, on another branch of the arm's postures."""
    start = [2.7219, -1.4859, 1.2591, 4.8548, 1.1356, 0.93]
    toward = load_arm("ur5")
    toward = toward.kinematics().R_WE(toward.home)[:, 2].tolist()
    experiment = a_circle_of_a_ur5(POSITION, {**UPRIGHT, "toward": toward}, start=start)
    assert follow(experiment).miss.max() < 1e-6
    assert "task: " not in " ".join(check_reach(experiment))


@pytest.mark.long
def test_the_posture_that_comes_nearest_is_one_of_least_error():
    """J^T e = 0 there, where e is not."""
    experiment = a_circle_of_a_ur5(POSITION, UPRIGHT)
    reach = follow(experiment)
    worst = int(reach.miss.argmax())
    kinematics, q = experiment.arm.kinematics(), reach.position[worst]
    desired = experiment.law_task.desired(experiment.desired, float(reach.time[worst]))[0]
    lever = np.array([1.0, 1.0, 1.0, 0.2, 0.2])
    error = lever * (desired - experiment.law_task.coordinates(kinematics, q))
    J = lever[:, np.newaxis] * experiment.law_task.J(kinematics, q)
    assert np.linalg.norm(error) == pytest.approx(reach.miss[worst])
    assert np.linalg.norm(J.T @ error) < 0.02 * np.linalg.norm(error)


@pytest.mark.long
def test_a_range_that_holds_asks_for_nothing():
    """The tool may tilt by half a radian, and the same circle is met; by 0.05 it is not."""
    wide, narrow = ({**UPRIGHT, "within": angle} for angle in (0.5, 0.05))
    assert follow(a_circle_of_a_ur5(POSITION, wide)).miss.max() < 1e-6
    assert follow(a_circle_of_a_ur5(POSITION, narrow)).miss.max() > 5e-3


def test_what_no_joint_moves_is_not_near_singular():
    """The axis of a planar arm's tool stands as it is."""
    document = {
        **{"arm": "planar6", "task": [{"kind": "position", "axes": "xy"}, UPRIGHT]},
        **{"path": {"kind": "circle", "size": 0.05, "period": 4}, "period": 1e-3, "duration": 4},
        "law": {"kind": "adaptive", "jacobian": "known"},
    }
    assert "singular" not in " ".join(check_reach(make_experiment(document)))


@pytest.mark.long
def test_a_point_that_moves_is_aimed_at_where_it_is():
    assert check_reach(load_experiment("adaptive_remote_centre_moving")) == []
