"""A law of a user's own module: run by YAML, swept, saved and loaded, in fresh processes."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate, sweep
from drake_rnn.signals import RESERVED_NAMES
from process_helpers import PATIENCE

EXAMPLES = Path(__file__).parents[2] / "examples"
FILTER = "filter={kind: moving_average, precompensate: true}"
SHORT = ("--duration", "0.5")

# As the installed command: a script in a folder of its own, whose folder Python looks into first.
SCRIPT = """
from drake_rnn.cli import saving, starting

saving.draw_figures = lambda result, folder: []
if __name__ == "__main__":
    starting.main()
"""


@pytest.fixture
def folder(tmp_path):
    """A fresh folder with the example's law and document."""
    for name in ("own_law.py", "own_law.yaml"):
        shutil.copy(EXAMPLES / name, tmp_path)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "command.py").write_text(SCRIPT)
    return tmp_path


def python(folder, *arguments):
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def command(folder, *arguments):
    return python(folder, "bin/command.py", *arguments)


@pytest.mark.parametrize(
    ("changes", "bound"),
    [
        pytest.param([], 1e-4, marks=pytest.mark.long),
        pytest.param(["--set", "level=dynamic"], 1e-3, marks=pytest.mark.long),
        pytest.param(
            ["--set", FILTER, "--set", "feedback=unfiltered"], 1e-3, marks=pytest.mark.long
        ),
    ],
    ids=["kinematic", "dynamic", "filter"],
)
def test_it_runs_by_yaml_in_a_fresh_folder(folder, changes, bound):
    run = command(folder, "run", "own_law.yaml", "--no-playback", *SHORT, *changes)
    assert run.returncode == 0, run.stderr
    metrics = json.loads((folder / "out" / "own_law" / "metrics.json").read_text())
    assert metrics["position_error_max_m"] < bound


@pytest.mark.long
def test_its_module_is_found_beside_the_document(folder):
    (folder / "inner").mkdir()
    for name in ("own_law.py", "own_law.yaml"):
        shutil.move(folder / name, folder / "inner")
    run = command(folder, "run", "inner/own_law.yaml", "--no-playback", "--duration", "0.02")
    assert run.returncode == 0, run.stderr
    # A module that Python finds by itself is the one that is meant.
    (folder / "own_law.py").write_text("")
    run = command(folder, "run", "inner/own_law.yaml", "--dry-run")
    assert "the module 'own_law' has no 'DampedLeastSquares'" in run.stderr


@pytest.mark.long
def test_its_keys_are_explained(folder):
    run = command(folder, "laws", "own_law:DampedLeastSquares")
    assert "Gain of the position error" in run.stdout, run.stderr


@pytest.mark.long
def test_it_is_swept_in_processes_of_their_own(folder):
    over = ("--over", "law.gain=5,10")
    run = command(folder, "sweep", "own_law.yaml", *over, "--jobs", "2", *SHORT)
    assert run.returncode == 0, run.stderr
    (table,) = (folder / "out").rglob("sweep.csv")
    header, *rows = table.read_text().splitlines()
    assert header.startswith("law.gain,")
    assert [row.split(",")[0] for row in rows] == ["5", "10"]
    assert all(row.endswith(",") for row in rows), "no failure"


def test_a_module_that_is_missing_is_one_sentence(folder):
    (folder / "own_law.py").unlink()
    run = command(folder, "run", "own_law.yaml", *SHORT)
    assert run.returncode == 2
    (line,) = run.stderr.splitlines()
    assert line.startswith("error law.kind: there is no module 'own_law' where Python looks")


@pytest.fixture(scope="module")
def saved(tmp_path_factory, laws_as_before):
    """The folder of a saved run, of a law that this process knows."""
    folder = tmp_path_factory.mktemp("saved")
    sys.path.insert(0, str(EXAMPLES))
    try:
        experiment = load_experiment(EXAMPLES / "own_law.yaml", {"duration": 0.02, "accept": None})
        simulate(experiment).save(folder)
    finally:
        sys.path.remove(str(EXAMPLES))
    yield folder
    # What is imported again registers its law again.
    del sys.modules["own_law"]


# One process for all that is given; what one load imports is not there for the next one.
LOAD = """
import sys
from drake_rnn import Result

for modules in {}:
    law = Result.load(sys.argv[1], modules=modules).experiment.law
    print(type(law).__name__, sys.modules.pop("own_law", None) is not None)
"""


@pytest.mark.long
def test_a_saved_run_is_loaded_where_its_module_can_be_imported(folder, saved):
    run = python(folder, "-c", LOAD.format([["own_law"], True]), saved)
    assert run.stdout.split() == 2 * ["DampedLeastSquares", "True"], run.stderr


@pytest.mark.long
def test_its_module_is_not_imported_unless_told_to(folder, saved):
    (folder / "own_law.py").write_text("print('imported')")
    run = python(folder, "-W", "always", "-c", LOAD.format([False, ["other"]]), saved)
    assert run.stdout.split() == 2 * ["DampedLeastSquares", "False"]
    assert run.stderr.count("is imported only when told to") == 2
    # Python 3.13 shows the line that warns below it.
    said = (
        "law.kind: is in the module 'own_law', which is imported only when told to: give "
        "modules=['own_law'], or modules=True; the saved numbers suffice to show the run"
    )
    assert run.stderr.count(f"{said}\n") == 2


@pytest.mark.long
def test_where_its_module_is_missing_that_is_said(folder, saved):
    (folder / "own_law.py").unlink()
    run = python(folder, "-c", LOAD.format([True]), saved)
    assert "law.kind: there is no module 'own_law' where Python looks" in run.stderr
    assert run.stdout.split() == ["DampedLeastSquares", "False"]


def test_a_process_that_knows_the_module_needs_no_permission(saved):
    assert type(Result.load(saved).experiment.law).__name__ == "DampedLeastSquares"


REGISTERED = """
from drake_rnn import LAWS, Result, make_experiment, sweep, validated
from drake_rnn.laws import Pseudoinverse

@validated
class Renamed(Pseudoinverse):
    pass

LAWS["renamed"] = Renamed
DOCUMENT = {"name": "x", "arm": "panda", "path": {"kind": "circle", "size": 0.02, "period": 4},
            "law": {"kind": "renamed"}, "period": 1e-3, "duration": 0.01}
OVER = {"law.feedback": [1, 2]}
if __name__ == "__main__":
    rows = sweep(make_experiment(DOCUMENT), OVER, processes=2)
    print([row.failure for row in rows])
"""


@pytest.mark.long
def test_a_law_registered_in_a_script_is_known_to_the_processes_of_a_sweep(folder):
    (folder / "script.py").write_text(REGISTERED)
    run = python(folder, "script.py")
    assert run.stdout == "[None, None]\n", run.stderr


@pytest.mark.long
def test_one_that_other_processes_cannot_know_is_named_with_the_remedy(folder):
    """Typed in, there is no file that they could read it from."""
    run = python(folder, "-c", REGISTERED)
    assert run.stderr.splitlines()[-1].endswith(
        "one of your own is named module:Class; only this process knows it: name it so for the "
        "others, or run the sweep in one process"
    )


def test_a_sweep_takes_a_document_or_an_experiment():
    document = {
        "name": "swept",
        "arm": "panda",
        "path": {"kind": "circle", "size": 0.02, "period": 4},
        "law": {"kind": "pseudoinverse"},
        "period": 1e-3,
        "duration": 0.02,
    }
    over = {"law.feedback": [1, 5]}
    by_document = sweep(document, over)
    by_experiment = sweep(load_experiment(document), over)
    assert [row.values for row in by_document] == [(1,), (5,)]
    for one, other in zip(by_document, by_experiment, strict=True):
        assert one.metrics["position_error_max_m"] == other.metrics["position_error_max_m"]
    assert document["law"] == {"kind": "pseudoinverse"}


@pytest.mark.parametrize("changes", [["law.gain=3"], {3: 4}, "law.gain=3"])
def test_changes_must_be_a_mapping(changes):
    with pytest.raises(InvalidInputError, match=r"^changes: must be a mapping of dotted keys to"):
        load_experiment("slc_nephroid_known", changes)


def test_what_describes_no_experiment_is_refused():
    with pytest.raises(InvalidInputError, match=r"^experiment: must be of class str or .*, not 3$"):
        load_experiment(3)


@pytest.mark.parametrize("name", ["naljdf_clover", "contact_soft_pad", "null_space_adjustment"])
def test_names_of_recorded_series_are_not_free_for_laws(name):
    """So that no law's signal takes the place of another."""
    document = load_experiment(name).document
    short = {"duration": 0.02, "accept": None, "window": None}
    result = simulate(load_experiment(document, short))
    law = result.experiment.law
    reading = law.sampled(document.period) if document.period else law.continuous()
    own = {*reading.state.parts, *reading.observables.parts}
    assert result.series.keys() - own <= RESERVED_NAMES
    assert np.all([part not in RESERVED_NAMES for part in own])
