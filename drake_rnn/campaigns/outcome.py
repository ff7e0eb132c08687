"""Orders of runs, which any process can carry out, and their outcomes, both as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from ..inputs.complaints import plain
from ..inputs.dataclass_fields import field_names, fields_of

#: How a run is carried out: by simulating its diagram, or in a batch of runs side by side.
Method = Literal["simulate", "batch"]
#: How a run ended: at its full duration; before it; refused for bad input; or with a crash.
Ended = Literal["complete", "failed", "refused", "killed its worker"]


@dataclass(frozen=True)
class Order:
    """A run to carry out, as plain data.

    Attributes:
        key: Name under which the outcome is kept, see `row_key`.
        document: Contents of the experiment's document.
        stamp: Versions of the packages that the run needs.
        around: Digest of these versions and of the files that the document names.
        anyway: Whether the run may take any number of steps.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run; the key depends on the method too.
    """

    key: str
    document: dict[str, Any]
    stamp: str
    around: str
    anyway: bool = False
    learning: bool = False
    method: Method = "simulate"


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run.

    Attributes:
        status: How the run ended.
        failure: Why the run did not complete; empty if it did.
        until_s: Simulated time that the run reached [s].
        metrics: Metrics up to that time, by name.
        kept: Whether each metric that is expected to keep a bound keeps it, by name.
        accepted: Metrics whose bounds stand in the document, under ``accept``.
        learning: Times [s] and Frobenius norms of J - J_hat; empty unless asked for and learned.
        wall_time_s: Wall time of the run, loading included [s]; in a batch, its share.
        method: How the run was carried out: a run that a batch refuses is simulated.
    """

    status: Ended
    failure: str = ""
    until_s: float = 0.0
    metrics: dict[str, float] = field(default_factory=dict)
    kept: dict[str, bool] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()
    learning: tuple[list[float], ...] = ()
    wall_time_s: float = 0.0
    method: Method = "simulate"

    @property
    def not_met(self) -> tuple[str, ...]:
        """Metrics outside the bounds that they are expected to keep."""
        return tuple(name for name, met in self.kept.items() if not met)

    def contents(self) -> dict[str, Any]:
        """Return the outcome as plain data that JSON can hold, bit for bit."""
        contents: dict[str, Any] = plain(fields_of(self))
        return contents

    @classmethod
    def of(cls, contents: Any) -> Outcome:
        """Return the outcome with these `contents`.

        Raises:
            ValueError: If the contents are not those of an outcome.
        """
        names = field_names(cls)
        if not isinstance(contents, dict) or not contents.keys() >= {*names}:
            raise ValueError("no outcome of a run")
        if contents["status"] not in get_args(Ended):
            raise ValueError(f"no status of a run: {contents['status']!r}")
        if contents["method"] not in get_args(Method):
            raise ValueError(f"no method of a run: {contents['method']!r}")
        values = {name: contents[name] for name in names}
        _require_kinds(values)
        values["accepted"] = tuple(values["accepted"])
        values["learning"] = tuple(values["learning"])
        return cls(**values)


def _require_kinds(values: Mapping[str, Any]) -> None:
    """Raise a ValueError unless the contents of an outcome are of the kinds that a run writes."""
    metrics, kept, learning = values["metrics"], values["kept"], values["learning"]
    right = (
        isinstance(values["failure"], str),
        all(map(_is_number, (values["until_s"], values["wall_time_s"]))),
        isinstance(metrics, dict) and all(map(_is_number, metrics.values())),
        isinstance(kept, dict) and all(isinstance(each, bool) for each in kept.values()),
        isinstance(values["accepted"], list)
        and all(isinstance(each, str) for each in values["accepted"]),
        isinstance(learning, list)
        and len(learning) in (0, 2)
        and all(isinstance(each, list) and all(map(_is_number, each)) for each in learning),
    )
    if not all(right):
        raise ValueError("no outcome of a run")


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return isinstance(float(value), float)
    except OverflowError:
        return False
