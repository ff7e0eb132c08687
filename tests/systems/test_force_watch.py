"""What stops a run whose force sensor is stuck."""

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem

from drake_rnn import SimulationError
from drake_rnn.features.contact import ForceWatch


class Said(LeafSystem):
    """A number as a function of time."""

    def __init__(self, said):
        super().__init__()
        self.DeclareVectorOutputPort(
            "said",
            BasicVector(1),
            lambda context, output: output.set_value([said(context.get_time())]),
        )


def watch(force, until=0.5, position=lambda t: t, **settings):
    """Look at a force every 1 ms, on an arm of one joint that moves unless told otherwise."""
    builder = DiagramBuilder()
    watched = builder.AddNamedSystem("watch", ForceWatch(1, 1e-3, **settings))
    for name, said in (("normal_force", force), ("position", position)):
        source = builder.AddSystem(Said(said))
        builder.Connect(source.get_output_port(), watched.GetInputPort(name))
    # Named, so that it lives as long as a traceback does, whose frames refer to its context.
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(until)


def test_a_force_that_is_stuck_stops_the_run_after_its_patience():
    """It sticks at 0.2 s; a sample later than 50 ms after that."""
    message = r"stuck at 1\.2 N since t = 0\.2 s"
    with pytest.raises(SimulationError, match=message) as caught:
        watch(lambda t: 1.0 + min(t, 0.2), patience=0.05)
    assert caught.value.time == pytest.approx(0.251, abs=1.5e-3)


def test_zero_force_is_no_sensor_that_is_stuck():
    """Nor is one that sticks there noticed: without contact, it would say the same."""
    watch(lambda t: 0.0)


def test_a_force_that_moves_by_its_last_bit_is_alive():
    watch(lambda t: 1.0 + 1e-15 * (round(t * 1e3) % 2))


def test_a_force_that_rests_for_less_than_the_patience_is_alive():
    watch(lambda t: 1.0 + t // 0.05, patience=0.06)


def test_the_force_on_an_arm_at_rest_may_rest_too():
    watch(lambda t: 1.2, position=lambda t: 0.5)
    with pytest.raises(SimulationError, match="stuck"):
        watch(lambda t: 1.2, position=lambda t: 0.5 + 1e-7 * t)
