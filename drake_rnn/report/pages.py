"""A report as pages of HTML, which need no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..inputs.page_templates import page_templates
from .contents import VERDICTS, parts_of
from .markdown import title_of

#: A sign for each verdict, so that no reader depends on its colour.
SIGNS = {
    "holds": "✓",
    "holds with correction": "≈",
    "does not hold": "✗",
    "cannot be checked": "?",
    "failed": "!",
}
_ENVIRONMENT = page_templates(Path(__file__).parent / "templates")
_ENVIRONMENT.filters.update(title_of=title_of, parts_of=parts_of)
_ENVIRONMENT.globals.update(verdicts=VERDICTS, signs=SIGNS)


def index_html(contents: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return the page of all papers.

    Args:
        contents: What the report says.
        page_of: Names of the papers' pages, by scheme.
    """
    return _ENVIRONMENT.get_template("index.html").render(
        contents=contents,
        page_of=page_of,
        failed=[
            (paper, claim)
            for paper in contents["papers"]
            for claim in paper["claims"]
            if claim["verdict"] == "failed"
        ],
    )


def paper_html(contents: dict[str, Any], paper: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return one paper's page."""
    return _ENVIRONMENT.get_template("paper.html").render(
        contents=contents, paper=paper, page_of=page_of, runs=contents["runs"]
    )
