"""The bounds that a run is expected to keep, as levels of the curves that they judge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ..measures import METRICS, told
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.result import Result

_METRICS = {metric.name: metric for metric in METRICS}
#: Curves by the metrics that are taken from them, and what of the curve a metric is.
_JUDGED = {
    "position_error_max_m": ("position_error", "largest"),
    "position_error_rms_m": ("position_error", "root mean square"),
    "pixel_error_max_px": ("pixel_error", "largest"),
    "pixel_error_rms_px": ("pixel_error", "root mean square"),
    "lateral_error_max_m": ("position_error", "largest"),
    "orientation_error_max_rad": ("orientation_error", "largest"),
    "orientation_error_rms_rad": ("orientation_error", "root mean square"),
    "force_error_max_N": ("force_error", "largest"),
    "force_error_rms_N": ("force_error", "root mean square"),
    "normal_force_peak_N": ("force", "largest"),
    "joint_error_max_rad": ("joint_error", "at the end"),
    "distance_min_m": ("distance", "least"),
    "distance_moving_min_m": ("distance", "least while it moves"),
    "jacobian_error_median": ("jacobian_error", "median"),
    "jacobian_error_max": ("jacobian_error", "largest"),
    "singular_value_min": ("singular_value", "least"),
    "joint_limit_margin_min_rad": ("margin", "least"),
    "envelope_margin_min_rad_s": ("envelope_margin", "least"),
    **{
        f"limit_ratio_{order}_max": (f"{name}_ratio", "largest")
        for order, name in enumerate(DERIVATIVE_UNITS, start=1)
    },
}


@dataclass(frozen=True)
class AcceptedBound:
    """A bound of a metric, as a level of the curve that the metric is taken from.

    Attributes:
        key: Key of the curve.
        level: The bound, in the unit of the curve.
        text: What of the curve is bounded, and by how much.
        met: Whether the run keeps it.
        windowed: Whether it is of the experiment's window, otherwise of the whole run.
    """

    key: str
    level: float
    text: str
    met: bool
    windowed: bool

    def as_data(self) -> dict[str, Any]:
        """Return the bound as the page reads it."""
        return {
            "level": self.level,
            "text": self.text,
            "met": self.met,
            "windowed": self.windowed,
        }


def accepted_bounds(result: Result) -> Iterator[AcceptedBound]:
    """Yield the bounds that a run is expected to keep, of metrics that a curve shows."""
    for verdict in result.verdicts:
        if verdict.metric not in _JUDGED:
            continue
        key, what = _JUDGED[verdict.metric]
        metric, bound = _METRICS[verdict.metric], verdict.bound
        for sign, level in (("≥", bound.at_least), ("≤", bound.at_most)):
            if level is not None:
                text = f"{what} {sign} {told(level, metric.unit)}"
                yield AcceptedBound(key, level, text, verdict.met, metric.over == "window")
