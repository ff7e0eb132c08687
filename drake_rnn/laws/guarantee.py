"""What is promised of a motion, and what each promise rests on, as data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

from ..robot.clearance import Clearance


@dataclass(frozen=True)
class Assumption:
    """Something that a promise rests on: a quantity that stays within a bound.

    Attributes:
        what: The quantity, e.g. ``error of the normal``.
        most: Its largest value that is counted on; 0 for something that must not be.
        unit: Unit of both values.
        actual: The largest value that it has, as far as that is known, as a simulation knows its
            own world; None if it is not known.
        key: Key of a document that states ``most``; empty for none.
        metric: Metric of a run that measures the quantity; empty for none.
    """

    what: str
    most: float = 0.0
    unit: str = ""
    actual: float | None = None
    key: str = ""
    metric: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether it holds; None if that is not known."""
        if self.actual is None:
            return None
        return self.actual <= self.most * (1.0 + 1e-9) + 1e-12

    def measured(self, metrics: Mapping[str, float]) -> Assumption:
        """Return it with what a run measured, if the run has its metric.

        Args:
            metrics: Metrics of the run, by name.
        """
        value = metrics.get(self.metric)
        return self if value is None else replace(self, actual=value)

    def __str__(self) -> str:
        text = f"no {self.what}"
        if self.most > 0.0:
            text = f"{self.what} ≤ {_quantity(self.most, self.unit)}"
        if self.holds is False and self.actual is not None:
            text += f" (does not hold: {_quantity(self.actual, self.unit)})"
        return text

    @property
    def contents(self) -> dict[str, Any]:
        """The assumption as plain data."""
        named = {"what": self.what, "most": self.most, "unit": self.unit}
        return {**named, "actual": self.actual, "holds": self.holds}


def _quantity(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".rstrip()


def assumptions_text(assumptions: Iterable[Assumption]) -> str:
    """Return assumptions in words; empty without any."""
    return ", ".join(str(each) for each in assumptions)


def distance_assumptions(
    clearance: Clearance, actual: float | None = None
) -> tuple[Assumption, ...]:
    """Return what a least distance rests on.

    Args:
        clearance: What the arm is to stay clear of.
        actual: Error of the kinematics that distances are computed with, as far as it is known [m].
    """
    solids = clearance.solids
    speed, error = float(solids.speeds.max(initial=0.0)), float(solids.errors.max(initial=0.0))
    is_known = actual is not None
    return (
        Assumption("error of the kinematics of the arm's model", 0.0, "m", actual),
        Assumption("extent of a body beyond its capsules", 0.0, "m"),
        Assumption("speed of an obstacle", speed, "m/s", speed if is_known else None),
        Assumption("error of an obstacle's place", error, "m", error if is_known else None),
    )


def guard_assumptions(tolerance: float, clearance: Clearance | None) -> tuple[Assumption, ...]:
    """Return what rests on calls of a guard before a robot that it knows nothing of.

    Args:
        tolerance: Time by which a call may be late [s].
        clearance: What the arm is to stay clear of; None for nothing.
    """
    return (
        Assumption("lateness of a call", tolerance, "s"),
        Assumption("deviation of the arm from its command", 0.0, "rad"),
        *(() if clearance is None else distance_assumptions(clearance)),
    )


class Guarantee(NamedTuple):
    """What holds by construction, whatever the inputs of a law are.

    Attributes:
        limits: Names of limits, of `drake_rnn.robot.limits.LIMIT_UNITS`.
        distance: Least distance from the arm itself and from obstacles that stand still [m]; None
            if none holds.
        force: Largest force on a surface, while the tool is as near to the path that gives way as
            is stated [N]; None if none holds.
        torque: Largest torques of the joints, of a law that commands torques, one for each joint
            and infinite for one without a limit [N m]; None if none holds.
    """

    limits: tuple[str, ...] = ()
    distance: float | None = None
    force: float | None = None
    torque: tuple[float, ...] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all that it promises: of limits, and ``distance``, ``force``, ``torque``."""
        others = {"distance": self.distance, "force": self.force, "torque": self.torque}
        return (*self.limits, *(name for name, value in others.items() if value is not None))

    def has(self, name: str) -> bool:
        """Return whether it promises something, by its name in `names`."""
        return name in self.names

    def without(self, names: Sequence[str]) -> Guarantee:
        """Return what is left without some of its `names`."""
        return Guarantee(
            tuple(name for name in self.limits if name not in names),
            None if "distance" in names else self.distance,
            None if "force" in names else self.force,
            None if "torque" in names else self.torque,
        )


@dataclass(frozen=True)
class Promise:
    """A bound that holds by construction, or that a user stated: what it rests on, and how it went.

    Attributes:
        name: A limit of `drake_rnn.robot.limits.LIMIT_UNITS`, ``distance``, ``force`` or
            ``torque``.
        of: What keeps it: the ``arm``, its ``command`` alone, or nothing: it is ``stated``.
        bound: The bound, if it is one number.
        unit: Unit of the bound.
        assumptions: What it rests on.
        met: Whether a run kept it; None without one, or if the run did not come to its end.
        excess: By how much a run exceeded it; 0 if it did not.
        excess_unit: Unit of the excess; empty for a ratio.
    """

    name: str
    of: str
    bound: float | None = None
    unit: str = ""
    assumptions: tuple[Assumption, ...] = ()
    met: bool | None = None
    excess: float = 0.0
    excess_unit: str = ""

    @property
    def contents(self) -> dict[str, Any]:
        """The promise as plain data."""
        assumptions = [each.contents for each in self.assumptions]
        named = {"name": self.name, "of": self.of, "bound": self.bound, "unit": self.unit}
        outcome = {"met": self.met, "excess": self.excess, "excess_unit": self.excess_unit}
        return {**named, **outcome, "assumptions": assumptions}

    @classmethod
    def from_contents(cls, contents: Mapping[str, Any]) -> Promise:
        """Return the promise of its `contents`."""
        names = {field.name for field in fields(cls)} & contents.keys()
        promise = cls(**{name: contents[name] for name in names})
        names = {field.name for field in fields(Assumption)}
        assumptions = (
            Assumption(**{name: each[name] for name in names & each.keys()})
            for each in contents["assumptions"]
        )
        return replace(promise, assumptions=tuple(assumptions))

    @property
    def subject(self) -> str:
        """What is bounded, and by how much."""
        if self.bound is None:
            return self.name
        sign = "≥" if self.name == "distance" else "≤"
        return f"{self.name} {sign} {_quantity(self.bound, self.unit)}"

    @property
    def outcome(self) -> str:
        """How it went, in words; empty if that is not known."""
        if self.met is None:
            return ""
        if self.met:
            return "kept"
        return f"exceeded by {_quantity(self.excess, self.excess_unit)}"


_OF = {
    "arm": "promised of the arm",
    "command": "promised of the command alone",
    "stated": "stated, but not promised",
}


def promise_lines(promises: Iterable[Promise]) -> list[str]:
    """Return promises in words, those in one line that rest on the same and went alike."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for each in promises:
        key = (each.of, each.outcome, assumptions_text(each.assumptions))
        groups.setdefault(key, []).append(each.subject)
    lines = []
    for (of, outcome, rests), subjects in groups.items():
        line = f"{', '.join(subjects)}: {_OF[of]}"
        line += f", {outcome}" if outcome else ""
        rest = "would rest on" if of == "stated" else "rests on"
        lines.append(line + (f"; {rest} {rests}" if rests else ""))
    return lines
