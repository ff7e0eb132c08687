"""The site that `make docs` has built opens without a network; skipped where there is none."""

from functools import cache
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest
from doc_pages import ROOT

from browsing import DESKTOP, PHONE, messages, set_size
from process_helpers import wait_for

SITE = ROOT / "build" / "site"
PAGES = sorted(
    str(file.relative_to(SITE))
    for file in SITE.rglob("*.html")
    if "_modules" not in file.parts and "playbacks" not in file.parts
)

pytestmark = pytest.mark.skipif(not PAGES, reason="make docs has not been run")


class _Links(HTMLParser):
    """What a page loads, what it links to, and what can be linked to in it."""

    def __init__(self):
        super().__init__()
        self.loaded, self.linked, self.names = set(), set(), set()

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if name := given.get("id"):
            self.names.add(name)
        if tag == "a" and given.get("href"):
            self.linked.add(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon"):
            self.loaded.add(given["href"])
        elif given.get("src"):
            self.loaded.add(given["src"])


@cache
def links(page):
    found = _Links()
    found.feed((SITE / page).read_text())
    return found


@pytest.mark.parametrize("page", PAGES)
def test_a_page_loads_only_files_of_the_site(page):
    for address in links(page).loaded:
        parts = urlsplit(address)
        assert parts.scheme in ("", "data"), address
        if not parts.scheme:
            assert ((SITE / page).parent / unquote(parts.path)).is_file(), address


@pytest.mark.parametrize("page", PAGES)
def test_every_link_of_a_page_leads_somewhere(page):
    for address in links(page).linked:
        parts = urlsplit(address)
        if parts.scheme or parts.netloc:
            assert parts.scheme in ("https", "mailto"), address
            continue
        target = (SITE / page).parent / unquote(parts.path) if parts.path else SITE / page
        assert target.is_file(), address
        if parts.fragment and target.suffix == ".html":
            name = str(target.resolve().relative_to(SITE))
            assert unquote(parts.fragment) in links(name).names, address


@pytest.mark.long
def test_formulas_are_drawn_without_a_network(browser):
    browser.get((SITE / "docs" / "reference" / "laws.html").as_uri())
    drawn, wrong = browser.execute_async_script(
        """
        const done = arguments[0];
        MathJax.startup.promise.then(() => done([
          document.querySelectorAll("mjx-container svg").length,
          document.querySelectorAll("mjx-merror, [data-mjx-error]").length]));
        """
    )
    assert drawn >= 15
    assert wrong == 0


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
@pytest.mark.parametrize(
    "page",
    [
        *("docs/index", "docs/claims", "docs/choosing", "docs/experiments"),
        *("notebooks/shield", "COMPATIBILITY", "SECURITY"),
    ],
)
@pytest.mark.long
def test_no_page_is_wider_than_its_window(page, size, browser):
    set_size(browser, size)
    browser.get((SITE / f"{page}.html").as_uri())
    assert browser.execute_script("return document.documentElement.scrollWidth") <= size[0]


def search(browser, asked):
    """Return titles and excerpts of what is found, in their order."""
    browser.get((SITE / "search.html").as_uri() + f"?q={asked.replace(' ', '+')}")
    done = "return document.querySelector('.search-summary, #search-results p').textContent"
    assert wait_for(lambda: "finished" in browser.execute_script(done))
    return browser.execute_script(
        """
        const found = document.querySelectorAll("#search-results :is(.kind-text, .kind-title)");
        const textOf = (item, name) => item.querySelector(name)?.textContent ?? "";
        return [...found].map((item) => [textOf(item, "a"), textOf(item, "p")]);
        """
    )


@pytest.mark.parametrize(
    ("asked", "first"),
    [
        ("motion-force control", "Motion-force control"),
        ("simultaneous learning", "Simultaneous learning and control"),
        ("jerk limit", "The adaptive law"),
        ("driving a robot", "Driving a robot"),
    ],
)
@pytest.mark.long
def test_a_search_has_what_is_asked_first_and_shows_excerpts(asked, first, browser):
    """Without a server, from which a page could fetch others."""
    items = search(browser, asked)
    assert items[0][0] == first
    assert any(word in items[0][1].lower() for word in asked.split())
    assert sum(bool(excerpt) for _, excerpt in items) > 0.8 * len(items)
    assert messages(browser) == []


#: What readers search, and the pages of which one is among the first three.
WANTED = {
    "unknown Jacobian": "Simultaneous learning and control",
    "obstacle avoidance": "Obstacles and safe commands",
    "install": "Troubleshooting",
    "own robot URDF": "Your own robot",
    "LeRobot": "A shield between a policy and an arm",
    "compile to C": "Campaigns and tuning",
    "press on a surface": "Pressing on a surface",
    "drive an iiwa": "Driving a robot",
    "units of metrics": "Metrics",
    "figures for a paper": "Figures, tables and data",
    "many robots at once": "Use from Python",
    "law of my own": "A law of your own",
    "how to install": "drake_rnn documentation",
    "policy chunk": "A shield between a policy and an arm",
    "contact force": "Motion-force control",
    "second arm": "Obstacles and safe commands",
    "learn Jacobian": "Simultaneous learning and control",
    "payload": "Obstacles and safe commands",
    "playback": "Experiments and the command line",
    "safety filter": "Obstacles and safe commands",
    "real robot": "Driving a robot",
    "ROS 2": "Figures, tables and data",
    "gripper": "Experiments and the command line",
    "torque limit": "Joint torques",
}


_IS_WIDE = "return document.querySelector('canvas').getBoundingClientRect().width > 500"


@pytest.mark.long
def test_a_search_has_the_page_that_a_reader_wants_among_the_first_three(browser):
    """Once among a third of the pages in the order of the alphabet."""
    far = {}
    for asked, wanted in WANTED.items():
        titles = [title for title, _ in search(browser, asked)][:3]
        if wanted not in {title.partition(" > ")[0] for title in titles}:
            far[asked] = titles
    assert far == {}


@pytest.mark.long
def test_the_start_page_shows_three_runs_that_play(browser):
    """Before anything is installed: pictures, and playbacks in which a run is seen."""
    for size in (DESKTOP, PHONE):
        set_size(browser, size)
        browser.get((SITE / "docs" / "index.html").as_uri())
        widths = browser.execute_script(
            """
            return [...document.querySelectorAll("article table:first-of-type img")]
              .slice(0, 3).map((image) => image.complete && image.naturalWidth
                && image.getBoundingClientRect().width);
            """
        )
        assert len(widths) == 3
        assert min(widths) > 90
    links = browser.execute_script(
        "return [...document.querySelectorAll('a[href*=\"playbacks/\"]')].map((each) => each.href)"
    )
    assert len(links) == 3
    # A page that is loaded once is made wide: to draw it anew takes seconds.
    for link in links:
        set_size(browser, PHONE)
        browser.get(link)
        assert wait_for(lambda: browser.execute_script("return !!document.querySelector('canvas')"))
        assert messages(browser) == []
        set_size(browser, DESKTOP)
        assert wait_for(lambda: browser.execute_script(_IS_WIDE))
        assert messages(browser) == []
