"""What a reader does with a page: values, links, zoom, loops, keys and files.

The browser has no WebGL: all of this needs no picture, and is quick without one.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_playback import Page, floats

from browsing import DESKTOP, PHONE, ask, chromium, messages, set_size
from drake_rnn import Result, load_experiment, simulate, write_playback
from process_helpers import wait_for

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
Keys = webdriver.Keys
pytestmark = pytest.mark.long
DURATION = 0.8
CHANGES = {
    "duration": DURATION,
    "path.period": DURATION,
    "path.by": [0.02, 0.03, 0.0],
    "window": [0.2, DURATION],
    "log_period": 0.01,
    "limits.acceleration": 5.0,
    "accept": {"position_error_max_m": {"at_most": 1e-4}},
}


@pytest.fixture(scope="module")
def runs() -> list[Result]:
    """A run that is accepted, and a later one that is not."""
    worse = {"name": "worse", "period": 0.02, "accept.position_error_max_m.at_most": 1e-12}
    changes = ({"name": "better"}, worse)
    return [simulate(load_experiment("pinv_line", CHANGES | each)) for each in changes]


@pytest.fixture(scope="module")
def pages(runs: list[Result], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The page of the first run alone, and with the other one beside it."""
    folder = tmp_path_factory.mktemp("used")
    alone = write_playback(runs[0], folder / "alone.html", 8)
    return [alone, write_playback(runs[0], folder / "both.html", 8, beside=runs[1:])]


@pytest.fixture(scope="module")
def blind() -> Iterator[Any]:
    """A browser without WebGL."""
    with chromium("--disable-3d-apis") as driver:
        yield driver


def opened(blind: Any, page: Path, address: str = "") -> None:
    """Open a page anew, with an address behind a hash sign."""
    set_size(blind, DESKTOP)
    blind.get("about:blank")
    blind.get(page.as_uri() + address)
    assert wait_for(lambda: ask(blind, "Boolean(window.playback && playback.ready)"))


def text(blind: Any, place: str) -> str:
    return str(ask(blind, "document.querySelector(arguments[0]).textContent", place))


def press(blind: Any, *keys: str) -> None:
    for key in keys:
        blind.find_element("tag name", "body").send_keys(key)


def test_an_address_leads_to_what_it_names_and_is_given_for_it(blind: Any, pages: Any) -> None:
    asked = "#t=0.3&view=arm&curve=margin,position_error&speed=0.5&loop=0.2,0.5&zoom=0.1,0.6"
    opened(blind, pages[0], asked + "&theme=dark")
    assert ask(blind, "playback.time") == 0.3
    assert not ask(blind, "playback.playing")
    pressed = (
        "[...document.querySelectorAll('#curves [aria-pressed=true]')].map(x => x.dataset.curve)"
    )
    assert ask(blind, pressed) == ["position_error", "margin"]
    assert ask(blind, "document.getElementById('speed').value") == "0.5"
    assert ask(blind, "document.documentElement.dataset.theme") == "dark"
    assert ask(blind, "playback.link") == f"{pages[0].as_uri()}{asked}&theme=dark"
    # A page that is open goes where its address is changed to.
    blind.execute_script("location.hash = 't=0.45'")
    assert wait_for(lambda: ask(blind, "playback.time") == 0.45)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("t=9", "t: must be a time from 0 to 0.8 s, not 9"),
        ("curve=nothing", "curve: may be position_error, "),
        ("loop=0.5,0.2", "loop: must be two times, such as loop=1,2.5, not 0.5,0.2"),
        ("theme=red", "theme: may be auto, light, dark, not red"),
        ("volume=3", "volume: may be t, view, theme, speed, loop, zoom, curve"),
        ("scale=red", "scale: may be log, linear, not red"),
        ("y=2,1", "y: must be two numbers for each axis, such as y=1e-9,1e-6, not 2,1"),
        ("scale=log&y=-1,1", "y: no axis from -1 to 1"),
        ("t=9&theme=red", "not 9; theme: may be auto, light, dark, not red"),
    ],
)
def test_of_an_address_that_cannot_be_shown_the_page_says_why(
    blind: Any, pages: Any, address: str, said: str
) -> None:
    """What is wrong there keeps nothing else from being shown."""
    if not ask(blind, "location.href").startswith(pages[0].as_uri()):
        opened(blind, pages[0])
    blind.execute_script("location.hash = `${arguments[0]}&speed=2`", address)
    assert wait_for(lambda: said in text(blind, "#notice"))
    assert ask(blind, "document.getElementById('speed').value") == "2"


def test_colours_that_were_chosen_are_there_after_a_reload(blind: Any, pages: Any) -> None:
    opened(blind, pages[0])
    press(blind, "t")
    chosen = ask(blind, "document.documentElement.dataset.theme")
    press(blind, "t")
    other = ask(blind, "document.documentElement.dataset.theme")
    assert {chosen, other} == {"light", "dark"}
    opened(blind, pages[0])
    assert ask(blind, "document.documentElement.dataset.theme") == other
    blind.execute_script("localStorage.clear()")


def test_values_are_told_where_the_pointer_is(blind: Any, pages: Any, runs: list[Result]) -> None:
    opened(blind, pages[0], "#t=0.1&curve=margin")
    curve = {one["key"]: one for one in Page(pages[0]).data["curves"]}["margin"]
    time, values = floats(curve["time"]), floats(curve["values"])
    for share in (0.25, 0.5, 0.9):
        blind.execute_script(
            """
            const chart = document.getElementById("chart"), box = chart.getBoundingClientRect();
            const style = getComputedStyle(document.getElementById("numbers"));
            const margin = (side) => parseFloat(style.getPropertyValue(`--plot-${side}`));
            const along = arguments[0] * (box.width - margin("left") - margin("right"));
            const [clientX, clientY] = [box.left + margin("left") + along, box.top + 40];
            chart.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY }));
            """,
            share,
        )
        at, _, told = text(blind, "#hover").partition(" s")
        assert float(at) == pytest.approx(share * DURATION, abs=2e-3)
        expected = values[np.argmin(np.abs(time - float(at)))]
        assert f"{expected:.4g}" in told
    # It stays where it was.
    assert ask(blind, "playback.time") == 0.1


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
@pytest.mark.parametrize("address", ["", "&curve=position_error,margin", "&zoom=0.2,0.6"])
def test_slider_and_chart_share_the_axis_of_time(
    blind: Any, pages: Any, size: tuple[int, int], address: str
) -> None:
    """The middle of the slider's thumb is below the cursor, which is where the margins say."""
    opened(blind, pages[0], f"#t=0.35{address}")
    set_size(blind, size)
    places = """(() => {
      const of = (id) => document.getElementById(id).getBoundingClientRect();
      const style = getComputedStyle(document.getElementById("numbers"));
      const margin = (side) => parseFloat(style.getPropertyValue(`--plot-${side}`));
      const [left, right] = [margin("left"), margin("right")];
      const slider = document.getElementById("scrubber"), thumb = 18;
      const share = (slider.value - slider.min) / (slider.max - slider.min);
      const box = of("scrubber"), chart = of("chart");
      return [box.left + thumb / 2 + share * (box.width - thumb),
        chart.left + left + share * (chart.width - left - right)];
    })()"""
    assert wait_for(lambda: ask(blind, "innerWidth") == size[0])
    thumb, cursor = ask(blind, places)
    assert thumb == pytest.approx(cursor, abs=1.0)


def test_what_is_accepted_and_when_is_told_below_the_numbers(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#t=0.1&loop=0.2,0.5")
    legend = text(blind, "#chart-legend")
    assert "accepted: largest ≤ 0.1 mm" in legend
    assert "errors evaluated from 0.2 to 0.8 s" in legend
    assert "loop from 0.2 to 0.5 s" in legend
    press(blind, "l")
    assert "loop" not in text(blind, "#chart-legend")
    press(blind, "l")
    assert "loop from 0.2 to 0.5 s" in text(blind, "#chart-legend")


def test_curves_of_two_units_are_drawn_together_and_of_no_third(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#t=0.1")
    press(blind, "o")
    for key in ("margin", "velocity_ratio"):
        blind.find_element("css selector", f"[data-curve={key}]").click()
    assert "curve=position_error,margin" in ask(blind, "playback.link")
    assert "both y axes are in use (m, rad)" in text(blind, "#notice")


def test_saved_curves_are_those_of_the_run(blind: Any, pages: Any, runs: list[Result]) -> None:
    """To the 32 bits that a page holds."""
    opened(blind, pages[1], "#t=0.1")
    rows = list(csv.DictReader(ask(blind, "playback.csv").splitlines()))
    assert list(rows[0]) == ["time_s", "better:position_error_m", "worse:position_error_m"]
    for run, name in zip(runs, ("better", "worse"), strict=True):
        column = f"{name}:position_error_m"
        time, error = zip(
            *((float(row["time_s"]), float(row[column])) for row in rows if row[column]),
            strict=True,
        )
        np.testing.assert_allclose(time, run.time, atol=1e-6)
        np.testing.assert_allclose(error, run.position_error, rtol=1e-6, atol=1e-12)


def test_time_goes_by_samples_and_stays_in_a_loop(
    blind: Any, pages: Any, runs: list[Result]
) -> None:
    opened(blind, pages[0], "#t=0.2")
    (here,) = np.flatnonzero(np.isclose(runs[0].time, 0.2))
    for key, sample in ((".", here + 1), (".", here + 2), (",", here + 1)):
        press(blind, key)
        assert ask(blind, "playback.time") == pytest.approx(runs[0].time[sample], abs=1e-6)
    blind.execute_script("playback.setLoop([0.3, 0.4]); playback.play()")
    assert wait_for(lambda: ask(blind, "playback.time") >= 0.3)
    times: list[float] = []

    def begun_again() -> bool:
        times.append(ask(blind, "playback.time"))
        return bool(np.any(np.diff(times) < 0.0))

    assert wait_for(begun_again)
    assert min(times) >= 0.3
    assert max(times) < 0.4


def test_the_chart_is_zoomed_and_follows_the_time(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#t=0.4")
    press(blind, "+", "+")
    begin, end = ask(blind, "['min', 'max'].map(x => +document.getElementById('scrubber')[x])")
    assert begin < 0.4 < end
    assert end - begin == pytest.approx(DURATION / 1.6**2)
    blind.execute_script("playback.seek(0.78)")
    begin, end = ask(blind, "['min', 'max'].map(x => +document.getElementById('scrubber')[x])")
    assert begin < 0.78 <= end <= DURATION
    press(blind, "0")
    assert ask(blind, "document.getElementById('zoomed').hidden")


_WHEEL = """
  const axis = document.querySelectorAll("#plot .axis")[arguments[0]];
  const { left, top, height } = axis.getBoundingClientRect();
  // The plot is 12 pixels below the upper end of its axis.
  axis.dispatchEvent(new WheelEvent("wheel", { deltaY: arguments[1], cancelable: true,
    clientX: left + 10, clientY: top + (height + 12) / 2 }));"""


def y_axis(blind: Any) -> list[float]:
    """The ends of the y axes that were chosen by hand."""
    asked = dict(part.split("=") for part in ask(blind, "playback.link").split("#")[1].split("&"))
    return [float(end) for end in asked.get("y", "").split(",") if end]


def test_a_y_axis_is_zoomed_moved_and_fitted_without_the_time(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#y=1,10&scale=log&t=0.4&curve=margin")
    assert y_axis(blind) == [1.0, 10.0]
    blind.execute_script(_WHEEL, 0, -100)
    # About its middle: 10^(1/2 -+ 1/3.2).
    assert y_axis(blind) == pytest.approx([10**0.1875, 10**0.8125], rel=1e-2)
    blind.execute_script(_WHEEL, 0, 100)
    assert y_axis(blind) == pytest.approx([1.0, 10.0], rel=1e-2)
    assert ask(blind, "document.getElementById('zoomed').hidden")
    assert ask(blind, "playback.time") == 0.4
    # Dragged upwards, smaller values come into view.
    axis = blind.find_element("css selector", "#plot .axis")
    chain = webdriver.ActionChains(blind)
    chain.click_and_hold(axis).move_by_offset(0, -20).release().perform()
    low, high = y_axis(blind)
    assert low < 0.9
    assert high / low == pytest.approx(10.0, rel=1e-3)
    webdriver.ActionChains(blind).double_click(axis).perform()
    assert y_axis(blind) == []
    assert "charted" not in ask(blind, "document.body.className")
    press(blind, "v")
    less = y_axis(blind)
    press(blind, "V", "V")
    low, high = y_axis(blind)
    assert low < less[0] < less[1] < high
    press(blind, "0")
    assert y_axis(blind) == []
    # Each of two axes by itself; other curves have axes that suit them.
    blind.execute_script("location.hash = 'curve=position_error,margin'")
    assert wait_for(lambda: "curve=position_error,margin" in ask(blind, "playback.link"))
    blind.execute_script(_WHEEL, 1, -100)
    assert len(y_axis(blind)) == 4
    press(blind, "y")
    assert y_axis(blind) == []


def test_the_chart_takes_half_of_the_page_and_small_room_again(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#t=0.2")
    height, whole = "document.getElementById('chart').clientHeight", ask(blind, "innerHeight")
    small = ask(blind, height)
    press(blind, "b")
    assert ask(blind, height) > 0.4 * whole
    press(blind, "b")
    assert ask(blind, height) == small


def test_keys_are_listed_and_the_row_of_curves_is_one_stop(blind: Any, pages: Any) -> None:
    opened(blind, pages[0], "#t=0.2")
    press(blind, "?")
    assert ask(blind, "document.getElementById('keys').open")
    listed = text(blind, "#keys-list")
    assert all(words in listed for words in ("play or pause", "a sample", "loop", "full screen"))
    press(blind, "?")
    assert not ask(blind, "document.getElementById('keys').open")
    stops = "[...document.querySelectorAll('#curves button')].filter(x => x.tabIndex === 0).length"
    assert ask(blind, stops) == 1
    blind.execute_script("document.querySelector('#curves button').focus()")
    blind.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
    # The arrow has moved the focus, and not the time.
    assert ask(blind, "document.activeElement.dataset.curve") != "position_error"
    assert ask(blind, "playback.time") == 0.2
    blind.switch_to.active_element.send_keys(Keys.ENTER)
    assert ask(blind, "document.activeElement.getAttribute('aria-pressed')") == "true"


def test_each_run_beside_another_has_its_verdict_curve_and_number(blind: Any, pages: Any) -> None:
    opened(blind, pages[1], "#t=0.4")
    verdicts = ask(
        blind, "[...document.querySelectorAll('.verdict strong')].map(x => x.textContent)"
    )
    assert verdicts == ["✓ better: accepted", "✗ worse: not accepted"]
    assert " | " in text(blind, "[data-curve=position_error] b")
    legend = text(blind, "#chart-legend")
    assert "accepted (better): largest ≤ 0.1 mm" in legend
    assert "✗ accepted (worse)" in legend
    lines = ask(blind, "[...document.querySelectorAll('#chart-legend i')].slice(0, 4)")
    looks = {line.value_of_css_property("background-image").partition("(")[2] for line in lines}
    assert len(looks) == 3


def test_joints_are_listed_and_drawn_with_their_limits(
    blind: Any, pages: Any, runs: list[Result]
) -> None:
    opened(blind, pages[0], "#t=0.4")
    (here,) = np.flatnonzero(np.isclose(runs[0].time, 0.4))
    told = ask(blind, "[...document.querySelectorAll('#joints b')].map(x => x.textContent)")
    expected = [
        f"{round(q, 3) + 0.0:.3f} rad".replace("-", "−") for q in runs[0].series["position"][here]
    ]
    assert told == expected
    lower = runs[0].experiment.limits.position_lower[3]
    blind.execute_script("document.querySelectorAll('#joints button')[3].click()")
    pressed = "document.querySelectorAll('#joints button')[3].getAttribute('aria-pressed')"
    assert ask(blind, pressed) == "true"
    legend = text(blind, "#chart-legend")
    assert "position of panda_joint4" in legend
    assert legend.count("mrad") == 0
    assert f"bound −{abs(lower):.4g} rad" in text(blind, "#chart-legend")


def test_it_complains_of_nothing(blind: Any) -> None:
    """The last of these tests."""
    assert [one for one in messages(blind) if "WebGL" not in one["message"]] == []
