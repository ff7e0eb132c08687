"""A shield between a source of targets and an arm."""

from .shield import (
    Shield as Shield,
    ShieldSettings as ShieldSettings,
    ShieldStatus as ShieldStatus,
)
