"""The command line, as a user meets it."""

import json
import math
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from typer.testing import CliRunner

from drake_rnn import Result, SimultaneousLearning, shipped_experiments
from drake_rnn.cli.commands import app
from drake_rnn.models import MODELS
from drake_rnn.runs import simulation

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


@pytest.fixture
def drawn():
    """For tests in which figures are drawn; it takes seconds."""


@pytest.fixture(autouse=True)
def undrawn(request, monkeypatch):
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr("drake_rnn.cli.saving.draw_figures", lambda result, folder: [])


@pytest.fixture
def breaks(monkeypatch):
    """A law whose numbers end at a time."""

    def at(when):
        step = SimultaneousLearning.step

        def broken(self, t, x, u, period):
            x = step(self, t, x, u, period)
            return x * math.nan if t >= when - 1e-9 else x

        monkeypatch.setattr(SimultaneousLearning, "step", broken)

    return at


# What it writes.


def test_list_shows_every_experiment():
    result = call("list")
    assert result.exit_code == 0
    for name in shipped_experiments():
        assert name in result.stdout
    for column in ("name", "paper", "arm", "law", "level", "what to expect"):
        assert column in result.stdout


def test_arm_shows_what_a_shipped_arm_is(tmp_path):
    result = call("arm", "planar6", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    for text in ("joint6", "unknown", "home: [0.261799, ", "planar6/limits.yaml", "yes"):
        assert text in result.stdout
    assert result.stderr.startswith("warning acceleration: not known for all joints")
    assert (tmp_path / "planar6.png").stat().st_size > 5000


def test_arm_proposes_a_home_that_runs(tmp_path):
    """What it prints is pasted into an experiment; there is a tool, and a joint is locked."""
    model = MODELS / "ur5" / "ur5.urdf"
    tool, lock = "{length: 0.15, mass: 0.3}", "lock={wrist_3_joint: 0.5}"
    arguments = ("--frame", "tool0", "--tool", tool, "--set", lock, "--set", "mass_scale=1.0")
    result = call("arm", model, *arguments, "--no-picture", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "0.3 kg on tool0, ball of 12 mm at tip" in result.stdout
    home = re.search(r"home, proposed +(home: \[.*\])", result.stdout)[1]
    file = tmp_path / "mine.yaml"
    file.write_text(
        f"arm: {{model: {model}, frame: tool0, tool: {tool}, lock: {{wrist_3_joint: 0.5}}, "
        f"{home}}}\npath: {{kind: circle, size: 0.02, period: 4}}\nlaw: {{kind: pseudoinverse}}\n"
        "period: 1e-3\nduration: 0.1\n"
    )
    assert call("run", file, "--out", tmp_path, "--no-playback").exit_code == 0
    assert metrics(tmp_path / "mine")["position_error_max_m"] < 1e-3
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("pandas",), "arm: no arm 'pandas'; nearest: panda"),
        (("panda", "--tool", "{bal: 1}"), "arm.tool.bal: no such key; nearest: ball"),
        (("panda", "--tool", "{ball: "), "--tool: not a YAML document: line 1"),
        (("panda", "--frame", "hand"), "arm.frame: no frame 'hand' in panda.urdf"),
        (("panda", "--set", "hom=[0]"), "arm.hom: no such key; nearest: home"),
        (
            ("panda", "--set", "home"),
            "--set: must be KEY=VALUE, or KEY=null to remove a key, not 'home'",
        ),
        (("panda", "--set", "limits=no.yaml"), "arm.limits: no file 'no.yaml'"),
        ((MODELS / "ur5" / "ur5.urdf",), "arm.frame: must be given"),
    ],
)
def test_an_arm_that_cannot_be_is_one_sentence(tmp_path, arguments, message):
    result = call("arm", *arguments, "--out", tmp_path / "out")
    assert sentence(result).startswith(message)
    assert not (tmp_path / "out").exists()


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


def test_a_run_can_be_shown_beside_another(tmp_path, drawn):
    """Both are run; the one asked for has the other in its playback."""
    result = call("run", KNOWN, "--beside", LEARNED, "--out", tmp_path, *SHORT)
    assert result.exit_code == 0
    both, one = ((tmp_path / name / "playback.html").read_text() for name in (KNOWN, LEARNED))
    assert f"<title>{KNOWN} beside {LEARNED}</title>" in both
    assert f"<title>{LEARNED}</title>" in one


def test_a_run_beside_itself_is_refused(tmp_path):
    result = call("run", KNOWN, "--beside", KNOWN, "--out", tmp_path, *SHORT)
    assert "two experiments are called" in sentence(result)


def test_beside_without_a_playback_is_refused(tmp_path):
    result = call("run", KNOWN, "--beside", LEARNED, "--no-playback", "--out", tmp_path, *SHORT)
    assert sentence(result).startswith("--beside: shows paths in a playback")
    result = call("run", KNOWN, "--beside", LEARNED, "--series", "none", "--out", tmp_path)
    assert sentence(result) == "--beside: shows paths, and --series none stores none"


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
    assert "warning path: asks panda_joint" in result.stderr


def notes(result):
    return [line for line in result.stdout.splitlines() if line.startswith("note ")]


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


def test_a_sweep_tells_of_windows_that_are_dropped(tmp_path):
    result = call("sweep", KNOWN, "--over", "duration=0.01,0.02", "--out", tmp_path)
    assert [note.split(" at ")[1] for note in notes(result)] == ["0.01 s", "0.02 s"]


# The same again.


def test_what_a_run_has_written_runs_again_to_the_same_numbers(tmp_path):
    """Bit for bit."""
    first = run(tmp_path / "a", "--duration", 0.02, "--seed", 5, experiment=LEARNED)
    result = call("run", first / "experiment.yaml", "--out", tmp_path / "b", "--no-playback")
    assert result.exit_code == 0, result.stderr
    second = tmp_path / "b" / LEARNED
    assert_same_series(first, second)
    assert metrics(first) == metrics(second)
    assert (first / "experiment.yaml").read_text() == (second / "experiment.yaml").read_text()


def test_a_seed_gives_the_same_numbers_again_and_in_another_process(tmp_path):
    """Bit for bit; and a run in a pipe has nothing to say on stderr."""
    arguments = ("--duration", "0.02", "--seed", "5")
    first = run(tmp_path / "a", *arguments, experiment=LEARNED)
    second = run(tmp_path / "b", *arguments, experiment=LEARNED)
    command = [sys.executable, "-m", "drake_rnn", "run", LEARNED, "--no-playback", *arguments]
    process = subprocess.run(
        [*command, "--out", tmp_path / "c"], capture_output=True, text=True, check=True
    )
    assert process.stderr == ""
    third = tmp_path / "c" / LEARNED
    assert metrics(first) == metrics(second) == metrics(third)
    assert_same_series(first, second)
    assert_same_series(first, third)
    other = run(tmp_path / "d", "--duration", 0.02, "--seed", 6, experiment=LEARNED)
    assert metrics(other) != metrics(first)


# Bad input.


@pytest.fixture
def simulated(monkeypatch):
    """Whether anything has been simulated."""
    times = []
    simulator = simulation.Simulator

    def watched(diagram):
        times.append(1)
        return simulator(diagram)

    monkeypatch.setattr(simulation, "Simulator", watched)
    return times


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("slc_nefroid",), "experiment: no experiment 'slc_nefroid'; nearest: slc_nephroid"),
        (("nowhere.yaml",), "nowhere.yaml: No such file or directory"),
        ((KNOWN, "--set", "law.kapa=1"), "law.kapa: no such key; nearest: kappa"),
        (
            (KNOWN, "--set", "law.kappa"),
            "--set: must be KEY=VALUE, or KEY=null to remove a key, not 'law.kappa'",
        ),
        ((KNOWN, "--set", "law.kappa=[1"), "--set law.kappa: not a YAML document: line 1"),
        ((KNOWN, "--set", "law.kappa=-1"), "law.kappa: must be greater than 0, not -1"),
        ((KNOWN, "--set", "law.kappa=[nan, 1]"), "law.kappa: must be a number, not ['nan', 1]"),
        ((KNOWN, "--set", "law.kappa=[.nan, 1]"), "law.kappa: must be a number, not [nan, 1]"),
        ((KNOWN, "--set", "law.kappa='[/red]'"), "law.kappa: must be a number, not '[/red]'"),
        ((KNOWN, "--duration", "-1"), "duration: must be greater than 0, not -1"),
        ((KNOWN, "--set", "path.size=2"), "path: out of reach: panda misses the point ("),
        ((KNOWN, LEARNED, "--set", "law.jacobian=known"), f"{LEARNED}: dither: must be left"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_runs(tmp_path, simulated, arguments, message):
    result = call("run", *arguments, "--out", tmp_path / "out")
    assert sentence(result).startswith(message)
    assert not simulated
    assert not list(tmp_path.rglob("*.json"))


def test_usage_that_makes_no_sense_ends_with_2(tmp_path):
    for arguments in (("run",), ("walk",), ("run", KNOWN, "--seed", "-1"), ("sweep", KNOWN)):
        assert call(*arguments).exit_code == 2


def test_a_path_out_of_reach_is_told_before_another_experiment_runs(tmp_path, simulated):
    mine = run(tmp_path / "a", *SHORT) / "experiment.yaml"
    simulated.clear()
    far = tmp_path / "far.yaml"
    far.write_text(
        mine.read_text()
        .replace(f"name: {KNOWN}", "name: far")
        .replace("size: 0.04", "size: 2")
        .replace("duration: 0.05", "duration: 1")
    )
    result = call("run", mine, far, "--out", tmp_path / "b", "--no-playback")
    assert sentence(result).startswith("far: path: out of reach")
    assert not simulated


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_runs(tmp_path, simulated):
    (tmp_path / "file").write_text("here")
    message = sentence(call("run", KNOWN, *SHORT, "--out", tmp_path / "file"))
    assert "file" in message
    assert "Not a directory" in message
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / KNOWN).write_text("here")
    message = sentence(call("run", KNOWN, *SHORT, "--out", tmp_path / "out", "--no-playback"))
    assert KNOWN in message
    assert not simulated
    assert (tmp_path / "out" / KNOWN).read_text() == "here"


# Runs that fail.


def test_a_run_that_fails_saves_what_there_was_and_names_the_time(tmp_path, breaks, drawn):
    breaks(0.03)
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT)
    assert result.exit_code == 1
    assert "Traceback" not in result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith("failed controller: ")
    assert line.endswith("is no longer finite (at t = 0.03 s)")
    until_then = Result.load(tmp_path / KNOWN)
    np.testing.assert_allclose(until_then.time, [0, 0.01, 0.02, 0.03], atol=1e-12)
    assert np.isfinite(until_then.series["position"]).all()
    assert until_then.metrics["joint_velocity_max_rad_s"] > 0
    assert list((tmp_path / KNOWN / "figures").iterdir())


def test_a_law_that_fails_at_once_is_refused_before_anything_runs(tmp_path, breaks, simulated):
    breaks(0.0)
    message = sentence(call("run", KNOWN, "--out", tmp_path, *SHORT))
    assert message.startswith("SimultaneousLearning.step: must return finite numbers, not [nan, ")
    assert message.endswith("(at t = 0 s)")
    assert not simulated


def test_after_a_run_that_fails_the_others_run(tmp_path, breaks):
    breaks(0.03)
    text = (run(tmp_path / "a", "--duration", 0.02) / "experiment.yaml").read_text()
    for name, duration in {"broken": 0.05, "calm": 0.02}.items():
        changed = text.replace(f"name: {KNOWN}", f"name: {name}")
        changed = changed.replace("duration: 0.02", f"duration: {duration}")
        (tmp_path / f"{name}.yaml").write_text(changed)
    files = [tmp_path / "broken.yaml", tmp_path / "calm.yaml"]
    result = call("run", *files, "--out", tmp_path / "b", "--no-playback")
    assert result.exit_code == 1
    assert Result.load(tmp_path / "b" / "broken").time[-1] == pytest.approx(0.03)
    assert Result.load(tmp_path / "b" / "calm").time[-1] == pytest.approx(0.02)


# Sweeps.


def test_sweep_writes_a_table_and_a_picture(tmp_path):
    over = ("--over", "law.kappa=2,8")
    result = call("sweep", KNOWN, *over, "--out", tmp_path, *SHORT)
    assert result.exit_code == 0, result.stderr
    (folder,) = tmp_path.iterdir()
    assert {path.name for path in folder.iterdir()} == {"sweep.csv", "sweep.png"}
    header, first, second = (folder / "sweep.csv").read_text().splitlines()
    assert header.startswith("law.kappa,position_error_max_m,")
    assert first.startswith("2,")
    assert second.startswith("8,")
    assert "law.kappa" in result.stdout
    assert "sweep.csv" in result.stdout
    # In a pipe it is one table, however many columns it has.
    assert result.stdout.count("law.kappa  ") == 1


def test_a_sweep_in_which_a_run_fails_ends_with_1_and_shows_the_others(tmp_path, breaks):
    breaks(0.03)
    result = call("sweep", KNOWN, "--over", "duration=0.02,0.05", "--out", tmp_path)
    assert result.exit_code == 1
    assert "failed" in result.stdout
    assert "duration=0.05: controller: " in result.stderr
    assert "is no longer finite (at t = 0.03 s)" in result.stderr
    (table,) = tmp_path.rglob("sweep.csv")
    assert len(table.read_text().splitlines()) == 3


def test_bad_input_to_a_sweep_is_one_sentence_and_nothing_runs(tmp_path, simulated):
    for over, message in (
        (["law.kappa"], "--over: must be KEY=v1,v2,..., not 'law.kappa'"),
        (["law.kappa=1,-1"], "law.kappa: must be greater than 0, not -1"),
        (["law.kapa=1"], "law.kapa: no such key; nearest: kappa"),
        (["seed=1", "seed=2"], "--over"),
    ):
        options = [part for axis in over for part in ("--over", axis)]
        result = call("sweep", KNOWN, *options, "--out", tmp_path, *SHORT)
        assert sentence(result).startswith(message)
    assert not simulated


def test_a_run_to_a_target_shows_every_joint(tmp_path):
    changes = ("--duration", "0.05", "--no-playback")
    result = call("run", "null_space_adjustment", "--out", tmp_path, *changes)
    assert result.exit_code == 0
    for text in ("start [rad]", "target [rad]", "|error| [rad]", "iiwa_joint_7", "1.5708"):
        assert text in result.stdout


# What scripts rely on.


def statuses(folder):
    return {file.parent.name: json.loads(file.read_text()) for file in folder.rglob("run.json")}


@pytest.mark.parametrize(("bound", "code"), [(1.0, 0), (1e-9, 3)])
def test_with_check_a_bound_that_is_not_kept_ends_with_3(tmp_path, bound, code):
    accept = f"accept={{position_error_max_m: {{at_most: {bound}}}}}"
    options = ("--duration", "0.05", "--set", "window=null", "--set", accept, "--out", tmp_path)
    result = call("run", KNOWN, "--no-playback", "--check", *options)
    assert result.exit_code == code
    assert call("run", KNOWN, "--no-playback", *options).exit_code == 0
    assert statuses(tmp_path)[KNOWN]["accept"]["position_error_max_m"]["met"] is (code == 0)
    result = call("sweep", KNOWN, "--over", "law.kappa=4", "--check", *options)
    assert result.exit_code == code


def test_a_queue_that_is_cut_names_what_was_not_run(tmp_path, monkeypatch):
    def interrupt(self, context):
        if context.get_time() > 0.02:
            raise KeyboardInterrupt

    monkeypatch.setattr(simulation.Recorder, "__call__", interrupt)
    names = ("pinv_line", "pinv_line_ur5", "pinv_csv")
    result = call("run", *names, "--no-playback", "--out", tmp_path, "--duration", "0.1")
    assert result.exit_code == 1
    assert "not run pinv_line_ur5, pinv_csv" in result.stderr
    assert statuses(tmp_path)["pinv_line"]["status"] == "interrupted"


def test_a_terminated_run_keeps_what_it_had(tmp_path):
    """As Ctrl-C does; the folder says that the run was interrupted."""
    command = [sys.executable, "-m", "drake_rnn", "run", KNOWN, "--no-playback"]
    process = subprocess.Popen(
        [*command, "--duration", "3000", "--out", tmp_path], stderr=subprocess.PIPE, text=True
    )
    # Its folder is made just before it runs.
    while not (tmp_path / KNOWN).exists() and process.poll() is None:
        time.sleep(0.1)
    time.sleep(2.0)
    process.terminate()
    _, said = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "failed interrupted (at t = " in said
    record = statuses(tmp_path)[KNOWN]
    assert record["status"] == "interrupted"
    assert 0.0 < record["until_s"] < 3000.0
    assert Result.load(tmp_path / KNOWN).time[-1] == record["until_s"]


def test_a_run_without_series_has_its_metrics_and_neither_figures_nor_playback(tmp_path):
    full = run(tmp_path / "full", *SHORT)
    result = call("run", KNOWN, *SHORT, "--series", "none", "--out", tmp_path)
    assert result.exit_code == 0
    assert "figures   none" in result.stdout
    assert metrics(tmp_path / KNOWN) == metrics(full)
    files = {file.name for file in (tmp_path / KNOWN).rglob("*") if file.is_file()}
    assert not {name for name in files if name.endswith((".png", ".html"))}
    assert Result.load(tmp_path / KNOWN).time.size == 1
