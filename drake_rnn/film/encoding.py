"""Pictures as the bytes of a file: WebP, GIF and MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

from ..errors import InvalidInputError
from .timing import FilmTimes

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
