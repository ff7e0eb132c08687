"""A report as Markdown: pages of their own, and the tables of the repository's page of claims."""

from __future__ import annotations

from typing import Any

from ..tables import markdown_rows
from .contents import VERDICTS, parts_of

_COLUMNS = ("claim", "place", "the paper says", "measured", "verdict", "why")
_RUN_COLUMNS = ("run", "seed", "simulated [s]", "wall time [s]", "status", "to look at")


def index_page(contents: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return the page of all papers.

    Args:
        contents: What the report says.
        page_of: Names of the papers' pages, by scheme.
    """
    links = [
        f"- [{title_of(paper)}]({page_of[paper['scheme']]}): {paper['citation']}"
        for paper in contents["papers"]
    ]
    parts = [
        "# What the papers claim, and what holds",
        markdown_rows(counts_rows(contents)),
        "\n".join(links),
        _made_with(contents),
    ]
    return "\n\n".join(parts) + "\n"


def paper_page(contents: dict[str, Any], paper: dict[str, Any]) -> str:
    """Return one paper's page: its claims, and the runs that they were judged by."""
    keys = dict.fromkeys(key for claim in paper["claims"] for key in claim["runs"])
    runs = [contents["runs"][key] for key in keys]
    parts = [
        f"# {title_of(paper)}",
        paper["citation"],
        claims_table(paper),
        "## Runs",
        markdown_rows([_RUN_COLUMNS, *map(_run, runs)]) if runs else "None.",
        _made_with(contents),
    ]
    return "\n\n".join(parts) + "\n"


def counts_table(contents: dict[str, Any]) -> str:
    """Return a table of how many claims of each paper hold."""
    return markdown_rows(counts_rows(contents))


def counts_rows(contents: dict[str, Any]) -> list[list[str]]:
    """Return its rows, the head first; failures have a column only if there are some."""
    shown = [each for each in VERDICTS if each != "failed" or contents["counts"]["failed"]]
    rows = [["scheme", "claims", *shown]]
    for paper in contents["papers"]:
        counts = [str(paper["counts"][verdict]) for verdict in shown]
        total = str(len(paper["claims"]))
        rows.append([paper["scheme"].replace("_", " "), total, *counts])
    return rows


def claims_table(paper: dict[str, Any]) -> str:
    """Return the table of one paper's claims."""
    return markdown_rows([_COLUMNS, *map(_claim, paper["claims"])])


def title_of(paper: dict[str, Any]) -> str:
    """Return the name of a paper's scheme as a heading."""
    return str(paper["scheme"]).replace("_", " ").capitalize()


def _claim(claim: dict[str, Any]) -> list[str]:
    measured: list[str] = []
    for part, findings in parts_of(claim).items():
        measured += [] if part == "as stated" else [f"*{part}:*"]
        measured += map(_finding, findings)
    return [
        f"`{claim['id']}`",
        claim["where"],
        claim["says"],
        "<br>".join(measured),
        claim["verdict"],
        claim["because"],
    ]


def _finding(finding: dict[str, Any]) -> str:
    what = f"`{finding['number']}`"
    if finding["command"] is not None:
        per = f", per `{finding['per']}`" if finding["per"] is not None else ""
        what = f"`{finding['command']}`: {finding['metric']}{per}"
    paper = f" (paper: {finding['paper']})" if finding["paper"] else ""
    wide = f" (wide: {finding['wide_because']})" if finding["wide_because"] else ""
    return f"{what}: **{finding['shown']}**, asked {finding['asked']}{paper}{wide}"


def _run(run: dict[str, Any]) -> list[str]:
    links = {"figure": run["figure"], "playback": run["playback"]}
    return [
        f"`{run['command']}`",
        str(run["seed"]),
        "" if run["until_s"] is None else f"{run['until_s']:g}",
        "" if run["wall_time_s"] is None else f"{run['wall_time_s']:.1f}",
        f"{run['status']}: {run['failure']}" if run["failure"] else run["status"],
        ", ".join(f"[{name}]({link})" for name, link in links.items() if link),
    ]


def _made_with(contents: dict[str, Any]) -> str:
    known = {name: number for name, number in contents["versions"].items() if number}
    return f"Made with {', '.join(f'{name} {number}' for name, number in known.items())}."
