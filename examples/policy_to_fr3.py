"""A policy's chunks, 10 a second, become commands of an FR3, 1000 a second; see docs/fr3_policy.md.

python examples/policy_to_fr3.py ADDRESS
"""

import os
import sys
import time
from contextlib import suppress
from multiprocessing import get_context

import numpy as np

from drake_rnn import CommandReader, Shield, ShieldSettings, load_arm

NOISE = np.random.default_rng(0)


def policy(q, t):
    """Return 16 postures, 20 a second from a time on: a swing of 0.3 rad in 3 s, with noise."""
    ahead = t + np.arange(16)[:, np.newaxis] / 20
    return q + 0.15 * (1 - np.cos(2 * ahead)) + NOISE.normal(0, 1e-3, (16, 7))


def drive(pipe, make_robot, address):
    """Answer each cycle of a robot by what the shield commands then, in a process of its own."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    robot = make_robot(address)
    pipe.send(list(robot.look().held))
    while not pipe.poll():  # until the shield is ready
        robot.look()
    reader = CommandReader(pipe.recv())
    robot.begin()
    cycles, first, error, reason, is_last = 0, None, 0.0, None, False
    try:
        while not is_last:
            state = robot.read()
            if first is None:  # commands are taken 2 ms late
                first, ahead, q = state, time.monotonic() - state.time - 2e-3, list(state.held)
            cycles += 1
            error = max(error, *np.abs(np.subtract(state.q, q)))
            t = state.time + ahead
            ahead -= 1e-6 * (t > time.monotonic() - 1e-3)  # where the robot's clock is faster
            command = reader.position_at(t).tolist()
            rests = np.abs(np.subtract(command, q)).max() < 1e-9
            is_last = rests and pipe.poll()
            q = q if rests else command
            robot.answer(q, is_last)
    except Exception as exception:  # a reflex of the robot, or a clock that is too slow
        reason = str(exception)
    pipe.send((reason, error, cycles, round(1e3 * (state.time - first.time)) + 1 - cycles))


def main(make_robot, address, seconds=5.0):
    """Have a robot follow the policy, and print what came of it; return 1 if it ended early."""
    pipe, end = get_context("spawn").Pipe()
    get_context("spawn").Process(target=drive, args=(end, make_robot, address), daemon=True).start()
    end.close()
    q, arm = np.array(pipe.recv()), load_arm("fr3")
    limits = arm.limits.replace(velocity=1.0, acceleration=3.0, jerk=50.0)
    settings = ShieldSettings(compiled=True)  # the first time a compiler takes a minute
    with Shield(arm, 1e-3, start=q, limits=limits, settings=settings, process=True) as shield:
        pipe.send(shield.path)
        begin = time.monotonic()
        while (t := time.monotonic() - begin) < seconds and not pipe.poll(0.1):
            chunk = shield.follow_positions(policy(q, t), rate=20, start=begin + t)
        while shield.status.arrived < chunk and not pipe.poll(0.01):
            continue
        if not pipe.poll():
            pipe.send("the policy has ended")
        reason, error, cycles, lost = pipe.recv()
        print(f"ended by: {reason or 'its end, no reflex'}")
        print(f"cycles: {cycles}, of which the robot lost {lost}")
        print(f"late samples: {shield.late_samples} of {shield.latest().number}")
        print(f"largest error of a joint: {error:.4f} rad")
    return int(reason is not None)


if __name__ == "__main__":
    from drake_rnn.drive.franka import Franka

    sys.exit(main(Franka, sys.argv[1]))
