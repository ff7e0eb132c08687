"""Follow a trajectory of Drake's, with its orientation: in a diagram and as an experiment."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePose

from drake_rnn import (
    AddLoop,
    IdealArm,
    PathSource,
    Pseudoinverse,
    SampledController,
    load_arm,
    make_experiment,
    simulate,
)

arm = load_arm("panda")
kinematics = arm.kinematics()
R_WE = RotationMatrix(kinematics.R_WE(arm.home))
p_WE = kinematics.p_WE(arm.home)
# Displacements from the start along the base's axes, and turns about the end effector's y-axis.
steps = [((0.0, 0.0, 0.0), 0.0), ((0.0, 0.1, 0.05), 0.3), ((0.05, 0.15, -0.05), -0.2)]
poses = [
    RigidTransform(R_WE @ RotationMatrix.MakeYRotation(turn), p_WE + np.array(way))
    for way, turn in steps
]
trajectory = PiecewisePose.MakeLinear([0.0, 2.0, 4.0], poses)

# In a diagram of your own: a source of its signals, in place of a path's.
PERIOD = 1e-3
law = Pseudoinverse(limits=arm.limits, task_size=6)
builder = DiagramBuilder()
source = builder.AddNamedSystem("path", PathSource(trajectory, task="pose", preview=PERIOD))
loop = AddLoop(builder, IdealArm(arm), SampledController(law, period=PERIOD), source, task="pose")
simulator = Simulator(builder.Build())
simulator.AdvanceTo(4.0)
q = loop.arm.GetOutputPort("position").Eval(loop.arm.GetMyContextFromRoot(simulator.get_context()))
print(
    "diagram: ends", abs(kinematics.p_WE(q) - poses[-1].translation()).max(), "m from the last pose"
)

# As an experiment: with the check of reach, metrics, figures and playback.
experiment = make_experiment(
    {
        "name": "own_trajectory",
        "arm": "panda",
        "task": "pose",
        "law": {"kind": "pseudoinverse"},
        "period": PERIOD,
        "duration": 4.5,
    },
    path=trajectory,
)
metrics = simulate(experiment).metrics
print("experiment: orientation within", metrics["orientation_error_max_rad"], "rad")
print("experiment: position within", metrics["position_error_max_m"], "m")
