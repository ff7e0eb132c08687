"""Verdicts follow from what is measured; a claim edited to be false turns its verdict."""

from dataclasses import replace

import pytest

from drake_rnn import InvalidInputError
from drake_rnn.claims import (
    Claim,
    Claims,
    Finding,
    Judge,
    Judgement,
    Paper,
    Quantity,
    SimulatedRuns,
)

SHORT = {"duration": 0.1}
ZERO = {"of": 0.0}


def run_it(**fields):
    return {"run": "pinv_line", "set": SHORT, **fields}


def error_below(bound):
    return run_it(metric="position_error_max_m", at_most=bound)


def half(run, of=1.0):
    return 0.5 * of


def longest(run):
    return run("pinv_line", SHORT).time[-1]


MEASURES = {"half": half, "longest": longest}


def claim(**fields):
    return Claim(id="slc-C1", where="here", says="something", **fields)


def judge_of(**fields):
    judge = Judge(Claims("test", Paper(title="A paper"), "README.md", (), MEASURES))
    return judge.judge(claim(**fields))


def test_a_claim_holds_if_all_its_criteria_are_met():
    found = judge_of(as_stated=[error_below(1.0), {"measure": "half", "at_least": 0.5}])
    assert found.verdict == "holds"
    assert found.findings[0].value < 1e-3
    assert [finding.holds for finding in found.findings] == [True, True]


def test_a_claim_edited_to_be_false_does_not_hold():
    assert judge_of(as_stated=[error_below(1.0), error_below(0.0)]).verdict == "does not hold"


def test_a_correction_counts_only_if_the_claim_fails_as_stated():
    fails, holds = [error_below(0.0)], [error_below(1.0)]
    corrected = judge_of(as_stated=fails, corrected=holds, because="another path")
    assert corrected.verdict == "holds with correction"
    assert judge_of(as_stated=holds, corrected=fails, because="no need").verdict == "holds"
    assert judge_of(as_stated=fails, corrected=fails, because="no").verdict == "does not hold"


def test_what_holds_instead_is_judged_and_turns_no_verdict():
    fails, holds = [error_below(0.0)], [error_below(1.0)]
    found = judge_of(as_stated=fails, instead=holds)
    assert found.verdict == "does not hold"
    assert [finding.holds for finding in found.parts["instead"]] == [True]
    assert judge_of(as_stated=holds, instead=fails).verdict == "holds"
    both = judge_of(as_stated=fails, corrected=fails, instead=holds, because="no")
    assert both.verdict == "does not hold"


def test_what_cannot_be_checked_says_so():
    assert judge_of(unchecked="its cells are lost").verdict == "cannot be checked"
    found = judge_of(unchecked="its arm is not printed", instead=[error_below(1.0)])
    assert found.verdict == "cannot be checked"
    assert [finding.holds for finding in found.findings] == [True]


def test_claims_that_rest_on_one_number_say_so():
    """Whatever is asked of it; another run, or another divisor, is another number."""
    first, second, third, fourth = (
        Claim(id=f"slc-C{k}", where="here", says="x", as_stated=[asked], because=because)
        for k, (asked, because) in enumerate(
            (
                (error_below(1.0), "Our reading."),
                (error_below(2.0), ""),
                (error_below(1.0) | {"set": {"duration": 0.2}}, ""),
                (error_below(1.0) | {"per": {"measure": "half"}}, "Ours."),
            ),
            start=1,
        )
    )
    claims = Claims("test", Paper(title="A paper"), "README.md", (first, second, third, fourth), {})
    assert claims.reason(first) == "Our reading. Shares a number with slc-C2."
    assert claims.reason(second) == "Shares a number with slc-C1."
    assert [claims.reason(third), claims.reason(fourth)] == ["", "Ours."]


def test_a_number_may_be_the_ratio_of_two():
    per = run_it(metric="position_error_max_m")
    (found,) = judge_of(as_stated=[error_below(1.0) | {"per": per}]).findings
    assert found.value == 1.0
    per = {"measure": "half"}
    (found,) = judge_of(
        as_stated=[{"measure": "half", "given": {"of": 8.0}, "at_most": 8.0, "per": per}]
    ).findings
    assert found.value == 8.0
    (found,) = judge_of(
        as_stated=[{"measure": "half", "at_most": 1e9, "per": {"measure": "half", "given": ZERO}}]
    ).findings
    assert not found.holds


def test_a_measure_may_look_at_a_whole_run():
    (found,) = judge_of(as_stated=[{"measure": "longest", "at_least": 0.1}]).findings
    assert found.value == 0.1


def test_a_run_that_is_refused_is_no_verdict():
    """A claim that names what is not there must not pass for one that does not hold."""
    fields = error_below(1.0) | {"set": {"law.damping": -1.0}}
    with pytest.raises(InvalidInputError, match="damping"):
        judge_of(as_stated=[fields])


def test_a_criterion_whose_run_lacks_the_number_is_not_met():
    (found,) = judge_of(as_stated=[run_it(metric="force_error_rms_N", at_most=1.0)]).findings
    assert not found.holds
    assert found.failure == "no force_error_rms_N in this run"


def test_a_run_is_made_once():
    runs = SimulatedRuns()
    first = runs.run("pinv_line", SHORT)
    assert runs.run("pinv_line", dict(SHORT)) is first
    assert runs.metrics("pinv_line", SHORT) is first.metrics


def test_a_judgement_with_an_error_is_none():
    """Whatever else was found."""
    one = Claim(id="slc-C1", where="here", says="x", as_stated=[error_below(1.0)] * 2)
    met, broken = (Finding(each, True) for each in one.as_stated)
    assert Judgement(one, {"as stated": (met, met)}).verdict == "holds"
    broken = replace(broken, holds=False, error="it broke")
    assert Judgement(one, {"as stated": (met, broken)}).verdict == "failed"
    assert Judgement(one, {"as stated": (met,), "instead": (broken,)}).verdict == "failed"
    assert str(broken) == "it broke"


def test_a_command_repeats_its_run_to_the_last_bit():
    """Numbers that are longer than is usual are written out."""
    quantity = Quantity(run="pinv_line", set={"law.damping": 1 / 3, "duration": 0.1}, metric="x")
    assert quantity.command == (
        f"drake-rnn run pinv_line --set law.damping={1 / 3!r} --set duration=0.1"
    )


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "give either as_stated or unchecked"),
        ({"as_stated": [error_below(1.0)], "unchecked": "why"}, "either as_stated or unchecked"),
        ({"as_stated": [run_it(at_most=1.0)]}, "metric: must be given with run"),
        ({"as_stated": [{"metric": "x", "at_most": 1.0}]}, "give either run or measure"),
        ({"as_stated": [run_it(metric="x")]}, "must give at_least, at_most or both"),
        ({"as_stated": [{"measure": "x", "set": SHORT, "at_most": 1.0}]}, "belong to a run"),
        ({"as_stated": [run_it(metric="x", at_most=1.0, at_least=2.0)]}, "must not exceed at_most"),
        ({"as_stated": [error_below(1.0)], "corrected": [error_below(1.0)]}, "needs .*because"),
    ],
)
def test_a_claim_that_cannot_be_judged_is_refused(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        claim(**fields)


@pytest.mark.parametrize("name", ["slc", "slc-X1", "F2a", "9-F2"])
def test_a_claim_has_a_name_by_scheme_and_place(name):
    with pytest.raises(InvalidInputError, match="must be like slc-F2a"):
        Claim(id=name, where="here", says="x", unchecked="why")
