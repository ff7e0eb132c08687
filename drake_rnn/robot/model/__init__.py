"""Model files of robots: what Drake cannot read of them is made readable."""

from .mimic import Mimic
from .model import Model, read_model

__all__ = ["Mimic", "Model", "read_model"]
