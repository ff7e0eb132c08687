"""`drake-rnn drive` against `drake-rnn robot`, as two processes that exchange messages."""

import os
import signal
import subprocess
import sys
from collections import namedtuple
from itertools import count

import numpy as np
import pytest

from drake_rnn import Result, RobotError
from drake_rnn.drive import connected

PORTS = count(7800 + os.getpid() % 100)
PATIENT = ("--silence", "0.4", "--late", "0.4")
Commands = namedtuple("Commands", "robot drive")


@pytest.fixture
def commands():
    url = f"udpm://239.255.76.67:{next(PORTS)}?ttl=0"
    try:
        connected(url)
    except RobotError as error:
        pytest.skip(str(error))
    started = []

    def begin(*arguments):
        line = [sys.executable, "-m", "drake_rnn", *map(str, arguments), "--url", url]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        started.append(subprocess.Popen(line, **pipes))
        return started[-1]

    def robot(*arguments):
        process = begin("robot", "iiwa", *arguments)
        assert "simulated" in process.stdout.readline()
        return process

    def drive(out, *arguments, wait=20):
        quick = ("--no-figures", "--no-playback", "--wait", wait, *PATIENT)
        return begin("drive", "slc_nephroid_known", "--out", out, *quick, *arguments)

    yield Commands(robot, drive)
    for process in started:
        process.kill()
        process.wait()


def running(drive):
    """Wait until the law commands."""
    said = []
    for line in drive.stdout:
        said.append(line)
        if line.startswith("run: "):
            return
    pytest.fail(f"it never ran: {said}")


@pytest.mark.long
@pytest.mark.timeout(300)
def test_it_runs_and_ctrl_c_brings_the_robot_to_rest(commands, tmp_path):
    commands.robot()
    drive = commands.drive(tmp_path, "--duration", 20)
    running(drive)
    drive.send_signal(signal.SIGINT)
    said, _ = drive.communicate(timeout=120)
    assert "stopped by interrupted: told to stop" in said
    assert drive.returncode == 130, said
    with np.load(tmp_path / "slc_nephroid_known" / "cycles.npz") as cycles:
        sent = cycles["position_sent"]
    assert not (sent[-1] - sent[-2]).any()
    assert Result.load(tmp_path / "slc_nephroid_known").status == "interrupted"


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_robot_that_is_killed_ends_the_run(commands, tmp_path):
    robot = commands.robot()
    drive = commands.drive(tmp_path, "--duration", 20)
    running(drive)
    robot.kill()
    said, _ = drive.communicate(timeout=120)
    assert "stopped by silence: no status for" in said
    assert drive.returncode == 1, said
    result = Result.load(tmp_path / "slc_nephroid_known")
    assert result.status == "failed"
    assert "silence" in result.failure
    # Nobody answers any more.
    drive = commands.drive(tmp_path / "again", wait=1)
    said, _ = drive.communicate(timeout=120)
    assert drive.returncode == 1, said
    assert "no status within 1 s" in said
