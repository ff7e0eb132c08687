"""Sources of the numbers for judging: runs, their metrics, and measures taken from them."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from ..errors import DrakeRnnError, InterruptedRunError
from ..experiment import load_experiment
from ..runs.result import Result
from ..runs.simulation import simulate
from .claim import Quantity
from .reading import Claims


class RunSource(ABC):
    """Runs of shipped experiments, each of which is made once, however often it is asked for."""

    @abstractmethod
    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """

    def metrics(self, name: str, changes: Mapping[str, Any] | None = None, /) -> dict[str, float]:
        """Return the metrics of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        return self.run(name, changes).metrics

    def measured(self, claims: Claims, quantity: Quantity) -> float:
        """Return the number of a quantity that a measure gives.

        Args:
            claims: The paper's claims, with its measures.
            quantity: The quantity.

        Raises:
            DrakeRnnError: If a run that it looks at is refused or fails.
        """
        return float(claims.measures[str(quantity.measure)](self.run, **quantity.given))


class SimulatedRuns(RunSource):
    """Runs that this process makes and keeps in memory, those that fail too."""

    def __init__(self) -> None:
        self._known: dict[str, Result | DrakeRnnError] = {}

    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        key = json.dumps([name, dict(changes or {})], sort_keys=True)
        if key not in self._known:
            try:
                self._known[key] = simulate(load_experiment(name, changes))
            except InterruptedRunError:
                raise
            except DrakeRnnError as error:
                # Without the traceback, which would keep the whole run in memory.
                self._known[key] = error.with_traceback(None)
        found = self._known[key]
        if isinstance(found, DrakeRnnError):
            raise found.with_traceback(None)
        return found
