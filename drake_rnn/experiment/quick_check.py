"""Checks of many documents of one kind, at a small part of what it costs to make them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..inputs.documents import construct
from ..inputs.fields import Array
from ..laws import LAWS, Law, PostureLaw
from ..robot.arm import Arm
from ..systems import start_posture
from .arms import Arms
from .document import ExperimentDocument
from .experiment import OUTSIDE, limited_arm
from .law import make_law
from .path import path_of


@dataclass(frozen=True)
class Checked:
    """A document of which each section is right by itself.

    Attributes:
        document: The document.
        law: Its law.
        arm: Its arm, with the limits of the experiment.
    """

    document: ExperimentDocument
    law: Law
    arm: Arm


class QuickCheck:
    """Checks each section of documents by itself, as far as no plant is needed for it.

    What is wrong with a key of arm, limits, start, law or path is found; whether a path is in reach
    and whether the parts fit together is not. Sections that documents share are checked once.

    Args:
        arms: Arms that were loaded before.
    """

    def __init__(self, arms: Arms | None = None) -> None:
        self._arms = Arms() if arms is None else arms

    def check(self, contents: Mapping[str, Any]) -> Checked:
        """Return what is made of the document of which these are the contents.

        Raises:
            InvalidInputError: If a key is wrong; the message names it and what it may be.
        """
        document, arms = construct(ExperimentDocument, contents, ""), self._arms
        arm, _ = limited_arm(document, arms)
        # To look through what installed packages offer takes longer than all the rest.
        kind = arms.shared("kind", document.law.get("kind"), lambda: LAWS.named_by(document.law))
        seeks_posture = issubclass(kind, PostureLaw)
        start: Array = start_posture(arm, document.start, OUTSIDE if seeks_posture else 0.0)
        arms.shared(
            "path",
            [document.path, document.on_unreachable, seeks_posture],
            lambda: path_of(document, seeks_posture, None, True),
        )
        return Checked(document, make_law(document, kind, arm.limits, start), arm)
