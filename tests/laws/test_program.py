"""Schemes as programs: rates are the derivatives along a motion of an arm, also of a pose."""

import numpy as np
import pytest

from drake_rnn import load_arm
from drake_rnn.laws.parts.jacobian import SignalRates
from drake_rnn.laws.scheme import EndEffectorVelocity, QPScheme, ReturningVelocity, VelocityBox
from drake_rnn.robot.rotation import rotation_by
from drake_rnn.robot.task import named_task

ARM = load_arm("panda")
KINEMATICS, HOME, N = ARM.kinematics(), ARM.home, ARM.limits.size
#: Velocity and acceleration of a path, with which what is desired moves; rotation about z.
STRAIGHT, CURVED, TURNING = np.array([0.2, -0.1, 0.3]), np.array([0.3, 0.4, -0.2]), 0.4
V = np.array([0.3, -0.2, 0.4, 0.1, -0.5, 0.2, 0.3])


def scheme(size):
    return QPScheme(
        ReturningVelocity(HOME + 0.1, 2.0),
        EndEffectorVelocity(N, size, 5.0),
        VelocityBox(ARM.limits.replace(velocity=0.5), 10.0),
    )


def signals(t, size):
    """What an arm that moves with V sees, its path beside it."""
    q = HOME + t * V
    task = named_task("pose" if size == 6 else "xyz")
    p, R = KINEMATICS.p_WE(HOME), KINEMATICS.R_WE(HOME)
    spin = rotation_by(np.array([0.0, 0.0, TURNING * t]))
    u = {"position": q, "J": task.J(KINEMATICS, q), "p_WE": KINEMATICS.p_WE(q)}
    u |= {"p_WE_desired": p + t * STRAIGHT + 0.5 * t**2 * CURVED}
    u |= {"v_WE_desired": STRAIGHT + t * CURVED, "a_WE_desired": CURVED}
    if size == 6:
        u |= {"R_WE": KINEMATICS.R_WE(q), "R_WE_desired": spin @ R}
        u |= {"w_WE_desired": np.array([0.0, 0.0, TURNING]), "alpha_WE_desired": np.zeros(3)}
    return u


@pytest.mark.parametrize("size", [3, 6])
def test_rates_are_derivatives_along_a_motion(size):
    """Central differences over 2 us; the rotation vector's is exact only where it vanishes."""
    made, h = scheme(size), 1e-6
    assert made.inputs.keys() == signals(0.0, size).keys()
    before, now, after = (made.program(signals(t, size)) for t in (-h, 0.0, h))
    u_dot = {"J": (after.A - before.A) / (2.0 * h)}
    rates = made.rates(signals(0.0, size), u_dot, V)
    np.testing.assert_allclose(rates.A, u_dot["J"])
    for name in ("b", "c"):
        found = (getattr(after, name) - getattr(before, name)) / (2.0 * h)
        np.testing.assert_allclose(getattr(rates, name), found, atol=1e-6)
    for rate, one, other in zip(rates.box, before.box, after.box, strict=True):
        np.testing.assert_allclose(rate, (other - one) / (2.0 * h), atol=1e-6)
    assert rates.W is None
    np.testing.assert_array_equal(now.W, np.eye(N))


def test_a_bound_moves_only_where_the_position_limit_is_the_narrower_one():
    box = VelocityBox(ARM.limits.replace(velocity=0.5), 10.0)
    q = HOME.copy()
    q[1] = ARM.limits.position_upper[1] - 0.02
    lower, upper = box.box({"position": q})
    assert upper[1] == pytest.approx(0.2)
    assert (lower == -0.5).all()
    assert (np.delete(upper, 1) == 0.5).all()
    closing, opening = box.rates({"position": q}, V)[::-1]
    np.testing.assert_allclose(closing, np.where(np.arange(N) == 1, -10.0 * V, 0.0))
    assert not opening.any()


def test_differences_of_three_samples_are_exact_for_a_parabola():
    kept, h = None, 1e-2
    rates = SignalRates({"J": (2, 2)})
    A, B = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[-2.0, 1.0], [0.5, 3.0]])
    for k in range(4):
        u = {"J": A + k * h * B + (k * h) ** 2 * A}
        kept = rates.init(u, None) if kept is None else kept
        found, kept = rates.step({**kept, "samples": np.array([float(k)])}, u, h)
        exact = B + 2.0 * k * h * A
        if k == 0:
            assert not found["J"].any()
        elif k == 1:
            np.testing.assert_allclose(found["J"], B + h * A)
        else:
            np.testing.assert_allclose(found["J"], exact, rtol=1e-9)
