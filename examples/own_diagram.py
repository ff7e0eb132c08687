"""Run a law in a diagram of your own."""

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    Circle,
    IdealArm,
    PathSource,
    SampledController,
    SimultaneousLearning,
    load_arm,
)

arm = load_arm("panda")
law = SimultaneousLearning(limits=arm.limits, home=arm.home, jacobian="known")
builder = DiagramBuilder()
path = PathSource(Circle(size=0.05, period=4.0), arm.kinematics().p_WE(arm.home))
builder.AddNamedSystem("path", path)
loop = AddLoop(builder, IdealArm(arm), SampledController(law, period=1e-3), path)
simulator = Simulator(builder.Build())
simulator.AdvanceTo(4.0)
q = loop.arm.GetOutputPort("position").Eval(loop.arm.GetMyContextFromRoot(simulator.get_context()))
print("after one lap the joints are back to", abs(q - arm.home).max(), "rad")
