"""Units of the series of a run."""

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
    "torque": "N m",
    "normal_force": "N",
    "normal_force_desired": "N",
    "normal_force_measured": "N",
    "contact_force": "N",
}
