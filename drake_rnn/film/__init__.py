"""A run as a moving picture: frames of its playback, drawn by Chromium without a window."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from ..errors import InvalidInputError
from ..inputs.fields import (
    checked,
    each,
    function,
    instance,
    optional,
)
from ..inputs.messages import require_type
from ..playback import write_playback
from ..runs.folder import require_output
from ..runs.result import Result
from ..runs.folder import replacing
from .encoding import open_browser, require_browser
from .encoding import Caption
from .encoding import format_of
from .encoding import fit_size
from .encoding import Player
from .encoding import FilmSettings
from .encoding import (
    FilmTimes,
    film_times,
)

__all__ = ["Film", "FilmProgress", "FilmSettings", "write_film"]

#: Called with the number of pictures drawn so far, and with the number of all pictures.
FilmProgress = Callable[[int, int], None]


@dataclass(frozen=True)
class Film:
    """A film that was written.

    Attributes:
        file: The file.
        size: Size of the file [bytes].
        frames: Number of its pictures.
        seconds: Its length [s], with the time for which the last picture stands.
        speed: How much faster than the run it is.
        quality: Quality of its pictures, in words.
        reduced: Whether quality or number of its pictures had to be lowered for its size.
    """

    file: Path
    size: int
    frames: int
    seconds: float
    speed: float
    quality: str
    reduced: bool

    def __str__(self) -> str:
        faster = "" if self.speed < 1.005 else f", {self.speed:.3g} times as fast as the run"
        note = ", lowered to fit" if self.reduced else ""
        return (
            f"{self.file}: {self.frames} pictures in {self.seconds:.1f} s{faster}, "
            f"{self.quality}{note}, {self.size / 1e6:.2f} MB"
        )


@checked(
    result=instance(Result),
    file=instance(str, Path),
    settings=instance(FilmSettings, None),
    beside=each(Result),
    progress=optional(function()),
)
def write_film(
    result: Result,
    file: str | Path,
    settings: FilmSettings | None = None,
    beside: Sequence[Result] = (),
    progress: FilmProgress | None = None,
) -> Film:
    """Write a run as a moving picture: WebP, GIF or, with ffmpeg, MP4.

    Its pictures are those of the playback, see `drake_rnn.write_playback`, which Chromium draws
    without a window. The same result gives the same pictures as far as Chromium does.

    Args:
        result: The run.
        file: File to write, which ends in ``.webp``, ``.gif`` or ``.mp4``; an existing one is
            replaced once the new one is whole.
        settings: What the film shows and how large it may be.
        beside: Other runs whose paths are shown beside those of ``result``.
        progress: Called after each picture with the number of pictures drawn, and of all.

    Returns:
        What was written.

    Raises:
        InvalidInputError: If selenium, Chromium or ffmpeg is missing or fails, the run is of a
            single instant or shorter than what should be shown, the film cannot be made small
            enough, or the file cannot be written.
    """
    settings = FilmSettings() if settings is None else settings
    require_type("settings", settings, FilmSettings)
    file = Path(file)
    kind = format_of(file)
    if result.time.size < 2:
        raise InvalidInputError("film: the run is a single instant, in which nothing moves")
    times = film_times(float(result.time[-1] - result.time[0]), settings)
    _require_writable(file)
    require_browser()
    pictures = _pictures(result, settings, beside, times, progress)
    film = fit_size(pictures, times, kind, settings.most_bytes)
    _write_whole(file, film.contents)
    return Film(
        file=file,
        size=len(film.contents),
        frames=len(film.times.shown),
        seconds=1e-3 * sum(film.times.durations(1e-3)),
        speed=times.speed,
        quality=film.quality,
        reduced=not film.best,
    )


def _pictures(
    result: Result,
    settings: FilmSettings,
    beside: Sequence[Result],
    times: FilmTimes,
    progress: FilmProgress | None,
) -> list[Image.Image]:
    """Return the pictures with their captions."""
    span = (float(times.shown[0]), float(times.shown[-1]))
    caption = Caption((result, *beside), settings, times.speed, span)
    width, height = settings.size
    pictures = []
    with TemporaryDirectory(prefix="drake_rnn_") as scratch:
        page = write_playback(result, Path(scratch) / "playback.html", beside=beside)
        with open_browser((width, height - caption.height)) as driver:
            player = Player(driver, page, settings)
            for t, picture in zip(times.shown, player.pictures(times.shown), strict=True):
                pictures.append(caption.below(picture, float(t)))
                if progress is not None:
                    progress(len(pictures), len(times.shown))
    return pictures


def _require_writable(file: Path) -> None:
    """Refuse a file that cannot be written before a minute is spent on its pictures."""
    require_output(file, "film file", "film.*")
    folder = file.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidInputError(f"film file {file}: cannot be written")


def _write_whole(file: Path, contents: bytes) -> None:
    """Write a file in one step, so that no reader ever finds part of it."""
    try:
        with replacing(file) as new:
            new.write_bytes(contents)
    except OSError as error:
        raise InvalidInputError(f"film file {file}: {error.strerror}") from None
