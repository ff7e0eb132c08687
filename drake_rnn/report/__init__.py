"""The report of the papers: pages and data, made from runs that are kept."""

from .kept_runs import Progress as Progress
from .report import (
    Format as Format,
    Report as Report,
    ReportSettings as ReportSettings,
    make_report as make_report,
)
