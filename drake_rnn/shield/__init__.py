"""A shield between a source of targets and an arm."""

from .pose_filter import PoseFilter as PoseFilter
from .process import Shield as Shield
from .report import ShieldRecord as ShieldRecord, ShieldSummary as ShieldSummary
from .shield import (
    ShieldSettings as ShieldSettings,
    ShieldStatus as ShieldStatus,
)
