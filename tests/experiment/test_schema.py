"""JSON schemas of documents: what an editor completes, explains and marks."""

import json
import re
from functools import cache
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from drake_rnn import LAWS, PATHS
from drake_rnn.diagrams import CAMPAIGNS, EXPERIMENTS, SCHEMAS
from drake_rnn.experiment import ExperimentDocument
from drake_rnn.experiment.components import ORIGINS
from drake_rnn.experiment.files import schema_line
from drake_rnn.inputs.documents import parse_yaml, read_yaml
from drake_rnn.inputs.messages import field_names
from language_server import LanguageServer, missing

ROOT = Path(__file__).parents[2]
#: All shipped documents.
SHIPPED = [
    *sorted(EXPERIMENTS.glob("*/*.yaml")),
    *sorted(CAMPAIGNS.glob("*.yaml")),
    *sorted((ROOT / "drake_rnn" / "claims" / "papers").glob("*.yaml")),
    *sorted((ROOT / "examples").glob("*.yaml")),
]
#: One of each folder.
OF_EACH_FOLDER = list({file.parent: file for file in SHIPPED}.values())
LEARNED = """\
arm: panda
path: {kind: circle, size: 0.1, period: 4}
law: {kind: simultaneous_learning}
period: 1e-3
duration: 4
"""


@cache
def schema(document):
    return json.loads((SCHEMAS / f"{document}.json").read_text())


def named(file):
    """Return the schema that a document's first line names."""
    place = re.match(r"# yaml-language-server: \$schema=(\S+)\n", file.read_text())[1]
    return (file.parent / place).resolve()


def marked(document, text):
    """Return the places in which an editor would mark a document."""
    errors = Draft7Validator(schema(document)).iter_errors(parse_yaml(text, "document"))
    return sorted({".".join(map(str, error.path)) + f": {error.message}" for error in errors})


@pytest.mark.long
def test_every_shipped_document_names_its_schema_and_fits_it():
    for file in SHIPPED:
        place = named(file)
        assert place.parent == SCHEMAS.resolve()
        errors = Draft7Validator(schema(place.stem)).iter_errors(read_yaml(file))
        assert [error.message for error in errors] == [], file.name


def test_it_is_a_schema_of_the_draft_that_language_servers_know():
    for document in ("experiment", "campaign", "claims"):
        Draft7Validator.check_schema(schema(document))


@pytest.mark.parametrize("kinds", [LAWS, PATHS], ids=["laws", "paths"])
def test_it_has_each_key_of_each_kind_and_no_other(kinds):
    definitions = schema("experiment")["$defs"]
    for kind, cls in kinds.shipped_classes.items():
        known = {*field_names(cls)} - (ORIGINS.keys() if kinds is LAWS else set()) | {"kind"}
        found = definitions[cls.__name__]
        assert found["properties"].keys() == known, kind
        assert found["additionalProperties"] is False
        untold = [key for key in known - {"kind"} if "description" not in found["properties"][key]]
        assert not untold, f"{kind}: {untold}"


def test_its_keys_are_those_of_the_document():
    assert [*schema("experiment")["properties"]] == [*field_names(ExperimentDocument)]


def test_it_tells_units_defaults_and_bounds():
    kappa = schema("experiment")["$defs"]["SimultaneousLearning"]["properties"]["kappa"]
    assert kappa["description"] == "Gain of the position feedback [1/s]."
    assert kappa["default"] == LAWS["simultaneous_learning"].__pydantic_fields__["kappa"].default
    assert (kappa["type"], kappa["exclusiveMinimum"], kappa["maximum"]) == ("number", 0, 1e9)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ("law: {kind: simultaneous_learning, kapa: 3}", "law: .*'kapa' was unexpected"),
        ("law: {kind: simultaneous_learning, kappa: yes}", "law.kappa: 'yes' is not of type"),
        ("law: {kind: simultaneous_learning, kappa: 0}", "law.kappa: 0(.0)? is less than"),
        ("law: {kind: simultaneous_learnin}", "law.kind: "),
        ("law: {kind: simultaneous_learning, limits: 3}", "law: .*'limits' was unexpected"),
        ("path: {kind: line, size: 0.1, period: 4}", "path: .*'size' was unexpected"),
        ("path: {kind: rest, period: 4, offset: [1, 2]}", "path.offset: "),
        ("obstacles: [{kind: ball, center: [0, 0, 1]}]", "obstacles.0: 'radius' is a required"),
        ("limits: {velocty: 1}", "limits: "),
        ("accept: {position_error_max: {at_most: 1}}", "accept: "),
        ("over: {law.kapa: [1, 2]}", "over: .*'law.kapa'"),
        ("over: {law.kappa: 3}", "over.law.kappa: 3 is not of type 'array'"),
        ("duraton: 3", ": .*'duraton'"),
        ("arm: pandas", "arm: "),
        ("arm: {frame: tool}", "arm: "),
        ("second: {duration: 3}", "second: .*'duration' was unexpected"),
    ],
)
def test_it_marks_what_is_wrong(change, place):
    key = change.partition(":")[0]
    text = "".join(line for line in LEARNED.splitlines(True) if not line.startswith(f"{key}:"))
    found = marked("experiment", f"{text}{change}\n")
    assert found
    assert all(re.match(place, each) for each in found), found


@pytest.mark.parametrize(
    "change",
    [
        "over: {law.kappa: [1, 2], path.size: [0.1], arm.tool.length: [0.1], start: [[0]]}",
        "over: {arm.lock.joint7: [0.1], accept.position_error_max_m.at_most: [1]}",
        "x-anything: {of: [any, kind]}",
        "limits: none",
        "limits: {velocity: [1, .inf], jerk: 3}",
        "second: {base: {translation: [1, 0, 0]}, arm: ur5}",
    ],
)
def test_it_accepts_what_is_right(change):
    assert marked("experiment", f"{LEARNED}{change}\n") == []


def test_a_class_of_ones_own_has_any_keys():
    own = LEARNED.replace("simultaneous_learning", '"my_law:MyLaw", speed: 3')
    assert marked("experiment", f"{own}over: {{law.speed: [1, 2]}}\n") == []


def test_objectives_of_ones_own_have_any_keys():
    law = "law: {kind: adaptive, secondary: {objectives: [%s]}}"
    shown = LEARNED.replace("law: {kind: simultaneous_learning}", law)
    assert marked("experiment", shown % '{kind: "my_module:KeepElbowUp", height: 0.5}') == []
    (found,) = marked("experiment", shown % "{kind: posture, weight: 1}")
    assert found.startswith("law")


def test_a_campaign_of_a_shipped_experiment_has_known_keys_and_one_of_ones_own_any():
    vary = "vary: {law.speed: [1, 2]}\n"
    (found,) = marked("campaign", f"experiment: slc_nephroid\n{vary}")
    assert found.startswith("vary: 'law.speed'")
    assert marked("campaign", f"experiment: mine.yaml\n{vary}") == []
    own = 'changes: {law: {kind: "my_law:MyLaw"}}\n'
    assert marked("campaign", f"experiment: slc_nephroid\n{own}{vary}") == []


def test_the_line_names_a_file_that_is_there():
    place = schema_line("experiment").rpartition("=")[2].strip()
    assert place == (SCHEMAS / "experiment.json").as_uri()


@pytest.mark.long
@pytest.mark.skipif(bool(missing()), reason=missing())
class TestLanguageServer:
    """The one that editors use: yaml-language-server."""

    def test_it_completes_and_explains_a_key(self, tmp_path):
        file = tmp_path / "mine.yaml"
        body = "law:\n  kind: simultaneous_learning\n  ka\nover:\n  law.ka\n"
        file.write_text(schema_line("experiment") + body)
        with LanguageServer() as server:
            server.marks(file)
            offered = server.completions(file, 3, 4)
            assert offered["kappa"] == "Gain of the position feedback [1/s]."
            # Of the other laws none.
            assert "braking" not in offered
            assert "law.kappa" in server.completions(file, 5, 8)

    def test_it_marks_a_misspelt_key(self, tmp_path):
        file = tmp_path / "mine.yaml"
        text = LEARNED.replace("learning}", "learning, kapa: 3}")
        file.write_text(schema_line("experiment") + text + "over: {law.kapa: [3]}\n")
        with LanguageServer() as server:
            assert server.marks(file) == [
                (3, "Property kapa is not allowed."),
                (6, "Property law.kapa is not allowed."),
            ]

    def test_it_shows_what_a_key_means(self, tmp_path):
        file = tmp_path / "mine.yaml"
        file.write_text(schema_line("experiment") + LEARNED)
        with LanguageServer() as server:
            assert server.marks(file) == []
            assert "Sampling period of the controller [s]" in server.hover(file, 4, 2)

    @pytest.mark.parametrize(
        "files", [OF_EACH_FOLDER, pytest.param(SHIPPED, marks=pytest.mark.nightly)]
    )
    def test_it_accepts_shipped_documents(self, files):
        """One of each folder; that all fit the schema is looked at without it."""
        with LanguageServer() as server:
            marks = {file.name: server.marks(file.resolve()) for file in files}
        assert {name: found for name, found in marks.items() if found} == {}
