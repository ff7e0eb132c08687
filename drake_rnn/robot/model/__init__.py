"""Model files of robots: what Drake cannot read of them is made readable."""

from .model import (
    displace_joints as displace_joints,
    moving_joints as moving_joints,
)
from .meshes import LostMesh as LostMesh
from .formats import Mimic as Mimic
from .model import Model as Model, read_model as read_model, read_shapes as read_shapes
