"""A report as pages of HTML, which need no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from .contents import VERDICTS
from .markdown import title_of

#: A sign for each verdict, so that none is told by its colour alone.
SIGNS = {
    "holds": "✓",
    "holds with correction": "≈",
    "does not hold": "✗",
    "cannot be checked": "?",
    "failed": "!",
}


def index_html(contents: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return the page of all papers.

    Args:
        contents: What the report says.
        page_of: Names of the papers' pages, by scheme.
    """
    return _ENVIRONMENT.get_template("index.html").render(
        contents=contents, page_of=page_of, failed=_failed(contents)
    )


def paper_html(contents: dict[str, Any], paper: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return one paper's page."""
    return _ENVIRONMENT.get_template("paper.html").render(
        contents=contents, paper=paper, page_of=page_of, runs=contents["runs"]
    )


def _failed(contents: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    return [
        (paper, claim)
        for paper in contents["papers"]
        for claim in paper["claims"]
        if claim["verdict"] == "failed"
    ]


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["title_of"] = title_of
    environment.globals.update(verdicts=VERDICTS, signs=SIGNS)
    return environment


_ENVIRONMENT = _environment()
