"""`drake-rnn film`: its options are settings of the film, and errors name the options."""

from pathlib import Path

import pytest
from cli_helpers import call, run, sentence

from drake_rnn import FilmSettings
from drake_rnn.film import Film


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run(tmp_path_factory.mktemp("out"), "--duration", "0.05", "--no-figures")


@pytest.fixture
def asked(monkeypatch):
    """What films were asked for, without any being made."""
    calls = []

    def write(result, file, settings, beside, progress):
        calls.append((result, Path(file), settings, list(beside)))
        return Film(Path(file), 812_345, 97, 9.0, 2.5, "quality 65", True)

    monkeypatch.setattr("drake_rnn.cli.presenting.write_film", write)
    return calls


def test_without_options_it_is_a_film_of_the_run_in_its_folder(folder, asked):
    result = call("film", folder)
    assert result.exit_code == 0, (result.stderr, result.exception)
    ((shown, file, settings, beside),) = asked
    assert shown.experiment.name == folder.name
    assert file == folder / "film.webp"
    assert beside == []
    assert vars(settings) == vars(FilmSettings())
    # What was chosen is told.
    assert result.stdout == (
        f"film      {file}: 97 pictures in 9.0 s, 2.5 times as fast as the run, "
        "quality 65, lowered to fit, 0.81 MB\n"
    )


def test_options_are_settings(folder, asked):
    options = "--format gif --size 320x200 --fps 5 --seconds 3 --from 0.01 --to 0.04 --view path"
    more = ("--theme", "dark", "--most-bytes", "0.5 MB", "--beside", folder)
    assert call("film", folder, *options.split(), *more).exit_code == 0
    ((_, file, settings, beside),) = asked
    assert file == folder / "film.gif"
    assert [each.experiment.name for each in beside] == [folder.name]
    wanted = FilmSettings(
        size=(320, 200),
        frames_per_second=5.0,
        seconds=3.0,
        begin=0.01,
        end=0.04,
        view="path",
        theme="dark",
        most_bytes=500_000,
    )
    assert vars(settings) == vars(wanted)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--fps 0", "--fps: must be greater than 0, not 0.0"),
        ("--fps 100", "--fps: may be 1 to 60, not 100.0"),
        ("--seconds -1", "--seconds: must be greater than 0, not -1.0"),
        ("--size 640", "--size: must be width and height, e.g. 640x400, not '640'"),
        ("--size 64x40", "--size: may be 160 to 3840, not 64"),
        ("--from 1", "--from: the run ends at 0.05 s, before 1 s"),
        ("--to 1", "--to: the run ends at 0.05 s, before 1 s"),
        ("--from 0.03 --to 0.02", "--to: must be later than the beginning, 0.03 s, not 0.02 s"),
        ("--most-bytes much", "--most-bytes: must be a number of bytes, kB or MB, e.g. 800kB"),
        ("--most-bytes 0", "--most-bytes: must be greater than or equal to 1, not 0"),
    ],
)
def test_an_error_names_the_option(folder, options, said):
    before = sorted(folder.iterdir())
    assert sentence(call("film", folder, *options.split())).startswith(said)
    assert sorted(folder.iterdir()) == before


def test_a_run_without_series_cannot_be_filmed(tmp_path):
    folder = run(tmp_path, "--duration", "0.05", "--series", "none")
    said = sentence(call("film", folder))
    assert said == "film: the run is a single instant, in which nothing moves"


def test_the_film_of_another_run_in_the_folder_is_removed(tmp_path):
    folder = run(tmp_path, "--duration", "0.05", "--no-figures")
    for name in ("film.webp", "film.mp4", "notes.txt"):
        (folder / name).write_text("of the run before")
    run(tmp_path, "--duration", "0.05", "--no-figures")
    assert not list(folder.glob("film.*"))
    assert (folder / "notes.txt").exists()


def test_interrupted_it_says_so(folder, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("drake_rnn.cli.presenting.write_film", interrupted)
    result = call("film", folder)
    assert result.exit_code == 130
    assert result.stderr == "interrupted: no film was written\n"
