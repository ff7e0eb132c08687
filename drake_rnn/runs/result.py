"""The result of a run: its series and metrics."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..experiment import Experiment, make_experiment
from ..inputs.documents import parse_yaml
from ..inputs.fields import Array
from ..inputs.modules import Modules
from ..paths import Path as MotionPath


@dataclass(frozen=True)
class Result:
    """Series and metrics of a run.

    Attributes:
        experiment: Experiment that was run.
        time: Times of the stored samples, one per ``log_period`` of the document, shape (k,) [s].
        series: Arrays with k rows, by name; `drake_rnn.measures.UNITS` holds their units. A series
            ``*_peak`` is the largest magnitude over all steps since the previous sample.
        metrics: Metrics, taken over every step, by name.
        warnings: Warnings about the run.
        graphviz: Diagram that was simulated, as Graphviz text.
    """

    experiment: Experiment
    time: Array
    series: dict[str, Array]
    metrics: dict[str, float]
    warnings: list[str] = field(default_factory=list)
    graphviz: str = ""

    @property
    def position_error(self) -> Array:
        """Norm of the position error, shape (k,) [m]; in contact, of its part along the surface."""
        error = self.series["p_WE"] - self.series["p_WE_desired"]
        if (contact := self.experiment.contact) is not None:
            n = contact.surface.normal_W
            error = error - np.outer(error @ n, n)
        return np.asarray(np.linalg.norm(error, axis=1))

    def save(self, folder: str | Path) -> Path:
        """Write ``experiment.yaml``, ``result.npz``, ``metrics.json`` and ``diagram.dot``.

        Returns:
            The folder, which is created if missing.

        Raises:
            InvalidInputError: If the folder cannot be written to.
        """
        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            header = "".join(f"# {line}\n" for line in versions())
            (folder / "experiment.yaml").write_text(header + self.experiment.document.to_yaml())
            arrays: dict[str, Any] = {"time": self.time, **self.series}
            np.savez_compressed(folder / "result.npz", **arrays)
            (folder / "metrics.json").write_text(json.dumps(self.metrics, indent=2) + "\n")
            if self.graphviz:
                (folder / "diagram.dot").write_text(self.graphviz)
        except OSError as error:
            raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None
        return folder

    @classmethod
    def load(
        cls,
        folder: str | Path,
        path: MotionPath | Trajectory | None = None,
        *,
        modules: Modules = False,
    ) -> Result:
        """Return a result that `save` has written.

        Args:
            folder: The folder.
            path: Path of the run, if it was made in Python: the folder does not hold it.
            modules: Modules that may be imported, as the run had a law, path or environment of
                the form ``module:Class``: True for any, False for none, or their names. What has
                been imported already is used without being told to.

        Raises:
            InvalidInputError: If the folder does not hold a result, or the run needs a class that
                is not known here, or that must not be imported.
        """
        folder = Path(folder)
        try:
            document = parse_yaml((folder / "experiment.yaml").read_text(), str(folder))
            with np.load(folder / "result.npz") as arrays:
                series = {name: arrays[name] for name in arrays.files}
            metrics = json.loads((folder / "metrics.json").read_text())
            time = series.pop("time")
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise InvalidInputError(f"{folder}: holds no result: {error}") from None
        graph = folder / "diagram.dot"
        return cls(
            experiment=make_experiment(document, path, modules=modules),
            time=time,
            series=series,
            metrics=metrics,
            graphviz=graph.read_text() if graph.is_file() else "",
        )


def versions() -> list[str]:
    """Return the versions of the packages that the numbers of a run may depend on."""
    packages = ("drake-rnn", "drake", "numpy")
    return [f"{package} {version(package)}" for package in packages]
