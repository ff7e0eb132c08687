"""A command that is told to end: a sentence, the status 130, and what it had is kept."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from cli_helpers import call, statuses

from drake_rnn import Result
from drake_rnn.cli import (
    saving,
)
from drake_rnn.cli import (
    starting as interrupting,
)
from drake_rnn.cli.starting import (
    interruptible,
    note_start,
)
from drake_rnn.runs import (
    checkpoint as keeper,
)
from drake_rnn.runs import (
    evaluation,
)
from process_helpers import PATIENCE, wait_for, wait_until_delivered

LAW = """
from pathlib import Path
from drake_rnn import Pseudoinverse, validated

@validated
class Endless(Pseudoinverse):
    def step(self, t, x, u, period):
        while t > 0.01:
            Path("endless").touch()
        return super().step(t, x, u, period)
"""
#: A command without Drake, whose work never ends.
WORK = """
from drake_rnn.cli.starting import interruptible, note_start
from drake_rnn.runs import evaluation, keeper
with interruptible():
    note_start()
    print("begun", flush=True)
    {}
"""


@pytest.fixture
def calls(monkeypatch):
    """What ends this process is raised instead, and its signals are as they were afterwards."""

    class Left(BaseException):
        """Which nothing catches."""

    def leave(status):
        raise Left(f"left with {status}")

    found = interrupting._Calls()
    monkeypatch.setattr(interrupting, "_CALLS", found)
    monkeypatch.setattr(interrupting.os, "_exit", leave)
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    yield found
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def ending(work, *, started=True):
    """The status with which a command ends that does this."""
    try:
        with interruptible():
            if started:
                note_start()
            work()
    except SystemExit as end:
        return end.code
    return 0


def interrupt():
    signal.raise_signal(signal.SIGINT)


def interrupt_but(raised):
    """What an interrupt may become on its way."""
    try:
        interrupt()
    except KeyboardInterrupt:
        raise raised from None


def interrupt_thrice():
    """As own code that catches every exception."""
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            interrupt()
    interrupt()


@pytest.mark.usefixtures("calls")
@pytest.mark.parametrize(
    ("work", "status", "said"),
    [
        (interrupt, 130, "interrupted\n"),
        (lambda: signal.raise_signal(signal.SIGTERM), 130, "interrupted\n"),
        (lambda: interrupt_but(ImportError("initialization failed")), 130, "interrupted\n"),
        (lambda: interrupt_but(SystemExit(1)), 130, ""),
        (lambda: interrupt_but(SystemExit(0)), 0, ""),
        (lambda: sys.exit(3), 3, ""),
    ],
)
def test_a_command_ends_with_a_sentence_of_its_own_or_this_one(capsys, work, status, said):
    assert ending(work) == status
    assert capsys.readouterr().err == said


@pytest.mark.usefixtures("calls")
def test_before_it_has_begun_it_is_left_at_once():
    """An import of compiled code would make words of an interrupt."""
    with pytest.raises(BaseException, match="left with 130"):
        ending(interrupt, started=False)


@pytest.mark.usefixtures("calls")
def test_the_third_call_waits_for_nothing(capsys):
    with pytest.raises(BaseException, match="left with 130"):
        ending(interrupt_thrice)
    assert capsys.readouterr().err.startswith("interrupted again: left at once\n")


@pytest.mark.usefixtures("calls")
def test_an_error_of_its_own_stays_one():
    with pytest.raises(ZeroDivisionError):
        ending(lambda: 1 / 0)


def test_a_process_that_ignores_ctrl_c_still_does(calls):
    """So does what a script starts in the background."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert (ending(interrupt), calls.count) == (0, 0)


@pytest.mark.long
@pytest.mark.parametrize(
    ("work", "signals", "status"),
    [
        ("while True: pass", 1, 130),
        # Code in another language, between whose steps Python never comes to a signal.
        ("sum(range(10**13))", 2, -signal.SIGINT),
    ],
)
def test_what_never_returns_ends(work, signals, status):
    process = subprocess.Popen(
        [sys.executable, "-c", WORK.format(work)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout.readline() == b"begun\n"
    for left in reversed(range(signals)):
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        if left:
            wait_until_delivered(process, signal.SIGINT)
    assert process.wait(PATIENCE) == status


@pytest.mark.long
def test_a_law_that_never_returns_ends_and_what_was_before_it_is_kept(tmp_path):
    (tmp_path / "endless.py").write_text(LAW)
    command = [sys.executable, "-m", "drake_rnn", "run", "pinv_line", "--out", "runs"]
    process = subprocess.Popen(
        [*command, "--set", "law={kind: 'endless:Endless'}"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert wait_for((tmp_path / "endless").exists)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert (process.returncode, said) == (130, "failed pinv_line: interrupted (at t = 0.011 s)\n")
    folder = tmp_path / "runs" / "pinv_line"
    with np.load(folder / "result.npz") as kept:
        assert kept["time"][-1] == pytest.approx(0.011)
    assert statuses(tmp_path)["pinv_line"]["status"] == "interrupted"
    assert os.listdir(tmp_path / "runs") == ["pinv_line"]
    assert not (folder / "playback.html").exists()


def test_a_run_that_is_interrupted_while_it_is_drawn_is_kept(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(saving, "draw_figures", interrupted)
    result = call("run", "pinv_line", "pinv_csv", "--duration", "0.05", "--out", tmp_path)
    folder = tmp_path / "pinv_line"
    assert result.exit_code == 130
    assert result.stderr == (
        f"interrupted: {folder} has the result; `drake-rnn plot {folder}` and `drake-rnn replay "
        f"{folder}` draw it; not run: pinv_csv\n"
    )
    assert Result.load(folder).status == "complete"
    assert list(statuses(tmp_path)) == ["pinv_line"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_interrupted_while_metrics_are_taken_is_kept(
    tmp_path, monkeypatch, calls, number
):
    calls.hear()
    calls.begin()
    finish = evaluation.Evaluations.finish

    def told(self, *args):
        signal.raise_signal(number)
        return finish(self, *args)

    monkeypatch.setattr(evaluation.Evaluations, "finish", told)
    result = call("run", "pinv_line", "pinv_csv", "--duration", "0.05", "--out", tmp_path)
    folder = tmp_path / "pinv_line"
    assert result.exit_code == 130
    assert result.stderr == (
        f"interrupted: {folder} has the result; `drake-rnn plot {folder}` and `drake-rnn replay "
        f"{folder}` draw it; not run: pinv_csv\n"
    )
    assert Result.load(folder).status == "complete"
    assert list(statuses(tmp_path)) == ["pinv_line"]
    assert not (folder / "playback.html").exists()


def test_a_run_whose_result_is_lost_says_how_to_go_on(tmp_path, monkeypatch):
    """As when a second Ctrl-C comes before anything is written."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(keeper, "_EVERY", 0.02)
    monkeypatch.setattr(keeper, "_PAUSE", 0.0)
    monkeypatch.setattr(saving, "metrics_table", interrupted)
    result = call("run", "pinv_line", "--duration", "0.05", "--out", tmp_path)
    folder = tmp_path / "pinv_line"
    assert result.exit_code == 130
    assert result.stderr == f"interrupted; `drake-rnn run --resume {folder}` goes on with it\n"
    monkeypatch.undo()
    assert call("run", "--resume", folder, "--no-playback", "--no-figures").exit_code == 0
