"""Pictures as the bytes of a file: WebP, GIF and MP4.

- The best film that fits within a given file size.
- The time of each picture in the run, and how long the film shows the picture.
- Settings of a film: its contents and its largest size.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

import numpy as np
from PIL import Image

from ..errors import InvalidInputError
from ..inputs.fields import Array, Count, NonNegative, Positive, between, validated

_Side = Annotated[Count, between(160, 3840)]


@validated
class FilmSettings:
    """Contents and largest size of a film of a run.

    Args:
        size: Width and height of its pictures [px].
        frames_per_second: Pictures in each second of the film [1/s].
        seconds: Length of the film, but for its last picture, which stands for a second [s]. A
            longer run is shown faster, and the film says how much; a shorter one as fast as it was.
        begin: Time of the run at which the film begins [s].
        end: Time of the run at which it ends [s]; by default that of the run.
        view: The whole arm, its end, or the path; by default what the playback shows first.
        theme: Light or dark ground.
        most_bytes: Size of the file that is not exceeded. Quality is lowered and pictures are left
            out until it fits.
    """

    size: tuple[_Side, _Side] = (640, 400)
    frames_per_second: Annotated[Positive, between(1.0, 60.0)] = 12.0
    seconds: Annotated[Positive, between(0.1, 600.0)] = 8.0
    begin: NonNegative = 0.0
    end: Positive | None = None
    view: Literal["arm", "close", "path"] | None = None
    theme: Literal["light", "dark"] = "light"
    most_bytes: Count = 1_500_000

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.begin:
            raise InvalidInputError(
                f"end: must be later than the beginning, {self.begin:g} s, not {self.end:g} s"
            )


#: Pictures that are kept until the film fits [bytes]: three of a point of a picture.
_MOST_MEMORY = 1.5e9
#: Time for which the last picture stands, so that a film that begins again can be read [s].
LAST = 1.0


@dataclass(frozen=True)
class FilmTimes:
    """The times of a film's pictures.

    Attributes:
        shown: Time of each picture in the run, shape (f,) [s].
        speed: How much faster than the run the film is.
    """

    shown: Array
    speed: float

    def every(self, step: int) -> tuple[FilmTimes, list[int]]:
        """Return the times and the numbers of each ``step``-th picture, and of the last one."""
        last = len(self.shown) - 1
        kept = sorted({*range(0, last, step), last})
        return FilmTimes(self.shown[kept], self.speed), kept

    def durations(self, unit: float) -> list[int]:
        """Return how long each picture is shown, in units of time that its format counts in.

        Rounding does not add up: each picture comes at its time, to half a unit.

        Args:
            unit: The unit [s].
        """
        begins = np.append(self.shown - self.shown[0], self.shown[-1] - self.shown[0])
        begins = begins / self.speed
        begins[-1] += LAST
        ticks: list[int] = np.diff(np.rint(begins / unit).astype(int)).tolist()
        return ticks


def film_times(duration: float, settings: FilmSettings) -> FilmTimes:
    """Return the times of a film's pictures, evenly from its beginning to its end.

    Args:
        duration: Duration of the run [s].
        settings: What the film shows.

    Raises:
        InvalidInputError: If the run is shorter than what should be shown of it, or the film would
            have too many pictures.
    """
    begin = settings.begin
    end = duration if settings.end is None else settings.end
    for name, time in (("begin", begin), ("end", end)):
        if time > duration * (1.0 + 1e-9):
            raise InvalidInputError(f"{name}: the run ends at {duration:g} s, before {time:g} s")
    if begin >= end:
        raise InvalidInputError(f"begin: must be before the end, {end:g} s, not {begin:g} s")
    speed = max(1.0, (end - begin) / settings.seconds)
    count = max(2, round((end - begin) / speed * settings.frames_per_second) + 1)
    width, height = settings.size
    if (memory := 3.0 * count * width * height) > _MOST_MEMORY:
        raise InvalidInputError(
            f"film: {count} pictures of {width}x{height} take {memory / 1e9:.1f} GB of memory; "
            "give a smaller size, fewer frames per second or fewer seconds"
        )
    return FilmTimes(np.linspace(begin, end, count), speed)


_MILLISECOND = 1e-3
#: GIF counts in hundredths of a second.
_GIF_UNIT = 1e-2
Pictures = Sequence[Image.Image]


@dataclass(frozen=True)
class Format:
    """A format of moving pictures.

    Attributes:
        encode: A function from pictures, their times and a quality to the bytes of a file.
        qualities: Qualities to try, the best one first.
        called: What its quality is called.
    """

    encode: Callable[[Pictures, FilmTimes, int], bytes]
    qualities: tuple[int, ...]
    called: str


def _webp(pictures: Pictures, times: FilmTimes, quality: int) -> bytes:
    return _moving("WEBP", pictures, times.durations(_MILLISECOND), quality=quality, method=4)


def _gif(pictures: Pictures, times: FilmTimes, colours: int) -> bytes:
    palette = _common_palette(pictures, colours)
    # Without dither, parts that stand still are the same in all pictures and take no bytes.
    reduced = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    durations = [10 * ticks for ticks in times.durations(_GIF_UNIT)]
    return _moving("GIF", reduced, durations, optimize=False)


def _moving(form: str, pictures: Pictures, durations: list[int], **options: Any) -> bytes:
    """Return pictures as a file that shows each for a time [ms], again and again."""
    stream = BytesIO()
    animation = {"save_all": True, "append_images": pictures[1:], "loop": 0}
    pictures[0].save(stream, form, duration=durations, **animation, **options)
    return stream.getvalue()


def _common_palette(pictures: Pictures, colours: int) -> Image.Image:
    """Return a palette for all pictures, from some of them side by side."""
    some = [pictures[k * (len(pictures) - 1) // 7] for k in range(8)]
    width, height = some[0].size
    sheet = Image.new("RGB", (4 * width, 2 * height))
    for k, picture in enumerate(some):
        sheet.paste(picture, (k % 4 * width, k // 4 * height))
    return sheet.quantize(colors=colours, method=Image.Quantize.MEDIANCUT)


def _mp4(pictures: Pictures, times: FilmTimes, quality: int) -> bytes:
    width, height = pictures[0].size
    *durations, last = times.durations(_MILLISECOND)
    each = sum(durations) / len(durations)
    command = [_ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{1e3 / each:.6f}", "-i", "-"]
    # Its colours are halved in both directions, which takes even sizes.
    command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p"]
    command += ["-crf", str(quality), "-fflags", "+bitexact", "-flags:v", "+bitexact"]
    command += ["-movflags", "+faststart"]
    stands = max(1, round(last / each))
    contents = b"".join(
        picture.tobytes() for picture in [*pictures, *[pictures[-1]] * (stands - 1)]
    )
    with TemporaryDirectory(prefix="drake_rnn_") as scratch:
        file = Path(scratch) / "film.mp4"
        done = subprocess.run(
            [*command, str(file)], input=contents, capture_output=True, check=False
        )
        if done.returncode != 0:
            told = done.stderr.decode(errors="replace").strip().splitlines()
            raise InvalidInputError(f"film: ffmpeg failed: {told[-1] if told else 'silently'}")
        return file.read_bytes()


#: The formats by the endings of their files.
FORMATS = {
    ".webp": Format(_webp, (80, 70, 60, 50), "quality"),
    ".gif": Format(_gif, (256, 128, 64), "colours"),
    ".mp4": Format(_mp4, (20, 26, 32, 38), "constant rate factor"),
}


def format_of(file: Path) -> Format:
    """Return the format of a file, by its ending.

    Raises:
        InvalidInputError: If there is none, or ffmpeg is needed and missing.
    """
    found = FORMATS.get(file.suffix.lower())
    if found is None:
        raise InvalidInputError(
            f"film file {file}: must end in one of {', '.join(FORMATS)}, not {file.suffix!r}"
        )
    if found is FORMATS[".mp4"]:
        _ffmpeg()
    return found


def _ffmpeg() -> str:
    """Return the program that encodes MP4."""
    if (ffmpeg := shutil.which("ffmpeg")) is None:
        raise InvalidInputError(
            "film: MP4 needs ffmpeg, which is not installed; webp and gif do not"
        )
    return ffmpeg


#: Steps from one shown picture to the next: all pictures, every second one, and so on.
_STEPS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Fitted:
    """A film that fits.

    Attributes:
        contents: The bytes of its file.
        times: Times of the pictures that it has.
        quality: Its quality, in words.
        best: Whether it has the best quality and all pictures.
    """

    contents: bytes
    times: FilmTimes
    quality: str
    best: bool


def fitted(pictures: Pictures, times: FilmTimes, kind: Format, most_bytes: int) -> Fitted:
    """Return the best film whose file is no larger than ``most_bytes``.

    Pictures are left out once the quality is at its lowest; it may then be better again.

    Args:
        pictures: The pictures.
        times: Their times.
        kind: Format of the file.
        most_bytes: Size that is not exceeded.

    Raises:
        InvalidInputError: If not even the smallest film fits; the message says how large it is.
    """
    contents = b""
    for step, quality in _attempts(len(pictures), kind):
        some, kept = times.every(step)
        contents = kind.encode([pictures[k] for k in kept], some, quality)
        if len(contents) <= most_bytes:
            best = step == 1 and quality == kind.qualities[0]
            return Fitted(contents, some, f"{kind.called} {quality}", best)
    raise InvalidInputError(
        f"most_bytes: the smallest film has {len(contents)} bytes, more than {most_bytes}; "
        "allow more, or give a smaller size or fewer seconds"
    )


def _attempts(count: int, kind: Format) -> Iterator[tuple[int, int]]:
    """Yield the step between pictures and the quality of each attempt, the best film first."""
    for step in _STEPS:
        if step > 1 and count // step < 2:
            return
        for quality in kind.qualities if step == 1 else kind.qualities[1:]:
            yield step, quality
