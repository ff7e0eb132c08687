"""Doubts about a law on a robot whose own controller judges each command, such as an FR3."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..robot.limits import JointLimits


def judged_doubts(limits: JointLimits, keeps: Collection[str], period: float | None) -> list[str]:
    """Return warnings if a robot with an envelope of the velocity may refuse a law's commands.

    Such a robot also checks the jerk of the velocities that are held, from each to the next two.

    Args:
        limits: Limits of the joints.
        keeps: Names of the limits that the command keeps.
        period: Time for which a velocity is held [s]; None if the command is not sampled.
    """
    if limits.envelope is None:
        return []
    found = []
    if "envelope" not in keeps:
        found.append(
            "limits: this law does not keep the envelope of the velocity near position limits; "
            "kind: adaptive does, and so does safety around any law"
        )
    if "jerk" in keeps or limits.jerk is None or period is None:
        return found
    # From the largest acceleration to the opposite one within a period.
    most = 0.5 * period * limits.jerk
    acceleration = np.inf if limits.acceleration is None else limits.acceleration
    if (acceleration > most).any():
        found.append(
            "limits: this law does not bound the jerk, and a robot that checks that of held "
            f"velocities refuses what accelerates by more than {most.min():.3g} rad/s^2, half of "
            "the jerk times the period; give limits.acceleration, a little less"
        )
    return found
