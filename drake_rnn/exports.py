"""Results in the formats of other tools, by the name of the format.

``mcap`` is a recording of ROS 2 messages, as Foxglove and PlotJuggler open it:

==================  ==========================  ==============================================
topic               message                     series
==================  ==========================  ==============================================
``/joint_states``   sensor_msgs/JointState      position, velocity, torque
``/end_effector``   geometry_msgs/PointStamped  p_WE
``/target``         geometry_msgs/PointStamped  the desired position
``/series/NAME``    std_msgs/Float64MultiArray  each other one, row by row
==================  ==========================  ==============================================

Times are those of the run: it begins at 0.

``csv`` and ``parquet`` are tables of series; numbers of CSV are read back to the last bit.

``trajectory`` is the motion of the joints as a trajectory_msgs/JointTrajectory, in YAML. It is sent
to a controller by
``ros2 topic pub --once TOPIC trajectory_msgs/msg/JointTrajectory "$(cat trajectory.yaml)"``.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from .errors import InvalidInputError
from .inputs.documents import to_yaml
from .inputs.fields import Array, checked, choice, each, instance, optional
from .inputs.messages import nearest
from .inputs.packages import import_extra
from .runs.folder import replacing, require_output
from .runs.result import Result
from .runs.series import require_series
from .signals import TRACKING

# What was a module in this one until 0.3 is found under its name, see `moved_modules`.
__path__: list[str] = []


def nanoseconds(time: float) -> int:
    """Return a time [s] in nanoseconds, rounded."""
    return round(time * 1e9)


def stamp(time: float, fraction: str) -> dict[str, int]:
    """Return a time [s] as a message, whose fraction has that name."""
    seconds, rest = divmod(nanoseconds(time), 1_000_000_000)
    return {"sec": seconds, fraction: rest}


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
    names = require_series(result.series, series)
    (module,) = import_extra("mcap", "mcap", "mcap_ros2.writer")
    topics = list(_topics(result, names))
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
    series_names = {*_JOINTS.values()}
    for topic, name in _POINTS.items():
        if name not in series or name not in chosen:
            continue
        series_names.add(name)

        def point(k: int, p: Array = series[name]) -> Message:
            x, y, z = p[k].tolist()
            return {"header": header(k), "point": {"x": x, "y": y, "z": z}}

        yield _Topic(topic, "geometry_msgs/msg/PointStamped", point)
    for name in chosen:
        if name not in series_names:
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


def write_csv(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write columns as CSV, with the shortest decimals that tell each number."""
    columns = result.columns(series)
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(np.column_stack(list(columns.values())).tolist())


def write_parquet(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write columns as Parquet; the document of the run is among the file's own data."""
    columns = result.columns(series)
    pyarrow, parquet = import_extra("parquet", "parquet", "pyarrow", "pyarrow.parquet")
    metadata = {"experiment": result.experiment.document.to_yaml()}
    table = pyarrow.table({name: np.ascontiguousarray(x) for name, x in columns.items()})
    parquet.write_table(table.replace_schema_metadata(metadata), file)


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


#: Names of the formats.
Format = Literal["csv", "parquet", "mcap", "trajectory"]
FORMATS: tuple[Format, ...] = get_args(Format)


class _Writer(NamedTuple):
    """What writes a format: to which file of a result's folder by default, and how."""

    file: str
    write: Callable[[Result, Path, Iterable[str] | None], None]


_WRITERS = {
    "csv": _Writer("series.csv", write_csv),
    "parquet": _Writer("series.parquet", write_parquet),
    "mcap": _Writer("series.mcap", write_mcap),
    "trajectory": _Writer("trajectory.yaml", write_trajectory),
}


@checked(
    result=instance(Result),
    place=instance(str, Path),
    form=choice(get_args(Format)),
    series=optional(each(str)),
)
def export(
    result: Result,
    place: str | Path,
    form: Format = "csv",
    series: Iterable[str] | None = None,
) -> Path:
    """Write the series of a result for other tools.

    Args:
        result: The result.
        place: File, or a folder that exists, in which the file is named after the format.
        form: ``csv`` and ``parquet`` are tables of `drake_rnn.runs.series`; ``mcap`` is a
            recording of ROS 2 messages; ``trajectory`` is the motion of the joints as a message of
            the type ``trajectory_msgs/JointTrajectory`` in YAML.
        series: Names of the series; all of them if None.

    Returns:
        The file; another one of that name is replaced at once, by the whole of the new one.

    Raises:
        InvalidInputError: If there is no such format or series, a format has no place for what is
            asked, the package that writes it is not installed, or the file is a link, a pipe, a
            device or one that a run has written itself.
        OSError: If it cannot be written.
    """
    file = exported_file(place, form)
    with replacing(file) as new:
        _WRITERS[form].write(result, new, series)
    return file


def exported_file(place: str | Path, form: Format) -> Path:
    """Return the file that `export` writes; place, form and errors are those of `export`."""
    if form not in FORMATS:
        raise InvalidInputError(f"form: no format {form!r}; {nearest(form, list(FORMATS))}")
    writer, file = _WRITERS[form], Path(place)
    if file.is_dir():
        file = file / writer.file
    for other, one in _WRITERS.items():
        if file.suffix == Path(one.file).suffix and one is not writer:
            raise InvalidInputError(f"form: {file.name} is named as {other}, not as {form}")
    require_output(file, "place")
    return file
