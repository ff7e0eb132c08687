"""The recorder sees every step and changes none."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Integrator, Sine, ZeroOrderHold

from drake_rnn import load_experiment
from drake_rnn.recorder import Recorder
from drake_rnn.simulation import simulate


def run(period=None, probe_period=0.5, duration=4.0, accuracy=1e-6):
    """Integrate a sine, sampled every 0.3 s; with a ``period``, watched by a recorder."""
    builder = DiagramBuilder()
    sine = builder.AddSystem(Sine(amplitude=1.0, frequency=2.0, phase=0.0, size=2))
    integral = builder.AddSystem(Integrator(2))
    hold = builder.AddSystem(ZeroOrderHold(0.3, 2))
    builder.Connect(sine.get_output_port(0), integral.get_input_port())
    builder.Connect(integral.get_output_port(), hold.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    root = simulator.get_mutable_context()
    probes = []

    def probe():
        probes.append(root.get_time())
        return {"time": np.array([root.get_time()])}

    recorder = Recorder(
        root,
        {"integral": integral.get_output_port(), "held": hold.get_output_port()},
        probe,
        probe_period,
    )
    if period is not None:
        simulator.set_monitor(recorder)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    return simulator, recorder, probes


def steps(simulator):
    return simulator.get_num_steps_taken(), simulator.get_num_discrete_updates()


def test_every_step_is_seen_and_the_start():
    simulator, recorder, _ = run(period=0.5)
    assert recorder.time.size == simulator.get_num_steps_taken() + 1
    assert recorder.time[0] == 0
    assert recorder.time[-1] == 4
    assert (np.diff(recorder.time) > 0).all()


def test_watching_changes_neither_steps_nor_numbers():
    """Bit for bit."""
    watched, recorder, _ = run(period=0.5)
    alone, _, _ = run()
    assert steps(watched) == steps(alone)
    end = alone.get_context().get_continuous_state_vector().CopyToVector()
    np.testing.assert_array_equal(recorder.series("integral")[-1], end)


def test_what_is_recorded_is_what_the_ports_said():
    """1e-5: the integrator's accuracy."""
    _, recorder, _ = run(period=0.5)
    expected = (1 - np.cos(2 * recorder.time)) / 2
    np.testing.assert_allclose(recorder.series("integral")[:, 1], expected, atol=1e-5)
    held = recorder.series("held")[:, 0]
    sampled = np.floor((recorder.time - 1e-9) / 0.3) * 0.3
    np.testing.assert_allclose(held, (1 - np.cos(2 * np.maximum(sampled, 0))) / 2, atol=1e-5)


def test_many_steps_are_kept():
    """More than the room made at first."""
    simulator, recorder, _ = run(period=0.5, accuracy=1e-13, duration=20.0)
    assert recorder.time.size == simulator.get_num_steps_taken() + 1 > 1024
    assert np.isfinite(recorder.series("integral")).all()


def test_the_probe_is_asked_at_the_first_step_of_each_period():
    _, recorder, probes = run(period=0.5)
    np.testing.assert_array_equal(recorder.time[recorder.probed_at], probes)
    assert [float(u["time"][0]) for u in recorder.probed] == probes
    for number in range(8):
        later = recorder.time[recorder.time >= 0.5 * number - 1e-9]
        assert later[0] in probes


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
