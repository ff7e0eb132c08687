"""Judge the papers' claims, and write their page and its data: make claims.

Of some papers alone, while what the page has of the others stays as it is::

    python docs/make_claims.py docs --only recursive state_adjustment
"""

import argparse
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

from drake_rnn.claims import read_claims, schemes_in
from drake_rnn.report import ReportSettings, make_report
from drake_rnn.report.report import (
    claims_table,
    counts_table,
    title_of,
)

_HEAD = """\
# What the papers claim, and what holds

<!-- Made by `make claims`, with claims.json; nightly tests compare the verdicts. -->

This page lists every numbered table, figure, theorem and remark of the papers, and the numbers in
their text. The texts of *floating base*, *noise suppressing*, *predefined time* and *prescribed
performance* were not available; their rows come from their authors' public code, data and pages.
The rows are data, a file for each paper in `drake_rnn/claims/papers/`.
Numbers and verdicts are computed from them: `drake-rnn claims ID --judge` does so for one claim,
and [`drake-rnn report`](export.md#the-report-of-the-papers) for all, with figures and playbacks of
the runs.

- **holds**: the measurements meet all criteria of the claim as stated. "As stated" means as
  printed; where the text leaves a choice, and for a physical experiment, which is simulated, it
  means the reading that the last column names.
- **holds with correction**: it does not hold as stated, but with the change to the printed law,
  parameter or formula that the last column names.
- **does not hold**: otherwise. A weaker claim (another bound, quantity or time, or one of its
  halves) is no correction; below *instead* stands what does hold.
- **cannot be checked**: the text does not give what the outcome depends on. Below *instead* stands
  what can be said all the same.

A number that the paper prints is required from both sides, a bound as printed. Any other bound is
at most five times away from what was measured, or says why it is wide: *round-off* is a number that
is zero but for the arithmetic of the computer. A bound that names no source was set beside the
measurement: it guards the number, and is no test of the claim. What a paper proves in continuous
time is judged in continuous time; the last column says what sampling does to it. What a paper
leaves open is chosen, and named. Claims that rest on the same number say so. Misprints that change
nothing else are not claims; they are on the pages of the schemes.

The name of a claim is made of the scheme and the place: T is a table, F a figure, Th a theorem, L a
lemma, R a remark, S a section, C a claim in the text. Photographs and schematics state nothing to
check.
"""


def page(contents: dict[str, Any], before: str = "") -> str:
    """Return the page from the data of a report.

    Args:
        contents: The data.
        before: The page as it was; what it has of papers that the report leaves out is taken over.
    """
    head, *rows = counts_table(contents).splitlines()
    rule, *rows = rows
    counts = {_first_cell(row): row for row in rows}
    sections = {title_of(paper): _section(paper) for paper in contents["papers"]}
    of_before = _HEADING.split(before)[1:]
    kept = {
        title: text.strip() for title, text in zip(of_before[::2], of_before[1::2], strict=True)
    }
    sections = kept | sections
    known = [row for row in before.split("## ")[0].splitlines() if row.startswith("| ")][1:]
    counts = {_first_cell(row): row for row in known} | counts
    table = "\n".join([head, rule, *(counts[name] for name in sorted(counts))])
    parts = [f"\n## {title}\n\n{sections[title]}" for title in sorted(sections)]
    return "\n".join([_HEAD, table, *parts]) + "\n"


_HEADING = re.compile(r"^## (.+)\n", re.MULTILINE)


def _section(paper: dict[str, Any]) -> str:
    name = paper["page"].removeprefix("docs/")
    return f"{paper['citation']}. More in [{name}]({name}).\n\n{claims_table(paper)}".strip()


def _first_cell(row: str) -> str:
    return row.split("|")[1].strip()


def measured(contents: dict[str, Any]) -> dict[str, Any]:
    """Return verdicts and numbers of all claims, by name, from the data of a report."""
    return {
        claim["id"]: {
            "verdict": claim["verdict"],
            "findings": [
                [finding[key] for key in ("number", "asked", "value", "met")]
                for finding in claim["findings"]
            ],
        }
        for paper in contents["papers"]
        for claim in paper["claims"]
    }


def _told(what: str, ended: int, total: int) -> None:
    print(f"{ended} of {total} {what}", file=sys.stderr)


def main() -> None:
    """Write page and data; runs that a report has made in its folder are not made again."""
    parser = argparse.ArgumentParser(description="Judge the papers' claims, and write their page.")
    parser.add_argument("place", type=Path, help="folder of claims.md and claims.json")
    parser.add_argument("folder", nargs="?", default="out/report", help="folder of the report")
    parser.add_argument("--only", nargs="+", choices=schemes_in(), help="papers to judge anew")
    given = parser.parse_args()
    place, folder = given.place, given.folder
    chosen = [(claims, claims.claims) for claims in map(read_claims, given.only or schemes_in())]
    settings = ReportSettings(jobs=os.cpu_count() or 1, pictures=False)
    made = make_report(chosen, folder, settings, _told)
    if made.failures or not made.complete:
        sys.exit("\n".join(f"{name}: {error}" for name, error in made.failures) or "interrupted")
    data, text = place / "claims.json", place / "claims.md"
    known = json.loads(data.read_text()) if given.only else {}
    found = known | measured(made.contents)
    order = [claim.id for scheme in schemes_in() for claim in read_claims(scheme).claims]
    rows = (f"{json.dumps(name)}: {json.dumps(found[name])}" for name in order if name in found)
    data.write_text("{\n" + ",\n".join(rows) + "\n}\n")
    text.write_text(page(made.contents, text.read_text() if given.only else ""))


if __name__ == "__main__":
    main()
