"""A law as a Drake system."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_rnn import (
    ContinuousController,
    ContinuousLaw,
    InvalidInputError,
    JointDriftFree,
    JointLimits,
    Layout,
    SampledController,
    SampledLaw,
    SimulationError,
    SimultaneousLearning,
)
from drake_rnn.laws import ContinuousReading
from drake_rnn.laws.joint_drift_free import TwoStep

N = 3
LIMITS = JointLimits.unlimited(N).replace(velocity=0.5, acceleration=1.0)
LAW = SimultaneousLearning(limits=LIMITS, home=np.zeros(N), jacobian="known")
LEARNING = SimultaneousLearning(limits=LIMITS, home=np.zeros(N))
CONTROLLERS = [lambda law: SampledController(law, 1e-3), ContinuousController]
IDS = ["sampled", "continuous"]


class Exploding(SampledLaw, ContinuousLaw):
    """A law that is not finite any more after a while."""

    state = Layout(v=(N,), other=(2,))
    inputs = Layout(position=(N,))
    observables = Layout(size=(1,))

    def derivatives(self, t, x, u):
        return np.array([0.0, 0.0, 0.0, 0.0, np.nan if t > 0.1 else 1.0])

    def step(self, t, x, u, period):
        return x + period * self.derivatives(t, x, u)

    def diagnostics(self, t, x, u):
        return {"size": np.linalg.norm(x, axis=-1, keepdims=True)}


def wire(controller, **values):
    """The controller with constants on its ports, in a simulator."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("controller", controller)
    for name, (at, _) in controller.reading.inputs.parts.items():
        value = np.asarray(values.get(name, np.zeros(at.stop - at.start))).ravel()
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), controller.GetInputPort(name))
    simulator = Simulator(builder.Build())
    return simulator, controller.GetMyMutableContextFromRoot(simulator.get_mutable_context())


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_ports_are_the_laws_own(make):
    controller = make(LEARNING)
    inputs = [controller.get_input_port(i).get_name() for i in range(controller.num_input_ports())]
    outputs = [
        controller.get_output_port(i).get_name() for i in range(controller.num_output_ports())
    ]
    assert inputs == list(LEARNING.inputs.parts)
    assert outputs == [
        "state",
        "commanded_velocity",
        *LEARNING.state.parts,
        *LEARNING.observables.parts,
        *(["next_state"] if isinstance(controller, SampledController) else []),
    ]
    assert controller.GetOutputPort("J_hat").size() == 3 * N


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_a_learning_law_is_blind_to_the_jacobian(make):
    controller = make(LEARNING)
    assert not controller.HasInputPort("J")
    assert make(LAW).HasInputPort("J")


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_command_and_state_do_not_feed_through(make):
    """So that no algebraic loop can arise, whatever the arm is."""
    controller = make(LEARNING)
    for name in ("state", "commanded_velocity", *LEARNING.state.parts):
        port = controller.GetOutputPort(name).get_index()
        for i in range(controller.num_input_ports()):
            assert not controller.HasDirectFeedthrough(i, port)


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_a_forgotten_initial_state_is_made_when_the_simulation_is_initialized(make):
    simulator, context = wire(make(LEARNING))
    controller = simulator.get_system().GetSubsystemByName("controller")
    assert np.isnan(controller.state(context)).all()
    simulator.Initialize()
    expected = LEARNING.initial_state(np.random.default_rng([0, 0]), {})
    np.testing.assert_array_equal(controller.state(context), expected)


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_a_state_that_was_set_is_kept(make):
    simulator, context = wire(make(LEARNING))
    controller = simulator.get_system().GetSubsystemByName("controller")
    x = np.arange(LEARNING.state.size, dtype=float)
    controller.set_state(context, x)
    simulator.Initialize()
    np.testing.assert_array_equal(controller.state(context), x)


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
@pytest.mark.parametrize(
    ("state", "message"),
    [
        ([0.0] * 6, r"a NumPy array of floats, shape \(6,\), not a list"),
        (np.zeros(5), r"a NumPy array of floats, shape \(6,\), not \(5,\)"),
        (np.array([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]), r"finite, not \[0\.0, nan"),
    ],
)
def test_a_state_that_is_none_cannot_be_set(make, state, message):
    """A NaN would stand for a state that is not there yet."""
    simulator, context = wire(make(LAW))
    controller = simulator.get_system().GetSubsystemByName("controller")
    with pytest.raises(InvalidInputError, match=f"^controller: the state must be {message}"):
        controller.set_state(context, state)


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_a_start_posture_that_is_not_finite_is_refused(make):
    simulator, _ = wire(make(LAW), position=[0.0, np.nan, 0.0])
    with pytest.raises(InvalidInputError, match=r"controller: position is .*nan.* start posture"):
        simulator.Initialize()


@pytest.mark.parametrize("started", [False, True])
def test_an_input_that_is_not_connected_is_named(started):
    builder = DiagramBuilder()
    controller = builder.AddNamedSystem("controller", SampledController(LAW, 1e-3))
    simulator = Simulator(builder.Build())
    if started:
        context = controller.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        controller.set_state(context, np.zeros(LAW.state.size))
    with pytest.raises(InvalidInputError, match="controller: its input port 'position' is not"):
        simulator.Initialize()


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_it_stops_when_a_part_of_the_state_is_not_finite(make):
    """Not silently, and not for ever: error control would shorten its steps without end."""
    simulator, _ = wire(make(Exploding()))
    with pytest.raises(SimulationError, match=r"controller.* other is no longer finite") as raised:
        simulator.AdvanceTo(1.0)
    # One step of the default integrator past it, at most.
    assert 0.1 <= raised.value.time <= 0.2


def test_an_input_that_is_not_finite_is_named_as_the_cause():
    simulator, _ = wire(SampledController(LAW, 1e-3), v_WE_desired=[0.0, np.nan, 0.0])
    with pytest.raises(
        SimulationError,
        match=r"multipliers is no longer finite; neither are the inputs v_WE_desired",
    ):
        simulator.AdvanceTo(0.01)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_must_be_positive(period):
    with pytest.raises(InvalidInputError, match="period: must be a positive time"):
        SampledController(LAW, period)


def test_a_law_without_derivatives_can_only_be_sampled():
    class Memoryless(SampledLaw):
        state = Layout(v=(N,))
        inputs = Layout(position=(N,))

        def step(self, t, x, u, period):
            return x

    message = (
        r"law: Memoryless is not a differential equation; use SampledController\(law, period\)"
    )
    with pytest.raises(InvalidInputError, match=message):
        ContinuousController(Memoryless())
    assert SampledController(Memoryless(), 1e-3).period == 1e-3


def test_a_law_without_a_step_can_only_be_integrated():
    class Flow(ContinuousLaw):
        state = Layout(v=(N,))
        inputs = Layout(position=(N,))

        def derivatives(self, t, x, u):
            return -x

    message = r"law: Flow cannot be sampled; use ContinuousController\(law\)"
    with pytest.raises(InvalidInputError, match=message):
        SampledController(Flow(), 1e-3)
    assert ContinuousController(Flow()).period is None


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_diagnostics_are_ports_and_what_the_law_says(make):
    simulator, context = wire(make(LAW), p_WE_desired=[0.1, 0.0, 0.0], J=np.eye(3))
    simulator.AdvanceTo(0.02)
    controller = simulator.get_system().GetSubsystemByName("controller")
    told = controller.diagnostics(context)
    for name in LAW.observables.parts:
        np.testing.assert_array_equal(controller.GetOutputPort(name).Eval(context), told[name])


@pytest.mark.parametrize("make", CONTROLLERS, ids=IDS)
def test_the_context_holds_everything(make):
    """A clone goes on as the original does, and the original is not disturbed."""
    simulator, _ = wire(make(LAW), p_WE_desired=[0.1, 0.0, 0.0], J=np.eye(3))
    simulator.AdvanceTo(0.01)
    copy = Simulator(simulator.get_system(), simulator.get_context().Clone())
    copy.AdvanceTo(0.02)
    simulator.AdvanceTo(0.02)
    controller = simulator.get_system().GetSubsystemByName("controller")
    states = [
        controller.state(controller.GetMyContextFromRoot(run.get_context()))
        for run in (simulator, copy)
    ]
    # The copy's integrator starts anew and may choose other steps.
    np.testing.assert_allclose(states[0], states[1], atol=1e-6)


class Ramping(Exploding):
    """A law whose command goes on between its samples."""

    integration_scheme = "runge_kutta2"

    def step(self, t, x, u, period):
        return x + 1.0

    def commanded_velocity(self, t, x):
        return x[:N] + t


class TestRamps:
    """Commands that change between samples."""

    def test_the_command_is_that_of_the_time_not_of_the_last_sample(self):
        """Otherwise Drake would keep what it computed when the state changed last."""
        simulator, context = wire(SampledController(Ramping(), 0.1))
        command = simulator.get_system().GetSubsystemByName("controller")
        command = command.GetOutputPort("commanded_velocity")
        simulator.AdvanceTo(0.02)
        for t in (0.02, 0.05, 0.08):
            simulator.AdvanceTo(t)
            np.testing.assert_allclose(command.Eval(context), 1.0 + t)

    def test_a_command_that_is_held_does_not_depend_on_time(self):
        controllers = SampledController(Exploding(), 0.1), SampledController(Ramping(), 0.1)
        tickets = []
        for controller in controllers:
            context = controller.CreateDefaultContext()
            controller.set_state(context, np.zeros(5))
            port = controller.GetOutputPort("commanded_velocity")
            first = port.Eval(context).copy()
            context.SetTime(3.0)
            tickets.append(np.array_equal(port.Eval(context), first))
        assert tickets == [True, False]


def test_a_law_with_a_sampled_reading_is_sampled_with_that():
    limits = JointLimits.unlimited(N).replace(acceleration=1.0)
    law = JointDriftFree(scheme="naljdf", limits=limits, home=np.zeros(N))
    controller = SampledController(law, 1e-3)
    assert controller.law is law
    assert isinstance(controller.reading, TwoStep)
    continuous = ContinuousController(law)
    assert continuous.law is continuous.reading is law
    assert controller.HasInputPort("p_preview")
    assert not controller.HasInputPort("p_WE_desired")
    assert continuous.HasInputPort("p_WE_desired")
    # The sampled reading is no differential equation, nor does the law have a step of its own.
    assert not isinstance(controller.reading, ContinuousReading)
    assert not hasattr(law, "step")


@pytest.mark.parametrize(
    "controller", [lambda law: SampledController(law, 1e-3), ContinuousController]
)
def test_what_is_no_law_is_refused(controller):
    with pytest.raises(InvalidInputError, match="law: must be of class Law, not None"):
        controller(None)
