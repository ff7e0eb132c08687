"""The arm that a robot moves: told where it is, asked what is commanded."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_rnn import ElasticSurface, InvalidInputError, PlantSettings, load_arm, simulate
from drake_rnn.experiment import load_experiment
from drake_rnn.systems import RobotArm

IIWA = load_arm("iiwa14")


def test_it_is_where_it_was_told_to_be_and_says_what_is_commanded():
    builder = DiagramBuilder()
    arm = builder.AddNamedSystem("arm", RobotArm(IIWA))
    q, v = np.arange(7.0) / 10, np.arange(7.0)
    for name, value in (("position", q), ("velocity", v)):
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), arm.GetInputPort(f"{name}_commanded"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = arm.GetMyContextFromRoot(root)
    np.testing.assert_array_equal(arm.GetOutputPort("position").Eval(context), IIWA.home)
    arm.measure(root, q + 1, v + 1)
    simulator.AdvanceTo(0.1)
    np.testing.assert_array_equal(arm.GetOutputPort("position").Eval(context), q + 1)
    np.testing.assert_array_equal(arm.GetOutputPort("velocity").Eval(context), v + 1)
    np.testing.assert_array_equal(arm.command(root), (q, v))


def test_nothing_of_it_is_simulated():
    document = {"law": {"kind": "pseudoinverse"}, "path": {"kind": "rest"}, "duration": 0.1}
    document |= {"arm": "iiwa14", "level": "robot", "period": 1e-3}
    with pytest.raises(InvalidInputError, match="level: robot is for `drake-rnn drive`"):
        simulate(load_experiment(document))
    for changes, message in (
        ({"plant": {"time_step": 1e-3}}, "plant: only at level: dynamic"),
        ({"sensing": {"position_noise": 1e-4}}, "sensing: "),
        ({"integrator": {"step": 1e-3}, "period": None}, "period: must be given at level: robot"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            load_experiment(document | changes)
    with pytest.raises(InvalidInputError, match="environment: must be left out at level: robot"):
        RobotArm.check_surface(ElasticSurface)
    with pytest.raises(InvalidInputError, match="plant: only at level: dynamic"):
        RobotArm(IIWA, settings=PlantSettings())
