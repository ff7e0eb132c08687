"""A report says what was measured, makes each run once, and tells what failed."""

import json
import runpy
from copy import deepcopy

import pytest
from doc_pages import ROOT
from report_helpers import CLAIMS, SHORT, claim, error_below

from drake_rnn import InvalidInputError, simulate
from drake_rnn.claims import Claim, Finding, Judgement, read_claims, schemes_in
from drake_rnn.experiment import load_experiment
from drake_rnn.report import ReportSettings, make_report
from drake_rnn.report.report import (
    SIGNS,
    VERDICTS,
    claims_table,
    contents_of,
    index_html,
    paper_html,
    paper_page,
)


def rows(made):
    (paper,) = made.contents["papers"]
    return {row["id"]: row for row in paper["claims"]}


def files(folder):
    found = (file for file in folder.rglob("*") if file.is_file() and file.name != ".claim")
    return {file: file.stat().st_mtime_ns for file in found}


def edited(change):
    contents = deepcopy(CLAIMS)
    change({each["id"]: each for each in contents["claims"]})
    return contents


def test_verdicts_follow_from_what_was_measured(tiny, report):
    made = report(tiny())
    verdicts = {name: row["verdict"] for name, row in rows(made).items()}
    assert verdicts == {
        "jdf-C1": "holds",
        "jdf-C2": "holds with correction",
        "jdf-C3": "does not hold",
        "jdf-C4": "cannot be checked",
    }
    assert [made.contents["counts"][verdict] for verdict in VERDICTS] == [1, 1, 1, 1, 0]
    assert made.complete
    assert made.failures == []
    assert rows(made)["jdf-C1"]["why"] == "As stated, both numbers are as asked."
    assert rows(made)["jdf-C2"]["why"] == (
        "As stated, the one number is not as asked; "
        "with the correction, the one number is as asked."
    )
    assert rows(made)["jdf-C3"]["why"] == (
        "As stated, the one number is not as asked; instead, the one number is as asked."
    )
    assert rows(made)["jdf-C4"]["why"] == "There is nothing to measure it by."


def test_what_holds_instead_stands_below_the_claim(tiny, report):
    made = report(tiny())
    assert [finding["part"] for finding in rows(made)["jdf-C3"]["findings"]] == [
        "as stated",
        "instead",
    ]
    html = (made.folder / "joint_drift_free.html").read_text()
    assert html.count('<tr class="part"><th colspan="5">instead</th></tr>') == 1
    assert "wide: an &lt;i&gt;example&lt;/i&gt;" in html
    table = claims_table(made.contents["papers"][0])
    assert "<br>*instead:*<br>`drake-rnn run pinv_line --set duration=0.05`" in table
    assert "(wide: an <i>example</i>)" in table


def test_rows_that_rest_on_one_number_name_each_other(tiny, report):
    found = rows(report(tiny()))
    assert found["jdf-C1"]["because"] == "Shares a number with jdf-C2, jdf-C3."
    assert found["jdf-C4"]["because"] == "Its cells are lost."


def test_the_data_hold_every_digit(tiny, report):
    """The number is that of the run which the command beside it makes."""
    made = report(tiny())
    told = json.loads((made.folder / "report.json").read_text())
    assert told == made.contents
    finding = rows(made)["jdf-C1"]["findings"][0]
    alone = simulate(load_experiment("pinv_line", SHORT))
    assert finding["value"] == alone.metrics["position_error_max_m"]
    assert finding["command"] == "drake-rnn run pinv_line --set duration=0.05"
    (key,) = finding["runs"]
    run = told["runs"][key]
    assert run["metrics"] == alone.metrics
    assert (run["seed"], run["status"], run["until_s"]) == (0, "complete", 0.05)
    assert run["wall_time_s"] > 0.0
    assert told["versions"]["drake"]
    assert (made.folder / run["folder"] / "result.npz").is_file()


@pytest.mark.long
def test_a_second_call_makes_no_run_and_writes_nothing(tiny, report, simulated):
    folder = report(tiny(), pictures=True).folder
    assert sorted(simulated) == ["pinv_line"] * 3
    before = files(folder)
    assert report(tiny(), pictures=True).complete
    assert len(simulated) == 3
    assert files(folder) == before


def test_files_of_a_users_own_are_not_touched(tiny, report, tmp_path):
    own = tmp_path / "report" / "runs" / "mine" / "result.npz"
    own.parent.mkdir(parents=True)
    own.write_text("mine")
    page = tmp_path / "report" / "index.html"
    page.write_text("mine")
    with pytest.raises(InvalidInputError, match=r"report: index.html is not of a report; give an"):
        report(tiny())
    assert page.read_text() == "mine"
    page.unlink()
    notes = page.with_name("notes.md")
    notes.write_text("mine")
    assert report(tiny()).complete
    assert (own.read_text(), notes.read_text()) == ("mine", "mine")


@pytest.mark.long
def test_a_kept_run_that_is_damaged_is_made_again_if_asked(tiny, report, simulated):
    folder = report(tiny()).folder
    (metrics, *_) = sorted(folder.rglob("metrics.json"))
    metrics.write_text("{")
    assert report(tiny(), again=True).complete
    assert len(simulated) == 4
    assert json.loads(metrics.read_text())


def test_a_claim_edited_to_be_false_turns_its_verdict_without_a_run(tiny, report, simulated):
    report(tiny())
    del simulated[:]
    false = edited(lambda claims: claims["jdf-C1"]["as_stated"][0].update(at_most=0.0))
    assert rows(report(tiny(false)))["jdf-C1"]["verdict"] == "does not hold"
    assert simulated == []


def test_a_run_with_another_change_is_another_run(tiny, report, simulated):
    report(tiny())
    del simulated[:]
    other = edited(lambda claims: claims["jdf-C1"]["as_stated"][0]["set"].update(duration=0.06))
    assert rows(report(tiny(other)))["jdf-C1"]["verdict"] == "holds"
    assert simulated == ["pinv_line"]


@pytest.mark.long
def test_what_fails_is_told_in_its_rows_and_stops_nothing_else(tiny, report, fatal, simulated):
    broken = {
        **CLAIMS,
        "claims": [
            *CLAIMS["claims"],
            claim(5, as_stated=[error_below(1.0, **fatal, **{"law.fate": "fail"})]),
            claim(6, as_stated=[error_below(1.0, **{"law.damping": -1.0})]),
            claim(7, as_stated=[error_below(1.0, **{"law.no": 1})]),
            claim(
                8,
                as_stated=[
                    {"measure": "error_at_end", "given": {"experiment": "none"}, "at_most": 1}
                ],
            ),
            claim(
                9,
                as_stated=[
                    {
                        "measure": "sigma_misfit",
                        "given": {"experiment": "pinv_line"},
                        "at_most": 1,
                    }
                ],
            ),
        ],
    }
    made = report(tiny(broken), pictures=True, playbacks=False)
    found = rows(made)
    assert [found[f"jdf-C{k}"]["verdict"] for k in range(1, 5)] == list(VERDICTS[:4])
    assert {found[f"jdf-C{k}"]["verdict"] for k in range(5, 10)} == {"failed"}
    errors = dict(made.failures)
    assert "its time has come (at t = 0.01" in errors["jdf-C5"]
    assert errors["jdf-C6"].startswith("law.damping: must be")
    assert "law: no" in errors["jdf-C7"] or "law.no" in errors["jdf-C7"]
    assert "no experiment 'none'" in errors["jdf-C8"]
    assert errors["jdf-C9"] == "KeyError: 'velocity_error_predicted'"
    page = (made.folder / "joint_drift_free.html").read_text()
    assert "its time has come" in page
    assert "5 could not be judged" in (made.folder / "index.html").read_text()
    # What it had until it failed is there to look at.
    (key,) = found["jdf-C5"]["runs"]
    assert (made.folder / made.contents["runs"][key]["figure"]).is_file()

    del simulated[:]
    report(tiny(broken))
    assert simulated == []
    report(tiny(broken), again=True)
    assert len(simulated) == 1


@pytest.mark.long
def test_a_run_that_kills_its_worker_is_told_too(tiny, report, fatal):
    fate = claim(5, as_stated=[error_below(1.0, **fatal, **{"law.fate": "kill"})])
    made = report(tiny({**CLAIMS, "claims": [*CLAIMS["claims"], fate]}), jobs=1)
    assert rows(made)["jdf-C1"]["verdict"] == "holds"
    ((name, error),) = made.failures
    assert name == "jdf-C5"
    assert error.startswith("its worker died 3 times")


def test_a_picture_that_fails_is_told(tiny, report, monkeypatch):
    def broken(result, folder, names):
        raise ValueError("no ink")

    monkeypatch.setattr("drake_rnn.report.kept_runs.write_figures", broken)
    made = report(tiny(), pictures=True)
    assert rows(made)["jdf-C1"]["verdict"] == "holds"
    assert {error for _, error in made.failures} == {"ValueError: no ink"}


@pytest.mark.long
def test_main_runs_have_playbacks_and_all_have_figures(tiny, report):
    """The second run of a claim gets a figure alone."""
    contents = {
        **CLAIMS,
        "claims": [claim(1, as_stated=[error_below(1.0), error_below(1.0, seed=3)])],
    }
    made = report(tiny(contents), pictures=True)
    one, other = (made.contents["runs"][key] for key in rows(made)["jdf-C1"]["runs"])
    assert (made.folder / one["playback"]).stat().st_size > 1e5
    assert other["playback"] is None
    for run in (one, other):
        assert (made.folder / run["figure"]).stat().st_size > 1e4
    assert report(tiny(contents), pictures=True, playbacks=False).contents["runs"]


def test_markdown_takes_the_place_of_html(tiny, report):
    folder = report(tiny()).folder
    assert (folder / "index.html").is_file()
    report(tiny(), format="md")
    assert not list(folder.glob("*.html"))
    page = (folder / "joint_drift_free.md").read_text()
    assert "| `jdf-C2` | place 2 | Something. |" in page
    assert "<b>seed</b> \\| is better." in page
    assert "| `drake-rnn run pinv_line --set duration=0.05` | 0 | 0.05 |" in page
    assert "[Joint drift free](joint_drift_free.md)" in (folder / "index.md").read_text()


def test_pages_say_what_runs_promise(tiny, report):
    changes = {"duration": 0.02, "window": None, "accept": None}
    run = {"run": "slc_nephroid_known", "set": changes, "metric": "position_error_max_m"}
    chosen = tiny({**CLAIMS, "claims": [claim(1, as_stated=[{**run, "at_most": 1.0}])]})
    made = report(chosen)
    ((_, found),) = made.contents["runs"].items()
    (line,) = found["promises"]
    assert line.startswith("position, velocity, acceleration: promised of the arm, kept; rests on ")
    assert f"promise: {line}" in (made.folder / "joint_drift_free.html").read_text()
    report(chosen, format="md")
    assert line in (made.folder / "joint_drift_free.md").read_text()


def test_what_a_claims_file_says_is_text_on_a_page(tiny, report):
    made = report(tiny())
    page = (made.folder / "joint_drift_free.html").read_text()
    assert "A &lt;b&gt;seed&lt;/b&gt; | is better." in page
    assert "<b>seed" not in page


def test_results_of_other_code_are_not_read_and_are_removed(tiny, report, simulated, monkeypatch):
    chosen = tiny({**CLAIMS, "claims": [claim(1, as_stated=[error_below(1.0)])]})
    folder = report(chosen).folder
    (before,) = (folder / "runs").iterdir()
    del simulated[:]
    monkeypatch.setattr("drake_rnn.report.kept_runs.stamp", lambda: "other code")
    report(chosen)
    assert len(simulated) == 1
    assert not before.exists()
    assert len(list((folder / "runs").iterdir())) == 1


def test_interrupted_while_it_measures_it_keeps_what_it_has(tiny, report, monkeypatch, simulated):
    def interrupted(claims, claim, runs):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("drake_rnn.report.report.judge", interrupted)
        assert not report(tiny()).complete
    del simulated[:]
    assert report(tiny()).complete
    assert simulated == []


def test_two_at_once_are_refused(tiny, report):
    chosen = tiny()

    def meanwhile(what, ended, total):
        with pytest.raises(InvalidInputError, match="another process is working"):
            report(chosen)

    folder = report(chosen).folder
    other = tiny({**CLAIMS, "claims": [claim(1, as_stated=[error_below(1.0, seed=9)])]})
    make_report(other, folder, ReportSettings(jobs=0, pictures=False), meanwhile)


class NoRuns:
    """Runs that nothing was taken from."""

    def used_by(self, claims, quantity):
        return []


@pytest.fixture(scope="module")
def shipped():
    """A report of all shipped claims, as if all numbers were there."""
    chosen = [(paper, list(paper.claims)) for paper in map(read_claims, schemes_in())]

    def met(claim: Claim):
        return Judgement(
            claim,
            {
                part: tuple(Finding(each, True, 1.0) for each in criteria)
                for part, criteria in claim.parts.items()
            },
        )

    judgements = {claim.id: met(claim) for _, claims in chosen for claim in claims}
    return contents_of(chosen, judgements, NoRuns())


def test_every_shipped_claim_has_its_row(shipped):
    page_of = {paper["scheme"]: f"{paper['scheme']}.html" for paper in shipped["papers"]}
    index = index_html(shipped, page_of)
    ids = []
    for paper in shipped["papers"]:
        html, md = paper_html(shipped, paper, page_of), paper_page(shipped, paper)
        for row in paper["claims"]:
            ids.append(row["id"])
            shown = f'<article id="{row["id"]}" data-claim="{row["verdict"]}">'
            assert html.count(shown) == 1
            assert f'href="{page_of[paper["scheme"]]}#{row["id"]}"' in index
            assert md.count(f"| `{row['id']}` |") == 1
        assert claims_table(paper) in md
    assert len(ids) == len(set(ids)) == sum(len(read_claims(s).claims) for s in schemes_in())


def test_the_page_of_claims_says_what_the_claims_files_say(shipped):
    """All but what is measured; a long test in tests/claims compares the verdicts."""
    page = runpy.run_path(str(ROOT / "docs" / "make_claims.py"))["page"](shipped)
    written = (ROOT / "docs" / "claims.md").read_text()
    assert words(page) == words(written)
    for paper in shipped["papers"]:
        assert f"\n{paper['citation']}. More in " in written


def words(page):
    """Return claim, place, statement and reason of each row of a page of claims."""
    rows = (line.split(" | ") for line in page.splitlines() if line.startswith("| `"))
    return [(row[0], row[1], row[2], row[-1]) for row in rows]


def test_no_page_asks_the_network(shipped):
    page_of = {paper["scheme"]: f"{paper['scheme']}.html" for paper in shipped["papers"]}
    pages = [paper_html(shipped, paper, page_of) for paper in shipped["papers"]]
    for page in [index_html(shipped, page_of), *pages]:
        assert "http://" not in page
        assert "https://" not in page


def test_every_verdict_has_a_sign():
    """So that none is told by its colour alone."""
    assert set(SIGNS) == set(VERDICTS)
    assert len(set(SIGNS.values())) == len(VERDICTS)
