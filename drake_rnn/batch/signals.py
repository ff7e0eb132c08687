"""Signals of robots side by side: those of the arms, and those of their paths."""

from __future__ import annotations

from collections.abc import Set
from typing import NamedTuple

from ..arrays.algebra import functions_of, matvec
from ..arrays.namespace import AnyArray, in_front, robots_first
from ..inputs.fields import Array
from ..robot.moved_screws import MovedScrews
from ..robot.task import Task
from .desired import Row, Tables

_AHEAD = {
    "p_preview": "p_WE_desired",
    "v_preview": "v_WE_desired",
    "a_preview": "a_WE_desired",
    "R_preview": "R_WE_desired",
    "w_preview": "w_WE_desired",
    "alpha_preview": "alpha_WE_desired",
}
#: Names of the signals that a law may see ahead of time.
PREVIEWS = frozenset(_AHEAD)

Found = dict[str, AnyArray]


class Sight:
    """Signals of the arms of many robots at one step, each computed once.

    Args:
        task: Their task.
        moved: Their kinematics.
        position: Joint positions, shape (robots, n) [rad].

    Attributes:
        origin: Origins of the end effectors, shape (robots, 3) [m].
        p_WE: The same along the task's axes, shape (robots, m) [m].
        J: Jacobians of the task, shape (robots, size, n).
    """

    def __init__(self, task: Task, moved: MovedScrews, position: Array) -> None:
        self._axes = slice(task.axes[0], task.axes[-1] + 1)
        self._moved = moved
        self._translation = moved.J[..., self._axes, :]
        # The last joint velocities asked for, and those of the end effectors for them.
        self._moving: tuple[Array, Array] | None = None
        self.position = position
        self.origin: Array = moved.p_WE
        self.p_WE: Array = self.origin[..., self._axes]
        self.J: Array = self._translation
        if task.with_orientation:
            self.J = _below(moved.J_omega, self._translation)

    def v_WE(self, velocity: Array) -> Array:
        """Return the velocities of the end effectors, shape (robots, m) [m/s]."""
        if self._moving is None or self._moving[0] is not velocity:
            self._moving = velocity, matvec(self._translation, velocity)
        return self._moving[1]

    def of_arms(self, names: Set[str], velocity: Array, causes: Array) -> Found:
        """Return signals of the arms, by name.

        Args:
            names: Names of signals; others are left out.
            velocity: Joint velocities that are shown, shape (robots, n) [rad/s].
            causes: Joint velocities that the others follow from, likewise.
        """
        known: Found = {"position": self.position, "p_WE": self.p_WE, "J": self.J}
        if "velocity" in names:
            known["velocity"] = velocity
        if "v_WE" in names:
            known["v_WE"] = self.v_WE(causes)
        if "Jdot_v" in names:
            known["Jdot_v"] = self._moved.Jdot_v(causes)[..., self._axes]
        if "R_WE" in names:
            known["R_WE"] = self._moved.R_WE
        if "J_omega" in names:
            known["J_omega"] = self._moved.J_omega
        return {name: value for name, value in known.items() if name in names}

    @property
    def R_WE(self) -> Array:
        """Orientations of the end effectors, shape (robots, 3, 3)."""
        R: Array = self._moved.R_WE
        return R


class Rows(NamedTuple):
    """The desired motions at a step.

    Attributes:
        now: Those of the functions that robots share.
        ahead: The same one period later; empty if no law sees ahead.
        late: The same, earlier by the delay of the arms; empty if they are not late.
    """

    now: Row
    ahead: Row
    late: Row


class Desired:
    """Desired motions of many robots, by the names of signals.

    Args:
        tables: The motions at each step.
        ahead: The motions one period after each step; None if no law sees ahead.
        late: The motions that arms behind filters make at each step; None if they are not late.
        task: Their task.
    """

    def __init__(
        self, tables: Tables, ahead: Tables | None, late: Tables | None, task: Task
    ) -> None:
        self._tables, self._ahead, self._late = tables, ahead, late
        self._each = (tables, ahead, late)
        self._axes = slice(task.axes[0], task.axes[-1] + 1)

    def row(self, number: int) -> Rows:
        """Return what is known of a step."""
        return Rows(*(() if tables is None else tables.row(number) for tables in self._each))

    def rows(self) -> Rows:
        """Return the same for all steps, with these in front."""
        return Rows(*(() if tables is None else tables.rows() for tables in self._each))

    def at(self, rows: Rows, names: Set[str]) -> Found:
        """Return the signals of a step, by name; position and velocity whatever the names are."""
        return self._named(self._tables, rows.now, names)

    def ahead(self, rows: Rows, names: Set[str]) -> Found:
        """Return those of the signals that are seen ahead of time at a step."""
        if self._ahead is None:
            return {}
        wanted = {_AHEAD[name] for name in names & PREVIEWS}
        known = self._named(self._ahead, rows.ahead, wanted)
        return {name: known[_AHEAD[name]] for name in names & PREVIEWS}

    def late(self, rows: Rows, names: Set[str]) -> Found:
        """Return the signals that arms behind filters should have; none if they are not late."""
        if self._late is None or not names:
            return {}
        known = self._named(self._late, rows.late, names)
        return {name: value for name, value in known.items() if name in names}

    def _named(self, tables: Tables, row: Row, names: Set[str]) -> Found:
        p, v, a = tables.position(row)
        axes = self._axes
        found: Found = {"p_WE_desired": p[..., axes], "v_WE_desired": v[..., axes]}
        found["a_WE_desired"] = a[..., axes]
        if names & {"R_WE_desired", "w_WE_desired", "alpha_WE_desired"}:
            R, w, alpha = tables.orientation(row)
            found |= {"R_WE_desired": R, "w_WE_desired": w, "alpha_WE_desired": alpha}
        return found


def _below(first: AnyArray, second: AnyArray) -> Array:
    """Return matrices of the rows of two, with robots side by side."""
    rows = functions_of(first).concatenate((in_front(first, 2), in_front(second, 2)))
    joined: Array = robots_first(rows, 2)
    return joined
