"""What a stranger sees of the project: badges, how to cite it, versions."""

from __future__ import annotations

import re
import runpy
import tomllib
from typing import Any

import pytest
from doc_pages import ROOT, text_of
from ruamel.yaml import YAML

from drake_rnn.claims import SCHEMES, read_claims

BADGES = runpy.run_path(str(ROOT / "docs" / "make_badges.py"))["badges"]()


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    loaded: dict[str, Any] = tomllib.loads(text_of("pyproject.toml"))["project"]
    return loaded


@pytest.fixture(scope="module")
def citation() -> dict[str, Any]:
    loaded: dict[str, Any] = YAML(typ="safe").load(text_of("CITATION.cff"))
    return loaded


def test_badges_say_what_is_true() -> None:
    written = {file.stem: file.read_text() for file in (ROOT / "docs" / "badges").glob("*.svg")}
    assert written == BADGES, "python docs/make_badges.py docs/badges"


def test_the_badge_of_claims_counts_all(project: dict[str, Any]) -> None:
    claims = [claim for scheme in SCHEMES for claim in read_claims(scheme).claims]
    judged = [claim for claim in claims if not claim.unchecked]
    assert f"{len(judged)} judged" in BADGES["claims"]
    assert project["version"] in BADGES["version"]


def test_the_version_is_one_everywhere(project: dict[str, Any], citation: dict[str, Any]) -> None:
    newest = re.search(r"^## \[(\d.*?)\] - (\S+)$", text_of("CHANGELOG.md"), re.MULTILINE)
    assert newest is not None
    assert newest[1] == project["version"] == citation["version"]
    assert newest[2] == str(citation["date-released"])


def test_every_paper_is_cited(citation: dict[str, Any]) -> None:
    cited = {" ".join(each["title"].lower().split()): each for each in citation["references"]}
    for scheme in SCHEMES:
        paper = read_claims(scheme).paper
        reference = cited[" ".join(paper.title.lower().split())]
        if paper.year is not None:
            assert reference["year"] == paper.year
        assert reference.get("doi", "") == paper.doi
        for author in filter(None, paper.authors.split(", ")):
            assert author in {each.get("family-names") for each in reference["authors"]}
