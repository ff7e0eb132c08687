"""Judge the papers' claims and print their page: make claims."""

import sys
from collections import Counter

from drake_rnn.claims import SCHEMES, Claims, Finding, Judge, Judgement, read_claims

_HEAD = """\
# What the papers claim, and what holds

<!-- Made by `make claims`; a long test compares the verdicts. -->

Every numbered table, figure, theorem and remark of the five papers, and what their text states in
numbers, row by row. The rows are data, a file for each paper in `drake_rnn/claims/papers/`. Numbers
and verdicts are computed from them: `drake-rnn claims ID --judge` does so for one of them.

A claim *holds* if all that is asked of it as stated is measured. As stated is what is printed;
where the text leaves a choice, and for a physical experiment, which is simulated, it is the reading
that the last column names. A claim *holds with correction* if that fails, but holds with the change
of what is printed that the last column names. Otherwise it *does not hold*. A claim *cannot be
checked* if the text does not say enough. A name is made of the scheme and the place: T is a table,
F a figure, Th a theorem, L a lemma, R a remark, S a section, C a claim in the text. Photographs and
schematics state nothing to check.
"""


def _line(finding: Finding) -> str:
    criterion = finding.criterion
    what = f"`{criterion}`"
    if criterion.measure is None:
        per = f", per `{criterion.per}`" if criterion.per is not None else ""
        what = f"`{criterion.command}`: {criterion.metric}{per}"
    paper = f" (paper: {criterion.paper})" if criterion.paper else ""
    return f"{what}: **{finding}**, asked {criterion.bounds}{paper}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _row(judgement: Judgement) -> str:
    claim = judgement.claim
    lines = [_line(finding) for finding in judgement.as_stated]
    if judgement.corrected:
        lines += ["*corrected:*", *map(_line, judgement.corrected)]
    cells = (
        f"`{claim.id}`",
        claim.where,
        claim.says,
        "<br>".join(lines),
        judgement.verdict,
        claim.because or claim.unchecked,
    )
    return f"| {' | '.join(map(_cell, cells))} |"


def _section(claims: Claims) -> tuple[str, Counter[str]]:
    judge, rows, verdicts = Judge(claims), [], Counter[str]()
    for claim in claims.claims:
        judgement = judge.judge(claim)
        print(claim.id, judgement.verdict, file=sys.stderr)
        rows.append(_row(judgement))
        verdicts[judgement.verdict] += 1
    page = claims.page.removeprefix("docs/")
    head = (
        f"\n## {claims.scheme.replace('_', ' ').capitalize()}\n\n{claims.paper}. More in "
        f"[{page}]({page}).\n\n"
        "| claim | place | the paper says | measured | verdict | why |\n|---|---|---|---|---|---|\n"
    )
    return head + "\n".join(rows) + "\n", verdicts


def main() -> None:
    """Print the page."""
    sections = {scheme: _section(read_claims(scheme)) for scheme in SCHEMES}
    kinds = ("holds", "holds with correction", "does not hold", "cannot be checked")
    print(_HEAD)
    print("| scheme | claims | " + " | ".join(kinds) + " |\n" + "|---" * 6 + "|")
    for scheme, (_, verdicts) in sections.items():
        counts = " | ".join(str(verdicts[kind]) for kind in kinds)
        print(f"| {scheme.replace('_', ' ')} | {verdicts.total()} | {counts} |")
    for text, _ in sections.values():
        print(text, end="")


if __name__ == "__main__":
    main()
