"""A motion through waypoints: positions and perhaps orientations, with times."""

# No postponed annotations: see `path`.
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator
from pydrake.math import RollPitchYaw

from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array, Positive, Speed, Time, Vector, rows_of_numbers, validated
from ..inputs.keys import Meaning
from .pieces import Blend, blended, cubic_spline, quintic_spline, rest_to_rest
from .table import QUATERNION, RPY, Table, listed, read_table
from .timed import TimedPath
from .turning import aligned

# Difference of a quaternion's length from 1 up to which it is taken for rounding.
_ROUNDING = 1e-3
# Largest sum of a leg's blends, relative to the leg.
_FULL = 1.0 + 1e-9
# Least time between two waypoints, and the latest time of one, as of a period [s].
_SOONEST, _LATEST = 1e-3, 1e6


def _rows(width: int, what: str) -> BeforeValidator:
    """Return a validator of lists of rows of this many finite numbers."""

    def rows(value: Any) -> Array:
        if (array := rows_of_numbers(value, width)) is None:
            raise ValueError(f"must be a list of rows of {width} finite numbers, {what}")
        return array

    return BeforeValidator(rows)


@validated
class Waypoints(TimedPath):
    """A motion through waypoints, from rest to rest, passed once."""

    kind: Literal["waypoints"] = "waypoints"
    summary = "A motion through waypoints, from rest to rest, passed once."
    file: Annotated[
        str | None,
        Meaning(
            "CSV file whose first line names its columns: x, y, z; t or time [s]; orientations "
            "as qw, qx, qy, qz, or as roll, pitch, yaw [rad]. Without that line it has three "
            "columns x, y, z. Give this or ``positions``.",
            unit="m",
        ),
    ] = None
    positions: Annotated[
        Annotated[Array, BeforeValidator(listed)] | None,
        Meaning("Rows x, y, z, shape (k, 3); at least 2.", unit="m"),
    ] = None
    times: Annotated[
        Vector | None,
        Meaning(
            "Times at which the waypoints are passed, increasing, shape (k,). Give this, "
            "``period`` or ``speed``, unless the file has times.",
            unit="s",
        ),
    ] = None
    period: Annotated[
        Time | None,
        Meaning("Duration [s], shared among the legs by their length.", unit="s"),
    ] = None
    speed: Annotated[Speed | None, Meaning("Mean speed along the legs.", unit="m/s")] = None
    quaternions: Annotated[
        Annotated[Array, _rows(4, "w, x, y, z")] | None,
        Meaning("Orientations as unit quaternions, rows w, x, y, z, shape (k, 4)."),
    ] = None
    rpy: Annotated[
        Annotated[Array, _rows(3, "roll, pitch, yaw")] | None,
        Meaning("Orientations as roll, pitch and yaw about fixed axes, shape (k, 3).", unit="rad"),
    ] = None
    through: Annotated[
        Literal["quintic", "cubic", "straight"],
        Meaning(
            "``quintic`` or ``cubic``: a smooth spline through all waypoints, which rests only "
            "at the ends; ``straight``: straight legs, which rest at each waypoint unless there "
            "are blends. See `pieces` for the formulas.",
        ),
    ] = "quintic"
    blend_time: Annotated[
        Positive | None,
        Meaning("Duration of the blend at each waypoint of straight legs.", unit="s"),
    ] = None
    blend_radius: Annotated[
        Positive | None,
        Meaning("Largest distance from a waypoint at which its blend may begin or end.", unit="m"),
    ] = None
    blend: Annotated[
        Blend | None,
        Meaning("Kind of the blends, ``quintic`` or ``parabolic``."),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.positions is None):
            raise ValueError("give either a file or positions")
        if self.quaternions is not None and self.rpy is not None:
            raise ValueError("give either quaternions or rpy")
        self._check_blends()
        # Bad waypoints are refused now, not during a run.
        _ = self._interpolants

    def _check_blends(self) -> None:
        given = [
            k for k in ("blend_time", "blend_radius", "blend") if fields_of(self)[k] is not None
        ]
        if given and self.through != "straight":
            raise ValueError(f"{given[0]}: only with through: straight")
        if self.blend_time is not None and self.blend_radius is not None:
            raise ValueError("give either blend_time or blend_radius")
        if given == ["blend"]:
            raise ValueError("blend: goes with a blend_time or blend_radius")

    @property
    def _positions(self) -> Any:
        return self._interpolants[0]

    @property
    def _quaternions(self) -> Any:
        return self._interpolants[1]

    @cached_property
    def _interpolants(self) -> tuple[Any, Any]:
        """Trajectories of the positions and of the quaternions, in F; None without the latter."""
        table = self._table
        points = table.points
        if len(points) < 2:
            raise ValueError(f"a path needs at least 2 waypoints, not {len(points)}")
        times = self._times(table)
        quaternions = self._orientations(table)
        blends = self._blends(times, points)
        positions = self._interpolant(times, points, blends)
        if quaternions is None:
            return positions, None
        return positions, self._interpolant(times, aligned(quaternions), blends)

    @cached_property
    def _table(self) -> Table:
        if self.positions is not None:
            return Table.of_points(self.positions)
        table = read_table(str(self.file))
        for names, rivals in (
            (("t",), ("times", "period", "speed")),
            (QUATERNION, ("quaternions", "rpy")),
            (RPY, ("quaternions", "rpy")),
        ):
            for rival in rivals:
                if names[0] in table.columns and fields_of(self)[rival] is not None:
                    raise ValueError(
                        f"{rival}: the file {self.file} has a column {names[0]}; leave one out"
                    )
        return table

    def _times(self, table: Table) -> Array:
        """Return the times of the waypoints, shape (k,) [s]."""
        given = [key for key in ("times", "period", "speed") if fields_of(self)[key] is not None]
        if "t" in table.columns:
            return _increasing(table.columns["t"], table)
        if len(given) != 1:
            raise ValueError("give one of times, period and speed" + (", no more" if given else ""))
        if self.times is not None:
            if self.times.size != len(table.rows):
                raise ValueError(
                    f"times: must be {len(table.rows)}, one for each waypoint, "
                    f"not {self.times.size}"
                )
            return _increasing(self.times, table)
        legs = np.linalg.norm(np.diff(table.points, axis=0), axis=1)
        if not legs.all():
            row = table.rows[int(np.argmin(legs)) + 1]
            raise ValueError(
                f"{given[0]}: gives row {row} no time, which is where the one before it is; give "
                "times"
            )
        way = np.cumsum([0.0, *legs])
        share = way / way[-1]
        times = way / self.speed if self.speed is not None else share * (self.period or 0.0)
        return _increasing(times, table)

    def _orientations(self, table: Table) -> Array | None:
        """Return the orientations as unit quaternions, shape (k, 4); None without any."""
        quaternions = table.group(QUATERNION) if self.quaternions is None else self.quaternions
        rpy = table.group(RPY) if self.rpy is None else self.rpy
        if rpy is not None:
            _require_radians(rpy, table)
            quaternions = np.array([RollPitchYaw(*row).ToQuaternion().wxyz() for row in rpy])
        if quaternions is None:
            return None
        if len(quaternions) != len(table.rows):
            key = "quaternions" if rpy is None else "rpy"
            raise ValueError(
                f"{key}: must be {len(table.rows)}, one for each waypoint, not {len(quaternions)}"
            )
        length = np.linalg.norm(quaternions, axis=1)
        worst = int(np.argmax(np.abs(length - 1.0)))
        if abs(length[worst] - 1.0) > _ROUNDING:
            raise ValueError(
                f"row {table.rows[worst]}: a quaternion must have the length 1, not "
                f"{length[worst]:.4g}"
            )
        return np.asarray(quaternions / length[:, np.newaxis])

    def _blends(self, times: Array, points: Array) -> Array | None:
        """Return the time of the blend at each waypoint, shape (k,) [s]; None without blends."""
        if self.blend_time is not None:
            blends = np.full(times.size, self.blend_time)
        elif self.blend_radius is not None:
            blends = _round(times, points, self.blend_radius)
        else:
            return None
        share = np.full(times.size, 0.5)
        share[[0, -1]] = 1.0
        taken = (share * blends)[:-1] + (share * blends)[1:]
        leg = int(np.argmax(taken / np.diff(times)))
        if taken[leg] > _FULL * (times[leg + 1] - times[leg]):
            key = "blend_radius" if self.blend_time is None else "blend_time"
            raise ValueError(
                f"{key}: the blends of leg {leg + 1} take {taken[leg]:.4g} s, and the leg has "
                f"{times[leg + 1] - times[leg]:.4g} s; give less"
            )
        return blends

    def _interpolant(self, times: Array, values: Array, blends: Array | None) -> Any:
        if self.through == "quintic":
            return quintic_spline(times, values)
        if self.through == "cubic":
            return cubic_spline(times, values)
        if blends is None:
            return rest_to_rest(times, values)
        return blended(times, values, blends, self.blend or "quintic")


def _increasing(times: Array, table: Table) -> Array:
    """Return times that increase from 0 or later.

    Raises:
        ValueError: If they do not; the message names the row.
    """
    if times.size and times[0] < 0.0:
        raise ValueError(f"row {table.rows[0]}: the time must be 0 or more, not {times[0]:g}")
    for row, before, time in zip(table.rows[1:], times[:-1], times[1:], strict=True):
        if time == before:
            raise ValueError(f"row {row}: repeats the time {time:g} of the row before it")
        if time < before:
            raise ValueError(f"row {row}: times must increase; {time:g} comes after {before:g}")
        if time - before < _SOONEST:
            raise ValueError(
                f"row {row}: must be at least {_SOONEST:g} s after the row before it, not "
                f"{time - before:g}"
            )
        if time > _LATEST:
            raise ValueError(f"row {row}: times may be up to {_LATEST:g} s, not {time:g}")
    return times


def _require_radians(rpy: Array, table: Table) -> None:
    """Raise a ValueError for angles of more than one turn, which are degrees."""
    beyond = np.abs(rpy).max(axis=1) > 2.0 * np.pi
    if beyond.any():
        k = int(np.argmax(beyond))
        raise ValueError(
            f"row {table.rows[k] if k < len(table.rows) else k + 1}: roll, pitch and yaw are at "
            f"most one turn, 2 pi, in radians, not {rpy[k].tolist()}"
        )


def _round(times: Array, points: Array, radius: float) -> Array:
    """Return the times of blends that begin and end at most ``radius`` [m] from their waypoints."""
    duration = np.diff(times)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not length.all():
        raise ValueError(
            f"blend_radius: leg {int(np.argmin(length)) + 1} has no length; give a blend_time"
        )
    # An end's blend covers half of what its leg's rate would.
    ends = 2.0 * radius * duration[[0, -1]] / (length[[0, -1]] + radius)
    fastest = np.maximum((length / duration)[:-1], (length / duration)[1:])
    return np.concatenate((ends[:1], 2.0 * radius / fastest, ends[1:]))
