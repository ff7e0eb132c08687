"""The sampled reading of acceleration laws: its ramps, its order, its stability, its bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from drake_rnn import (
    ContinuousController,
    JointDriftFree,
    JointLimits,
    SampledController,
)
from drake_rnn.laws import ContinuousReading, SampledReading
from drake_rnn.laws.joint_drift_free import TwoStep

N, M = 5, 3
SCHEMES = ["man", "galjdf", "naljdf", "moaljdf_printed", "moaljdf"]
FREE = JointLimits.unlimited(N).replace(acceleration=np.inf)
HOME = np.linspace(-0.3, 0.5, N)
SIZE, TURN = np.array([0.05, -0.03, 0.02]), 2.0


def make(scheme="naljdf", limits=FREE, **fields):
    return JointDriftFree(scheme=scheme, limits=limits, home=HOME, **fields)


class LinearArm:
    """An arm whose J does not change, and a path that starts without velocity or acceleration.

    SIZE times 1 - 4/3 cos TURN t + 1/3 cos 2 TURN t.
    """

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        self.J = np.linalg.qr(rng.standard_normal((N, M)))[0].T * rng.uniform(0.5, 1.5, (M, 1))
        root = rng.standard_normal((N, N))
        dynamics = {"M": root @ root.T / N + np.eye(N), "bias": rng.standard_normal(N)}
        self.constant = {"J": self.J, "Jdot_v": np.zeros(M), "gravity": np.ones(N), **dynamics}

    def desired(self, t, names):
        waves = np.array([f(k * TURN * t) for k in (1, 2) for f in (np.sin, np.cos)])
        derivatives = self.path(waves, 1.0)
        return dict(zip(names, derivatives, strict=True))

    @staticmethod
    def path(waves, one):
        """Position, velocity and acceleration from sin, cos of TURN t and of 2 TURN t."""
        s1, c1, s2, c2 = waves
        p, v, a = one - 4 / 3 * c1 + c2 / 3, 4 / 3 * s1 - 2 / 3 * s2, 4 / 3 * (c1 - c2)
        return SIZE * p, SIZE * TURN * v, SIZE * TURN**2 * a

    def seen(self, t, q, period):
        ahead = self.desired(t + period, ("p_preview", "v_preview", "a_preview"))
        now = self.desired(t, ("p_WE_desired", "v_WE_desired", "a_WE_desired"))
        return {"position": q, "p_WE": self.J @ (q - HOME), **ahead, **now, **self.constant}

    def run(self, law, period, until):
        """Where the joints are at the end; and time, joints, state and what was seen before."""
        law, q, past = law.sampled(period), HOME, []
        x = law.initial_state(np.random.default_rng(0), {})
        for k in range(round(until / period)):
            t = k * period
            u = self.seen(t, q, period)
            x = law.step(t, x, u, period)
            past.append((t, q, x, u))
            ends = law.commanded_velocity(t, x), law.commanded_velocity(t + period, x)
            q = q + period / 2 * (ends[0] + ends[1])
        return q, past

    def exact(self, law, until):
        """Where the differential equation takes the joints: all of it is linear."""

        def rate(z):
            v, omega, q, waves, one = np.split(z, [N, N + M, 2 * N + M, 2 * N + M + 4])
            names = ("p_WE_desired", "v_WE_desired", "a_WE_desired")
            u = {**self.constant, **dict(zip(names, self.path(waves, one), strict=True))}
            form = law.linear_form(u, q, self.J @ (q - HOME))
            v_dot = form.a_v @ v + form.a_omega @ omega + form.a_0
            omega_dot = form.b_v @ v + form.b_omega @ omega + form.b_0
            s1, c1, s2, c2 = TURN * waves
            return np.concatenate((v_dot, omega_dot, v, [c1, -s1, 2 * c2, -2 * s2, 0.0]))

        size = 2 * N + M + 5
        # Affine, since home and gravity are constants: the last entry of z, one, carries them.
        base = rate(np.zeros(size))
        A = np.column_stack([rate(column) - base for column in np.eye(size)])
        A[:, -1] += base
        start = np.concatenate((np.zeros(N + M), HOME, [0, 1, 0, 1, 1]))
        return (expm(until * A) @ start)[N + M : 2 * N + M]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_halving_the_period_quarters_the_error(scheme):
    """Second order, of the joints' positions, against the matrix exponential."""
    arm, law = LinearArm(), make(scheme, velocity_gain=1e5)
    exact = arm.exact(law, 2.0)
    assert np.abs(exact - HOME).max() > 0.05
    off = [np.abs(arm.run(law, h, 2.0)[0] - exact).max() for h in (8e-3, 4e-3, 2e-3)]
    assert off[0] < 1e-6
    np.testing.assert_allclose([off[0] / off[1], off[1] / off[2]], 4.0, rtol=0.05)


@pytest.mark.long
def test_with_accelerations_cut_it_still_nears_the_differential_equation():
    """Of first order then, in MOALJDF; Heun's method at 0.1 ms is the reference."""
    law = make("moaljdf", limits=FREE.replace(acceleration=0.03), velocity_gain=1e3)
    arm, h, until = LinearArm(), 1e-4, 1.2
    x, q = np.zeros(law.state.size), HOME
    names = ("p_WE_desired", "v_WE_desired", "a_WE_desired")

    def rate(t, x, q):
        seen = {**arm.constant, "position": q, "p_WE": arm.J @ (q - HOME)}
        return law.derivatives(t, x, seen | arm.desired(t, names))

    for k in range(round(until / h)):
        t, v = k * h, x[:N]
        first = rate(t, x, q)
        second = rate(t + h, x + h * first, q + h * v)
        q = q + h * (v + h / 2 * first[:N])
        x = x + h / 2 * (first + second)
    ends = [arm.run(law, period, until) for period in (8e-3, 4e-3, 2e-3)]
    off = [np.abs(end - q).max() for end, _ in ends]
    sampled = law.sampled(2e-3)
    demands = np.array([sampled.state.part(x, "demand") for _, _, x, _ in ends[-1][1]])
    assert (np.abs(demands) > 0.03).any(axis=1).mean() > 0.2
    assert off[0] < 1e-3
    assert off[2] < off[0] / 2.5


@pytest.mark.parametrize("period", [1e-3, 5e-3, 2e-2])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_is_stable_where_one_step_forward_is_not(scheme, period):
    """At a velocity gain of 1e5, where an explicit step multiplies errors by 10 and more."""
    arm, law = LinearArm(), make(scheme, velocity_gain=1e5)
    u = arm.seen(0.0, HOME, period)
    form = law.linear_form(u, HOME, u["p_WE"])
    assert np.abs(np.linalg.eigvals(np.eye(N) + period * form.a_v)).max() > 10
    _, past = arm.run(law, period, min(1.5e3 * period, 4.0))
    v = np.array([law.sampled(period).state.part(x, "v") for _, _, x, _ in past])
    assert np.abs(v).max() < 5.0
    late = v[len(v) // 2 :]
    # Smooth: nothing that alternates from one sample to the next is left.
    assert np.abs(np.diff(late, n=2, axis=0)).max() < 10 * period**2 * (1 + np.abs(v).max())


def first_step(law, u, period):
    sampled = law.sampled(period)
    x = sampled.initial_state(np.random.default_rng(0), {})
    return sampled.step(0.0, x, u, period)


class TestRamp:
    law = make(limits=FREE.replace(acceleration=2.0))

    def test_the_command_runs_from_one_velocity_to_the_next_at_the_acceleration(self):
        period, arm = 4e-3, LinearArm()
        sampled, (_, past) = self.law.sampled(period), arm.run(self.law, period, 0.4)
        before = np.zeros(N)
        for t, _, x, u in past:
            v, slope = sampled.state.part(x, "v"), sampled.state.part(x, "slope")
            places = [sampled.commanded_velocity(t + s * period, x) for s in (0, 0.5, 1)]
            np.testing.assert_array_equal(places[0], before)
            np.testing.assert_allclose(places[1], (before + v) / 2, atol=1e-15)
            np.testing.assert_allclose(places[2], v, atol=1e-15)
            np.testing.assert_allclose(v - before, period * slope, atol=1e-15)
            told = sampled.diagnostics(t, x, u)
            np.testing.assert_array_equal(
                told["acceleration_demand"], sampled.state.part(x, "demand")
            )
            before = v
        assert np.abs(before).max() > 0.01

    @settings(max_examples=30)
    @given(
        seed=st.integers(0, 2**32 - 1),
        scheme=st.sampled_from(SCHEMES),
        period=st.sampled_from([1e-4, 2e-3, 2e-2]),
        bound=st.floats(1e-3, 1e3),
        bounds=st.sampled_from(["acceleration", "all"]),
    )
    def test_whatever_is_asked_no_acceleration_is_beyond_its_bound(
        self, seed, scheme, period, bound, bounds
    ):
        rng = np.random.default_rng(seed)
        limits = FREE.replace(acceleration=bound * rng.uniform(0.5, 1, N))
        law = make(scheme, limits=limits, bounds=bounds)
        sampled, arm = law.sampled(period), LinearArm(seed)
        x = rng.standard_normal(sampled.state.size)
        u = arm.seen(0.0, HOME + rng.standard_normal(N), period)
        x = sampled.step(0.0, x, u, period)
        slope, demand = sampled.state.part(x, "slope"), sampled.state.part(x, "demand")
        assert (np.abs(slope) <= limits.acceleration).all()
        np.testing.assert_array_equal(
            slope, np.clip(demand, -limits.acceleration, limits.acceleration)
        )
        told = sampled.diagnostics(0.0, x, u)
        assert told["saturated"] == (np.abs(demand) > limits.acceleration).any()

    def test_a_demand_beyond_it_is_told_as_it_was(self):
        arm = LinearArm()
        free, bound = make(), make(limits=FREE.replace(acceleration=0.01))
        u = arm.seen(0.5, HOME, 4e-3)
        told = [
            law.sampled(4e-3).diagnostics(0.0, first_step(law, u, 4e-3), u) for law in (free, bound)
        ]
        assert [entry["saturated"][0] for entry in told] == [0.0, 1.0]
        np.testing.assert_array_equal(
            told[1]["acceleration_demand"], told[0]["acceleration_demand"]
        )
        assert np.abs(told[1]["acceleration_demand"]).max() > 0.01

    @pytest.mark.parametrize("scheme", SCHEMES)
    def test_the_torque_is_that_of_the_ramp(self, scheme):
        law, arm = make(scheme, limits=FREE.replace(acceleration=0.05)), LinearArm()
        _, past = arm.run(law, 4e-3, 0.1)
        _, _, x, u = past[-1]
        sampled = law.sampled(4e-3)
        told = sampled.diagnostics(0.0, x, u)
        if law.weighs_torque:
            effort = u["M"] @ sampled.state.part(x, "slope")
            np.testing.assert_allclose(told["torque"], effort + u["bias"] - u["gravity"])
        else:
            assert "torque" not in told


class TestBounds:
    """With ``bounds: all``, of an arm whose path leads it out of them."""

    limits = JointLimits(
        position_lower=HOME - 0.02,
        position_upper=HOME + 0.02,
        velocity=np.full(N, 0.03),
        acceleration=np.full(N, 0.5),
    )

    def extremes(self, **fields):
        law = make(limits=self.limits, **fields)
        q, past = LinearArm().run(law, 4e-3, 6.0)
        positions = np.array([*(q for _, q, _, _ in past), q])
        v = np.array([law.sampled(4e-3).state.part(x, "v") for _, _, x, _ in past])
        return self.limits.violation(positions).max(), np.abs(v).max()

    def test_none_is_broken(self):
        """1e-12: rounding."""
        violation, speed = self.extremes(bounds="all")
        assert violation < 1e-12
        assert speed == pytest.approx(0.03, abs=1e-12)

    def test_with_those_of_the_paper_position_and_velocity_are(self):
        violation, speed = self.extremes()
        assert violation > 0.005
        assert speed > 0.04


class TestFirstSample:
    def test_there_is_none_before_it(self):
        """One step back, from rest: the mean of what holds at both ends is not asked for."""
        law, arm, h = make(velocity_gain=1e3), LinearArm(), 4e-3
        sampled = law.sampled(h)
        x = sampled.initial_state(np.random.default_rng(0), {})
        for name in ("v", "omega", "v_from", "slope"):
            np.testing.assert_array_equal(sampled.state.part(x, name), 0.0)
        u = arm.seen(0.0, HOME, h)
        x = sampled.step(0.0, x, u, h)
        v, omega = sampled.state.part(x, "v"), sampled.state.part(x, "omega")
        # That is v = h f(v), f at the end of the ramp, where the joints have gone h v / 2.
        there = {**u, **arm.desired(h, ("p_WE_desired", "v_WE_desired", "a_WE_desired"))}
        there |= {"position": HOME + h / 2 * v, "p_WE": arm.J @ (h / 2 * v)}
        rates = law.derivatives(0.0, law.state.join(v, omega), there)
        np.testing.assert_allclose(law.state.join(v, omega), h * rates, rtol=1e-9, atol=1e-12)

    def test_the_second_looks_back_two(self):
        law, arm, h = make(velocity_gain=1e3), LinearArm(), 4e-3
        _, past = arm.run(law, h, 2 * h)
        (_, _, first, _), (t, q, second, u) = past
        states = [law.state.join(*law.sampled(h).state.split(x)[:2]) for x in (first, second)]
        v = states[1][:N]
        q = q + h / 2 * (states[0][:N] + v)
        there = {**u, **arm.desired(t + h, ("p_WE_desired", "v_WE_desired", "a_WE_desired"))}
        there |= {"position": q, "p_WE": arm.J @ (q - HOME)}
        slope = (3 * states[1] - 4 * states[0]) / (2 * h)
        np.testing.assert_allclose(
            slope, law.derivatives(0.0, states[1], there), rtol=1e-8, atol=1e-9
        )


class TestController:
    def test_a_sampled_controller_runs_the_sampled_reading_and_drake_the_equation(self):
        law = make()
        controller = SampledController(law, 2e-3)
        assert controller.law is law
        assert isinstance(controller.reading, TwoStep)
        assert controller.reading.law is law
        assert ContinuousController(law).reading is law
        # A step of its own would be unstable, and a ramp is no differential equation.
        assert not isinstance(law, SampledReading)
        assert not isinstance(controller.reading, ContinuousReading)

    @pytest.mark.parametrize("period", [1e-6, 1e-3, 1.0])
    def test_any_period_will_do(self, period):
        law = make()
        sampled = law.sampled(period)
        assert isinstance(sampled, TwoStep)
        assert sampled.law is law
        assert sampled.observables.parts == law.observables.parts

    def test_its_command_varies_within_a_period_and_heuns_step_integrates_it(self):
        assert not make().sampled(1e-3).holds_command
        assert make().sampled(1e-3).integration_scheme == "runge_kutta2"
        assert make().continuous().holds_command

    def test_before_it_is_initialized_it_commands_rest(self):
        for controller in (SampledController(make(), 2e-3), ContinuousController(make())):
            context = controller.CreateDefaultContext()
            command = controller.GetOutputPort("commanded_velocity")
            np.testing.assert_array_equal(command.Eval(context), np.zeros(N))

    @pytest.mark.parametrize("scheme", SCHEMES)
    def test_its_observables_follow_from_what_it_sees_in_a_diagram(self, scheme):
        """Which is the path one period ahead; a recorded run has that of the instant as well."""
        law, arm = make(scheme, limits=FREE.replace(acceleration=0.05)), LinearArm()
        sampled = law.sampled(4e-3)
        u = arm.seen(0.5, HOME, 4e-3)
        x = first_step(law, u, 4e-3)
        ports = {name: u[name] for name in sampled.inputs.parts}
        assert "v_WE_desired" not in ports
        told = sampled.diagnostics(0.0, x, ports)
        assert told.keys() == sampled.observables.parts.keys()
        ahead = {"p_WE_desired": u["p_preview"], "v_WE_desired": u["v_preview"]}
        for name, value in sampled.diagnostics(0.0, x, {**u, **ahead}).items():
            np.testing.assert_array_equal(told[name], value)
