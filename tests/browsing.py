"""Pages in a real browser, in windows of a real size."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from drake_rnn.film.encoding import open_browser, require_browser
from process_helpers import wait_for

DESKTOP, PHONE = (1400, 900), (390, 800)


@contextmanager
def chromium(*arguments: str) -> Iterator[Any]:
    """Yield a headless browser without a network; without one skip the test, but not in CI.

    Args:
        arguments: More arguments of Chromium.
    """
    try:
        require_browser()
    except InvalidInputError as error:
        if "CI" in os.environ:
            raise
        pytest.skip(str(error))
    logs = {"browser": "ALL", "performance": "ALL"}
    with open_browser(DESKTOP, arguments, logs) as driver:
        yield driver


def requests(browser: Any) -> Iterator[dict[str, Any]]:
    """Yield what was asked of a network, or of files, since this was asked last."""
    for entry in browser.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            yield message["params"]


def set_size(browser: Any, size: tuple[int, int]) -> None:
    """Give the window a size; a narrow one is a telephone's, which a window cannot be."""
    width, height = size
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def open_page(browser: Any, page: Path, size: tuple[int, int] | None = None) -> None:
    """Open a playback, and wait until it can be asked."""
    if size is not None:
        set_size(browser, size)
    browser.get(page.as_uri())
    assert wait_for(lambda: ask(browser, "Boolean(window.playback && playback.ready)"))


def ask(browser: Any, expression: str, *arguments: Any) -> Any:
    """Return the value of an expression of the page."""
    return browser.execute_script(f"return {expression}", *arguments)


def messages(browser: Any) -> list[Any]:
    """Return what the browser has complained about since it was last asked."""
    return [one for one in browser.get_log("browser") if one["level"] in ("SEVERE", "WARNING")]


def farthest(browser: Any, places: list[str]) -> Any:
    """Return how far what is drawn below some places of the scene reaches in the picture.

    Returns:
        The largest distances from the middle, to the side and up or down; 1 at the edge.
    """
    return np.array(browser.execute_script(f"return ({_FARTHEST})(arguments[0])", places))


_FARTHEST = """(places) => {
  viewer.render();
  const reach = [0, 0];
  for (const place of places) {
    viewer.scene_tree.find([place]).object.traverse((mesh) => {
      if (!mesh.isMesh || !mesh.visible) return;
      mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      for (let k = 0; k < 8; k++) {
        const corner = [k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z];
        const seen = min.clone().set(...corner);
        seen.applyMatrix4(mesh.matrixWorld).project(viewer.camera);
        reach[0] = Math.max(reach[0], Math.abs(seen.x));
        reach[1] = Math.max(reach[1], Math.abs(seen.y));
      }
    });
  }
  return reach;
}"""
