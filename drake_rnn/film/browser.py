"""Chromium without a window, which draws a page of this package without a network.

- A playback in a browser, picture by picture.
"""

from __future__ import annotations

import base64
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.packages import find_program, import_extra
from ..inputs.processes import signals_held
from .encoding import FilmSettings

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
        until = time.monotonic() + _DRAWING_PATIENCE
        while not self._script(condition):
            if time.monotonic() > until:
                errors = complaints(self._driver)
                raise InvalidInputError(
                    f"film: Chromium has not drawn the playback within {_DRAWING_PATIENCE:g} s"
                    + (f": {errors[0]}" if errors else "")
                )
            time.sleep(0.05)

    def _do(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except browser_errors() as error:
            raise InvalidInputError(
                f"film: Chromium cannot show the playback: {first_line(error)}"
            ) from None


def _image(data: str) -> Image.Image:
    return Image.open(BytesIO(base64.b64decode(data)))
