"""The page of a campaign: one file, with tables and figures inside it."""

from __future__ import annotations

import math
import os
from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from pathlib import Path

from ..campaigns import CampaignResult
from ..campaigns.statistics import Interval
from ..campaigns.summary import MetricSummary, Summary, smaller_is_worse
from ..colours import components
from ..errors import InvalidInputError
from .campaign import distribution_figure, sensitivity_figure
from .looks import SERIES

_STYLE = """
body { font: 14px/1.4 sans-serif; max-width: 72em; margin: 2em auto; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 0 0 1.5em; display: block; overflow-x: auto }
th, td { padding: .15em .7em; text-align: right; border-bottom: 1px solid #ddd }
td { white-space: nowrap }
th:first-child, td:first-child, td.text { text-align: left }
code { font-size: 12px } .picture { overflow-x: auto }
img { min-width: 50em; max-width: 100% } small { color: #666 }
"""
#: What is said of rows that a batch has run.
METHODS_NOTE = (
    "a command repeats a row of a batch in a simulation: but for rounding the same, medians of a "
    "learned Jacobian's errors within 0.6 %"
)
#: Rows that did not come to their end that are listed; all are in the table.
_LISTED = 50
#: Numbers of the colours of negative and positive correlations.
_LESS, _MORE = 4, 2


def write_campaign_page(result: CampaignResult, file: Path) -> Path:
    """Write what a campaign has come to as a page of HTML, and return its file.

    Args:
        result: The campaign.
        file: File to write.

    Raises:
        InvalidInputError: If it cannot be written.
    """
    summary, expect = result.summary, result.plan.campaign.expect
    parts = [
        f"<h1>{escape(summary.name or 'Campaign')}</h1>",
        *([f"<p>Expected: {escape(expect)}</p>"] if expect else []),
        _rows(result),
        _shares(summary),
        _metrics(summary),
        *_figures(result),
        _worst(summary),
        _sensitivity(summary),
        _unlike(summary),
    ]
    new = file.with_name(f".{file.name}.new")
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(summary.name)}</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(parts)}</body></html>\n"
    )
    try:
        new.write_text(page, encoding="utf-8")
        os.replace(new, file)
    except OSError as error:
        raise InvalidInputError(f"page {file}: {error.strerror}") from None
    return file


def interval_text(interval: Interval, percent: bool = False) -> str:
    """Return an estimate with its bounds as a text; bounds that are not known are left out."""
    number = "{:.1%}" if percent else "{:.4g}"
    low, high = (
        "?" if math.isinf(bound) else number.format(bound)
        for bound in (interval.low, interval.high)
    )
    return f"{number.format(interval.value)} [{low}, {high}]"


def _rows(result: CampaignResult) -> str:
    summary = result.summary
    told = [(status, str(count)) for status, count in summary.statuses.items()]
    told += [(f"by {method}", str(count)) for method, count in summary.methods.items()]
    if result.missing:
        told.append(("not run", str(result.missing)))
    table = f"<h2>{summary.rows} rows</h2>" + _table(("status", "rows"), told)
    return table + f"<p><small>{METHODS_NOTE}</small></p>" if "batch" in summary.methods else table


def _shares(summary: Summary) -> str:
    rows = [
        (name, interval_text(interval, percent=True)) for name, interval in summary.shares.items()
    ]
    note = f"of all finished rows, with {summary.confidence:.0%} Wilson intervals"
    return f"<h2>Shares</h2><p><small>{note}</small></p>" + _table(("keeps", "share"), rows)


def _metrics(summary: Summary) -> str:
    if not summary.metrics:
        return ""
    probabilities = list(summary.metrics[0].quantiles)
    head = ["metric", "rows", "mean", "least", *(f"{p:g} quantile" for p in probabilities)]
    rows = [
        (
            metric.name,
            str(metric.count),
            f"{metric.mean:.4g}",
            f"{metric.least:.4g}",
            *(interval_text(interval) for interval in metric.quantiles.values()),
            f"{metric.largest:.4g}",
        )
        for metric in summary.metrics
    ]
    note = (
        f"over the rows that came to their end; intervals between order statistics cover the true "
        f"quantile with {summary.confidence:.0%}; ? where there are too few rows for a bound"
    )
    return f"<h2>Metrics</h2><p><small>{note}</small></p>" + _table([*head, "largest"], rows)


def _figures(result: CampaignResult) -> Iterable[str]:
    distributions, sensitivity = BytesIO(), BytesIO()
    bounds = result.plan.experiment.get("accept", {})
    if distribution_figure(result.summary, result.lines, bounds, distributions):
        yield "<h2>Distributions</h2>" + _image(distributions)
    if sensitivity_figure(result.summary, result.lines, result.plan.experiment, sensitivity):
        yield "<h2>What they follow most</h2>" + _image(sensitivity)


def _worst(summary: Summary) -> str:
    rows = [
        (metric.name, str(worst.row), f"{worst.value:.6g}", f"<code>{escape(worst.command)}</code>")
        for metric in summary.metrics
        for worst in metric.worst
    ]
    least = [metric.name for metric in summary.metrics if smaller_is_worse(metric.name)]
    note = f"largest; of {', '.join(least)} smallest" if least else "largest"
    head = ("metric", "row", "value", "command")
    return f"<h2>Worst runs</h2><p><small>{note}</small></p>" + _table(head, rows, text=3)


def _sensitivity(summary: Summary) -> str:
    metrics = [metric for metric in summary.metrics if metric.correlations]
    if not metrics:
        return ""
    keys = list(metrics[0].correlations)
    cells = [(metric.name, *(_correlation(metric, key) for key in keys)) for metric in metrics]
    head = ("metric", *keys)
    note = (
        "Spearman's rank correlation of each varied number with each metric; independent ones stay "
        f"within ±{summary.chance:.2f} in {summary.confidence:.0%} of cases"
    )
    body = "".join(f"<tr><td>{escape(name)}</td>{''.join(values)}</tr>" for name, *values in cells)
    return f"<h2>Sensitivity</h2><p><small>{note}</small></p><table>{_head(head)}{body}</table>"


def _correlation(metric: MetricSummary, key: str) -> str:
    value = metric.correlations[key]
    if math.isnan(value):
        return "<td>-</td>"
    # Colours without a meaning of their own; the sign says the same.
    parts = components(SERIES[_LESS if value < 0 else _MORE])
    colour = ", ".join(f"{255 * part:.0f}" for part in parts)
    return f'<td style="background: rgba({colour}, {abs(value) * 0.6:.2f})">{value:.2f}</td>'


def _unlike(summary: Summary) -> str:
    if not summary.unlike:
        return ""
    rows = [
        (str(row), status, failure, f"<code>{escape(command)}</code>")
        for row, status, failure, command in summary.unlike[:_LISTED]
    ]
    left = len(summary.unlike) - len(rows)
    note = f"<p><small>and {left} more, see the table</small></p>" if left else ""
    title = "<h2>Rows that did not come to their end</h2>"
    return title + _table(("row", "status", "reason", "command"), rows, text=3) + note


def _image(picture: BytesIO) -> str:
    data = b64encode(picture.getvalue()).decode()
    return f'<div class="picture"><img alt="" src="data:image/png;base64,{data}"></div>'


def _head(head: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<th>{escape(name)}</th>' for name in head)}</tr>"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], text: int | None = None) -> str:
    """Return a table; the column ``text`` is HTML already, and stands to the left."""
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="text">{value}</td>' if k == text else f"<td>{escape(value)}</td>"
            for k, value in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f"<table>{_head(head)}{body}</table>"
