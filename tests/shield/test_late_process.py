"""A shield's process that is stopped at random: what a robot is sent keeps every bound."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import (
    CommandReader,
    Guard,
    InvalidInputError,
    JointStream,
    RobotError,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from drake_rnn.drive.command_memory import COMMANDS, CommandMemory
from drake_rnn.drive.own_process import CommandWriter
from drake_rnn.drive.shared_cycles import HEADER, MOVING, anonymous_file
from drake_rnn.laws.guard import StreamGuard
from drake_rnn.laws.guard_command import GuardCommand
from drake_rnn.robot.joint_stop import stop_after
from process_helpers import wait_for

EXAMPLES = Path(__file__).parents[2] / "examples"
ARM = load_arm("planar6")
HOME, N = np.asarray(ARM.home), ARM.n
V, A, J = 1.0, 4.0, 80.0
LIMITS = ARM.limits.replace(velocity=V, acceleration=A, jerk=J)
NEEDS_C = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")

#: Stops that are asked for one a line; or positions that are sent to a robot, into a file.
PROGRAM = r"""
#include "shield_memory.h"
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{
    double v, a, most, jerk, h, samples, way, velocity;
    if (argc == 1) {
        while (scanf("%lf %lf %lf %lf %lf %lf", &v, &a, &most, &jerk, &h, &samples) == 6) {
            shield_stop_after(v, a, most, jerk, h, samples, &way, &velocity);
            printf("%.17g %.17g\n", way, velocity);
        }
        return 0;
    }
    shield_memory memory;
    shield_reader reader = {0};
    double q[SHIELD_JOINTS];
    if (argc != 5 || shield_open(&memory, argv[1]) != 0) return 1;
    if (shield_position_at(&reader, &memory, shield_now() + 1.0, q) != -3) return 3;
    FILE *file = fopen(argv[4], "wb");
    h = atof(argv[2]);
    const double begin = shield_now();
    for (int k = 0; k < atof(argv[3]) / h; ++k) {
        const double t = begin + k * h, now = shield_now();
        if (t > now) usleep((useconds_t)(1e6 * (t - now)) + 1);
        while (shield_now() < t) {
        }
        if (shield_position_at(&reader, &memory, t, q) != 0) return 2;
        fwrite(q, sizeof(double), memory.joints, file);
    }
    return fclose(file);
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    folder = tmp_path_factory.mktemp("c")
    (folder / "reader.c").write_text(PROGRAM)
    strict = ("-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I", EXAMPLES)
    out = folder / "reader"
    subprocess.run(["cc", "-O2", *strict, "-o", out, folder / "reader.c", "-lm"], check=True)
    return out


@NEEDS_C
def test_a_stop_in_c_is_that_of_python(program):
    rng, rows = np.random.default_rng(0), []
    for k in range(5000):
        h, most = float(rng.choice([1e-3, 4e-3, 1e-2])), rng.uniform(0.5, 20.0)
        jerk = np.inf if k % 5 == 0 else min(np.exp(rng.uniform(2.0, 9.0)), 2.0 * most / h)
        most = np.inf if k % 25 == 0 else most
        a = 0.0 if np.isinf(jerk) or k % 3 == 0 else rng.uniform(-most, most)
        v = 0.0 if k % 7 == 0 else rng.uniform(-2.0, 2.0)
        rows.append((v, a, most, jerk, h, float(rng.integers(0, 400))))
    asked = "\n".join(" ".join(map(repr, map(float, row))) for row in rows)
    run = subprocess.run([program], input=asked, capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in run.stdout.splitlines()], dtype=float)
    expected = [
        stop_after(*row[:3], None if np.isinf(row[3]) else row[3], *row[4:]) for row in rows
    ]
    np.testing.assert_allclose(found, np.array(expected)[:, :2], rtol=1e-13, atol=1e-14)


def stop_at_random(process, until, rng):
    """Stop a process for 5, 50 and 500 ms at random, until an event."""
    while not until.wait(rng.uniform(0.02, 0.3)):
        os.kill(process, signal.SIGSTOP)
        time.sleep(rng.choice([5e-3, 5e-2, 0.5], p=[0.5, 0.4, 0.1]))
        os.kill(process, signal.SIGCONT)


def read_in_python(shield, h, seconds, file):
    """What `PROGRAM` does."""
    reader, begin, rows = CommandReader(shield.path), time.monotonic(), []
    for k in range(int(seconds / h)):
        t = begin + k * h
        while (now := time.monotonic()) < t:
            time.sleep(t - now)
        rows.append(reader.position_at(t))
    np.array(rows).tofile(file)


@NEEDS_C
@pytest.mark.long
@pytest.mark.parametrize("language", ["c", "python"])
def test_a_robot_is_sent_no_jerk_while_the_process_is_stopped_at_random(
    program, tmp_path, language
):
    h, seconds, file = 1e-3, 6.0, tmp_path / "positions"
    with Shield(ARM, h, ShieldSettings(compiled=True), limits=LIMITS, process=True) as shield:
        (child,) = multiprocessing.active_children()
        until, rng = threading.Event(), np.random.default_rng(0)
        stops = threading.Thread(target=stop_at_random, args=(child.pid, until, rng))
        if language == "c":
            run = [program, shield.path, str(h), str(seconds), file]
            robot = subprocess.Popen(run)
            has_ended = robot.poll
        else:
            reads = threading.Thread(target=read_in_python, args=(shield, h, seconds, file))
            reads.start()
            has_ended = lambda: None if reads.is_alive() else 0  # noqa: E731
        stops.start()
        try:
            while has_ended() is None:
                shield.follow_positions(HOME + rng.uniform(-0.5, 0.5, N))
                time.sleep(0.2)
        finally:
            until.set()
            stops.join()
        assert has_ended() == 0
        assert shield.late_stops == 0
        assert shield.late_samples > 50
    q = np.fromfile(file).reshape(-1, N)
    assert len(q) == int(seconds / h)
    v, a, j = (np.diff(q, n=n, axis=0) / h**n for n in (1, 2, 3))
    assert np.abs(v).max() > 0.5
    # What positions of some rad, rounded, come to.
    for value, bound, n in ((v, V, 1), (a, A, 2), (j, J, 3)):
        assert np.abs(value).max() <= bound * (1.0 + 1e-9) + 1e-15 * (2.0 / h) ** n


def command(number, t, after=None, v=0.5):
    one, none = np.ones(2), np.zeros(2)
    after = number - 1 if after is None else after
    return GuardCommand(number, t, one, v * one, 0.0, 0.01, none, 4.0 * one, 80.0 * one, after)


@pytest.fixture
def shared():
    """A memory as a process sees it, and where others find it."""
    size = HEADER + CommandMemory.command_bytes(2)
    file = anonymous_file(size)
    memory = CommandMemory(file, size, 2)
    memory.doing, memory.goes_on = MOVING, True
    yield memory, f"/proc/{os.getpid()}/fd/{file}"
    os.close(file)


def test_a_driver_and_the_process_agree_on_a_command_that_came_at_the_last_moment(shared):
    memory, path = shared
    reader = CommandReader(path)
    memory.give(command(1, 1.0))
    assert (reader.at(1.0).number, reader.at(1.0).sample) == (1, 0)
    # It is there before the driver looks: it stays.
    memory.give(command(2, 1.01))
    assert not memory.withdraw(command(2, 1.01))
    assert reader.at(1.012).number == 2
    # The driver was already on the stop: it is withdrawn, and not followed later either.
    assert (reader.at(1.02).number, reader.at(1.02).sample) == (2, 1)
    memory.give(command(3, 1.02))
    assert (reader.at(1.022).number, reader.at(1.022).sample) == (2, 1)
    assert memory.withdraw(command(3, 1.02))
    # The process goes on from the first sample of the stop, and so does the driver.
    memory.give(command(4, 1.03, after=2))
    assert (reader.at(1.029).number, reader.at(1.03).number) == (2, 4)
    # It followed it, and so it stays.
    memory.give(command(5, 1.04))
    assert reader.at(1.045).number == 5
    assert not memory.withdraw(command(5, 1.04))
    # Several that the driver has slept through.
    for number in range(6, 20):
        memory.give(command(number, 1.04 + 0.01 * (number - 5)))
    assert reader.at(1.11).number == 12
    assert reader.at(1.18).number == 19
    # Too many: how the arm goes on is not known.
    for number in range(20, 21 + COMMANDS):
        memory.give(command(number, 1.18 + 0.01 * (number - 19)))
    with pytest.raises(RobotError, match=r"commands: number 19 was followed last.* fall behind"):
        reader.at(1.19)


def test_a_driver_that_looks_ahead_or_back_is_refused_and_goes_on(shared):
    """What begins to hold until then may still come, and nobody would follow it."""
    memory, path = shared
    reader, now = CommandReader(path), time.monotonic()
    for number in (1, 2):
        memory.give(command(number, now - 0.03 + 0.01 * number))
    assert reader.at(now - 0.015).number == 1
    for look in (reader.at, reader.position_at):
        with pytest.raises(InvalidInputError, match=r"^t: is 10 s after now; must be on "):
            look(time.monotonic() + 10.0)
        with pytest.raises(InvalidInputError, match=r"^t: is 0\.02 s before the time of "):
            look(now - 0.035)
        with pytest.raises(InvalidInputError, match=r"^t: must be a time \[s\], not 'now'"):
            look("now")
    assert reader.at(now).number == 2


def test_a_driver_whose_command_was_taken_back_says_so(shared):
    """It stood still for longer than the process waits, between its look and its word."""
    memory, path = shared
    reader = CommandReader(path)
    memory.give(command(1, 1.0))
    memory.give(command(2, 1.01))
    assert reader.at(1.01).number == 2
    memory.give(command(2, 1.01), begins=np.inf)
    memory.give(command(3, 1.02, after=1))
    with pytest.raises(RobotError, match=r"^commands: number 2 was .* has taken it back"):
        reader.at(1.02)


@pytest.mark.parametrize("moves", [False, True])
def test_a_process_that_is_too_slow_makes_commands_for_later_and_a_driver_reads_on(moves):
    """It makes none where what it measures would be older than its law knows."""
    ball = {"kind": "ball", "center": [0.0, 9.0, 0.0], "radius": 0.1, "speed": 0.5}
    clearance, _ = arm_clearance(ARM, make_obstacles([ball]), HOME)
    law = JointStream(limits=LIMITS, home=HOME, clearance=clearance if moves else None)
    size, h = HEADER + CommandMemory.command_bytes(N), 0.05
    p_WO, file = np.zeros((1, 3)) if moves else None, anonymous_file(size)
    memory = CommandMemory(file, size, N)
    guard = StreamGuard(law, h, t=time.monotonic(), p_WO=p_WO, tolerance=h, late="stop")
    writer, given, reader = CommandWriter(memory, guard), [], None

    def call(takes):
        time.sleep(max(guard.next_call(time.monotonic()) - time.monotonic(), 0.0))
        t = time.monotonic()
        guard.command(HOME + 0.3, p_WO, t)
        time.sleep(takes)
        return writer.write(t)

    for _ in range(12):
        given.append(call(1.2 * h))
        reader = CommandReader(f"/proc/{os.getpid()}/fd/{file}") if reader is None else reader
        q = reader.position_at()
    if moves:
        assert (given, writer.withdrawn) == ([None] * 12, 12)
        np.testing.assert_array_equal(q, HOME)
        # As soon as it is quick enough, numbers go on from those that were followed.
        assert wait_for(lambda: (made := call(0.0)) is not None and made.number == 1)
    else:
        assert given[0] is None
        assert sum(each is not None for each in given) >= 6
        assert np.abs(q - HOME).max() > 0.0
    os.close(file)


def test_without_a_driver_a_late_command_is_withdrawn_and_others_look_by_time(shared):
    memory, _ = shared
    memory.give(command(1, 1.0))
    memory.give(command(2, 1.01))
    assert memory.withdraw(command(2, 1.01))
    memory.give(command(3, 1.02, after=1))
    assert [memory.newest(t).number for t in (0.5, 1.015, 1.02, 9.0)] == [1, 1, 3, 3]
    memory.goes_on = False
    assert memory.newest(0.0).number == 3


def test_a_command_says_where_its_stop_leads():
    of = command(7, 1.0)._replace(acceleration=np.array([1.0, -4.0]))
    assert of.at(0.9) is of
    assert of.at(1.0099) is of
    np.testing.assert_array_equal(of.position_at(0.0), of.position_at(1.0))
    np.testing.assert_allclose(of.position_at(1.01), of.position)
    half = of.position_at(1.015)
    np.testing.assert_allclose(half, (of.position + of.stop(1).position) / 2.0, atol=1e-12)
    later = of.at(1.0234)
    assert (later.number, later.sample, later.time) == (7, 2, pytest.approx(1.02))
    # What is left of a stop is the stop from there.
    np.testing.assert_allclose(later.stop(5).position, of.stop(7).position, atol=1e-12)
    assert not of.at(1e6).velocity.any()


def test_what_is_no_memory_is_refused(tmp_path):
    (tmp_path / "none").write_bytes(bytes(4096))
    for path in (str(tmp_path / "none"), str(tmp_path / "not"), 7.5, "\0"):
        with pytest.raises(InvalidInputError, match=r"^path: "):
            CommandReader(path)


@pytest.mark.long
def test_a_process_that_is_called_by_a_function_holds_the_last_command(tmp_path):
    law = JointStream(limits=LIMITS, home=HOME)
    for process, goes_on in ((True, True), (print_nothing, False)):
        with Guard(law, 5e-3, process=process) as guard:
            assert guard._process.memory.goes_on == goes_on
            guard.target(HOME + 0.1)
            assert wait_for(lambda g=guard: np.abs(g.velocity).max() > 0.01)


def print_nothing(command):
    """What a robot is sent by."""
