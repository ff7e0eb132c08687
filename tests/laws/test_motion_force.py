"""RNN (19), (21) and (22) as functions of arrays, and what holds of them."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from drake_rnn import (
    Circumstances,
    ContactLoss,
    ElasticSurface,
    InvalidInputError,
    JointLimits,
    MotionForce,
    OnlineStiffness,
    load_arm,
)
from drake_rnn.laws.parts.surface_task import LOST
from drake_rnn.systems import SpringContact

ARM = load_arm("iiwa14", frame="tip")
KINEMATICS = ARM.kinematics()
HOME = ARM.home
# Away from home, where no direction is special.
Q = HOME + np.array([0.2, -0.1, 0.15, 0.1, -0.2, 0.25, 0.1])
N = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
DELTA = 1e-3
LIMITS = ARM.limits.replace(velocity=0.5)
FREE = JointLimits.unlimited(7).replace(velocity=1e6)


def law(**fields):
    return MotionForce(**{"limits": LIMITS, "stiffness": 100.0, **fields})


def turned(angles, R):
    return Rotation.from_rotvec(angles).as_matrix() @ R


def signals(q=Q, **others):
    p_WE, R_WE = KINEMATICS.p_WE(q), KINEMATICS.R_WE(q)
    return {
        "position": q,
        "p_WE": p_WE,
        "R_WE": R_WE,
        "J": KINEMATICS.J(q),
        "J_omega": KINEMATICS.J_omega(q),
        "p_WE_desired": p_WE + np.array([0.002, -0.001, 0.003]),
        "v_WE_desired": np.array([0.01, 0.02, -0.005]),
        "R_WE_desired": turned([0.01, -0.02, 0.015], R_WE),
        "w_WE_desired": np.zeros(3),
        "normal_WE": N,
        "normal_force_desired": np.array([5.0]),
        "normal_force": np.array([4.5]),
        "velocity": np.linspace(-0.2, 0.3, 7),
        "v_WE": np.array([0.03, -0.02, 0.01]),
        **others,
    }


def some_state(network, seed=0, size=0.05):
    return size * np.random.default_rng(seed).normal(size=network.state.size)


def asked_of_the_tip(network, u, **known):
    """From the multipliers' rate (J v - wanted) / delta, at v = 0, in a sample of 1 ns."""
    x = np.zeros(network.state.size)
    for name, value in known.items():
        network.state.part(x, name)[:] = value
    rate = network.state.part(network.step(0.0, x, u, 1e-9), "multipliers") / 1e-9
    return -network.time_constant * rate


def printed_w(R):
    """w = [b2, b3, c2, c3] of (11)."""
    return np.concatenate((R[1:, 1], R[1:, 2]))


# The equations of the file's docstring, typed out once more.


def desired_velocity(u, force_error, gain, stiffness):
    """P_t (p_d' + k (p_d - p)) + k e n."""
    n = u["normal_WE"]
    along = u["v_WE_desired"] + gain * (u["p_WE_desired"] - u["p_WE"])
    tangential = along - n * sum(n[i] * along[i] for i in range(3))
    return tangential + gain * force_error / stiffness * n


@pytest.mark.parametrize("form", ["normalised", "literal"])
@pytest.mark.parametrize("orientation", ["rotation", "printed"])
@pytest.mark.parametrize("jacobian", ["known", "learned", "printed"])
def test_its_right_hand_side_is_that_of_its_equations(form, orientation, jacobian):
    """Both forms, both orientations, (19), (21) and (22); 1e-9 of the largest rate."""
    network = law(form=form, orientation=orientation, jacobian=jacobian, rho=1e-3)
    u = signals(w_WE_desired=np.array([0.02, -0.03, 0.01]))
    x = some_state(network, size=0.2)
    v, dual, turn, *learned = network.state.split(x)
    true_J, J_omega, n = u["J"], u["J_omega"], u["normal_WE"]
    J = learned[0] if learned else true_J
    J_drive = J if jacobian == "learned" else true_J
    wanted = desired_velocity(u, 4.5 - 5.0, network.gain, 100.0)
    A = np.eye(3)
    if form == "literal":
        A = np.vstack((100.0 * np.outer(n, n), np.eye(3) - np.outer(n, n)))
    if orientation == "rotation":
        H = J_omega
        E = Rotation.from_matrix(u["R_WE_desired"] @ u["R_WE"].T).as_rotvec()
        w_desired = u["w_WE_desired"] + network.orientation_gain * E
    else:
        b_rows = np.array([np.cross(column, u["R_WE"][:, 1]) for column in J_omega.T]).T
        c_rows = np.array([np.cross(column, u["R_WE"][:, 2]) for column in J_omega.T]).T
        H, w_desired = np.vstack((b_rows[1:], c_rows[1:])), np.zeros(4)
    upper = np.minimum(0.5, 10.0 * (LIMITS.position_upper - u["position"]))
    lower = np.maximum(-0.5, 10.0 * (LIMITS.position_lower - u["position"]))
    sought = np.clip(-J_drive.T @ A.T @ dual - H.T @ turn, lower, upper)
    expected = [
        (sought - v) / DELTA,
        (A @ J @ v - A @ wanted) / DELTA,
        (H @ v - w_desired) / DELTA,
    ]
    if learned:
        expected.append(np.outer(u["v_WE"] - J @ u["velocity"], u["velocity"]) / 1e-3)
    got = network.state.split(network.derivatives(0.0, x, u))
    for one, other in zip(got, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * max(1.0, np.abs(other).max()))


def run(network, x, u, time, period=1e-3):
    states = [x]
    for _ in range(round(time / period)):
        x = network.step(0.0, x, u, period)
        states.append(x)
    return np.array(states)


def test_three_multipliers_are_an_exact_reduction_of_the_papers_six():
    """L = A^T lambda_1, where A is the same, at a stiffness of 1 N/m: v alike at each sample.

    1e-8 rad/s: the two step by step sizes of their own.
    """
    few, many = law(stiffness=1.0), law(stiffness=1.0, form="literal")
    u = signals(normal_force=np.array([5.0 - 1e-3]))
    A = np.vstack((np.outer(N, N), np.eye(3) - np.outer(N, N)))
    x = some_state(many)
    v, dual, turn = many.state.split(x)
    six = run(many, x, u, 0.2, 1e-4)
    three = run(few, few.state.join(v, A.T @ dual, turn), u, 0.2, 1e-4)
    np.testing.assert_allclose(three[:, :7], six[:, :7], atol=1e-8)
    reduced = six[:, 7:13] @ A
    np.testing.assert_allclose(three[:, 7:10], reduced, atol=1e-7)


def test_six_multipliers_come_to_rest_where_three_do():
    """At any stiffness: what solves one set of equations solves the other; 1e-6 rad/s."""
    u = signals()
    ends = [
        run(network, np.zeros(network.state.size), u, 1.0, 1e-2)[-1, :7]
        for network in (law(stiffness=50.0), law(stiffness=50.0, form="literal"))
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


def optimum(J, J_omega, wanted, turn, lower, upper, preferred=0.0):
    """Of min |v - g|^2 / 2 subject to J v = wanted, J_omega v = turn, lower <= v <= upper."""
    program = MathematicalProgram()
    v = program.NewContinuousVariables(7)
    program.AddQuadraticCost(np.eye(7), -preferred * np.ones(7), v)
    program.AddLinearEqualityConstraint(np.vstack((J, J_omega)), np.hstack((wanted, turn)), v)
    program.AddBoundingBoxConstraint(lower, upper, v)
    result = ClarabelSolver().Solve(program)
    assert result.is_success()
    return result.GetSolution(v)


def feasible_case(seed, bound):
    """Signals whose aims some velocity within the bound fulfils, and its network."""
    rng = np.random.default_rng(seed)
    J, J_omega = rng.normal(size=(2, 3, 7)) * 0.6
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    inside = bound * rng.choice([-0.98, 0.5, 0.98], 7)
    wanted, turn = J @ inside, J_omega @ inside
    network = law(limits=JointLimits.unlimited(7).replace(velocity=bound), orientation_gain=10.0)
    error = network.stiffness * n.dot(wanted) / network.gain
    u = signals(
        J=J,
        J_omega=J_omega,
        normal_WE=n,
        v_WE_desired=wanted - n.dot(wanted) * n,
        p_WE_desired=signals()["p_WE"],
        normal_force=np.array([5.0 + error]),
        R_WE_desired=turned(0.06 * turn, signals()["R_WE"]),
        w_WE_desired=0.4 * turn,
    )
    return network, u, optimum(J, J_omega, wanted, turn, np.full(7, -bound), np.full(7, bound))


@pytest.mark.parametrize("seed", range(6))
def test_at_rest_it_is_where_the_quadratic_program_is(seed):
    """Some with active bounds; where these leave little freedom, rest takes seconds.

    1e-6 rad/s: Clarabel's own tolerance.
    """
    network, u, expected = feasible_case(seed, 0.2)
    x = np.zeros(network.state.size)
    for _ in range(80):
        x = network.step(0.0, x, u, 0.5)
        if np.abs(network.derivatives(0.0, x, u)).max() * DELTA < 1e-9:
            break
    np.testing.assert_allclose(x[:7], expected, atol=1e-6)


@pytest.mark.parametrize("form", ["normalised", "literal"])
def test_with_a_return_gain_it_is_as_near_to_the_way_home_as_its_tasks_allow(form):
    """At rest the optimum of |v - g|^2, within Clarabel's tolerance; the tip moves no less well."""
    home = Q + np.linspace(-0.02, 0.03, 7)
    u = signals(v_WE_desired=np.zeros(3), p_WE_desired=signals()["p_WE"])
    u["R_WE_desired"], u["normal_force"] = u["R_WE"], u["normal_force_desired"]
    network = law(form=form, stiffness=3.0, return_gain=0.5, home=home)
    v = run(network, np.zeros(network.state.size), u, 2.0, 1e-2)[-1, :7]
    lower, upper = LIMITS.velocity_box(Q, network.limit_stiffness)
    J, still = u["J"], np.zeros(3)
    expected = optimum(J, u["J_omega"], still, still, lower, upper, 0.5 * (home - Q))
    np.testing.assert_allclose(v, expected, atol=1e-6)
    np.testing.assert_allclose(J @ v, 0.0, atol=1e-6)
    assert v @ (home - Q) > 0.0


def test_some_of_these_programs_have_active_bounds_and_some_have_none():
    active = [np.abs(feasible_case(seed, 0.2)[2]).max() > 0.2 - 1e-6 for seed in range(6)]
    assert 0 < sum(active) < 6


@settings(max_examples=40)
@given(
    arrays(float, 13, elements=st.floats(-20, 20)),
    arrays(float, 3, elements=st.floats(-1, 1)),
    arrays(float, 7, elements=st.floats(-1.5, 1.5)),
)
def test_a_velocity_in_the_box_stays_in_the_box(x, v_WE_desired, shift):
    """Whatever multipliers and path ask for; 1e-12 rad/s: rounding."""
    network = law()
    q = np.clip(HOME + shift, LIMITS.position_lower, LIMITS.position_upper)
    u = signals(q, v_WE_desired=v_WE_desired)
    lower, upper = LIMITS.velocity_box(q, network.limit_stiffness)
    x[:7] = np.clip(x[:7], lower, upper)
    v = run(network, x, u, 5e-3)[:, :7]
    assert (v >= lower - 1e-12).all()
    assert (v <= upper + 1e-12).all()


def test_without_the_box_the_same_task_breaks_it():
    u = signals(v_WE_desired=np.array([0.5, 0.3, 0.0]))
    bounded, free = (run(law(limits=limits), np.zeros(13), u, 0.1) for limits in (LIMITS, FREE))
    assert np.abs(bounded[:, :7]).max() <= 0.5 + 1e-12
    assert np.abs(free[:, :7]).max() > 0.55
    told = law().diagnostics(0.0, bounded[-1], u)
    assert told["saturated"] == 1.0


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-6, 1e-3, 1.0]))
def test_the_learned_jacobian_never_gets_farther_from_the_true_one(seed, rho):
    """As the paper's theorem has it, at a fixed J; and what has been moved along, it knows."""
    rng = np.random.default_rng(seed)
    network = law(jacobian="learned", rho=rho)
    J, x = rng.normal(size=(3, 7)), rng.normal(size=network.state.size)
    x[:13] = 0.0
    error = np.linalg.norm(network.state.part(x, "J_hat") - J)
    for _ in range(20):
        v = rng.normal(size=7) * rng.choice([0.0, 1e-3, 1.0])
        x = network.step(0.0, x, signals(velocity=v, v_WE=J @ v), 1e-3)
        J_hat = network.state.part(x, "J_hat")
        now = np.linalg.norm(J_hat - J)
        assert now <= error * (1 + 1e-12)
        error = now
        if rho == 1e-6 and np.linalg.norm(v) > 0.5:
            np.testing.assert_allclose(J_hat @ v, J @ v, atol=1e-9)


def closed_loop(network, samples=200):
    """The command of each sample, of an arm that moves as it is told."""
    q, x = HOME.copy(), network.initial_state(np.random.default_rng(0), {})
    R = KINEMATICS.R_WE(HOME)
    start = KINEMATICS.p_WE(HOME)
    commands = []
    for _ in range(samples):
        v = x[:7].copy()
        u = signals(
            q,
            R_WE_desired=R,
            p_WE_desired=start + np.array([0.01, 0.0, 0.0]),
            velocity=v,
            v_WE=KINEMATICS.J(q) @ v,
            normal_WE=np.array([0.0, 0.0, 1.0]),
        )
        x = network.step(0.0, x, u, 1e-3)
        q = q + 1e-3 * x[:7]
        commands.append(x[:7])
    return np.array(commands), x


def test_without_excitation_a_jacobian_learned_from_nothing_stays_dead():
    """(21) with J_hat^T, all multipliers zero: no drive, no motion, nothing to learn, exactly."""
    network = law(jacobian="learned")
    commands, x = closed_loop(network)
    assert (commands == 0.0).all()
    assert (network.state.part(x, "J_hat") == 0.0).all()


def test_what_moves_the_papers_network_is_the_jacobian_it_is_not_to_know():
    """(21) as printed, with the true J^T: the same start moves, and learns, without noise."""
    network = law(jacobian="printed")
    commands, x = closed_loop(network)
    assert np.abs(commands).max() > 1e-2
    assert np.linalg.norm(network.state.part(x, "J_hat")) > 0.1
    assert "J" in network.inputs
    assert "J" not in law(jacobian="learned").inputs


def test_a_draw_of_the_multipliers_wakes_what_would_stay_dead():
    """The paper's U(0, 0.1): the rows of the orientation, which are not learned, move the arm."""
    network = law(jacobian="learned", multipliers_initial=0.1)
    commands, x = closed_loop(network)
    assert np.abs(commands).max() > 1e-2
    assert np.linalg.norm(network.state.part(x, "J_hat")) > 0.1


@pytest.mark.parametrize("form", ["normalised", "literal"])
def test_multipliers_start_within_their_draw_and_by_default_at_nothing(form):
    drawn = law(form=form, multipliers_initial=0.1)
    v, *duals = drawn.state.split(drawn.initial_state(np.random.default_rng(3), {}))
    assert not v.any()
    for dual in duals:
        assert (dual > 0.0).all()
        assert (dual < 0.1).all()
    again = drawn.initial_state(np.random.default_rng(3), {})
    np.testing.assert_array_equal(again, drawn.state.join(v, *duals))
    rng = np.random.default_rng(3)
    assert not law(form=form).initial_state(rng, {}).any()
    assert rng.uniform() == np.random.default_rng(3).uniform()


@pytest.mark.parametrize(
    ("fields", "order"),
    [
        # The network alone: a Runge-Kutta method of fourth order.
        ({}, 4),
        ({"orientation": "printed", "form": "literal", "stiffness": 3.0}, 4),
        # Learning first, then the network with what has been learned: first order.
        ({"jacobian": "learned", "rho": 1e-2}, 1),
        ({"jacobian": "printed", "rho": 1e-2}, 1),
    ],
)
def test_a_sample_approaches_the_differential_equation(fields, order):
    """With inputs held, against a tight integration over 4 ms; away from the box."""
    network = law(limits=FREE, **fields)
    u = signals(velocity=np.full(7, 0.5))
    x = some_state(network, size=0.1)
    tight = solve_ivp(
        lambda t, x: network.derivatives(t, x, u), (0, 4e-3), x, rtol=1e-12, atol=1e-13
    ).y[:, -1]
    # Below the time constant over the rows' norm, a sample is one step.
    errors = [np.abs(run(network, x, u, 4e-3, h)[-1] - tight).max() for h in (2e-4, 1e-4, 5e-5)]
    for coarse, fine in pairwise(errors):
        assert fine < 1.3 * 0.5**order * coarse + 1e-11


@pytest.mark.parametrize("q", [HOME, Q])
def test_the_printed_rows_are_how_w_changes(q):
    """Central differences over 1e-6 rad; the rows read off the multipliers' rate H v / delta."""
    network, u, h = law(orientation="printed"), signals(q), 1e-6
    for joint, v in enumerate(np.eye(7)):
        x = network.state.join(v, np.zeros(3), np.zeros(4))
        rates = network.state.part(network.derivatives(0.0, x, u), "orientation_multipliers")
        after, before = (printed_w(KINEMATICS.R_WE(q + way * h * v)) for way in (1, -1))
        change = (after - before) / (2 * h)
        np.testing.assert_allclose(DELTA * rates, change, atol=1e-8, err_msg=f"joint {joint}")


def test_w_has_rank_one_where_the_tool_points_straight_down():
    """So that the paper's own posture of work leaves two rotations to drift."""
    network = law(orientation="printed")
    x = np.zeros(network.state.size)
    assert network.diagnostics(0.0, x, signals(HOME))["orientation_rank"] == 1.0
    assert network.diagnostics(0.0, x, signals(Q))["orientation_rank"] == 3.0
    assert "rank 1" in network.caveats({"orientation_rank_min": 1.0})[0]
    assert network.caveats({"orientation_rank_min": 3.0}) == []
    # The angular velocity's rows have rank 3 in both.
    assert np.linalg.svd(KINEMATICS.J_omega(HOME), compute_uv=False).min() > 0.5


@settings(max_examples=30)
@given(
    arrays(float, 3, elements=st.floats(-0.05, 0.05)), st.floats(1e-4, 0.05), st.floats(0.1, 20.0)
)
def test_what_is_assumed_of_the_force_is_measured_on_a_spring_of_that_stiffness(
    sideways, depth, desired
):
    """On its plane, with a path in it; above the plane a sensor says 0 and no model does."""
    surface = ElasticSurface(normal=N, stiffness=100.0)
    u = signals()
    p_WS = u["p_WE_desired"]
    p_WE = p_WS + sideways - N.dot(sideways) * N - depth * N
    v = u["v_WE_desired"] - N.dot(u["v_WE_desired"]) * N
    # An arm whose joints are its tip's coordinates.
    spring = SpringContact(surface, p_WS, 3, SimpleNamespace(p_WE=np.asarray))
    context = spring.CreateDefaultContext()
    spring.get_input_port().FixValue(context, p_WE)
    force = N.dot(spring.get_output_port().Eval(context))
    u |= {
        "p_WE": p_WE,
        "v_WE_desired": v,
        "normal_force": np.array([force]),
        "normal_force_desired": np.array([desired]),
    }
    measured, assumed = law(), law(force_feedback="assumed")
    x = some_state(measured)
    np.testing.assert_allclose(
        measured.derivatives(0.0, x, u), assumed.derivatives(0.0, x, u), atol=1e-8
    )
    assert "normal_force" not in assumed.inputs


@given(st.floats(0.0, 100.0), st.floats(0.1, 50.0))
def test_the_tip_is_lowered_no_faster_than_is_allowed(force, desired):
    """And raised; what it does along the surface is not touched, and slower is not changed."""
    u = signals(normal_force=np.array([force]), normal_force_desired=np.array([desired]))
    free = asked_of_the_tip(law(), u)
    bounded = asked_of_the_tip(law(approach_speed=0.02), u)
    assert abs(N.dot(bounded)) <= 0.02 + 1e-9
    np.testing.assert_allclose(bounded - N.dot(bounded) * N, free - N.dot(free) * N, atol=1e-9)
    if abs(N.dot(free)) <= 0.02:
        np.testing.assert_allclose(bounded, free, atol=1e-12)


def test_too_much_force_raises_the_tip_and_too_little_lowers_it():
    """At gain over stiffness times the force's error."""
    for force, rise in ((6.0, 0.1), (4.0, -0.1), (5.0, 0.0)):
        asked = asked_of_the_tip(law(), signals(normal_force=np.array([force])))
        assert N.dot(asked) == pytest.approx(rise, abs=1e-12)


def test_the_stiffness_it_has_learned_takes_the_place_of_the_assumed_one():
    known = OnlineStiffness(initial=1e3, exponent=1.0)
    network = law(stiffness=known)
    asked = asked_of_the_tip(network, signals(), stiffness=[500.0, 1.0, -1.0, 0.0])
    assert N.dot(asked) == pytest.approx(10.0 * (4.5 - 5.0) / 500.0)


def test_a_sample_teaches_it_the_stiffness_from_force_and_depth():
    """A spring of 800 N/m, seen at five depths."""
    network = law(stiffness=OnlineStiffness(initial=2e3, exponent=1.0))
    x = network.initial_state(np.random.default_rng(0), {})
    for depth in 1e-3 * np.arange(5.0, 12.0):
        u = signals(p_WE=-depth * N, normal_force=np.array([800.0 * depth]))
        x = network.step(0.0, x, u, 1e-3)
    assert network.state.part(x, "stiffness")[0] == pytest.approx(800.0, rel=1e-2)


@pytest.mark.parametrize(("reaction", "speed"), [("hold", 0.0), ("retreat", 0.02)])
def test_once_contact_is_lost_all_that_is_asked_is_to_stay_or_to_leave(reaction, speed):
    network = law(contact_loss=ContactLoss(reaction=reaction, patience=0.01))
    x = network.initial_state(np.random.default_rng(0), {})
    touching = signals()
    x = network.step(0.0, x, touching, 1e-3)
    gone = signals(normal_force=np.array([0.0]))
    for _ in range(12):
        x = network.step(0.0, x, gone, 1e-3)
    contact = network.state.part(x, "contact")
    assert contact[0] == LOST
    asked = asked_of_the_tip(network, gone, contact=contact)
    np.testing.assert_allclose(asked, speed * N, atol=1e-12)


@pytest.mark.parametrize("form", ["normalised", "literal"])
@pytest.mark.parametrize("orientation", ["rotation", "printed"])
@pytest.mark.parametrize("jacobian", ["known", "learned", "printed"])
def test_many_instants_are_told_as_single_ones_are(form, orientation, jacobian):
    network = law(form=form, orientation=orientation, jacobian=jacobian)
    each = [signals(HOME + shift) for shift in (0.0, 0.1, -0.2)]
    states = np.array([some_state(network, seed) for seed in range(3)])
    many = {name: np.array([u[name] for u in each]) for name in each[0]}
    told = network.diagnostics(np.arange(3.0), states, many)
    assert set(told) == set(network.observables.parts)
    for k in range(3):
        single = network.diagnostics(float(k), states[k], each[k])
        for name, value in single.items():
            np.testing.assert_allclose(told[name][k], value, atol=1e-12)
            assert value.shape == network.observables.parts[name][1]


def test_a_learned_jacobian_starts_at_nothing_or_as_the_true_one():
    network = law(jacobian="learned", J_hat_initial="exact")
    x = network.initial_state(np.random.default_rng(0), signals())
    np.testing.assert_array_equal(network.state.part(x, "J_hat"), signals()["J"])
    blind = {name: value for name, value in signals().items() if name != "J"}
    with pytest.raises(InvalidInputError, match=r"law\.J_hat_initial: exact needs the arm's J"):
        network.initial_state(np.random.default_rng(0), blind)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"stiffness": 0.0}, "stiffness"),
        ({"gain": -1.0}, "gain"),
        ({"rho": 0.0}, "rho"),
        ({"time_constant": float("nan")}, "time_constant"),
        ({"approach_speed": 0.0}, "approach_speed"),
        ({"form": "short"}, "form.*normalised.*literal"),
        ({"jacobian": "guessed"}, "jacobian.*known"),
        ({"orientation": "up"}, "orientation"),
        ({"force_feedback": "felt"}, "force_feedback"),
        (
            {"force_feedback": "assumed", "stiffness": OnlineStiffness()},
            "stiffness: needs force_feedback: measured",
        ),
        (
            {"force_feedback": "assumed", "contact_loss": ContactLoss()},
            "contact_loss: needs force_feedback: measured",
        ),
        ({"form": "literal", "stiffness": OnlineStiffness()}, "stiffness: must be a number"),
        ({"multipliers_initial": -0.1}, "multipliers_initial"),
        ({"return_gain": 0.5}, "return_gain: needs home"),
        ({"home": np.zeros(6)}, "home: must have 7 entries, one per joint, not 6"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        law(**fields)


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ({"stiffness": OnlineStiffness()}, "stiffness: learning it"),
        ({"contact_loss": ContactLoss()}, "contact_loss:"),
    ],
)
def test_what_is_learned_by_samples_is_not_integrated(fields, key):
    message = rf"law\.{key} needs a sampled law; give a period instead of an integrator"
    with pytest.raises(InvalidInputError, match=message):
        law(**fields).continuous()
    network = law()
    assert network.continuous() is network


def test_a_contact_that_counts_as_lost_at_once_is_refused():
    network = law(contact_loss=ContactLoss(floor=0.5))
    assert network.doubts(Circumstances(pressing_force=0.6)) == []
    assert network.doubts(Circumstances()) == law().doubts(Circumstances(pressing_force=0.1)) == []
    message = r"law\.contact_loss\.floor: must be below force\.value, 0\.5 N, not 0\.5"
    with pytest.raises(InvalidInputError, match=message):
        network.doubts(Circumstances(pressing_force=0.5))


def test_what_it_did_without_contact_is_told_of():
    lost = {"contact_lost_time_s": 1.0}
    for reaction in ("hold", "retreat"):
        (said,) = law(contact_loss=ContactLoss(reaction=reaction)).caveats(lost)
        assert said.startswith("law.contact_loss: ")
        assert reaction in said
    assert law(contact_loss=ContactLoss()).caveats({}) == law().caveats(lost) == []


def test_a_period_too_long_for_its_gains_is_refused():
    network = law()
    assert network.sampled(0.099) is network
    with pytest.raises(InvalidInputError, match=r"period: must be below 0\.1 s .* not 0\.1"):
        network.sampled(0.1)
