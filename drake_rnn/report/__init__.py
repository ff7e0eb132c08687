"""The report of the papers: pages and data, made from runs that are kept."""

from .gathering import Done
from .report import Format, Report, ReportSettings, make_report

__all__ = ["Done", "Format", "Report", "ReportSettings", "make_report"]
