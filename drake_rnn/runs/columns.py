"""The series of a run as columns: one for each number, named with its part and its unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..inputs.extras import needed
from ..inputs.fields import Array
from ..measures import UNITS
from ..robot.arm import Arm

#: Name of the column of times.
TIME = "time_s"
# Units whose series have a number for each joint.
_OF_JOINTS = ("rad", "rad/s", "rad/s^2", "N m")
_AXES = ("x", "y", "z")


def columns_of(
    time: Array, series: Mapping[str, Array], arm: Arm, names: Iterable[str] | None = None
) -> dict[str, Array]:
    """Return series as columns: their name, the joint, axis or indices from 1, and the unit.

    ``position`` of a Panda becomes ``position_panda_joint1_rad`` to ``position_panda_joint7_rad``,
    ``p_WE`` becomes ``p_WE_x_m`` and two more, and entry (1, 2) of ``J`` is ``J_1_2_m``. Units are
    written as those of metrics: ``rad_s2`` is rad/s^2.

    Args:
        time: Times, shape (k,) [s].
        series: Arrays of k rows, by name.
        arm: The arm that they are of.
        names: The series; all of them if None.

    Returns:
        Arrays of shape (k,) by name, the times first.

    Raises:
        InvalidInputError: If there is no series of that name.
    """
    found = {TIME: time}
    for name in require_series(series, names):
        values, unit = series[name], UNITS.get(name, "")
        shape = values.shape[1:]
        units = [unit] * int(np.prod(shape))
        parts = _parts(shape, unit, arm.joints)
        if parts is arm.joints:
            # A joint that slides has metres for radians.
            units = [unit.replace("rad", own) for own in arm.units]
        columns = values.reshape(len(values), int(np.prod(shape))).T
        for part, own, column in zip(parts, units, columns, strict=True):
            found["_".join(filter(None, (name, part, _spelt(own))))] = column
    return found


def require_series(series: Mapping[str, Array], names: Iterable[str] | None) -> list[str]:
    """Return the names of series that are asked for; of all of them if that is None.

    Raises:
        InvalidInputError: If there is no series of that name.
    """
    chosen = list(series) if names is None else list(names)
    for name in chosen:
        if name not in series:
            hint = nearest(name, list(series))
            raise InvalidInputError(f"series: no {name!r} in this result; {hint}")
    return chosen


def frame_of(columns: Mapping[str, Array]) -> Any:
    """Return columns as a pandas frame, with the times as its index.

    Raises:
        InvalidInputError: If pandas is not installed.
    """
    (pandas,) = needed("frame", "pandas", "pandas")
    return pandas.DataFrame(dict(columns)).set_index(TIME)


def _parts(shape: tuple[int, ...], unit: str, joints: Sequence[str]) -> Sequence[str]:
    """Return the names of a series' parts."""
    if not shape:
        return ("",)
    if shape == (len(joints),) and unit in _OF_JOINTS:
        return joints
    if shape == (len(_AXES),) and unit:
        return _AXES
    indices = product(*(range(1, size + 1) for size in shape))
    return tuple("_".join(map(str, each)) for each in indices)


def _spelt(unit: str) -> str:
    return unit.replace("/", "_").replace("^", "").replace(" ", "")
