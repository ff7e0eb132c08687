"""Drake linearises a closed loop: its systems convert to AutoDiffXd."""

import gc
import re
import weakref
from dataclasses import dataclass, field

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator, Simulator_
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import FirstOrderTaylorApproximation, Linearize

from drake_rnn import (
    AddLoop,
    Circle,
    ContinuousController,
    ContinuousLaw,
    DitherSettings,
    IdealArm,
    InvalidInputError,
    Layout,
    PathSource,
    Rest,
    SampledController,
    SimulationError,
    SimultaneousLearning,
    StateAdjustment,
    load_arm,
    load_experiment,
)
from drake_rnn.features.joint_noise import HeldNoise
from drake_rnn.runs.simulation import build_simulator, start_laws
from drake_rnn.systems import Dynamics, Kinematics
from drake_rnn.systems.block import AutoDiffBlock

PANDA = load_arm("panda")
CONTINUOUS = {"integrator": {"scheme": "runge_kutta3", "accuracy": 1e-6}, "period": None}
#: Loops of each law that is a differential equation, by experiment and what differs from it.
LOOPS = {
    "simplified_lvi_continuous": {},
    "ramped_adjustment": {},
    "modified_state_adjustment_panda": {},
    "slc_nephroid_known_continuous": {},
    "slc_nephroid_continuous": {"dither": None, "law.J_hat_initial": "exact"},
    "naljdf_clover": CONTINUOUS,
    "moaljdf_parallelogram": CONTINUOUS,
    "motion_force_tricuspid": CONTINUOUS,
    "motion_force_tricuspid_w": CONTINUOUS,
}
# Central differences by h err by h^2 times third derivatives and by the rounding of the rates over
# h; both are below this share of the largest entry.
STEP, SHARE = 1e-6, 1e-8


def differences(diagram, context):
    """Return the derivatives of a diagram's rates by its state, by central differences."""
    context = context.Clone()
    x = context.get_continuous_state_vector().CopyToVector()

    def rates(x):
        context.SetContinuousState(x)
        return diagram.EvalTimeDerivatives(context).CopyToVector()

    columns = [(rates(x + dx) - rates(x - dx)) / (2.0 * STEP) for dx in STEP * np.eye(x.size)]
    return np.transpose(columns)


def converted(diagram, context):
    """Return the AutoDiffXd twin of a diagram and a context with the same state."""
    twin = diagram.ToAutoDiffXd()
    its = twin.CreateDefaultContext()
    its.SetTimeStateAndParametersFrom(context)
    return twin, its


def on_the_way(name, changes):
    simulator, loop = build_simulator(load_experiment(name, changes))
    context = simulator.get_mutable_context()
    start_laws([loop], context)
    simulator.Initialize()
    simulator.AdvanceTo(0.01)
    return simulator, loop


@pytest.mark.parametrize("name", LOOPS)
def test_the_linearisation_of_a_loop_equals_central_differences(name):
    simulator, _ = on_the_way(name, LOOPS[name])
    diagram, context = simulator.get_system(), simulator.get_context()
    A, expected = FirstOrderTaylorApproximation(diagram, context).A(), differences(diagram, context)
    assert np.abs(A - expected).max() <= SHARE * np.abs(expected).max()


@pytest.mark.parametrize("name", LOOPS)
def test_the_twin_of_a_loop_has_the_same_outputs_and_rates(name):
    simulator, loop = on_the_way(name, LOOPS[name])
    diagram, context = simulator.get_system(), simulator.get_context()
    twin, its = converted(diagram, context)
    for system in map(diagram.GetSubsystemByName, loop.systems):
        other = twin.GetSubsystemByName(system.get_name())
        for k in range(system.num_output_ports()):
            port = system.get_output_port(k)
            value = port.Eval(system.GetMyContextFromRoot(context))
            same = other.get_output_port(k)
            assert same.get_name() == port.get_name()
            found = ExtractValue(same.Eval(other.GetMyContextFromRoot(its))).ravel()
            # Sums are added in another order.
            scale = 1e-12 * max(1.0, np.abs(value).max())
            np.testing.assert_allclose(found, value, rtol=0.0, atol=scale)
    x = context.get_continuous_state_vector().CopyToVector()
    terms = np.abs(FirstOrderTaylorApproximation(diagram, context).A()) @ np.abs(x)
    rates = diagram.EvalTimeDerivatives(context).CopyToVector()
    found = ExtractValue(twin.EvalTimeDerivatives(its).CopyToVector()).ravel()
    # Of the size of the terms that a high gain multiplies, and that cancel.
    np.testing.assert_allclose(found, rates, rtol=0.0, atol=1e-12 * terms.max())


def at_rest(law, body=None):
    """Return the diagram of a law that holds the arm where it is, and its context."""
    builder = DiagramBuilder()
    body = body or IdealArm(PANDA)
    place = builder.AddNamedSystem("place", PathSource(Rest(), PANDA.kinematics().p_WE(PANDA.home)))
    controller = law if isinstance(law, SampledController) else ContinuousController(law)
    loop = AddLoop(builder, body, controller, place)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    return simulator, loop


def apart(found, expected):
    """Return the largest distance of an eigenvalue from the nearest one that is expected."""
    return max(np.abs(np.asarray(expected) - value).min() for value in found)


@pytest.mark.parametrize("kappa", [2.0, 5.0])
def test_the_eigenvalues_of_simultaneous_learning_are_its_gains(kappa):
    r"""The task's error decays with kappa, the posture's with return_gain, in the null space.

    With :math:`\dot v = r (J^T y - c (q - q_0) - v)` and
    :math:`\dot y = r (\kappa (x_d - x) - J v)`, they are the roots of
    :math:`s^2 + r s + r c` in the null space of J, and of
    :math:`s^3 + r s^2 + (r c + r^2 \sigma^2) s + r^2 \sigma^2 \kappa` for each singular value.
    """
    rate, back = 1e4, 1.5
    law = SimultaneousLearning(
        limits=PANDA.limits,
        home=PANDA.home,
        jacobian="known",
        kappa=kappa,
        rate=rate,
        return_gain=back,
    )
    simulator, _ = at_rest(law)
    A = Linearize(simulator.get_system(), simulator.get_context()).A()
    found = np.linalg.eigvals(A)
    sigma = np.linalg.svd(PANDA.kinematics().J(PANDA.home), compute_uv=False)
    free = np.roots([1.0, rate, rate * back])
    task = [
        np.roots([1.0, rate, rate * back + (rate * s) ** 2, (rate * s) ** 2 * kappa]) for s in sigma
    ]
    assert found.size == 17
    # Rounding of matrices whose entries are up to the rate.
    assert apart(found, [*free, *np.ravel(task)]) < 1e-9 * rate
    slow = np.sort(found[np.abs(found) < 10.0].real)
    assert slow.size == 7
    # A network of finite rate follows by about kappa (kappa - c) / (rate sigma^2) less.
    near = kappa * abs(kappa - back) / (rate * sigma.min() ** 2)
    slow_expected = np.sort([-kappa] * 3 + [-back] * 4)
    np.testing.assert_allclose(slow, slow_expected, atol=1.2 * near + back**2 / rate)


def test_the_eigenvalues_of_state_adjustment_are_its_rate():
    """In the null space the joints go to the target at the rate; the task is an invariant."""
    law = StateAdjustment(target=PANDA.home, limits=PANDA.limits, rate=4.0, time_constant=1e-4)
    simulator, _ = at_rest(law)
    found = np.linalg.eigvals(Linearize(simulator.get_system(), simulator.get_context()).A())
    slow = np.roots([1e-4, 1.0, 4.0])[1]
    assert np.sum(np.abs(found - slow) < 1e-6) == 4
    assert np.sum(np.abs(found) < 1e-6) == 3
    assert np.all(found[np.abs(found) > 10.0].real < -100.0)


@pytest.mark.parametrize("name", ["panda", "iiwa14", "planar6"])
def test_kinematics_with_derivatives_are_the_same_and_differentiate_to_the_jacobian(name):
    arm = load_arm(name)
    q = arm.home + 0.1
    v = np.linspace(0.1, 0.5, arm.n)
    for block in (Kinematics(arm), Dynamics(arm)):
        twin = block.ToAutoDiffXd()
        assert isinstance(twin, AutoDiffBlock)
        context, its = block.CreateDefaultContext(), twin.CreateDefaultContext()
        for port, value in (("position", q), ("velocity", v)):
            block.GetInputPort(port).FixValue(context, value)
            twin.GetInputPort(port).FixValue(its, InitializeAutoDiff(value))
        for k in range(block.num_output_ports()):
            expected = block.get_output_port(k).Eval(context)
            found = ExtractValue(twin.get_output_port(k).Eval(its)).ravel()
            scale = 1e-13 * max(1.0, np.abs(expected).max())
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=scale)
        if isinstance(block, Kinematics):
            J = block.GetOutputPort("J").Eval(context).reshape(-1, arm.n)
            gradient = ExtractGradient(twin.GetOutputPort("p_WE").Eval(its))
            np.testing.assert_allclose(gradient, J, rtol=0.0, atol=1e-14)


def test_a_path_differentiates_by_time():
    start, R = PANDA.kinematics().p_WE(PANDA.home), PANDA.kinematics().R_WE(PANDA.home)
    source = PathSource(Circle(size=0.05, period=2.0), start, "pose", R, preview=0.1)
    source.set_name("path")
    twin = source.ToAutoDiffXd()
    context = twin.CreateDefaultContext()
    context.SetTime(AutoDiffXd(0.3, np.array([2.0])))

    def found(name):
        return ExtractGradient(twin.GetOutputPort(name).Eval(context)).ravel()

    plain = source.CreateDefaultContext()
    plain.SetTime(0.3)
    for name, rate in {
        "p_WE_desired": "v_WE_desired",
        "v_WE_desired": "a_WE_desired",
        "p_preview": "v_preview",
        "w_WE_desired": "alpha_WE_desired",
    }.items():
        assert np.array_equal(found(name), 2.0 * source.GetOutputPort(rate).Eval(plain))
    with pytest.raises(SimulationError, match=r"^a_WE_desired: has no derivative by time; take"):
        found("a_WE_desired")


def test_a_law_that_varies_with_time_differentiates_by_time():
    law = StateAdjustment(target=PANDA.home + 0.1, limits=PANDA.limits, ramp_time=1.0)
    simulator, _ = at_rest(law)
    diagram, context = simulator.get_system(), simulator.get_mutable_context()
    twin, its = converted(diagram, context)
    its.SetTime(AutoDiffXd(0.4, np.ones(1)))
    found = ExtractGradient(twin.EvalTimeDerivatives(its).CopyToVector()).ravel()
    rates = []
    for t in (0.4 - STEP, 0.4 + STEP):
        context.SetTime(t)
        rates.append(diagram.EvalTimeDerivatives(context).CopyToVector())
    expected = (rates[1] - rates[0]) / (2.0 * STEP)
    assert np.abs(found - expected).max() <= SHARE * np.abs(expected).max()
    assert np.abs(expected).max() > 1.0


def test_a_twin_is_simulated_with_derivatives_by_its_initial_state():
    """The motion of a loop at rest follows its linearisation: x(t) = exp(A t) x(0)."""
    law = SimultaneousLearning(limits=PANDA.limits, home=PANDA.home, jacobian="known", rate=100.0)
    simulator, _ = at_rest(law)
    diagram, context = simulator.get_system(), simulator.get_context()
    A = Linearize(diagram, context).A()
    twin, its = converted(diagram, context)
    its.SetContinuousState(InitializeAutoDiff(context.get_continuous_state_vector().CopyToVector()))
    with_derivatives = Simulator_[AutoDiffXd](twin, its)
    step = 1e-3
    ResetIntegratorFromFlags(with_derivatives, "runge_kutta3", step)
    with_derivatives.get_mutable_integrator().set_fixed_step_mode(True)
    with_derivatives.AdvanceTo(3 * step)
    found = ExtractGradient(its.get_continuous_state_vector().CopyToVector())
    h = step * A
    one = np.eye(len(A)) + h + h @ h / 2.0 + h @ h @ h / 6.0
    # At rest the third-order method does exactly this.
    np.testing.assert_allclose(found, one @ one @ one, rtol=0.0, atol=1e-9)


def refusal(make):
    with pytest.raises(InvalidInputError) as caught:
        make()
    return str(caught.value)


def sampled():
    law = SimultaneousLearning(limits=PANDA.limits, home=PANDA.home, jacobian="known")
    return SampledController(law, 1e-3)


def test_what_does_not_convert_is_named_with_the_reason():
    simulator, _ = at_rest(sampled())
    assert refusal(simulator.get_system().ToAutoDiffXd) == (
        "controller: SampledController cannot be converted to AutoDiffXd, so its diagram cannot be "
        "linearised: a sampled law has no continuous state; give a ContinuousController a law that "
        "is a differential equation"
    )
    noise = HeldNoise(7, DitherSettings(sigma=0.1, hold=1e-3))
    noise.set_name("dither")
    assert refusal(noise.ToAutoDiffXd) == (
        "dither: HeldNoise cannot be converted to AutoDiffXd, so its diagram cannot be linearised: "
        "it changes at samples, or its derivatives are not known"
    )
    twin = Kinematics(PANDA).ToAutoDiffXd()
    twin.set_name("kinematics")
    assert refusal(lambda: twin.ToScalarType[float]()).startswith(
        "kinematics: cannot be converted from AutoDiffXd back to float"
    )


@dataclass(frozen=True)
class Own(ContinuousLaw):
    """A law of a user's own, in plain NumPy."""

    form: str = "solve"
    n: int = field(default=7)

    @property
    def state(self):
        return Layout(v=(self.n,))

    @property
    def inputs(self):
        return Layout(position=(self.n,), J=(3, self.n), p_WE=(3,), p_WE_desired=(3,))

    def derivatives(self, t, x, u):
        J, error = u["J"], u["p_WE_desired"] - u["p_WE"]
        if self.form == "solve":
            v = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(3), 3.0 * error)
        elif self.form == "inv":
            v = J.T @ np.linalg.inv(J @ J.T) @ np.clip(error, -1.0, 1.0)
        elif self.form == "pinv":
            v = np.linalg.pinv(J) @ (3.0 * error) - 0.1 * np.tanh(u["position"]) * np.cos(t)
        elif self.form == "norm":
            v = J.T.dot(error / np.linalg.norm(error))
        else:
            v = np.linalg.lstsq(J, error, rcond=None)[0]
        return 20.0 * (v - x)


def own(form, offset=0.01):
    builder = DiagramBuilder()
    start = PANDA.kinematics().p_WE(PANDA.home)
    place = builder.AddNamedSystem("place", PathSource(Rest(), start + offset))
    AddLoop(builder, IdealArm(PANDA), ContinuousController(Own(form)), place)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    x = context.get_continuous_state_vector().CopyToVector()
    context.SetContinuousState(np.where(np.isnan(x), 0.05, x))
    return diagram, context


@pytest.mark.parametrize("form", ["solve", "inv", "pinv", "norm"])
def test_a_law_in_plain_numpy_is_differentiated(form):
    diagram, context = own(form)
    A, expected = FirstOrderTaylorApproximation(diagram, context).A(), differences(diagram, context)
    assert np.abs(A - expected).max() <= SHARE * np.abs(expected).max()


def test_a_law_that_has_no_derivative_is_named_with_the_reason():
    # Functions of NumPy for which there is no rule.
    diagram, context = own("lstsq")
    told = re.escape("controller: Own.derivatives: cannot be computed with numbers of AutoDiffXd")
    with pytest.raises(SimulationError, match=f"^{told}"):
        Linearize(diagram, context)
    # A norm at zero.
    diagram, context = own("norm", offset=0.0)
    twin, its = converted(diagram, context)
    seeded = InitializeAutoDiff(context.get_continuous_state_vector().CopyToVector())
    its.SetContinuousState(seeded)
    told = "controller: Own.derivatives: "
    with pytest.raises(SimulationError, match=f"^{told}"):
        twin.EvalTimeDerivatives(its)


def test_a_state_that_is_not_set_is_named():
    law = SimultaneousLearning(limits=PANDA.limits, home=PANDA.home, jacobian="known")
    simulator, _ = at_rest(law)
    diagram = simulator.get_system()
    told = "controller: its state is not set; initialize a Simulator with the context, or call"
    with pytest.raises(SimulationError, match=f"^{told}"):
        FirstOrderTaylorApproximation(diagram, diagram.CreateDefaultContext())


def test_twins_are_freed_by_the_collector():
    diagram, _ = own("solve")
    twin = diagram.ToAutoDiffXd()
    freed = [weakref.ref(twin.GetSubsystemByName(name)) for name in ("controller", "kinematics")]
    del twin
    gc.collect()
    assert not [each() for each in freed if each() is not None]
