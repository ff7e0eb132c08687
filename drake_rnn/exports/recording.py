"""A run as a recording of ROS 2 messages, an MCAP file as Foxglove and PlotJuggler open it.

==================  ==========================  ==============================================
topic               message                     series
==================  ==========================  ==============================================
``/joint_states``   sensor_msgs/JointState      position, velocity, torque
``/end_effector``   geometry_msgs/PointStamped  p_WE
``/target``         geometry_msgs/PointStamped  the desired position
``/series/NAME``    std_msgs/Float64MultiArray  each other one, row by row
==================  ==========================  ==============================================

Times are those of the run: it begins at 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ..inputs.extras import needed
from ..inputs.fields import Array
from ..runs.columns import require_series
from ..runs.result import Result
from ..signals import TRACKING
from .stamps import nanoseconds, stamp

#: A message by the names of its fields.
Message = dict[str, Any]

_FRAME = "world"
_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
_HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
_POINT = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z"
_LAYOUT = "MSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset"
_DIMENSION = "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride"
# Definitions of messages, each followed by those that it names.
_DEFINITIONS = {
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort",
        _HEADER,
        _TIME,
    ),
    "geometry_msgs/msg/PointStamped": (
        "std_msgs/Header header\ngeometry_msgs/Point point",
        _HEADER,
        _TIME,
        _POINT,
    ),
    "std_msgs/msg/Float64MultiArray": (
        "MultiArrayLayout layout\nfloat64[] data",
        _LAYOUT,
        _DIMENSION,
    ),
}
_BETWEEN = "\n" + 80 * "=" + "\n"
# Series of the joints, by their field of a message.
_JOINTS = {"position": "position", "velocity": "velocity", "effort": "torque"}
_POINTS = dict(zip(("/end_effector", "/target"), TRACKING, strict=True))


class _Topic(NamedTuple):
    """A topic: its name, the type of its messages, and what makes that of a sample."""

    name: str
    kind: str
    message: Callable[[int], Message]


def write_mcap(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write the messages; of series that are asked for, if they are, and the joints' state."""
    chosen = require_series(result.series, series)
    (module,) = needed("mcap", "mcap", "mcap_ros2.writer")
    topics = list(_topics(result, chosen))
    with file.open("wb") as stream, module.Writer(stream) as writer:
        schemas = {
            kind: writer.register_msgdef(kind, _BETWEEN.join(texts))
            for kind, texts in _DEFINITIONS.items()
        }
        writer.add_metadata("drake_rnn", {"experiment": result.experiment.document.to_yaml()})
        for k, time in enumerate(result.time):
            for topic in topics:
                when = nanoseconds(float(time))
                writer.write_message(
                    topic.name, schemas[topic.kind], topic.message(k), when, when, k
                )


def _topics(result: Result, chosen: list[str]) -> Iterator[_Topic]:
    series, times = result.series, result.time
    names = list(result.experiment.arm.joints)

    def header(k: int) -> Message:
        return {"stamp": stamp(float(times[k]), "nanosec"), "frame_id": _FRAME}

    def state(k: int) -> Message:
        parts = {
            part: series[name][k].tolist() if name in series else []
            for part, name in _JOINTS.items()
        }
        return {"header": header(k), "name": names, **parts}

    yield _Topic("/joint_states", "sensor_msgs/msg/JointState", state)
    shown = {*_JOINTS.values()}
    for topic, name in _POINTS.items():
        if name not in series or name not in chosen:
            continue
        shown.add(name)

        def point(k: int, p: Array = series[name]) -> Message:
            x, y, z = p[k].tolist()
            return {"header": header(k), "point": {"x": x, "y": y, "z": z}}

        yield _Topic(topic, "geometry_msgs/msg/PointStamped", point)
    for name in chosen:
        if name not in shown:
            yield _Topic(
                f"/series/{name}", "std_msgs/msg/Float64MultiArray", _entries(series[name])
            )


def _entries(values: Array) -> Callable[[int], Message]:
    """Return what makes the message of a sample of a series."""
    dimensions: list[Message] = []
    stride = 1
    for axis, size in reversed(list(enumerate(values.shape[1:]))):
        stride *= size
        dimensions.insert(0, {"label": f"axis {axis + 1}", "size": size, "stride": stride})
    layout = {"dim": dimensions, "data_offset": 0}
    return lambda k: {"layout": layout, "data": values[k].ravel().tolist()}
