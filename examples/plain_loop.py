"""Run a law in a plain loop without a Diagram: arrays in, arrays out."""

import numpy as np

from drake_rnn import SimultaneousLearning, load_arm

arm = load_arm("panda")
kinematics, q, h = arm.kinematics(), arm.home, 1e-3
law = SimultaneousLearning(limits=arm.limits, home=q, jacobian="known")
goal = kinematics.p_WE(q) + np.array([0.05, 0.0, 0.0])
seen = {"p_WE_desired": goal, "v_WE_desired": np.zeros(3)}
x = law.initial_state(np.random.default_rng(0), seen)
for k in range(3000):
    seen |= {"position": q, "p_WE": kinematics.p_WE(q), "J": kinematics.J(q)}
    x = law.step(k * h, x, seen, h)
    q = q + h * law.commanded_velocity(k * h, x)
print("distance left:", np.linalg.norm(goal - kinematics.p_WE(q)), "m")
