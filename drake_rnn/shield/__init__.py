"""A shield between a source of targets and an arm."""

from .process import Shield as Shield
from .shield import (
    ShieldSettings as ShieldSettings,
    ShieldStatus as ShieldStatus,
)
