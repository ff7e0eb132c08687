"""Experiments: everything a run depends on, as one document that is checked before it runs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path as File
from typing import Any, Literal

import numpy as np
from pydantic import Field
from pydrake.systems.analysis import GetIntegrationSchemes

from .complaints import nearest, plain
from .diagrams import EXPERIMENTS
from .diagrams.loop import Feedback
from .documents import construct, parse_yaml, read_yaml, to_yaml
from .errors import InvalidInputError
from .experiment_setup import Setup, make_setup
from .fields import Finite, NonNegative, Positive, Seed, Vector, validated
from .metrics import METRICS
from .systems.contact_reference import ForceProfile
from .systems.dither import DitherSettings
from .systems.force_sensor import SensorSettings
from .systems.moving_average import FilterSettings
from .systems.plant import PlantSettings


@validated
class IntegratorSettings:
    """How Drake integrates a continuous reading.

    Args:
        scheme: One of Drake's integration schemes.
        accuracy: For error control; or
        step: For fixed steps [s].
    """

    scheme: str = "runge_kutta3"
    accuracy: Positive | None = None
    step: Positive | None = None

    def __post_init__(self) -> None:
        if self.scheme not in GetIntegrationSchemes():
            may_be = ", ".join(GetIntegrationSchemes())
            raise ValueError(f"scheme may be {may_be}, not {self.scheme!r}")
        if (self.accuracy is None) == (self.step is None):
            raise ValueError("give either accuracy or step")


@validated
class Acceptance:
    """Between what a metric is expected to lie.

    Args:
        at_least, at_most: Bounds, in the metric's unit; None for no bound.
    """

    at_least: Finite | None = None
    at_most: Finite | None = None

    def __post_init__(self) -> None:
        if self.at_least is None and self.at_most is None:
            raise ValueError("must give at_least, at_most or both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError(f"at_least: must not exceed at_most, {self.at_most:g}")

    def holds(self, value: float) -> bool:
        """Whether ``value`` lies within; NaN does not."""
        return bool(
            (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
            and not np.isnan(value)
        )

    def __str__(self) -> str:
        bounds = {">=": self.at_least, "<=": self.at_most}
        return ", ".join(f"{sign} {bound:g}" for sign, bound in bounds.items() if bound is not None)


@validated
class Experiment:
    """Everything a run depends on. `make_experiment` checks it as a whole.

    Args:
        name: Of the experiment; the file's name by default.
        paper: What it repeats, in the table of experiments.
        expect: What will be seen, in one sentence.
        arm: A shipped arm's name, or the fields of `drake_rnn.arms.ArmDescription`.
        task: What of the end effector the task is about: ``xyz``, ``xy`` for a planar arm, or
            ``pose``, its position and orientation.
        path: ``kind`` and the fields of a path; not for a law that seeks a target posture
            while the end effector stays.
        law: ``kind`` and those fields of a law that neither arm nor task determine.
        level: ``kinematic``: the arm is where it is commanded to be. ``dynamic``: it has mass,
            motors and contact.
        plant: At the dynamic level, how the arm is simulated and driven.
        environment: ``kind`` and the fields of what the tool presses against, see
            `drake_rnn.environments`.
        force: To press with.
        sensor: Of that force; one that says what is, by default.
        period: Of the controller [s]; or
        integrator: Drake's, for a law's continuous reading.
        start: Posture to start from, shape (n,) [rad]; the arm's home by default.
        on_unreachable: What to do about a target posture to which no self-motion leads:
            ``refuse``, or ``project`` it to the nearest posture on the way.
        limits: Bounds that override the arm's, by the names of
            `drake_rnn.limits.JointLimits`, a number standing for all joints; or none.
        dither: Excitation of the joints.
        filter: What the law's command goes through, so that the arm keeps the bounds of
            ``limits`` up to the highest order given.
        feedback: Which arm the law sees: the one that the filtered command moves,
            ``commanded``; or ``unfiltered``, a virtual one that its own command moves; or the
            true one, ``measured``, which is the default of documents at the dynamic level.
        seed: Of everything drawn at random.
        duration: Of the run [s].
        window: Times between which errors are evaluated [s]; the whole run by default.
        settling_tolerance_m: Position error below which the arm has settled [m].
        log_period: Between two samples of the stored series [s]; metrics see every step.
        accept: What the metrics are expected to be, by name.
        over: Values by dotted key that a sweep runs it at, unless it is told others.
    """

    name: str = ""
    paper: str = ""
    expect: str = ""
    arm: str | dict[str, Any]
    task: Literal["xyz", "xy", "pose"] = "xyz"
    path: dict[str, Any] | None = None
    law: dict[str, Any]
    level: Literal["kinematic", "dynamic"] = "kinematic"
    plant: PlantSettings | None = None
    environment: dict[str, Any] | None = None
    force: ForceProfile | None = None
    sensor: SensorSettings | None = None
    period: Positive | None = None
    integrator: IntegratorSettings | None = None
    start: Vector | None = None
    on_unreachable: Literal["refuse", "project"] = "refuse"
    limits: dict[str, Any] | Literal["none"] = Field(default_factory=dict)
    dither: DitherSettings | None = None
    filter: FilterSettings | None = None
    feedback: Feedback = "commanded"
    seed: Seed = 0
    duration: Positive
    window: tuple[NonNegative, Positive] | None = None
    settling_tolerance_m: Positive = 1e-3
    log_period: Positive = 0.01
    accept: dict[str, Acceptance] = Field(default_factory=dict)
    over: dict[str, list[Any]] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        if re.search(r"[/\\\x00-\x1f]|^\.+$", self.name):
            raise ValueError(f"name: must be good for a folder's name, not {self.name!r}")
        if self.period is not None and self.integrator is not None:
            raise ValueError("period: stands beside integrator; give one of them")
        if self.period is None and self.integrator is None:
            raise ValueError("period: must be given, or integrator")
        if self.period is not None and self.period > self.duration:
            raise ValueError(
                f"period: may be at most the duration, {self.duration:g} s, not {self.period:g}"
            )
        if self.window is not None and not self.window[0] < self.window[1] <= self.duration:
            raise ValueError(
                f"window: must be two rising times up to {self.duration:g} s, "
                f"not {list(self.window)}"
            )
        for metric in self.accept:
            if metric not in METRICS:
                raise ValueError(f"accept.{metric}: no such metric; {nearest(metric, METRICS)}")

    @cached_property
    def setup(self) -> Setup:
        """The objects that the document describes."""
        return make_setup(self)

    def document(self) -> dict[str, Any]:
        """The experiment as plain data, without what is not set."""
        document = {}
        for name in _FIELDS:
            value = getattr(self, name)
            if value is None or (isinstance(value, (dict, str)) and not value):
                continue
            if name == "accept":
                value = {key: _given(bound) for key, bound in value.items()}
            elif name in {"integrator", "dither", "filter", "plant", "force", "sensor"}:
                value = _given(value)
            document[name] = plain(value)
        return document

    def to_yaml(self) -> str:
        """The experiment as a document that `load_experiment` reads back, bit for bit."""
        return to_yaml(self.document())


_FIELDS = Experiment.__dataclass_fields__


def _given(value: Any) -> dict[str, Any]:
    names = value.__dataclass_fields__
    return {name: getattr(value, name) for name in names if getattr(value, name) is not None}


def shipped_experiments() -> list[str]:
    """Names of the experiments that come with this package.

    All but ``state_adjustment_printed`` can be run; that one is there to be refused.
    """
    return sorted(file.stem for file in EXPERIMENTS.glob("*.yaml"))


def load_experiment(experiment: str | File, changes: Mapping[str, Any] | None = None) -> Experiment:
    """An experiment by its shipped name or from a YAML file, checked as a whole.

    Args:
        experiment: A name from `shipped_experiments`, or a file.
        changes: New values by dotted keys, e.g. ``{"law.kappa": 8}``; None removes a key.
            Setting one of period and integrator removes the other; a duration that ends
            before the document's window removes that, and what was expected in it.

    Raises:
        InvalidInputError: Naming the key, its value and what it may be.
    """
    return make_experiment(read_experiment(experiment, changes))


def read_experiment(
    experiment: str | File, changes: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The document of an experiment, with ``changes``, read and not yet checked.

    Raises:
        InvalidInputError: If there is no such experiment, or it is no document.
    """
    name = str(experiment)
    if name in shipped_experiments():
        file = EXPERIMENTS / f"{name}.yaml"
    elif File(name).suffix in {".yaml", ".yml"}:
        file = File(name)
    else:
        raise InvalidInputError(
            f"experiment: no experiment {name!r}; "
            + nearest(name, shipped_experiments())
            + ", or a .yaml file"
        )
    document = read_yaml(file)
    if not isinstance(document, dict):
        raise InvalidInputError(f"{file}: must be a mapping of keys to values")
    # Models and CSV files are named relative to the document that names them.
    _resolve_files(document, file.parent)
    rivals = {key.split(".")[0] for key, value in (changes or {}).items() if value is not None}
    if {"period", "integrator"} <= rivals:
        raise InvalidInputError("period: stands beside integrator; change one of them")
    for key, value in (changes or {}).items():
        _change(document, key, value)
    _cut_short(document, changes or {})
    return {"name": file.stem, **document}


def make_experiment(document: Mapping[str, Any]) -> Experiment:
    """An experiment from plain data, checked as a whole.

    Raises:
        InvalidInputError: Naming the key, its value and what it may be.
    """
    if document.get("level") == "dynamic":
        document = {"feedback": "measured", **document}
    made = construct(Experiment, document, "")
    _ = made.setup
    return made


def parse_change(text: str) -> tuple[str, Any]:
    """Key and value of ``KEY=VALUE``; the value is read as YAML.

    Raises:
        InvalidInputError: If there is no ``=``, or the value is no YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InvalidInputError(f"--set: must be KEY=VALUE, not {text!r}")
    return key.strip(), parse_yaml(value, f"--set {key.strip()}")


def _change(document: dict[str, Any], key: str, value: Any) -> None:
    *folders, last = key.split(".")
    place = document
    for depth, folder in enumerate(folders):
        inner = place.setdefault(folder, {})
        if not isinstance(inner, dict):
            where = ".".join(folders[: depth + 1])
            raise InvalidInputError(f"{key}: {where} is {inner!r}, which has no keys")
        place = inner
    if value is None:
        place.pop(last, None)
    else:
        place[last] = value
    rival = {"period": "integrator", "integrator": "period"}.get(key.split(".")[0])
    if rival is not None and value is not None:
        document.pop(rival, None)


def _cut_short(document: dict[str, Any], changes: Mapping[str, Any]) -> None:
    if "duration" not in changes or "window" in changes:
        return
    duration, window, numbers = document.get("duration"), document.get("window"), (int, float)
    until = window[-1] if isinstance(window, list) and window else None
    if isinstance(duration, numbers) and isinstance(until, numbers) and until > duration:
        document.pop("window")
        if not any(key.split(".")[0] == "accept" for key in changes):
            document.pop("accept", None)


def _resolve_files(document: dict[str, Any], folder: File) -> None:
    arm, path = _section(document, "arm"), _section(document, "path")
    packages, environment = _section(arm, "packages"), _section(document, "environment")
    files = ((arm, "model"), (path, "file"), (environment, "model"))
    for section, key in (*files, *((packages, key) for key in packages)):
        value = section.get(key)
        # A shipped arm's name may also be that of a folder.
        found = File.is_dir if section is packages else File.is_file
        if isinstance(value, str) and found(folder / value):
            # Whole, so that the document means the same wherever it is written next.
            section[key] = str((folder / value).resolve())


def _section(document: dict[str, Any], key: str) -> dict[str, Any]:
    section = document.get(key)
    return section if isinstance(section, dict) else {}
