"""Distances of an arm from itself and from obstacles, in arrays."""

from .clearance import Clearance as Clearance, Near as Near
from .clearance import (
    Flags as Flags,
    Indices as Indices,
)
