"""Jin et al.'s acceleration laws as plain arrays: algebra, optimality, what theorems are worth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import (
    ContinuousController,
    InvalidInputError,
    JointDriftFree,
    JointLimits,
    load_experiment,
    simulate,
)
from limit_helpers import broken
from row_helpers import each

N, M = 6, 3
SCHEMES = ["man", "galjdf", "naljdf", "moaljdf_printed", "moaljdf"]
LIMITS = JointLimits.unlimited(N).replace(acceleration=np.inf)
seeds = st.integers(0, 2**32 - 1)
schemes = st.sampled_from(SCHEMES)


def make(**fields):
    defaults = {"scheme": "naljdf", "limits": LIMITS, "home": np.linspace(-0.5, 0.5, N)}
    fields = {**defaults, **fields}
    if "moaljdf" not in fields["scheme"]:
        fields.pop("alpha", None)
    return JointDriftFree(**fields)


def random_gains(rng):
    names = ["return_weight", "return_beta", "return_gamma", "task_beta", "task_gamma"]
    gains = {name: float(rng.uniform(0.5, 5)) for name in names}
    sizes = {"position_gain": 250.0, "velocity_gain": 1e3, "composite_gain": 2.0, "rate": 1e3}
    gains |= {name: float(size * rng.uniform(0.3, 1)) for name, size in sizes.items()}
    return {**gains, "alpha": float(rng.uniform(0.3, 1)), "damping": 0.05}


def world(rng):
    """What a law may see: anything, but for M, which is symmetric and positive definite."""
    root = rng.standard_normal((N, N))
    u = {name: rng.standard_normal(M) for name in ("p_WE", "p_WE_desired", "Jdot_v")}
    u |= {name: rng.standard_normal(M) for name in ("v_WE_desired", "a_WE_desired")}
    u |= {name: rng.standard_normal(N) for name in ("position", "bias", "gravity")}
    return u | {"J": rng.standard_normal((M, N)), "M": root @ root.T + 0.1 * np.eye(N)}


def errors(law, v, u):
    """Drift index c, position feedback d, and velocity error, as in the docstring."""
    slip = u["J"] @ v - u["v_WE_desired"]
    error = u["p_WE"] - u["p_WE_desired"]
    b1, g1, b2, g2 = law.return_beta, law.return_gamma, law.task_beta, law.task_gamma
    c = (b1 + g1) * v + b1 * g1 * (u["position"] - law.home)
    return c, (b2 + g2) * slip + b2 * g2 * error, slip


def projection(law, J):
    return np.eye(N) - J.T @ np.linalg.inv(J @ J.T + law.damping**2 * np.eye(M)) @ J


def rates(law, v, omega, u):
    """The docstring's equations, without the bounds."""
    J, h, zeta = u["J"], u["bias"] - u["gravity"], 1 - (law.alpha or 1.0)
    c, d, slip = errors(law, v, u)
    slip = slip + law.composite_gain * (u["p_WE"] - u["p_WE_desired"])
    along, lam = -law.velocity_gain * J.T @ slip, law.return_weight
    if law.scheme in ("naljdf", "moaljdf"):
        c = projection(law, J) @ c
    if law.scheme == "man":
        v_dot = along + J.T @ omega
    elif law.scheme in ("galjdf", "naljdf"):
        v_dot = along + J.T @ omega - lam * c
    elif law.scheme == "moaljdf_printed":
        right = along + law.alpha * (J.T @ omega - lam * c) - zeta * u["M"] @ h
        v_dot = np.linalg.inv(np.eye(N) + zeta * u["M"] @ u["M"]) @ right
    else:
        right = along + J.T @ omega - law.alpha * lam * c - zeta * u["M"] @ h
        v_dot = np.linalg.inv(law.alpha * np.eye(N) + zeta * u["M"] @ u["M"]) @ right
    yielded = J @ v_dot if law.scheme == "moaljdf" else J @ J.T @ omega
    wanted = u["a_WE_desired"] - u["Jdot_v"] - law.position_gain * d
    return v_dot, law.rate * (wanted - yielded)


def of_form(form, v, omega):
    return (
        form.a_v @ v + form.a_omega @ omega + form.a_0,
        form.b_v @ v + form.b_omega @ omega + form.b_0,
    )


def omega_at_rest(law, v, u):
    """The omega that does not change while everything else stands still."""
    form = law.linear_form(u, u["position"], u["p_WE"])
    return -np.linalg.solve(form.b_omega, form.b_v @ v + form.b_0)


def accelerations(law, v, u):
    """With omega at rest."""
    form = law.linear_form(u, u["position"], u["p_WE"])
    return of_form(form, v, omega_at_rest(law, v, u))[0]


def assert_near(actual, expected, relative=1e-9):
    """Relative to the largest entry: gains differ by powers of ten."""
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * np.abs(expected).max())


@each(
    ("fields", "message"),
    [
        ({"return_beta": 0.0}, "return_beta: must be greater than 0, not 0.0"),
        ({"return_gamma": -1.0}, "return_gamma: must be greater than 0, not -1.0"),
        ({"task_beta": 0.0}, "task_beta: must be greater than 0"),
        ({"task_gamma": 0.0}, "task_gamma: must be greater than 0"),
        ({"rate": 0.0}, "rate: must be greater than 0"),
        ({"damping": 0.0}, "damping: must be greater than 0"),
        ({"return_weight": -1.0}, "return_weight: must be greater than or equal to 0"),
        ({"velocity_gain": 0.0}, "velocity_gain: must be greater than 0"),
        ({"scheme": "moaljdf", "alpha": 0.0}, "alpha: must be greater than 0, not 0.0"),
        ({"scheme": "moaljdf", "alpha": 1.5}, "alpha: must be less than or equal to 1"),
        ({"home": np.zeros(5)}, "home: must have 6 entries, one per joint, not 5"),
        ({"home": np.full(N, np.nan)}, "home: must be one list of numbers, none of them NaN"),
        ({"scheme": "galdjf"}, "scheme: "),
        ({"task_size": 6}, "task_size: must be 1, 2, 3, 4 or 5, not 6"),
        ({"bounds": "none"}, "bounds: "),
        ({"limits": JointLimits.unlimited(N)}, "limits.acceleration: not known for this arm"),
    ],
)
def test_what_it_cannot_be_is_refused(fields, message):
    with pytest.raises(InvalidInputError) as caught:
        make(**fields)
    assert message in str(caught.value)


class TestEquations:
    @given(seed=seeds, scheme=schemes)
    def test_the_linear_form_is_the_printed_equations(self, seed, scheme):
        rng = np.random.default_rng(seed)
        law, u = make(scheme=scheme, **random_gains(rng)), world(rng)
        v, omega = rng.standard_normal(N), rng.standard_normal(M)
        form = law.linear_form(u, u["position"], u["p_WE"])
        for actual, expected in zip(of_form(form, v, omega), rates(law, v, omega, u), strict=True):
            assert_near(actual, expected)

    @given(seed=seeds, scheme=schemes)
    def test_looking_ahead_is_the_posture_that_v_leads_to(self, seed, scheme):
        """J being the same; the second-order sampled reading solves for that v."""
        rng = np.random.default_rng(seed)
        law, u = make(scheme=scheme, **random_gains(rng)), world(rng)
        v, omega, ahead = rng.standard_normal(N), rng.standard_normal(M), rng.uniform(0, 0.1)
        form = law.linear_form(u, u["position"], u["p_WE"], ahead)
        q, p_WE = u["position"] + ahead * v, u["p_WE"] + ahead * u["J"] @ v
        there = law.linear_form(u, q, p_WE)
        for actual, expected in zip(of_form(form, v, omega), of_form(there, v, omega), strict=True):
            assert_near(actual, expected)

    @given(seed=seeds, scheme=schemes)
    def test_the_derivatives_are_these_with_the_accelerations_clipped(self, seed, scheme):
        """Of which omega is not told, in any scheme."""
        rng = np.random.default_rng(seed)
        bound = rng.uniform(1, 1e4, N)
        law = make(scheme=scheme, limits=LIMITS.replace(acceleration=bound), **random_gains(rng))
        u, v, omega = world(rng), rng.standard_normal(N), rng.standard_normal(M)
        demand, omega_dot = rates(law, v, omega, u)
        v_dot = np.clip(demand, -bound, bound)
        given_v_dot, given_omega_dot = law.state.split(
            law.derivatives(0.0, law.state.join(v, omega), u)
        )
        assert (np.abs(given_v_dot) <= bound).all()
        assert_near(given_v_dot, v_dot)
        assert_near(given_omega_dot, omega_dot)

    @given(seed=seeds)
    def test_without_the_drift_index_all_are_the_minimum_acceleration_norm(self, seed):
        rng = np.random.default_rng(seed)
        gains, u, x = random_gains(rng), world(rng), rng.standard_normal(N + M)
        man = make(scheme="man", **gains).derivatives(0.0, x, u)
        for scheme in ("galjdf", "naljdf"):
            law = make(scheme=scheme, **{**gains, "return_weight": 0.0})
            np.testing.assert_array_equal(law.derivatives(0.0, x, u), man)

    @given(seed=seeds, damping=st.floats(1e-4, 1e-2))
    def test_naljdf_does_not_move_the_end_effector_to_bring_the_joints_back(self, seed, damping):
        """But for what damping leaves: mu^2 / (s^2 + mu^2) of c at a singular value s."""
        rng = np.random.default_rng(seed)
        u, x = world(rng), rng.standard_normal(N + M)
        moving, man, greedy = (
            make(scheme=scheme, damping=damping, velocity_gain=1e-12)
            for scheme in ("naljdf", "man", "galjdf")
        )

        def left(law):
            apart = law.derivatives(0.0, x, u)[:N] - man.derivatives(0.0, x, u)[:N]
            return np.linalg.norm(u["J"] @ apart)

        c, _, _ = errors(moving, x[:N], u)
        smallest = np.linalg.svd(u["J"], compute_uv=False)[-1]
        most = 3 * damping**2 / (smallest**2 + damping**2) * np.linalg.norm(u["J"] @ c)
        # What 1e-12 adds is rounding of omega's part.
        assert left(moving) <= np.sqrt(M) * 10 * most + 1e-11 * (1 + np.abs(x).max() + left(greedy))
        assert left(greedy) == pytest.approx(3 * np.linalg.norm(u["J"] @ c), rel=1e-9)


class TestProjector:
    """I - J^+ J, of which the paper says that it is diag(0, I)."""

    @given(seed=seeds)
    def test_it_is_diagonal_in_the_basis_of_the_singular_vectors_alone(self, seed):
        """In that of the joints it drives the first of them as well as the last."""
        J = world(np.random.default_rng(seed))["J"]
        projector = np.eye(N) - np.linalg.pinv(J) @ J
        block = np.diag([0.0] * M + [1.0] * (N - M))
        right = np.linalg.svd(J)[2]
        np.testing.assert_allclose(right @ projector @ right.T, block, atol=1e-9)
        assert np.abs(projector - block).max() > 1e-3
        assert np.abs(projector[:M]).max() > 1e-3


class TestMeasuredVelocity:
    def test_it_is_an_input_only_if_asked_for(self):
        assert "velocity" not in make().sampled(1e-3).inputs
        assert "velocity" in make(velocity="measured").sampled(1e-3).inputs

    def test_it_cannot_be_integrated(self):
        with pytest.raises(InvalidInputError, match=r"law\.velocity: measured needs a sampled law"):
            ContinuousController(make(velocity="measured"))

    def test_where_it_is_the_own_one_the_first_step_is_the_same(self):
        """Only later steps differ, by the order of the formula."""
        rng = np.random.default_rng(5)
        u, steps = world(rng), []
        u |= {f"{name}_preview": u[f"{name}_WE_desired"] for name in "pva"}
        for velocity in ("own", "measured"):
            reading = make(velocity=velocity).sampled(1e-3)
            x = reading.initial_state(rng, u)
            seen = {**u, "velocity": np.zeros(N)} if velocity == "measured" else u
            steps.append(reading.step(0.0, x, seen, 1e-3))
        np.testing.assert_array_equal(*steps)


class TestOptimality:
    """Of (41): least alpha (a'a / 2 + lambda c'P a) + zeta / 2 tau'tau where J a is prescribed."""

    @staticmethod
    def optimum(law, v, u):
        """By its optimality conditions, as one linear system."""
        J, inertia, h, zeta = u["J"], u["M"], u["bias"] - u["gravity"], 1 - law.alpha
        c, d, _ = errors(law, v, u)
        hessian = law.alpha * np.eye(N) + zeta * inertia @ inertia
        slope = law.alpha * law.return_weight * projection(law, J) @ c + zeta * inertia @ h
        wanted = u["a_WE_desired"] - u["Jdot_v"] - law.position_gain * d
        conditions = np.block([[hessian, -J.T], [J, np.zeros((M, M))]])
        return np.linalg.solve(conditions, np.concatenate((-slope, wanted)))[:N]

    @given(seed=seeds)
    def test_the_corrected_law_at_rest_is_the_optimum(self, seed):
        """1e-6: the conditions' own condition number is up to 1e8."""
        rng = np.random.default_rng(seed)
        law, u = make(scheme="moaljdf", **random_gains(rng)), world(rng)
        v = rng.standard_normal(N)
        assert_near(accelerations(law, v, u), self.optimum(law, v, u), 1e-6)

    def test_the_printed_law_is_not_nor_does_it_do_the_task(self):
        rng = np.random.default_rng(0)
        u, v = world(rng), rng.standard_normal(N)
        law = make(scheme="moaljdf_printed", alpha=0.995)
        best, found = self.optimum(law, v, u), accelerations(law, v, u)
        assert np.abs(found - best).max() > 0.1 * np.abs(best).max()
        done = u["J"] @ found
        assert np.abs(done - u["J"] @ best).max() > 0.1 * np.abs(done).max()

    @given(seed=seeds)
    def test_without_a_weight_of_torque_it_is_naljdf(self, seed):
        """Where there is no velocity error, of whose gradient omega is told in one of them only."""
        rng = np.random.default_rng(seed)
        gains, u, v = {**random_gains(rng), "alpha": 1.0}, world(rng), rng.standard_normal(N)
        u["v_WE_desired"] = u["J"] @ v
        gains |= {"damping": 1e-6, "composite_gain": 0.0}
        weighing, plain = (make(scheme=name, **gains) for name in ("moaljdf", "naljdf"))
        assert_near(accelerations(weighing, v, u), accelerations(plain, v, u), 1e-6)


class TestTheorem1:
    @staticmethod
    def settled(law, rng):
        """A v and a world in which the velocity error is what the theorem says, for any c and d."""
        u, v, d = world(rng), rng.standard_normal(N), 1e-2 * rng.standard_normal(M)
        J = u["J"]
        c, _, _ = errors(law, v, u)
        drift = law.return_weight * J @ c if law.scheme == "galjdf" else 0.0
        gram = J @ J.T
        slip = -np.linalg.solve(gram, drift + law.position_gain * d) / law.velocity_gain
        u["v_WE_desired"] = J @ v - slip
        b2, g2 = law.task_beta, law.task_gamma
        u["p_WE_desired"] = u["p_WE"] - (d - (b2 + g2) * slip) / (b2 * g2)
        return u, v, slip

    @settings(max_examples=30)
    @given(seed=seeds, scheme=st.sampled_from(["galjdf", "naljdf", "man"]))
    def test_with_j_c_and_d_frozen_the_velocity_error_settles_where_it_says(self, seed, scheme):
        """With omega at rest: there its rate is zero, and off there it returns as J J^T says."""
        rng = np.random.default_rng(seed)
        law = make(scheme=scheme, velocity_gain=1e3, damping=1e-7)
        u, v, slip = self.settled(law, rng)
        scale = law.velocity_gain * np.linalg.norm(u["J"]) ** 2
        rate = u["J"] @ accelerations(law, v, u) + u["Jdot_v"] - u["a_WE_desired"]
        assert np.abs(rate).max() < 1e-9 * scale * (1 + np.abs(slip).max())
        off = rng.standard_normal(M)
        other = {**u, "v_WE_desired": u["v_WE_desired"] - off}
        # d as it was.
        b2, g2 = law.task_beta, law.task_gamma
        other["p_WE_desired"] = u["p_WE_desired"] + (b2 + g2) / (b2 * g2) * off
        rate = u["J"] @ accelerations(law, v, other) + u["Jdot_v"] - u["a_WE_desired"]
        expected = -law.velocity_gain * u["J"] @ u["J"].T @ off
        np.testing.assert_allclose(rate, expected, rtol=0, atol=1e-7 * scale)

    @pytest.mark.parametrize("scheme", ["galjdf", "naljdf", "man"])
    def test_it_is_what_the_law_tells(self, scheme):
        law = make(scheme=scheme, velocity_gain=1e3, damping=1e-7)
        u, v, slip = self.settled(law, np.random.default_rng(2))
        told = law.diagnostics(0.0, law.state.join(v, np.zeros(M)), u)["velocity_error_predicted"]
        assert_near(told, slip, 1e-7)

    def test_a_torque_weighed_law_tells_no_such_thing(self):
        """Its velocity error does not settle there."""
        for scheme in SCHEMES:
            observables = make(scheme=scheme).observables
            assert ("velocity_error_predicted" in observables) == ("moaljdf" not in scheme)
            assert ("torque" in observables) == ("moaljdf" in scheme)


class TestRoots:
    """Of the position error, for which the paper has beta and gamma themselves."""

    def test_delta_multiplies_them(self):
        """e'' + delta ((beta2 + gamma2) e' + beta2 gamma2 e) = 0 with omega at rest: exactly."""
        rng = np.random.default_rng(4)
        law, u, v = make(scheme="moaljdf"), world(rng), rng.standard_normal(N)
        curve = u["J"] @ accelerations(law, v, u) + u["Jdot_v"] - u["a_WE_desired"]
        slip, error = u["J"] @ v - u["v_WE_desired"], u["p_WE"] - u["p_WE_desired"]
        assert_near(curve, -250.0 * (2.0 * slip + error), 1e-7)

    def test_so_that_one_is_slow_and_one_is_fast_where_both_should_be_1(self):
        found = np.sort(np.roots([1.0, 250.0 * 2.0, 250.0]))
        np.testing.assert_allclose(found, [-499.4995, -0.5005], rtol=1e-5)
        assert np.abs(found + 1.0).min() > 0.4


class TestDiagnostics:
    @staticmethod
    def many(rng, count=7):
        worlds = [world(rng) for _ in range(count)]
        return {name: np.array([u[name] for u in worlds]) for name in worlds[0]}

    @pytest.mark.parametrize("scheme", SCHEMES)
    @pytest.mark.parametrize("sampled", [False, True])
    def test_those_of_many_instants_are_those_of_each(self, scheme, sampled):
        """Rounding alone: products are summed in another order."""
        rng = np.random.default_rng(1)
        law = make(scheme=scheme, limits=LIMITS.replace(acceleration=3.0))
        law = law.sampled(1e-3) if sampled else law
        u, t = self.many(rng), np.arange(7.0)
        x = rng.standard_normal((7, law.state.size))
        together = law.diagnostics(t, x, u)
        assert together.keys() == law.observables.parts.keys()
        for k in range(7):
            alone = law.diagnostics(t[k], x[k], {name: value[k] for name, value in u.items()})
            for name, value in alone.items():
                assert value.shape == law.observables.parts[name][1]
                np.testing.assert_allclose(together[name][k], value, rtol=1e-9, atol=1e-12)

    @pytest.mark.parametrize("scheme", ["moaljdf", "moaljdf_printed"])
    def test_the_torque_is_that_of_the_acceleration_that_was_allowed(self, scheme):
        rng = np.random.default_rng(2)
        law = make(scheme=scheme, limits=LIMITS.replace(acceleration=0.5))
        u, x = world(rng), rng.standard_normal(N + M)
        v_dot = law.derivatives(0.0, x, u)[:N]
        assert np.abs(v_dot).max() == 0.5
        told = law.diagnostics(0.0, x, u)
        assert told["saturated"] == 1.0
        assert np.abs(told["acceleration_demand"]).max() > 0.5
        np.testing.assert_allclose(told["torque"], u["M"] @ v_dot + u["bias"] - u["gravity"])

    def test_a_cut_is_told_even_where_another_joint_has_no_bound(self):
        rng = np.random.default_rng(3)
        bound = np.full(N, np.inf)
        bound[2] = 1e-3
        law = make(limits=LIMITS.replace(acceleration=bound))
        assert law.diagnostics(0.0, rng.standard_normal(N + M), world(rng))["saturated"] == 1.0
        free = make()
        assert free.diagnostics(0.0, rng.standard_normal(N + M), world(rng))["saturated"] == 0.0


CLEAN = {
    "saturated_fraction": 0.0,
    "joint_acceleration_demand_max_rad_s2": 1.0,
    "singular_value_min": 0.3,
    "position_error_max_m": 1e-4,
}


class TestCaveats:
    def test_there_are_none_of_a_clean_run(self):
        assert make().caveats(CLEAN) == []
        assert make().caveats({}) == []

    @pytest.mark.parametrize(
        ("metrics", "words"),
        [
            (
                {"saturated_fraction": 0.12, "joint_acceleration_demand_max_rad_s2": 7.5},
                ["clipped to their bounds in 12 %", "demand up to 7.5 rad/s^2"],
            ),
            ({"singular_value_min": 0.05}, ["close to losing rank", "0.05", "full rank"]),
            ({"position_error_max_m": 0.03}, ["0.03 m off its path"]),
        ],
    )
    def test_what_is_off_is_said_with_its_size(self, metrics, words):
        (said,) = make().caveats({**CLEAN, **metrics})
        assert said.startswith("law: ")
        assert all(word in said for word in words)

    def test_a_demand_that_is_not_a_number_any_more_is_no_obstacle(self):
        """Metrics leave out what is not finite."""
        said = make().caveats({"saturated_fraction": 1.0})
        assert "up to inf" in said[0]


def test_a_weight_of_torque_is_refused_by_a_scheme_without():
    message = (
        "alpha: needs a scheme that weights the torque, moaljdf or moaljdf_printed, not galjdf"
    )
    with pytest.raises(InvalidInputError, match=message):
        JointDriftFree(scheme="galjdf", limits=LIMITS, home=np.zeros(N), alpha=0.5)


def test_bounds_kept_from_sample_to_sample_cannot_be_integrated():
    with pytest.raises(
        InvalidInputError, match=r"law\.bounds: all needs a sampled law; use SampledController"
    ):
        ContinuousController(make(bounds="all"))


@pytest.mark.parametrize("reading", ["continuous", "sampled"])
def test_a_step_too_long_is_suspected_only_of_an_integrator(reading):
    """A sampled reading takes implicit steps, whose length does not matter."""
    law = make()
    ran = law.continuous() if reading == "continuous" else law.sampled(1e-3)
    said = ran.caveats({**CLEAN, "saturated_fraction": 0.9})
    assert any("clipped to their bounds in 90 %" in warning for warning in said)
    suspected = any("explicit integrator" in warning for warning in said)
    assert suspected == (reading == "continuous")


# Whole runs that are hard.

FIXED = {"accept": None, "log_period": 0.02}


def run(name, **changes):
    return simulate(load_experiment(name, {**FIXED, **changes}))


@pytest.mark.long
def test_an_outstretched_arm_is_warned_of_and_stays_finite():
    """J has no full rank at the start: errors of 2 mm on a circle of 10 mm."""
    path = {"kind": "circle", "size": 0.01, "period": 2, "timing": "sin2", "laps": 1}
    changes = {"law.return_weight": 3, "law.velocity_gain": 1e5, "period": 4e-3}
    result = run("naljdf_clover_iiwa", start=[0.0] * 7, path=path, duration=2, **changes)
    assert all(np.isfinite(values).all() for values in result.series.values())
    assert result.metrics["singular_value_min"] < 1e-6
    said = " ".join(result.warnings)
    assert "near-singular posture" in said
    assert "close to losing rank" in said
    assert result.metrics["position_error_max_m"] < 0.01 or "off its path" in said


def test_a_path_out_of_reach_is_refused_before_anything_runs():
    for changes in (
        {"name": "naljdf_clover", "path.size": 0.6},
        {"name": "naljdf_clover_iiwa", "start": [0.0] * 7},
    ):
        with pytest.raises(InvalidInputError, match=r"path: out of reach: .* misses the point"):
            run(**changes)


def test_accelerations_that_do_not_suffice_are_told():
    """0.53 rad/s^2 would: the path is left by a centimetre, and no bound is broken by rounding."""
    result = run("naljdf_clover", period=5e-3, **{"limits.acceleration": 0.3})
    assert result.metrics["saturated_fraction"] > 0.1
    assert result.metrics["joint_acceleration_max_rad_s2"] <= 0.3 + 1e-9
    said = " ".join(result.warnings)
    assert "clipped to their bounds" in said
    assert "asks elbow_joint for an acceleration of" in said
    assert "off its path" in said


LIMITED = {"limits.position_upper": [6.2, 6.2, 0.71, 6.2, 6.2, 6.2], "period": 4e-3}


class TestPositionLimit:
    """The elbow would go to 0.73 rad."""

    def test_with_all_bounds_it_is_kept_and_the_path_pays(self):
        """0.8 mm; to 1e-11, the rounding of differences."""
        result = run("naljdf_clover", **LIMITED, **{"law.bounds": "all"})
        assert broken(result.metrics, 1e-11) == {}
        assert -1e-11 <= result.metrics["joint_limit_margin_min_rad"] < 1e-11
        assert result.metrics["position_error_max_m"] == pytest.approx(7.9e-4, rel=0.02)
        assert any("clipped to their bounds" in said for said in result.warnings)

    def test_with_those_of_the_paper_it_is_broken(self):
        result = run("naljdf_clover", **LIMITED)
        beyond = result.metrics["position_violation_max_rad"]
        assert beyond == pytest.approx(0.0217, rel=0.02)
        # Once, and with what would keep it.
        assert [said for said in result.warnings if f"{beyond:.3g}" in said] == [
            f"limits: the arm exceeds a limit of position by {beyond:.3g} rad; this law does not "
            "keep it; a sampled law with law.bounds: all does"
        ]
        assert result.metrics["saturated_fraction"] == 0.0


@pytest.mark.parametrize(
    "name", ["naljdf_clover", pytest.param("galjdf_clover", marks=pytest.mark.long)]
)
def test_the_sampled_reading_nears_the_continuous_one(name):
    """Joint angles against Radau's, good to 1e-8 rad: each half of the period is a quarter off."""
    moving = {"path.period": 1.2, "limits.acceleration": 100, "duration": 0.3, "log_period": 0.05}
    integrator = {"scheme": "radau3", "accuracy": 1e-6}
    reference = run(name, integrator=integrator, period=None, **moving)
    assert reference.time[-1] == pytest.approx(0.3, abs=1e-12)
    end = reference.series["position"][-1]
    assert np.abs(end - reference.series["position"][0]).max() > 0.1
    off = [
        np.abs(run(name, period=period, **moving).series["position"][-1] - end).max()
        for period in (2e-3, 1e-3)
    ]
    assert off[1] < 1.2e-6
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)
