"""The arm's dynamics as signals, against energy and against the arm's own functions."""

import numpy as np
import pytest

from drake_rnn import Dynamics, InvalidInputError, load_arm, shipped_arms

STEP = 1e-6


@pytest.fixture(params=shipped_arms())
def arm(request):
    return load_arm(request.param)


def ports(system, q, v):
    context = system.CreateDefaultContext()
    system.GetInputPort("position").FixValue(context, q)
    system.GetInputPort("velocity").FixValue(context, v)
    n = q.size
    return {
        "M": system.GetOutputPort("M").Eval(context).reshape(n, n),
        "bias": system.GetOutputPort("bias").Eval(context),
        "gravity": system.GetOutputPort("gravity").Eval(context),
    }


def motions(arm, count=5):
    rng = np.random.default_rng(3)
    for _ in range(count):
        yield rng.uniform(-1.5, 1.5, arm.n), rng.uniform(-1, 1, arm.n)


def test_ports_are_the_arms_own_dynamics(arm):
    system, own = Dynamics(arm), arm.kinematics()
    for q, v in motions(arm):
        seen = ports(system, q, v)
        np.testing.assert_array_equal(seen["M"], own.M(q))
        np.testing.assert_array_equal(seen["bias"], own.bias(q, v))
        np.testing.assert_array_equal(seen["gravity"], own.gravity(q))


def test_inertia_is_symmetric_and_kinetic_energy_positive(arm):
    system = Dynamics(arm)
    for q, v in motions(arm):
        M = ports(system, q, v)["M"]
        np.testing.assert_allclose(M, M.T, atol=1e-12 * np.abs(M).max())
        assert np.linalg.eigvalsh(M).min() > 0


def test_the_power_of_the_torques_and_of_gravity_is_the_rate_of_kinetic_energy(arm):
    """With tau = M a + bias - gravity; central differences: 1e-8 of the largest term."""
    system, rng = Dynamics(arm), np.random.default_rng(5)
    for q, v in motions(arm):
        a = rng.uniform(-1, 1, arm.n)

        def energy(t, q=q, v=v, a=a):
            moved = v + t * a
            return moved @ ports(system, q + t * v, moved)["M"] @ moved / 2

        rate = (energy(STEP) - energy(-STEP)) / (2 * STEP)
        seen = ports(system, q, v)
        torque = seen["M"] @ a + seen["bias"] - seen["gravity"]
        assert v @ (torque + seen["gravity"]) == pytest.approx(rate, rel=1e-6, abs=1e-7)


def test_coriolis_torques_are_quadratic_in_speed_and_absent_at_rest(arm):
    system = Dynamics(arm)
    for q, v in motions(arm):
        np.testing.assert_array_equal(ports(system, q, 0 * v)["bias"], 0.0)
        once, twice = ports(system, q, v)["bias"], ports(system, q, 2 * v)["bias"]
        np.testing.assert_allclose(twice, 4 * once, atol=1e-10 * np.abs(once).max())


@pytest.mark.parametrize("scale", [0.4, 3.0])
def test_a_lighter_arm_has_less_of_everything(scale):
    system, other = (Dynamics(load_arm("planar6", mass_scale=s)) for s in (1.0, scale))
    for q, v in motions(load_arm("planar6")):
        whole, scaled = ports(system, q, v), ports(other, q, v)
        for name, value in whole.items():
            atol = 1e-13 * np.abs(value).max()
            np.testing.assert_allclose(scaled[name], scale * value, rtol=0, atol=atol)


def test_wrong_masses_are_told_and_not_carried():
    """What a law is told of the dynamics follows them; the arm itself does not."""
    arm = load_arm("planar6", believed_mass_scale=0.4)
    told, light = Dynamics(arm), Dynamics(load_arm("planar6", mass_scale=0.4))
    true = load_arm("planar6").kinematics()
    for q, v in motions(arm):
        for name, value in ports(light, q, v).items():
            np.testing.assert_array_equal(ports(told, q, v)[name], value)
        np.testing.assert_array_equal(arm.kinematics().M(q), true.M(q))


def test_what_depends_on_posture_alone_does_not_feed_velocity_through(arm):
    system = Dynamics(arm)
    velocity = system.GetInputPort("velocity").get_index()
    through = {
        name: system.HasDirectFeedthrough(velocity, system.GetOutputPort(name).get_index())
        for name in ("M", "bias", "gravity")
    }
    assert through == {"M": False, "bias": True, "gravity": False}


@pytest.mark.parametrize(("q", "v"), [(np.nan, 0.0), (0.0, np.inf)])
def test_what_is_not_finite_is_refused(q, v):
    """Drake would end the process over it."""
    with pytest.raises(InvalidInputError, match="must be 6 finite numbers"):
        ports(Dynamics(load_arm("planar6")), np.full(6, q), np.full(6, v))
