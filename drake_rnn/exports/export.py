"""Results written in the formats of other tools, by the name of the format."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from ..errors import InvalidInputError
from ..inputs.arguments import checked, choice, each, instance, optional
from ..inputs.complaints import nearest
from ..runs.folder import require_output
from ..runs.result import Result
from ..runs.whole_file import replacing
from .recording import write_mcap
from .tables import write_csv, write_parquet
from .trajectory import write_trajectory

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
        form: ``csv`` and ``parquet`` are tables of `drake_rnn.runs.columns`; ``mcap`` is a
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
