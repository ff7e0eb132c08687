"""Units and shapes of the series of a run."""

from __future__ import annotations

#: Units of the series, by name; a series that is not listed has none.
UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "position_measured": "rad",
    "velocity_measured": "rad/s",
    "p_WE_measured": "m",
    "v_WE_measured": "m/s",
    "acceleration": "rad/s^2",
    "acceleration_peak": "rad/s^2",
    "network_velocity": "rad/s",
    "network_acceleration": "rad/s^2",
    "network_acceleration_peak": "rad/s^2",
    "p_WE": "m",
    "v_WE": "m/s",
    "p_WE_desired": "m",
    "v_WE_desired": "m/s",
    "J": "m",
    "J_hat": "m",
    "joint_error": "rad",
    "distance": "m",
    "orientation_error": "rad",
    "displacement": "m",
    "velocity_lower": "rad/s",
    "velocity_upper": "rad/s",
    "acceleration_demand": "rad/s^2",
    "velocity_error_predicted": "m/s",
    "pixels": "px",
    "pixels_desired": "px",
    "pixels_measured": "px",
    "torque": "N m",
    "normal_force": "N",
    "normal_force_desired": "N",
    "normal_force_measured": "N",
    "contact_force": "N",
}

#: Series that every run has; a motion has fields of these names.
OF_EVERY_RUN = (
    *("position", "velocity", "network_velocity"),
    *("p_WE", "v_WE", "p_WE_desired", "v_WE_desired", "J"),
)
_JOINTS = ("n",)
#: Shapes of the series at one time, by name: n is the number of joints; other lengths are the same
#: wherever the same name stands. A series that is not listed may have any shape.
SHAPES: dict[str, tuple[str, ...]] = {
    "position": _JOINTS,
    "velocity": _JOINTS,
    "position_measured": _JOINTS,
    "velocity_measured": _JOINTS,
    "acceleration": _JOINTS,
    "acceleration_peak": (),
    "network_velocity": _JOINTS,
    "network_acceleration": _JOINTS,
    "network_acceleration_peak": (),
    "velocity_lower": _JOINTS,
    "velocity_upper": _JOINTS,
    "acceleration_demand": _JOINTS,
    "torque": _JOINTS,
    "joint_error": _JOINTS,
    "p_WE": ("axes",),
    "p_WE_desired": ("axes",),
    "v_WE": ("axes",),
    "v_WE_desired": ("axes",),
    "J": ("rows", "n"),
    "J_hat": ("rows", "n"),
    "pixels": ("pixels",),
    "pixels_desired": ("pixels",),
    "pixels_measured": ("pixels",),
    "distance": (),
    "orientation_error": (),
    "normal_force": (),
    "normal_force_desired": (),
    "normal_force_measured": (),
    "contact_force": ("xyz",),
}
