"""Filters between the laws and the arms of many robots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..experiment import Experiment
from ..features.filter import Averages, averaging_windows
from ..inputs.fields import Array


class Filters:
    """Moving averages of the velocities that move the arms.

    Args:
        experiments: The robots' experiments, all with the same windows.

    Attributes:
        apart: Whether the laws see virtual arms, ahead of the filter, in place of their own.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        first = experiments[0]
        assert first.document.filter is not None
        self.apart = first.feedback == "unfiltered"
        velocity = [each.limits.require("velocity", "filter") for each in experiments]
        self._averages = Averages(
            _windows(first),
            np.stack(velocity, axis=-1),
            precompensate=first.document.filter.precompensate,
        )

    def started(self) -> Array:
        """Return states at rest, shape (size, robots)."""
        return np.zeros(self._averages.shape)

    def velocity(self, states: Array) -> Array:
        """Return the filtered velocities, shape (robots, n) [rad/s]."""
        return self._averages.mean(states).T

    def add(self, states: Array, velocity: Array) -> None:
        """Add velocities, shape (robots, n) [rad/s], to the states, in place."""
        self._averages.add(states, velocity.T)


def alike(experiment: Experiment) -> object:
    """Return what robots side by side have in common of their filters."""
    settings = experiment.document.filter
    if settings is None:
        return None
    windows = _windows(experiment)
    return (
        experiment.feedback,
        settings.precompensate,
        settings.delay_desired,
        windows.shape,
        windows.tobytes(),
    )


def _windows(experiment: Experiment) -> np.ndarray:
    settings, period = experiment.document.filter, experiment.document.period
    assert settings is not None
    assert period is not None
    return averaging_windows(experiment.limits, period, settings.above)
