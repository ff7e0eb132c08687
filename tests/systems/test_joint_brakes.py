"""Brakes that close on joints, whatever is commanded."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Integrator

from drake_rnn import InvalidInputError, JointLimits, JointLock, JointLocks
from drake_rnn.features.locks import JointBrakes

NAMES = ("shoulder", "elbow", "wrist")
V, H = np.array([0.4, -0.4, 0.2]), 1e-3


def braked(*locks, until=2.0, **bounds):
    """Velocities at each sample, and where joints come to rest, of even commands."""
    each = {name: np.broadcast_to(bound, 3) for name, bound in bounds.items()}
    limits = JointLimits(**JointLimits.unlimited(3).merge(each))
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource(V))
    brakes = builder.AddSystem(JointBrakes(JointLocks.of(NAMES, locks), limits, H))
    position = builder.AddSystem(Integrator(3))
    builder.Connect(source.get_output_port(), brakes.get_input_port())
    builder.Connect(brakes.get_output_port(), position.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_maximum_step_size(H)
    rows = []
    for k in range(round(until / H)):
        simulator.AdvanceTo((k + 0.5) * H)
        context = simulator.get_context()
        rows.append(brakes.get_output_port().Eval(brakes.GetMyContextFromRoot(context)).copy())
    gone = position.get_output_port().Eval(position.GetMyContextFromRoot(context))
    return np.array(rows), gone


def test_a_joint_stops_in_the_least_time_and_the_others_go_on():
    v, _ = braked(JointLock(joint=2, time=0.5), acceleration=[1.0, 2.0, 1.0])
    np.testing.assert_array_equal(v[:, [0, 2]], np.tile(V[[0, 2]], (2000, 1)))
    assert (v[:500, 1] == V[1]).all()
    # From 0.4 rad/s at 2 rad/s^2 in 0.2 s, give or take a sample for rounding.
    assert (v[498:698, 1] != 0.0).all()
    assert (v[701:, 1] == 0.0).all()
    assert np.abs(np.diff(v[:, 1]) / H).max() <= 2.0 * (1 + 1e-9)


def test_the_jerk_of_a_stop_is_within_its_bound_too():
    v, _ = braked(JointLock(joint="wrist", time=0.3), acceleration=1.0, jerk=10.0)
    a = np.diff(v[:, 2]) / H
    assert np.abs(a).max() <= 1.0 + 1e-9
    assert np.abs(np.diff(a) / H).max() <= 10.0 * (1 + 1e-9)
    # 0.2 rad/s in two ramps of 0.1 s of the acceleration, and 0.1 s in between.
    assert np.flatnonzero(v[:, 2] != 0.0)[-1] == pytest.approx(600, abs=2)


def test_at_once_is_from_one_sample_to_the_next():
    v, _ = braked(JointLock(joint=1, time=0.3, stop="at_once"), acceleration=1.0, jerk=10.0)
    assert v[299, 0] == V[0]
    assert (v[300:, 0] == 0.0).all()


def test_several_joints_stop_each_at_its_time_and_stay():
    locks = [JointLock(joint=3, time=0.2), JointLock(joint=1, time=0.6)]
    v, gone = braked(*locks, acceleration=1.0)
    assert (v[1001:, [0, 2]] == 0.0).all()
    # v t + v^2 / 2 a, up to a sample of the velocity that is held.
    expected = [0.4 * 0.6 + 0.08, -0.4 * 2.0, 0.2 * 0.2 + 0.02]
    np.testing.assert_allclose(gone, expected, atol=1.1 * H * 0.4)


def test_without_a_bound_a_joint_stops_at_once():
    v, _ = braked(JointLock(joint=1, time=0.3))
    assert (v[300:, 0] == 0.0).all()


def test_locks_and_limits_are_of_one_arm():
    locks = JointLocks.of(NAMES, [JointLock(joint=1, time=0.3)])
    with pytest.raises(InvalidInputError, match="locks: must be of 7 joints, not of 3"):
        JointBrakes(locks, JointLimits.unlimited(7), H)


def test_a_law_is_told_from_its_time_on_and_not_at_all_if_it_is_not_to_be():
    locks = JointLocks.of(
        NAMES,
        [
            JointLock(joint=1, time=0.5, told_after=0.25),
            JointLock(joint=2, time=0.1, told=False),
            JointLock(joint=3, time=1.0),
        ],
    )
    free = locks.free(np.array([0.0, 0.5, 0.75, 1.0]))
    np.testing.assert_array_equal(free[:, 0], [[1, 1, 1], [1, 1, 1], [0, 1, 1], [0, 1, 0]])
    assert locks.joints == [1, 0, 2]
    assert locks.span == (0.1, 1.0)
    np.testing.assert_array_equal(locks.is_locked(0.5), [True, True, False])
