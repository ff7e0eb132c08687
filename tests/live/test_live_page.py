"""The live page in a browser: dragged, set, switched, recorded and saved."""

import json
import re
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager
from urllib.request import Request, urlopen

import pytest

from browsing import DESKTOP, PHONE, ask, messages, set_size
from drake_rnn.film.encoding import open_browser, require_browser
from drake_rnn.runs.result import Result
from process_helpers import PATIENCE, wait_for

_LOCAL = ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost"]


@contextmanager
def playing(*what, folder):
    """Yield the address of a page that plays, until Ctrl-C, which ends it well."""
    command = [sys.executable, "-m", "drake_rnn", *what, "--port", "0", "--out", str(folder)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    process = subprocess.Popen(command, **pipes)
    try:
        lines = iter(process.stdout.readline, "")
        yield next(found[0] for line in lines if (found := re.search(r"http://\S+", line)))
    finally:
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, said
    assert "ended" in said


@contextmanager
def page(url):
    require_browser()
    with open_browser(DESKTOP, _LOCAL) as browser:
        browser.get(url)
        assert wait_for(lambda: ask(browser, "Boolean(window.live && live.ready)"))
        yield browser


@contextmanager
def another_page(url):
    """Hold the controls as a page does that was there before, and then give them back."""

    def post(path, key):
        headers = {"Content-Type": "application/json", "X-Key": key}
        return json.load(urlopen(Request(url.rstrip("/") + path, b"null", headers)))

    key, left = post("/controls", "")["key"], threading.Event()
    assert key

    def stay():
        while not left.wait(0.5):
            post("/controls", key)

    staying = threading.Thread(target=stay)
    staying.start()
    try:
        yield
    finally:
        left.set()
        staying.join()
        post("/return", key)


def play_on(browser, seconds):
    """Wait until the experiment has gone on by some seconds of its own time."""
    until = ask(browser, "live.time") + seconds
    assert wait_for(lambda: ask(browser, "live.time") >= until)


def drag(browser, by):
    """Drag the target by pixels, as a mouse does."""
    browser.execute_script(
        """
        const pane = document.getElementById("meshcat-pane"), box = pane.getBoundingClientRect();
        const knob = viewer.scene_tree.find(["desired", "point"]).object;
        const at = knob.getWorldPosition(viewer.camera.position.clone()).project(viewer.camera);
        const x = box.left + (0.5 + at.x / 2) * box.width;
        const y = box.top + (0.5 - at.y / 2) * box.height;
        const tell = (kind, dx, dy) => pane.dispatchEvent(new PointerEvent(kind, {
          bubbles: true, pointerId: 1, button: 0, buttons: 1, clientX: x + dx, clientY: y + dy }));
        pane.setPointerCapture = () => {};
        tell("pointerdown", 0, 0);
        tell("pointermove", arguments[0] / 2, arguments[1] / 2);
        tell("pointermove", arguments[0], arguments[1]);
        tell("pointerup", arguments[0], arguments[1]);
        """,
        *by,
    )


def control(browser, name):
    """Return what a control is set to."""
    return ask(browser, "live.controls[arguments[0]]?.value", name)


def press(browser, selector):
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


_SLIDE = """
  const range = document.querySelector("[data-control='law.kappa']");
  range.value = 800;
  for (const kind of ["input", "change"]) range.dispatchEvent(new Event(kind));"""
_CHOOSE = """
  const select = document.querySelector("[data-control='law']");
  select.value = arguments[0];
  select.dispatchEvent(new Event("change"));"""


def watches_and_cannot_set(browser):
    """A page that comes second says so, and sees the arm move."""
    assert wait_for(lambda: ask(browser, "!document.getElementById('lent').hidden"))
    assert not ask(browser, "live.held")
    assert ask(browser, "document.getElementById('panel').disabled")
    play_on(browser, 0.1)
    assert not ask(browser, "live.held")


@pytest.mark.long
def test_everything_is_done_on_the_page_once_no_other_has_the_controls(tmp_path):
    with playing("live", "slc_nephroid_known", folder=tmp_path) as url, ExitStack() as left:
        with another_page(url):
            browser = left.enter_context(page(url))
            watches_and_cannot_set(browser)
        press(browser, "#ask")
        assert wait_for(lambda: ask(browser, "live.held"))
        assert not ask(browser, "document.getElementById('panel').disabled")
        assert ask(browser, "document.getElementById('lent').hidden")
        press(browser, "[data-press=stop]")
        play_on(browser, 1.5)
        before = ask(browser, "live.desired()")
        drag(browser, (90, -60))
        assert wait_for(lambda: max(map(_far, before, ask(browser, "live.desired()"))) > 0.03)

        press(browser, "#record")
        assert wait_for(lambda: control(browser, "record"))
        browser.execute_script(_SLIDE)
        assert wait_for(lambda: control(browser, "law.kappa") > 10.0)
        play_on(browser, 0.6)
        press(browser, "[data-press=save]")
        said = "document.getElementById('said').textContent"
        assert wait_for(lambda: ask(browser, said).startswith("saved"))
        folder = tmp_path / "slc_nephroid_known_live_1"
        assert Result.load(folder).time[-1] > 0.3
        assert (folder / "playback.html").exists()

        options = ask(browser, "live.controls.law.options")
        law = next(each for each in options if each != control(browser, "law"))
        browser.execute_script(_CHOOSE, law)
        assert wait_for(lambda: control(browser, "law") == law)
        before = ask(browser, "live.time")
        press(browser, "[data-press=reset]")
        assert wait_for(lambda: ask(browser, "live.time") < before)

        set_size(browser, PHONE)
        press(browser, "#details")
        wide = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        assert ask(browser, wide)
        assert not messages(browser)


_LINES = """
  const lines = ["held", "away"].map((id) => document.getElementById(id));
  const boxes = lines.filter((one) => !one.hidden).map((one) => one.getBoundingClientRect());
  const fits = (box, k) => box.right <= innerWidth && (!k || boxes[k - 1].bottom <= box.top);
  return boxes.every(fits);"""


@pytest.mark.long
def test_the_page_says_that_the_target_is_out_of_reach(tmp_path):
    """As long as it is; also on a telephone, above what is said of a target that is out of view."""
    held = "document.getElementById('held').textContent"
    with playing("live", "adaptive_pose", folder=tmp_path) as url, page(url) as browser:
        assert wait_for(lambda: ask(browser, "live.held"))
        assert ask(browser, held) == ""
        press(browser, "[data-press=stop]")
        said = "document.getElementById('said').textContent"
        assert wait_for(lambda: ask(browser, said) == "the target stops")
        browser.execute_script("live.set('target', [0.9, 0.2, 0.9])")
        assert wait_for(lambda: ask(browser, said) == "")
        assert wait_for(lambda: "target out of reach: 0." in ask(browser, held))
        for size in (DESKTOP, PHONE):
            set_size(browser, size)
            assert wait_for(lambda: browser.execute_script(_LINES))
        press(browser, "[data-press=path]")
        assert wait_for(lambda: ask(browser, held) == "")
        assert not messages(browser)


@pytest.mark.long
def test_a_shield_is_led_by_hand(tmp_path):
    """A ball stands where the target is set, which the page tells, for as long as it is there."""
    ball = "obstacles=[{kind: ball, center: [0.35, 0.2, 0.59], radius: 0.05, name: lamp}]"
    limits = "limits={velocity: 1.0, acceleration: 5.0, jerk: 100.0}"
    changes = "--period", "0.01", "--set", ball, "--set", limits
    with playing("shield", "--live", *changes, folder=tmp_path) as url, page(url) as browser:
        assert wait_for(lambda: ask(browser, "live.held"))
        before = ask(browser, "live.desired()")
        drag(browser, (60, -90))
        assert wait_for(lambda: max(map(_far, before, ask(browser, "live.desired()"))) > 0.03)
        browser.execute_script("live.set('target', [0.35, 0.2, 0.59])")
        held = "document.getElementById('held').textContent"
        assert wait_for(lambda: "in lamp" in ask(browser, held))
        assert wait_for(lambda: "near lamp" in ask(browser, held))
        assert ask(browser, "document.getElementById('record').hidden")
        press(browser, "[data-press=reset]")
        assert wait_for(lambda: ask(browser, "live.time") < 3.0)
        set_size(browser, PHONE)
        wide = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        assert ask(browser, wide)
        assert not messages(browser)


def _far(one, other):
    return abs(one - other)
