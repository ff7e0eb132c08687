"""A playback in a browser without a network."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drake_rnn.experiment import load_experiment
from drake_rnn.playback import write_playback
from drake_rnn.runs.simulation import simulate

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
DURATION = 2.0


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("Debian's chromium and chromium-driver are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless",
        "--no-sandbox",  # chromium refuses a sandbox for root
        "--use-angle=swiftshader",  # WebGL without a graphics card
        "--enable-unsafe-swiftshader",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--disable-quic",
        "--disable-sync",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-dev-shm-usage",
        "--no-first-run",
        "--window-size=640,400",
        f"--user-data-dir={tmp_path / 'profile'}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.set_page_load_timeout(30)
    try:
        yield driver
    finally:
        driver.quit()


def wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.05)
    return False


def test_a_playback_plays_without_a_network(browser: Any, tmp_path: Path) -> None:
    changes = {"duration": DURATION, "window": None}
    result = simulate(load_experiment("slc_nephroid_known", changes))
    page = write_playback(result, tmp_path / "playback.html")
    browser.get(page.as_uri())

    def ask(expression: str) -> Any:
        return browser.execute_script(f"return {expression}")

    # It plays by itself and in a loop, with all tracks in step.
    assert wait_for(lambda: ask("viewer.animator.actions.length") > 0)
    assert ask("viewer.animator.playing")
    assert ask("viewer.animator.duration") == DURATION
    assert wait_for(lambda: ask("viewer.animator.mixer.time") > 0.1)
    browser.execute_script("viewer.animator.mixer.timeScale = 5")
    assert wait_for(lambda: ask("viewer.animator.mixer.time") > 1.5 * DURATION)
    assert ask("viewer.animator.playing")
    times = ask("viewer.animator.actions.map(action => action.time)")
    assert max(times) - min(times) < 1e-6

    # The tool's origin is E, and the traced path follows it. In three.js, y points up.
    browser.execute_script("viewer.animator.pause()")
    shown = []
    for sample in (0, 50, 125, 200):
        t = result.time[sample]
        browser.execute_script(f"viewer.animator.seek({t}); viewer.scene.updateMatrixWorld(true);")
        tool = "viewer.scene_tree.find(['arm', 'panda', 'tool']).object"
        x, y, z = ask(f"{tool}.matrixWorld.elements.slice(12, 15)")
        np.testing.assert_allclose([x, -z, y], result.series["p_WE"][sample], atol=1e-3)
        pieces = "Object.values(viewer.scene_tree.find(['traced', 'path']).children)"
        shown.append(ask(f"{pieces}.filter(piece => piece.object.visible).length"))
    assert shown[0] == 0
    assert np.all(np.diff(shown) > 0)
    assert shown[-1] == ask(f"{pieces}.length")

    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    messages = [json.loads(entry["message"]) for entry in browser.get_log("performance")]
    requests = [
        message["message"]["params"]
        for message in messages
        if message["message"]["method"] == "Network.requestWillBeSent"
    ]
    # Other requests are those of the empty tab before.
    urls = {sent["request"]["url"] for sent in requests if sent["documentURL"] == page.as_uri()}
    assert {url for url in urls if not url.startswith("data:")} == {page.as_uri()}


def test_the_ghost_stands_still_while_the_arm_comes_to_it(browser: Any, tmp_path: Path) -> None:
    result = simulate(load_experiment("modified_state_adjustment"))
    browser.get(write_playback(result, tmp_path / "playback.html").as_uri())
    assert wait_for(lambda: browser.execute_script("return viewer.animator.actions.length") > 0)
    browser.execute_script("viewer.animator.pause()")

    def poses(scene: str, t: float) -> Any:
        browser.execute_script(f"viewer.animator.seek({t}); viewer.scene.updateMatrixWorld(true);")
        return np.array(
            [
                browser.execute_script(
                    f"return viewer.scene_tree.find(['{scene}', 'iiwa14', 'iiwa_link_{k}'])"
                    ".object.matrixWorld.elements"
                )
                for k in range(1, 8)
            ]
        )

    ghost = poses("target", 0.0)
    assert np.abs(poses("arm", 0.0) - ghost).max() > 0.1
    np.testing.assert_allclose(poses("arm", result.time[-1]), ghost, atol=1e-4)
    np.testing.assert_array_equal(poses("target", result.time[-1]), ghost)
    # The viewer knows every property of the ghost.
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


@pytest.mark.parametrize("size", [(900, 600), (500, 800)])
def test_labels_are_below_their_drawings_in_any_window(
    browser: Any, tmp_path: Path, size: tuple[int, int]
) -> None:
    """A narrow window, such as a telephone's, shows the whole width."""
    changes = {"period": 5e-3, "accept": None}
    naljdf, galjdf = (
        simulate(load_experiment(f"{scheme}_clover_iiwa", changes | {"name": scheme}))
        for scheme in ("naljdf", "galjdf")
    )
    browser.set_window_size(*size)
    page = write_playback(naljdf, tmp_path / "playback.html", 8, beside=[galjdf])
    browser.get(page.as_uri())
    width, height = browser.execute_script("return [innerWidth, innerHeight]")

    def places() -> list[dict[str, float]]:
        script = """return [...document.querySelectorAll(".label")].map(label => {
            const {left, right, top} = label.getBoundingClientRect();
            return {left, right, top};
        })"""
        found: list[dict[str, float]] = browser.execute_script(script)
        return found

    def seen() -> bool:
        inside = all(
            label["left"] > 0 and label["right"] < width and height / 3 < label["top"] < height
            for label in places()
        )
        one, other = sorted(places(), key=lambda label: label["left"])
        return inside and one["right"] < other["left"]

    assert wait_for(lambda: browser.execute_script("return viewer.animator.actions.length") > 0)
    assert wait_for(seen), places()
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
