"""The document of an experiment: everything that a run depends on, as plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field
from pydrake.systems.analysis import GetIntegrationSchemes

from ..errors import OldName
from ..features import FEATURES, Feature, installed_features
from ..features.camera import ToolCamera
from ..features.contact import ForceProfile, SensorSettings
from ..features.detour import DetourSettings
from ..features.filter import FilterSettings
from ..features.joint_noise import DisturbanceSettings, DitherSettings, JointNoise
from ..features.locks import JointLock
from ..features.obstacles import SafetySettings
from ..features.pairs import LISTED, Combination
from ..features.planning import Goal
from ..features.sensing import SensingSettings
from ..inputs.documents import require_folder_name, to_yaml
from ..inputs.fields import Finite, NonNegative, Positive, Seed, Vector, between, validated
from ..inputs.keys import Meaning
from ..inputs.messages import (
    field_names,
    fields_of,
    nearest,
    plain,
)
from ..laws import Law
from ..measures import METRICS
from ..paths import RecordedTargets
from ..robot.arm_description import drive_named
from ..robot.task import TASKS, Task, named_task
from ..systems import BODIES
from ..systems.body import Feedback
from ..systems.plant import PlantSettings

_LOG_PERIOD = 0.01
# Accuracy of an integrator: a larger one controls no error, a smaller one is below rounding.
_Accuracy = Annotated[Positive, between(1e-14, 0.1)]
# Sampling period of a controller [s]; no controller of an arm is slower.
_Period = Annotated[Positive, between(0.0, 1.0)]
#: Schemes of Drake that make fixed steps and ignore the accuracy.
_WITHOUT_ERROR_CONTROL = ("explicit_euler", "runge_kutta2", "semi_explicit_euler")


@validated
class IntegratorSettings:
    """Settings of the Drake integrator that runs a law's continuous reading."""

    scheme: Annotated[str, Meaning("One of Drake's integration schemes.")] = "runge_kutta3"
    accuracy: Annotated[
        _Accuracy | None,
        Meaning("Accuracy for error control; give either this or ``step``."),
    ] = None
    step: Annotated[
        Positive | None,
        Meaning("Length of fixed steps; give either this or ``accuracy``.", unit="s"),
    ] = None

    def __post_init__(self) -> None:
        if self.scheme not in GetIntegrationSchemes():
            may_be = ", ".join(GetIntegrationSchemes())
            raise ValueError(f"scheme: may be {may_be}, not {self.scheme!r}")
        if (self.accuracy is None) == (self.step is None):
            raise ValueError("give either accuracy or step")
        if self.accuracy is not None and self.scheme in _WITHOUT_ERROR_CONTROL:
            raise ValueError(
                f"accuracy: {self.scheme} does not estimate its error; give a step, or another "
                "scheme, e.g. runge_kutta3"
            )


@validated
class Acceptance:
    """Bounds that a metric is expected to keep."""

    at_least: Annotated[
        Finite | None,
        Meaning("Lower and upper bound, in the metric's unit; None for no bound."),
    ] = None
    at_most: Annotated[
        Finite | None,
        Meaning("Lower and upper bound, in the metric's unit; None for no bound."),
    ] = None

    def __post_init__(self) -> None:
        if self.at_least is None and self.at_most is None:
            raise ValueError("must give at_least, at_most or both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError(
                f"at_least: must not exceed at_most, {self.at_most:g}; it is {self.at_least:g}"
            )

    def holds(self, value: float) -> bool:
        """Return whether ``value`` lies within the bounds; NaN does not."""
        return bool(
            (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
            and not np.isnan(value)
        )

    def __str__(self) -> str:
        bounds = {">=": self.at_least, "<=": self.at_most}
        return ", ".join(f"{sign} {bound:g}" for sign, bound in bounds.items() if bound is not None)


D = TypeVar("D", bound=type)


def _with_sections(features: Sequence[Feature]) -> Callable[[D], D]:
    """Return a decorator that gives a class the sections of features which do not have one."""

    def decorate(cls: D) -> D:
        for feature in features:
            if feature.section is not None:
                cls.__annotations__[feature.key] = feature.section
                setattr(cls, feature.key, None)
        return cls

    return decorate


@validated
@_with_sections(FEATURES)
class ExperimentDocument:
    """Everything that a run depends on, as plain data; `make_experiment` makes the objects."""

    name: Annotated[str, Meaning("Name of the experiment; by default the file's name.")] = ""
    paper: Annotated[str, Meaning("Source of the experiment, for the table of experiments.")] = ""
    expect: Annotated[str, Meaning("Expected outcome, in one sentence.")] = ""
    arm: Annotated[
        str | dict[str, Any],
        Meaning("Name of a shipped arm, or the fields of `drake_rnn.ArmDescription`."),
    ]
    task: Annotated[
        str | list[Any],
        Meaning(
            "Part of the end effector's pose that the task is about: ``xyz``; ``xy`` for a "
            "planar arm; ``pose``, position and orientation; or a list of objectives, each with "
            "its ``kind`` and its keys, see `drake_rnn.robot.task`.",
        ),
    ] = "xyz"
    path: Annotated[
        dict[str, Any] | None,
        Meaning(
            "``kind`` and the fields of a path; omit for laws that seek a target posture or "
            "follow joint targets.",
        ),
    ] = None
    targets: Annotated[
        RecordedTargets | None,
        Meaning("Joint targets that came to a law that follows such targets."),
    ] = None
    goal: Annotated[
        Goal | None,
        Meaning(
            "Where the arm is to come to rest: a joint path there is planned round ``obstacles``, "
            "and followed in place of ``targets``.",
        ),
    ] = None
    goals: Annotated[
        list[Goal] | None,
        Meaning(
            "Goals that are reached one after the other, in place of ``goal``; at some of them "
            "``arm.payload`` may be attached or released, see their key ``action``.",
        ),
    ] = None
    law: Annotated[
        dict[str, Any],
        Meaning("``kind`` and the fields of a law, without those that arm and task determine."),
    ]
    level: Annotated[
        str,
        Meaning(
            "``kinematic``: the arm follows its command exactly. ``dynamic``: it has mass, "
            "motors and contact. ``torque``: torques that the law commands move it.",
        ),
    ] = "kinematic"
    plant: Annotated[
        PlantSettings | None,
        Meaning("Simulation and motor settings of the arm, at the levels that have a plant."),
    ] = None
    environment: Annotated[
        dict[str, Any] | None,
        Meaning(
            "``kind`` and the fields of the surface that the tool presses against, see "
            "`drake_rnn.environments`.",
        ),
    ] = None
    obstacles: Annotated[
        list[Any] | None,
        Meaning(
            "What the arm is to stay clear of, each with its ``kind`` and fields, see "
            "`drake_rnn.robot.clearance.obstacles`, and itself, also if the list is empty. A law "
            "with the field ``avoidance`` avoids them, any with ``safety.collisions``; of others "
            "the distance is measured. By default distances are not looked at.",
        ),
    ] = None
    detour: Annotated[
        DetourSettings | None,
        Meaning(
            "How an arm that is stuck before ``obstacles`` goes round, back to its path; by "
            "default it waits. An empty mapping has all defaults.",
        ),
    ] = None
    second: Annotated[
        dict[str, Any] | None,
        Meaning(
            "Another arm beside this one: ``base``, where it stands, and keys of an experiment "
            "of its own; those left out are as in this document. With ``follows`` its path goes "
            "along with this arm's tool. Needs ``obstacles``.",
        ),
    ] = None
    safety: Annotated[
        SafetySettings | None,
        Meaning(
            "What is kept of the command, whatever the law is; by default the law's command is "
            "taken as it is.",
        ),
    ] = None
    force: Annotated[ForceProfile | None, Meaning("Desired pressing force.")] = None
    sensor: Annotated[
        SensorSettings | None,
        Meaning("Force sensor; by default an ideal one."),
    ] = None
    sensing: Annotated[
        SensingSettings | None,
        Meaning("Measurement of the joints that the law sees; by default an ideal one."),
    ] = None
    camera: Annotated[
        ToolCamera | None,
        Meaning(
            "Camera that sees points on the tool, for a law that sees their pixels in place of "
            "the end effector's position; the path is then what these points are to be seen on.",
        ),
    ] = None
    faults: Annotated[list[JointLock] | None, Meaning("Joints that lock during the run.")] = None
    period: Annotated[
        _Period | None,
        Meaning("Sampling period of the controller; give either this or ``integrator``.", unit="s"),
    ] = None
    integrator: Annotated[
        IntegratorSettings | None,
        Meaning("Integrator of the law's continuous reading; give either this or ``period``."),
    ] = None
    start: Annotated[
        Vector | str | None,
        Meaning(
            "Start posture, shape (n,), or the name of a posture of the arm's files; by default "
            "the arm's home posture.",
            unit="rad",
        ),
    ] = None
    on_unreachable: Annotated[
        Literal["refuse", "project", "follow"],
        Meaning(
            "What to do if no self-motion leads to the target posture: ``refuse``, or "
            "``project`` the target to the nearest posture that can be reached. What to do about "
            "a path out of reach: ``refuse``, or ``follow`` it as far as law and limits let the "
            "arm.",
        ),
    ] = "refuse"
    limits: Annotated[
        dict[str, Any] | str,
        Meaning(
            "Bounds that override the arm's, by the names of `drake_rnn.JointLimits`, one number "
            "for all joints or one per joint; or ``none`` for no limits at all; or the name of "
            "shipped limits that replace the arm's, such as ``fr3`` or ``fer``.",
        ),
    ] = Field(default_factory=dict)
    dither: Annotated[DitherSettings | None, Meaning("Excitation of the joints.")] = None
    disturbance: Annotated[
        DisturbanceSettings | None,
        Meaning("Velocities that the joints make besides those commanded."),
    ] = None
    filter: Annotated[
        FilterSettings | None,
        Meaning(
            "Filter of the law's command, so that the arm keeps the bounds of ``limits`` up to "
            "the highest order given.",
        ),
    ] = None
    feedback: Annotated[
        Feedback | None,
        Meaning(
            "Arm that the law sees: ``commanded``, the one that the filtered command moves; "
            "``unfiltered``, a virtual one that the law's unfiltered command moves; or "
            "``measured``, the true one. By default ``commanded`` at the kinematic level without "
            "``sensing``, otherwise ``measured``.",
        ),
    ] = None
    seed: Annotated[Seed, Meaning("Seed of all random numbers.")] = 0
    duration: Annotated[Positive, Meaning("Duration of the run.", unit="s")]
    window: Annotated[
        tuple[NonNegative, Positive] | None,
        Meaning(
            "Start and end of the time in which errors are evaluated; by default the whole run.",
            unit="s",
        ),
    ] = None
    settling_tolerance_m: Annotated[
        Positive,
        Meaning("Position error below which the arm has settled.", unit="m"),
    ] = 1e-3
    log_period: Annotated[
        Positive,
        Meaning("Sampling period of the stored series; metrics use every step.", unit="s"),
    ] = _LOG_PERIOD
    accept: Annotated[
        dict[str, Acceptance],
        Meaning("Bounds that metrics are expected to keep, by metric."),
    ] = Field(default_factory=dict)
    over: Annotated[
        dict[str, list[Any]],
        Meaning("Values that a sweep runs by default, by dotted key."),
    ] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_names()
        self._check_times()
        self._check_goals()
        for metric in self.accept:
            if metric not in METRICS.names:
                raise ValueError(
                    f"accept.{metric}: no such metric; {nearest(metric, list(METRICS.names))}"
                )
        for key in self.over:
            if not self.over[key]:
                raise ValueError(f"over.{key}: must have one value or more, not []")
            first, names = key.split(".")[0], list(field_names(type(self)))
            if first not in names:
                raise ValueError(f"over.{key}: no such key; {nearest(first, names)}")

    def _check_names(self) -> None:
        require_folder_name("name", self.name)
        if self.level not in BODIES:
            raise ValueError(f"level: may be {', '.join(BODIES)}, not {self.level!r}")
        if isinstance(self.task, str) and self.task not in TASKS:
            raise ValueError(
                f"task: may be {', '.join(TASKS)}, or a list of objectives, not {self.task!r}"
            )

    def _check_goals(self) -> None:
        if self.goals is not None and not self.goals:
            raise ValueError("goals: must have one goal or more, not []")

    def _check_times(self) -> None:
        if self.period is not None and self.integrator is not None:
            raise ValueError("period: cannot be combined with integrator; give one of them")
        if self.period is None and self.integrator is None:
            raise ValueError("period: must be given, unless integrator is given")
        step = None if self.integrator is None else self.integrator.step
        for key, value in (("integrator.step", step), ("period", self.period)):
            if value is not None and value > self.duration:
                raise ValueError(
                    f"{key}: may be at most the duration, {self.duration:g} s, not {value:g}"
                )
        if self.log_period > max(self.duration, _LOG_PERIOD):
            raise ValueError(
                f"log_period: may be at most the duration, {self.duration:g} s, "
                f"not {self.log_period:g}"
            )
        if self.window is not None and not self.window[0] < self.window[1] <= self.duration:
            raise ValueError(
                f"window: must be two increasing times up to {self.duration:g} s, "
                f"not {list(self.window)}"
            )

    @property
    def joint_noise(self) -> JointNoise | None:
        """What is added to the joint velocities; None for nothing."""
        return self.dither or self.disturbance

    @property
    def installed_features(self) -> tuple[Feature, ...]:
        """Features of installed packages, whose sections a subclass has besides."""
        return ()

    @property
    def features(self) -> tuple[Feature, ...]:
        """All features that may be given; hosts ask them in this order."""
        return (*FEATURES, *self.installed_features)

    @property
    def further(self) -> dict[Feature, Any]:
        """Features that are given and no host names, each with the value of its section."""
        sections = (each for each in self.features if each.section is not None)
        values = {each: vars(self)[each.key] for each in sections}
        return {each: value for each, value in values.items() if value is not None}

    def contents(self) -> dict[str, Any]:
        """Return the document as plain data, without the keys that are not set."""
        # Sections that need not be given; an empty one is given, with the defaults of its keys.
        optional = {each.name for each in fields(self) if each.default is None}
        contents = {}
        for name, value in fields_of(self).items():
            empty = isinstance(value, (dict, str)) and not value
            if value is None or (empty and name not in optional):
                continue
            if name == "accept":
                value = {key: _non_defaults(bound) for key, bound in value.items()}
            else:
                value = _as_plain(value)
            contents[name] = plain(value)
        return contents

    def to_yaml(self) -> str:
        """Return the document as YAML text that reads back bit for bit."""
        return to_yaml(self.contents())

    installed = OldName("installed_features")


def _may_move(obstacle: Any) -> bool:
    """Return whether an obstacle, as a document lists it, may move."""
    return isinstance(obstacle, Mapping) and obstacle.get("speed") is not None


def combination_of(
    document: ExperimentDocument,
    kind: type[Law] | None = None,
    law: Law | None = None,
    task: Task | None = None,
) -> Combination:
    """Return what a document combines, as the table of pairs asks for it.

    Args:
        document: The document.
        kind: Class of its law; None as long as it is not known.
        law: The law; None as long as it is not known.
        task: Its task, if that has been made; its modules may be imported.
    """
    level, has_sensing = BODIES[document.level], document.sensing is not None
    task = named_task(document.task) if task is None else task
    settings, obstacles, safety = document.filter, document.obstacles, document.safety
    return Combination(
        level=level,
        drive=drive_named(document.arm),
        plant=document.plant is not None,
        task=LISTED if task.objectives else str(document.task),
        ranges=task.has_ranges,
        weights=task.has_weights,
        frames=bool(task.frames),
        pair=isinstance(document.arm, Mapping) and document.arm.get("pair") is not None,
        feedback=level.chosen_feedback(document.feedback, has_sensing=has_sensing),
        period=document.period,
        kind=kind,
        law=law,
        law_keys=document.law,
        camera=document.camera,
        faults=document.faults,
        dither=document.dither,
        disturbance=document.disturbance,
        sensing=document.sensing,
        filter=settings is not None,
        precompensate=settings is not None and settings.precompensate,
        delay_desired=settings is not None and settings.delay_desired,
        environment=document.environment is not None,
        force=document.force is not None,
        sensor=document.sensor is not None,
        admittance=document.force is not None and document.force.yields,
        moving_surface=(document.environment or {}).get("moves") is not None,
        obstacles=obstacles is not None,
        detour=document.detour is not None,
        moving=any(_may_move(each) for each in obstacles or ()),
        safety=safety is not None,
        collisions=safety is not None and safety.collisions,
        second=document.second is not None,
        follows=bool((document.second or {}).get("follows")),
        path=document.path is not None,
        targets=document.targets is not None,
        goal=document.goal is not None or document.goals is not None,
        goals=document.goals is not None,
        one_goal=document.goal is not None,
        handling=any(goal.acts for goal in document.goals or ()),
        on_unreachable=document.on_unreachable,
        further=tuple(document.further),
    )


def document_class(contents: Any) -> type[ExperimentDocument]:
    """Return the class of a document: features of installed packages may be given.

    Args:
        contents: What it holds, not yet checked.

    Raises:
        InvalidInputError: If a package offers one of its keys that cannot be loaded, or one that
            every document may have.
    """
    keys = contents if isinstance(contents, Mapping) else ()
    features = installed_features(keys, field_names(ExperimentDocument))
    return _with_installed(features) if features else ExperimentDocument


@lru_cache(maxsize=16)
def _with_installed(features: tuple[Feature, ...]) -> type[ExperimentDocument]:
    """Return the class of documents with the sections of installed features."""
    body: dict[str, Any] = {
        "__module__": __name__,
        "__doc__": ExperimentDocument.__doc__,
        "__annotations__": {},
        "__reduce__": lambda self: (_restore, (fields_of(self),)),
        "installed_features": property(lambda self: features),
    }
    name = ExperimentDocument.__name__
    return validated(_with_sections(features)(type(name, (ExperimentDocument,), body)))


def _restore(values: dict[str, Any]) -> ExperimentDocument:
    """Return a document from its fields, for another process."""
    return document_class(values)(**values)


def _non_defaults(value: Any) -> dict[str, Any]:
    values = {name: entry for name, entry in fields_of(value).items() if entry is not None}
    return {name: _as_plain(entry) for name, entry in values.items()}


def _as_plain(entry: Any) -> Any:
    if isinstance(entry, list):
        return [_as_plain(each) for each in entry]
    return _non_defaults(entry) if is_dataclass(entry) else entry
