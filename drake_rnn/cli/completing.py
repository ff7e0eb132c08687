"""What a shell offers when a name is begun."""

from __future__ import annotations

from ..campaigns import shipped_campaigns
from ..experiment import shipped_experiments
from ..laws import LAWS
from ..paths import PATHS
from ..robot.load_arm import shipped_arms
from ..systems import BODIES


def complete_experiments(incomplete: str) -> list[str]:
    """Return the shipped experiments that begin so."""
    return [name for name in shipped_experiments() if name.startswith(incomplete)]


def complete_arms(incomplete: str) -> list[str]:
    """Return the shipped arms that begin so."""
    return [name for name in shipped_arms() if name.startswith(incomplete)]


def complete_laws(incomplete: str) -> list[str]:
    """Return the laws that begin so."""
    return [name for name in LAWS if name.startswith(incomplete)]


def complete_paths(incomplete: str) -> list[str]:
    """Return the paths that begin so."""
    return [name for name in PATHS if name.startswith(incomplete)]


def complete_levels(incomplete: str) -> list[str]:
    """Return the levels of detail that begin so."""
    return [name for name in BODIES if name.startswith(incomplete)]


def complete_campaigns(incomplete: str) -> list[str]:
    """Return the shipped campaigns that begin so."""
    return [name for name in shipped_campaigns() if name.startswith(incomplete)]
