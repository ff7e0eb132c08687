"""The notebooks run as they stand, and import only what is public."""

import matplotlib as mpl
import pytest
from doc_pages import PAGES, ROOT, assert_public, cells

from drake_rnn import Result

NOTEBOOKS = [page for page in PAGES if page.startswith("docs/notebooks/")]
#: What else a notebook may import.
OTHERS = {"IPython", "functools", "matplotlib", "numpy", "pydrake", "subprocess"}


def test_there_are_notebooks_of_tracking_contact_and_a_law():
    names = {page.rpartition("/")[2] for page in NOTEBOOKS}
    assert {"tracking.md", "contact.md", "own_law.md"} <= names


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
    assert results
    for result in results:
        assert result.status == "complete"
    assert [verdict for verdict in names["result"].verdicts if not verdict.met] == []
