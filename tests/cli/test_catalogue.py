"""What the command line says there is."""

from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from drake_rnn import LAWS, PATHS, load_arm, shipped_arms, shipped_experiments
from drake_rnn.cli.commands import app
from drake_rnn.cli.listing import listings_table, shipped_listings
from drake_rnn.experiment import ExperimentDocument, load_experiment, read_document
from drake_rnn.experiment.components import ORIGINS
from drake_rnn.inputs.documents import construct
from drake_rnn.inputs.keys import keys_of
from drake_rnn.inputs.messages import field_names
from row_helpers import each


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def said(*arguments):
    result = call(*arguments)
    assert result.exit_code == 0, (result.stderr, result.exception)
    return result.stdout


def listed(*arguments):
    return {word for line in said("list", *arguments).splitlines() for word in line.split()[:1]}


def test_versions():
    assert said("--version").startswith("drake-rnn ")


def test_a_shell_is_offered_the_shipped_experiments():
    """As bash asks for them."""
    asked = {"_DRAKE_RNN_COMPLETE": "complete_bash", "COMP_WORDS": "drake-rnn run pinv_l"}
    asked |= {"COMP_CWORD": "2"}
    result = CliRunner().invoke(app, [], env=asked, prog_name="drake-rnn")
    assert {"pinv_line", "pinv_line_ur5"} <= set(result.stdout.split())


# The list.


def test_the_list_fits_80_columns_and_breaks_no_name():
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(listings_table(shipped_listings(), 80))
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= 80
    assert set(shipped_experiments()) <= {word for line in lines for word in line.split()[:1]}


def test_the_list_says_what_a_run_reads():
    """The list reads documents by itself, which is faster."""
    listings = {each.name: each for each in shipped_listings()}
    assert sorted(listings) == shipped_experiments()
    for name, listing in listings.items():
        document = construct(ExperimentDocument, read_document(name), name)
        arm = document.arm if isinstance(document.arm, str) else document.arm["model"]
        read = (document.law["kind"], name, document.level, document.paper, document.expect)
        assert read == (listing.law, name, listing.level, listing.paper, listing.expect)
        assert Path(arm).name == Path(listing.arm).name


def test_a_list_can_be_narrowed():
    documents = {each.name: each for each in shipped_listings()}
    for option, of in (
        (("--arm", "ur5"), lambda document: document.arm == "ur5"),
        (("--law", "motion_force"), lambda document: document.law == "motion_force"),
        (("--level", "dynamic"), lambda document: document.level == "dynamic"),
        (("NEPHROID",), lambda document: "nephroid" in f"{document.name} {document.expect}"),
    ):
        expected = {name for name, document in documents.items() if of(document)}
        assert expected
        assert expected <= listed(*option)
    assert "contact_circle" not in listed("--level", "kinematic")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("list", "--arm", "pandas"), "--arm: no 'pandas'; nearest: panda"),
        (("list", "--law", "motion_forse"), "--law: no 'motion_forse'; nearest: motion_force"),
        (("list", "--level", "x"), "--level: no 'x'; it may be kinematic, dynamic"),
        (("list", "nothing_like_it"), "there is no such experiment"),
        (("laws", "pseudo_inverse"), "law: no 'pseudo_inverse'; nearest: pseudoinverse"),
        (("paths", "circel"), "path: no 'circel'; nearest: circle"),
        (("show", "contact_cirle"), "experiment: no experiment 'contact_cirle'; nearest: contact"),
    ],
)
def test_what_there_is_not_is_one_sentence(arguments, message):
    result = call(*arguments)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"error {message}")


# Arms, laws and paths.


def test_arms():
    text = said("arms")
    for name in shipped_arms():
        assert name in text
        assert load_arm(name).frame in text
    assert "believed_mass_scale" in text


def test_laws_and_paths_with_keys_and_defaults():
    laws, paths = said("laws"), said("paths")
    assert all(kind in laws for kind in LAWS)
    assert all(kind in paths for kind in PATHS)
    assert "feedback (10), feed_forward (true), damping (1e-06)" in laws
    assert "Gain of the feedback of position and orientation [1/s]." in said(
        "laws", "pseudoinverse"
    )
    assert "must be given" in said("paths", "circle")
    assert "{posture: 1, target: none, limits: 3," in said("laws", "adaptive")


@each("kind", [*LAWS, *PATHS])
def test_every_key_is_explained_by_a_docstring(kind):
    """Its meaning is written once, where the field is."""
    cls = LAWS[kind] if kind in LAWS else PATHS[kind]
    keys = keys_of(cls, ("kind", *ORIGINS))
    assert {key.name for key in keys} == set(field_names(cls)) - {"kind", *ORIGINS}
    assert not [key.name for key in keys if not key.meaning]


# A document.


def test_a_document_that_is_shown_can_be_run_again(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(said("show", "contact_circle"))
    text = file.read_text()
    assert "  # Friction coefficient of ball and plate.\n  friction: 0.3\n" in text
    assert "  # root mean square of the force error [N]\n" in text
    again = load_experiment(str(file)).document
    assert again.contents() == load_experiment("contact_circle").document.contents()
