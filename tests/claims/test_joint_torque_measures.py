"""The report's methods of least torques: their arm is that of the model, and each is the least."""

import numpy as np
import pytest

from drake_rnn import load_experiment
from drake_rnn.claims.papers import joint_torque as measures

RNG = np.random.default_rng(0)
POSTURES = RNG.uniform(-1.0, 1.0, (5, 2, 3))


def test_the_equations_are_those_of_the_model():
    plant = load_experiment("rods3_short").arm.plant()
    context = plant.CreateDefaultContext()
    frame = plant.GetFrameByName("tip")
    for q, v in POSTURES:
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        M, S = measures._mass(q), measures._factor(q, v)
        np.testing.assert_allclose(M, plant.CalcMassMatrix(context), atol=1e-11)
        np.testing.assert_allclose(S @ v, plant.CalcBiasTerm(context), atol=1e-10)
        p = plant.CalcPointsPositions(context, frame, np.zeros(3), plant.world_frame())
        np.testing.assert_allclose(measures._tip(q, v)[0], p[:2, 0], atol=1e-12)


def test_the_forces_do_no_work_of_their_own():
    """dM/dt - 2 S is skew, and J and h are slopes."""
    step = 1e-6
    for q, v in POSTURES:
        M_dot = (measures._mass(q + step * v) - measures._mass(q - step * v)) / (2.0 * step)
        skew = M_dot - 2.0 * measures._factor(q, v)
        np.testing.assert_allclose(skew, -skew.T, atol=1e-7)
        ahead, behind = (measures._tip(q + sign * step * v, v) for sign in (1.0, -1.0))
        _, J, h = measures._tip(q, v)
        np.testing.assert_allclose((ahead[0] - behind[0]) / (2.0 * step), J @ v, atol=1e-7)
        np.testing.assert_allclose((ahead[1] - behind[1]) @ v / (2.0 * step), h, atol=1e-7)


@pytest.mark.parametrize("method", ["mtn", "mtnb", "mtnd"])
def test_no_other_acceleration_of_the_tip_costs_less_torque(method):
    W = 1.0 / (2.0 * measures._LIMITS) ** 2 if method == "mtnb" else np.ones(3)
    for q, v in POSTURES:
        wanted = np.array([0.3, -0.2])
        x = measures._instantaneous(method, q, v, wanted)
        J = measures._tip(q, v)[1]
        np.testing.assert_allclose(J @ x, wanted, atol=1e-9)
        free = np.cross(*J)
        M, n = measures._mass(q), measures._factor(q, v) @ v
        if method == "mtnd":
            n = n + measures._DAMPING * M @ v
        costs = [W @ (M @ (x + s * free) + n) ** 2 for s in (-0.1, 0.0, 0.1)]
        assert costs[1] < min(costs[0], costs[2])


def test_a_preview_of_nothing_is_that_of_the_moment():
    """As the preview shrinks, torques now and later separate, and those now are the least."""
    for q, v in POSTURES:
        wanted = np.array([0.3, -0.2])
        for damping, method in ((0.0, "mtn"), (measures._DAMPING, "mtnd")):
            x, _ = measures._previewed(q, v, wanted, 0.0, 1e-7, damping)
            np.testing.assert_allclose(x, measures._instantaneous(method, q, v, wanted), atol=1e-4)


def test_reduced_peaks_are_the_least_within_the_limits():
    """Of all torques within the limits that reach the next velocity of the path."""
    start, rest = measures._START, np.zeros(3)
    for q in (start, start + np.array([0.1, -0.2, 0.3])):
        x, later = measures._reduced(q, rest, measures._STEP, "short")
        M, h = measures._mass(q), measures._STEP
        J = measures._tip(q, rest)[1]
        _, fast, ahead = measures._desired(h, "short")
        np.testing.assert_allclose(J @ x * h, [fast, fast], atol=1e-12)
        assert (np.abs(M @ x) <= measures._LIMITS * (1.0 + 1e-9)).all()
        costs = []
        for s in np.linspace(-20.0, 20.0, 401):
            other = x + s * np.cross(*J)
            if (np.abs(M @ other) <= measures._LIMITS).all():
                w = h * other
                wanted = ahead - measures._tip(q, w)[2]
                n = measures._factor(q, w) @ w
                then = M @ measures._instantaneous("mtnb", q, w, wanted) + n
                costs.append(((then / measures._LIMITS) ** 2).sum())
        assert len(costs) > 5
        assert ((later / measures._LIMITS) ** 2).sum() <= min(costs) + 1e-12
