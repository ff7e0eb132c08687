"""`drake-rnn drive` against `drake-rnn robot`, as two processes that exchange messages."""

import os
import signal
import subprocess
import sys
import threading
from collections import namedtuple
from contextlib import contextmanager
from itertools import count, cycle

import numpy as np
import pytest
from typer.testing import CliRunner

from drake_rnn import Result, RobotError
from drake_rnn.cli.commands import app
from drake_rnn.drive import open_lcm
from drake_rnn.drive.iiwa_lcm import COMMAND, STATUS, encoded_command
from process_helpers import PATIENCE

PORTS = count(7800 + os.getpid() % 100)
Commands = namedtuple("Commands", "robot drive refused url")
# Pauses of a busy machine stop no robot.
PATIENT = ("--silence", 60, "--late", 60)
DRIVE = ("drive", "slc_nephroid_known", "--no-figures", "--no-playback")


@pytest.fixture
def commands():
    url = f"udpm://239.255.76.67:{next(PORTS)}?ttl=0"
    try:
        open_lcm(url)
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

    def drive(out, watches=PATIENT):
        line = (*DRIVE, "--duration", 600, "--wait", PATIENCE, *watches)
        return begin(*line, "--out", out)

    def refused(*arguments):
        """Call a command that never begins; in a process of its own it would import all anew."""
        ended = CliRunner().invoke(app, [*map(str, arguments), "--url", url])
        assert ended.exit_code == 1, ended.output
        return ended.output

    yield Commands(robot, drive, refused, url)
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
def test_it_runs_and_ctrl_c_brings_the_robot_to_rest(commands, tmp_path):
    commands.robot()
    drive = commands.drive(tmp_path)
    running(drive)
    drive.send_signal(signal.SIGINT)
    said, _ = drive.communicate(timeout=PATIENCE)
    assert "stopped by interrupted: told to stop" in said
    assert drive.returncode == 130, said
    with np.load(tmp_path / "slc_nephroid_known" / "cycles.npz") as cycles:
        sent = cycles["position_sent"]
    assert not (sent[-1] - sent[-2]).any()
    assert Result.load(tmp_path / "slc_nephroid_known").status == "interrupted"


@pytest.mark.long
def test_a_robot_that_is_killed_ends_the_run(commands, tmp_path):
    robot = commands.robot()
    drive = commands.drive(tmp_path, ("--silence", 1, "--late", 60))
    running(drive)
    robot.kill()
    said, _ = drive.communicate(timeout=PATIENCE)
    assert "stopped by silence: no status for" in said
    assert drive.returncode == 1, said
    result = Result.load(tmp_path / "slc_nephroid_known")
    assert result.status == "failed"
    assert "silence" in result.failure
    # Nobody answers any more.
    said = commands.refused(*DRIVE, "--wait", 1, "--out", tmp_path / "again")
    assert "no status within 1 s" in said


@contextmanager
def publishing(url, channel, messages, pause=0.05):
    """Publish messages of a stranger, again and again."""
    stranger, ended = open_lcm(url), threading.Event()

    def publish():
        for data in cycle(messages):
            stranger.Publish(channel, data)
            if ended.wait(pause):
                return

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.long
@pytest.mark.parametrize(
    # Of each kind within one process in test_malformed_statuses.py.
    "junk",
    [b"junk", *(pytest.param(junk, marks=pytest.mark.nightly) for junk in (b"", bytes(400)))],
)
def test_junk_among_the_statuses_ends_in_a_stop(commands, tmp_path, junk):
    commands.robot()
    drive = commands.drive(tmp_path)
    running(drive)
    with publishing(commands.url, STATUS, [junk]):
        said, _ = drive.communicate(timeout=PATIENCE)
    assert f"stopped by status: a message of {len(junk)} bytes on IIWA_STATUS" in said
    assert "Traceback" not in said
    assert drive.returncode == 1, said
    folder = tmp_path / "slc_nephroid_known"
    assert Result.load(folder).status == "failed"
    with np.load(folder / "cycles.npz") as cycles:
        sent = cycles["position_sent"]
    assert not (sent[-1] - sent[-2]).any()


@pytest.mark.long
def test_a_simulated_robot_ignores_what_is_no_command(commands):
    robot = commands.robot()
    wrong = [encoded_command(np.zeros(count), 1.0) for count in (0, 1, 6, 8, 100)]
    wrong += [b"junk", b"", wrong[0][:-1], encoded_command(np.full(7, np.nan), 1.0)]
    expected = {
        "bytes is no lcmt_iiwa_command, and ignored",
        "commands 6 joints of 7, and is ignored",
        "commands a position that is no number, and is ignored",
    }
    # A robot that is busy passes over some, so they come again.
    said = []
    with publishing(commands.url, COMMAND, wrong):
        while missing := {each for each in expected if not any(each in line for line in said)}:
            said.append(robot.stdout.readline())
            assert said[-1], f"it ended, and never said {missing}: {said}"
    told, listener = [], open_lcm(commands.url)
    listener.Subscribe(STATUS, told.append)
    while len(told) < 5:
        assert listener.HandleSubscriptions(int(1e3 * PATIENCE))
    robot.send_signal(signal.SIGTERM)
    said, _ = robot.communicate(timeout=PATIENCE)
    assert robot.returncode == 0, said


@pytest.mark.long
def test_one_robot_at_an_address_and_one_drive_of_it(commands, tmp_path):
    commands.robot()
    said = commands.refused("robot", "iiwa")
    assert "--url: another robot tells IIWA_STATUS at" in said
    drive = commands.drive(tmp_path)
    running(drive)
    said = commands.refused(*DRIVE, *PATIENT, "--wait", PATIENCE, "--out", tmp_path / "other")
    assert "robot: another program commands it" in said
    assert not (tmp_path / "other" / "slc_nephroid_known").exists()
    # A program that does not look first.
    with publishing(commands.url, COMMAND, [encoded_command(np.zeros(7), 1.0)]):
        said, _ = drive.communicate(timeout=PATIENCE)
    assert "stopped by others: another program commands the robot" in said
    assert drive.returncode == 1, said
