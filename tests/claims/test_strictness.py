"""Criteria are no wider than what was measured gives reason for, and nothing is counted twice.

Measured numbers are those that `make claims` wrote to docs/claims.json; no run is made here.
"""

import json
import math
import re
from dataclasses import replace
from functools import cache

from doc_pages import ROOT

from drake_rnn.claims import SCHEMES, Finding, Judgement, read_claims

MEASURED = json.loads((ROOT / "docs" / "claims.json").read_text())

#: How many times a bound may be as far from zero, or as near to it, as what was measured.
WIDEST = 5.0
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


@cache
def every_claim():
    """Return all claims by id, which are read only once they are asked for."""
    return {claim.id: claim for scheme in SCHEMES for claim in read_claims(scheme).claims}


def factor(bound, number):
    """Return how many times one number is the other, either way; infinite across zero."""
    if bound * number <= 0.0:
        return math.inf
    return max(bound / number, number / bound)


def is_wide(criterion, value):
    """Return whether a bound that is kept is far from the number, and the paper's figure too.

    Zero is a bound that cannot be too wide.
    """
    if value is None or not criterion.bounds.holds(value):
        return False
    figures = [value, *map(float, _NUMBER.findall(criterion.paper))]
    bounds = [bound for bound in (criterion.at_least, criterion.at_most) if bound]
    return any(min(factor(bound, each) for each in figures) > WIDEST for bound in bounds)


def complaints(claim):
    """Return what is wrong with a claim's criteria, beside what was measured."""
    told = []
    for criterion, (number, asked, value, _) in zip(
        claim.criteria, MEASURED[claim.id]["findings"], strict=True
    ):
        if (str(criterion), str(criterion.bounds)) != (number, asked):
            told.append(
                f"{criterion}: {criterion.bounds} is not what docs/claims.json has: {asked}"
            )
        if is_wide(criterion, value) and not criterion.wide_because:
            told.append(f"{criterion}: {criterion.bounds}, measured {value:.3g}: no wide_because")
    return told


def ten_times_wider(criterion):
    """Return a criterion with bounds ten times as far from what they let through."""

    def moved(bound, up):
        return bound if bound is None else bound * (10.0 if (bound > 0.0) == up else 0.1)

    return replace(
        criterion, at_least=moved(criterion.at_least, False), at_most=moved(criterion.at_most, True)
    )


def test_criteria_are_as_narrow_as_what_was_measured():
    assert {
        name: told for name, claim in every_claim().items() if (told := complaints(claim))
    } == {}


def test_a_criterion_made_ten_times_wider_is_found():
    """Each in turn; also if its number is measured anew, if it is met and has no reason."""
    tried = 0
    for name, claim in every_claim().items():
        for part, criteria in claim.parts.items():
            key = {"as stated": "as_stated", "with the correction": "corrected"}.get(part, part)
            for k, criterion in enumerate(criteria):
                wider = ten_times_wider(criterion)
                if str(wider.bounds) == str(criterion.bounds):
                    continue  # zero
                tampered = replace(claim, **{key: [*criteria[:k], wider, *criteria[k + 1 :]]})
                assert complaints(tampered), (name, str(criterion))
                value = MEASURED[name]["findings"][claim.criteria.index(criterion)][2]
                if value and criterion.bounds.holds(value) and not criterion.wide_because:
                    assert is_wide(wider, value), (name, str(criterion))
                tried += 1
    assert tried > 150


def found(criterion, value):
    return Finding(criterion, value is not None and criterion.bounds.holds(value))


def test_the_verdict_follows_from_the_data_and_what_holds_instead_does():
    for name, claim in every_claim().items():
        values = (value for _, _, value, _ in MEASURED[name]["findings"])
        parts = {part: tuple(map(found, each, values)) for part, each in claim.parts.items()}
        judgement = Judgement(claim, parts)
        assert judgement.verdict == MEASURED[name]["verdict"], name
        holds = [finding.holds for finding in judgement.findings]
        assert holds == [met for *_, met in MEASURED[name]["findings"]], name
        assert all(finding.holds for finding in parts["instead"]), name


def within(bounds, others):
    """Return whether bounds let nothing through that others do not."""
    least, other_least = (
        -math.inf if each.at_least is None else each.at_least for each in (bounds, others)
    )
    most, other_most = (
        math.inf if each.at_most is None else each.at_most for each in (bounds, others)
    )
    return least >= other_least and most <= other_most


def test_a_correction_meets_all_that_is_stated():
    """The same numbers, within the same bounds or narrower ones: no half, no other bound."""
    judged = 0
    for name, claim in every_claim().items():
        if not claim.corrected:
            continue
        for stated in claim.as_stated:
            quantity = stated.metric or stated.measure
            assert any(
                quantity == (each.metric or each.measure) and within(each.bounds, stated.bounds)
                for each in claim.corrected
            ), (name, str(stated))
            judged += 1
    assert judged > 30


def measured():
    """Yield every criterion with its claim's name and what was measured."""
    for name, claim in every_claim().items():
        findings = MEASURED[name]["findings"]
        for criterion, (_, _, value, _) in zip(claim.criteria, findings, strict=True):
            yield name, criterion, value


def test_a_number_that_the_paper_prints_is_asked_for_from_both_sides():
    for name, criterion, _ in measured():
        printed = re.match(r"(?:about |around |of order )?(\d\S*)", criterion.paper)
        if printed and float(printed[1]) != 0.0:
            assert None not in (criterion.at_least, criterion.at_most), (name, str(criterion))


def test_a_reason_to_be_wide_is_needed():
    """A reason that outlives its bound would hide the next one."""
    for name, criterion, value in measured():
        if criterion.wide_because:
            assert is_wide(criterion, value), (name, str(criterion))
        if criterion.wide_because == "round-off":
            assert abs(value) < 1e-10, (name, str(criterion))


def test_no_claim_holds_twice_by_one_number_without_saying_so():
    """Rows of the page that rest on the same numbers name each other."""
    page = (ROOT / "docs" / "claims.md").read_text()
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    numbers = {name: {row[0] for row in MEASURED[name]["findings"]} for name in every_claim()}
    shared = 0
    for one in every_claim():
        for other in every_claim():
            if one != other and one.partition("-")[0] == other.partition("-")[0]:
                told = re.search(r"Shares a number with ([^|]*)\. \|$", rows[one])
                named = told[1].split(", ") if told else []
                assert (other in named) is (not numbers[one].isdisjoint(numbers[other]))
                shared += other in named
    assert shared >= 10
