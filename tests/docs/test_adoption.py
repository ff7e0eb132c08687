"""What a release says of itself, in the files that registries, journals and archives read."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import check_release
import pytest
from doc_pages import ROOT, text_of
from ruamel.yaml import YAML

from row_helpers import each

PROJECT: dict[str, Any] = tomllib.loads(text_of("pyproject.toml"))["project"]
CITATION: dict[str, Any] = YAML(typ="safe").load(text_of("CITATION.cff"))
CODEMETA: dict[str, Any] = json.loads(text_of("codemeta.json"))
ZENODO: dict[str, Any] = json.loads(text_of(".zenodo.json"))
PAPER = text_of("paper/paper.md")
WORKFLOWS = sorted(str(file.relative_to(ROOT)) for file in ROOT.glob(".github/workflows/*.yml"))
#: The Pythons that are said to be supported.
PYTHONS = [
    line.rpartition(" ")[2] for line in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", line)
]


def yaml_of(file: str) -> Any:
    return YAML(typ="safe").load(text_of(file))


def front_matter() -> dict[str, Any]:
    loaded: dict[str, Any] = YAML(typ="safe").load(PAPER.split("---\n")[1])
    return loaded


def test_version_date_and_licence_are_one() -> None:
    recipe = yaml_of("recipe/recipe.yaml")
    versions = {each["version"] for each in (PROJECT, CITATION, CODEMETA, ZENODO)}
    assert versions == {recipe["context"]["version"]}
    dates = {str(CITATION["date-released"]), CODEMETA["dateModified"], ZENODO["publication_date"]}
    assert len(dates) == 1
    licences = {PROJECT["license"], CITATION["license"], ZENODO["license"]}
    assert licences == {recipe["about"]["license"], CODEMETA["license"].rpartition("/")[2]}


def test_authors_keywords_and_words_are_one() -> None:
    authors = [each["name"] for each in CITATION["authors"]]
    for named in (PROJECT["authors"], CODEMETA["author"], ZENODO["creators"]):
        assert [each["name"] for each in named] == authors
    assert [each["name"] for each in front_matter()["authors"]] == authors
    keywords = [each.lower() for each in CITATION["keywords"]]
    for others in (PROJECT["keywords"], CODEMETA["keywords"], ZENODO["keywords"]):
        assert others == keywords
    assert CODEMETA["description"] == ZENODO["description"] == CITATION["abstract"]


def test_addresses_are_those_of_one_account() -> None:
    """It does not exist yet: who makes it changes one name everywhere."""
    repository, site = PROJECT["urls"]["Repository"], PROJECT["urls"]["Documentation"]
    assert CITATION["repository-code"] == CODEMETA["codeRepository"] == repository
    assert CITATION["url"] == CODEMETA["softwareHelp"] == site
    account = repository.removeprefix("https://github.com/").partition("/")[0]
    assert f"`{account}`" in text_of("CONTRIBUTING.md").partition("\n## A release\n")[2]
    files = [*ROOT.glob("*.*"), *ROOT.glob(".github/*/*.yml"), *ROOT.glob("notebooks/*.ipynb")]
    for file in files:
        if not file.is_file():
            continue
        for named in re.findall(r"github\.com/([\w-]*drake-rnn[\w-]*)/", file.read_text()):
            assert named == account, file


def test_each_python_that_is_named_is_tested() -> None:
    assert PYTHONS[0] == PROJECT["requires-python"].removeprefix(">=")
    jobs = yaml_of(".github/workflows/tests.yml")["jobs"]["quick"]["strategy"]["matrix"]["include"]
    assert [job["python"] for job in jobs if job["versions"] == "locked"] == PYTHONS
    table = text_of("COMPATIBILITY.md")
    assert all(f"\n| {python} | " in table for python in PYTHONS)


@each("file", WORKFLOWS)
def test_workflows_name_targets_and_files_that_are_there(file: str) -> None:
    workflow = yaml_of(file)
    assert workflow["permissions"] == {"contents": "read"}, "what a job needs, it says itself"
    makefile = text_of("Makefile")
    for job in workflow["jobs"].values():
        for step in job["steps"]:
            for target in re.findall(r"\bmake ([a-z][\w-]*)", step.get("run", "")):
                assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
            assert "uses" not in step or re.fullmatch(r"[\w./-]+@[\w.-]+(?:/v\d+)?", step["uses"])


@pytest.mark.parametrize("name", ["bug", "robot", "paper"])
def test_issue_forms_have_what_a_code_host_asks_for(name: str) -> None:
    form = yaml_of(f".github/ISSUE_TEMPLATE/{name}.yml")
    assert {"name", "description", "body"} <= form.keys()
    ids = [part["id"] for part in form["body"]]
    assert len(set(ids)) == len(ids)
    assert all(part["attributes"]["label"] for part in form["body"])
    assert ("doctor" in ids) == (name != "paper")


def test_the_recipe_has_the_dependencies_of_the_package() -> None:
    recipe = yaml_of("recipe/recipe.yaml")
    names = {"matplotlib": "matplotlib-base"}
    stated = {line.partition(">=")[::2] for line in PROJECT["dependencies"]}
    stated = {(names.get(name, name.lower()), bound) for name, bound in stated}
    _, *run = recipe["requirements"]["run"]
    assert {tuple(line.split(" >=")) for line in run} == stated
    assert recipe["context"]["python_min"] == PROJECT["requires-python"].removeprefix(">=")


def test_links_of_the_page_on_pypi_are_whole() -> None:
    # In a process of its own: setuptools wants to be imported before distutils.
    made = "runpy.run_path('setup.py')['with_whole_links'](open('README.md').read())"
    show = f"import runpy; print({made})"
    command = [sys.executable, "-c", show]
    page = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert len(links) > 30
    tag = f"{PROJECT['urls']['Repository']}/{{}}/v{PROJECT['version']}/"
    for link in links:
        assert link.startswith("https://"), link
        for kind in ("blob", "raw"):
            if link.startswith(tag.format(kind)):
                file = link.removeprefix(tag.format(kind)).partition("#")[0]
                assert (ROOT / file).exists(), link
                assert (kind == "raw") == file.endswith((".svg", ".webp", ".png")), link


@pytest.mark.parametrize(
    ("more", "less", "said"),
    [
        ({}, None, None),
        ({"tests/test_x.py": 1}, None, "has tests/test_x.py"),
        ({"drake_rnn/large.bin": check_release.MOST}, None, "more than 3000000"),
        ({}, "models/panda", "has no drake_rnn/models/panda/"),
    ],
    ids=["right", "foreign", "large", "without models"],
)
def test_a_wheel_is_refused_that_is_large_or_has_not_what_it_should(
    more: dict[str, int], less: str | None, said: str | None, tmp_path: Path
) -> None:
    wheel = tmp_path / "drake_rnn-1.0-py3-none-any.whl"
    with ZipFile(wheel, "w") as archive:
        for room in check_release.ROOMS:
            if room != less:
                archive.writestr(f"drake_rnn/{room}/file", "")
        for name, size in more.items():
            archive.writestr(name, b"0" * size)
    if said is None:
        check_release.check_wheel(wheel)
        return
    with pytest.raises(SystemExit, match=said):
        check_release.check_wheel(wheel)


# The paper.


def test_the_paper_has_the_sections_and_the_length_that_the_journal_asks_for() -> None:
    sections = re.findall(r"^# (.+)$", PAPER, re.MULTILINE)
    assert sections == [
        *("Summary", "Statement of need", "State of the field", "Software design"),
        *("Research impact statement", "AI usage disclosure", "Acknowledgements", "References"),
    ]
    body = re.sub(r"<!--.*?-->", "", PAPER.split("---\n", 2)[2], flags=re.DOTALL)
    assert 750 <= len(body.split()) <= 1750
    assert front_matter()["bibliography"] == "paper.bib"


def test_every_figure_of_the_paper_stands_on_the_page_that_it_names() -> None:
    """A line ``<!-- from PAGE: "WORDS"; "WORDS" -->`` below a sentence names it."""
    sources = re.findall(r'<!-- from ([\w./]+): ((?:"[^"]+"(?:; )?)+) -->', PAPER)
    assert len(sources) == PAPER.count("<!-- from") >= 8
    for page, quotes in sources:
        text = " ".join(text_of(page).split())
        for quote in re.findall(r'"([^"]+)"', quotes):
            assert quote in text, f"{page}: {quote}"
    # A sentence with a number and a unit is followed by its source.
    for sentence in re.findall(r"[^.]*\d (?:nm|µm|mrad|%)[^<]*\n(.*)", PAPER):
        assert sentence.startswith("<!-- from") or "(`drake-rnn" in sentence, sentence


def test_what_the_paper_cites_is_in_its_list_and_the_reverse() -> None:
    cited = set(re.findall(r"@([a-z]+\d{0,4}[a-z]*)", PAPER.split("---\n", 2)[2]))
    entries = re.findall(r"^@\w+\{(\w+),$", text_of("paper/paper.bib"), re.MULTILINE)
    assert len(set(entries)) == len(entries)
    assert cited == set(entries)
