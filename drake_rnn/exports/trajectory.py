"""The motion of the joints as a ROS 2 message, trajectory_msgs/JointTrajectory, in YAML.

It is sent to a controller by
``ros2 topic pub --once TOPIC trajectory_msgs/msg/JointTrajectory "$(cat trajectory.yaml)"``.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import InvalidInputError
from ..inputs.documents import to_yaml
from ..runs.result import Result
from .stamps import stamp

# Series of a run, by what they are in a point of the message.
_PARTS = {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}


def write_trajectory(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write positions, velocities and accelerations of all joints, from rest at time 0."""
    if series is not None:
        raise InvalidInputError("series: trajectory has the motion of the joints; leave them out")
    file.write_text(to_yaml(trajectory_message(result)), encoding="utf-8")


def trajectory_message(result: Result) -> dict[str, Any]:
    """Return the message as nested dictionaries, by the names of its fields."""
    begin = float(result.time[0]) if result.time.size else 0.0
    points = []
    for k, time in enumerate(result.time):
        parts = {
            part: result.series[name][k].tolist()
            for part, name in _PARTS.items()
            if name in result.series
        }
        points.append({**parts, "time_from_start": stamp(float(time) - begin, "nanosec")})
    return {"joint_names": list(result.experiment.arm.joints), "points": points}
