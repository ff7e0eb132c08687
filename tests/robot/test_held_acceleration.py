"""Joints that have held their acceleration for some samples, as a robot does that hears nothing."""

import numpy as np
import pytest

import fr3_held
from drake_rnn import FR3
from drake_rnn.laws.parts.bounded_velocity import reached_limits
from drake_rnn.robot.velocity_envelope import (
    JerkLimits,
    jerk_box,
)

H = 1e-3
ONE = JerkLimits(
    (np.array([-10.0]), np.array([10.0])),
    *(np.array([x]) for x in (1.0, 10.0, 5000.0)),
)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_is_too_fast_brakes_until_it_is_not(side):
    q, v, a = np.zeros(1), side * np.array([1.15]), side * np.array([10.0])
    for _ in range(40):
        lower, upper = jerk_box(q, v, a, ONE, H)
        assert (lower <= upper).all()
        before, a = a, np.clip(side * np.inf, lower, upper)
        assert np.abs(a - before).max() <= 5.0 * (1 + 1e-12)
        v = v + H * a
        q = q + H * v
    np.testing.assert_allclose(v, side * 1.0, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(a, 0.0, atol=1e-9)


@pytest.mark.long
def test_the_margins_of_a_drive_pay_for_a_few_lost_cycles(monkeypatch):
    for name, value in (("ARMS", 10), ("DRIVEN", 600), ("BACK", 100)):
        monkeypatch.setattr(fr3_held, name, value)
    limits = reached_limits(FR3.command_limits, H)
    start, wanted = fr3_held.reached(limits, np.random.default_rng(0))
    for held in (1, 5):
        # That the box is never empty is asserted on the way.
        found = fr3_held.found(limits, start, wanted, held)
        assert found.breaks > 0.0
        assert found.envelope > 0.0
        assert found.outside == 0.0
