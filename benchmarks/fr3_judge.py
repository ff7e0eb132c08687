"""Judge commands for a Franka FR3 as franka-sim does; run by an environment that has it.

franka-sim pins its own NumPy, so `fr3_conformance.py` writes commands to a file and has this script
read them with another Python, which needs nothing of drake_rnn::

    /path/to/venv/bin/python benchmarks/fr3_judge.py commands.npz

The file has, of m motions of k samples, ``start``, shape (m, 7) [rad], and ``velocity``, shape
(m, k, 7) [rad/s]. Printed is, as JSON, of each motion how many commands were objected to as
velocities and as positions, and the first objection of each. A command that is objected to is
counted and, as without enforcement, applied. Each motion begins with standstill, as a client must:
the checker takes the first command for it, and differentiates from the second on.
"""

from __future__ import annotations

import json
import logging
import sys
from typing import Any

import numpy as np
from franka_sim.control_modes import ControlMode
from franka_sim.motion_limits import MotionLimitChecker

PERIOD = 1e-3
STILL = [0.0] * 7
#: Commands of standstill before each motion.
WAITED = 20


def judged(mode: ControlMode, start: Any, commands: Any, positions: Any) -> tuple[int, str]:
    """Return how many commands are objected to, and the first objection in words.

    Args:
        mode: What the commands are.
        start: Joint positions at the start, at rest, shape (7,) [rad].
        commands: The commands, shape (k, 7) [rad or rad/s].
        positions: Measured joint positions at which each arrives, shape (k, 7) [rad].
    """
    checker = MotionLimitChecker()
    state = {"q": start.tolist(), "q_d": start.tolist(), "dq_d": STILL, "ddq_d": STILL}
    checker.start_motion(mode, {**state, "tau_J_d": STILL})
    key = "q_c" if mode is ControlMode.POSITION else "dq_c"
    count, first = 0, ""
    for k, (command, q) in enumerate(zip(commands.tolist(), positions.tolist(), strict=True), 1):
        message = {"message_id": k, key: command, "motion_generation_finished": False}
        checker.note_published(k)
        violation = checker.check(message, q)
        if violation is not None:
            count += 1
            first = first or f"at {k} ms: {violation.describe()}"
        checker.record(message, clean=violation is None)
    return count, first


def main() -> None:
    logging.disable(logging.CRITICAL)
    file = np.load(sys.argv[1])
    found = []
    for start, velocity in zip(file["start"], file["velocity"], strict=True):
        velocity = np.vstack((np.zeros((WAITED, 7)), velocity))
        moved = start + PERIOD * np.cumsum(velocity, axis=0)
        before = np.vstack((start, moved[:-1]))
        as_velocity = judged(ControlMode.VELOCITY, start, velocity, before)
        as_position = judged(ControlMode.POSITION, start, moved, before)
        found.append({"velocity": as_velocity, "position": as_position})
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
