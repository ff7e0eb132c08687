"""Arms that the law `adaptive` moves, sample by sample, with the kinematics of Drake."""

from typing import NamedTuple

import numpy as np

from drake_rnn import Adaptive, JointLimits, load_arm

PANDA = load_arm("panda").kinematics()
HOME = np.array([0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5])
N = 7
#: Those of the arm, and the velocity and acceleration of the experiments.
LIMITS = load_arm("panda").limits.replace(velocity=0.5, acceleration=1.0)
LIMITS = JointLimits(**{**LIMITS.bounds, "jerk": None, "snap": None, "crackle": None})
PERIOD = 1e-3


def adaptive(**changes):
    return Adaptive(**{"limits": LIMITS, "home": HOME, **changes})


class Motion(NamedTuple):
    """What an arm did: positions, shape (k, n), velocities and errors of the end effector [m]."""

    q: np.ndarray
    v: np.ndarray
    error: np.ndarray
    x: np.ndarray


def signals(law, q, desired, t, period):
    """What the law sees of an arm at a posture, and of what is desired at a time."""
    names = law.inputs.parts
    u = {"position": q, "p_WE": PANDA.p_WE(q)}
    u["p_WE_desired"], u["p_preview"] = desired(t), desired(t + period)
    if "R_WE" in names:
        u["R_WE"] = PANDA.R_WE(q)
        u["R_WE_desired"] = u["R_preview"] = PANDA.R_WE(HOME)
    if "J_omega" in names:
        u["J_omega"] = PANDA.J_omega(q)
    if "J" in names:
        J = PANDA.J(q)
        u["J"] = J if law.task_size == 3 else np.vstack((PANDA.J_omega(q), J))
    return u


def moved(law, desired, until, period=PERIOD, start=HOME, seed=0, late=0):
    """Return the motion of an arm; what the law sees of it is some samples late."""
    reading = law.sampled(period)
    q, v = np.array(start), np.zeros(N)
    seen = [q] * (late + 1)
    u = signals(law, q, desired, 0.0, period)
    x = reading.initial_state(np.random.default_rng(seed), u)
    rows = []
    for k in range(round(until / period)):
        t = k * period
        rows.append((q, v, np.linalg.norm(PANDA.p_WE(q) - desired(t))))
        u = signals(law, seen[0], desired, t, period)
        x = reading.step(t, x, u, period)
        v = reading.commanded_velocity(t, x)
        q = q + period * v
        seen = [*seen[1:], q]
    return Motion(*(np.array(column) for column in zip(*rows, strict=True)), x)


def excess(motion, limits, period=PERIOD):
    """Largest excess over each limit; of derivatives, as a share of it; of positions [rad]."""
    found = {"position": limits.violation(motion.q).max()}
    for order, name in enumerate(("velocity", "acceleration", "jerk")):
        if (bound := limits.bounds[name]) is not None:
            # At rest before it began.
            v = np.vstack((np.zeros((order, N)), motion.v))
            size = np.abs(np.diff(v, n=order, axis=0)) / period**order
            found[name] = (size / bound - 1.0).max()
    return found


def circle(radius=0.04, turn=4.0, centre=None):
    """A circle through the arm's start, which is at rest there for no time."""
    first = PANDA.p_WE(HOME) if centre is None else centre

    def desired(t):
        phase = 2 * np.pi * t / turn
        return first + radius * np.array([0.0, np.sin(phase), 1.0 - np.cos(phase)])

    return desired
