"""The blocks of the loop, one by one."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from drake_rnn import (
    Dither,
    Dynamics,
    InvalidInputError,
    Kinematics,
    PathSource,
    load_arm,
)
from drake_rnn.paths import Nephroid

PANDA = load_arm("panda")
PLANAR = load_arm("planar6")


def fixed(system, **inputs):
    context = system.CreateDefaultContext()
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, np.asarray(value, dtype=float))
    return lambda name: system.GetOutputPort(name).Eval(context)


@pytest.mark.parametrize(("arm", "task"), [(PANDA, "xyz"), (PLANAR, "xy")])
def test_kinematics_ports_are_the_arms_kinematics(arm, task):
    rows = list(range(len(task)))
    q, v = arm.home + 0.1, np.linspace(-0.3, 0.4, arm.n)
    port = fixed(Kinematics(arm, task), position=q, velocity=v)
    expected = arm.kinematics()
    J = expected.J(q)[rows]
    np.testing.assert_array_equal(port("p_WE"), expected.p_WE(q)[rows])
    np.testing.assert_array_equal(port("J").reshape(len(task), arm.n), J)
    np.testing.assert_allclose(port("v_WE"), J @ v, atol=1e-15)
    np.testing.assert_array_equal(port("R_WE").reshape(3, 3), expected.R_WE(q))
    np.testing.assert_array_equal(port("J_omega").reshape(3, arm.n), expected.J_omega(q))
    np.testing.assert_array_equal(port("Jdot_v"), expected.Jdot_v(q, v)[rows])


def test_the_jacobian_of_a_pose_is_how_orientation_and_then_position_change():
    """Central differences over 1e-6 rad: 1e-9 of truncation and rounding."""
    q, h = PANDA.home + 0.1, 1e-6
    system = Kinematics(PANDA, "pose")

    def at(q):
        port = fixed(system, position=q, velocity=np.zeros(7))
        return port("J").reshape(6, 7), port("R_WE").reshape(3, 3), port("p_WE")

    J, R, _ = at(q)
    for joint in range(7):
        (_, R_after, p_after), (_, R_before, p_before) = (
            at(q + way * h * np.eye(7)[joint]) for way in (1, -1)
        )
        # The angular velocity, from its cross product.
        w = (R_after - R_before) / (2 * h) @ R.T
        np.testing.assert_allclose(J[:3, joint], [w[2, 1], w[0, 2], w[1, 0]], atol=1e-8)
        np.testing.assert_allclose(J[3:, joint], (p_after - p_before) / (2 * h), atol=1e-8)


def test_only_the_jacobian_of_a_pose_is_longer():
    port = fixed(Kinematics(PANDA, "pose"), position=PANDA.home, velocity=np.ones(7))
    sizes = {name: port(name).size for name in ("p_WE", "v_WE", "Jdot_v", "R_WE", "J", "J_omega")}
    assert sizes == {"p_WE": 3, "v_WE": 3, "Jdot_v": 3, "R_WE": 9, "J": 42, "J_omega": 21}
    np.testing.assert_allclose(port("v_WE"), port("J").reshape(6, 7)[3:] @ np.ones(7), atol=1e-15)


def test_kinematics_refuses_a_posture_that_is_not_finite():
    port = fixed(Kinematics(PANDA), position=np.full(7, np.nan), velocity=np.zeros(7))
    with pytest.raises(InvalidInputError, match="position: must be 7 finite numbers"):
        port("p_WE")


def test_kinematics_positions_do_not_depend_on_velocities():
    """Otherwise injected noise would feed through, and Drake would recompute them."""
    system = Kinematics(PANDA)
    velocity = system.GetInputPort("velocity").get_index()
    for name in ("p_WE", "R_WE", "J", "J_omega"):
        assert not system.HasDirectFeedthrough(velocity, system.GetOutputPort(name).get_index())


def test_a_path_source_is_its_path_from_where_the_arm_starts():
    path = Nephroid(size=0.04, period=8.0, plane="yz", offset=np.array([0.1, 0.0, 0.0]))
    p_WE = np.array([0.3, 0.0, 0.6])
    source = PathSource(path, p_WE)
    context = source.CreateDefaultContext()
    np.testing.assert_allclose(
        source.GetOutputPort("p_WE_desired").Eval(context), p_WE - [0.1, 0, 0]
    )
    context.SetTime(1.3)
    p, v, a = path.evaluate(1.3)
    got = [source.GetOutputPort(f"{x}_WE_desired").Eval(context) for x in "pva"]
    np.testing.assert_array_equal(got[0], p_WE - [0.1, 0, 0] + p)
    np.testing.assert_array_equal(got[1], v)
    np.testing.assert_array_equal(got[2], a)


@pytest.mark.parametrize("task", ["xyz", "xy"])
def test_a_preview_is_what_will_be_desired_that_much_later(task):
    """Whichever port is asked first, and at whichever time."""
    path = Nephroid(size=0.04, period=8.0, plane="xy")
    source = PathSource(path, np.array([0.3, 0.0, 0.6]), task, preview=0.05)
    now, later = source.CreateDefaultContext(), source.CreateDefaultContext()
    for t in (0.0, 1.3, 7.98, 0.4):
        now.SetTime(t)
        later.SetTime(t + 0.05)
        for letter in "avp":
            desired = source.GetOutputPort(f"{letter}_WE_desired")
            ahead = source.GetOutputPort(f"{letter}_preview")
            assert ahead.size() == len(task)
            np.testing.assert_array_equal(ahead.Eval(now), desired.Eval(later))
            assert (ahead.Eval(now) != desired.Eval(now)).any()


def test_samples_that_see_ahead_are_the_path_at_their_own_times():
    """Also where one sample's time ahead is the next one's now, but for rounding."""
    path = Nephroid(size=0.04, period=8.0, plane="xy")
    source = PathSource(path, np.zeros(3), preview=1e-3)
    context = source.CreateDefaultContext()
    for k in range(20):
        context.SetTime(k * 1e-3)
        for name, t in (("p_WE_desired", k * 1e-3), ("p_preview", k * 1e-3 + 1e-3)):
            said = source.GetOutputPort(name).Eval(context)
            np.testing.assert_array_equal(said, path.evaluate(t)[0])


def test_a_delayed_path_rests_until_it_begins_late():
    path = Nephroid(size=0.04, period=8.0)
    source = PathSource(path, np.zeros(3), delay=0.5)
    context = source.CreateDefaultContext()
    for t, p in ((0.4, np.zeros(3)), (1.75, path.evaluate(1.25)[0])):
        context.SetTime(t)
        np.testing.assert_array_equal(source.GetOutputPort("p_WE_desired").Eval(context), p)


@pytest.mark.parametrize("delay", [-0.1, float("nan"), float("inf"), "0.1"])
def test_a_delay_that_is_no_time_is_refused(delay):
    with pytest.raises(InvalidInputError, match="delay: must be a time of 0 or more, not"):
        PathSource(Nephroid(size=0.04, period=8.0), np.zeros(3), delay=delay)


def test_who_does_not_see_ahead_is_offered_no_preview():
    source = PathSource(Nephroid(size=0.04, period=8.0), np.zeros(3))
    assert not any(source.HasOutputPort(f"{letter}_preview") for letter in "pva")


def test_a_planar_task_has_two_rows():
    source = PathSource(Nephroid(size=0.04, period=8.0), np.zeros(3), task="xy")
    assert source.GetOutputPort("v_WE_desired").size() == 2


def test_an_orientation_to_keep_is_offered_if_there_is_one():
    path, kinematics = Nephroid(size=0.04, period=8.0), PANDA.kinematics()
    p_WE, R_WE = kinematics.p_WE(PANDA.home), kinematics.R_WE(PANDA.home)
    source = PathSource(path, p_WE, "pose", R_WE)
    context = source.CreateDefaultContext()
    for t in (0.0, 1.3):
        context.SetTime(t)
        kept = source.GetOutputPort("R_WE_desired").Eval(context)
        np.testing.assert_array_equal(kept.reshape(3, 3), R_WE)
    assert source.GetOutputPort("p_WE_desired").size() == 3
    assert not PathSource(path, p_WE).HasOutputPort("R_WE_desired")


class TestDither:
    """White, bounded, held, and the same in each run."""

    def series(self, seed=0, hold=1e-3, until=0.5):
        builder = DiagramBuilder()
        dither = builder.AddSystem(Dither(4, 0.03, hold, seed))
        log = LogVectorOutput(dither.get_output_port(), builder, publish_period=hold / 2)
        simulator = Simulator(builder.Build())
        simulator.AdvanceTo(until)
        return dither, log.FindLog(simulator.get_context()).data().T

    def test_it_is_the_same_for_a_seed_and_another_for_another(self):
        first, again, other = (self.series(seed)[1] for seed in (0, 0, 1))
        np.testing.assert_array_equal(first, again)
        assert (first[2:] != other[2:]).all()

    def test_it_holds_its_value_and_then_changes(self):
        dither, data = self.series()
        # A log entry at a sample's own time shows the value before its update.
        for k in (0, 7, 400):
            np.testing.assert_array_equal(data[2 * k + 1], dither.sample(k))
            np.testing.assert_array_equal(data[2 * k + 2], dither.sample(k))

    def test_it_is_normal_cut_off_at_three_sigma_and_white(self):
        dither = Dither(4, 0.03, 1e-4, seed=5)
        values = np.array([dither.sample(k) for k in range(20_000)])
        assert np.abs(values).max() == 0.09
        # Cutting off at three sigma takes 1.3 % off the standard deviation.
        np.testing.assert_allclose(values.std(axis=0), 0.0296, rtol=0.03)
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=1e-3)
        correlation = np.corrcoef(np.hstack((values[:-1], values[1:])).T)
        assert np.abs(correlation - np.eye(8)).max() < 0.03

    def test_samples_can_be_asked_for_in_any_order(self):
        forward, backward = Dither(2, 1.0, 1.0), Dither(2, 1.0, 1.0)
        numbers = [0, 1, 1023, 1024, 5000]
        rows = [forward.sample(k).copy() for k in numbers]
        for k, row in zip(reversed(numbers), reversed(rows), strict=True):
            np.testing.assert_array_equal(backward.sample(k), row)


def test_blocks_refuse_what_they_cannot_be():
    with pytest.raises(
        InvalidInputError, match="task: may be xyz, xy, pose, or a list of objectives, not 'yz'"
    ):
        Kinematics(PANDA, "yz")
    with pytest.raises(InvalidInputError, match="sigma: must be greater than 0, not -1"):
        Dither(7, -1.0, 1e-3)
    with pytest.raises(InvalidInputError, match="hold: must be greater than 0"):
        Dither(7, 1.0, 0.0)


@pytest.mark.parametrize("v", [np.full(7, np.nan), np.zeros(6)])
def test_velocities_that_are_none_are_refused(v):
    """Drake would end the process over them."""
    with pytest.raises(InvalidInputError, match="velocity: must be 7 finite numbers"):
        PANDA.kinematics().Jdot_v(PANDA.home, v)


@pytest.mark.parametrize("system", [Kinematics, Dynamics])
def test_the_name_of_an_arm_is_not_an_arm(system):
    with pytest.raises(InvalidInputError, match=r"^arm: must be of class Arm, not 'panda'$"):
        system("panda")
