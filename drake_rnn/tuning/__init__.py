"""Gains of a law tuned by descent along derivatives through the closed loop."""

from .choosing import Trial as Trial
from .tuned import Tuned as Tuned, Tuning as Tuning, tune as tune
