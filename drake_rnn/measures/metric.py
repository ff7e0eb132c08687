"""What a metric is: its name, unit and meaning, how it is taken, and where it is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS
from .gathering import Gathering, Largest
from .values import Observed, Values

#: Steps that a metric is taken over: those of the experiment's window, or those of the whole run.
Over = Literal["window", "run"]

#: Places that show a metric: overviews, by what the run is about, and the table of a sweep.
Shown = Literal["path", "posture", "return", "force", "sweep"]


def _ending(unit: str) -> str:
    """Return a unit in the form in which it ends the name of a metric."""
    return "_" + unit.replace("/s^", "_s").replace("/", "_")


# Units by the endings of names, longest first: a name that ends in ``_m_s`` is of no time.
_UNITS = {_ending(unit): unit for unit in ("m", "s", "N", "px", "m/s", *LIMIT_UNITS.values())}
_ENDINGS = sorted(_UNITS, key=len, reverse=True)


@dataclass(frozen=True)
class Metric:
    """A number computed from a run.

    Attributes:
        name: Key in ``metrics.json``; it ends in the unit.
        meaning: Description for the documentation.
        over: Steps it is taken over.
        shown: Places that show it in addition to the metrics in the experiment's ``accept``.
        of: Function that gives the values at the steps of a motion; None if a `Group` takes the
            metric, or if no motion shows it.
        by: How the metric is gathered from these values.
        unit_if_unnamed: SI unit if the name does not end in one; "1" for a pure number.
    """

    name: str
    meaning: str
    over: Over = "run"
    shown: tuple[Shown, ...] = ()
    of: Values | None = None
    by: Gathering = Largest()  # noqa: RUF009 - it has no state
    unit_if_unnamed: str = "1"

    @property
    def unit(self) -> str:
        """SI unit; "1" for a pure number."""
        named = (_UNITS[ending] for ending in _ENDINGS if self.name.endswith(ending))
        return next(named, self.unit_if_unnamed)

    @property
    def of_law(self) -> bool:
        """Whether the values are observables of the law."""
        return isinstance(self.of, Observed)

    @property
    def differentiable(self) -> bool:
        """Whether a compiled run can take the metric and its derivative."""
        return self.of is not None and self.by.differentiable and not self.of_law

    @property
    def words(self) -> str:
        """The name in words, without the unit."""
        words = self.name.removesuffix(_ending(self.unit)).replace("_", " ")
        for order, derivative in enumerate(DERIVATIVE_UNITS, start=1):
            words = words.replace(f"limit ratio {order}", f"{derivative} / bound")
        return words


def violation_metric(limit: str) -> str:
    """Return the name of the metric of a limit's violation.

    Args:
        limit: A key of `LIMIT_UNITS`.
    """
    return f"{limit}_violation_max{_ending(LIMIT_UNITS[limit])}"
