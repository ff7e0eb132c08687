"""Films of runs, drawn by a browser; and what is said where that cannot be."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from drake_rnn import FilmSettings, InvalidInputError, load_experiment, simulate, write_film
from drake_rnn.film.encoding import Caption
from process_helpers import PATIENCE

SHORT = {"duration": 2.0, "window": None, "accept": None}
TINY = FilmSettings(size=(240, 180), frames_per_second=4.0, seconds=1.0, view="close")
INSTALLED = bool(shutil.which("chromium") and shutil.which("chromedriver"))
needs_browser = pytest.mark.skipif(
    not INSTALLED, reason="Debian's chromium and chromium-driver are not installed"
)


@pytest.fixture(scope="module")
def run():
    return simulate(load_experiment("slc_nephroid_known", SHORT))


@pytest.fixture(scope="module")
def filmed(run, tmp_path_factory):
    """A tiny film of the run, and what was told of its progress."""
    told = []
    file = tmp_path_factory.mktemp("filmed") / "film.webp"
    return write_film(run, file, TINY, progress=lambda *counts: told.append(counts)), told


def frames_of(file):
    with Image.open(BytesIO(file.read_bytes())) as film:
        return [
            (np.asarray(frame.convert("RGB"), float), frame.info["duration"])
            for frame in ImageSequence.Iterator(film)
        ]


def orange(picture):
    """How many points have the hue of what is traced: nothing else is red rather than blue."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red - blue > 50) & (red - green > 25)).sum())


@needs_browser
@pytest.mark.long
def test_a_film_shows_the_arm_that_moves_and_the_path_that_grows(run, filmed):
    film, told = filmed
    file = film.file
    assert told == [(k, 5) for k in range(1, 6)]
    assert (film.size, film.frames) == (file.stat().st_size, 5)
    assert (film.speed, film.seconds, film.reduced) == (2.0, 2.0, False)
    assert film.size <= TINY.most_bytes
    frames = frames_of(file)
    assert [duration for _, duration in frames] == [250, 250, 250, 250, 1000]
    height = 180 - Caption([run], TINY, 2.0, (0.0, 2.0)).height
    scenes = [picture[:height] for picture, _ in frames]
    # No two are alike, no scene is empty, and what is traced grows.
    for one, other in pairwise(scenes):
        assert (np.abs(one - other).max(axis=2) > 30).sum() > 500
    assert (np.abs(scenes[0] - scenes[-1]).max(axis=2) > 30).sum() > 2000
    assert min(scene.std() for scene in scenes) > 10
    traced = [orange(scene) for scene in scenes]
    assert traced[0] < traced[2] < traced[4]
    assert list(file.parent.iterdir()) == [file]


@needs_browser
@pytest.mark.long
def test_the_same_run_gives_the_same_film_and_other_settings_another(run, filmed, tmp_path):
    def again(name, **others):
        file = tmp_path / f"{name}.webp"
        return write_film(run, file, replace(TINY, **others)).file

    one, two = filmed[0].file, again("two")
    assert one.read_bytes() == two.read_bytes()
    # A moment of the run is enough to tell another view or ground.
    moment = {"begin": 0.0, "end": 0.5, "frames_per_second": 1.0}
    dark, near = again("dark", theme="dark", **moment), again("near", view="path", **moment)
    (light, _), (black, _), (path, _) = (frames_of(file)[0] for file in (one, dark, near))
    assert black.mean() < 100 < light.mean()
    assert (np.abs(light - path).max(axis=2) > 30).sum() > 2000


@needs_browser
@pytest.mark.long
@pytest.mark.parametrize(
    "after", [1.0, *(pytest.param(after, marks=pytest.mark.nightly) for after in (0.0, 4.0))]
)
def test_interrupted_at_any_time_it_leaves_no_file_and_no_process(run, tmp_path, after):
    folder = run.save(tmp_path / "run")
    # Chromium does not start where the name of its socket is longer than some 100 characters.
    scratch = Path(tempfile.mkdtemp(prefix="film"))
    before = sorted(folder.iterdir())
    process = subprocess.Popen(
        [sys.executable, "-m", "drake_rnn", "film", str(folder), "--seconds", "60"],
        env=os.environ | {"TMPDIR": str(scratch)},
        stderr=subprocess.PIPE,
        text=True,
    )
    # From where the browser is about to start.
    while not list(scratch.glob("drake_rnn_*/profile")):
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert sorted(folder.iterdir()) == before
    assert not [each for each in scratch.iterdir() if each.name.startswith("drake_rnn_")]
    assert not processes_with(str(scratch))
    shutil.rmtree(scratch)


def processes_with(text):
    """Numbers and command lines of running processes that have a text in them."""
    found = {}
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = file.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if text in line:
            found[int(file.parent.name)] = line
    return found


def test_without_selenium_it_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "selenium.webdriver", None)
    with pytest.raises(InvalidInputError, match=r"needs selenium.*pip install 'selenium"):
        write_film(run, tmp_path / "film.webp")
    assert not list(tmp_path.iterdir())


def test_without_chromium_it_says_what_to_install(run, tmp_path, monkeypatch):
    pytest.importorskip("selenium.webdriver")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InvalidInputError, match="needs chromium and chromedriver, which are not"):
        write_film(run, tmp_path / "film.webp")
    assert not list(tmp_path.iterdir())


@needs_browser
def test_a_chromium_that_does_not_start_is_one_sentence(run, tmp_path, monkeypatch):
    folder = tmp_path / "programs"
    folder.mkdir()
    (folder / "chromium").write_text("#!/bin/sh\nexit 1\n")
    (folder / "chromium").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(InvalidInputError) as refused:
        write_film(run, tmp_path / "film.webp")
    assert str(refused.value).startswith("film: Chromium does not start: ")
    assert "\n" not in str(refused.value)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["programs"]


@needs_browser
@pytest.mark.long
def test_a_chromium_that_ends_meanwhile_is_one_sentence(run, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def crash(done, count):
        for process in processes_with(f"--user-data-dir={tmp_path}"):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    with pytest.raises(InvalidInputError, match="film: Chromium cannot show the playback: "):
        write_film(run, tmp_path / "film.webp", TINY, progress=crash)
    assert not list(tmp_path.iterdir())


def test_a_run_of_a_single_instant_and_files_that_cannot_be_written_are_refused(run, tmp_path):
    instant = simulate(load_experiment("slc_nephroid_known", SHORT), series="none")
    with pytest.raises(InvalidInputError, match="the run is a single instant"):
        write_film(instant, tmp_path / "film.webp")
    for file in (tmp_path / "nowhere" / "film.webp", tmp_path / "film.avi"):
        with pytest.raises(InvalidInputError, match="film file"):
            write_film(run, file)
    assert not list(tmp_path.iterdir())
