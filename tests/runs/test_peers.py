"""The parts of the peers' bench that need no peer: tasks, figures, what is left out."""

from xml.etree import ElementTree

import numpy as np
import pytest

import peers
import peers_in_batches
from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.compiled.library import compiler
from drake_rnn.robot.rotation import rotation_by, rotation_error
from peer_schemes.behind import JERK_GAIN, Shaper, behind
from peer_schemes.chosen_tasks import BASE, OURS, chosen_tasks
from peer_schemes.figures import figures_of
from peer_schemes.ours import CompiledLoop, Ours, PlainLoop
from peer_schemes.rows import Row, columns, ratio
from peer_schemes.scheme import (
    AimedScheme,
    Motion,
    NoSolutionError,
    Scheme,
    braked,
    in_the_middle,
    run,
)
from peer_schemes.tasks import POSITION, ROTATION, Braking, Task
from peer_schemes.turns import rotated_by, swept, twice_turned
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


class LeastNorm(AimedScheme):
    """Goes where it is to go by the pseudoinverse of the posture that it linearises about."""

    name, setting = "least norm", ""

    def pose(self, q):
        kinematics = self.task.arm.kinematics()
        return kinematics.p_WE(q), kinematics.R_WE(q)

    def towards(self, aim, q, v):
        J, h = self.task.arm.kinematics().J(aim.q), self.task.period
        return v + np.linalg.pinv(J) @ ((aim.p_target - aim.p) / h - J @ v)


class Ramp(AimedScheme):
    """Wants accelerations of half the bound, whatever it is to do."""

    name, setting = "ramp", ""

    def __init__(self, task):
        super().__init__(task)
        self.wanted = -0.25 * H * np.ones(7)

    def pose(self, q):
        return np.zeros(3), np.eye(3)

    def towards(self, aim, q, v):
        self.wanted = self.wanted + 0.5 * H
        return self.wanted


class Obedient(Shaper):
    """Does what is wanted of it at the end of a sample."""

    name, setting = "obedient", ""

    def moved(self, q, v, a):
        before, self.v, self.a = self.v, v, a
        return q + 0.5 * H * (before + v)


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


def test_a_gain_takes_back_no_more_than_its_share_and_brakes_as_before_from_afar():
    slow = Braking(0.05, 0.1, gain=100.0)
    assert slow.share(1e-9, H) == pytest.approx(0.1)
    assert slow.share(0.05, H) == Braking(0.05, 0.1).share(0.05, H)
    # Where one goes over into the other, both are the same.
    edge = 2.0 * 0.05 / 100.0**2
    assert slow.share(edge * (1 + 1e-12), H) == pytest.approx(slow.share(edge, H))


def test_a_target_on_the_path_is_the_next_sample_and_beside_it_no_further_than_the_feedback(tasks):
    task = tasks["position"]
    assert np.array_equal(task.target(5000, task.p_WE[5000]), task.p_WE[5001])
    away = np.array([0.05, 0.0, 0.0])
    left = task.target(5000, task.p_WE[5000] + away) - task.p_WE[5001]
    assert left == pytest.approx(away * (1.0 - POSITION.share(0.05, H)), abs=1e-15)


def test_the_middle_of_the_sample_leads_to_a_target_a_hundred_times_as_near(short):
    """By the chord: J at its middle is right to the third order of the period."""
    v = 0.3 * np.ones(7)
    missed = {}
    for scheme in (LeastNorm, in_the_middle(LeastNorm)):
        made, kinematics = scheme(short), short.arm.kinematics()
        target = kinematics.p_WE(short.start + H * v)
        made.task = _Towards(short, target)
        found = made.velocity(0, short.start, v)
        missed[scheme] = np.linalg.norm(kinematics.p_WE(short.start + H * found) - target)
    beginning, middle = missed.values()
    assert 1e-9 < beginning < 1e-6
    assert middle < 0.01 * beginning


class _Towards:
    """A task whose target is given."""

    oriented, period = False, H

    def __init__(self, task, target):
        self.arm, self._target = task.arm, target

    def target(self, k, p_WE, braking):
        return self._target


def test_small_turns_are_those_of_the_package():
    R = rotation_by(np.array([0.3, -0.2, 0.5]))
    turn = np.array([2e-4, -1e-4, 3e-4])
    assert rotated_by(1000.0 * turn, R) == pytest.approx(rotation_by(1000.0 * turn) @ R, abs=1e-15)
    assert np.array_equal(rotated_by(np.zeros(3), R), R)
    half = rotated_by(0.5 * turn, R)
    assert twice_turned(R, half) == pytest.approx(2.0 * rotation_error(R, half), abs=1e-11)


def test_a_twist_sweeps_its_way_aside_as_it_turns():
    way, turn = np.array([1e-3, 2e-3, -1e-3]), np.array([0.02, -0.03, 0.01])
    steps = (np.arange(20000) + 0.5) / 20000
    turned = np.mean(rotation_by(steps[:, None] * turn) @ way, axis=0)
    assert swept(way, turn) == pytest.approx(turned, abs=1e-8)
    assert np.linalg.norm(way - turned) > 1e-5


def test_what_is_behind_a_scheme_is_told_of_the_end_of_the_sample(short):
    scheme = behind(Obedient, Ramp)(short)
    assert scheme.braking == Braking(0.05, 0.1, JERK_GAIN)
    q, v, means = short.start, np.zeros(7), []
    for k in range(5):
        v = scheme.velocity(k, q, v)
        q = q + H * v
        means.append(v)
    # At 0.5 rad/s^2, of which the scheme wants the means over samples: known from the second on.
    wanted = 0.5 * H * (np.arange(5) + 0.5)
    assert np.array(means[2:]) == pytest.approx(np.tile(wanted[2:, None], 7))


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
    (entry,) = peers.peer_entries(short)
    (found,) = entry.with_costs(entry.again()).rows
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


def test_adaptive_rows_brake_as_the_peers_do_unless_their_name_says_so(tasks):
    for ours in OURS:
        if "adaptive" not in ours.name:
            continue
        for name in ours.tasks:
            law = ours.on(tasks[name]).law
            given = 0.08 if "braking 0.08" in ours.name else POSITION.deceleration
            assert (law.braking, law.feedback_limit) == (given, POSITION.limit)
            assert (law.turn_braking, law.turn_limit) == (ROTATION.deceleration, ROTATION.limit)
    other = braked(Ramp, 0.08)
    assert (other.braking.deceleration, other.name) == (0.08, "ramp, braking 0.08")


def test_the_least_cost_of_all_rounds_counts():
    entry = peers.Entry([Row("", "", cost=3.0, diagram=5.0)], list)
    (found,) = entry.with_costs([(4.0, 2.0)]).rows
    assert (found.cost, found.diagram) == (3.0, 2.0)


@pytest.mark.parametrize("ours", OURS[:4], ids=lambda ours: ours.name)
def test_a_law_in_a_plain_loop_moves_as_in_its_diagram(short, ours):
    """To rounding, which a law that learns makes larger; 0.3 s."""
    document = {"duration": 0.3, "window": [0.2, 0.3], "log_period": H}
    experiment = load_experiment(ours.experiment, {"accept": None, **ours.changes, **document})
    plain = run(PlainLoop(short, experiment))
    assert np.abs(simulate(experiment).series["position"] - plain.position).max() < 1e-10


@pytest.mark.long
@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_a_law_in_c_moves_as_in_a_plain_loop(short):
    pytest.importorskip("jax")
    ours = OURS[0]
    document = {"duration": 0.3, "window": [0.2, 0.3], "log_period": H}
    experiment = load_experiment(ours.experiment, {"accept": None, **ours.changes, **document})
    plain, compiled = (run(scheme(short, experiment)) for scheme in (PlainLoop, CompiledLoop))
    assert np.abs(plain.position - compiled.position).max() < 1e-12
    assert np.abs(plain.velocity - compiled.velocity).max() < 1e-11


def test_a_law_that_is_not_compiled_says_why(short, monkeypatch):
    pytest.importorskip("jax")
    monkeypatch.setenv("CC", "no_such_compiler")
    monkeypatch.setenv("PATH", "")
    compiler.cache_clear()
    monkeypatch.setattr(Ours, "on", lambda self, task: load_experiment(BASE, {"accept": None}))
    (entry,) = [peers.compiled_entry(OURS[0], short)]
    compiler.cache_clear()
    (found,) = entry.with_costs(entry.again()).rows
    assert found.cells(oriented=False)[:2] == [
        "ours: SLC, J known, in C",
        "CC: must name a C compiler that can be run, not 'no_such_compiler'; set it to gcc or "
        "clang, or unset it",
    ]


def test_costs_below_two_units_have_two_digits_more(short):
    figures = figures_of(Motion(np.tile(short.start, (301, 1)), np.zeros((300, 7))), short)
    cells = [
        Row("", "", figures, cost).cells(oriented=False)[2] for cost in (0.5049, 1.996, 2.04, 31.52)
    ]
    assert cells == ["0.50", "2.00", "2.0", "31.5"]


# Many robots.


def test_robots_of_a_batch_are_beside_the_same_path_and_judged_by_drake():
    """The first 0.1 m beside it; of 1000 the others are 84 to 118 mm beside it."""
    experiments = peers_in_batches.robots(peers_in_batches.EXPERIMENT, 3, 0.02, 0.01)
    wanted = peers_in_batches.desired(experiments)
    for number, experiment in enumerate(experiments):
        begin = experiment.arm.kinematics().p_WE(experiment.start)
        beside = np.linalg.norm(wanted[0, number] - begin)
        assert beside == pytest.approx(0.1, abs=0.019 if number else 1e-9)
        for k in (0, 7, 21):
            p_WE = experiment.desired.position(k * H)[0]
            assert np.allclose(wanted[k, number], p_WE, rtol=0.0, atol=1e-15)
    starts = np.array([each.start for each in experiments])
    assert 0.0 < np.abs(starts - starts[0]).max() < 5.0 * peers_in_batches.SPREAD
    judge = peers_in_batches.Judge(experiments, range(3))
    judge.visit(2999, starts)
    assert judge.most == 0.0


def test_all_sides_are_measured_in_turn_and_need_no_peer(monkeypatch, capsys):
    monkeypatch.setattr(peers_in_batches, "import_module", _missing)
    compared = peers_in_batches.sides("cpu", obstacles=False)
    assert "mink-warp is left out, not installed: mink_warp" in capsys.readouterr().out
    assert [side.name[-3:] for side in compared] == ["own", "JAX", "n C"]
    experiments = peers_in_batches.robots(peers_in_batches.EXPERIMENT, 2, 5e-3)
    micros = peers_in_batches.measure(compared[0], experiments, 2, peers_in_batches.cpu)
    assert micros > 0.0


def _missing(name):
    raise ModuleNotFoundError(name="mink_warp")
