"""`drake-rnn doctor` says what is there, and of what is missing how to get it."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from drake_rnn.cli import listing as installation
from drake_rnn.inputs.packages import PROGRAMS

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
#: Extras for those who work on the package, and of benchmarks.
OF_DEVELOPERS = {"dev", "docs", "mutants", "oink", "peers"}


def doctor(*arguments, code="", **environment):
    """What the command prints, and its exit status, after some code in the same process."""
    start = f"{code}\nfrom drake_rnn.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", start, "doctor", *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def states(checks):
    return {check.name: check.state for check in checks}


def test_it_knows_every_extra_that_users_install():
    assert set(installation.EXTRAS) == set(PROJECT["optional-dependencies"]) - OF_DEVELOPERS


def test_what_every_installation_has_is_there():
    found = states(installation.dependency_checks())
    assert set(found) == {"drake-rnn", *(line.split(">=")[0] for line in PROJECT["dependencies"])}
    assert set(found.values()) == {"ok"}


def test_a_missing_extra_is_no_failure_and_has_its_command(monkeypatch):
    for modules, _ in installation.EXTRAS.values():
        for module in modules:
            monkeypatch.setitem(sys.modules, module, None)
    for check in installation.extra_checks():
        extra = check.name.removeprefix("extra ")
        packages = [each.split(";")[0] for each in PROJECT["optional-dependencies"][extra]]
        assert check.state == "missing"
        assert check.remedy.endswith("-m pip install " + " ".join(map(repr, packages)))


def test_an_older_package_fails_with_the_command_that_brings_a_newer_one(monkeypatch):
    numbers = {"numpy": "1.25.9"}
    monkeypatch.setattr(installation, "version", lambda name: numbers.get(name, "9999"))
    wrong = [check for check in installation.dependency_checks() if check.state != "ok"]
    assert [(check.name, check.state) for check in wrong] == [("numpy", "failed")]
    assert wrong[0].detail == "1.25.9, older than 1.26"
    assert wrong[0].remedy.endswith("pip install 'numpy>=1.26'")


def test_an_environment_of_uv_has_no_pip(monkeypatch):
    monkeypatch.setitem(sys.modules, "pip", None)
    monkeypatch.setitem(sys.modules, "svgelements", None)
    (check,) = (each for each in installation.extra_checks() if each.name == "extra svg")
    assert check.remedy == f"uv pip install --python {sys.executable} 'svgelements>=1.9'"


def test_a_machine_without_programs_is_told_their_packages(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    checks = list(installation.program_checks())
    assert [check.name for check in checks] == list(PROGRAMS)
    assert {check.state for check in checks} == {"missing"}
    assert all(check.remedy.startswith("apt-get install ") for check in checks)
    compiler = tmp_path / "my-cc"
    compiler.write_text("#!/bin/sh\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", "my-cc")
    assert states(installation.program_checks())["C compiler"] == "ok"


def test_a_folder_that_cannot_be_written_to_fails(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "new"))
    assert set(states(installation.folder_checks()).values()) == {"ok"}
    assert not list(tmp_path.iterdir())
    # Nobody can, not even root.
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/self")
    monkeypatch.chdir("/proc/self")
    assert set(states(installation.folder_checks()).values()) == {"failed"}


@pytest.mark.long
def test_it_answers_where_drake_cannot_be_imported(tmp_path):
    """As in a slim container: the library is named, with the command that brings it."""
    (tmp_path / "pydrake").mkdir()
    missing = "libglib-2.0.so.0: cannot open shared object file: No such file or directory"
    (tmp_path / "pydrake" / "__init__.py").write_text(f"raise ImportError({missing!r})")
    paths = os.pathsep.join((str(tmp_path), str(ROOT)))
    done = doctor("--json", PYTHONPATH=paths)
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    failed = [check for check in report["checks"] if check["state"] == "failed"]
    assert not report["works"]
    assert {check["name"] for check in failed} == {"a run of 0.1 s", "its playback"}
    assert "apt-get install libglib2.0-0" in failed[0]["detail"]


@pytest.mark.long
def test_without_extras_it_works_and_says_all_that_is_missing():
    modules = [module for modules, _ in installation.EXTRAS.values() for module in modules]
    blocked = f"import sys; sys.modules.update(dict.fromkeys({modules}))"
    done = doctor("--json", code=blocked)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    found = {check["name"]: check["state"] for check in report["checks"]}
    assert report["works"]
    assert {name for name, state in found.items() if state == "missing"} >= {
        f"extra {name}" for name in installation.EXTRAS
    }
    assert found["a run of 0.1 s"] == found["its playback"] == "ok"
    table = doctor(code=blocked)
    assert table.returncode == 0
    assert all(name in table.stdout for name in found)
