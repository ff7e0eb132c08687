"""Output that cannot be written: one sentence and the status 2, and the work is done.

Where the reader of a pipe has left, as ``head`` does: no word, and the status of that signal.
"""

import json
import os
import subprocess
import sys
import tempfile

import pytest

from drake_rnn.cli import starting as streams

COMMAND = f"{sys.executable} -m drake_rnn"
LOST = "error stdout: {}; what was to be printed is lost\n"
PIPE = "| true"
ELSEWHERE = {
    ">&-": (2, LOST.format("Bad file descriptor")),
    ">/dev/full": (2, LOST.format("No space left on device")),
    PIPE: (141, ""),
}


def shell(line, **options):
    """Call the shell; the status is that of the first command of a pipe.

    What is printed to ``| true`` is printed once nobody can read it any more.
    """
    if line.endswith(PIPE):
        closed = os.path.join(tempfile.mkdtemp(), "closed")
        os.mkfifo(closed)
        command = line.removesuffix(PIPE)
        line = f"{{ read < {closed}; {command}; }} | {{ exec <&-; echo > {closed}; }}"
    bash = ["bash", "-c", f"set -o pipefail; {line}"]
    return subprocess.run(bash, capture_output=True, text=True, **options)


@pytest.mark.parametrize("where", ELSEWHERE)
@pytest.mark.parametrize("arguments", ["--version", "run --help"])
def test_what_cannot_be_printed_is_told(arguments, where):
    done = shell(f"{COMMAND} {arguments} {where}")
    assert (done.returncode, done.stderr) == ELSEWHERE[where]


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        ("list", ">&-"),
        ("schema experiment", ">/dev/full"),
        ("show pinv_line", PIPE),
        ("claims slc", PIPE),
    ],
)
def test_by_each_kind_of_command(arguments, where):
    test_what_cannot_be_printed_is_told(arguments, where)


@pytest.mark.long
@pytest.mark.parametrize("where", ELSEWHERE)
def test_a_run_is_written_nevertheless(tmp_path, where):
    options = f"--duration 0.05 --no-playback --no-figures --out {tmp_path}"
    done = shell(f"{COMMAND} run pinv_line {options} {where}")
    assert (done.returncode, done.stderr) == ELSEWHERE[where]
    assert json.loads((tmp_path / "pinv_line" / "run.json").read_text())["status"] == "complete"
    quiet = shell(f"{COMMAND} run pinv_line --quiet {options} {where}")
    assert (quiet.returncode, quiet.stderr) == (0, "")


@pytest.mark.parametrize("where", ["2>&-", "2>/dev/full", "<&- >&- 2>&-"])
def test_errors_that_cannot_be_printed_leave_the_status(where):
    assert shell(f"{COMMAND} walk {where}").returncode == 2
    if ">&- 2" not in where:
        assert shell(f"{COMMAND} --version {where}").returncode == 0


def test_another_file_never_takes_the_place_of_a_closed_stream():
    """Libraries in other languages would print to it."""
    code = (
        "from drake_rnn.cli.starting import Streams; Streams(); print(open('/dev/null').fileno())"
    )
    done = shell(f'{sys.executable} -c "{code}" <&- 2>&-')
    assert int(done.stdout) > 2


@pytest.mark.long
def test_a_current_folder_that_was_removed_is_told(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    done = shell(f"rmdir {gone}; {COMMAND} laws; exit $?", cwd=gone, env=_environment())
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == (
        "error current folder: No such file or directory; change to a folder that exists"
    )


def _environment():
    package = os.path.dirname(os.path.dirname(os.path.dirname(streams.__file__)))
    return {**os.environ, "PYTHONPATH": package}
