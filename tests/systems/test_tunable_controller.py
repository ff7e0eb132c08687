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


def pseudoinverse(**fields):
    return Pseudoinverse(limits=load_arm("panda").limits, **fields)


def simulated(controller, change=None, after=None):
    """Return the joint positions after two tenths of a second, with a change halfway.

    What comes ``after`` is called as soon as the next sample has been taken.
    """
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
    if after is not None:
        simulator.AdvancePendingEvents()
        after(root)
    simulator.AdvanceTo(0.2)
    return loop.joint_command.get_output_port().Eval(loop.joint_command.GetMyContextFromRoot(root))


def test_it_is_a_sampled_controller_until_its_law_is_replaced():
    law, stiff = pseudoinverse(feedback=10.0), pseudoinverse(feedback=40.0)
    tunable = SampledController(law, 1e-3, tunable=True)
    plain = simulated(SampledController(law, 1e-3))
    assert np.array_equal(simulated(tunable), plain)
    again = SampledController(law, 1e-3, tunable=True)

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


def test_a_controller_that_is_not_tunable_keeps_its_law():
    controller = SampledController(pseudoinverse(), 1e-3)
    controller.set_name("controller")
    told = "controller: its law cannot be replaced; give SampledController tunable: True"
    with pytest.raises(InvalidInputError, match=f"^{told}$"):
        controller.set_reading(controller.CreateDefaultContext(), controller.read(pseudoinverse()))


def test_the_next_state_is_a_port_before_the_sample_is_taken():
    """Whether or not its update reads the port: the number is that of the sample that follows."""
    for leads in (False, True):
        controller = SampledController(pseudoinverse(), 1e-3, leads=leads)
        seen = []

        def look(root, controller=controller, seen=seen):
            context = controller.GetMyContextFromRoot(root)
            # The sample at this time has not been taken yet.
            seen.append(controller.GetOutputPort("next_state").Eval(context))

        def after(root, controller=controller, seen=seen):
            seen.append(controller.state(controller.GetMyContextFromRoot(root)))

        simulated(controller, look, after)
        assert np.array_equal(*seen)


def test_a_law_with_another_state_is_refused():
    controller = SampledController(pseudoinverse(), 1e-3)
    with pytest.raises(InvalidInputError, match="state and the inputs"):
        controller.read(pseudoinverse(task_size=6))
