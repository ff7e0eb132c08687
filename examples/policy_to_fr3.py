"""A policy's chunks, 10 a second, become commands of an FR3, 1000 a second; see docs/fr3_policy.md.

python examples/policy_to_fr3.py ADDRESS
"""

import os
import sys
import time
from contextlib import suppress
from multiprocessing import get_context

import numpy as np

from drake_rnn import CommandReader, RobotError, Shield, ShieldSettings, load_arm
from drake_rnn.drive.lost_cycles import LostCycles

H, BEHIND = 1e-3, 0.01  # cycle of the robot; its commands are taken so much later [s]
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
    reader, follower = CommandReader(pipe.recv()), LostCycles(robot.look().held)
    robot.begin()
    state = last = robot.read()
    t, rate = time.monotonic() - BEHIND, 1.0
    q, cycles, error, reason, is_last = np.array(state.held), 0, 0.0, None, False
    try:
        while not is_last:
            passed = max(round((state.time - last.time) / H), 1)
            # The robot's clock is not this one: its cycles get a little longer or shorter here.
            lag = time.monotonic() - BEHIND - (t + passed * H)
            rate += np.clip(np.clip(1 + 5 * lag, 0.8, 1.25) - rate, -2e-4, 2e-4)
            times = t + rate * H * np.arange(1, passed + 1)
            t = times[-1]
            while time.monotonic() < t:  # states come faster than its clock goes
                time.sleep(1e-4)
            try:
                commands = [reader.position_at(each) for each in times]
                command = reader.at(t)
            except RobotError as exception:  # come to rest along the last stop
                reader, reason = command, f"the robot is {lag:.1f} s behind; {exception}"
                commands = [command.position_at(each) for each in times]
            before, q = q, follower.answer(commands, state.held)
            is_at_rest = passed == 1 and np.abs(q - before).max() < 1e-9
            is_last = is_at_rest and bool(reason or pipe.poll())
            q = before if is_last else q  # what is left of lost cycles moves no joint at the end
            robot.answer(q.tolist(), is_last)
            cycles, error = cycles + 1, max(error, np.abs(state.q - before).max())
            last, state = state, state if is_last else robot.read()
    except Exception as exception:  # a reflex of the robot, or an end of the shield's process
        reason = str(exception)
    pipe.send((reason, error, cycles, follower.lost))


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
