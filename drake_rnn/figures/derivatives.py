"""The figures of experiments that bound derivatives of the motion beyond the acceleration."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..robot.limits import DERIVATIVE_UNITS
from ..runs.derivatives import derivatives_of_motion
from ..runs.result import Result
from .derivative_panels import stacked_panels
from .registry import draws
from .traits import bounds_jerk, shows_signals


@draws("position", "velocity", applies=bounds_jerk)
def derivatives(result: Result) -> Figure:
    """Draw angle to crackle of the arm's motion, with bounds.

    The ratio to a bound is taken from the metrics: for the acceleration, it is that of single
    steps and not of 10 ms.
    """
    ratios = {
        order: result.metrics[name]
        for order in range(1, len(DERIVATIVE_UNITS) + 1)
        if (name := f"limit_ratio_{order}_max") in result.metrics
    }
    texts = ["angle", *DERIVATIVE_UNITS]
    return stacked_panels(result, derivatives_of_motion(result), texts, ratios)


@draws("position", "velocity", "levels", applies=lambda r: bounds_jerk(r) and shows_signals(r))
def displayed_signals(result: Result) -> Figure:
    """Draw the signals of the law's filters that stand for derivatives, with the same bounds.

    They are not the derivatives of the motion; `derivatives` shows those.
    """
    v = result.series.get("network_velocity", result.series["velocity"])
    levels = result.series["levels"]
    signals = [result.series["position"], v, *(levels[:, k] for k in range(levels.shape[1]))]
    names = [f"signal {order}" for order in range(2, len(signals))]
    return stacked_panels(
        result, [(result.time, values) for values in signals], ["angle", "velocity", *names]
    )
