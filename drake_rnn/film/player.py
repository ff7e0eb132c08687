"""A playback in a browser, picture by picture."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .browser import browser_errors, complaints, first_line
from .settings import FilmSettings

#: Time that a page may take until it is drawn [s].
_PATIENCE = 120.0
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
        until = time.monotonic() + _PATIENCE
        while not self._script(condition):
            if time.monotonic() > until:
                said = complaints(self._driver)
                raise InvalidInputError(
                    f"film: Chromium has not drawn the playback within {_PATIENCE:g} s"
                    + (f": {said[0]}" if said else "")
                )
            time.sleep(0.05)

    def _do(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except browser_errors() as error:
            raise InvalidInputError(
                f"film: Chromium cannot show the playback: {first_line(error)}"
            ) from None


def _image(encoded: str) -> Image.Image:
    return Image.open(BytesIO(base64.b64decode(encoded)))
