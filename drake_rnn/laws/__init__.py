"""Neural dynamics, one scheme a file: arrays in, arrays out, no Drake."""

from .law import ContinuousLaw, Law, Layout, Signals
from .simultaneous_learning import SimultaneousLearning

#: The laws an experiment may name, by their ``kind``.
LAWS: dict[str, type[Law]] = {"simultaneous_learning": SimultaneousLearning}

__all__ = ["LAWS", "ContinuousLaw", "Law", "Layout", "Signals", "SimultaneousLearning"]
