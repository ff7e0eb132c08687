"""A guard in a process of its own: whatever becomes of the source, the arm keeps its bounds."""

import multiprocessing
import os
import signal
import subprocess
import sys
import warnings
from functools import partial

import numpy as np
import pytest

from drake_rnn import Guard, InvalidInputError, JointLimits, JointStream, RobotError
from drake_rnn.drive.shared_cycles import HEADER, MOVING, SharedMemory, anonymous_file
from process_helpers import PATIENCE, wait_for

LONG = pytest.mark.long
PERIOD, HOME = 2e-3, np.array([0.2, 0.5])
LIMITS = JointLimits(
    position_lower=[-3.0, -1.5],
    position_upper=[3.0, 1.5],
    velocity=[1.0, 0.8],
    acceleration=[4.0, 3.0],
    jerk=[80.0, 60.0],
)
LAW = JointStream(limits=LIMITS, home=HOME, timeout=0.1)
FAR = HOME + np.array([2.0, 0.9])


def record(file, command):
    """Write a command into a file: its time, positions and velocities."""
    with open(file, "ab") as stream:
        stream.write(np.array([command.time, *command.position, *command.velocity]).tobytes())


def fail_in_motion(command):
    if command.velocity.any():
        raise ConnectionError("the robot is gone")


def recorded(file):
    return np.fromfile(file).reshape(-1, 5)


def assert_within_bounds(rows):
    """Each command goes on from the one before, or from rest after a call that came too late."""
    time, q, v = rows[:, 0], rows[:, 1:3], rows[:, 3:]
    assert not LIMITS.violation(q).any()
    np.testing.assert_allclose(np.diff(q, axis=0), PERIOD * v[1:], atol=1e-12)
    # Whatever is late, by the guard's rule, is on time or begins anew.
    late = np.diff(time) > PERIOD * 1.5
    before = np.where(late[:, None], 0.0, v[:-1])
    assert (np.abs(v) <= LIMITS.velocity * (1.0 + 1e-9)).all()
    change = np.abs(v[1:] - before)
    assert (change <= PERIOD * LIMITS.acceleration * (1.0 + 1e-9)).all()
    if not late.any():
        jerk = np.abs(np.diff(np.vstack((np.zeros((2, 2)), v)), n=2, axis=0)) / PERIOD**2
        assert (jerk <= LIMITS.jerk * (1.0 + 1e-9)).all()


def rests(guard):
    return not np.abs(guard.latest().velocity).max() > 1e-12


def test_commands_go_on_while_the_source_stalls_and_sends_no_targets(tmp_path):
    with Guard(LAW, PERIOD, process=partial(record, tmp_path / "commands")) as guard:
        before = guard.latest().number
        # The source stalls: commands go on, and the arm stays where it is.
        assert wait_for(lambda: guard.latest().number > before + 20)
        assert np.array_equal(guard.position, HOME)

        def moves():
            guard.target(FAR)
            return np.abs(guard.velocity).max() > 0.05

        assert wait_for(moves)
        # It sends what is none, much faster than the guard looks.
        for _ in range(200):
            guard.target([np.nan, 0.3])
            with pytest.raises(InvalidInputError, match=r"^target: must be 2 numbers, one per"):
                guard.target(np.zeros(3))
        assert wait_for(lambda: rests(guard))
        command = guard.latest()
        assert command.target_age > LAW.timeout
        assert np.array_equal(guard.position, command.position)
        assert guard.part("missed").item() > 50.0
        assert wait_for(moves)
        # It is closed in motion, and ends at rest.
    assert rests(guard)
    rows = recorded(tmp_path / "commands")
    assert np.array_equal(rows[-1, 1:3], guard.position)
    assert_within_bounds(rows)
    assert not multiprocessing.active_children()
    guard.close()
    with pytest.raises(RobotError, match=r"^guard: it has been closed, and takes no target"):
        guard.target(HOME)


def test_what_fails_in_the_process_is_told_by_name():
    # It moves only once it has a target: a failure as it starts is told where it is made.
    guard = Guard(LAW, PERIOD, process=fail_in_motion)
    said = r"^guard: its process has failed with ConnectionError: the robot is gone \(test_guard_"

    def ended():
        try:
            guard.latest()
        except RobotError as error:
            told.append(str(error))
        return told

    told = []
    guard.target(FAR)
    assert wait_for(ended)
    with pytest.raises(RobotError, match=said):
        guard.target(HOME)
    guard.close()
    assert not multiprocessing.active_children()


def test_what_cannot_be_is_refused_before_a_process_is_started():
    def local(command):
        """It cannot be found by its name."""

    for wrong, why in (
        ({"process": "yes"}, "process: must be True, False or a function, not 'yes'"),
        ({"process": local}, "process: cannot be sent to the guard's process: Can't "),
        ({"process": True, "t": 0.0}, "t: must be left out with process, which has a clock"),
        ({"process": True, "start": [9.0, 0.0]}, "start: joint 1 is at 9 rad; it may be"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            Guard(LAW, PERIOD, **wrong)
        assert str(refused.value).startswith(why)
    guard = Guard(LAW, PERIOD)
    for call in (lambda: guard.target(HOME), guard.latest):
        with pytest.raises(InvalidInputError, match="is for a guard that was made with process=T"):
            call()
    guard.close()
    assert not multiprocessing.active_children()


WRITES = """
from drake_rnn.drive.shared_cycles import HEADER, MOVING, SharedMemory
memory = SharedMemory({file}, HEADER)
for number in range({count}):
    memory.doing = MOVING
    memory.count = number + 1
"""


def test_what_is_written_again_is_never_read_as_zero_or_in_part():
    """As it is thousands of times a second, by a process that another one looks at."""
    file, count = anonymous_file(HEADER), 200_000
    memory = SharedMemory(file, HEADER)
    memory.doing = MOVING
    code = WRITES.format(file=file, count=count)
    with subprocess.Popen([sys.executable, "-c", code], pass_fds=(file,)) as process:
        before = 0
        while process.poll() is None:
            assert memory.doing == MOVING
            now = memory.count
            assert before <= now <= count
            before = now
    assert (process.returncode, memory.count) == (0, count)
    os.close(file)


SCRIPT = """
import os, signal, time
from functools import partial
import numpy as np
from test_guard_process import FAR, LAW, PERIOD, record
from drake_rnn import Guard

def run():
    guard = Guard(LAW, PERIOD, process=partial(record, {file!r}))
    while np.abs(guard.velocity).max() < 0.1:
        guard.target(FAR)
    print("moves", flush=True)
    end = {end!r}
    if end == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if end == "stalls":
        time.sleep(3600.0)
    if end == "raises":
        raise ValueError("a source of targets that is wrong")
"""
GUARDED = SCRIPT + '\nif __name__ == "__main__":\n    run()\n'


def source_of(tmp_path, end, text=GUARDED):
    """A script that moves the arm and then ends, or stalls."""
    script, file = tmp_path / "source.py", tmp_path / "commands"
    script.write_text(text.format(file=str(file), end=end))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    found = {"env": {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}}
    return subprocess.Popen([sys.executable, script], **pipes, **found), file


@pytest.mark.parametrize(
    ("end", "status"),
    [
        ("killed", -signal.SIGKILL),
        *(pytest.param(*p, marks=LONG) for p in (("returns", 0), ("raises", 1))),
    ],
)
def test_the_arm_comes_to_rest_when_the_source_ends(tmp_path, end, status):
    source, file = source_of(tmp_path, end)
    said, errors = source.communicate(timeout=PATIENCE)
    assert (said, source.returncode) == ("moves\n", status), errors

    def is_still():
        rows = recorded(file)
        return not np.abs(rows[-2:, 3:]).max() > 1e-9

    assert wait_for(is_still)
    rows = recorded(file)
    assert_within_bounds(rows)
    # It was on its way.
    assert np.abs(rows[:, 3:]).max() >= 0.1


@LONG
def test_the_arm_comes_to_rest_when_the_source_stalls(tmp_path):
    source, file = source_of(tmp_path, "stalls")
    assert source.stdout.readline() == "moves\n"
    os.kill(source.pid, signal.SIGSTOP)
    before = len(recorded(file))

    # In two seconds of commands, or later where commands that come late stop it on its way.
    def rests():
        rows = recorded(file)
        return len(rows) > before + 2.0 / PERIOD and not np.abs(rows[-1, 3:]).max() > 1e-12

    assert wait_for(rests)
    rows = recorded(file)
    assert_within_bounds(rows)
    source.kill()
    source.communicate()


@LONG
def test_a_script_without_its_guard_of_main_is_told_so(tmp_path):
    source, _ = source_of(tmp_path, "returns", SCRIPT + "\nrun()\n")
    _, errors = source.communicate(timeout=PATIENCE)
    assert source.returncode == 1
    assert "process: cannot be started here; it imports the script that starts it" in errors
    assert errors.strip().endswith('must stand below `if __name__ == "__main__":`')
    assert "guard: its process has ended as it started, with status 1" in errors


@LONG
def test_a_process_that_is_killed_or_let_go_is_noticed(tmp_path):
    guard = Guard(LAW, PERIOD, process=True)
    (child,) = multiprocessing.active_children()
    os.kill(child.pid, signal.SIGKILL)
    child.join()
    said = r"^guard: its process has ended, with status -9; the robot has its last command"
    with pytest.raises(RobotError, match=said):
        guard.latest()
    with pytest.raises(RobotError, match=said):
        guard.target(HOME)
    guard.close()
    guard = Guard(LAW, PERIOD, process=True)
    (child,) = multiprocessing.active_children()
    with warnings.catch_warnings(action="error"):
        del guard
    assert wait_for(lambda: not multiprocessing.active_children())
    assert child.exitcode == 0
