"""Runs that go on after they were stopped have the bits of whole ones."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate
from drake_rnn.compiled.library import compiler
from drake_rnn.errors import InterruptedRunError
from drake_rnn.experiment import read_document
from drake_rnn.inputs.documents import to_yaml
from drake_rnn.runs import (
    checkpoint,
    resume,
    simulation,
)
from drake_rnn.runs import (
    checkpoint as keeper,
)
from drake_rnn.runs.checkpoint import Keeper

QUICK = "slc_nephroid_known"
#: What varies in them: a learned Jacobian with its covariance and noise of measurement; a learned
#: Jacobian with dither and sensor; two steps of acceleration; moving averages; a plant in contact
#: with a force sensor that is noisy and late; a law that Drake integrates; joint targets
#: beside an obstacle; two arms.
RUNS = {
    "adaptive_measured": {},
    "slc_nephroid_warm_up": {"sensing": {"position_noise": 1e-5, "delay": 3e-3}},
    "naljdf_clover": {},
    "chain_circle": {"limits": {"velocity": 1, "acceleration": 50, "jerk": 5000}},
    "contact_circle": {"sensor": {"noise": 0.1, "delay": 0.004, "low_pass": 50}},
    "modified_state_adjustment": {},
    "stream_guarded": {},
    "adaptive_two_arms_together": {},
}
DURATION, EVERY = 0.65, 0.2


@pytest.fixture(autouse=True)
def often(monkeypatch):
    """A checkpoint at each fifth of a second."""
    monkeypatch.setattr(keeper, "_EVERY", EVERY)
    monkeypatch.setattr(keeper, "_PAUSE", 0.0)


def same(one, other):
    """Whether two results have the same bits, but for timings."""
    assert one.series.keys() == other.series.keys()
    arrays = [(one.time, other.time), *((one.series[k], other.series[k]) for k in one.series)]
    equal = all(np.array_equal(a, b, equal_nan=True) for a, b in arrays)
    seconds = [each.second for each in (one, other)]
    beside = seconds == [None, None] or same(*seconds)
    # NaN is written as text, which is equal to itself.
    told = json.dumps(one.metrics) == json.dumps(other.metrics)
    return equal and beside and told and one.warnings == other.warnings


def changed(name, **changes):
    document = read_document(name)
    end = {"duration": DURATION, "window": None, "accept": None, "over": None}
    return load_experiment(name, {k: v for k, v in end.items() if k in document} | changes)


def stopped(folder, experiment, at, **options):
    """Stop a run once it has come to a time [s]."""

    def progress(t):
        if t >= at:
            raise KeyboardInterrupt

    with pytest.raises(InterruptedRunError) as caught:
        simulate(experiment, progress, keep=folder, **options)
    return caught.value.result


@pytest.mark.long
@pytest.mark.parametrize("name", RUNS)
def test_it_has_the_bits_of_a_whole_run_at_any_moment(tmp_path, monkeypatch, name):
    moments, write = [], Keeper._checkpoint

    def copied(self, state):
        write(self, state)
        moments.append(state.time)
        # As if the process had been killed here.
        shutil.copytree(tmp_path / "whole", tmp_path / str(len(moments)))

    monkeypatch.setattr(Keeper, "_checkpoint", copied)
    experiment = changed(name, **RUNS[name])
    whole = simulate(experiment, keep=tmp_path / "whole")
    monkeypatch.setattr(Keeper, "_checkpoint", write)
    assert len(moments) == 3
    assert same(whole, simulate(experiment))
    for number, moment in enumerate(moments, 1):
        assert moment == pytest.approx(number * EVERY, abs=1e-3)
        result = resume(tmp_path / str(number))
        assert result.timings["resumed_at_s"] == moment
        assert same(result, whole), moment


@pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
def test_a_compiled_run_goes_on_compiled(tmp_path):
    pytest.importorskip("jax")
    experiment = changed(QUICK)
    whole = simulate(experiment, compiled=True)
    stopped(tmp_path, experiment, 0.5, compiled=True)
    result = resume(tmp_path)
    assert result.options.compiled
    assert same(result, whole)


@pytest.mark.long
def test_between_steps_of_a_plant_its_state_is_not_enough(tmp_path, monkeypatch):
    """It remembers the forces of its last step, which the law sees at a time of its own."""
    experiment = changed("contact_circle", duration=0.3, plant={"time_step": 8e-4})
    whole = simulate(experiment, keep=tmp_path)
    stopped(tmp_path / "at a step", experiment, 0.25)
    result = resume(tmp_path / "at a step")
    assert result.timings["resumed_at_s"] == pytest.approx(0.2)
    assert same(result, whole)

    monkeypatch.setattr(keeper, "_EVERY", 0.201)
    begin = Keeper.__init__

    def without_tick(self, *arguments):
        *others, tick, since = arguments
        assert tick == 8e-4
        begin(self, *others, None, since)

    monkeypatch.setattr(Keeper, "__init__", without_tick)
    stopped(tmp_path / "between", experiment, 0.25)
    result = resume(tmp_path / "between")
    assert result.timings["resumed_at_s"] == pytest.approx(0.201)
    assert not same(result, whole)


def test_it_goes_on_after_parts_were_evaluated_and_dropped(tmp_path, monkeypatch):
    monkeypatch.setattr(simulation, "PART", 100)
    experiment = changed(QUICK)
    stopped(tmp_path, experiment, 0.5)
    whole = simulate(experiment)
    assert same(resume(tmp_path), whole)


def test_it_can_be_stopped_again_and_again(tmp_path):
    experiment = changed(QUICK)
    stopped(tmp_path, experiment, 0.25)

    def progress(t):
        if t >= 0.45:
            raise KeyboardInterrupt

    with pytest.raises(InterruptedRunError):
        resume(tmp_path, progress)
    result = resume(tmp_path)
    assert result.timings["resumed_at_s"] == pytest.approx(0.4)
    assert same(result, simulate(experiment))


def test_what_it_stores_stays_as_it_was_asked(tmp_path):
    experiment = changed(QUICK)
    stopped(tmp_path, experiment, 0.5, series="none")
    result = resume(tmp_path)
    assert result.time.tolist() == [DURATION]
    assert same(result, simulate(experiment, series="none"))


def test_the_folder_of_a_finished_run_has_no_checkpoint(tmp_path):
    stopped(tmp_path, changed(QUICK), 0.5).save(tmp_path)
    assert (tmp_path / checkpoint.FOLDER).is_dir()
    resume(tmp_path).save(tmp_path)
    assert not (tmp_path / checkpoint.FOLDER).exists()
    assert Result.load(tmp_path).status == "complete"
    with pytest.raises(InvalidInputError, match="is complete; there is nothing left to resume"):
        resume(tmp_path)


def test_a_run_is_kept_even_if_its_checkpoint_cannot_be(tmp_path, monkeypatch):
    monkeypatch.setattr(keeper, "MOST_BYTES", 100_000)
    result = simulate(changed(QUICK), keep=tmp_path)
    (warning,) = [text for text in result.warnings if text.startswith("checkpoint: ")]
    assert warning.startswith("checkpoint: none after t = 0.")
    assert warning.endswith("its steps take more than 0.0001 GB")
    assert result.status == "complete"


class TestRefused:
    """With a sentence, before anything runs."""

    @staticmethod
    def refusal(folder):
        with pytest.raises(InvalidInputError) as caught:
            resume(folder)
        return str(caught.value).removeprefix(f"{folder}: ")

    def test_what_is_no_run_that_was_stopped(self, tmp_path):
        assert self.refusal(tmp_path) == "holds no run that was stopped"
        assert self.refusal(tmp_path / "none") == "there is no such folder"

    def test_a_run_that_failed(self, tmp_path):
        simulate(changed(QUICK, duration=0.01)).save(tmp_path)
        record = json.loads((tmp_path / "run.json").read_text())
        failed = {**record, "status": "failed", "failure": "v is no longer finite"}
        (tmp_path / "run.json").write_text(json.dumps(failed))
        said = self.refusal(tmp_path)
        assert said == "the run failed, and would fail again: v is no longer finite"

    def test_a_run_that_had_hardly_begun(self, tmp_path):
        stopped(tmp_path, changed(QUICK, duration=0.3, period=5e-4), 0.1)
        assert self.refusal(tmp_path).startswith("was stopped before the first whole second")

    def test_another_document(self, tmp_path):
        experiment = changed(QUICK)
        stopped(tmp_path, experiment, 0.5).save(tmp_path)
        contents = {**experiment.document.contents(), "law": {"kind": "adaptive"}}
        (tmp_path / "experiment.yaml").write_text(to_yaml(contents))
        assert self.refusal(tmp_path).startswith("experiment.yaml has another law than the run")

    def test_other_code(self, tmp_path, monkeypatch):
        stopped(tmp_path, changed(QUICK), 0.5)
        monkeypatch.setattr("drake_rnn.experiment.files.stamp", lambda: "drake 2.0")
        said = self.refusal(tmp_path)
        assert said.startswith("was begun by other code, of drake-rnn ")
        assert said.endswith("run it again")

    @pytest.mark.parametrize(
        ("integrator", "said"),
        [
            ({"accuracy": 1e-4}, "cannot go on: integrator.accuracy: with error control"),
            (
                {"scheme": "implicit_euler", "step": 1e-3},
                "cannot go on: integrator.scheme: implicit_euler remembers derivatives",
            ),
        ],
    )
    def test_an_integrator_that_remembers(self, tmp_path, integrator, said):
        law = {"kind": "simultaneous_learning", "rate": 100}
        experiment = changed(QUICK, law=law, integrator=integrator, duration=0.05, period=None)
        simulate(experiment, keep=tmp_path)
        assert not checkpoint.can_go_on(tmp_path)
        assert self.refusal(tmp_path).startswith(said)

    def test_what_reads_a_result_says_how_to_go_on(self, tmp_path):
        stopped(tmp_path, changed(QUICK), 0.5)
        for name in ("run.json", "experiment.yaml"):
            (tmp_path / name).unlink(missing_ok=True)
        with pytest.raises(InvalidInputError) as refused:
            Result.load(tmp_path)
        assert str(refused.value) == (
            f"{tmp_path}: its run was stopped, or is not at its end; `drake-rnn run --resume "
            f"{tmp_path}` goes on with a run that was stopped"
        )

    @pytest.mark.parametrize("file", ["state.npz", "steps.bin", "run.json", "experiment.yaml"])
    def test_a_damaged_checkpoint(self, tmp_path, file):
        stopped(tmp_path, changed(QUICK), 0.5)
        damaged = tmp_path / checkpoint.FOLDER / file
        damaged.write_bytes(damaged.read_bytes()[:100])
        with pytest.raises(InvalidInputError) as caught:
            resume(tmp_path)
        said = str(caught.value)
        assert said.startswith(f"{damaged.parent}: is no checkpoint of a run: ")
        assert said.endswith("; run the experiment again")


def _shifted(kept, time):
    kept["time"] = np.array(time)


def _swapped(kept):
    kept["shape"] = kept["shape"][::-1].copy()


#: What the state of a checkpoint may have been changed to.
STATES = {
    "before the start": lambda kept: _shifted(kept, -5.0),
    "far beyond the end": lambda kept: _shifted(kept, 1e9),
    "between two samples": lambda kept: _shifted(kept, 1.23456),
    "no time": lambda kept: _shifted(kept, np.nan),
    "two times": lambda kept: _shifted(kept, [0.4, 0.4]),
    "rows for columns": _swapped,
    "fewer steps": lambda kept: kept["shape"].__isub__([100, 0]),
    "no steps": lambda kept: kept["shape"].__imul__(0),
    "steps without end": lambda kept: kept.update(shape=np.array([10**9, 10**9])),
    "fewer than no steps": lambda kept: kept["shape"].__imul__(-1),
    "steps that are no number": lambda kept: kept.update(shape=np.array([np.nan, 3.0])),
    "another state": lambda kept: kept["discrete"].__iadd__(1e-9),
    "a smaller state": lambda kept: kept.update(discrete=kept["discrete"][:-1]),
    "no state": lambda kept: kept.pop("discrete"),
    "no digest": lambda kept: kept.pop("digest"),
    "another digest": lambda kept: kept["digest"].__iadd__(1),
    "words": lambda kept: kept.update(continuous=np.array(["a"])),
    "objects": lambda kept: kept.update(continuous=np.array([{}], dtype=object)),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that was stopped; nothing is changed in it."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(keeper, "_EVERY", EVERY)
        patch.setattr(keeper, "_PAUSE", 0.0)
        stopped(folder, changed(QUICK), 0.5)
    return folder


class TestDamaged:
    """A checkpoint is what the run has written, or it is refused: no run goes on with another."""

    @pytest.fixture
    def folder(self, whole, tmp_path):
        shutil.copytree(whole, tmp_path / "run")
        return tmp_path / "run"

    @pytest.mark.parametrize("change", STATES)
    def test_another_state(self, folder, change):
        file = folder / checkpoint.FOLDER / checkpoint.STATE
        with np.load(file) as arrays:
            kept = dict(arrays)
        STATES[change](kept)
        np.savez(file, **kept)
        with pytest.raises(InvalidInputError, match=r"is no checkpoint of a run: st.*; run the ex"):
            checkpoint.Checkpoint.load(folder)

    @pytest.mark.parametrize("name", ["run.json", "experiment.yaml", "state.npz", "steps.bin"])
    def test_any_byte(self, folder, name):
        """That is another one, or from which on the file is cut off."""
        file = folder / checkpoint.FOLDER / name
        content = file.read_bytes()
        right = checkpoint.Checkpoint.load(folder)
        rng = np.random.default_rng(0)
        same = 0
        for _ in range(60):
            at = int(rng.integers(len(content)))
            damaged = bytearray(content)
            damaged[at] ^= int(rng.integers(1, 256))
            for changed_to in (bytes(damaged), content[:at]):
                file.write_bytes(changed_to)
                try:
                    found = checkpoint.Checkpoint.load(folder)
                except InvalidInputError as error:
                    assert str(folder) in str(error)  # noqa: PT017  either outcome is right
                    continue
                # The names and times of files in an archive are told twice.
                assert name == "state.npz"
                same += 1
                for one, other in zip(right.state, found.state, strict=True):
                    assert np.array_equal(one, other)
                assert np.array_equal(right.rows, found.rows)
                texts = [each.experiment.document.to_yaml() for each in (right, found)]
                assert texts[0] == texts[1]
        assert same < 30

    @pytest.mark.parametrize("name", ["run.json", "experiment.yaml", "state.npz", "steps.bin"])
    @pytest.mark.parametrize("kind", ["pipe", "folder", "device", "nested", "empty", "none"])
    def test_what_is_no_file_of_a_run(self, folder, name, kind):
        file = folder / checkpoint.FOLDER / name
        file.unlink()
        make = {
            "pipe": lambda: os.mkfifo(file),
            "folder": file.mkdir,
            "device": lambda: file.symlink_to("/dev/zero"),
            "nested": lambda: file.write_text("[" * 10_000),
            "empty": lambda: file.write_text(""),
            "none": lambda: None,
        }
        make[kind]()
        with pytest.raises(InvalidInputError) as caught:
            checkpoint.Checkpoint.load(folder)
        assert "\n" not in str(caught.value)
        assert str(folder) in str(caught.value)

    def test_another_document(self, folder):
        """With which the run would go on as it did not begin."""
        file = folder / checkpoint.FOLDER / checkpoint.DOCUMENT
        file.write_text(file.read_text().replace("seed: 0", "seed: 1") + "# 1\n")
        with pytest.raises(InvalidInputError, match="its files are not those that the run has wri"):
            checkpoint.Checkpoint.load(folder)

    def test_steps_beyond_the_state_are_not_of_it(self, folder):
        """A run that was killed has written them."""
        with (folder / checkpoint.FOLDER / checkpoint.STEPS).open("ab") as stream:
            stream.write(b"abc" * 100)
        assert checkpoint.Checkpoint.load(folder).state.time == pytest.approx(0.4)


@pytest.mark.long
def test_a_run_that_was_killed_goes_on(tmp_path):
    """By the command line, whose checkpoints are at whole seconds, a second of real time apart."""
    document = tmp_path / "mine.yaml"
    contents = {**read_document("slc_nephroid_warm_up"), "name": "mine", "duration": 15.0}
    shorter = {k: v for k, v in contents.items() if k not in ("window", "accept", "over")}
    document.write_text(to_yaml(shorter))
    command = [sys.executable, "-m", "drake_rnn", "run", "--no-figures", "--no-playback"]
    killed = subprocess.Popen([*command, document, "--out", tmp_path / "killed"])
    folder = tmp_path / "killed" / "mine"
    while not checkpoint.can_go_on(folder):
        assert killed.poll() is None
        time.sleep(0.05)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    subprocess.run([*command, "--resume", folder], check=True)
    result = Result.load(folder)
    assert result.timings["resumed_at_s"] >= 1.0
    assert same(result, simulate(load_experiment(document)))
    assert not (folder / checkpoint.FOLDER).exists()
