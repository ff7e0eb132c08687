"""Every claim of the papers: what it names exists, and its verdict is the one on the page."""

import ast
from pathlib import Path

import pytest
from doc_pages import ROOT, tables

from drake_rnn import InvalidInputError, shipped_experiments
from drake_rnn.claims import SCHEMES, Judge, read_claims
from drake_rnn.experiment import read_document
from drake_rnn.experiment.document import ExperimentDocument
from drake_rnn.inputs.documents import construct

ALL = [(scheme, claim) for scheme in SCHEMES for claim in read_claims(scheme).claims]
every_claim = pytest.mark.parametrize(("scheme", "claim"), ALL, ids=[claim.id for _, claim in ALL])


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


@every_claim
def test_what_a_claim_names_exists(scheme, claim):
    claims = read_claims(scheme)
    assert (ROOT / claims.page).is_file()
    for criterion in claim.criteria:
        for quantity in filter(None, (criterion, criterion.per)):
            if quantity.run is not None:
                assert quantity.run in shipped_experiments()
                changed = read_document(quantity.run, quantity.set)
                if criterion.refused is None:
                    construct(ExperimentDocument, changed, quantity.run)
    for test in claim.tests:
        file, _, name = test.partition("::")
        assert Path(file).parts[0] == "tests"
        assert name in set(named_tests(file)), test


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
    assert sorted(page_rows()) == sorted(claim.id for _, claim in ALL)


@pytest.mark.long
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_verdicts_are_those_on_the_page(scheme):
    claims, rows = read_claims(scheme), page_rows()
    judge = Judge(claims)
    # Ratios of times belong to a quiet machine.
    judged = [claim for claim in claims.claims if not any(c.timed for c in claim.criteria)]
    found = {claim.id: judge.judge(claim) for claim in judged}
    now = {name: judgement.verdict for name, judgement in found.items()}
    assert now == {name: rows[name]["verdict"] for name in now}
