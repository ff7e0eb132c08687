"""The command: what it prints, how it ends, and that it goes on after it was killed."""

import signal
import subprocess
import sys
import time

import pytest
from cli_helpers import call, sentence
from report_helpers import CLAIMS, claim, error_below

from drake_rnn.claims import read_claims
from drake_rnn.jobs import pool
from drake_rnn.jobs.pool import ThisProcess
from process_helpers import assert_gone

#: Several runs, one after another.
MANY = {
    **CLAIMS,
    "claims": [claim(k, as_stated=[error_below(1.0, duration=0.3, seed=k)]) for k in range(8)],
}


@pytest.fixture
def folders(tiny, tmp_path):
    """Options with a tiny claims file and a folder."""

    def given(contents=CLAIMS):
        tiny(contents)
        return ("--claims", tmp_path / "claims", "--out", tmp_path / "report")

    return given


@pytest.mark.long
def test_it_prints_how_many_hold_and_where_the_pages_are(folders, tmp_path):
    result = call("report", *folders(), "--jobs", 1, "--no-pictures")
    assert result.exit_code == 0, result.stderr
    (line,) = (line for line in result.stdout.splitlines() if "joint drift free" in line)
    assert line.split()[3:] == ["1", "1", "1", "1"]
    assert str(tmp_path / "report" / "index.html") in result.stdout
    result = call("report", "jdf-C4", *folders(), "--no-pictures", "--quiet", "--format", "md")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
    assert not (tmp_path / "report" / "index.html").exists()


def test_a_failure_is_told_and_the_status_says_so(folders, monkeypatch):
    # A process of its own imports everything first.
    monkeypatch.setattr(pool, "Processes", lambda jobs: ThisProcess())
    failing = {**CLAIMS, "claims": [claim(1, as_stated=[error_below(1.0, **{"law.gain": "x"})])]}
    result = call("report", *folders(failing), "--jobs", 1, "--no-pictures")
    assert result.exit_code == 1
    assert "failed jdf-C1: " in result.stderr
    assert "failed" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("jdf-C99",), "no claim 'jdf-C99'"),
        (("--claims", "."), "no claims file"),
        (("--out", "/dev/null/report"), "--out: /dev/null/report: "),
    ],
)
def test_bad_input_is_refused_before_a_run(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert message in sentence(call("report", *arguments))


def test_a_paper_may_be_named_by_its_scheme():
    result = call("claims", "state_adjustment")
    assert result.exit_code == 0
    for each in read_claims("state_adjustment").claims:
        assert each.id in result.stdout


def kept(folder):
    return len(list(folder.glob("runs/*/rows/*/*.json")))


@pytest.mark.parametrize(
    # That of campaigns has the same workers.
    "number",
    [signal.SIGKILL, signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.nightly)],
)
@pytest.mark.long
def test_killed_it_goes_on_where_it_was(number, folders, tmp_path, report, tiny, simulated):
    command = [sys.executable, "-m", "drake_rnn", "report", *map(str, folders(MANY))]
    process = subprocess.Popen(
        [*command, "--jobs", "1", "--no-pictures"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    folder = tmp_path / "report"
    while kept(folder) < 2:
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(number)
    complained = process.communicate()[1]
    assert process.returncode == (-number if number == signal.SIGKILL else 130)
    if number != signal.SIGKILL:
        assert "run the same command again to continue" in complained
        assert "Traceback" not in complained
    assert_gone(process.pid)
    ended = kept(folder)
    assert 2 <= ended < 8
    made = report(tiny(MANY), folder)
    assert len(simulated) == 8 - ended
    assert made.contents["counts"]["holds"] == 8
