"""The parts of the peers' bench that need no peer: tasks, figures, what is left out."""

from xml.etree import ElementTree

import numpy as np
import pytest

import peers
from drake_rnn import InvalidInputError, load_experiment, simulate
from peer_schemes.chosen_tasks import BASE, OURS, chosen_tasks
from peer_schemes.figures import figures_of
from peer_schemes.ours import Ours, PlainLoop
from peer_schemes.rows import Row, columns, ratio
from peer_schemes.scheme import Motion, NoSolutionError, Scheme, run
from peer_schemes.tasks import POSITION, Braking, Task
from peer_schemes.urdf import without_shapes

H = 1e-3


@pytest.fixture(scope="module")
def tasks():
    return {name: make() for name, make in chosen_tasks().items()}


@pytest.fixture(scope="module")
def short():
    experiment = load_experiment(BASE, {"accept": None, "duration": 0.3, "window": [0.2, 0.3]})
    return Task("short", experiment, 0.1, oriented=False)


class Still(Scheme):
    """Leaves the arm at rest until it finds no solution any more."""

    name, setting = "still", ""

    def pose(self, q):
        return np.zeros(3), np.eye(3)

    def velocity(self, k, q, v):
        if k == 0:
            return np.full(7, 1e-3)
        raise NoSolutionError


# What all schemes are asked to do.


def test_an_error_brakes_to_zero_within_its_deceleration_and_its_speed():
    braking, errors, speeds = Braking(0.05, 0.1), [0.1], []
    while errors[-1] > 1e-12:
        taken = braking.share(errors[-1], H) * errors[-1]
        speeds.append(taken / H)
        errors.append(errors[-1] - taken)
    assert max(speeds) <= 0.1 * (1 + 1e-12)
    # Of a speed that is held for a sample; the last steps, of a few um, brake harder.
    far = np.array(errors[1:-1]) > 1e-3
    assert max(-np.diff(speeds)[far]) / H <= 0.05 * 1.01
    # 0.1 m/s at a distance of 0.1 m is where a stop at 0.05 m/s^2 begins; it takes 2 s.
    assert len(speeds) * H == pytest.approx(2.0, abs=0.01)


def test_a_target_on_the_path_is_the_next_sample_and_beside_it_no_further_than_the_feedback(tasks):
    task = tasks["position"]
    assert np.array_equal(task.target(5000, task.p_WE[5000]), task.p_WE[5001])
    away = np.array([0.05, 0.0, 0.0])
    left = task.target(5000, task.p_WE[5000] + away) - task.p_WE[5001]
    assert left == pytest.approx(away * (1.0 - POSITION.share(0.05, H)), abs=1e-15)


def test_the_cone_turns_smoothly_and_leads_back(tasks):
    task = tasks["cone"]
    R = task.R_WE[:8001]
    assert np.allclose(np.einsum("kji,kjl->kil", R, R), np.eye(3), atol=1e-12)
    # 20 degrees of radius in 8 s are 0.27 rad/s; a quaternion that flips would make thousands.
    assert np.abs(np.diff(R, axis=0)).max() / H < 0.4
    assert np.allclose(R[-1], task.experiment.R_WE_start, atol=1e-5)
    assert np.linalg.norm(task.p_WE[0] - task.experiment.p_WE_start) == pytest.approx(0.1)


def test_peers_read_all_joints_and_no_shapes(short):
    tree = ElementTree.fromstring(without_shapes(short.arm))
    assert not [*tree.iter("visual"), *tree.iter("collision")]
    assert {joint.get("name") for joint in tree.iter("joint")} >= set(short.arm.joints)


# What is measured.


def test_figures_of_a_known_motion(short):
    v = np.zeros((300, 7))
    # Joint 1 accelerates at half its bound for 0.1 s, holds 0.05 rad/s, and jerks once.
    v[:, 0] = np.minimum(0.5 * H * np.arange(1, 301), 0.05)
    v[200, 0] += 2e-3
    q = short.start + H * np.vstack((np.zeros(7), np.cumsum(v, axis=0)))
    found = figures_of(Motion(q, v), short)
    assert found.velocity == pytest.approx(0.052 / 0.5)
    assert found.acceleration == pytest.approx(2.0)
    assert found.jerk == pytest.approx(4e-3 / H**2)
    assert found.drift == pytest.approx(0.1 * 0.05 + 2e-3 * H)
    assert found.beyond == 0.0
    # It was 0.1 m from its path and stays there.
    assert found.settling == np.inf
    assert 0.05 < found.error_rms <= found.error_max < 0.15
    assert not Row("", "", found).keeps_bounds
    assert Row("", "", found._replace(acceleration=1.0 + 1e-9)).keeps_bounds


def test_an_arm_without_a_solution_brakes_within_its_bound_and_is_counted(short):
    motion = run(Still(short))
    assert motion.failures == short.steps - 1
    assert figures_of(motion, short).acceleration == pytest.approx(1.0)
    assert not motion.velocity[1:].any()
    assert min(motion.costs) > 0.0


def test_ratios_next_to_a_bound_are_told_as_their_difference():
    assert [ratio(x) for x in (1.0, 1.0 + 2e-8, 1.97, 0.5, 298.4)] == [
        "1", "1 + 2e-08", "1.97", "0.5", "298",
    ]  # fmt: skip


# Who is compared.


def test_a_peer_that_is_not_installed_is_named_and_left_out(short, monkeypatch):
    monkeypatch.setattr(peers, "PEERS", {"nobody": "no_such_package.scheme"})
    (found,) = peers.peer_rows(short, 1)
    assert found.cells(oriented=False)[:2] == ["nobody", "not installed: no_such_package"]
    for oriented in (False, True):
        assert len(found.cells(oriented)) == len(columns(oriented))


def test_our_rows_do_the_same_tasks_as_the_peers(tasks):
    for ours in OURS:
        for name in ours.tasks:
            assert ours.on(tasks[name]).document.log_period == H
    other = Ours("", "", BASE, changes={"limits.acceleration": 2.0})
    with pytest.raises(InvalidInputError, match="another limit of acceleration"):
        other.on(tasks["position"])


@pytest.mark.parametrize("ours", OURS[:4], ids=lambda ours: ours.name)
def test_a_law_in_a_plain_loop_moves_as_in_its_diagram(short, ours):
    """To rounding, which a law that learns makes larger; 0.3 s."""
    document = {"duration": 0.3, "window": [0.2, 0.3], "log_period": H}
    experiment = load_experiment(ours.experiment, {"accept": None, **ours.changes, **document})
    plain = run(PlainLoop(short, experiment))
    assert np.abs(simulate(experiment).series["position"] - plain.position).max() < 1e-10
