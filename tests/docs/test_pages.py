"""What the pages say exists: links, files, commands, experiments, keys and metrics."""

import re
import runpy
import shlex
from functools import cache

import click
import typer
from doc_pages import PAGES, ROOT, fenced, prose, spans, tables, text_of

from drake_rnn import (
    ENVIRONMENTS,
    METRICS,
    PATHS,
    ArmDescription,
    ContactLoss,
    DitherSettings,
    ExperimentDocument,
    FilterSettings,
    ForceProfile,
    JointLimits,
    OnlineStiffness,
    PlantSettings,
    Secondary,
    SensingSettings,
    SensorSettings,
    TipMaterial,
    ToolDescription,
    WarmUp,
    load_experiment,
    shipped_arms,
    shipped_experiments,
)
from drake_rnn.claims import SCHEMES, read_claims
from drake_rnn.cli.commands import app
from drake_rnn.experiment import IntegratorSettings, parse_change, read_document
from drake_rnn.experiment.components import Arms
from drake_rnn.inputs.fields import field_names
from drake_rnn.jobs import CampaignDocument, read_campaign, shipped_campaigns
from drake_rnn.jobs.campaign import parse_axis
from drake_rnn.jobs.plan import VARIATIONS
from drake_rnn.robot.arm_description import GripperDescription
from row_helpers import each

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
CAMPAIGNS, ARMS = shipped_campaigns(), Arms()
#: The page whose live playbacks are made for the site; tests/docs/test_gallery.py looks at them.
PLAYING = ("docs/gallery.md", "docs/index.md")
#: What stands for an experiment of the reader's own.
PLACEHOLDER = re.compile(r"NAME|EXPERIMENT|\.\.\.|CAMPAIGN|.*\.yaml|out/campaign_.*")
#: An experiment that is there to be refused.
REFUSED = "state_adjustment_printed"
#: Its commands are there to be refused or to fail; its own tests run them.
PROVOKING = "docs/troubleshooting.md"


@cache
def commands_of_claims():
    """Some of them are refused; tests/claims looks at them."""
    claims = [claim for scheme in SCHEMES for claim in read_claims(scheme).claims]
    return {criterion.command for claim in claims for criterion in claim.criteria}


def test_the_readme_is_short():
    assert len(text_of("README.md").split()) <= 1200


# Links and files.


def anchors(page):
    titles = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@each("page", PAGES)
def test_every_link_leads_somewhere(page):
    for link in LINK.findall(prose(page)):
        if link.startswith("https://") or (page in PLAYING and link.startswith("playbacks/")):
            continue
        place, _, anchor = link.partition("#")
        target = (ROOT / page).parent / place if place else ROOT / page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(str(target.resolve().relative_to(ROOT))), link


@each("page", PAGES)
def test_every_file_that_is_named_exists(page):
    folders = (ROOT, ROOT / "drake_rnn", (ROOT / page).parent)
    for span in spans(prose(page)):
        if re.fullmatch(r"[\w./]+/[\w.]+\.(?:py|yaml|urdf|md)", span) or re.fullmatch(
            r"(?!out/)(?:[a-z_]+/)+", span
        ):
            assert any((folder / span).exists() for folder in folders), span


def test_every_page_is_in_the_index():
    listed = set(LINK.findall(text_of("docs/index.md")))
    docs = ROOT / "docs"
    written = {str(file.relative_to(docs)) for file in docs.rglob("*.md")} - {"index.md"}
    assert written <= listed


# Commands.


def shell_lines(page):
    blocks = [block.replace("\\\n", "") for _, block in fenced(page, "sh")]
    lines = [line for block in blocks for line in block.splitlines()]
    return [line.split(" #")[0].strip() for line in lines]


def commands(page):
    """Command lines of `drake-rnn`, among them those of which only experiment and options stand."""
    for text in [*shell_lines(page), *spans(prose(page))]:
        if text in commands_of_claims():
            continue
        if text.startswith("drake-rnn "):
            yield shlex.split(text)[1:]
        elif re.match(r"\w+ --(?:set|duration)", text):
            yield ["run", *shlex.split(text)]
        elif re.match(r"\w+ --over", text):
            yield ["sweep", *shlex.split(text)]


@cache
def command_line():
    return typer.main.get_command(app)


@each("page", PAGES)
def test_every_command_exists_and_so_do_its_options_experiments_and_keys(page):
    group = command_line()
    known, options = group.commands, {name for option in group.params for name in option.opts}
    for name, *arguments in commands(page):
        if name in options:
            continue
        assert name in known, name
        if arguments == ["..."]:
            continue
        command = known[name]
        given, _, _ = command.make_parser(click.Context(command)).parse_args(arguments)
        named = given.get("experiments") or given.get("experiment") or ()
        changes = dict(map(parse_change, given.get("changes") or []))
        campaign = given.get("campaign")
        assert campaign is None or PLACEHOLDER.fullmatch(campaign) or campaign in CAMPAIGNS
        axes = map(parse_axis, given.get("over") or [])
        changes |= {key: values[0] for key, values in axes if key != "KEY"}
        for experiment in (named,) if isinstance(named, str) else named:
            if PLACEHOLDER.fullmatch(experiment):
                continue
            assert experiment in shipped_experiments(), experiment
            # Without changes it is what the tests of shipped documents make.
            if changes and experiment != REFUSED and page != PROVOKING:
                load_experiment(experiment, changes, arms=ARMS)


@each("page", PAGES)
def test_every_row_of_a_run_is_a_shipped_experiment(page):
    for head, rows in tables(page):
        if "drake-rnn run ..." in head[0]:
            for row in rows:
                names = spans(row[0])
                assert names
                assert set(names) <= set(shipped_experiments()), row[0]


@each("page", PAGES)
def test_every_target_of_make_exists(page):
    makefile = (ROOT / "Makefile").read_text()
    targets = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split()
    targets += re.findall(r"^\$\(VENV\)(/installed[-\w]*):", makefile, re.MULTILINE)
    variables = set(re.findall(r"^(\w+) \?=", makefile, re.MULTILINE))
    for text in [*shell_lines(page), *spans(prose(page))]:
        if text.startswith("make "):
            words = [word.removeprefix(".venv") for word in text.split()[1:]]
            given = {word.partition("=")[0] for word in words if "=" in word}
            assert given <= variables, text
            assert {word for word in words if "=" not in word} <= set(targets), text


# What is shipped.


def test_every_experiment_is_in_the_folder_of_its_law():
    for file in (ROOT / "diagrams" / "experiments").glob("*/*.yaml"):
        kind = read_document(file.stem)["law"]["kind"]
        assert file.parent.name == kind, f"move {file} to the folder {kind}/"


def test_every_campaign_has_its_line_with_its_number_of_rows():
    ((head, rows),) = tables("diagrams/campaigns/README.md")
    assert head == ["campaign", "rows", "what to expect"]
    assert [LINK.findall(row[0]) for row in rows] == [[f"{name}.yaml"] for name in CAMPAIGNS]
    assert [int(row[1]) for row in rows] == [read_campaign(name).count for name in CAMPAIGNS]


def test_every_arm_has_its_row():
    (rows,) = [rows for head, rows in tables("models/README.md") if head[0] == "arm"]
    assert sorted(spans(row[0])[0] for row in rows) == shipped_arms()


# Keys.


def test_every_key_of_a_document_has_its_row():
    keys, *_ = [rows for head, rows in tables("docs/experiments.md") if head[0] == "key"]
    assert [spans(row[0])[0] for row in keys] == list(field_names(ExperimentDocument))


def test_every_key_of_a_campaign_and_every_kind_of_variation_has_its_row():
    found = dict((head[0], rows) for head, rows in tables("docs/campaigns.md"))
    assert [spans(row[0])[0] for row in found["campaign key"]] == list(
        field_names(CampaignDocument)
    )
    kinds = {spans(row[0])[-1]: set(spans(row[1])) for row in found["`kind` in `vary`"]}
    assert kinds == {kind: set(field_names(cls)) for kind, cls in VARIATIONS.items()}


@each(
    "section",
    [
        *(ArmDescription, ContactLoss, DitherSettings, FilterSettings, ForceProfile),
        *(IntegratorSettings, JointLimits, OnlineStiffness, PlantSettings, SensingSettings),
        *(Secondary, SensorSettings),
        *(
            GripperDescription,
            TipMaterial,
            ToolDescription,
            WarmUp,
            *PATHS.values(),
            *ENVIRONMENTS.values(),
        ),
    ],
    ids=lambda section: section.__name__,
)
def test_every_key_of_a_section_is_explained(section):
    written = {word for span in spans(prose("docs/experiments.md")) for word in span.split(": ")}
    assert set(field_names(section)) - {"kind"} <= written


# Metrics.


def test_the_page_of_metrics_is_what_the_script_makes():
    page = runpy.run_path(str(ROOT / "docs" / "make_metrics.py"))["page"]
    assert text_of("docs/metrics.md") == page()


def test_the_page_of_pairs_is_what_the_script_makes():
    page = runpy.run_path(str(ROOT / "docs" / "make_pairs.py"))["page"]
    assert text_of("docs/compatibility.md") == page()


def test_every_metric_has_one_row():
    ((_, rows),) = tables("docs/metrics.md")
    assert [spans(row[0]) for row in rows] == [[metric.name] for metric in METRICS]
    assert all(len(row) == 4 and all(row) for row in rows)
