"""Judge packets to a Franka FR3 as franka-sim does, those that come late included.

It is run by an environment that has franka-sim, and reads packets from the standard input, as JSON.
`fr3_lost_cycles.py` calls it by `judged_by`.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple


class Packet(NamedTuple):
    """A state that the robot has sent, or a command that has come.

    Attributes:
        number: Number of the state, or of the one that the command answers.
        position: What is commanded, 7 [rad]; None for a state.
    """

    number: int
    position: list[float] | None


def judged_by(python: str, motions: Sequence[Sequence[Packet]]) -> list[str]:
    """Return the first objection to each motion, or "", by a Python that has franka-sim."""
    done = subprocess.run(
        [python, __file__], input=json.dumps(motions), capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"--judge: {python} could not judge: {done.stderr.strip()[-400:]}")
    found: list[str] = json.loads(done.stdout)
    return found


def _judged(packets: Sequence[Any]) -> str:
    """Return the first objection to packets, in the order of franka-sim's own server, or ""."""
    from franka_sim.control_modes import ControlMode
    from franka_sim.motion_limits import MotionLimitChecker

    checker, still = MotionLimitChecker(enforce=True), [0.0] * 7
    published, answered, q = 0, True, None
    for number, position in packets:
        if position is None:
            if not answered and q is not None and (guess := checker.extrapolate(published)):
                command, violation = guess
                if violation is not None:
                    return f"held: {violation.describe()}"
                q = command["q_c"]
            published, answered = number, False
            checker.note_published(number)
            continue
        if q is None:
            q = position
            state = {"q": q, "q_d": q, "dq_d": still, "ddq_d": still, "tau_J_d": still}
            checker.start_motion(ControlMode.POSITION, state)
        fresh = number == published
        answered = answered or fresh
        message = {"message_id": number, "q_c": position, "motion_generation_finished": False}
        taken = checker.absorb_command(message, q, fresh=fresh, enforce=True)
        if taken.violation is not None:
            return str(taken.violation.describe())
        q = position
    return ""


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    json.dump([_judged(packets) for packets in json.load(sys.stdin)], sys.stdout)
