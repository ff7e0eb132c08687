"""`drake-rnn drive` against `drake-rnn robot`, as two processes that exchange messages."""

import os
import signal
import subprocess
import sys
import time
from collections import namedtuple
from itertools import count

import numpy as np
import pytest

from drake_rnn import Result, RobotError
from drake_rnn.drive import connected
from drake_rnn.drive.iiwa_lcm import COMMAND, STATUS, encoded_command

PORTS = count(7800 + os.getpid() % 100)
PATIENT = ("--silence", "0.4", "--late", "0.4")
Commands = namedtuple("Commands", "robot drive begin url")


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

    yield Commands(robot, drive, begin, url)
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


def published(url, channel, messages, pause=0.02):
    """Publish messages of a stranger."""
    stranger = connected(url)
    for data in messages:
        stranger.Publish(channel, data)
        time.sleep(pause)


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize("junk", [b"junk", b"", bytes(400)])
def test_junk_among_the_statuses_ends_in_a_stop(commands, tmp_path, junk):
    commands.robot()
    drive = commands.drive(tmp_path, "--duration", 20)
    running(drive)
    published(commands.url, STATUS, [junk])
    said, _ = drive.communicate(timeout=120)
    assert f"stopped by status: a message of {len(junk)} bytes on IIWA_STATUS" in said
    assert "Traceback" not in said
    assert drive.returncode == 1, said
    folder = tmp_path / "slc_nephroid_known"
    assert Result.load(folder).status == "failed"
    with np.load(folder / "cycles.npz") as cycles:
        sent = cycles["position_sent"]
    assert not (sent[-1] - sent[-2]).any()


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_simulated_robot_ignores_what_is_no_command(commands):
    robot = commands.robot()
    wrong = [encoded_command(np.zeros(count), 1.0) for count in (0, 1, 6, 8, 100)]
    wrong += [b"junk", b"", wrong[0][:-1], encoded_command(np.full(7, np.nan), 1.0)]
    told, listener = [], connected(commands.url)
    listener.Subscribe(STATUS, told.append)
    while len(told) < 5:
        assert listener.HandleSubscriptions(20_000)
    published(commands.url, COMMAND, wrong, pause=0.2)
    told.clear()
    listener.HandleSubscriptions(2000)
    assert listener.HandleSubscriptions(2000)
    robot.send_signal(signal.SIGTERM)
    said, _ = robot.communicate(timeout=60)
    assert robot.returncode == 0, said
    assert "IIWA_COMMAND: a message of 4 bytes is no lcmt_iiwa_command, and ignored" in said
    assert "commands 6 joints of 7, and is ignored" in said
    assert "commands a position that is no number, and is ignored" in said


@pytest.mark.long
@pytest.mark.timeout(300)
def test_one_robot_at_an_address_and_one_drive_of_it(commands, tmp_path):
    commands.robot()
    second = commands.begin("robot", "iiwa")
    said, _ = second.communicate(timeout=60)
    assert second.returncode == 1, said
    assert "--url: another robot tells IIWA_STATUS at" in said
    drive = commands.drive(tmp_path, "--duration", 20)
    running(drive)
    other = commands.drive(tmp_path / "other", "--duration", 20)
    said, _ = other.communicate(timeout=60)
    assert other.returncode == 1, said
    assert "robot: another program commands it" in said
    assert not (tmp_path / "other" / "slc_nephroid_known").exists()
    # A program that does not look first.
    published(commands.url, COMMAND, [encoded_command(np.zeros(7), 1.0)] * 3)
    said, _ = drive.communicate(timeout=120)
    assert "stopped by others: another program commands the robot" in said
    assert drive.returncode == 1, said
