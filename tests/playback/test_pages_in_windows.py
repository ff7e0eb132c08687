"""Playbacks of eight kinds of experiments, in the window of a desk and of a telephone."""

from __future__ import annotations

import base64
import re
from functools import cache
from typing import Any

import numpy as np
import pytest
from test_playback import Page

from browsing import DESKTOP, PHONE, ask, farthest, messages, open_page, set_size
from drake_rnn import Result, load_experiment, simulate, write_playback
from process_helpers import wait_for

Keys = pytest.importorskip("selenium.webdriver", reason="selenium is not installed").Keys

# Durations [s], and sizes of the pages that showed these runs before the page had a chart, a bar
# and what came out of the run, at 64 frames a second: it may be larger by a fifth.
RUNS = {
    "slc_nephroid_warm_up": (4.0, 2770906),
    "naljdf_clover": (10.0, 3313176),
    "moaljdf_parallelogram": (10.0, 3287210),
    "modified_state_adjustment": (3.0, 2679300),
    "recursive_circle": (6.0, 2927118),
    "adaptive_pose": (4.0, 2873776),
    "contact_circle": (3.0, 2636194),
    "contact_inclined": (3.0, 2636682),
}
# Times that are those of a frame and of a sample as well [s].
TIMES = (0.0, 0.75, 1.5, 2.25)
# Without and with a force; of the others nothing is drawn in a way of its own.
MARKS = dict.fromkeys(("slc_nephroid_warm_up", "contact_circle"), pytest.mark.long)
EACH = [pytest.param(name, marks=MARKS.get(name, pytest.mark.nightly)) for name in RUNS]
PREFIXES = {"": 1.0, "m": 1e-3, "µ": 1e-6, "n": 1e-9}
LIGHTEST = 12.0


@cache
def run(name: str) -> Result:
    changes = {"duration": RUNS[name][0], "window": None, "accept": None}
    return simulate(load_experiment(name, changes))


@pytest.fixture(scope="module", params=EACH)
def shown(request: pytest.FixtureRequest, browser: Any, tmp_path_factory: Any) -> Any:
    """A run and its file, whose page is open."""
    name = request.param
    file = write_playback(run(name), tmp_path_factory.mktemp(name) / "playback.html")
    set_size(browser, DESKTOP)
    messages(browser)
    open_page(browser, file)
    browser.execute_script("playback.pause()")
    return run(name), file


def seek(browser: Any, t: float) -> None:
    browser.execute_script("playback.seek(arguments[0]); viewer.scene.updateMatrixWorld(true)", t)


def quantities(result: Result) -> dict[str, np.ndarray]:
    """Return what a page may show of a run, from the run's own series; shape (k,) each."""
    series, limits, found = result.series, result.experiment.limits, {}
    found["position_error"] = result.position_error
    if "normal_force" in series:
        found["force"] = series["normal_force"]
        found["force_error"] = np.abs(series["normal_force"] - series["normal_force_desired"])
    if "orientation_error" in series:
        found["orientation_error"] = series["orientation_error"]
    if "joint_error" in series:
        found["joint_error"] = np.abs(series["joint_error"]).max(axis=1)
    if "J_hat" in series:
        found["jacobian_error"] = np.linalg.norm(series["J"] - series["J_hat"], axis=(1, 2))
    else:
        found["singular_value"] = np.linalg.svd(series["J"])[1].min(axis=1)
    found["velocity_ratio"] = np.abs(series["velocity"] / limits.velocity).max(axis=1)
    if "torque" in series:
        effort = result.experiment.arm.effort
        found["torque_ratio"] = np.abs(series["torque"] / effort).max(axis=1)
    q = series["position"]
    found["margin"] = np.minimum(q - limits.position_lower, limits.position_upper - q).min(axis=1)
    return found


def number(text: str, unit: str) -> float:
    """Return the first number of a text such as "12.34 µm of 5 N" in its unit."""
    value, prefix = re.match(rf"(\S+)\s*([mµn]?){'' if unit == '1' else unit}", text).groups()
    return float(value.replace("−", "-")) * (1.0 if unit == "1" else PREFIXES[prefix])


def test_the_arm_is_where_the_run_had_it(browser: Any, shown: Any) -> None:
    """Every moving link: Meshcat keeps poses as numbers of 32 bits."""
    result, _ = shown
    arm = result.experiment.arm
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    for t in TIMES:
        seek(browser, t)
        assert ask(browser, "playback.time") == t
        (sample,) = np.flatnonzero(np.isclose(result.time, t, atol=1e-6))
        plant.SetPositions(context, arm.posture(plant, result.series["position"][sample]))
        bodies = ask(
            browser, f"Object.keys(viewer.scene_tree.find(['arm', '{arm.name}']).children)"
        )
        assert len(bodies) >= arm.n
        for name in bodies:
            node = f"viewer.scene_tree.find(['arm', '{arm.name}', '{name}']).object"
            seen = np.reshape(ask(browser, f"{node}.matrixWorld.elements"), (4, 4)).T
            X_WB = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(name)).GetAsMatrix4()
            # In three.js, y points up: (x, z, -y).
            upright = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
            np.testing.assert_allclose(seen, upright @ X_WB, atol=2e-6, err_msg=f"{name} at {t} s")


def test_chart_and_numbers_are_those_of_the_run(browser: Any, shown: Any) -> None:
    result, file = shown
    known = quantities(result)
    curves = {curve["key"]: curve for curve in Page(file).data["curves"]}
    assert len(known.keys() & curves.keys()) >= 3
    for key in known.keys() & curves.keys():
        held = np.frombuffer(base64.b64decode(curves[key]["values"]), dtype="<f4")
        np.testing.assert_allclose(held, known[key], rtol=1e-6, atol=1e-12, err_msg=key)
    for t in TIMES:
        seek(browser, t)
        told = ask(
            browser,
            "[...document.querySelectorAll('#curves button')]"
            ".map(x => [x.dataset.curve, x.querySelector('b').textContent])",
        )
        assert [key for key, _ in told] == list(curves)
        (sample,) = np.flatnonzero(np.isclose(result.time, t, atol=1e-6))
        for key, text in told:
            if key in known and np.isfinite(known[key][sample]):
                # Four digits are told.
                expected = pytest.approx(known[key][sample], rel=6e-4, abs=1e-12)
                assert number(text, curves[key]["unit"]) == expected, (key, t)


def test_keys_and_pointer_move_the_time(browser: Any, shown: Any) -> None:
    result, _ = shown
    body = browser.find_element("tag name", "body")
    seek(browser, 0.5)
    body.send_keys(Keys.SPACE)
    assert ask(browser, "playback.playing")
    assert wait_for(lambda: ask(browser, "playback.time") > 0.5)
    body.send_keys(Keys.SPACE)
    assert not ask(browser, "playback.playing")
    body.send_keys(Keys.END)
    assert ask(browser, "playback.time") == result.time[-1]
    body.send_keys(Keys.ARROW_LEFT)
    assert ask(browser, "playback.time") == pytest.approx(result.time[-1] - 1 / 64)
    body.send_keys(Keys.HOME)
    assert ask(browser, "playback.time") == 0.0
    # A click in the middle of the chart.
    browser.find_element("id", "chart").click()
    middle = ask(browser, "playback.time") / result.time[-1]
    assert 0.4 < middle < 0.6


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_the_whole_arm_and_path_are_in_the_frame(
    browser: Any, shown: Any, size: tuple[int, int]
) -> None:
    result, _ = shown
    set_size(browser, size)
    pane = "document.getElementById('meshcat-pane')"
    canvas = "viewer.renderer.domElement"
    assert wait_for(lambda: ask(browser, f"{pane}.clientWidth <= {size[0]}"))
    assert wait_for(lambda: ask(browser, f"{canvas}.clientWidth == {pane}.clientWidth"))
    browser.execute_script("playback.setView('arm')")
    for t in (*TIMES, float(result.time[-1])):
        seek(browser, t)
        reach = farthest(browser, ["arm", "desired", "traced", "target"])
        assert reach.max() < 1.0, t
    # Seen from near: neither is smaller than it needs to be.
    assert reach.max() > 0.5
    told, drawn, seen = browser.execute_script(_BAR)
    assert told.split()[1] in ("m", "mm")
    assert drawn == pytest.approx(seen, rel=0.02)


# The length that the bar tells, and in pixels the bar and such a length at the view's middle.
_BAR = """
  const bar = document.getElementById("scale"), text = bar.textContent.trim();
  const [number, unit] = text.split(" "), length = number * (unit === "mm" ? 1e-3 : 1);
  const { camera, controls } = viewer, from = controls.target.clone(), to = from.clone();
  camera.updateMatrixWorld();
  to.add(from.clone().setFromMatrixColumn(camera.matrixWorld, 0).setLength(length));
  const [a, b] = [from, to].map((point) => point.project(camera).x);
  const wide = document.getElementById("meshcat-pane").clientWidth;
  return [text, parseFloat(bar.firstElementChild.style.width), (b - a) / 2 * wide];"""


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_is_large_enough_and_stands_out(
    browser: Any, shown: Any, size: tuple[int, int], theme: str
) -> None:
    """Contrast as the Web Content Accessibility Guidelines ask of text: 4.5."""
    set_size(browser, size)
    browser.execute_script(f"playback.setTheme('{theme}')")
    texts = ask(browser, "(" + TEXTS + ")()")
    assert len(texts) > 10
    assert min(text["size"] for text in texts) >= LIGHTEST
    assert [text for text in texts if contrast(text["colour"], text["ground"]) < 4.5] == []
    buttons = ask(
        browser,
        "[...document.querySelectorAll('button, select')].filter(x => "
        "x.offsetParent).map(x => Math.min(x.offsetWidth, x.offsetHeight))",
    )
    assert min(buttons) >= (44 if size == PHONE else 40)
    wide = ask(browser, "document.documentElement.scrollWidth")
    assert wide <= size[0]


# Size, colour and ground of every element with text of its own that is seen.
TEXTS = r"""() => [...document.body.querySelectorAll("*")].filter((one) => one.checkVisibility()
    && [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim())
    && !["SCRIPT", "STYLE", "OPTION"].includes(one.tagName)
    && !one.closest("#legend .axes, .arrow, .dg")).map((one) => {
  let ground = one;
  const opaque = (of) => !/^rgba.*, 0\)$/.test(getComputedStyle(of).backgroundColor);
  while (!opaque(ground)) ground = ground.parentElement;
  const style = getComputedStyle(one);
  return { text: one.textContent.slice(0, 30), size: parseFloat(style.fontSize),
    colour: style.color, ground: getComputedStyle(ground).backgroundColor };
})"""


def contrast(one: str, other: str) -> float:
    """Return the ratio of luminances of two colours of a page, opaque as they stand."""

    def luminance(colour: str) -> float:
        rgb = np.array([float(x) for x in re.findall(r"[\d.]+", colour)[:3]]) / 255.0
        linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_it_stays_as_small_as_it_was_and_says_nothing(browser: Any, shown: Any) -> None:
    """The last of these tests: nothing that they did made the browser complain."""
    result, file = shown
    assert file.stat().st_size <= 1.2 * RUNS[result.experiment.name][1]
    assert messages(browser) == []
