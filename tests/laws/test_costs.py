"""What schemes minimise: against Drake's solver, along a motion, and in whole runs."""

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from drake_rnn import InvalidInputError, JointLimits, Zeroing, load_arm, load_experiment, simulate
from drake_rnn.laws.parts.programs import Rates

ARM = load_arm("panda")
KINEMATICS, DYNAMICS, HOME, N = ARM.kinematics(), ARM.believed_dynamics(), ARM.home, 7
LIMITS = JointLimits.unlimited(N).replace(velocity=0.4)
V = np.array([0.3, -0.2, 0.4, 0.1, -0.5, 0.2, 0.3])
COSTS = {
    "velocity": {"return_gain": 0.5},
    "kinetic_energy": {"cost": "kinetic_energy", "return_gain": 0.5},
    "largest_velocity": {"cost": "largest_velocity", "return_gain": 0.5},
    "largest_within": {"cost": "largest_velocity", "bounds": "velocity"},
    "manipulability": {"manipulability": 0.2, "return_gain": 0.5},
}


def law(**fields):
    return Zeroing(**{"limits": LIMITS, "home": HOME + 0.1, "damping": 1e-6, **fields})


def signals(q):
    """What an arm in a posture sees, whose tool is to move."""
    p = KINEMATICS.p_WE(q)
    u = {"position": q, "J": KINEMATICS.J(q), "J_omega": KINEMATICS.J_omega(q)}
    u |= {"M": DYNAMICS.M(q), "p_WE": p, "p_WE_desired": p, "a_WE_desired": np.zeros(3)}
    return u | {"v_WE_desired": np.array([0.05, -0.1, 0.08])}


def best(program):
    """The optimum by Drake's solver."""
    made, k = MathematicalProgram(), program.c.size
    x = made.NewContinuousVariables(k)
    made.AddQuadraticCost(program.W, program.c, x)
    made.AddLinearEqualityConstraint(program.A, program.b, x)
    if (rows := program.inequalities()) is not None:
        made.AddLinearConstraint(rows[0], np.full(rows[1].size, -np.inf), rows[1], x)
    result = ClarabelSolver().Solve(made)
    assert result.is_success()
    return result.GetSolution(x)


@pytest.mark.parametrize("cost", COSTS)
def test_the_network_comes_to_the_optimum_of_drakes_solver(cost):
    """In five postures at rest, to 1e-6; feedback and gains that would move the optimum are off."""
    rng, h = np.random.default_rng(4), 1e-3
    for _ in range(5):
        u = signals(HOME + 0.3 * rng.uniform(-1.0, 1.0, N))
        made = law(**COSTS[cost], feedback=0.0, gain=500.0)
        program = made.scheme.program(u)
        kept = made.dynamics.init(u, rng)
        for k in range(200):
            kept["samples"] = np.array([float(k)])
            _, kept = made.dynamics.step(kept, u, h, k * h, program, Rates())
        np.testing.assert_allclose(kept["optimum"], best(program), atol=1e-6)


@pytest.mark.parametrize("cost", COSTS)
def test_rates_are_derivatives_along_a_motion(cost):
    """Central differences over 2 us; that of the gradient is itself a difference."""
    made, h = law(**COSTS[cost]).scheme, 1e-6
    at = [signals(HOME + t * V) for t in (-h, 0.0, h)]
    before, now, after = (made.program(u) for u in at)
    u_dot = {name: (at[2][name] - at[0][name]) / (2.0 * h) for name in ("J", "J_omega", "M")}
    x = np.append(V, 0.5)[: now.c.size]
    rates = made.rates(at[1], u_dot, x)
    for name in ("W", "c", "A"):
        found = (getattr(after, name) - getattr(before, name)) / (2.0 * h)
        told = getattr(rates, name)
        np.testing.assert_allclose(0.0 * found if told is None else told, found, atol=2e-4)


def run(**changes):
    circle = {"kind": "circle", "plane": "yz", "size": 0.05, "period": 2, "timing": "sin2"}
    document = {"name": "z", "arm": "panda", "path": {**circle, "laps": 1}, "period": 2e-3}
    own = {"kind": "zeroing", "gain": 200, **changes}
    return simulate(load_experiment({**document, "duration": 2, "law": own})).series


def energy(series):
    return sum(
        v @ DYNAMICS.M(q) @ v for q, v in zip(series["position"], series["velocity"], strict=True)
    )


@pytest.mark.long
def test_each_cost_has_the_least_of_its_own():
    """Each without the way back; the manipulability from a posture where it is low."""
    plain = run(return_gain=0.0)
    light = run(cost="kinetic_energy", return_gain=0.0)
    slow = run(cost="largest_velocity", return_gain=0.0)
    assert energy(light) < 0.8 * energy(plain)
    assert np.square(plain["velocity"]).sum() < 0.99 * np.square(slow["velocity"]).sum()
    assert np.abs(slow["velocity"]).max() < 0.85 * np.abs(plain["velocity"]).max()


def test_manipulability_grows_while_the_tool_stays():
    start = np.array([0.0, -0.2, 0.0, -1.0, 0.0, 1.2, 0.8])
    changes = {"path": {"kind": "rest"}, "start": start.tolist(), "duration": 2.0}
    document = {"name": "z", "arm": "panda", "period": 2e-3, **changes}

    def measured(q):
        return np.sqrt(np.linalg.det(KINEMATICS.J(q) @ KINEMATICS.J(q).T))

    own = {"kind": "zeroing", "return_gain": 0.0, "manipulability": 0.5}
    result = simulate(load_experiment({**document, "law": own}))
    first, last = measured(result.series["position"][0]), measured(result.series["position"][-1])
    assert last > 1.05 * first
    assert result.metrics["position_error_max_m"] < 1e-4


def test_what_has_no_meaning_is_refused():
    with pytest.raises(InvalidInputError, match="manipulability: needs cost: velocity"):
        law(cost="kinetic_energy", manipulability=1.0)
    with pytest.raises(InvalidInputError, match="manipulability: needs cost: velocity"):
        law(task_size=2, manipulability=1.0)
    with pytest.raises(InvalidInputError, match="blend"):
        law(cost="largest_velocity", blend=0.0)
