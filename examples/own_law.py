"""A law of one's own: the damped pseudoinverse, what one would do without a network.

What it asks for under ``inputs`` is what the diagram wires to it, by name.
"""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import Layout, PathSource, SampledController, load_arm
from drake_rnn.diagrams.kinematic import AddKinematicLoop
from drake_rnn.paths import Nephroid


class DampedPseudoinverse:
    """Joint velocities J^T (J J^T + damping^2 I)^-1 (v_d + kappa (p_d - p))."""

    state = Layout(v=(7,))
    inputs = Layout(p_WE=(3,), J=(3, 7), p_WE_desired=(3,), v_WE_desired=(3,))
    observables = Layout()
    holds_command = True

    def __init__(self, kappa: float, damping: float) -> None:
        self.kappa = kappa
        self.damping = damping

    def initial_state(self, rng, u):
        return np.zeros(7)

    def step(self, t, x, u, period):
        J = u["J"]
        asked = u["v_WE_desired"] + self.kappa * (u["p_WE_desired"] - u["p_WE"])
        return J.T @ np.linalg.solve(J @ J.T + self.damping**2 * np.eye(3), asked)

    def commanded_velocity(self, t, x):
        return x

    def diagnostics(self, t, x, u):
        return {}


arm = load_arm("panda")
builder = DiagramBuilder()
nephroid = Nephroid(plane="yz", size=0.04, period=8.0)
path = builder.AddNamedSystem("path", PathSource(nephroid, arm.kinematics().p_WE(arm.home)))
controller = SampledController(DampedPseudoinverse(kappa=4.0, damping=1e-3), period=1e-3)
loop = AddKinematicLoop(builder, arm, controller, path)
simulator = Simulator(builder.Build())
kinematics_context = loop.kinematics.GetMyContextFromRoot(simulator.get_context())
path_context = path.GetMyContextFromRoot(simulator.get_context())
worst = 0.0
for t in np.linspace(0.01, 8.0, 800):
    simulator.AdvanceTo(t)
    p_WE = loop.kinematics.GetOutputPort("p_WE").Eval(kinematics_context)
    desired = path.GetOutputPort("p_WE_desired").Eval(path_context)
    worst = max(worst, float(np.linalg.norm(p_WE - desired)))
print("largest position error:", worst, "m")
