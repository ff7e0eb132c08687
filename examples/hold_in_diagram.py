"""Move to another posture while the end effector's pose is held, in a diagram of your own."""

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    IdealArm,
    NullSpaceAdjustment,
    PathSource,
    Rest,
    SampledController,
    SelfMotion,
    load_arm,
)

arm = load_arm("iiwa14")
kinematics, start = arm.kinematics(), arm.home
target = SelfMotion(arm, start, "pose").somewhere(0.5)
law = NullSpaceAdjustment(target=target, limits=arm.limits, task_size=6)
builder = DiagramBuilder()
place = PathSource(Rest(), kinematics.p_WE(start), "pose", kinematics.R_WE(start))
builder.AddNamedSystem("place", place)
controller = SampledController(law, period=1e-3)
loop = AddLoop(builder, IdealArm(arm, start), controller, place, task="pose")
simulator = Simulator(builder.Build())
simulator.AdvanceTo(4.0)
q = loop.arm.GetOutputPort("position").Eval(loop.arm.GetMyContextFromRoot(simulator.get_context()))
print("joints off by", abs(q - target).max(), "rad")
print("the end effector is off by", abs(kinematics.p_WE(q) - kinematics.p_WE(start)).max(), "m")
