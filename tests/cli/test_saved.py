"""Commands about results that are there already, alone and side by side."""

import csv
import dataclasses
import json

import pytest
from typer.testing import CliRunner

from drake_rnn import Result, simulate
from drake_rnn.cli.commands import app
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import Paper
from drake_rnn.figures.comparison import compared_figure
from drake_rnn.jobs.requests import RunRecord
from drake_rnn.runs.result import stop, value_text

SHORT = {"duration": 0.05, "window": [0, 0.05], "accept": None}
KNOWN, LINE = "slc_nephroid_known", "pinv_line"


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def sentence(result):
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    (line,) = result.stderr.splitlines()
    return line.removeprefix("error ")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Saved results of two short runs."""
    place = tmp_path_factory.mktemp("saved")
    for name in (KNOWN, LINE):
        simulate(load_experiment(name, SHORT)).save(place / name)
    return place


# Side by side.


def test_folders_are_compared(folders, tmp_path):
    result = call("compare", folders / KNOWN, folders / LINE, "--out", tmp_path)
    assert result.exit_code == 0, (result.stderr, result.exception)
    (folder,) = tmp_path.iterdir()
    assert folder.name == f"compare_{KNOWN}_{LINE}"
    assert {file.name for file in folder.iterdir()} == {"comparison.csv", "comparison.png"}
    with (folder / "comparison.csv").open() as stream:
        rows = {row["run"]: row for row in csv.DictReader(stream)}
    for name in (KNOWN, LINE):
        saved = Result.load(folders / name).metrics
        assert float(rows[name]["position_error_max_m"]) == saved["position_error_max_m"]
        (line,) = [line for line in result.stdout.splitlines() if "position_error_max_m" in line]
        assert value_text("position_error_max_m", saved["position_error_max_m"]) in line
    # A law that keeps a limit by construction has its bound beside the figure.
    assert "(≤ 1)" in result.stdout
    # As a run has it.
    (line,) = [each for each in result.stdout.splitlines() if "velocity_violation_max" in each]
    assert line.split()[1:] == ["none", "none"]


def test_a_comparison_can_be_read_by_a_script_and_only_planned(folders, tmp_path):
    arguments = ("compare", folders / LINE, KNOWN, "--duration", "0.05", "--out", tmp_path)
    refused = call(*arguments)
    assert "is a saved result" in sentence(refused)
    arguments = ("compare", folders / LINE, KNOWN, "--out", tmp_path)
    plan = json.loads(call(*arguments, "--dry-run", "--json").stdout)
    assert plan["expected_time_s"][LINE] == 0.0
    assert plan["expected_time_s"][KNOWN] > 0.1
    assert not list(tmp_path.iterdir())
    found = json.loads(
        call("compare", folders / LINE, folders / KNOWN, "--out", tmp_path, "--json").stdout
    )
    assert found.keys() == {LINE, KNOWN}
    assert found[KNOWN]["status"] == "complete"
    assert found[KNOWN]["metrics"] == Result.load(folders / KNOWN).metrics


def test_an_experiment_is_run_and_compared_with_a_folder(folders, tmp_path):
    """Its own document with another gain; both are called alike, so they are named as given."""
    arguments = (KNOWN, folders / KNOWN, "--out", tmp_path)
    file = tmp_path / "slow.yaml"
    text = (folders / KNOWN / "experiment.yaml").read_text()
    file.write_text(text.replace("kappa: 4", "kappa: 1"))
    result = call("compare", file, *arguments[1:])
    assert result.exit_code == 0, (result.stderr, result.exception)
    (table,) = tmp_path.rglob("comparison.csv")
    with table.open() as stream:
        assert {row["run"] for row in csv.DictReader(stream)} == {str(file), str(folders / KNOWN)}


@pytest.mark.parametrize(("bound", "code"), [(1.0, 0), (1e-15, 3)])
@pytest.mark.long
def test_check_looks_at_all_that_are_compared(folders, tmp_path, bound, code):
    text = (folders / LINE / "experiment.yaml").read_text()
    file = tmp_path / "strict.yaml"
    accept = f"accept: {{position_error_max_m: {{at_most: {bound}}}}}\n"
    file.write_text(text.replace(f"name: {LINE}", "name: strict") + accept)
    arguments = ("compare", file, folders / KNOWN, "--out", tmp_path / "out")
    result = call(*arguments, "--check")
    assert result.exit_code == code
    assert ("† (≤ 1e-06 nm)" in result.stdout) is (code == 3), result.stdout
    assert call(*arguments).exit_code == 0


def test_what_was_interrupted_is_compared_as_far_as_it_came(folders, tmp_path):
    part = stop(Result.load(folders / LINE), "interrupted", "interrupted at 0.05 s")
    part.save(tmp_path / "part")
    result = call("compare", tmp_path / "part", folders / KNOWN, "--out", tmp_path / "out")
    assert result.exit_code == 1, (result.stderr, result.exception)
    with (tmp_path / "out" / f"compare_{LINE}_{KNOWN}" / "comparison.csv").open() as stream:
        rows = {row["run"]: row for row in csv.DictReader(stream)}
    assert (rows[LINE]["failure"], rows[KNOWN]["failure"]) == ("interrupted at 0.05 s", "")
    assert rows[LINE]["position_error_max_m"]


def test_a_run_that_failed_is_never_the_better_one(folders, tmp_path):
    """Its metrics are of the part of the run before its errors grew."""
    good = Result.load(folders / KNOWN)
    metrics = {**good.metrics, "position_error_max_m": 1e-12}
    failed = stop(dataclasses.replace(good, metrics=metrics), "failed", "v is no longer finite")
    assert good.verdicts
    assert all(verdict.met for verdict in good.verdicts)
    assert not any(verdict.met or verdict.judged for verdict in failed.verdicts)
    assert not any(RunRecord.of_result(failed).kept.values())
    assert repr(failed).endswith("bounds not judged>")
    failed.save(tmp_path / "failed")
    tables = [tmp_path / f"table{suffix}" for suffix in (".md", ".tex", ".csv")]
    options = (word for file in tables for word in ("--table", file))
    runs = (folders / LINE, tmp_path / "failed")
    result = call("compare", *runs, "--out", tmp_path / "out", *options)
    assert result.exit_code == 1, (result.stderr, result.exception)
    assert "failed at t = 0.05 s: v is no longer finite" in result.stderr
    (line,) = [line for line in result.stdout.splitlines() if "position_error_max_m" in line]
    assert line.endswith(" failed")
    for file in tables:
        text = file.read_text()
        assert "failed at t = 0.05 s" in text
        assert "1e-" not in text
    drawn = compared_figure(
        {"a": Result.load(folders / LINE), "b": failed}, ["error"], Paper("pdf", 0.2)
    )
    labels = [text.get_text() for legend in drawn.legends for text in legend.get_texts()]
    assert "b: failed at t = 0.05 s" in labels


def test_warnings_of_saved_runs_are_said_once_and_shortly(folders, tmp_path):
    results = [Result.load(folders / name) for name in (KNOWN, LINE)]
    long = "path: " + 30 * "its times begin late; "
    for result, name in zip(results, (KNOWN, LINE), strict=True):
        dataclasses.replace(result, warnings=[long, "both: short", f"{name} alone"]).save(
            tmp_path / name
        )
    said = call("compare", tmp_path / KNOWN, tmp_path / LINE, "--out", tmp_path / "out").stderr
    both = f"warning {KNOWN}, {LINE}: "
    assert said.splitlines() == [
        f"{both}{long[:99].rstrip()}…", f"{both}both: short",
        f"warning {KNOWN}: {KNOWN} alone", f"warning {LINE}: {LINE} alone",
    ]  # fmt: skip


def test_what_cannot_be_compared_is_one_sentence(folders, tmp_path):
    out = ("--out", tmp_path / "out")
    assert "needs two runs" in sentence(call("compare", LINE, *out))
    assert "pinv_line is given twice" in sentence(call("compare", LINE, LINE, *out))
    changed = call("compare", folders / LINE, KNOWN, "--set", "law.damping=1", *out)
    assert sentence(changed).startswith("law.damping: ")
    assert "no experiment 'pinv_lime'" in sentence(call("compare", LINE, "pinv_lime", *out))
    assert not (tmp_path / "out").exists()


# Again.


def test_figures_are_drawn_again(folders):
    result = call("plot", folders / LINE, "--only", "overview")
    assert result.exit_code == 0, (result.stderr, result.exception)
    (file,) = (folders / LINE / "figures").iterdir()
    assert file.name == "overview.png"
    assert str(file) in result.stdout
    wrong = sentence(call("plot", folders / LINE, "--only", "overwiew"))
    assert wrong == "--only: no figure 'overwiew'; nearest: overview"
    assert "holds no result" in sentence(call("plot", folders))


def test_a_playback_is_written_again(folders):
    result = call("replay", folders / LINE, "--beside", folders / KNOWN)
    assert result.exit_code == 0, (result.stderr, result.exception)
    page = (folders / LINE / "playback.html").read_text()
    assert f"<title>{LINE} beside {KNOWN}</title>" in page


# For print.


@pytest.mark.long
def test_tables_and_figures_of_a_comparison_are_for_print(folders, tmp_path):
    tex, page = tmp_path / "paper" / "table.tex", tmp_path / "paper" / "table.md"
    result = call(
        *("compare", folders / KNOWN, folders / LINE, "--out", tmp_path, "--labels", "SLC,PINV"),
        *("--metrics", "position_error_max_m,joint_velocity_max_rad_s"),
        *("--table", tex, "--table", page, "--format", "pdf", "--width", "88mm"),
    )
    assert result.exit_code == 0, (result.stderr, result.exception)
    (folder,) = [each for each in tmp_path.iterdir() if each.name.startswith("compare_")]
    assert {file.name for file in folder.iterdir()} == {"comparison.csv", "comparison.pdf"}
    assert "joint_velocity_max_rad_s" in result.stdout
    assert "settling_time_s" not in result.stdout
    head, rule, *rows = page.read_text().splitlines()
    assert (head, rule) == ("| metric | SLC | PINV |", "|---|---:|---:|")
    assert [row.split(" [")[0] for row in rows] == ["| position error max", "| joint velocity max"]
    assert r"metric & SLC & PINV \\" in tex.read_text()


def test_one_figure_of_several_runs(folders, tmp_path):
    runs = ("figure", "compare", folders / KNOWN, folders / LINE)
    file = tmp_path / "new" / "figure.svg"
    result = call(*runs, "--panels", "error,velocity", "--width", "180mm", "--to", file)
    assert result.exit_code == 0, (result.stderr, result.exception)
    assert 'width="510.' in file.read_text()
    for options, message in (
        (("--panels", "eror"), "panels: no 'eror'; nearest: error"),
        (("--width", "88"), "width: must be a length such as 88mm"),
        (("--to", tmp_path / "x.jpg"), "x.jpg: must end in one of .png, .pdf, .svg"),
        (("--labels", "one"), "--labels: must have one name for each of 2 runs, not 1"),
        (("--labels", "a,a"), "--labels: 'a' is given twice"),
    ):
        assert message in sentence(call(*runs, *options))
    assert sentence(call("figure", "compare", folders / LINE)) == "compare: needs two runs or more"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--table", "table.doc"), "--table: table.doc: must end in one of .md, .tex, .csv"),
        (("--metrics", "position_error_m"), "--metrics: no 'position_error_m'; nearest: "),
        (("--width", "2m"), "width: must be a length"),
    ],
)
def test_what_cannot_be_printed_is_refused_before_anything_runs(options, message, tmp_path):
    for command in (("compare", KNOWN, LINE), ("sweep", KNOWN, "--over", "seed=1,2")):
        assert message in sentence(call(*command, "--out", tmp_path / "out", *options))
    assert not (tmp_path / "out").exists()
    if "--width" in options:
        assert message in sentence(call("campaign", "line_starts", *options, "--out", tmp_path))


@pytest.mark.long
def test_figures_are_drawn_again_for_print(folders):
    arguments = ("plot", folders / LINE, "--format", "pdf", "--width", "88mm", "--look", "journal")
    result = call(*arguments)
    assert result.exit_code == 0, (result.stderr, result.exception)
    assert result.stdout.startswith("note overview: not drawn, too narrow at 88mm")
    assert (folders / LINE / "figures" / "position_error.pdf").is_file()
    assert "overview needs a width of" in sentence(call(*arguments, "--only", "overview"))
