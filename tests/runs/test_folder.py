"""A run's folder is the old result, the new one, or says that it is incomplete."""

import json
import os
import signal
import sys
from dataclasses import replace

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate

SHORT = {"duration": 0.1, "window": None, "accept": None}


@pytest.fixture(scope="module")
def result():
    return simulate(load_experiment("pinv_line", SHORT))


def told(result, number):
    """A result whose metrics and series both tell which of two it is."""
    rows = result.time.size
    series = {**result.series, "mark": np.full((rows, 200), float(number))}
    # A figure alone, so that old files of a run are there to be removed.
    return replace(result, series=series, metrics={"mark": float(number)})


def saved(result, folder):
    """Save a result with a picture that tells which it is."""

    def draw(place):
        (place / "figures").mkdir(exist_ok=True)
        (place / "figures" / f"{result.metrics['mark']:g}.png").write_text("a picture")

    result.save(folder, draw)


def calls_until(work, most=None):
    """Do something, and return how many functions it calls; end at once with number `most`."""
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        if event in ("call", "c_call"):
            calls += 1
            if calls == most:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
    return calls


# JAX, where another test has loaded it, is not used by what is forked here.
@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")
@pytest.mark.long
def test_killed_at_any_moment_it_is_one_result_or_incomplete(result, tmp_path):
    """A moment is told by the number of functions called until then: it is the same every time."""
    results, folder = [told(result, number) for number in range(2)], tmp_path / "run"
    for each in results:
        saved(each, folder)
    calls = calls_until(lambda: saved(results[0], folder))
    outcomes = []
    # The first of them is nothing yet, and the last is not killed.
    for most in (*np.linspace(1, calls, 16, dtype=int)[:-1].tolist(), None):
        child = os.fork()
        if child == 0:
            try:
                saved(results[0], folder)
                calls_until(lambda: saved(results[1], folder), most)
            finally:
                os._exit(0)
        assert os.waitpid(child, 0)[1] == (0 if most is None else signal.SIGKILL)
        try:
            loaded = Result.load(folder)
        except InvalidInputError as error:
            assert "is incomplete" in str(error)  # noqa: PT017  either outcome is right
            outcomes.append("incomplete")
            continue
        number = loaded.metrics["mark"]
        assert (loaded.series["mark"] == number).all()
        pictures = {file.stem for file in (folder / "figures").glob("*")}
        assert pictures <= {f"{number:g}"}
        outcomes.append(number)
    assert (outcomes[0], outcomes[-1]) == (0.0, 1.0)
    assert set(outcomes) == {0.0, "incomplete", 1.0}


def test_files_of_another_run_go_and_a_users_own_stay(result, tmp_path):
    result.save(tmp_path)
    (tmp_path / "figures").mkdir()
    for name in ("playback.html", "figures/old.png", "notes.txt"):
        (tmp_path / name).write_text("text")
    replace(result, graphviz="").save(tmp_path)
    files = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*") if file.is_file()}
    assert files == {"experiment.yaml", "result.npz", "metrics.json", "run.json", "notes.txt"}


def test_the_record_says_what_a_run_came_to(result, tmp_path):
    result.save(tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "complete"
    assert record["until_s"] == record["duration_s"] == 0.1
    assert set(record["versions"]) == {"drake-rnn", "drake", "numpy"}
    assert set(record["timings"]) == {"real_time_factor", "wall_time_s", "control_step_us"}
    loaded = Result.load(tmp_path)
    assert (loaded.status, loaded.warnings, loaded.timings) == (
        "complete",
        result.warnings,
        result.timings,
    )


def test_verdicts_are_in_the_record(tmp_path):
    accept = {
        "position_error_max_m": {"at_most": 1.0},
        "position_error_rms_m": {"at_most": 0.0},
        "settling_time_s": {"at_most": 1.0},
    }
    changes = {**SHORT, "accept": accept, "path": {"kind": "circle", "size": 0.3, "period": 0.5}}
    result = simulate(load_experiment("pinv_circle", changes))
    met = {verdict.metric: verdict.met for verdict in result.verdicts}
    assert met["position_error_max_m"]
    assert not met["position_error_rms_m"]
    result.save(tmp_path)
    told = json.loads((tmp_path / "run.json").read_text())["accept"]
    assert {name: entry["met"] for name, entry in told.items()} == met
    assert told["position_error_rms_m"]["bound"] == "<= 0"


@pytest.mark.parametrize("name", ["result.npz", "metrics.json", "experiment.yaml", "run.json"])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_file_that_is_cut_short_is_refused_in_a_sentence(result, tmp_path, name, share):
    result.save(tmp_path)
    file = tmp_path / name
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InvalidInputError) as caught:
        Result.load(tmp_path)
    assert str(tmp_path) in str(caught.value)


def test_a_folder_from_before_there_were_records_is_read(result, tmp_path):
    result.save(tmp_path)
    (tmp_path / "run.json").unlink()
    assert Result.load(tmp_path).status == "complete"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"metrics": []}, "metrics.json must hold numbers by name"),
        ({"metrics": {"position_error_max_m": "x"}}, "metrics.json must hold numbers by name"),
        ({"position": None}, "result.npz: position is missing"),
        ({"position": np.zeros((3, 7))}, r"result.npz: position has shape \(3, 7\), but there are"),
        ({"time": np.full(11, np.nan)}, "result.npz: time must be finite numbers"),
    ],
)
def test_a_folder_that_no_run_has_written_is_refused(result, tmp_path, change, message):
    result.save(tmp_path)
    if "metrics" in change:
        (tmp_path / "metrics.json").write_text(json.dumps(change.pop("metrics")))
    with np.load(tmp_path / "result.npz") as arrays:
        series = {name: arrays[name] for name in arrays.files} | change
    np.savez(tmp_path / "result.npz", **{k: v for k, v in series.items() if v is not None})
    with pytest.raises(InvalidInputError, match=f"holds no result: {message}"):
        Result.load(tmp_path)
