"""The page of a campaign: one file, with tables and figures inside it."""

from __future__ import annotations

import math
from base64 import b64encode
from io import BytesIO
from pathlib import Path

from ..campaigns import CampaignResult
from ..campaigns.statistics import Interval
from ..campaigns.summary import Summary, smaller_is_worse
from ..colours import components
from ..errors import InvalidInputError
from ..inputs.page_templates import page_templates
from ..measures import rounded
from ..runs.whole_file import written_whole
from .campaign import distribution_figure, sensitivity_figure
from .looks import SERIES
from .paper import current

#: Rows that did not come to their end that are listed; all are in the table.
_LISTED = 50
#: Numbers of the colours of negative and positive correlations, which have no meaning of their own.
_LESS, _MORE = 4, 2


def write_campaign_page(result: CampaignResult, file: Path) -> Path:
    """Write the outcome of a campaign as a page of HTML, and return its file.

    Args:
        result: The campaign.
        file: File to write.

    Raises:
        InvalidInputError: If it cannot be written.
    """
    template = page_templates(Path(__file__).parent).get_template("campaign_page.html.jinja")
    summary = result.summary
    distributions, sensitivity = _figures(result)
    page = template.render(
        summary=summary,
        expect=result.plan.campaign.expect,
        confidence=f"{summary.confidence:.0%}",
        counts=_counts(result),
        shares=[(name, interval_text(share, True)) for name, share in summary.shares.items()],
        metrics=_metrics(summary),
        distributions=distributions,
        sensitivity=sensitivity,
        worst=[
            (metric.name, worst.row, f"{worst.value:.6g}", worst.command)
            for metric in summary.metrics
            for worst in metric.worst
        ],
        smaller_is_worse=[m.name for m in summary.metrics if smaller_is_worse(m.name)],
        correlations=[metric for metric in summary.metrics if metric.correlations],
        less=_colour(_LESS),
        more=_colour(_MORE),
        listed=_LISTED,
    )
    try:
        with written_whole(file) as stream:
            stream.write(page)
    except OSError as error:
        raise InvalidInputError(f"page {file}: {error.strerror}") from None
    return file


def write_campaign_figures(result: CampaignResult, folder: Path) -> list[Path]:
    """Write the figures of a campaign's page as files of their own, as far as there are any.

    Args:
        result: The campaign.
        folder: Folder to write to.
    """
    form, document = current().form, result.plan.experiment
    files = [folder / f"{name}.{form}" for name in ("distributions", "sensitivity")]
    drawn = (
        distribution_figure(result.summary, result.lines, document.get("accept", {}), files[0]),
        sensitivity_figure(result.summary, result.lines, document, files[1]),
    )
    return [file for file, done in zip(files, drawn, strict=True) if done]


def interval_text(interval: Interval, percent: bool = False) -> str:
    """Return an estimate with its bounds as a text; bounds that are not known are left out."""
    number = "{:.1%}".format if percent else rounded
    bounds = (interval.low, interval.high)
    low, high = ("?" if math.isinf(bound) else number(bound) for bound in bounds)
    return f"{number(interval.value)} [{low}, {high}]"


def _counts(result: CampaignResult) -> list[tuple[str, int]]:
    """Return the number of rows of each status, by each method, and of those not run."""
    methods = [(f"by {method}", count) for method, count in result.summary.methods.items()]
    missing = [("not run", result.missing)] if result.missing else []
    return [*result.summary.statuses.items(), *methods, *missing]


def _metrics(summary: Summary) -> list[list[str]]:
    """Return the rows of the table of metrics, the head first; none without metrics."""
    if not summary.metrics:
        return []
    quantiles = [f"{probability:g} quantile" for probability in summary.metrics[0].quantiles]
    rows = [["metric", "rows", "mean", "least", *quantiles, "largest"]]
    for metric in summary.metrics:
        numbers = [rounded(metric.mean), rounded(metric.least)]
        numbers += map(interval_text, metric.quantiles.values())
        rows.append([metric.name, str(metric.count), *numbers, rounded(metric.largest)])
    return rows


def _figures(result: CampaignResult) -> tuple[str, str]:
    """Return both figures as PNG files in base64; empty where there is nothing to draw."""
    document, (distributions, sensitivity) = result.plan.experiment, (BytesIO(), BytesIO())
    distribution_figure(result.summary, result.lines, document.get("accept", {}), distributions)
    sensitivity_figure(result.summary, result.lines, document, sensitivity)
    return (
        b64encode(distributions.getvalue()).decode(),
        b64encode(sensitivity.getvalue()).decode(),
    )


def _colour(number: int) -> str:
    """Return red, green and blue of the colour of curve ``number``, as HTML takes them."""
    return ", ".join(f"{255 * part:.0f}" for part in components(SERIES[number]))
