"""The notebooks run as they stand, and import only what is public."""

import json
import re

import make_notebooks
import matplotlib as mpl
import pytest
from doc_pages import PAGES, ROOT, assert_public, cells, text_of

from drake_rnn import Result

NOTEBOOKS = [page for page in PAGES if re.match("(docs/)?notebooks/", page)]
#: What else a notebook may import.
OTHERS = {"IPython", "functools", "matplotlib", "numpy", "pydrake", "subprocess"}


def test_there_are_notebooks_of_tracking_contact_a_law_a_shield_and_a_campaign():
    names = {page.rpartition("/")[2] for page in NOTEBOOKS}
    assert names >= {"tracking.md", "contact.md", "own_law.md", "shield.md", "campaign.md"}


def test_every_notebook_is_there_for_browsers_as_its_page_is():
    assert sorted(make_notebooks.PAGES) == sorted(NOTEBOOKS)
    files = {file.stem: file.read_text() for file in (ROOT / "notebooks").glob("*.ipynb")}
    made = {page.rpartition("/")[2][:-3]: make_notebooks.text_of(page) for page in NOTEBOOKS}
    assert files == made, "python docs/make_notebooks.py"


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_a_notebook_for_browsers_installs_first_and_its_links_lead_to_the_site(page):
    notebook = json.loads(make_notebooks.text_of(page))
    codes = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert re.search('%pip install --quiet "?drake-rnn', codes[0])
    stripped = [re.sub("^%.*$", "", code, flags=re.MULTILINE).strip() for code in codes[1:]]
    assert stripped == [code.strip() for _, code in cells(page)]
    texts = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] != "code"]
    site = f"{make_notebooks.URLS['Documentation']}/en/stable/"
    links = re.findall(r"\]\(([^)]+)\)", "".join(texts))
    assert all(link.startswith("https://") for link in links)
    for link in links:
        if link.startswith(site):
            page_of_link = link.removeprefix(site).partition("#")[0].replace(".html", ".md")
            assert (ROOT / page_of_link).is_file(), link
    assert text_of(page).count("```{code-cell} ipython3") == len(codes) - 1


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_a_notebook_imports_only_what_is_public(page):
    for _, code in cells(page):
        assert_public(code, OTHERS)


# `make docs` runs them as well, which CI does for every commit.
@pytest.mark.nightly
@pytest.mark.usefixtures("laws_as_before")
@pytest.mark.parametrize("page", NOTEBOOKS)
def test_a_notebook_runs_and_its_runs_keep_their_bounds(page, monkeypatch):
    pytest.importorskip("IPython", reason="needs the extra `docs`")
    monkeypatch.chdir(ROOT)
    names = {"__name__": "__main__"}
    with mpl.rc_context():
        for line, code in cells(page):
            exec(compile("\n" * (line - 1) + code, page, "exec"), names)
    results = [value for value in names.values() if isinstance(value, Result)]
    for result in results:
        assert result.status == "complete"
    # Those of a shield and of a campaign have assertions of their own.
    assert bool(results) == page.startswith("docs/")
    if results:
        assert [verdict for verdict in names["result"].verdicts if not verdict.met] == []
