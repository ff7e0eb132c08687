"""Runs on the command line, as a user meets them."""

import json
import math
import shutil
import subprocess
import sys

import pytest
from cli_helpers import (
    KNOWN,
    LEARNED,
    SHORT,
    assert_same_series,
    call,
    metrics,
    notes,
    run,
    statuses,
)

from drake_rnn import Result

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.mark.long
def test_run_writes_a_folder_with_everything(tmp_path, drawn):
    result = call("run", KNOWN, "--out", tmp_path, *SHORT)
    assert result.exit_code == 0
    assert result.stderr == ""
    folder = tmp_path / KNOWN
    picture = {"diagram.svg"} if shutil.which("dot") else set()
    assert {path.name for path in folder.iterdir()} == picture | {
        "experiment.yaml",
        "result.npz",
        "metrics.json",
        "run.json",
        "figures",
        "playback.html",
        "diagram.dot",
    }
    figures = list((folder / "figures").iterdir())
    assert figures
    assert {path.suffix for path in figures} == {".png"}
    assert all(path.stat().st_size > 1000 for path in figures)
    assert (folder / "playback.html").stat().st_size > 100_000
    assert (folder / "diagram.dot").read_text().startswith("digraph")
    for name in metrics(folder):
        assert name in result.stdout
    for name in ("playback.html", "figures", KNOWN):
        assert name in result.stdout


@pytest.mark.long
def test_a_run_can_be_shown_beside_another(tmp_path, drawn):
    """Both are run; the one asked for has the other in its playback."""
    result = call("run", KNOWN, "--beside", LEARNED, "--out", tmp_path, *SHORT)
    assert result.exit_code == 0
    both, one = ((tmp_path / name / "playback.html").read_text() for name in (KNOWN, LEARNED))
    assert f"<title>{KNOWN} beside {LEARNED}</title>" in both
    assert f"<title>{LEARNED}</title>" in one


def test_metrics_are_one_flat_object_of_finite_numbers(tmp_path):
    found = metrics(run(tmp_path, *SHORT))
    assert found["joint_velocity_max_rad_s"] > 0
    assert all(isinstance(value, float) and math.isfinite(value) for value in found.values())


def test_the_experiment_written_says_the_versions_and_what_was_changed(tmp_path):
    folder = run(tmp_path, *SHORT, "--set", "law.kappa=8", "--seed", 3)
    text = (folder / "experiment.yaml").read_text()
    for package in ("drake-rnn", "drake", "numpy"):
        assert f"# {package} " in text
    document = Result.load(folder).experiment.document
    assert document.law["kappa"] == 8
    assert document.seed == 3
    assert document.duration == 0.05


def test_several_experiments_have_a_folder_each(tmp_path):
    names = [KNOWN, "slc_nephroid_unbounded"]
    result = call("run", *names, "--out", tmp_path, "--no-playback", *SHORT)
    assert result.exit_code == 0
    assert {path.name for path in tmp_path.iterdir()} == set(names)


def test_without_playback_no_page_is_written(tmp_path):
    assert not (run(tmp_path, *SHORT) / "playback.html").exists()


def test_warnings_of_the_path_are_told(tmp_path):
    result = call(
        "run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT, "--set", "path.period=0.05"
    )
    assert result.exit_code == 0
    assert f"warning {KNOWN}: path: asks panda_joint" in result.stderr


def test_a_window_that_is_dropped_is_told(tmp_path):
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT)
    assert notes(result) == [
        f"note {KNOWN}: window [12, 20] s and the bounds of accept are dropped: "
        "the run ends at 0.05 s"
    ]
    # It is told where it is dropped, and only there.
    assert Result.load(tmp_path / KNOWN).experiment.document.window is None
    again = call("run", tmp_path / KNOWN / "experiment.yaml", "--out", tmp_path, "--no-playback")
    assert (again.exit_code, notes(again)) == (0, [])
    kept = (*SHORT, "--set", "window=[0, 0.05]")
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *kept)
    assert (result.exit_code, notes(result)) == (0, [])


def test_a_window_is_dropped_without_what_was_expected_where_that_is_set(tmp_path):
    expected = ("--set", "accept={saturated_fraction: {at_most: 1}}")
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT, *expected)
    (note,) = notes(result)
    assert "window [12, 20] s is dropped: " in note


def test_what_a_run_has_written_runs_again_to_the_same_numbers(tmp_path):
    """Bit for bit."""
    first = run(tmp_path / "a", "--duration", 0.02, "--seed", 5, experiment=LEARNED)
    result = call("run", first / "experiment.yaml", "--out", tmp_path / "b", "--no-playback")
    assert result.exit_code == 0, result.stderr
    second = tmp_path / "b" / LEARNED
    assert_same_series(first, second)
    assert metrics(first) == metrics(second)
    assert (first / "experiment.yaml").read_text() == (second / "experiment.yaml").read_text()


@pytest.mark.long
def test_a_seed_gives_the_same_numbers_again_and_in_another_process(tmp_path):
    """Bit for bit; and a run in a pipe says on stderr only what it warns of, here of its noise."""
    arguments = ("--duration", "0.02", "--seed", "5")
    first = run(tmp_path / "a", *arguments, experiment=LEARNED)
    second = run(tmp_path / "b", *arguments, experiment=LEARNED)
    command = [sys.executable, "-m", "drake_rnn", "run", LEARNED, "--no-playback", *arguments]
    process = subprocess.run(
        [*command, "--out", tmp_path / "c"], capture_output=True, text=True, check=True
    )
    (said,) = process.stderr.splitlines()
    assert said.startswith(f"warning {LEARNED}: limits: the arm exceeds a limit of acceleration")
    third = tmp_path / "c" / LEARNED
    assert metrics(first) == metrics(second) == metrics(third)
    assert_same_series(first, second)
    assert_same_series(first, third)
    other = run(tmp_path / "d", "--duration", 0.02, "--seed", 6, experiment=LEARNED)
    assert metrics(other) != metrics(first)


def test_a_run_to_a_target_shows_every_joint(tmp_path):
    changes = ("--duration", "0.05", "--no-playback")
    result = call("run", "null_space_adjustment", "--out", tmp_path, *changes)
    assert result.exit_code == 0
    for text in ("start [rad]", "target [rad]", "|error|", " rad", "iiwa_joint_7", "1.5708"):
        assert text in result.stdout


@pytest.mark.parametrize(
    ("bound", "code"), [pytest.param(1.0, 0, marks=pytest.mark.long), (1e-9, 3)]
)
def test_with_check_a_bound_that_is_not_kept_ends_with_3(tmp_path, bound, code):
    accept = f"accept={{position_error_max_m: {{at_most: {bound}}}}}"
    options = ("--duration", "0.05", "--set", "window=null", "--set", accept, "--out", tmp_path)
    result = call("run", KNOWN, "--no-playback", "--check", *options)
    assert result.exit_code == code
    assert call("run", KNOWN, "--no-playback", *options).exit_code == 0
    assert statuses(tmp_path)[KNOWN]["accept"]["position_error_max_m"]["met"] is (code == 0)
    result = call("sweep", KNOWN, "--over", "law.kappa=4", "--check", *options)
    assert result.exit_code == code


def test_a_run_without_series_has_its_metrics_and_neither_figures_nor_playback(tmp_path):
    full = run(tmp_path / "full", *SHORT)
    result = call("run", KNOWN, *SHORT, "--series", "none", "--out", tmp_path)
    assert result.exit_code == 0
    assert "figures   none" in result.stdout
    assert metrics(tmp_path / KNOWN) == metrics(full)
    files = {file.name for file in (tmp_path / KNOWN).rglob("*") if file.is_file()}
    assert not {name for name in files if name.endswith((".png", ".html"))}
    assert Result.load(tmp_path / KNOWN).time.size == 1


def test_the_verdict_is_one_line_and_bounded_metrics_are_first(tmp_path):
    """Also where nobody looks at the table: in a pipe or a file."""
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT)
    (line,) = [each for each in result.stdout.splitlines() if each.startswith("verdict")]
    record = json.loads((tmp_path / KNOWN / "run.json").read_text())
    met = sum(verdict["met"] for verdict in record["accept"].values())
    assert f"{KNOWN}: " in line
    assert f"{met} of {len(record['accept'])} criteria met" in line
    names = [each.split()[0] for each in result.stdout.splitlines() if each.startswith("  ")]
    bounded = names[2 : 2 + len(record["accept"])]
    assert set(bounded) == set(record["accept"])
    # Nothing is padded with blanks.
    assert not any(each.endswith(" ") for each in result.stdout.splitlines())


#: A path along a surface whose normal is believed 5 degrees off: its tool goes into a spring.
WRONG_NORMAL = """
arm: {model: iiwa14, frame: tip}
path: {kind: circle, plane: xy, size: 0.03, period: 1, timing: sin2}
law: {kind: adaptive}
environment:
  kind: elastic_surface
  stiffness: 10000
  gap: 1.0e-3
  believed_normal: [0.0871557, 0, 0.9961947]
force: {kind: admittance, value: 5.0, damping: 2000.0, largest: 7.0, surface_stiffness: 10000}
limits: {velocity: 1.5, acceleration: 20.0}
period: 1.0e-3
duration: 1.0
"""


def test_a_force_beyond_its_bound_is_told_wherever_a_run_is_and_fails_the_check(tmp_path):
    """Verdict, promise, page and record; stated, the error of the normal is no excess."""
    document = tmp_path / "touch.yaml"
    document.write_text(WRONG_NORMAL)
    options = ("--check", "--no-figures", "--out", tmp_path)
    result = call("run", document, *options)
    assert result.exit_code == 3
    assert "limits broken: force" in result.stdout
    line = next(each for each in result.stdout.splitlines() if each.startswith("promise   force"))
    assert "stated, but not promised, exceeded by " in line
    rests = "no error of the believed normal (does not hold: 0.08727 rad)"
    assert rests in line
    page = (tmp_path / "touch" / "playback.html").read_text()
    assert rests in page
    record = statuses(tmp_path)["touch"]
    (force,) = (each for each in record["promises"] if each["name"] == "force")
    assert (force["of"], force["met"]) == ("stated", False)
    assert force["assumptions"][0]["actual"] == pytest.approx(math.radians(5.0), rel=1e-4)

    stated = ("force.normal_error=0.0873", "force.approach_speed=0.3", "force.acceleration=5")
    changes = [word for each in stated for word in ("--set", each)]
    result = call("run", document, *options, *changes)
    assert result.exit_code == 0
    assert "promise   force ≤ 7 N: promised of the arm, kept; rests on error of" in result.stdout
    assert "limits kept" in result.stdout
