"""Numbers of a run that a film shows beside its time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..inputs.fields import Array
from ..measures import told
from ..runs.result import Result


@dataclass(frozen=True)
class Numbers:
    """Numbers over time, as they are written.

    Attributes:
        time: Times of the samples, shape (k,) [s].
        written: Each number at each of them, as text.
    """

    time: Array
    written: list[list[str]]

    def at(self, time: float) -> list[str]:
        """Return the numbers of the last sample that is not later than ``time`` [s]."""
        sample = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return [each[max(sample, 0)] for each in self.written]

    @property
    def widest(self) -> list[str]:
        """The longest text of each number."""
        return [max(each, key=len) for each in self.written]


def live_numbers(result: Result) -> Numbers:
    """Return the numbers that a film shows: force, errors of Jacobian, joints, tool."""
    written = []
    series = result.series
    if result.experiment.contact is not None:
        written.append([f"{force:.2f} N" for force in series["normal_force"]])
    if "J_hat" in series and series["J_hat"].shape == series["J"].shape:
        off = np.linalg.norm(series["J_hat"] - series["J"], axis=(1, 2))
        share = 100.0 * off / np.linalg.norm(series["J"], axis=(1, 2))
        written.append([f"Jacobian off by {each:.0f} %" for each in share])
    if "joint_error" in series:
        written.append([f"{each:.2f} rad to go" for each in np.abs(series["joint_error"]).max(1)])
    if "pixels" in series:
        written.append([f"error {told(float(each), 'px', 2)}" for each in result.pixel_error])
    else:
        written.append([f"error {told(float(each), 'm', 2)}" for each in result.position_error])
    return Numbers(result.time - result.time[0], written)
