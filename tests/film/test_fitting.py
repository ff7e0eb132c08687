"""A file holds the pictures it should, as long as it should, and is no larger than it may be."""

import json
import shutil
import subprocess
from io import BytesIO

import numpy as np
import pytest
from film_helpers import evenly, pictures, place
from PIL import Image, ImageSequence

from drake_rnn import InvalidInputError
from drake_rnn.film import encoding
from drake_rnn.film.encoding import FORMATS, fit_size, format_of

SIZE, COUNT = (160, 120), 12
ALL = 10**8


def shown(contents):
    """Pictures and durations [ms] of an animated file."""
    with Image.open(BytesIO(contents)) as film:
        return [
            (np.asarray(frame.convert("RGB"), float), frame.info["duration"])
            for frame in ImageSequence.Iterator(film)
        ]


def smallest(made, times, kind):
    """Size of the smallest film, which is told where not even that fits."""
    with pytest.raises(InvalidInputError, match="most_bytes: the smallest film has") as refused:
        fit_size(made, times, kind, 500)
    return int(str(refused.value).split()[5])


@pytest.mark.parametrize("ending", [".webp", ".gif"])
def test_every_picture_is_there_as_long_as_it_should_be(ending):
    made, times = pictures(COUNT, SIZE), evenly(COUNT, 12.0)
    film = fit_size(made, times, FORMATS[ending], ALL)
    assert film.best
    frames = shown(film.contents)
    assert len(frames) == COUNT
    unit = 10 if ending == ".gif" else 1
    assert [duration for _, duration in frames] == [
        unit * ticks for ticks in times.durations(1e-3 * unit)
    ]
    for k, (frame, _) in enumerate(frames):
        left = place(k, COUNT, SIZE)
        square = frame[45:55, left + 5 : left + 15]
        # The colour that means something is still what it is.
        assert np.abs(square.mean(axis=(0, 1)) - (213, 94, 0)).max() < 12
        assert np.abs(frame - np.asarray(made[k], float)).mean() < 20


@pytest.mark.parametrize("ending", [".webp", ".gif"])
@pytest.mark.long
def test_quality_falls_before_pictures_are_left_out_and_no_more_than_it_must(ending):
    made, times, kind = pictures(COUNT, SIZE), evenly(COUNT), FORMATS[ending]
    best = len(fit_size(made, times, kind, ALL).contents)
    sizes, counts = [best], [COUNT]
    for most in np.linspace(best, smallest(made, times, kind), 8).astype(int):
        film = fit_size(made, times, kind, int(most))
        assert len(film.contents) <= most
        assert film.best == (most == best)
        sizes.append(len(film.contents))
        counts.append(len(film.times.shown))
        assert len(shown(film.contents)) == counts[-1]
        assert sum(film.times.durations(1e-2)) == sum(times.durations(1e-2))
    assert counts == sorted(counts, reverse=True)
    assert COUNT in counts[1:]
    assert counts[-1] < COUNT


@pytest.mark.parametrize("ending", [".webp", ".gif"])
def test_a_film_that_cannot_be_small_enough_is_refused_with_its_size(ending):
    made, times, kind = pictures(COUNT, SIZE), evenly(COUNT), FORMATS[ending]
    least = smallest(made, times, kind)
    assert len(fit_size(made, times, kind, least).contents) == least


def test_the_same_pictures_give_the_same_bytes():
    made, times = pictures(4, SIZE), evenly(4)
    for ending in (".webp", ".gif"):
        one, two = (fit_size(made, times, FORMATS[ending], ALL).contents for _ in range(2))
        assert one == two


@pytest.mark.skipif(not shutil.which("ffprobe"), reason="ffmpeg is not installed")
@pytest.mark.parametrize("size", [(160, 120), (161, 121)])
def test_mp4_is_as_long_as_it_should_be(tmp_path, size):
    contents = fit_size(pictures(COUNT, size), evenly(COUNT, 12.0), FORMATS[".mp4"], ALL).contents
    file = tmp_path / "film.mp4"
    file.write_bytes(contents)
    asked = "stream=codec_name,pix_fmt,width,height,nb_frames,duration"
    command = ["ffprobe", "-v", "error", "-show_entries", asked, "-of", "json", str(file)]
    (stream,) = json.loads(subprocess.check_output(command))["streams"]
    assert stream["codec_name"] == "h264"
    assert stream["pix_fmt"] == "yuv420p"
    assert (stream["width"] - size[0], stream["height"] - size[1]) in ((0, 0), (1, 1))
    # The last picture stands for a second.
    assert int(stream["nb_frames"]) == COUNT - 1 + 12
    assert float(stream["duration"]) == pytest.approx((COUNT - 1) / 12.0 + 1.0, abs=0.02)


def test_mp4_without_ffmpeg_and_unknown_endings_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(encoding.shutil, "which", lambda name: None)
    with pytest.raises(InvalidInputError, match="MP4 needs ffmpeg, which is not installed; webp"):
        format_of(tmp_path / "film.mp4")
    assert format_of(tmp_path / "film.WEBP") is FORMATS[".webp"]
    with pytest.raises(InvalidInputError, match=r"must end in one of .webp, .gif, .mp4, not '.avi"):
        format_of(tmp_path / "film.avi")
