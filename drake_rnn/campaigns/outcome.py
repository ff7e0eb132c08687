"""What came of a run: an order that any process can be handed, and its outcome as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args

#: What carries a run out: a simulation of its diagram, or a batch of runs side by side.
Method = Literal["simulate", "batch"]
#: How a run ended: at its end; before it; not begun, as its input is bad; or with its process.
Ended = Literal["complete", "failed", "refused", "killed its worker"]


@dataclass(frozen=True)
class Order:
    """A run that is asked for, as plain data.

    Attributes:
        key: Name under which its outcome is kept, see `row_key`.
        document: Contents of the experiment's document.
        stamp: Versions that it is to be run with.
        around: Digest of them and of the files that the document names.
        anyway: Whether it may take as many steps as it likes.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: What is to carry it out; its key tells it too.
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
    """What came of a run.

    Attributes:
        status: How it ended.
        failure: Why it did not come to its end; empty if it did.
        until_s: Simulated time that it came to [s].
        metrics: Metrics, up to that time, by name.
        kept: Whether each metric that is expected to keep a bound keeps it, by name.
        accepted: Those of them whose bounds stand in the document, under ``accept``.
        learning: Times [s] and Frobenius norms of J - J_hat; empty unless asked for and learned.
        wall_time_s: What the run took on its machine, loading included [s]; of a batch, its part.
        method: What has carried it out: a run that a batch refuses is simulated.
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
        """Metrics that do not keep the bounds that they are expected to keep."""
        return tuple(name for name, met in self.kept.items() if not met)

    def contents(self) -> dict[str, Any]:
        """Return the outcome as plain data that JSON can hold, bit for bit."""
        return {
            "status": self.status,
            "failure": self.failure,
            "until_s": self.until_s,
            "metrics": self.metrics,
            "kept": self.kept,
            "accepted": list(self.accepted),
            "learning": [list(values) for values in self.learning],
            "wall_time_s": self.wall_time_s,
            "method": self.method,
        }

    @classmethod
    def of(cls, contents: Any) -> Outcome:
        """Return the outcome of its `contents`.

        Raises:
            ValueError: If they are no outcome.
        """
        names = {each.name for each in fields(cls)}
        if not isinstance(contents, dict) or not names <= contents.keys():
            raise ValueError("no outcome of a run")
        if contents["status"] not in get_args(Ended):
            raise ValueError(f"no status of a run: {contents['status']!r}")
        if contents["method"] not in get_args(Method):
            raise ValueError(f"no method of a run: {contents['method']!r}")
        values = {name: contents[name] for name in names}
        values["accepted"] = tuple(values["accepted"])
        values["learning"] = tuple(values["learning"])
        return cls(**values)
