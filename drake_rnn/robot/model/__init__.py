"""Model files of robots: what Drake cannot read of them is made readable."""

from .displaced import displaced, moving_joints
from .mimic import Mimic
from .model import Model, read_model

__all__ = ["Mimic", "Model", "displaced", "moving_joints", "read_model"]
