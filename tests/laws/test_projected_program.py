"""Networks of one projection by themselves: their limit, their steps, and what they agree with."""

import numpy as np
import pytest
from program_helpers import optimum, random_program

from drake_rnn import JointLimits, Projection, SimultaneousLearning
from drake_rnn.laws.parts.programs import PrimalDual, Program
from drake_rnn.laws.projection import PRIMAL, inequality, iterate, neurons, project

NETWORKS = ("lvi", "simplified_lvi", "dual", "simplified_dual")
DAMPING = 1e-14


def programs(count):
    """Programs with a box, with other inequalities, and with both."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        yield rng, random_program(rng, box=seed % 3 != 1, rows=seed % 3 != 2)


def equations_alone():
    return random_program(np.random.default_rng(1), box=False, rows=False)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("spread", [0.1, 100.0])
def test_its_limit_is_the_optimum_of_a_random_program_from_any_start(network, spread):
    """60 programs, by three implicit steps; 1e-6."""
    for rng, program in programs(60):
        form = project(network, program, DAMPING)
        y = spread * rng.normal(size=form.g.shape)
        rows = 0 if program.d is None else program.d.size
        assert y.size == neurons(network, 7, 3, program.box is not None, rows)
        for _ in range(3):
            y = form.after(y, 1e7)
        np.testing.assert_allclose(form.optimum(y), optimum(program), atol=1e-6)


@pytest.mark.parametrize("network", ["lvi", "simplified_lvi", "dual"])
def test_without_bounds_its_limit_is_the_optimum_too(network):
    program = equations_alone()
    form = project(network, program, DAMPING)
    y = form.after(form.after(np.ones(form.g.size), 1e7), 1e7)
    np.testing.assert_allclose(form.optimum(y), optimum(program), atol=1e-9)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("turns", [0.1, 10.0, 1e4])
def test_an_implicit_step_fulfils_its_equation_at_any_gain(network, turns):
    """y - y_0 = gain h rate(y), to 1e-10 of its terms."""
    for rng, program in programs(40):
        form = project(network, program, DAMPING)
        start = 10.0 * rng.normal(size=form.g.shape)
        y = form.after(start, turns)
        short = np.abs(y - start - turns * form.rate(y)).max()
        assert short < 1e-10 * (1.0 + turns) * (1.0 + np.abs(y).max())


@pytest.mark.parametrize("network", NETWORKS)
def test_many_programs_at_once_are_solved_as_each_alone(network):
    each = [program for _, program in programs(30) if program.box and program.C is not None]
    whole = Program(
        *(np.stack([p[k] for p in each]) for k in range(4)),
        tuple(np.stack([p.box[k] for p in each]) for k in range(2)),
        *(np.stack([p[k] for p in each]) for k in (5, 6)),
    )
    forms = project(network, whole, DAMPING)
    found = forms.optimum(forms.after(np.zeros(forms.g.shape), 1e7))
    for row, program in zip(found, each, strict=True):
        form = project(network, program, DAMPING)
        alone = form.optimum(form.after(np.zeros(form.g.shape), 1e7))
        np.testing.assert_allclose(row, alone, atol=1e-9)


def test_the_primal_dual_network_never_moves_away_from_its_equilibrium():
    """The distance to it falls at every step, whatever the start: global convergence."""
    for rng, program in programs(30):
        form = project("lvi", program, DAMPING)
        y = 10.0 * rng.normal(size=form.g.shape)
        rest = form.after(form.after(form.after(y, 1e7), 1e7), 1e7)
        away = [np.linalg.norm(y - rest)]
        for _ in range(30):
            y = form.after(y, 0.3)
            away.append(np.linalg.norm(y - rest))
        assert (np.diff(away) <= 1e-9).all()
        assert away[-1] < 0.9 * away[0]


def test_iterations_come_nearer_with_each_and_end_at_the_optimum():
    """The distance to the equilibrium falls with each; 1e-6 after as many as they need."""
    for rng, program in programs(9):
        form = project("lvi", program, DAMPING)
        rest = form.after(form.after(np.zeros(form.g.size), 1e8), 1e8)
        y = rng.normal(size=form.g.shape)
        away = [np.linalg.norm(y - rest)]
        for _ in range(50):
            y = iterate(program, DAMPING, y, 1)
            away.append(np.linalg.norm(y - rest))
        assert (np.diff(away) <= 1e-9).all()
        y = iterate(program, DAMPING, y, 2000)
        np.testing.assert_allclose(y[:7], optimum(program), atol=1e-6)


@pytest.mark.parametrize("network", ["lvi", "simplified_lvi", "dual"])
def test_an_explicit_step_is_stable_up_to_the_gain_that_is_told(network):
    program = equations_alone()
    form = project(network, program, 1e-3)
    rest = form.after(form.after(np.zeros(form.g.size), 1e8), 1e8)
    for share in (0.98, 1.02):
        y = rest + 1e-3
        for _ in range(1500):
            y = y + share * form.stable_below() * form.rate(y)
        assert (np.abs(y - rest).max() < 1e-3) == (share < 1.0)


def test_where_bounds_leave_no_way_the_multipliers_stay_bounded_and_what_is_short_is_least():
    """epsilon lambda = b - A x; the velocity is that of least squares within the box."""
    program = random_program(np.random.default_rng(3), rows=False)._replace(b=np.full(3, 50.0))
    for network in NETWORKS:
        form = project(network, program, 1e-6)
        y = np.zeros(form.g.size)
        for _ in range(4):
            y = form.after(y, 1e9)
        x, A = form.optimum(y), program.A
        assert (np.abs(x) <= 0.8 + 1e-9).all()
        soft = program._replace(
            W=program.W + A.T @ A / 1e-6,
            c=program.c - A.T @ program.b / 1e-6,
            A=np.zeros((1, 7)),
            b=np.zeros(1),
        )
        np.testing.assert_allclose(x, optimum(soft), atol=1e-5)


def test_the_inequality_is_monotone():
    """y^T H y >= 0, of which convergence follows; H is not symmetric."""
    for _, program in programs(20):
        H, p, lower, upper = inequality(program, 1e-6)
        assert np.linalg.eigvalsh(H + H.T).min() >= -1e-12
        assert lower.shape == upper.shape == p.shape
        assert (lower < upper).all()
        assert np.abs(H - H.T).max() > 0.1


def test_the_network_of_simultaneous_learning_is_the_simplified_one():
    """RNN (16), without a bound of the acceleration; the same rates to rounding."""
    rng, n = np.random.default_rng(0), 7
    limits = JointLimits.unlimited(n).replace(
        velocity=rng.uniform(0.2, 1.0, n), position_lower=-np.ones(n), position_upper=np.ones(n)
    )
    shared = {"limits": limits, "home": 0.1 * rng.normal(size=n), "limit_stiffness": 3.0}
    theirs = SimultaneousLearning(
        **shared, kappa=5.0, rate=800.0, return_gain=2.0, jacobian="known",
        acceleration_bound="none", multiplier_limit="none",
    )  # fmt: skip
    ours = Projection(
        **shared, network="simplified_lvi", feedback=5.0, gain=800.0, return_gain=2.0,
        bounds="velocity", damping=1e-12,
    ).continuous()  # fmt: skip
    for _ in range(20):
        u = {name: 0.5 * rng.normal(size=s) for name, (_, s) in ours.inputs.parts.items()}
        x = rng.normal(size=ours.state.size)
        expected = theirs.derivatives(0.0, x, {name: u[name] for name in theirs.inputs.parts})
        np.testing.assert_allclose(ours.derivatives(0.0, x, u), expected, atol=1e-9)


def test_the_network_of_motion_force_control_is_the_simplified_one():
    """Its multipliers have the other sign; preferred velocities are -c."""
    for rng, program in programs(20):
        if program.box is None:
            continue
        program = program._replace(W=np.eye(7), C=None, d=None)
        network = PrimalDual(program.A, program.A, program.b, *program.box, 0.01, -program.c)
        z = rng.normal(size=10)
        mirrored = np.concatenate((z[:7], -z[7:]))
        rate = 100.0 * project("simplified_lvi", program, 0.0).rate(mirrored)
        np.testing.assert_allclose(
            network.rate(z), np.concatenate((rate[:7], -rate[7:])), atol=1e-10
        )


def test_a_simplified_dual_network_without_bounds_has_no_neuron():
    with pytest.raises(ValueError, match="needs a program with bounds or inequalities"):
        project("simplified_dual", equations_alone(), 0.0)
    assert neurons("simplified_dual", 7, 3, has_bounds=False) == 0
    assert [neurons(name, 7, 3, has_bounds=False) for name in PRIMAL] == [10, 10]
