"""A page in a browser without WebGL: a sentence in place of the picture, and all else."""

from typing import Any

import pytest

from browsing import DESKTOP, PHONE, ask, open_page
from drake_rnn import load_experiment, simulate, write_playback
from drake_rnn.film.encoding import open_browser
from process_helpers import wait_for

NAME = "pinv_line"
#: What is seen, by its place in the page.
SEEN = ("#undrawn", "#chart", "#curves", "#bar", "#outcome .criteria")
UNSEEN = ("#meshcat-pane", "#legend", "#views", "#details")
VISIBLE = "[...document.querySelectorAll(arguments[0])].some((one) => one.offsetHeight > 0)"


@pytest.mark.long
def test_chart_numbers_and_criteria_are_shown_where_no_arm_can_be(
    browser: Any, tmp_path: Any
) -> None:
    """The other browser skips the test where there is none."""
    result = simulate(load_experiment(NAME, {"duration": 0.5}))
    page = write_playback(result, tmp_path / "playback.html")
    with open_browser(DESKTOP, ("--disable-3d-apis",)) as blind:
        for size in (DESKTOP, PHONE):
            open_page(blind, page, size)
            assert "no WebGL" in ask(blind, "document.getElementById('undrawn').textContent")
            assert all(ask(blind, VISIBLE, place) for place in SEEN)
            assert not any(ask(blind, VISIBLE, place) for place in UNSEEN)
            # Time passes, by itself and as it is told.
            assert wait_for(lambda: ask(blind, "playback.time > 0"))
            blind.execute_script("playback.seek(0.25)")
            assert ask(blind, "document.getElementById('clock').textContent") == "0.25 / 0.50 s"
            assert ask(blind, "document.documentElement.scrollWidth <= innerWidth")
    open_page(browser, page, DESKTOP)
    assert not ask(browser, VISIBLE, "#undrawn")
