"""The document of an experiment: everything a run depends on, as it is written."""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field
from pydrake.systems.analysis import GetIntegrationSchemes

from ..inputs.complaints import nearest, plain
from ..inputs.dataclass_fields import fields_of
from ..inputs.documents import to_yaml
from ..inputs.fields import Finite, NonNegative, Positive, Seed, Vector, validated
from ..measures import METRIC_NAMES
from ..systems.body import Feedback
from ..systems.contact_reference import ForceProfile
from ..systems.dither import DitherSettings
from ..systems.force_sensor import SensorSettings
from ..systems.moving_average import FilterSettings
from ..systems.plant import PlantSettings


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
    """Bounds that a metric is expected to keep.

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
class ExperimentDocument:
    """Everything a run depends on, as plain data; `make_experiment` gives it its meaning.

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
            true one, ``measured``. By default ``commanded`` at the kinematic level, ``measured``
            at the dynamic one.
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
    feedback: Feedback | None = None
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
            if metric not in METRIC_NAMES:
                raise ValueError(
                    f"accept.{metric}: no such metric; {nearest(metric, list(METRIC_NAMES))}"
                )

    def contents(self) -> dict[str, Any]:
        """Return the document as plain data, without what is not set."""
        contents = {}
        for name, value in fields_of(self).items():
            if value is None or (isinstance(value, (dict, str)) and not value):
                continue
            if name == "accept":
                value = {key: _given(bound) for key, bound in value.items()}
            elif is_dataclass(value):
                value = _given(value)
            contents[name] = plain(value)
        return contents

    def to_yaml(self) -> str:
        """Return the document as YAML text that reads back bit for bit."""
        return to_yaml(self.contents())


def _given(value: Any) -> dict[str, Any]:
    return {name: entry for name, entry in fields_of(value).items() if entry is not None}
