"""Robots behind messages: what drives them, what stops them, and one to try it on."""

from ..inputs.packages import lent_names

_OLD_NAMES = {
    "Driven": "drive.session:DriveOutcome",
    "Paced": "drive.driving:PacedConnection",
    "connected": "drive.iiwa_lcm:open_lcm",
}

__all__, __getattr__, __dir__ = lent_names(__name__, __file__, _OLD_NAMES)
