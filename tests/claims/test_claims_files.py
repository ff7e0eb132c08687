"""Every claim of the papers: what it names exists, and its verdict is the one on the page."""

import ast
from pathlib import Path

import pytest
from doc_pages import ROOT, tables

from drake_rnn import InvalidInputError, load_experiment, shipped_experiments
from drake_rnn.claims import (
    SCHEMES,
    Judge,
    read_claims,
    schemes_in,
)
from drake_rnn.claims import (
    claims as reading,
)
from shared_runs import SharedRuns


def every_claim():
    """Return all claims, which are read only once they are asked for."""
    return [claim for scheme in SCHEMES for claim in read_claims(scheme).claims]


def named_tests(file):
    """Names of a file's tests, as pytest writes them, without parameters."""
    tree = ast.parse((ROOT / file).read_text())
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.ClassDef):
            yield node.name
            yield from (
                f"{node.name}::{inner.name}"
                for inner in node.body
                if isinstance(inner, ast.FunctionDef)
            )


def test_runs_that_claims_name_can_be_made():
    runs = {}
    for claim in every_claim():
        for criterion in claim.criteria:
            for quantity in filter(None, (criterion, criterion.per)):
                if quantity.run is not None:
                    assert quantity.run in shipped_experiments(), claim.id
                    runs[quantity.run, repr(quantity.set)] = quantity
    for quantity in runs.values():
        load_experiment(quantity.run, quantity.set)


def test_pages_and_tests_that_claims_name_exist():
    assert all((ROOT / read_claims(scheme).page).is_file() for scheme in SCHEMES)
    names = {}
    for test in {test for claim in every_claim() for test in claim.tests}:
        file, _, name = test.partition("::")
        assert Path(file).parts[0] == "tests"
        if file not in names:
            names[file] = set(named_tests(file))
        assert name in names[file], test


#: Claims that cannot be judged: what is written in place of what, and what is said.
BROKEN = {
    "an experiment that is none": ("naljdf_clover,", "naljdf_clovr,", "no experiment"),
    "a metric that is none": ("joint_drift_mean_rad", "joint_drift_men_rad", "no metric"),
    "a measure that is none": ("sigma_misfit", "sigma_misft", "no measure"),
    "an argument that is none": ("basis:", "bases:", "block_mismatch: given"),
    "a claim of another paper": ("id: jdf-C6", "id: slc-C6", "must begin with jdf-"),
    "a claim that is there twice": ("id: jdf-C6", "id: jdf-C5", "is there twice"),
}


@pytest.mark.parametrize(("old", "new", "message"), BROKEN.values(), ids=BROKEN)
def test_a_file_that_cannot_be_judged_is_refused(tmp_path, old, new, message):
    text = (reading._FOLDER / "joint_drift_free.yaml").read_text()
    assert old in text
    (tmp_path / "joint_drift_free.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_claims("joint_drift_free", tmp_path)
    assert str(caught.value).startswith("joint_drift_free.yaml: ")


def test_a_folder_without_claims_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"no claims file, \*\.yaml, in "):
        schemes_in(tmp_path)


def test_an_unknown_scheme_is_refused():
    with pytest.raises(InvalidInputError, match="no scheme 'recursiv'"):
        read_claims("recursiv")


def page_rows():
    """Rows of the page of claims by id."""
    return {
        row[0].strip("`"): dict(zip(head, row, strict=True))
        for head, rows in tables("docs/claims.md")
        if head[0] == "claim"
        for row in rows
    }


def test_the_page_has_a_row_for_every_claim():
    assert sorted(page_rows()) == sorted(claim.id for claim in every_claim())


@pytest.mark.nightly
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_verdicts_are_those_on_the_page(scheme):
    claims, rows = read_claims(scheme), page_rows()
    judge = Judge(claims, SharedRuns())
    # Ratios of times belong to a quiet machine.
    judged = [claim for claim in claims.claims if not any(c.timed for c in claim.criteria)]
    found = {claim.id: judge.judge(claim) for claim in judged}
    now = {name: judgement.verdict for name, judgement in found.items()}
    assert now == {name: rows[name]["verdict"] for name in now}
