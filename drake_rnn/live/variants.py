"""The experiments that a page may switch between: law, Jacobian, level and noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..errors import InvalidInputError
from ..experiment import Experiment, load_experiment
from ..experiment.arms import Arms
from ..features.pairs import refuse
from ..inputs.dataclass_fields import field_names, fields_of
from ..laws import LAWS
from ..laws.checks import sampled_reading
from ..signals import DESIRED_POSITION
from ..systems import BODIES

#: Speed of obstacles that a hand may move, where the document gives none [m/s].
OBSTACLE_SPEED = 0.1
# What the law is shown where noise is switched on, and the document has none.
_NOISE = {"p_WE_noise": 1e-4}
# Keys of a document that are about a run that ends.
_OF_A_RUN = ("accept", "over", "window", "expect", "paper")
# Keys of obstacles that may move: balls, boxes and capsules.
_SOLID = {"center", "ends"}
_LEARNED, _KNOWN = "learned", "known"


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
            self._contents["obstacles"] = [
                {"speed": obstacle_speed, **each} if _SOLID & each.keys() else each
                for each in contents.get("obstacles", [])
            ]
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
                self._known[setup] = self._made(setup)
            except InvalidInputError as error:
                # The sentence alone: an error holds all that was at work where it was raised.
                self._known[setup] = str(error)
        found = self._known[setup]
        if isinstance(found, str):
            raise InvalidInputError(found)
        return found

    def offers(self, setup: Setup) -> bool:
        """Return whether there is an experiment of a setup."""
        try:
            self.experiment(setup)
        except InvalidInputError:
            return False
        return True

    def switched(self, setup: Setup, **changes: Any) -> Setup:
        """Return a setup after a switch; a law that cannot learn, or be noisy, is as it can be."""
        wanted = replace(setup, **changes)
        if "law" in changes and not self.offers(wanted):
            wanted = replace(wanted, learned=not wanted.learned)
        return wanted

    def options(self, setup: Setup) -> dict[str, list[Any]]:
        """Return what may be chosen now, by what is switched: each list holds what is set too."""
        found: dict[str, list[Any]] = {}
        for name, every in (
            ("law", list(LAWS)),
            ("learned", [False, True]),
            ("level", list(BODIES)),
            ("noisy", [False, True]),
        ):
            mine = fields_of(setup)[name]
            able = [e for e in every if self.offers(self.switched(setup, **{name: e}))]
            found[name] = able if mine in able else [mine, *able]
        return found

    def _made(self, setup: Setup) -> Experiment:
        changed = setup != self.base
        contents = self._changed(setup)
        made = load_experiment(contents, arms=self._arms)
        refuse(replace(made.combination, host="switch" if changed else "live"))
        if changed:
            self._require_switchable(made)
        if made.law.learns_jacobian != setup.learned:
            raise InvalidInputError("law: learns no Jacobian, or no other one")
        return self._kept(made, contents, changed)

    def _require_switchable(self, made: Experiment) -> None:
        """Raise an InvalidInputError if a variant cannot take over from another one."""
        if not self.kept:
            raise InvalidInputError(
                "law: varies its command between samples, so that nothing can be kept of it where "
                "another one takes over"
            )
        lacking = [] if made.law.follows_position else [DESIRED_POSITION]
        if made.contact is not None and not made.law.measures_force:
            lacking = ["normal_force", *lacking]
        if lacking:
            raise InvalidInputError(f"law: does not see {', '.join(lacking)}")

    def _changed(self, setup: Setup) -> dict[str, Any]:
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

    def _kept(self, made: Experiment, contents: Mapping[str, Any], changed: bool) -> Experiment:
        """Return an experiment whose command keeps all bounds, whatever velocity it begins with."""
        if made.safety is not None or made.document.filter is not None or _is_certain(made):
            return made
        safety: dict[str, Any] = {"collisions": self._avoids}
        # As near as the document's own law may come.
        if isinstance(avoidance := self._contents["law"].get("avoidance"), dict):
            safety["avoidance"] = avoidance
        try:
            return load_experiment({**contents, "safety": safety}, arms=self._arms)
        except InvalidInputError:
            # The document's own law can be played with as it is.
            if changed:
                raise
            return made


def _is_certain(made: Experiment) -> bool:
    """Return whether a law goes on from the state of any other one that is kept within bounds.

    It chooses from the same box and, where it avoids anything, by the same certificate, if its
    state says where it has commanded the arm to be.
    """
    period = made.document.period
    if period is None or not sampled_reading(made.law, period).knows_commanded_position:
        return False
    bounded = {name for name, bound in made.limits.bounds.items() if bound is not None}
    kept = bounded & {"velocity", "acceleration", "jerk"}
    return kept <= {*made.law.keeps}
