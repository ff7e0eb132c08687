"""Each command imports what it needs, and no more."""

import json
import os
import subprocess
import sys

import pytest

import drake_rnn
from drake_rnn import shipped_experiments
from drake_rnn.cli.command import (
    complete_arms,
    complete_campaigns,
    complete_experiments,
)
from drake_rnn.jobs import shipped_campaigns

#: What is large, and not needed to answer; pydantic is not among it, as typer imports it for words.
LARGE = {"pydrake", "numpy", "matplotlib", "trimesh", "jinja2", "ruamel", "rich", "PIL"}
PICTURES = {"matplotlib", "trimesh", "jinja2", "PIL"}

TELL = """
import atexit, json, sys
names = lambda: list(sys.modules)
atexit.register(lambda: print(json.dumps(names()), file=sys.stderr))
"""
CALL = "from drake_rnn.cli import main; main()"
#: Several commands, one after another.
CALLS = """
from drake_rnn.cli import main
for sys.argv[1:] in json.loads(sys.argv[1]):
    try:
        main()
    except SystemExit:
        pass
"""


def imported(code, *arguments, **environment):
    """Packages that a new Python has imported once the code has run."""
    told = subprocess.run(
        [sys.executable, "-c", TELL + code, *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    ).stderr
    return {name.split(".")[0] for name in json.loads(told.splitlines()[-1])}


def test_what_needs_no_robot_imports_none():
    calls = [
        ["--version"],
        ["--help"],
        ["run", "--help"],
        ["walk"],
        ["run", "pinv_line", "--nonsense"],
        ["report", "--format", "pdf"],
    ]
    assert not imported(CALLS, json.dumps(calls)) & LARGE


def test_a_shell_completes_names_of_files_without_reading_them():
    asked = {"_DRAKE_RNN_COMPLETE": "complete_bash", "COMP_WORDS": "drake-rnn run p"}
    code = "from drake_rnn.cli.commands import app; app(prog_name='drake-rnn')"
    assert not imported(code, COMP_CWORD="2", **asked) & LARGE
    assert complete_experiments("") == shipped_experiments()
    assert complete_campaigns("") == shipped_campaigns()
    assert complete_arms("") == drake_rnn.shipped_arms()


def test_a_list_is_made_without_what_a_run_needs():
    assert not imported(CALL, "list") & (LARGE - {"rich"})
    assert not imported(CALL, "list", "--arm", "ur5", "nephroid") & (LARGE - {"rich"})


@pytest.mark.parametrize("arguments", [["show", "pinv_line"], ["arms"]], ids=" ".join)
@pytest.mark.long
def test_what_draws_nothing_imports_no_pictures(arguments):
    """Nor does it mind a setting of Matplotlib that is wrong."""
    found = imported(CALL, *arguments, MPLBACKEND="nope")
    assert "pydrake" in found
    assert not found & PICTURES


@pytest.mark.long
def test_a_run_draws_to_files_whatever_windows_are_asked_for(tmp_path):
    environment = {**os.environ, "MPLBACKEND": "nope"}
    short = ("--set", "duration=0.01", "--set", "window=null", "--set", "accept=null")
    command = [sys.executable, "-m", "drake_rnn", "run", "slc_nephroid_known", *short]
    options = ["--out", str(tmp_path), "--no-playback"]
    done = subprocess.run([*command, *options], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("*/figures/overview.png"))


@pytest.mark.long
def test_a_run_imports_matplotlib_only_to_draw():
    assert "matplotlib" not in imported(CALL, "run", "pinv_line", "--dry-run")


@pytest.mark.long
def test_the_package_is_imported_name_by_name():
    code = "import drake_rnn; {}"
    assert not imported(code.format("drake_rnn.__all__, dir(drake_rnn)")) & LARGE
    assert not imported(code.format("drake_rnn.Adaptive")) & {"pydrake", *PICTURES}
    found = imported(code.format("drake_rnn.simulate, drake_rnn.load_arm"))
    assert "pydrake" in found
    assert not found & PICTURES


def test_a_name_that_is_not_lent_is_named():
    with pytest.raises(AttributeError, match="module 'drake_rnn' has no attribute 'Adaptve'"):
        _ = drake_rnn.Adaptve
    assert (
        drake_rnn.__version__
        in subprocess.run(
            [sys.executable, "-m", "drake_rnn", "--version"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    )


def test_a_missing_library_of_the_system_is_named():
    """As a slim container lacks it; what Drake prints about it comes before."""
    code = """
from drake_rnn.cli import starting
def without_glib(place):
    raise ImportError("libglib-2.0.so.0: cannot open shared object file: No such file or directory")
starting.import_name = without_glib
starting.main()
"""
    command = [sys.executable, "-c", code, "run", "pinv_line"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error libglib-2.0.so.0: this library of the system, which Drake")
    assert "apt-get install libglib2.0-0" in done.stderr
    assert "Traceback" not in done.stderr
