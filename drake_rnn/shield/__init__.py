"""A shield between a source of targets and an arm."""

from .report import ShieldRecord as ShieldRecord, ShieldSummary as ShieldSummary
from .shield import (
    Shield as Shield,
    ShieldSettings as ShieldSettings,
    ShieldStatus as ShieldStatus,
)
