"""The pages of a report in a browser without a network."""

import pytest

from browsing import DESKTOP, PHONE, requests, set_size


@pytest.mark.long
def test_pages_open_fit_filter_and_lead_to_their_rows(browser, tiny, report):
    folder = report(tiny(), pictures=True, playbacks=False).folder
    pages = [folder / "index.html", folder / "joint_drift_free.html"]
    for size in (DESKTOP, PHONE):
        set_size(browser, size)
        for page in pages:
            browser.get(page.as_uri())
            assert browser.execute_script(SPILLS) == 0
            assert browser.execute_script(SMALLEST_TEXT) >= 12

    def shown():
        script = "return [...document.querySelectorAll('article')].map(row => !row.hidden)"
        return browser.execute_script(script)

    assert shown() == [True] * 4
    browser.find_element("css selector", "button[data-show='does not hold']").click()
    assert shown() == [False, False, True, False]
    browser.get(f"{pages[1].as_uri()}#jdf-C2")
    assert shown() == [True] * 4
    assert browser.execute_script("return document.querySelector(':target').id") == "jdf-C2"
    browser.find_element("css selector", ".copy").click()
    assert browser.find_element("css selector", ".copy").text == "copied"
    script = "return [...document.images].map(image => {image.loading = 'eager'; return image.src})"
    assert len(browser.execute_script(script)) == 5

    assert browser.get_log("browser") == []
    for sent in requests(browser):
        url = sent["request"]["url"]
        assert url.startswith(("data:", folder.as_uri(), "chrome:", "chrome-")), url


#: The smallest size of letters [px] of any element that has text of its own.
SMALLEST_TEXT = """
return Math.min(...[...document.body.querySelectorAll("*")]
  .filter(each => [...each.childNodes].some(node => node.nodeType === 3 && node.data.trim()))
  .map(each => parseFloat(getComputedStyle(each).fontSize)))
"""
#: How far a page is wider than its window [px].
SPILLS = "const page = document.documentElement; return page.scrollWidth - page.clientWidth"
