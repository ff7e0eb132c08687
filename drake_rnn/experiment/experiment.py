"""An experiment: the objects made from a document, checked as a whole.

- Bounds that the metrics of a run are expected to keep.
- Doubts about a law on a robot whose own controller judges each command, such as an FR3.
- Check of whether a path is within an arm's reach, and how close it comes to its limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from types import NoneType
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..features.contact import Contact
from ..features.feature import Assumption, Guarantee, Guarantees, Moment
from ..features.filter import FilterDelay, filter_delay
from ..features.handling import Handling
from ..features.locks import JointLocks
from ..features.obstacles import ObstacleMotions, command_guarantee
from ..features.pairs import Combination
from ..features.second import Base, StandingArm, second_document, side_by_side
from ..inputs.documents import construct, without_extensions
from ..inputs.fields import Array
from ..inputs.kinds import Modules, naming, require_modules
from ..inputs.messages import metres_hint, require_type, short
from ..laws import Circumstances, Law, PostureLaw, Safety
from ..laws.checks import warnings_of
from ..measures.metric import RATIO_METRICS, violation_metric
from ..paths import JointTargets, LedPath, Path, PlacedPath
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.obstacles import Obstacle
from ..robot.kinematics import ArmKinematics
from ..robot.limits import LIMIT_UNITS, JointLimits
from ..robot.postures import LEVER, Aim, ObjectivesAim, PoseAim, damped_inverse
from ..robot.task import TASKS, Task
from ..robot.task_objectives import TaskObjective
from ..signals import DelayedPath
from ..systems import BODIES, Body, Feedback
from .components import GIVEN_KIND, Arms
from .document import Acceptance, ExperimentDocument, combination_of, document_class
from .keys import idle_keys
from .sections import Sections, read_sections, with_reachable_target


def judged_doubts(limits: JointLimits, keeps: Collection[str], period: float | None) -> list[str]:
    """Return warnings if a robot with an envelope of the velocity may refuse a law's commands.

    Such a robot also checks the jerk of the velocities that are held, from each to the next two.

    Args:
        limits: Limits of the joints.
        keeps: Names of the limits that the command keeps.
        period: Time for which a velocity is held [s]; None if the command is not sampled.
    """
    if limits.envelope is None:
        return []
    doubts = []
    if "envelope" not in keeps:
        doubts.append(
            "limits: this law does not keep the envelope of the velocity near position limits; "
            "kind: adaptive does, and so does safety around any law"
        )
    if "jerk" in keeps or limits.jerk is None or period is None:
        return doubts
    # From the largest acceleration to the opposite one within a period.
    most = 0.5 * period * limits.jerk
    has_none = limits.acceleration is None
    if (np.asarray(np.inf if has_none else limits.sides("acceleration").largest) > most).any():
        doubts.append(
            "limits: this law does not bound the jerk, and a robot that checks that of held "
            f"velocities refuses what accelerates by more than {most.min():.3g} rad/s^2, half of "
            "the jerk times the period; give limits.acceleration, a little less"
        )
    return doubts


@dataclass(frozen=True, eq=False)
class Experiment:
    """The objects that an experiment consists of.

    Attributes:
        document: The document as it was written.
        arm: The arm, with the limits of the experiment.
        law: The law.
        path: The path.
        targets: Joint targets that the law follows; None for a law that follows none.
        desired: The path placed at the start: the desired motion of the end effector.
        start: Start posture, shape (n,) [rad].
        p_WE_start: Position of the end effector at the start, shape (3,) [m].
        R_WE_start: Orientation of the end effector at the start, shape (3, 3).
        contact: Contact of the tool with a surface; None without one.
        obstacles: What stands in the arm's way.
        clearance: What the arm is to stay clear of; None if distances are not looked at.
        motions: How obstacles that may move do; None without any.
        second: The experiment of another arm beside this one; None without one. Of both, obstacles
            and distances are in the base frame of this one.
        base: Where that arm stands; None without one.
        features: What further features became, by key, see `ExperimentDocument.further`.
        guarantees: Which limits, distances and forces the command and the arm keep by construction,
            and what that rests on.
        safety: What is kept of the law's command; None if it is taken as it is.
        locks: When joints lock; None if none does.
        handling: What the arm attaches and releases on its way; None if it does not.
        feedback: Arm that the law sees.
        path_delay: Delay with which the arm follows the path [s].
        law_task: What is asked of the end effector: a named task, or a list of objectives.
        warnings: Warnings about the document and the objects.
    """

    document: ExperimentDocument
    arm: Arm
    law: Law
    path: Path
    targets: JointTargets | None
    desired: PlacedPath
    start: Array
    p_WE_start: Array
    R_WE_start: Array
    contact: Contact | None
    obstacles: tuple[Obstacle, ...]
    clearance: Clearance | None
    motions: ObstacleMotions | None
    safety: Safety | None
    locks: JointLocks | None
    handling: Handling | None
    feedback: Feedback
    path_delay: float
    law_task: Task
    warnings: tuple[str, ...] = ()
    second: Experiment | None = None
    base: Base | None = None
    features: Mapping[str, Any] = field(default_factory=dict)
    guarantees: Guarantees = field(init=False)

    def __post_init__(self) -> None:
        command = command_guarantee(self.law, self.safety)
        arm = command
        for feature in self.document.features:
            arm = feature.guarantee(arm, self)
        if self.level.has_motors:
            # It does not move as commanded, but for torques that alone act on it.
            arm = Guarantee(torque=self._torques_that_act(arm.torque))
        assumptions: dict[str, tuple[Assumption, ...]] = {}
        stated: dict[str, float] = {}
        for feature in self.document.features:
            stated |= feature.stated(self)
            for name, group in feature.assumptions(self).items():
                assumptions[name] = (*assumptions.get(name, ()), *group)
        wrong = [
            name for name in arm.names if any(e.holds is False for e in assumptions.get(name, ()))
        ]
        arm = arm.without(wrong)
        for name in {*command.names, *arm.names}:
            assumptions[name] = (*assumptions.get(name, ()), *self._common_assumptions(name, arm))
        object.__setattr__(self, "guarantees", Guarantees(command, arm, assumptions, stated))

    def _common_assumptions(self, name: str, arm: Guarantee) -> tuple[Assumption, ...]:
        """Return what a promise rests on whatever features there are."""
        # Of a robot it is not known what it does with a command, nor when.
        actual = 0.0 if self.level.is_simulated else None
        assumptions = [Assumption("velocity at the start", 0.0, "rad/s", actual)]
        if self.document.period is not None:
            assumptions.append(Assumption("lateness of a sample", 0.0, "s", actual))
        if arm.has(name) and name != "torque":
            assumptions.append(
                Assumption("deviation of the arm from its command", 0.0, "rad", actual)
            )
        return tuple(assumptions)

    def _torques_that_act(self, bounds: tuple[float, ...] | None) -> tuple[float, ...] | None:
        """Return bounds of commanded torques if the arm keeps them within its own limits."""
        follows = bounds is None or self.level.follows_command
        return None if follows or (np.array(bounds) > self.arm.effort).any() else bounds

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return self.document.name

    def last_lap(self, until: float, delay: float | None = None) -> float | None:
        """Return the time at which the last whole lap of a run began [s]; None without one.

        Args:
            until: Time at which the run ends [s].
            delay: Delay with which the path is followed [s]; by default ``path_delay``.
        """
        delay = self.path_delay if delay is None else delay
        began = self.desired.last_lap(until - delay)
        # The first lap begins with the run, whatever the delay.
        return began + delay if began is not None and began > 0.0 else began

    @property
    def limits(self) -> JointLimits:
        """Joint limits of the experiment, those of its arm."""
        return self.arm.limits

    def with_path(self, path: Path | Trajectory) -> Experiment:
        """Return the same experiment along another path, made in Python or a Drake trajectory.

        Raises:
            InvalidInputError: As `make_experiment` does.
        """
        return make_experiment(self.document, path)

    @property
    def moments(self) -> list[Moment]:
        """Times at which something happens, in order, each with its name in figures and pages."""
        moments_of_features = (
            moment for each in self.document.features for moment in each.moments(self)
        )
        return sorted(moments_of_features, key=lambda moment: moment.time)

    @property
    def combination(self) -> Combination:
        """What it combines, as the table of pairs asks for it; its host is a diagram."""
        features = combination_of(self.document, type(self.law), self.law, self.law_task)
        return replace(features, moving=self.motions is not None)

    @property
    def keeps(self) -> tuple[str, ...]:
        """Former name of ``guarantees.command.limits``; deprecated."""
        _warn_of_name("keeps", "guarantees.command.limits")
        return self.guarantees.command.limits

    @property
    def keeps_distance(self) -> float | None:
        """Former name of ``guarantees.command.distance``; deprecated."""
        _warn_of_name("keeps_distance", "guarantees.command.distance")
        return self.guarantees.command.distance

    @property
    def kept_limits(self) -> tuple[str, ...]:
        """Former name of ``guarantees.arm.limits``; deprecated."""
        _warn_of_name("kept_limits", "guarantees.arm.limits")
        return self.guarantees.arm.limits

    @property
    def commanded_limits(self) -> tuple[str, ...]:
        """Former name of ``guarantees.command_only``; deprecated."""
        _warn_of_name("commanded_limits", "guarantees.command_only")
        return self.guarantees.command_only

    @property
    def target(self) -> Array | None:
        """Target posture of the law, shape (n,) [rad]; None without one."""
        return self.law.target if isinstance(self.law, PostureLaw) else None

    @property
    def holds_orientation(self) -> bool:
        """Whether the end effector is to keep its orientation, or to turn along with its path."""
        return self.task.with_orientation or self.law.follows_orientation

    @property
    def task(self) -> Task:
        """Axes of the position, and perhaps the orientation, along which errors are measured."""
        return self.law_task.measured

    @property
    def level(self) -> type[Body]:
        """Class of the body that simulates the arm."""
        return BODIES[self.document.level]


def _warn_of_name(name: str, place: str) -> None:
    """Warn that an attribute of an experiment has moved, once for each line that reads it."""
    text = f"Experiment.{name} is deprecated; read Experiment.{place}"
    warn(text, DeprecationWarning, stacklevel=3)


def make_experiment(
    document: Mapping[str, Any] | ExperimentDocument,
    path: Path | Trajectory | None = None,
    *,
    modules: Modules = True,
    arms: Arms | None = None,
    law: Law | None = None,
) -> Experiment:
    """Return the experiment that a document describes, checked as a whole.

    Args:
        document: The document, or its contents as plain data.
        path: Path made in Python, or a trajectory of Drake's, in place of the document's; the
            experiment's document then only says that one was given.
        modules: Modules that may be imported for a ``kind`` of the form ``module:Class``: True for
            any, False for none, or their names. What has been imported already may be used.
        arms: Arms that were loaded for other experiments; what is missing is added.
        law: Law in place of the document's, as it is, of a saved run whose own law is not known.

    Raises:
        InvalidInputError: If a key is wrong; the message names it, its value and what it may be.
    """
    require_type("arms", arms, Arms, NoneType)
    require_modules(modules)
    document = _check(document, path)
    arms = Arms() if arms is None else arms
    require_type("law", law, Law, NoneType)
    parts = read_sections(document, arms, path, modules, law)
    document, delay = parts.document, _delay(parts)
    law, target_warnings = with_reachable_target(parts) if law is None else (law, [])
    start, kinematics = parts.start, arms.share("kinematics", document.arm, parts.arm.kinematics)
    desired = _place(parts.path.placed_by(kinematics, start), law, parts.task)
    experiment = Experiment(
        document=document,
        arm=parts.arm,
        law=law,
        path=parts.path,
        targets=parts.targets,
        desired=desired,
        start=start,
        p_WE_start=kinematics.p_WE(start),
        R_WE_start=kinematics.R_WE(start),
        contact=parts.contact and parts.contact.along(desired, document.duration),
        obstacles=parts.obstacles,
        clearance=parts.clearance,
        motions=parts.motions,
        safety=parts.safety,
        locks=parts.locks,
        handling=parts.handling,
        feedback=parts.feedback,
        path_delay=delay.path,
        law_task=parts.task.at(kinematics.R_WE(start), kinematics, start),
        features=_make_features(document, parts),
    )
    idle = idle_keys(document, law=law, path=parts.path, arm=parts.arm.description)
    doubts = _doubts(experiment, delay, kinematics)
    experiment = replace(
        experiment, warnings=(*parts.warnings, *_far(experiment), *idle, *target_warnings, *doubts)
    )
    return experiment if document.second is None else _beside(experiment, modules, arms)


def _require_moved(experiment: Experiment, kinematics: ArmKinematics) -> None:
    """Raise an InvalidInputError if no joint moves what a law is to move."""
    if experiment.target is not None or experiment.targets is not None:
        return
    J = experiment.law_task.valued.J(kinematics, experiment.start)
    if np.abs(J).max(initial=0.0) <= _MOVED:
        arm = experiment.arm
        raise InvalidInputError(
            f"start: no joint moves the task at the start: at {short(experiment.start)} each axis "
            f"of {', '.join(arm.joints)} leaves {arm.frame!r} where it is; give another start, "
            "arm.frame, arm.joints or task"
        )


def _doubts(experiment: Experiment, delay: FilterDelay, kinematics: ArmKinematics) -> list[str]:
    """Return what features, the law and a robot that judges its commands are in doubt about."""
    _require_moved(experiment, kinematics)
    document, law = experiment.document, experiment.law
    unsure = [doubt for each in document.features for doubt in each.doubts(experiment)]
    circumstances = _circumstances(experiment, delay, kinematics)
    unsure += warnings_of(law, "doubts", lambda: law.doubts(circumstances))
    keeps = experiment.guarantees.command.limits
    return [*unsure, *judged_doubts(experiment.limits, keeps, document.period)]


def _make_features(document: ExperimentDocument, parts: Sections) -> dict[str, Any]:
    """Return what the features of installed packages make of their sections, by their keys."""
    features = {}
    for each, value in document.further.items():
        with naming(f"{type(each).__name__}.make", key=each.key, own=type(value)):
            features[each.key] = each.make(value, parts)
    return features


# Distance from the tool at which a path may begin without a warning [m].
_AWAY = 0.05


def _far(experiment: Experiment) -> list[str]:
    """Return a warning if a path that has a place of its own begins far from the tool."""
    if not experiment.path.has_place:
        return []
    way = experiment.desired.position(0.0)[0] - experiment.p_WE_start
    away = float(np.linalg.norm(way[list(experiment.task.axes)]))
    if away <= _AWAY:
        return []
    return [
        f"path: begins {away:.3g} m from where the tool is at the start; the arm goes there first, "
        "at once and along no path"
    ]


def _place(path: PlacedPath, law: Law, task: Task) -> PlacedPath:
    """Return the path, which must not turn if its law cannot see that."""
    if path.turns and not (law.sees_turning or task.sees_turning):
        raise InvalidInputError(
            "path: carries an orientation, which this law does not see; give task: pose, or a law "
            "with the input R_WE_desired, or leave the orientation out"
        )
    return path


def _check(
    document: Mapping[str, Any] | ExperimentDocument, path: Path | Trajectory | None
) -> ExperimentDocument:
    """Return a document with its own fields checked, which says if a path is given besides."""
    if not isinstance(document, ExperimentDocument):
        section = without_extensions(document)
        document = construct(document_class(section), section, "")
    return document if path is None else replace(document, path=GIVEN_KIND)


def _beside(experiment: Experiment, modules: Modules, arms: Arms) -> Experiment:
    """Return an experiment with that of the second arm beside it.

    Raises:
        InvalidInputError: If the second arm's section is wrong, or the two do not fit together.
    """
    document, base, follows = second_document(experiment.document)
    try:
        other = make_experiment(document, modules=modules, arms=arms)
    except InvalidInputError as error:
        raise InvalidInputError(f"second: {error}") from None
    assert experiment.clearance is not None
    assert other.clearance is not None
    one, two = side_by_side(
        StandingArm(experiment.law, experiment.clearance, experiment.start, experiment.limits),
        StandingArm(other.law, other.clearance, other.start, other.limits),
        base,
        experiment.document.period,
    )
    warnings = (*experiment.warnings, *(f"second: {text}" for text in other.warnings))
    other = replace(other, law=two.law, clearance=two.clearance, motions=experiment.motions)
    if follows:
        ways = (other.desired, experiment.desired)
        led_path = LedPath(*ways, experiment.arm, experiment.p_WE_start, base.R.T)
        other = replace(other, desired=led_path)
        if other.task.with_orientation:
            positions = " or ".join(
                name for name, task in TASKS.items() if not task.with_orientation
            )
            raise InvalidInputError(f"second.follows: needs task: {positions}")
    return replace(
        experiment, law=one.law, clearance=one.clearance, second=other, base=base, warnings=warnings
    )


def _delay(parts: Sections) -> FilterDelay:
    """Return the delays that a filter causes."""
    document, limits = parts.document, parts.arm.limits
    keeps = command_guarantee(parts.law, parts.safety).limits
    times = document.period, document.duration
    return filter_delay(document.filter, parts.feedback, keeps, limits, *times)


def _circumstances(
    experiment: Experiment, delay: FilterDelay, kinematics: ArmKinematics
) -> Circumstances:
    """Return what a law may have doubts about."""
    path, contact, document = experiment.desired, experiment.contact, experiment.document
    offset = velocity = J = None
    if experiment.target is None:
        position = experiment.task.position
        p_start, v_start, _ = path.position(0.0)
        offset, velocity = position(p_start - experiment.p_WE_start), position(v_start)
        J = position(kinematics.J(experiment.start))
    return Circumstances(
        loop_delay=delay.loop,
        reference_is_delayed=delay.path > 0.0,
        pressing_force=None if contact is None else contact.force.value,
        path_turns=path.turns,
        start_offset=offset,
        start_velocity=velocity,
        J=J,
        task_J=None if document.camera else lambda q: experiment.law_task.valued.J(kinematics, q),
        period=document.period,
        duration=document.duration,
    )


class CountedLimit(NamedTuple):
    """A limit that may hold by construction: how it is judged in a run.

    Attributes:
        name: Its name in `Guarantee.names`.
        metric: Metric that it is judged by.
        within: What this keeps where the limit is not broken, up to rounding: the difference
            quotient of a motion at its bound carries rounding errors.
        is_bounded: Returns whether any joint of an experiment has it.
        share: Metric of the share of its bound that is used; empty if there is none.
        others: Further metrics of it.
        guaranteed: Returns what the metric keeps if the arm keeps the limit by construction; by
            default ``within``.
        beside_moving: Metric that it is judged by where obstacles may move; empty for ``metric``.
    """

    name: str
    metric: str
    within: Acceptance
    is_bounded: Callable[[Experiment], bool]
    share: str = ""
    others: tuple[str, ...] = ()
    guaranteed: Callable[[Experiment], Acceptance] | None = None
    beside_moving: str = ""

    def metric_of(self, experiment: Experiment) -> str:
        """Return the metric that it is judged by in an experiment."""
        return (experiment.motions is not None and self.beside_moving) or self.metric

    def bound_of(self, experiment: Experiment) -> Acceptance:
        """Return what the metric keeps in an experiment where the limit holds by construction."""
        return self.within if self.guaranteed is None else self.guaranteed(experiment)

    def judged_by(self, experiment: Experiment) -> Acceptance:
        """Return what the metric keeps in an experiment where the limit is not broken."""
        has_own = self.name == "distance" or (
            self.name == "torque" and experiment.guarantees.arm.has(self.name)
        )
        return self.bound_of(experiment) if has_own else self.within

    def excess(self, experiment: Experiment, metrics: Mapping[str, float]) -> tuple[float, str]:
        """Return by how much a run exceeds the limit, 0 if it does not, and the unit of that.

        Args:
            experiment: What was run.
            metrics: Its metrics.
        """
        value, guarantees = metrics.get(self.metric_of(experiment), np.nan), experiment.guarantees
        if np.isnan(value) or self.judged_by(experiment).holds(value):
            return 0.0, ""
        if self.name == "force":
            return (value - 1.0) * guarantees.stated["force"], "N"
        if self.name == "distance":
            return (guarantees.command.distance or 0.0) - value, "m"
        if self.name == "torque":
            return value - (self.judged_by(experiment).at_most or 0.0), ""
        return metrics.get(violation_metric(self.name), 0.0), LIMIT_UNITS[self.name]


def _has_range(experiment: Experiment) -> bool:
    limits = experiment.limits
    return bool(np.isfinite(limits.position_upper - limits.position_lower).any())


def _has_bound(name: str) -> Callable[[Experiment], bool]:
    def is_bounded(experiment: Experiment) -> bool:
        bound = experiment.limits.bounds[name]
        return bound is not None and bool(np.isfinite(bound).any())

    return is_bounded


def _kept_torque(experiment: Experiment) -> Acceptance:
    share = torque_share_bound(experiment)
    assert share is not None
    return Acceptance(at_most=share * EXCESS_RATIO)


def _kept_distance(experiment: Experiment) -> Acceptance:
    return Acceptance(at_least=(experiment.guarantees.command.distance or 0.0) - _ROUNDING)


#: Excess of a distance that is rounding [m].
_ROUNDING = 1e-9
#: Ratio above which a bound counts as broken; secants at a bound have rounding errors.
EXCESS_RATIO = 1.0 + 1e-9
_WITHIN = Acceptance(at_most=EXCESS_RATIO)
# Rounding of velocities is in their third and fourth differences over 10 ms by 1e6 and 1e8 times.
_WITHIN_ROUNDED = {
    "snap": Acceptance(at_most=1.0 + 1e-7),
    "crackle": Acceptance(at_most=1.0 + 1e-5),
}
#: The limits that may hold by construction, in the order in which they are shown: guarantees,
#: verdicts, bars and lines of a bound follow from these. Those of derivatives and of torques are
#: judged by ratios, because joints may differ in their limits.
COUNTED_LIMITS = {
    each.name: each
    for each in (
        CountedLimit(
            *("position", "joint_limit_margin_min_rad", Acceptance(at_least=-1e-9), _has_range),
            others=(violation_metric("position"),),
            guaranteed=lambda experiment: Acceptance(at_least=0.0),
        ),
        *(
            CountedLimit(
                *(name, ratio, _WITHIN_ROUNDED.get(name, _WITHIN), _has_bound(name), ratio),
                others=(violation_metric(name),),
            )
            for name, ratio in RATIO_METRICS.items()
        ),
        CountedLimit(
            *("envelope", violation_metric("envelope"), Acceptance(at_most=1e-9)),
            lambda experiment: experiment.limits.envelope is not None,
            share="envelope_ratio_max",
            others=("envelope_margin_min_rad_s",),
        ),
        CountedLimit(
            *("torque", "torque_ratio_max", _WITHIN),
            lambda experiment: (
                experiment.law.commands_torque and bool(np.isfinite(experiment.arm.effort).any())
            ),
            share="torque_ratio_max",
            guaranteed=_kept_torque,
        ),
        # An obstacle may run into an arm at rest, which no command prevents.
        CountedLimit(
            *("distance", "distance_min_m", Acceptance(at_least=-_ROUNDING)),
            lambda experiment: experiment.guarantees.command.distance is not None,
            guaranteed=_kept_distance,
            beside_moving="distance_moving_min_m",
        ),
        CountedLimit(
            *("force", "normal_force_ratio_max", _WITHIN),
            lambda experiment: "force" in experiment.guarantees.stated,
            share="normal_force_ratio_max",
        ),
    )
}


def expected_bounds(experiment: Experiment) -> dict[str, Acceptance]:
    """Return the bounds on metrics: the document's, and those of the limits that the law keeps.

    Of limits, those are expected to be kept that the law or a filter behind it keeps by
    construction, and a largest force that the document states, whether it is promised or not. A
    document may ask for less than is promised; the promise stays.
    """
    guarantees, asked = experiment.guarantees, experiment.document.accept
    bounds = {
        limit.metric_of(experiment): limit.bound_of(experiment)
        for limit in COUNTED_LIMITS.values()
        if limit.is_bounded(experiment)
        and (guarantees.arm.has(limit.name) or limit.name in guarantees.stated)
    }
    return bounds | {name: _both(bound, bounds.get(name)) for name, bound in asked.items()}


def _both(asked: Acceptance, promised: Acceptance | None) -> Acceptance:
    """Return a bound with what it misses of one that is promised."""
    if promised is None:
        return asked
    least = [each for each in (asked.at_least, promised.at_least) if each is not None]
    most = [each for each in (asked.at_most, promised.at_most) if each is not None]
    low, high = max(least, default=None), min(most, default=None)
    # A document may ask for more than can be, as that a bound is passed.
    if low is not None and high is not None and low > high:
        return asked
    return Acceptance(at_least=low, at_most=high)


def torque_share_bound(experiment: Experiment) -> float | None:
    """Return the share of its joints' limits of torque that an arm keeps; None without one."""
    torques, most = experiment.guarantees.arm.torque, experiment.arm.effort
    has_limit = np.isfinite(most)
    if torques is None or not has_limit.any():
        return None
    return float((np.array(torques)[has_limit] / most[has_limit]).max())


_SAMPLES, _MOST_SAMPLES = 400, 10_000
# Largest distance between two points on a long path [m].
_SPACING = 0.01
#: Distance from its path that a posture may miss it by [m].
MISS = 1e-3
# Largest entry of a row of J that is no more than rounding [m].
_MOVED = 1e-12


@dataclass(frozen=True)
class Reach:
    """A path followed by damped least squares from the start posture, at k points.

    Attributes:
        time: Time of each point, shape (k,) [s].
        position: Joint positions, shape (k, n) [rad].
        miss: Distance from the path, shape (k,) [m]; if the orientation matters, or other
            objectives do, including their errors, angles [rad] times a lever of 0.2 m.
        singular_value: Smallest singular value of J, whose rotations are weighted, shape (k,) [m].
        velocity: Joint velocities J^+ v_WE_desired, shape (k, n) [rad/s].
        acceleration: Time derivative of ``velocity``, shape (k, n) [rad/s^2].
        desired: Points of the path, shape (k, m) [m].
    """

    time: Array
    position: Array
    miss: Array
    singular_value: Array
    velocity: Array
    acceleration: Array
    desired: Array


def follow(experiment: Experiment, samples: int = _SAMPLES, whole: bool = True) -> Reach:
    """Follow the experiment's path by inverse kinematics while it runs, passing the path once.

    Args:
        experiment: The experiment.
        samples: Number of points; a long path gets more.
        whole: Whether all objectives of a list count, and not their positions alone.
    """
    aim_at = _aims(experiment, whole)
    times = reach_times(experiment, samples)
    # Once the path is lost, a few points suffice to find the largest miss.
    stride = math.ceil(times.size / samples)
    q = experiment.start.copy()
    time: list[float] = []
    miss: list[float] = []
    position, jacobian, velocity, points = [], [], [], []
    is_lost = False
    for number, t in enumerate(times.tolist()):
        if is_lost and number % stride:
            continue
        time.append(t)
        aim, target, valued, demand, point = aim_at(t)
        # Once the path is lost, only the distance matters, so fewer iterations suffice.
        q, distance = aim.descend(q, target, 20) if is_lost else aim.reach(q, target)
        J = valued.J(q)
        position.append(q)
        points.append(point)
        miss.append(distance)
        is_lost = is_lost or distance > MISS
        jacobian.append(J)
        velocity.append(damped_inverse(J) @ demand)
    jacobians = np.array(jacobian)
    # What no joint moves, as the height of a planar arm's tool, is not lost anywhere.
    jacobians = jacobians[:, np.abs(jacobians).max(axis=(0, 2)) > _MOVED]
    return Reach(
        time=np.array(time),
        position=np.array(position),
        miss=np.array(miss),
        singular_value=np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, -1]),
        velocity=np.array(velocity),
        acceleration=np.gradient(np.array(velocity), np.array(time), axis=0),
        desired=np.array(points),
    )


class _Aimed(NamedTuple):
    """What is to be reached at a time.

    Attributes:
        aim: What it is.
        target: Its target.
        valued: The same without ranges, which ask for no velocity.
        demand: The velocity of the latter, as `Aim.error` [m/s].
        point: The point of the path, shape (m,) [m].
    """

    aim: Aim
    target: Array
    valued: Aim
    demand: Array
    point: Array


def _aims(experiment: Experiment, whole: bool) -> Callable[[float], _Aimed]:
    """Return what is to be reached, by time.

    Args:
        experiment: The experiment.
        whole: Whether all objectives of a list count, and not their positions alone.
    """
    rows, path, task = list(experiment.task.axes), experiment.desired, experiment.law_task
    kinematics = experiment.arm.kinematics()
    # In contact the path lies on the surface.
    shift = np.zeros(3)
    if experiment.contact is not None:
        shift = experiment.contact.surface.gap * experiment.contact.surface.normal_W
    objectives, valued = (ObjectivesAim(kinematics, each) for each in (task, task.valued))
    timed = DelayedPath(path)

    def objectives_at(t: float) -> _Aimed:
        demand = valued.levers * valued.task.desired(timed, t)[1]
        point = path.position(t)[0][rows]
        return _Aimed(objectives, task.desired(timed, t)[0], valued, demand, point)

    def pose_at(t: float) -> _Aimed:
        p, v, _ = path.position(t)
        R, w = None, np.zeros(0)
        if experiment.holds_orientation:
            R, w, _ = path.orientation(t)
        aim, point = PoseAim(kinematics, rows, R), (p - shift)[rows]
        return _Aimed(aim, point, aim, np.concatenate((LEVER * w, v[rows])), point)

    return objectives_at if whole and task.objectives else pose_at


def reach_times(experiment: Experiment, samples: int = _SAMPLES) -> Array:
    """Return the times at which a path is followed, shape (k,) [s].

    Args:
        experiment: The experiment.
        samples: Number of times; a long path gets more.
    """
    end = min(experiment.desired.traversal, experiment.document.duration)
    position = experiment.desired.position
    points = np.array([position(t)[0] for t in np.linspace(0.0, end, samples).tolist()])
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if not math.isfinite(length):
        raise InvalidInputError(f"path: must have a finite length, not {length} m")
    return np.linspace(0.0, end, min(max(samples, math.ceil(length / _SPACING)), _MOST_SAMPLES))


class Forecast(NamedTuple):
    """A warning about a path that a run may prove wrong.

    Attributes:
        text: The warning.
        limit: Limit that the path asks the arm to exceed; None for any other warning.
    """

    text: str
    limit: str | None = None


def check_reach(experiment: Experiment) -> list[str]:
    """Return the experiment's warnings, then those about its path.

    Raises:
        InvalidInputError: As `forecasts` does.
    """
    require_type("experiment", experiment, Experiment)
    return [*experiment.warnings, *(forecast.text for forecast in forecasts(experiment))]


def forecasts(experiment: Experiment) -> list[Forecast]:
    """Return warnings about the experiment's path.

    The posture of a redundant arm is not unique: limits that the least-squares posture meets may
    be avoidable, so they cause a warning, not an error.

    Raises:
        InvalidInputError: If inverse kinematics misses the path by more than 1 mm, or the motors
            are too weak for the pressing force.
    """
    # Joints that are told where to go need no inverse kinematics.
    if experiment.target is not None or experiment.targets is not None:
        return []
    _require_within_task(experiment)
    reach = follow(experiment)
    worst = int(np.argmax(reach.miss))
    apart = list[Forecast]()
    if reach.miss[worst] > MISS and experiment.law_task.objectives:
        # Objectives that cannot all be met have prices; a path out of reach is another fault.
        apart = [Forecast(_unmet(experiment, reach))]
        reach = follow(experiment, whole=False)
        worst = int(np.argmax(reach.miss))
    if reach.miss[worst] > MISS:
        first = int(np.argmax(reach.miss > MISS))
        place = ", ".join(f"{value:.4g}" for value in reach.desired[first])
        text = (
            f"path: out of reach: {experiment.arm.name} misses the point ({place}) m, at "
            f"t = {reach.time[first]:.4g} s, by {reach.miss[first] * 1e3:.3g} mm; "
            f"the largest miss is {reach.miss[worst]:.3g} m at t = {reach.time[worst]:.4g} s"
        )
        text += metres_hint(float(reach.miss[worst]))
        if experiment.document.on_unreachable == "follow":
            return [Forecast(text)]
        raise InvalidInputError(text)
    _require_torque(experiment, reach)
    places = [*_near_limits(experiment, reach), *_near_singular(experiment, reach)]
    return [*apart, *map(Forecast, places), *_beyond_bounds(experiment, reach)]


def _name_of(objective: TaskObjective) -> str:
    """Return what an objective is called in a message: with its frame, of two tools."""
    return objective.text if objective.of is None else f"{objective.of}'s {objective.text}"


def _unmet(experiment: Experiment, reach: Reach) -> str:
    """Return the warning that no posture near those before it meets all objectives."""
    first, worst = int(np.argmax(reach.miss > MISS)), int(np.argmax(reach.miss))
    task, aimed = experiment.law_task, _aims(experiment, whole=True)(float(reach.time[worst]))
    left = aimed.aim.error(reach.position[worst], aimed.target)
    ends = np.cumsum([each.size for each in task.objectives])[:-1]
    missed = zip(task.objectives, map(np.linalg.norm, np.split(left, ends)), strict=True)
    shares = [
        f"{_name_of(each)} by " + (f"{size / LEVER:.2g} rad" if each.turns else f"{size:.2g} m")
        for each, size in missed
        if size > 0.1 * MISS
    ]
    return (
        f"task: followed from the start, it cannot all be met from t = {reach.time[first]:.4g} s "
        f"on: the nearest posture at t = {reach.time[worst]:.4g} s misses {', '.join(shares)}; "
        "another start may lead all along it"
    )


def _near_limits(experiment: Experiment, reach: Reach) -> list[str]:
    limits = experiment.limits
    margin = np.minimum(
        reach.position - limits.position_lower, limits.position_upper - reach.position
    )
    k, joint = np.unravel_index(np.argmin(margin), margin.shape)
    left = float(margin[k, joint])
    if left >= 0.05:
        return []
    name, unit = experiment.arm.joints[joint], experiment.arm.units[joint]
    place = f"comes within {left:.3g} {unit} of" if left >= 0 else f"goes {-left:.3g} {unit} beyond"
    return [f"path: {name} {place} its limit near t = {reach.time[k]:.3g} s"]


def _near_singular(experiment: Experiment, reach: Reach) -> list[str]:
    k = np.argmin(reach.singular_value)
    if reach.singular_value[k] >= 0.05:
        return []
    turns = experiment.holds_orientation or any(b.turns for b in experiment.law_task.blocks)
    # The metric singular_value_min does not weigh rotations.
    weighting = f" with rotations weighted by {LEVER:g} m" if turns else ""
    return [
        f"path: near-singular posture near t = {reach.time[k]:.3g} s: smallest singular value of J"
        f"{weighting} {reach.singular_value[k]:.3g}"
    ]


def _beyond_bounds(experiment: Experiment, reach: Reach) -> list[Forecast]:
    warnings = []
    for article, name, per, demand in (
        ("a", "velocity", "/s", reach.velocity),
        ("an", "acceleration", "/s^2", reach.acceleration),
    ):
        bound = experiment.limits.toward(name, demand)
        if bound is None:
            continue
        bound = np.broadcast_to(bound, demand.shape)
        ratio = np.abs(demand) / bound
        k, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
        if ratio[k, joint] > 1.0:
            text = (
                f"path: asks {experiment.arm.joints[joint]} for {article} {name} of "
                f"{ratio[k, joint] * bound[k, joint]:.3g} {experiment.arm.units[joint]}{per} "
                f"near t = {reach.time[k]:.3g} s; "
                f"its limit is {bound[k, joint]:.3g}"
            )
            warnings.append(Forecast(text, name))
    return warnings


def _require_torque(experiment: Experiment, reach: Reach) -> None:
    """Raise an InvalidInputError if the motors cannot hold gravity and the pressing force."""
    if experiment.contact is None or not experiment.level.has_motors:
        return
    kinematics, effort = experiment.arm.kinematics(), experiment.arm.effort
    most = max(experiment.contact.force.value, experiment.contact.force.initial)
    force = most * experiment.contact.surface.normal_W
    for t, q in zip(reach.time, reach.position, strict=True):
        torque = np.abs(kinematics.gravity(q) + kinematics.J(q).T @ force)
        weakest = int(np.argmax(torque - effort))
        if torque[weakest] > effort[weakest]:
            unit = "N" if experiment.arm.units[weakest] == "m" else "Nm"
            raise InvalidInputError(
                f"force.value: {most:g} N asks {experiment.arm.joints[weakest]} "
                f"for {torque[weakest]:.4g} {unit} near t = {t:.3g} s; its motor has "
                f"{effort[weakest]:g} {unit}"
            )


def _require_within_task(experiment: Experiment) -> None:
    """Raise an InvalidInputError if a planar task would silently ignore part of its path."""
    # What a list of objectives leaves free is left free on purpose.
    if experiment.law_task.objectives:
        return
    axes = [axis for axis in range(3) if axis not in experiment.task.axes]
    extent = np.ptp(experiment.desired.sample(50)[:, axes], axis=0).max(initial=0.0)
    if extent > 1e-9:
        raise InvalidInputError(
            f"path: leaves the plane of task {experiment.document.task} by {extent:.3g} m; "
            "give a path in that plane"
        )
