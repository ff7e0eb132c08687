"""The chart of a page: curves, joints and acceptance bounds.

- The curves that a page shows beside the motion: one for each quantity that the run recorded.
- The joints of a motion, as a page lists them: positions, velocities and their limits.
- The bounds that a run is expected to keep, as levels of the curves that they judge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..experiment import torque_share_bound
from ..inputs.fields import Array
from ..measures import METRICS, format_quantity
from ..measures.metric import RATIO_METRICS
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.limit_use import derivatives_of_motion
from ..runs.result import Result
from ..shield.report import WANTED
from ..signals import TASK_MEASURES, TRACKING
from .replay import ReplayedMotion, pack

#: Number of samples up to which a page holds all of them; of more, it holds the least and the
#: largest of each of so many intervals, and the samples at the frames.
MOST, _INTERVALS = 6000, 2000
# Bounds that differ by less are the same for all joints.
_ALIKE = 1e-9

Scale = Literal["log", "linear"]


@dataclass(frozen=True)
class Curve:
    """A quantity over the time of a run.

    Attributes:
        key: Name in the page.
        name: Name that the page shows.
        unit: SI unit; "1" for a ratio.
        time: Shape (k,) [s], since the first sample.
        values: Shape (k,).
        scale: Axis that suits it.
        desired: Desired values, shape (k,); None if they are zero, or there are none.
        bound: Upper bound of the values, or their lower bound if ``above``; None if there is none.
        above: Whether the values must stay above the bound.
    """

    key: str
    name: str
    unit: str
    time: Array
    values: Array
    scale: Scale = "linear"
    desired: Array | None = None
    bound: float | None = None
    above: bool = False

    def as_data(self, frames: Array) -> dict[str, Any]:
        """Return the curve as the page reads it; ``frames`` are their times, shape (f,) [s]."""
        data: dict[str, Any] = {"key": self.key, "name": self.name, "unit": self.unit}
        data |= {"scale": self.scale, "bound": self.bound, "above": self.above}
        whole = self.values.size <= MOST
        at = slice(None) if whole else nearest(self.time, frames)
        data |= {"time": pack(self.time[at]), "values": pack(self.values[at])}
        if self.desired is not None:
            data["desired"] = pack(self.desired[at])
        if not whole:
            time, low, high = thin(self.time, self.values)
            data |= {"begins": pack(time), "low": pack(low), "high": pack(high)}
        return data


def nearest(time: Array, target: Array) -> Any:
    """Return the index of the sample nearest to each wanted time."""
    after = np.clip(np.searchsorted(time, target), 1, max(1, time.size - 1))
    before = after - 1
    after = np.minimum(after, time.size - 1)
    return np.where(target - time[before] <= time[after] - target, before, after)


def thin(time: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return the beginning, the least and the largest value of each interval, shape (i,) each."""
    edges = np.linspace(0, time.size, _INTERVALS + 1).astype(int)[:-1]
    low, high = np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
    return time[edges], low, high


def curves_of(motion: ReplayedMotion) -> list[Curve]:
    """Return the curves of a run, the most informative one first."""
    groups = (
        _forces,
        _target,
        _image,
        _errors,
        _objectives,
        _distance,
        _jacobian,
        _ratios,
        _envelope,
        _torque,
        _margins,
    )
    return [curve for group in groups for curve in group(motion) if _is_telling(curve)]


def _is_telling(curve: Curve) -> bool:
    """Return whether a curve has finite values, and not zeros alone."""
    finite = curve.values[np.isfinite(curve.values)]
    return bool(finite.size) and bool(np.any(finite != 0.0))


def _forces(motion: ReplayedMotion) -> Iterator[Curve]:
    if (series := _series(motion, "normal_force", "normal_force_desired")) is not None:
        force, force_desired = series
        yield Curve("force", "contact force", "N", motion.time, force, desired=force_desired)
        error = np.abs(force - force_desired)
        yield Curve("force_error", "force error", "N", motion.time, error, "log")
    if (offset := _series(motion, "admittance_offset")) is not None:
        yield Curve("admittance", "path given way", "m", motion.time, offset[0])


def _target(motion: ReplayedMotion) -> Iterator[Curve]:
    if (wanted := _series(motion, WANTED)) is not None:
        away = np.abs(wanted[0] - motion.position).max(axis=1)
        yield Curve("wanted_error", "from where the source wants it", "rad", motion.time, away)
        return
    if (series := _series(motion, "joint_error")) is not None:
        farthest = np.abs(series[0]).max(axis=1)
        streams = motion.result.experiment.targets is not None
        name = "to the newest target" if streams else "to the target posture"
        yield Curve("joint_error", name, "rad", motion.time, farthest, "log")


def _image(motion: ReplayedMotion) -> Iterator[Curve]:
    if _series(motion, "pixels", "pixels_desired") is not None:
        error = motion.result.pixel_error[: len(motion.time)]
        yield Curve("pixel_error", "error in the image", "px", motion.time, error, "log")


def _errors(motion: ReplayedMotion) -> Iterator[Curve]:
    if _series(motion, *TRACKING) is not None:
        error = motion.result.position_error[: len(motion.time)]
        presses = motion.result.experiment.contact is not None
        name = "error along the surface" if presses else "position error"
        if motion.result.experiment.document.camera is not None:
            name = "position error, not controlled"
        yield Curve("position_error", name, "m", motion.time, error, "log")
    if (rotation_error := _series(motion, "orientation_error")) is not None:
        name = "orientation error"
        yield Curve("orientation_error", name, "rad", motion.time, rotation_error[0], "log")


def _objectives(motion: ReplayedMotion) -> Iterator[Curve]:
    for measure in TASK_MEASURES:
        if (values := _series(motion, measure.name)) is not None:
            scale: Scale = "log" if measure.kind == "error" else "linear"
            yield Curve(measure.name, measure.text, measure.unit, motion.time, values[0], scale)


def _distance(motion: ReplayedMotion) -> Iterator[Curve]:
    if (series := _series(motion, "distance")) is not None:
        yield Curve("distance", "least distance", "m", motion.time, series[0])
    if (series := _series(motion, "arms_distance")) is not None:
        yield Curve("arms_distance", "distance of the arms", "m", motion.time, series[0])


def _jacobian(motion: ReplayedMotion) -> Iterator[Curve]:
    if (J_learned := _series(motion, "J", "J_hat")) is not None:
        size = np.sqrt(np.square(J_learned[0] - J_learned[1]).sum(axis=(1, 2)))
        yield Curve("jacobian_error", "error of Ĵ", "m", motion.time, size, "log")
    elif (J := _series(motion, "J")) is not None and np.isfinite(J[0]).all():
        smallest = np.asarray(np.linalg.svd(J[0], compute_uv=False)[:, -1], dtype=float)
        yield Curve("singular_value", "least singular value of J", "m", motion.time, smallest)


def _ratios(motion: ReplayedMotion) -> Iterator[Curve]:
    """Yield how much of its bound each derivative of the joint positions uses, worst joint."""
    for name in DERIVATIVE_UNITS:
        bound = motion.result.experiment.limits.bounds[name]
        if bound is None or not np.isfinite(bound).any():
            continue
        time, worst = _magnitudes(motion, name)
        if worst.size:
            yield Curve(f"{name}_ratio", f"{name} / bound", "1", time, worst, bound=1.0)


def _magnitudes(motion: ReplayedMotion, name: str) -> tuple[Array, Array]:
    """Return times and the largest ratio of a derivative to its bound, shape (k,) each."""
    limits, series = motion.result.experiment.limits, _series(motion, name)
    time, values = _differences(motion, name) if series is None else (motion.time, series[0])
    peak, sides = _series(motion, f"{name}_peak"), limits.sides(name)
    ends = np.concatenate(sides)
    if series is not None and peak is not None and np.ptp(ends) <= _ALIKE * ends.max():
        # The largest of all steps since the sample before.
        return time, peak[0] / sides.up[0]
    return time, np.abs(values / sides.toward(values > 0.0)).max(axis=1, initial=0.0)


def _differences(motion: ReplayedMotion, name: str) -> tuple[Array, Array]:
    """Return a derivative by differences over some 10 ms, as metrics take it, while it is shown.

    Returns:
        Times, shape (k,) [s], in the middle of what the differences span, and shape (k, n).
    """
    order, times = 1 + list(DERIVATIVE_UNITS).index(name), motion.result.time
    time, values = derivatives_of_motion(motion.result)[order]
    is_recorded = time <= times[len(motion.time) - 1]
    return time[is_recorded] - times[0], values[is_recorded]


def _torque(motion: ReplayedMotion) -> Iterator[Curve]:
    experiment = motion.result.experiment
    series, effort = _series(motion, "torque"), experiment.arm.effort
    if series is not None and np.isfinite(effort).any():
        worst, kept = np.abs(series[0] / effort).max(axis=1), torque_share_bound(experiment)
        bound = 1.0 if kept is None else kept
        yield Curve("torque_ratio", "torque / limit", "1", motion.time, worst, bound=bound)
    elif series is not None:
        largest = np.abs(series[0]).max(axis=1)
        yield Curve("torque", "largest torque", "N m", motion.time, largest)


def _margins(motion: ReplayedMotion) -> Iterator[Curve]:
    limits, q = motion.result.experiment.limits, motion.position
    margin = np.minimum(q - limits.position_lower, limits.position_upper - q).min(axis=1)
    label = "to nearest joint limit"
    yield Curve("margin", label, "rad", motion.time, margin, bound=0.0, above=True)


def _envelope(motion: ReplayedMotion) -> Iterator[Curve]:
    """Yield how much faster the joint that is nearest to the envelope of its velocity might be."""
    limits, series = motion.result.experiment.limits, _series(motion, "velocity")
    if limits.envelope is None or series is None:
        return
    (v,), position = series, (limits.position_lower, limits.position_upper)
    lowest, highest = limits.envelope.velocities(motion.position, position)
    margin = np.minimum(v - lowest, highest - v).min(axis=1)
    label = "to the envelope of the velocity"
    yield Curve("envelope_margin", label, "rad/s", motion.time, margin, bound=0.0, above=True)


def _series(motion: ReplayedMotion, *names: str) -> list[Array] | None:
    """Return series up to the last posture that is shown; None unless the run has them all."""
    series: dict[str, Array] = motion.result.series
    if not set(names) <= series.keys():
        return None
    return [series[name][: len(motion.time)] for name in names]


def joints_of(motion: ReplayedMotion, frames: Array) -> dict[str, Any]:
    """Return the joints as the page reads them.

    Args:
        motion: The motion.
        frames: Times of the frames, shape (f,) [s]; of a long run, the samples there are held.
    """
    experiment, time = motion.result.experiment, motion.time
    limits, arm = experiment.limits, experiment.arm
    at = slice(None) if time.size <= MOST else nearest(time, frames)
    speeds = limits.sides("velocity")
    velocity = motion.result.series.get("velocity")
    return {
        "names": list(arm.joints),
        "units": list(arm.units),
        "lower": pack(limits.position_lower),
        "upper": pack(limits.position_upper),
        "speeds": pack(speeds.up),
        "speedsBack": pack(speeds.down),
        "time": pack(time[at]),
        "position": pack(motion.position[at]),
        "velocity": "" if velocity is None else pack(velocity[: time.size][at]),
    }


#: Images of a camera for each second of a run.
_IMAGES = 25.0


def image_of(motion: ReplayedMotion, frames: Array) -> dict[str, Any] | None:
    """Return what a camera sees of the tool as the page reads it; None without a camera.

    Args:
        motion: The motion.
        frames: Times of the frames, shape (f,) [s].
    """
    camera = motion.result.experiment.document.camera
    if camera is None or (series := _series(motion, "pixels", "pixels_desired")) is None:
        return None
    at = nearest(motion.time, np.arange(0.0, frames[-1] + 1.0 / _IMAGES, 1.0 / _IMAGES))
    widths, heights = zip(*(each.image_size for each in camera.cameras), strict=True)
    return {
        "size": [max(widths), max(heights)],
        "points": len(camera.points),
        "time": pack(motion.time[at]),
        "seen": pack(series[0][at]),
        "desired": pack(series[1][at]),
    }


_METRICS = METRICS.by_name
#: Curves by the metrics that are taken from them, and what of the curve a metric is.
_METRIC_CURVES = {
    "position_error_max_m": ("position_error", "largest"),
    "position_error_rms_m": ("position_error", "root mean square"),
    "pixel_error_max_px": ("pixel_error", "largest"),
    "pixel_error_rms_px": ("pixel_error", "root mean square"),
    "lateral_error_max_m": ("position_error", "largest"),
    "orientation_error_max_rad": ("orientation_error", "largest"),
    "orientation_error_rms_rad": ("orientation_error", "root mean square"),
    **{
        metric: (measure.name, what)
        for measure in TASK_MEASURES
        for metric, what in measure.metrics.items()
    },
    "force_error_max_N": ("force_error", "largest"),
    "force_error_rms_N": ("force_error", "root mean square"),
    "normal_force_peak_N": ("force", "largest"),
    "joint_error_max_rad": ("joint_error", "at the end"),
    "distance_min_m": ("distance", "least"),
    "distance_moving_min_m": ("distance", "least while it moves"),
    "arms_distance_min_m": ("arms_distance", "least"),
    "jacobian_error_median": ("jacobian_error", "median"),
    "jacobian_error_max": ("jacobian_error", "largest"),
    "singular_value_min": ("singular_value", "least"),
    "joint_limit_margin_min_rad": ("margin", "least"),
    "envelope_margin_min_rad_s": ("envelope_margin", "least"),
    **{metric: (f"{name}_ratio", "largest") for name, metric in RATIO_METRICS.items()},
}


@dataclass(frozen=True)
class AcceptedBound:
    """A bound of a metric, as a level of the curve that the metric is taken from.

    Attributes:
        key: Key of the curve.
        level: The bound, in the unit of the curve.
        text: What of the curve is bounded, and by how much.
        met: Whether the run keeps it.
        judged: Whether the run came to its end.
        windowed: Whether it is of the experiment's window, otherwise of the whole run.
    """

    key: str
    level: float
    text: str
    met: bool
    judged: bool
    windowed: bool

    def as_data(self) -> dict[str, Any]:
        """Return the bound as the page reads it."""
        return {
            "level": self.level,
            "text": self.text,
            "met": self.met,
            "judged": self.judged,
            "windowed": self.windowed,
        }


def accepted_bounds(result: Result) -> Iterator[AcceptedBound]:
    """Yield the bounds that a run is expected to keep, of metrics that a curve shows."""
    for verdict in result.verdicts:
        if verdict.metric not in _METRIC_CURVES:
            continue
        key, what = _METRIC_CURVES[verdict.metric]
        metric, bound = _METRICS[verdict.metric], verdict.bound
        for sign, level in (("≥", bound.at_least), ("≤", bound.at_most)):
            if level is not None:
                text = f"{what} {sign} {format_quantity(level, metric.unit)}"
                marks = verdict.met, verdict.judged, metric.over == "window"
                yield AcceptedBound(key, level, text, *marks)
