import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    Circle,
    IdealArm,
    InvalidInputError,
    PathSource,
    Pseudoinverse,
    SampledController,
    load_arm,
)
from drake_rnn.systems import TunableController


def pseudoinverse(**fields):
    return Pseudoinverse(limits=load_arm("panda").limits, **fields)


def simulated(controller, change=None):
    """Return the joint positions after two tenths of a second, with a change halfway."""
    arm = load_arm("panda")
    builder = DiagramBuilder()
    start = arm.kinematics().p_WE(arm.home)
    source = PathSource(Circle(size=0.05, period=2.0), start + 0.01, preview=1e-3)
    path = builder.AddNamedSystem("path", source)
    loop = AddLoop(builder, IdealArm(arm), controller, path)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.1)
    root = simulator.get_mutable_context()
    if change is not None:
        change(root)
    simulator.AdvanceTo(0.2)
    return loop.joint_command.get_output_port().Eval(loop.joint_command.GetMyContextFromRoot(root))


def test_it_is_a_sampled_controller_until_its_law_is_replaced():
    law, stiff = pseudoinverse(feedback=10.0), pseudoinverse(feedback=40.0)
    tunable = TunableController(law, 1e-3)
    plain = simulated(SampledController(law, 1e-3))
    assert np.array_equal(simulated(tunable), plain)
    again = TunableController(law, 1e-3)

    def change(root):
        context = again.GetMyMutableContextFromRoot(root)
        copied = again.GetMyContextFromRoot(root.Clone())
        again.set_reading(context, again.read(stiff))
        assert again.reading_in(context) is not again.reading
        # A copy of the context that was made before is not changed.
        assert again.reading_in(copied) is again.reading

    changed = simulated(again, change)
    assert not np.array_equal(changed, plain)
    assert not np.array_equal(changed, simulated(SampledController(stiff, 1e-3)))


def test_a_law_with_another_state_is_refused():
    controller = TunableController(pseudoinverse(), 1e-3)
    with pytest.raises(InvalidInputError, match="state and the inputs"):
        controller.read(pseudoinverse(task_size=6))
