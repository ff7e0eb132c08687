"""The recorder sees every step and changes none."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Integrator, Sine, ZeroOrderHold

from drake_rnn import load_experiment, simulate
from drake_rnn.measures import Recorder


def run(watched=True, duration=4.0, accuracy=1e-6):
    """Integrate a sine, sampled every 0.3 s; watched by a recorder or not."""
    builder = DiagramBuilder()
    sine = builder.AddSystem(Sine(amplitude=1.0, frequency=2.0, phase=0.0, size=2))
    integral = builder.AddSystem(Integrator(2))
    hold = builder.AddSystem(ZeroOrderHold(0.3, 2))
    builder.Connect(sine.get_output_port(0), integral.get_input_port())
    builder.Connect(integral.get_output_port(), hold.get_input_port())
    ports = {"integral": integral.get_output_port(), "held": hold.get_output_port()}
    recorder = Recorder(builder, ports) if watched else None
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    if recorder is not None:
        recorder.watch(simulator)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    return simulator, recorder


def steps(simulator):
    return simulator.get_num_steps_taken(), simulator.get_num_discrete_updates()


def test_every_step_is_seen_and_the_start():
    simulator, recorder = run()
    assert recorder.steps.time.size == simulator.get_num_steps_taken() + 1
    assert recorder.steps.time[0] == 0
    assert recorder.steps.time[-1] == 4
    assert (np.diff(recorder.steps.time) > 0).all()


def test_watching_changes_neither_steps_nor_numbers():
    """Bit for bit."""
    watched, recorder = run()
    alone, _ = run(watched=False)
    assert steps(watched) == steps(alone)
    end = alone.get_context().get_continuous_state_vector().CopyToVector()
    np.testing.assert_array_equal(recorder.steps.series("integral")[-1], end)


def test_what_is_recorded_is_what_the_ports_said():
    """1e-5: the integrator's accuracy."""
    _, recorder = run()
    expected = (1 - np.cos(2 * recorder.steps.time)) / 2
    np.testing.assert_allclose(recorder.steps.series("integral")[:, 1], expected, atol=1e-5)
    held = recorder.steps.series("held")[:, 0]
    sampled = np.floor((recorder.steps.time - 1e-9) / 0.3) * 0.3
    np.testing.assert_allclose(held, (1 - np.cos(2 * np.maximum(sampled, 0))) / 2, atol=1e-5)


@pytest.mark.long
def test_many_steps_are_kept():
    """More than the room made at first."""
    simulator, recorder = run(accuracy=1e-13, duration=20.0)
    assert recorder.steps.time.size == simulator.get_num_steps_taken() + 1 > 1024
    assert np.isfinite(recorder.steps.series("integral")).all()


class Failing(LeafSystem):
    """A source that has no value any more after a while."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorOutputPort("y", 1, self._calc, {self.time_ticket()})

    def _calc(self, context, output):
        if context.get_time() > 0.25:
            raise ValueError("broken")
        output.set_value([context.get_time()])


def test_steps_before_one_that_cannot_be_recorded_are_kept_whole():
    """The port before the one that fails has been logged once more by then."""
    builder = DiagramBuilder()
    hold = builder.AddSystem(ZeroOrderHold(0.1, 1))
    failing = builder.AddSystem(Failing())
    builder.ExportInput(hold.get_input_port())
    ports = {"held": hold.get_output_port(), "failing": failing.get_output_port()}
    recorder = Recorder(builder, ports)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    diagram.get_input_port().FixValue(simulator.get_mutable_context(), [1.0])
    recorder.watch(simulator)
    with pytest.raises(ValueError, match="broken"):
        simulator.AdvanceTo(1.0)
    steps = recorder.steps
    np.testing.assert_allclose(steps.time, [0.0, 0.1, 0.2], atol=1e-12)
    np.testing.assert_array_equal(steps.series("held")[:, 0], [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(steps.series("failing")[:, 0], steps.time)


def test_metrics_do_not_depend_on_what_is_stored():
    """Every metric, with a stored sample a step and one in a hundred."""
    every, few = (
        simulate(load_experiment("slc_nephroid_known", {"duration": 0.5, "log_period": log}))
        for log in (1e-3, 0.1)
    )
    assert every.time.size > 50 * few.time.size
    for name in every.metrics:
        assert every.metrics[name] == few.metrics[name], name


@pytest.mark.parametrize("period", [1e-3, 5e-4])
def test_a_sampled_run_is_seen_at_every_sample(period):
    """Speed is largest at one sample of many: a thinned log would miss it."""
    experiment = load_experiment(
        "slc_nephroid_known", {"duration": 0.05, "period": period, "log_period": 0.01}
    )
    result = simulate(experiment)
    assert result.time.size == 6
    peak = result.series["acceleration_peak"].max()
    assert peak == result.metrics["joint_acceleration_max_rad_s2"]
