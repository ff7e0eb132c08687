"""Checks of many documents of one kind, at a small part of what it costs to make them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..inputs.complaints import plain
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

# Arms with limits of their own that are kept, for documents that share them.
_MOST_KEPT = 100


class QuickCheck:
    """Checks each section of documents by itself, as far as no plant is needed for it.

    What is wrong with a key of arm, limits, start, law or path is found; whether a path is in reach
    and whether the parts fit together is not. Sections that documents share are checked once.

    Args:
        arms: Arms that were loaded before.
    """

    def __init__(self, arms: Arms | None = None) -> None:
        self._arms = Arms() if arms is None else arms
        self._kinds: dict[str, type[Law]] = {}
        self._limited: dict[str, Arm] = {}
        self._paths: set[str] = set()

    def check(self, contents: Mapping[str, Any]) -> ExperimentDocument:
        """Return the document of which these are the contents.

        Raises:
            InvalidInputError: If a key is wrong; the message names it and what it may be.
        """
        document = construct(ExperimentDocument, contents, "")
        arm = self._arm(document)
        kind = self._kind(document)
        seeks_posture = issubclass(kind, PostureLaw)
        start: Array = start_posture(arm, document.start, OUTSIDE if seeks_posture else 0.0)
        asked = _text(document.path, document.on_unreachable, seeks_posture)
        if asked not in self._paths:
            path_of(document, seeks_posture, None, True)
            self._paths.add(asked)
        make_law(document, kind, arm.limits, start)
        return document

    def _arm(self, document: ExperimentDocument) -> Arm:
        name = _text(document.arm, document.limits)
        if name not in self._limited:
            if len(self._limited) > _MOST_KEPT:
                self._limited.clear()
            self._limited[name] = limited_arm(document, self._arms)[0]
        return self._limited[name]

    def _kind(self, document: ExperimentDocument) -> type[Law]:
        # To look through what installed packages offer takes longer than all the rest.
        name = _text(document.law.get("kind"))
        if name not in self._kinds:
            self._kinds[name] = LAWS.named_by(document.law)
        return self._kinds[name]


def _text(*values: Any) -> str:
    return json.dumps([plain(value) for value in values], sort_keys=True, default=repr)
