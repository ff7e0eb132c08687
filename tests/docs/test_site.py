"""What the site is made of fits the code and the pages."""

import importlib
import re
import shutil
import subprocess

import pytest
from doc_pages import ROOT, prose, spans, text_of
from jinja2 import Environment, FileSystemLoader

import drake_rnn
from drake_rnn import build_diagram, load_experiment, wiring_graph

DOCS = ROOT / "docs"
REFERENCE = sorted((DOCS / "reference").glob("*.rst"))
_DIRECTIVE = re.compile(r"^\.\. (?:autoclass|autofunction|data):: (\w+)$", re.MULTILINE)
#: The commands of drawings that pages show.
DRAWN = dict(
    re.fullmatch(r"drake-rnn show (\w+) --diagram (docs/wiring_\w+\.svg)", span).group(2, 1)
    for span in spans(prose("diagrams/README.md"))
    if span.startswith("drake-rnn show") and "--diagram docs/" in span
)
_TEXT = re.compile(r"<text [^>]*>([^<]*)</text>")


def test_every_public_name_is_documented_once():
    found = [name for file in REFERENCE for name in _DIRECTIVE.findall(file.read_text())]
    assert sorted(found) == sorted(drake_rnn.__all__)


def test_every_law_has_its_module_in_the_reference():
    laws = (DOCS / "reference" / "laws.rst").read_text()
    for law in drake_rnn.LAWS.values():
        assert f".. automodule:: {law.__module__}\n" in laws


def test_every_page_of_the_reference_is_in_its_list():
    listed = (DOCS / "reference" / "index.rst").read_text().split()
    assert {file.stem for file in REFERENCE} - {"index"} <= set(listed)


def test_no_two_pages_have_one_title():
    """A search of the site tells them apart."""
    titles = [file.read_text().partition("\n")[0].lower() for file in REFERENCE]
    for file in (*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *ROOT.glob("[dm]*s/**/README.md")):
        titles += re.findall(r"^# (.+)$", file.read_text(), re.MULTILINE)[:1]
    lowered = [title.lower() for title in titles]
    assert len(lowered) > 50
    assert {title for title in lowered if lowered.count(title) > 1} == set()


def test_every_drawing_has_its_command():
    assert {str(file.relative_to(ROOT)) for file in DOCS.glob("wiring_*.svg")} == set(DRAWN)


@pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
@pytest.mark.parametrize("file", DRAWN)
def test_a_drawing_is_what_its_command_draws(file):
    """In what is written in it; where things stand depends on Graphviz and its fonts."""
    graph = wiring_graph(build_diagram(load_experiment(DRAWN[file]))[0])
    drawn = subprocess.run(
        ["dot", "-Tsvg"], input=graph, capture_output=True, text=True, check=True
    ).stdout
    assert sorted(_TEXT.findall(text_of(file))) == sorted(_TEXT.findall(drawn))


def test_pages_know_no_address_but_those_of_others():
    """The site opens without a network: nothing that it shows is fetched."""
    for file in [DOCS / "conf.py", *(DOCS / "site").rglob("*.*")]:
        if file.suffix in (".py", ".css", ".html"):
            assert "http" not in file.read_text().replace("http-equiv", ""), file


def test_versions_lead_to_each_other_where_several_are_built():
    """On Read the Docs one is built at a time, and its own menu leads to the others."""
    templates = FileSystemLoader(DOCS / "site" / "templates")
    menu = Environment(loader=templates).get_template("sidebar/variant-selector.html")
    page = {"release": "1.2.0", "pagename": "docs/paths", "content_root": "../"}
    assert menu.render(page).strip() == ""
    made = menu.render(page, site_versions="latest,stable", site_version="stable")
    assert "<b>stable</b> (1.2.0)" in made
    assert re.findall(r'href="([^"]*)"', made) == ["../../latest/index.html"]
    assert re.findall(r'data-same="([^"]*)"', made) == ["../../latest/docs/paths.html"]


def test_a_site_of_two_versions_wants_the_older_one_named():
    command = ["make", "site-versions", "STABLE="]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode != 0
    assert "make site-versions STABLE=" in ended.stdout


def test_units_of_tables_have_their_signs_on_the_site_and_code_is_as_written(monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "site")
    with_signs = importlib.import_module("unit_signs").with_signs
    made = "<td>9.4 um, 50 urad at 20 rad/s^3 [um]</td><code>10 um, s^2</code><td>u a step</td>"
    signed = "<td>9.4 µm, 50 µrad at 20 rad/s³ [µm]</td><code>10 um, s^2</code><td>u a step</td>"
    assert with_signs(made) == signed
    formula = '<span class="math notranslate nohighlight">\\(x^2\\)</span>'
    assert with_signs(formula) == formula
