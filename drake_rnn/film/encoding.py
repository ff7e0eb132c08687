"""Pictures as the bytes of a file: WebP, GIF and MP4.

- The strip below each picture: name, legend, numbers of the run, speed and time.
- The best film that fits within a given file size.
- The time of each picture in the run, and how long the film shows the picture.
- Chromium without a window, which draws a page of this package without a network.
- A playback in a browser, picture by picture.
"""

from __future__ import annotations

import base64
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Annotated, Any, Literal, NamedTuple

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..colours import DESIRED, FORCE, TARGET, TRACED
from ..errors import InvalidInputError
from ..inputs.fields import Array, Count, NonNegative, Positive, between, validated
from ..inputs.packages import find_program, import_extra
from ..inputs.processes import signals_held
from ..measures import format_quantity
from ..runs.result import Result

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
        indices = sorted({*range(0, last, step), last})
        return FilmTimes(self.shown[indices], self.speed), indices

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
    images = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    durations = [10 * ticks for ticks in times.durations(_GIF_UNIT)]
    return _moving("GIF", images, durations, optimize=False)


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
        process = subprocess.run(
            [*command, str(file)], input=contents, capture_output=True, check=False
        )
        if process.returncode != 0:
            lines = process.stderr.decode(errors="replace").strip().splitlines()
            raise InvalidInputError(f"film: ffmpeg failed: {lines[-1] if lines else 'silently'}")
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
    film_format = FORMATS.get(file.suffix.lower())
    if film_format is None:
        raise InvalidInputError(
            f"film file {file}: must end in one of {', '.join(FORMATS)}, not {file.suffix!r}"
        )
    if film_format is FORMATS[".mp4"]:
        _ffmpeg()
    return film_format


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
class SizedFilm:
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


def fit_size(pictures: Pictures, times: FilmTimes, kind: Format, most_bytes: int) -> SizedFilm:
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
        some, indices = times.every(step)
        contents = kind.encode([pictures[k] for k in indices], some, quality)
        if len(contents) <= most_bytes:
            best = step == 1 and quality == kind.qualities[0]
            return SizedFilm(contents, some, f"{kind.called} {quality}", best)
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


@dataclass(frozen=True)
class Numbers:
    """Numbers over time, as they are written.

    Attributes:
        time: Times of the samples, shape (k,) [s].
        written: Each number at each of them, as text.
    """

    time: Array
    written: list[list[str]]

    def at(self, time: float) -> list[str]:
        """Return the numbers of the last sample that is not later than ``time`` [s]."""
        sample = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return [each[max(sample, 0)] for each in self.written]

    @property
    def widest(self) -> list[str]:
        """The longest text of each number."""
        return [max(each, key=len) for each in self.written]


def live_numbers(result: Result) -> Numbers:
    """Return the numbers that a film shows: force, errors of Jacobian, joints, tool."""
    lines = []
    series = result.series
    if result.experiment.contact is not None:
        lines.append([f"{force:.2f} N" for force in series["normal_force"]])
    if "J_hat" in series and series["J_hat"].shape == series["J"].shape:
        off = np.linalg.norm(series["J_hat"] - series["J"], axis=(1, 2))
        share = 100.0 * off / np.linalg.norm(series["J"], axis=(1, 2))
        lines.append([f"Jacobian off by {each:.0f} %" for each in share])
    if "joint_error" in series:
        lines.append([f"{each:.2f} rad to go" for each in np.abs(series["joint_error"]).max(1)])
    if "pixels" in series:
        lines.append(
            [f"error {format_quantity(float(each), 'px', 2)}" for each in result.pixel_error]
        )
    else:
        lines.append(
            [f"error {format_quantity(float(each), 'm', 2)}" for each in result.position_error]
        )
    return Numbers(result.time - result.time[0], lines)


#: Height of letters in a wide picture and in a narrow one, and width from which it is wide [px].
_LARGE, _SMALL, _WIDE = 14, 12, 480
#: Height of a row over the height of its letters.
_LINE_SPACING = 1.6
_GAP, _EDGE, _BAR = 16, 10, 3
_FIGURE_SPACE = "\u2007"


@dataclass(frozen=True)
class _Colours:
    ground: str
    text: str
    faint: str
    done: str


_THEMES = {
    "light": _Colours("#FFFFFF", "#1A222C", "#D3D9E0", "#55606D"),
    "dark": _Colours("#1C2229", "#E9EDF2", "#37414C", "#A3AEBB"),
}


class _Entry(NamedTuple):
    """A piece of text, with a coloured sign before it."""

    text: str
    sign: str = ""
    colour: str = ""


class Caption:
    """The caption of a film.

    The caption stands in one row if there is room, else in two. In two rows, a name that is too
    long is cut, and numbers that do not fit beside the legend are left out.

    Args:
        results: The run that the film shows, and those beside it.
        settings: What the film shows.
        speed: How much faster than the run it is.
        span: Times of the run at which the film begins and ends [s].
    """

    def __init__(
        self,
        results: Sequence[Result],
        settings: FilmSettings,
        speed: float,
        span: tuple[float, float],
    ) -> None:
        self._size, self._colours = settings.size, _THEMES[settings.theme]
        self._speed, self._span = speed, span
        height = _LARGE if settings.size[0] >= _WIDE else _SMALL
        self._plain, self._bold = _font("DejaVuSans", height), _font("DejaVuSans-Bold", height)
        self._row = round(_LINE_SPACING * height)
        # For several runs, labels beside the paths show the errors.
        numbers = live_numbers(results[0]) if len(results) == 1 else Numbers(results[0].time, [])
        title = " beside ".join(
            each.experiment.name or each.experiment.arm.name for each in results
        )
        room = settings.size[0] - 2 * _EDGE
        before_clock = room - self._width(self._clock(span[1]))
        legend, left = self._that_fit(_legend(results[0]), room)
        widest = [_Entry(text) for text in numbers.widest]
        one_row = self._bold.getlength(title) + _GAP + (room - left) + sum(map(self._width, widest))
        self._rows = 1 if one_row <= before_clock else 2
        if self._rows == 2:
            title = _cut(title, self._bold, before_clock)
            names = self._that_fit(widest, left)[0]
            columns = [numbers.written[widest.index(each)] for each in names]
            numbers = Numbers(numbers.time, columns)
        self._title, self._legend, self._numbers = title, legend, numbers

    @property
    def height(self) -> int:
        """Height of the strip [px]."""
        return self._rows * self._row + _BAR

    def below(self, picture: Image.Image, time: float) -> Image.Image:
        """Return a picture with its caption.

        Args:
            picture: The picture, without the strip's height.
            time: Its time in the run [s].
        """
        whole = Image.new("RGB", self._size, self._colours.ground)
        whole.paste(picture, (0, 0))
        draw = ImageDraw.Draw(whole)
        self._draw_bar(draw, time)
        numbers = [_Entry(text) for text in self._numbers.at(time)]
        y = self._size[1] - self._row * (self._rows - 0.5)
        draw.text((_EDGE, y), self._title, self._colours.text, self._bold, "lm")
        if self._rows == 1:
            left = _EDGE + self._bold.getlength(self._title) + _GAP
            self._draw_from_left(draw, (left, y), self._legend)
            self._draw_from_right(draw, y, [*numbers, self._clock(time)])
        else:
            self._draw_from_right(draw, y, [self._clock(time)])
            self._draw_from_left(draw, (_EDGE, y + self._row), self._legend)
            self._draw_from_right(draw, y + self._row, numbers)
        return whole

    def _draw_bar(self, draw: ImageDraw.ImageDraw, time: float) -> None:
        """Draw how much of the film has passed."""
        width, height = self._size
        top = height - self.height
        begin, end = self._span
        filled_width = round(width * (time - begin) / (end - begin))
        draw.rectangle((0, top, width, top + _BAR - 1), fill=self._colours.faint)
        if filled_width > 0:
            draw.rectangle((0, top, filled_width - 1, top + _BAR - 1), fill=self._colours.done)

    def _draw_from_left(
        self, draw: ImageDraw.ImageDraw, at: tuple[float, float], entries: Sequence[_Entry]
    ) -> None:
        x, y = at
        for entry in entries:
            sign = f"{entry.sign} " if entry.sign else ""
            draw.text((x, y), entry.sign, entry.colour or self._colours.text, self._bold, "lm")
            text_at = (x + self._plain.getlength(sign), y)
            draw.text(text_at, entry.text, self._colours.text, self._plain, "lm")
            x += self._width(entry)

    def _draw_from_right(
        self, draw: ImageDraw.ImageDraw, y: float, entries: Sequence[_Entry]
    ) -> None:
        x: float = self._size[0] - _EDGE
        for entry in reversed(entries):
            draw.text((x, y), entry.text, self._colours.text, self._plain, "rm")
            x -= self._width(entry)

    def _clock(self, time: float) -> _Entry:
        # The clock has the same width during the whole film.
        digits = len(f"{self._span[1]:.1f}")
        text = f"{time:.1f}".rjust(digits, _FIGURE_SPACE) + " s"
        faster = "" if self._speed < 1.005 else f"{self._speed:.3g}×   "
        return _Entry(faster + text)

    def _width(self, entry: _Entry) -> float:
        """Return the width of a piece, with the gap that follows [px]."""
        text = f"{entry.sign} {entry.text}" if entry.sign else entry.text
        return self._plain.getlength(text) + _GAP

    def _that_fit(self, entries: Sequence[_Entry], room: float) -> tuple[list[_Entry], float]:
        """Return the pieces that fit into the room, and the room that is left [px]."""
        names = []
        for entry in entries:
            if (width := self._width(entry)) <= room:
                names.append(entry)
                room -= width
        return names, room


def _legend(result: Result) -> list[_Entry]:
    """Return the objects that the playback draws, with their colours."""
    experiment = result.experiment
    trace = _Entry("traced", "●", TRACED)
    if experiment.target is not None:
        return [_Entry("target", "●", TARGET), trace]
    legend = [_Entry("desired", "●", DESIRED), trace]
    first_pass_end = experiment.desired.traversal + experiment.path_delay
    if not experiment.desired.closed and result.time[-1] - result.time[0] >= first_pass_end * (
        1.0 - 1e-9
    ):
        legend.append(_Entry("end", "■", DESIRED))
    if experiment.contact is not None:
        legend.append(_Entry("force", "↑", FORCE))
    features = experiment.document.features
    further = (each for one in features for each in one.legend(experiment))
    return [*legend, *(_Entry(each.text, each.sign, each.colour) for each in further)]


def _cut(text: str, font: ImageFont.FreeTypeFont, room: float) -> str:
    """Return a text that is as wide as there is room for, or less."""
    if font.getlength(text) <= room:
        return text
    while text and font.getlength(text + "…") > room:
        text = text[:-1]
    return text + "…"


@cache
def _font(name: str, height: int) -> ImageFont.FreeTypeFont:
    """Return a font that comes with Matplotlib, so that a film is alike on all machines."""
    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"
    return ImageFont.truetype(str(file), height)


_ARGUMENTS = (
    "--headless=new",
    # WebGL is drawn by the processor, alike on all machines.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # A page needs no network, and none is used.
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--force-color-profile=srgb",
    "--hide-scrollbars",
    "--mute-audio",
    "--no-first-run",
)
#: Time that one script or the loading of a page may take [s].
_PATIENCE = 180.0


def require_browser() -> None:
    """Check that all that `open_browser` needs is installed.

    Raises:
        InvalidInputError: If something is missing; the message says how to install it.
    """
    _webdriver()
    _programs()


@contextmanager
def open_browser(
    size: tuple[int, int], arguments: Sequence[str] = (), logs: dict[str, str] | None = None
) -> Iterator[Any]:
    """Start Chromium, and end all of its processes when the block ends, also after an error.

    Args:
        size: Width and height of the page [px].
        arguments: More arguments of Chromium.
        logs: Levels of logging, by default ``{"browser": "ALL"}``: the messages of pages.

    Yields:
        Selenium's driver, a ``selenium.webdriver.Chrome``.

    Raises:
        InvalidInputError: If selenium, Chromium or its driver is missing, or does not start.
    """
    webdriver = _webdriver()
    chromium, program = _programs()
    with TemporaryDirectory(prefix="drake_rnn_", ignore_cleanup_errors=True) as scratch:
        options = webdriver.ChromeOptions()
        options.binary_location = chromium
        # Chromium has no sandbox for root.
        for argument in (*_ARGUMENTS, *(["--no-sandbox"] if os.geteuid() == 0 else []), *arguments):
            options.add_argument(argument)
        options.add_argument(f"--user-data-dir={Path(scratch) / 'profile'}")
        options.add_argument("--window-size={},{}".format(*size))
        options.set_capability("goog:loggingPrefs", logs or {"browser": "ALL"})
        # Ctrl-C goes to a whole group: in another one the driver can still end the browser.
        service = webdriver.ChromeService(program, popen_kw={"start_new_session": True})
        try:
            with signals_held():
                driver = _start(webdriver, options, service)
            driver.set_page_load_timeout(_PATIENCE)
            driver.set_script_timeout(_PATIENCE)
            _fit_page(driver, size)
            yield driver
            with signals_held(), suppress(Exception):
                # A browser that has crashed cannot be asked to quit; others are asked only where
                # nobody waits for it.
                driver.quit()
        finally:
            with signals_held():
                _end(service)


def complaints(driver: Any) -> list[str]:
    """Return the errors that the page has logged since the last call."""
    return [
        " ".join(str(entry["message"]).split())
        for entry in driver.get_log("browser")
        if entry["level"] == "SEVERE"
    ]


def _webdriver() -> Any:
    (webdriver,) = import_extra("film", "film", "selenium.webdriver")
    return webdriver


def _programs() -> tuple[str, str]:
    """Return the files of Chromium and of its driver."""
    chromium, driver = find_program("chromium"), find_program("chromedriver")
    missing = [
        name for name, file in (("chromium", chromium), ("chromedriver", driver)) if file is None
    ]
    if chromium is None or driver is None:
        raise InvalidInputError(
            f"film: needs {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} "
            "not installed; on Debian: apt-get install chromium chromium-driver"
        )
    return chromium, driver


def _start(webdriver: Any, options: Any, service: Any) -> Any:
    try:
        return webdriver.Chrome(options=options, service=service)
    except browser_errors() as error:
        raise InvalidInputError(f"film: Chromium does not start: {first_line(error)}") from None


def first_line(error: Exception) -> str:
    """Return the message of an error of selenium, without the stack of the browser's functions."""
    text = str(error).removeprefix("Message:").strip()
    return " ".join(text.splitlines()[0].split()) if text else type(error).__name__


def browser_errors() -> tuple[type[Exception], ...]:
    """Return the classes of the errors that are raised when a browser or its driver fails."""
    selenium, urllib3 = import_module("selenium.common"), import_module("urllib3.exceptions")
    return (selenium.WebDriverException, urllib3.HTTPError)


def _fit_page(driver: Any, size: tuple[int, int]) -> None:
    """Set the size of the page, which differs from that of the window."""
    width, height = size
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def _end(service: Any) -> None:
    """End the browser, its driver and all processes that they have started."""
    process = service.process
    if process is not None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    # It takes a second to find that out.
    with suppress(Exception):
        service.stop()


#: Time that a page may take until it is drawn [s].
_DRAWING_PATIENCE = 120.0
#: Functions that are put into the page.
_SCRIPT = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")


class Player:
    """A playback that a browser shows.

    Args:
        driver: Driver of the browser, whose page has the size of the pictures.
        page: File of the playback.
        settings: What is shown of it.

    Raises:
        InvalidInputError: If the browser cannot draw it.
    """

    def __init__(self, driver: Any, page: Path, settings: FilmSettings) -> None:
        self._driver = driver
        self._do(lambda: driver.get(page.as_uri()))
        self._wait("return Boolean(window.playback && window.playback.ready)")
        self._script(_SCRIPT)
        self._script("window.film.setUp(...arguments)", settings.theme, settings.view)
        self._wait("return window.film.settled()")
        self._overlay = self._read_overlay()

    def pictures(self, times: Array) -> Iterator[Image.Image]:
        """Yield the picture at each time of the run, shape (f,) [s]."""
        for t in times.tolist():
            data = self._script("return window.film.picture(arguments[0])", t)
            picture = _image(data.partition(",")[2]).convert("RGB")
            if self._overlay is not None:
                picture.paste(self._overlay, (0, 0), self._overlay)
            yield picture

    def _read_overlay(self) -> Image.Image | None:
        """Return the labels beside drawings, which are no part of the scene.

        None if there are none, or no room for all of them.
        """
        if not self._script("return window.film.labelled()"):
            return None
        clear = {"color": {"r": 0, "g": 0, "b": 0, "a": 0}}
        self._driver.execute_cdp_cmd("Emulation.setDefaultBackgroundColorOverride", clear)
        self._script("window.film.hideScene(true)")
        shot = self._driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
        self._script("window.film.hideScene(false)")
        self._driver.execute_cdp_cmd("Emulation.setDefaultBackgroundColorOverride", {})
        return _image(shot["data"]).convert("RGBA")

    def _script(self, script: str, *arguments: Any) -> Any:
        return self._do(lambda: self._driver.execute_script(script, *arguments))

    def _wait(self, condition: str) -> None:
        until = monotonic() + _DRAWING_PATIENCE
        while not self._script(condition):
            if monotonic() > until:
                errors = complaints(self._driver)
                raise InvalidInputError(
                    f"film: Chromium has not drawn the playback within {_DRAWING_PATIENCE:g} s"
                    + (f": {errors[0]}" if errors else "")
                )
            sleep(0.05)

    def _do(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except browser_errors() as error:
            raise InvalidInputError(
                f"film: Chromium cannot show the playback: {first_line(error)}"
            ) from None


def _image(data: str) -> Image.Image:
    return Image.open(BytesIO(base64.b64decode(data)))
