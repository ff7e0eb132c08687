"""A shield in a process of its own: whatever becomes of the source, the arm keeps its bounds."""

import mmap
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from struct import Struct, unpack_from

import numpy as np
import pytest

from drake_rnn import InvalidInputError, RobotError, Shield, load_arm
from drake_rnn.shield.memory import ShieldMemory, ShieldSizes
from process_helpers import PATIENCE, wait_for

ROOT, LONG = Path(__file__).parents[2], pytest.mark.long
PERIOD, ARM = 5e-3, load_arm("planar6")
HOME, N = np.asarray(ARM.home), ARM.n
V, A, J = 1.0, 4.0, 80.0
LIMITS = ARM.limits.replace(velocity=V, acceleration=A, jerk=J)
#: From the largest speed to rest, with acceleration and jerk bounded [s].
STOPS = V / A + A / J


def shield_of(file=None):
    send = True if file is None else partial(record, file)
    return Shield(ARM, PERIOD, limits=LIMITS, collisions=False, process=send)


def record(file, command):
    """Write a command into a file: its time, positions and velocities."""
    with open(file, "ab") as stream:
        stream.write(np.array([command.time, *command.position, *command.velocity]).tobytes())


def recorded(file):
    return np.fromfile(file).reshape(-1, 1 + 2 * N)


def assert_within_bounds(rows):
    """Each command goes on from the one before, or from rest after a call that came too late."""
    time, q, v = rows[:, 0], rows[:, 1 : 1 + N], rows[:, 1 + N :]
    assert not LIMITS.violation(q).any()
    np.testing.assert_allclose(np.diff(q, axis=0), PERIOD * v[1:], atol=1e-12)
    late = np.diff(time) > 2.0 * PERIOD
    before = np.where(late[:, None], 0.0, v[:-1])
    assert np.abs(v).max() <= V * (1.0 + 1e-9)
    assert np.abs(v[1:] - before).max() <= PERIOD * A * (1.0 + 1e-9)
    if not late.any():
        jerk = np.abs(np.diff(np.vstack((np.zeros((2, N)), v)), n=2, axis=0)) / PERIOD**2
        assert jerk.max() <= J * (1.0 + 1e-9)


def rests(shield):
    return not np.abs(shield.velocity).max() > 1e-12


@pytest.mark.long
def test_it_does_what_the_shield_of_this_process_does_and_tells_as_much(tmp_path):
    with shield_of(tmp_path / "commands") as shield:
        now = time.monotonic()
        way = HOME + np.linspace(0.0, 0.5, 11)[:, None] * np.ones(N)
        assert shield.follow_positions(way, rate=10.0, start=now)
        assert wait_for(lambda: np.abs(shield.velocity).max() > 0.1)
        status = shield.status
        assert status.silent_for >= 0.0
        # It is held at the end of the chunk.
        assert wait_for(lambda: np.abs(shield.position - way[-1]).max() < 1e-3 and rests(shield))
        assert shield.status.behind < 1e-3
        # One that is far: it is told what is in the way, and for how long.
        shield.follow_positions(HOME - 1.0)
        limited = set()

        def moves():
            limited.update(shield.status.limited_by)
            return rests(shield) and limited

        assert wait_for(moves)
        assert any(name.endswith(" velocity") for name in limited)
        assert shield.counts.chunks == 2
        assert shield.uncertified == shield.counts.refused == 0
        last = shield.latest()
        assert np.array_equal(last.position, shield.position)
        shield.follow_velocities(np.full(N, 0.3))
        assert wait_for(lambda: np.abs(shield.velocity).max() > 0.2)
        # After the timeout, it comes to rest.
        assert wait_for(lambda: rests(shield))
        assert shield.status.silent_for > 0.2
    assert rests(shield)
    assert_within_bounds(recorded(tmp_path / "commands"))
    assert not multiprocessing.active_children()
    with pytest.raises(RobotError, match=r"^shield: it has been closed, and takes no target"):
        shield.follow_positions(HOME)


@pytest.mark.long
def test_garbage_at_10_khz_does_no_harm_and_is_told(tmp_path):
    """What is refused at once, what is left out, and what other programs may write."""
    rng, wrong = np.random.default_rng(0), ["x", None, HOME[:-1], 1e4 * HOME + 1e4, [[HOME]]]
    with shield_of(tmp_path / "commands") as shield:
        memory = shield._process.memory
        shield.follow_velocities(np.full(N, 0.3))
        assert wait_for(lambda: np.abs(shield.velocity).max() > 0.1)
        # Garbage comes while the arm moves.
        refused, given, begin = 0, 1, time.monotonic()
        while time.monotonic() < begin + 1.0:
            given += 1
            # In bursts, so that they are more than 10,000 a second.
            if given % 40 > 3:
                # A program that knows no rules.
                number = memory.count + 1
                head = number, rng.normal(), *rng.integers(0, 300, 3).tolist()
                memory.arms[0].chunks[number % 4].write(*head, rng.bytes(400))
                memory.count = number
            elif given % 4 == 1:
                with pytest.raises(InvalidInputError):
                    shield.follow_positions(wrong[given // 4 % len(wrong)])
                refused += 1
            elif given % 4 == 2:
                shield.follow_velocities(np.full(N, np.nan))
            else:
                shield.follow_positions(HOME + rng.uniform(-1.5, 1.5, N))
            if given % 40 == 0:
                time.sleep(max(begin + 1e-4 * given - time.monotonic(), 0.0))
        assert wait_for(lambda: shield.counts.refused > 0)
        assert "must be of kind 0 to 3, on clock 0 or 1, with 1 to 256 rows" in shield.refusal

        def is_all_told():
            counts = shield.counts
            return counts.chunks + counts.refused + counts.lost == given - refused

        assert wait_for(is_all_told)
        empty = shield.counts.empty
        shield.follow_velocities(np.full(N, np.nan))
        assert wait_for(lambda: shield.counts.empty == empty + 1)
        shield.rest()
        assert wait_for(lambda: rests(shield))
    rows = recorded(tmp_path / "commands")
    assert np.abs(rows[:, 1 + N :]).max() > 0.1
    assert_within_bounds(rows)


SCRIPT = """
import os, signal, sys, time
sys.path[:0] = {path!r}
from test_shield_process import HOME, N, shield_of
import numpy as np

if __name__ == "__main__":
    shield = shield_of({file!r})
    shield.follow_positions(HOME + np.linspace(0, 1.5, 2)[:, None] * np.ones(N), rate=1.0)
    while np.abs(shield.velocity).max() < 0.9:
        time.sleep(0.002)
    print("moves", flush=True)
    {end}
"""


def source_of(tmp_path, end):
    """A script that moves the arm and then ends, or stalls."""
    script, file = tmp_path / "source.py", tmp_path / "commands"
    script.write_text(SCRIPT.format(path=sys.path, file=str(file), end=end))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, script], **pipes), file


@LONG
def test_when_the_source_is_killed_the_arm_rests_as_soon_as_its_bounds_allow(tmp_path):
    source, file = source_of(tmp_path, "os.kill(os.getpid(), signal.SIGKILL)")
    said, errors = source.communicate(timeout=PATIENCE)
    assert (said, source.returncode) == ("moves\n", -signal.SIGKILL), errors
    assert wait_for(lambda: not np.abs(recorded(file)[-2:, 1 + N :]).max() > 1e-9)
    rows = recorded(file)
    assert_within_bounds(rows)
    speed = np.abs(rows[:, 1 + N :]).max(axis=1)
    fastest = int(np.flatnonzero(speed >= 0.9)[-1])
    assert (len(rows) - fastest) * PERIOD <= STOPS + 10 * PERIOD


@LONG
def test_while_the_source_is_stopped_for_2_s_the_arm_ends_its_chunk_and_rests(tmp_path):
    source, file = source_of(tmp_path, "time.sleep(3600)")
    assert source.stdout.readline() == "moves\n"
    os.kill(source.pid, signal.SIGSTOP)
    stopped = recorded(file)[-1, 0]

    # Commands that come late on a busy machine stop the arm on its way, and it rests later. It
    # comes the nearer the slower, once the chunk has ended.
    def ends_its_chunk():
        rows = recorded(file)
        slow = np.abs(rows[-20:, 1 + N :]).max() <= 0.01
        return slow and rows[-1, 0] > stopped + 2.0

    assert wait_for(ends_its_chunk)
    rows = recorded(file)
    np.testing.assert_allclose(rows[-1, 1 : 1 + N], HOME + 1.5, atol=1e-3)
    assert_within_bounds(rows)
    source.kill()
    source.communicate()


def test_what_cannot_be_is_refused_by_name():
    plain = Shield(ARM, PERIOD, limits=LIMITS, collisions=False)
    for call in (
        plain.latest,
        lambda: plain.path,
        lambda: plain.refusal,
        lambda: plain.place_obstacles(np.zeros((0, 3))),
    ):
        with pytest.raises(InvalidInputError, match="is for a shield that was made with process=T"):
            call()
    plain.close()
    with pytest.raises(InvalidInputError, match="process: must be True, False or a function, not"):
        Shield(ARM, PERIOD, process="yes")
    with pytest.raises(InvalidInputError, match="process: cannot be sent to the shield's process"):
        Shield(ARM, PERIOD, limits=LIMITS, collisions=False, process=lambda command: None)


@pytest.fixture(scope="module")
def served():
    """A shield in a process of its own."""
    with shield_of() as shield:
        yield shield


def test_what_a_process_cannot_do_is_refused_by_name(served):
    for call, text in (
        (lambda: served.command(), "command: is called by the shield's own process"),
        (lambda: served.follow_positions(HOME, t=0.0), "t: must be left out with process"),
        (lambda: served.follow_positions(HOME, start=1.7e9), "1970"),
        (
            lambda: served.follow_positions(np.tile(HOME, (300, 1)), rate=50.0),
            "q: has 300 targets; with process at most 256",
        ),
    ):
        with pytest.raises(InvalidInputError, match=text):
            call()


def layout():
    """Rows of the tables of the page: where parts begin, and the cells of each."""
    page = (ROOT / "docs" / "shield_memory.md").read_text()
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in page.splitlines()
        if line.startswith("|")
    ]
    begins = {row[0]: row[1] for row in rows if len(row) == 3}
    cells, part = {}, ""
    for row in (row for row in rows if len(row) == 6):
        part = row[0] or part
        cells.setdefault(part, []).append(row[1:])
    return begins, cells


def number(text, **values):
    """A number of the tables, such as ``5 + 2 n``."""
    product = re.sub(r"(\d) ([nmwkl(])", r"\1 * \2", text).replace("k (", "k * (")
    return eval(product, {}, values)


@pytest.mark.parametrize(("n", "m", "arms"), [(6, 0, ()), (7, 2, ()), (9, 1, (4, 5))])
def test_the_layout_is_that_of_the_page(n, m, arms):
    sizes = ShieldSizes(n, m, 10, ("joint",) * n + ("cup",) * m, arms)
    begins, cells = layout()
    chunks = [(f"chunk {k}", k) for k in range(4)]
    parts = [("status", 0), ("places", 0), ("refusal", 0), *chunks, ("names", 0)]
    if arms:
        parts += [(f"second arm: {part}", k) for part, k in (("count", 0), parts[0], parts[2])]
        parts += [(f"second arm: {part}", k) for part, k in chunks]
    at, w = 128, sizes.columns
    records = [(f"command {k}", ShieldMemory.command_fields(n), k) for k in range(1024)]
    assert number(begins["driver"], n=n) + 5 == 128 + ShieldMemory.command_bytes(n) // 8
    rest = zip(parts, ShieldMemory.records(sizes), strict=False)
    records += [(part, text, k) for (part, k), text in rest]
    for part, text, k in records:
        known = {"n": n, "m": m, "w": w, "k": k, "l": len(sizes.text) // 8}
        several = {f"command {k}": "command k, of 1024", f"chunk {k}": "chunk k, of 4"}
        name = re.sub(r" \d+$", "", part).removeprefix("second arm: ")
        if part == "status":
            at += 5
        for one, row in several.items():
            part = part.replace(one, row)
        assert number(begins[part], **known) == at
        if name == "count":
            at += 3
            continue
        size = Struct(f"=Q{text}Q").size // 8
        assert number(cells[name][-1][0], **known) == size - 1
        at += size
        # Types of the cells one after the other; text and rows are bytes.
        types = "".join(int(k or 1) * t for k, t in re.findall(r"(\d*)([Qds])", f"Q{text}Q"))
        byte = types.count("s")
        # Rows of a chunk are bytes here, and floats for others.
        rows = {"chunk": "d"}.get(name, "s") * (byte // 8)
        types = types.replace("s" * byte, rows) if byte else types
        for cell, kind, *_ in cells[name]:
            first, *_ = re.split(r",| to | on", cell)
            letter = types[number(first, **known)]
            is_empty = name == "places" and kind == "f" and m == 0
            assert is_empty or letter == {"u": "Q", "f": "d", "text": "s"}[kind]


def test_the_memory_names_joints_and_obstacles_in_order_and_places_may_be_by_name():
    """Read as another program does, and in the order of the list, not of shapes."""
    box = {"kind": "box", "name": "böx", "center": [5, 0, 0], "size": [0.1] * 3, "speed": 0.1}
    ball = {"kind": "ball", "center": [-5, 0, 0], "radius": 0.1, "speed": 0.1}
    with Shield(ARM, 0.02, limits=LIMITS, obstacles=[box, ball], process=True) as shield:
        shield.place_obstacles({"ball 2": [0.0, 0.0, 0.01], "böx": [0.01, 0.0, 0.0]})
        begins, _ = layout()
        known = {"n": N, "m": 2, "w": 1 + max(N, 7)}
        with open(shield.path, "rb") as stream:
            memory = stream.read()
        names = memory[8 * number(begins["names"], **known) + 8 :].split(b"\0")[: N + 2]
        assert [name.decode() for name in names] == [*ARM.joints, "böx", "ball 2"]
        at = 8 * number(begins["places"], **known) + 16
        assert np.frombuffer(memory[at : at + 48]).tolist() == [0.01, 0, 0, 0, 0, 0.01]
        with pytest.raises(InvalidInputError, match="p_WO: 'box' is the name of no obstacle"):
            shield.place_obstacles({"box": [0.0, 0.0, 0.0]})


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")
def test_a_program_in_c_moves_the_arm_and_reads_commands(served, tmp_path):
    program = tmp_path / "client"
    source = ROOT / "examples" / "shield_client.c"
    warnings = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
    subprocess.run(["cc", "-O2", *warnings, "-o", program, source, "-lm"], check=True)
    before, chunks = served.position[0], served.counts.chunks
    run = subprocess.run([program, served.path], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout.splitlines()[-1]) == (0, "there"), run.stderr
    assert abs(served.position[0] - before - 0.1) < 2e-3
    assert served.counts.chunks == chunks + 1
    with open(served.path, "rb") as file:
        memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        assert unpack_from("=4Q", memory, 32) == (2, N, 256, 0)
