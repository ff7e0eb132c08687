"""A command that is killed at any moment leaves no folder that reads as complete and is not."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result

NAME = "pinv_line"


#: The command, which is killed where it begins to draw what it has computed.
KILLED = """
import os, signal
from drake_rnn.cli import saving, starting
saving.draw_figures = lambda *given: os.kill(os.getpid(), signal.SIGKILL)
starting.main()
"""


def start(folder, seed, program=("-m", "drake_rnn")):
    # The seed is written to the document, so that a mixture of two runs can be told.
    command = [sys.executable, *program, "run", NAME, "--duration", "0.5"]
    return subprocess.Popen(
        [*command, "--seed", str(seed), "--out", folder],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def pictures(folder):
    return {str(file.relative_to(folder)) for file in folder.rglob("*") if file.suffix == ".png"}


def complete_result(folder, seeds):
    """Return the result in the folder, of one of these seeds, or None where it says incomplete."""
    try:
        result = Result.load(folder)
    except InvalidInputError as error:
        assert "is incomplete" in str(error)  # noqa: PT017  either outcome is right
        return None
    assert result.experiment.document.seed in seeds
    assert result.status == "complete"
    return result


@pytest.mark.long
@pytest.mark.parametrize("kills", [2, pytest.param(50, marks=pytest.mark.nightly)])
def test_killed_at_any_moment_a_run_is_the_old_one_the_new_one_or_incomplete(tmp_path, kills):
    """At moments from the start of the process to after its end, and once while it writes."""
    began = time.monotonic()
    assert start(tmp_path, 0).wait() == 0
    takes = time.monotonic() - began
    folder = tmp_path / NAME
    drawn = pictures(folder)
    metrics = json.loads((folder / "metrics.json").read_text())
    rng = np.random.default_rng(0)
    seed = 0
    for number in range(1, kills + 1):
        process = start(tmp_path, number)
        time.sleep(rng.uniform(0.2, 1.2) * takes)
        process.send_signal(signal.SIGKILL)
        process.wait()
        result = complete_result(folder, {seed, number})
        if result is None:
            continue
        seed = result.experiment.document.seed
        assert result.metrics == metrics
        assert pictures(folder) == drawn
        assert (folder / "playback.html").stat().st_size > 1e5
        assert os.listdir(tmp_path) == [NAME]

    # How many of those met a run that writes depends on the machine; these two do not.
    assert start(tmp_path, kills + 1).wait() == 0
    assert complete_result(folder, {kills + 1}).metrics == metrics
    assert start(tmp_path, kills + 2, ("-c", KILLED)).wait() == -signal.SIGKILL
    assert complete_result(folder, {kills + 2}) is None
