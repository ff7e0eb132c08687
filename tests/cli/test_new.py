"""Files to start from, which run and pass as they are."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from drake_rnn.cli.commands import app
from process_helpers import PATIENCE


def new(*arguments):
    return CliRunner().invoke(app, ["new", *map(str, arguments)])


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


WRITTEN = [("law", "my_law", "MyLaw"), ("path", "figure_8", "Figure8")]
WRITTEN += [("environment", "table_2", "Table2")]


@pytest.mark.parametrize(("what", "name", "title"), WRITTEN)
def test_it_writes_what_to_start_from(here, what, name, title):
    result = new(what, name)
    assert result.exit_code == 0, result.stderr
    assert {file.name for file in here.iterdir()} == {
        "experiment.schema.json",
        f"{name}.py",
        f"{name}.yaml",
        f"test_{name}.py",
    }
    assert f'kind: "{name}:{title}"' in (here / f"{name}.yaml").read_text()


@pytest.mark.long
def test_what_it_writes_passes_its_own_tests(here, monkeypatch):
    for what, name, _ in WRITTEN:
        (here / what).mkdir()
        monkeypatch.chdir(here / what)
        assert new(what, name).exit_code == 0
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."],
        cwd=here,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert " passed" in run.stdout
    assert "warning" not in run.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    "what",
    ["law", *(pytest.param(what, marks=pytest.mark.nightly) for what in ("path", "environment"))],
)
def test_what_it_writes_keeps_what_its_document_expects(here, what):
    new(what, "mine")
    run = subprocess.run(
        [sys.executable, "-m", "drake_rnn", "run", "mine.yaml", "--no-playback", "--no-figures"],
        cwd=here,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    assert " ok" in run.stdout
    assert " no " not in run.stdout


@pytest.mark.parametrize(
    "name", ["", "My_law", "my-law", "3d", "_law", "law_", "class", "a.b", "../law", "my law"]
)
def test_a_name_must_be_that_of_a_module(here, name):
    result = new("law", name)
    assert result.exit_code == 2
    message = f"error name: must be a module's name in lower case, e.g. my_law, not {name!r}"
    assert result.stderr.splitlines() == [message]
    assert not list(here.iterdir())


def test_the_name_of_an_installed_module_is_refused(here):
    result = new("law", "numpy")
    assert result.exit_code == 2
    assert "name: there is a Python module 'numpy' already; take another" in result.stderr
    assert not list(here.iterdir())


@pytest.mark.parametrize("file", ["my_law.py", "my_law.yaml", "test_my_law.py"])
def test_nothing_is_overwritten(here, file):
    (here / file).write_text("mine")
    result = new("law", "my_law")
    assert result.exit_code == 2
    assert f"{file}: already exists, and is not overwritten" in result.stderr
    assert [each.name for each in here.iterdir()] == [file]
    assert (here / file).read_text() == "mine"
