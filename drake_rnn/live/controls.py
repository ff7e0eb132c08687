"""What a page may set: controls by name, each of which checks what it is given.

- The gains of a law that a page may change while it runs, and between which ends.
- The experiments that a page may switch between: law, Jacobian, level and noise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..experiment.components import Arms
from ..experiment.document import ExperimentDocument
from ..experiment.keys import acting_keys
from ..features.pairs import refuse
from ..inputs.fields import rows_of_numbers
from ..inputs.messages import field_names, fields_of, is_number, short
from ..laws import LAWS, Law
from ..laws.checks import sampled_reading
from ..signals import DESIRED_POSITION
from ..systems import BODIES, SampledController


@dataclass(frozen=True)
class Control(ABC):
    """A control.

    Attributes:
        label: What the page calls it.
        meaning: What it does, as a sentence; empty if the label says it.
    """

    label: str
    meaning: str = field(default="", kw_only=True)

    #: What it is to the page.
    kind = ""

    @abstractmethod
    def read(self, value: Any) -> Any:
        """Return what a value from outside means.

        Raises:
            ValueError: If it is no value of this control; the message says what it must be.
        """

    def set(self, value: Any) -> Control:
        """Return the control with a value that `read` has returned."""
        return self

    def as_data(self) -> dict[str, Any]:
        """Return the control as the page reads it."""
        return {"kind": self.kind, "label": self.label, "meaning": self.meaning}


@dataclass(frozen=True)
class Slider(Control):
    """A number between two ends, on a logarithmic scale.

    Attributes:
        low, high: The ends, greater than 0.
        value: What it is.
        unit: SI unit.
    """

    low: float
    high: float
    value: float
    unit: str = ""

    kind = "slider"

    def read(self, value: Any) -> float:
        """See `Control.read`; a number beyond an end is that end."""
        if not is_number(value):
            raise ValueError("must be a finite number")
        return float(min(max(float(value), self.low), self.high))

    def set(self, value: Any) -> Slider:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        numbers = {"low": self.low, "high": self.high, "value": self.value, "unit": self.unit}
        return super().as_data() | numbers


@dataclass(frozen=True)
class Switch(Control):
    """What is on or off.

    Attributes:
        value: Whether it is on.
    """

    value: bool

    kind = "switch"

    def read(self, value: Any) -> bool:
        """See `Control.read`."""
        if not isinstance(value, bool):
            raise ValueError("must be true or false")
        return value

    def set(self, value: Any) -> Switch:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"value": self.value}


@dataclass(frozen=True)
class Choice(Control):
    """One of several names.

    Attributes:
        options: The names.
        value: The one that is chosen.
    """

    options: tuple[str, ...]
    value: str

    kind = "choice"

    def read(self, value: Any) -> str:
        """See `Control.read`."""
        if not isinstance(value, str) or value not in self.options:
            raise ValueError(f"may be {', '.join(self.options)}")
        return value

    def set(self, value: Any) -> Choice:
        """See `Control.set`."""
        return replace(self, value=value)

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"options": list(self.options), "value": self.value}


@dataclass(frozen=True)
class Button(Control):
    """What is pressed."""

    kind = "button"

    def read(self, value: Any) -> None:
        """See `Control.read`; it takes no value."""
        if value is not None:
            raise ValueError("takes no value; give null")


@dataclass(frozen=True)
class Handle(Control):
    """A point that is dragged.

    Attributes:
        center: Middle of the ball within which it may be dragged [m].
        radius: Radius of that ball [m].
        place: Scene path of what is dragged.
    """

    center: tuple[float, float, float]
    radius: float
    place: str

    kind = "handle"

    def read(self, value: Any) -> Any:
        """See `Control.read`; a point beyond the ball is the nearest one of it."""
        rows = rows_of_numbers([value], 3)
        if rows is None:
            raise ValueError("must be three finite numbers")
        middle = np.array(self.center)
        away = rows[0] - middle
        # A number may be so large that its square is none.
        size = float(np.abs(away).max()) or 1.0
        length = size * float(np.linalg.norm(away / size))
        return middle + away * min(1.0, self.radius / length) if length else middle

    def as_data(self) -> dict[str, Any]:
        """See `Control.as_data`."""
        return super().as_data() | {"place": self.place}


def read_message(controls: Mapping[str, Control], name: Any, value: Any) -> Any:
    """Return what a message from outside sets a control to.

    Raises:
        InvalidInputError: If there is no such control, or it does not take this value.
    """
    if not isinstance(name, str) or name not in controls:
        raise InvalidInputError(f"{short(name)}: there is no such control")
    try:
        return controls[name].read(value)
    except OverflowError:
        raise InvalidInputError(f"{name}: must be a finite number, not {short(value)}") from None
    except ValueError as error:
        raise InvalidInputError(f"{name}: {error}, not {short(value)}") from None


# Factor from a gain to its ends, unless the law allows less, and how often the way there is halved.
_FACTOR, _HALVES = 30.0, 6
_PREFIX = "law."


def gains_of(
    law: Law, controller: SampledController, document: ExperimentDocument
) -> dict[str, Slider]:
    """Return a slider for each gain of a law: its numbers greater than 0, as far as it allows them.

    Keys that do nothing in this experiment, or follow from its other sections, have no slider.

    Args:
        law: The law.
        controller: Controller that runs it, or one with other gains.
        document: Document of the experiment.
    """
    gains = {}
    keys = acting_keys(document, "law", law)
    values = {**fields_of(law), **{k: v for k, v in law.loop_gains.items() if k in fields_of(law)}}
    for name, value in values.items():
        if name not in keys:
            continue
        if isinstance(value, bool) or not isinstance(value, Real) or isinstance(value, int):
            continue
        if (start := float(value)) > 0.0:
            low, high = (
                _farthest(law, controller, name, start, start * factor)
                for factor in (1.0 / _FACTOR, _FACTOR)
            )
            if low < high:
                texts = {"unit": keys[name].unit, "meaning": keys[name].meaning}
                label = name.replace("_", " ")
                gains[_PREFIX + name] = Slider(label, low=low, high=high, value=start, **texts)
    return gains


def with_gain(law: Law, control: str, value: float) -> Law:
    """Return a law with another value of a gain, by the name of its slider.

    Raises:
        InvalidInputError: If the law does not allow it.
    """
    changes: dict[str, object] = {control.removeprefix(_PREFIX): value}
    changed_law: Law = replace(law, **changes)  # type: ignore[type-var]
    return changed_law


def _farthest(
    law: Law, controller: SampledController, name: str, start: float, end: float
) -> float:
    """Return the value farthest on the way from a start to an end that the law allows."""

    def allows(value: float) -> bool:
        try:
            controller.read(with_gain(law, name, value))
        except (InvalidInputError, ValueError):
            return False
        return True

    if allows(end):
        return end
    good, bad = start, end
    for _ in range(_HALVES):
        middle = sqrt(good * bad)
        if allows(middle):
            good = middle
        else:
            bad = middle
    return good


#: Speed of obstacles that a hand may move, where the document gives none [m/s].
OBSTACLE_SPEED = 0.1
# What the law is shown where noise is switched on, and the document has none.
_NOISE = {"p_WE_noise": 1e-4}
# Keys of a document that are about a run that ends.
_OF_A_RUN = ("accept", "over", "window", "expect", "paper")
# Keys of obstacles that may move: balls, boxes and capsules.
_SOLID = {"center", "ends"}
_LEARNED, _KNOWN = "learned", "known"


def with_speed(obstacles: Sequence[Mapping[str, Any]], speed: float) -> list[Mapping[str, Any]]:
    """Return obstacles of a document that a hand may move.

    Args:
        obstacles: The obstacles.
        speed: Speed of those that have none [m/s].
    """
    return [{"speed": speed, **each} if _SOLID & each.keys() else each for each in obstacles]


@dataclass(frozen=True)
class Setup:
    """What is switched while an experiment runs.

    Attributes:
        law: Kind of the law.
        learned: Whether it learns its Jacobian.
        level: Level of the arm.
        noisy: Whether the law sees noise.
    """

    law: str
    learned: bool
    level: str
    noisy: bool


class Variants:
    """The variants of an experiment.

    A law that may leave another one's state behind it is made safe (`drake_rnn.laws.safety`): it is
    kept within the bounds of the joints, and clear of what the experiment's own law avoids, from
    whatever velocity it takes over.

    Attributes:
        document: The document.
        kept: Whether the bounds of the joints are kept whatever is switched. Where they are not,
            because of a filter or of a command that varies between samples, nothing is switched.

    Args:
        experiment: The experiment.
        obstacle_speed: Speed of obstacles that the document lets stand still and the law avoids
            [m/s]; 0 to leave them where they are.

    Raises:
        InvalidInputError: If it cannot be played with; the message says why.
    """

    def __init__(self, experiment: Experiment, obstacle_speed: float = OBSTACLE_SPEED) -> None:
        refuse(replace(experiment.combination, host="live"))
        self._arms = Arms()
        contents = experiment.document.contents()
        self._contents = {k: v for k, v in contents.items() if k not in _OF_A_RUN}
        self._avoids = experiment.guarantees.command.distance is not None
        if self._avoids and obstacle_speed > 0.0:
            self._contents["obstacles"] = with_speed(contents.get("obstacles", []), obstacle_speed)
        self.document = document = experiment.document
        self.base = Setup(
            law=str(contents["law"]["kind"]),
            learned=experiment.law.learns_jacobian,
            level=document.level,
            noisy=document.sensing is not None,
        )
        self._known: dict[Setup, Experiment | str] = {}
        self.kept = True
        first = self.experiment(self.base)
        self.kept = first.safety is not None or _is_certain(first)

    def experiment(self, setup: Setup) -> Experiment:
        """Return the experiment of a setup.

        Raises:
            InvalidInputError: If there is none.
        """
        if setup not in self._known:
            try:
                self._known[setup] = self._make(setup)
            except InvalidInputError as error:
                # The sentence alone: an error holds all that was at work where it was raised.
                self._known[setup] = str(error)
        known_experiment = self._known[setup]
        if isinstance(known_experiment, str):
            raise InvalidInputError(known_experiment)
        return known_experiment

    def offers(self, setup: Setup) -> bool:
        """Return whether there is an experiment of a setup."""
        try:
            self.experiment(setup)
        except InvalidInputError:
            return False
        return True

    def switch(self, setup: Setup, **changes: Any) -> Setup:
        """Return a setup after a switch; a law that cannot learn, or be noisy, is as it can be."""
        new_setup = replace(setup, **changes)
        if "law" in changes and not self.offers(new_setup):
            new_setup = replace(new_setup, learned=not new_setup.learned)
        return new_setup

    def options(self, setup: Setup) -> dict[str, list[Any]]:
        """Return what may be chosen now, by what is switched: each list holds what is set too."""
        choices: dict[str, list[Any]] = {}
        for name, every in (
            ("law", list(LAWS)),
            ("learned", [False, True]),
            ("level", list(BODIES)),
            ("noisy", [False, True]),
        ):
            mine = fields_of(setup)[name]
            able = [e for e in every if self.offers(self.switch(setup, **{name: e}))]
            choices[name] = able if mine in able else [mine, *able]
        return choices

    def _make(self, setup: Setup) -> Experiment:
        differs = setup != self.base
        contents = self._document_of(setup)
        experiment = load_experiment(contents, arms=self._arms)
        refuse(replace(experiment.combination, host="switch" if differs else "live"))
        if differs:
            self._require_switchable(experiment)
        if experiment.law.learns_jacobian != setup.learned:
            raise InvalidInputError("law: learns no Jacobian, or no other one")
        return self._keep_bounds(experiment, contents, differs)

    def _require_switchable(self, experiment: Experiment) -> None:
        """Raise an InvalidInputError if a variant cannot take over from another one."""
        if not self.kept:
            raise InvalidInputError(
                "law: varies its command between samples, so that nothing can be kept of it where "
                "another one takes over"
            )
        lacking = [] if experiment.law.follows_position else [DESIRED_POSITION]
        if experiment.contact is not None and not experiment.law.measures_force:
            lacking = ["normal_force", *lacking]
        if lacking:
            raise InvalidInputError(f"law: does not see {', '.join(lacking)}")

    def _document_of(self, setup: Setup) -> dict[str, Any]:
        """Return the contents of the document of a setup."""
        base, contents = self.base, dict(self._contents)
        law = dict(contents["law"]) if setup.law == base.law else {"kind": setup.law}
        fields = field_names(LAWS[setup.law]) if setup.law in LAWS else ()
        if (setup.law, setup.learned) != (base.law, base.learned) and "jacobian" in fields:
            law["jacobian"] = _LEARNED if setup.learned else _KNOWN
        contents["law"] = law
        if setup.level != base.level:
            contents["level"] = setup.level
            for key in ("plant", "feedback"):
                contents.pop(key, None)
        if setup.noisy != base.noisy:
            contents.pop("sensing", None)
            contents.pop("feedback", None)
            if setup.noisy:
                contents["sensing"] = dict(_NOISE)
        if not setup.learned and base.learned:
            contents.pop("dither", None)
        return contents

    def _keep_bounds(
        self, experiment: Experiment, contents: Mapping[str, Any], differs: bool
    ) -> Experiment:
        """Return an experiment whose command keeps all bounds, whatever velocity it begins with."""
        if (
            experiment.safety is not None
            or experiment.document.filter is not None
            or _is_certain(experiment)
        ):
            return experiment
        safety: dict[str, Any] = {"collisions": self._avoids}
        # As near as the document's own law may come.
        if isinstance(avoidance := self._contents["law"].get("avoidance"), dict):
            safety["avoidance"] = avoidance
        try:
            return load_experiment({**contents, "safety": safety}, arms=self._arms)
        except InvalidInputError:
            # The document's own law can be played with as it is.
            if differs:
                raise
            return experiment


def _is_certain(experiment: Experiment) -> bool:
    """Return whether a law goes on from the state of any other one that is kept within bounds.

    It chooses from the same box and, where it avoids anything, by the same certificate, if its
    state says where it has commanded the arm to be.
    """
    period = experiment.document.period
    if period is None or not sampled_reading(experiment.law, period).knows_commanded_position:
        return False
    names = {name for name, bound in experiment.limits.bounds.items() if bound is not None}
    derivatives = names & {"velocity", "acceleration", "jerk"}
    return derivatives <= {*experiment.law.keeps}
