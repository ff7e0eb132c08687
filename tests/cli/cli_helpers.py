"""Calls of the command line within this process, and what they have printed and written."""

import json

import numpy as np
from typer.testing import CliRunner

from drake_rnn.cli.commands import app

KNOWN, LEARNED = "slc_nephroid_known", "slc_nephroid"
SHORT = ("--duration", "0.05")


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def run(out, *arguments, experiment=KNOWN):
    """Run without a playback, and return the folder."""
    result = call("run", experiment, "--out", out, "--no-playback", *arguments)
    assert result.exit_code == 0, result.stderr
    return out / experiment


def sentence(result):
    """What stderr says: one line, without a traceback, and where to look for it."""
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    lines = result.stderr.splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("error ")
    return lines[0].removeprefix("error ")


def metrics(folder):
    return json.loads((folder / "metrics.json").read_text())


def assert_same_series(one, two):
    """Bit for bit."""
    with np.load(one / "result.npz") as a, np.load(two / "result.npz") as b:
        assert set(a.files) == set(b.files)
        for name in a.files:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name, strict=True)


def notes(result):
    return [line for line in result.stdout.splitlines() if line.startswith("note ")]


def statuses(folder):
    return {file.parent.name: json.loads(file.read_text()) for file in folder.rglob("run.json")}
