"""Arms and other parts that several experiments share, so that each is made only once."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ..errors import InvalidInputError
from ..inputs.complaints import plain
from ..inputs.documents import construct
from ..robot.arm import Arm
from ..robot.link_error_settings import LinkErrorSettings
from ..robot.load_arm import load_arm

T = TypeVar("T")

# Largest number of arms, and of parts of each kind, that are kept: a plant takes up to 1 MB.
_MOST_KEPT = 20


class Arms:
    """Arms by their descriptions in documents, each loaded when it is first needed.

    An arm never changes after it was made, so experiments may share it; the same holds for paths,
    limits and classes of laws. A file that changes later is not read again, and kinematics are
    shared too: use one object for one batch of experiments, in one thread.
    """

    def __init__(self) -> None:
        self._known: dict[str, Arm] = {}
        self._parts: dict[str, dict[str, Any]] = {}

    def of(self, description: str | Mapping[str, Any]) -> Arm:
        """Return the arm that the section ``arm`` of a document describes.

        Raises:
            InvalidInputError: If there is no such arm, or a key of it is wrong.
        """
        if isinstance(description, Mapping) and description.get("link_errors") is not None:
            # There may be thousands of link errors, and adding them to a loaded arm is quick.
            rest = {key: value for key, value in description.items() if key != "link_errors"}
            errors = construct(LinkErrorSettings, description["link_errors"], "arm.link_errors")
            return self.of(rest).with_link_errors(errors)
        return _kept(self._known, _text(description), lambda: _loaded(description))

    def shared(self, part: str, said: Any, make: Callable[[], T]) -> T:
        """Return a part of an experiment, made once for all documents that describe the same part.

        Args:
            part: Kind of the part.
            said: Everything that the part depends on, as plain data.
            make: Function that makes the part.
        """
        return _kept(self._parts.setdefault(part, {}), _text(said), make)


def _kept(known: dict[str, Any], text: str, make: Callable[[], T]) -> T:
    """Return what is kept under a text, made if it is not there; the oldest goes if there are many.

    What is asked for again becomes the newest.
    """
    found: T = known.pop(text) if text in known else make()
    while len(known) >= _MOST_KEPT:
        del known[next(iter(known))]
    known[text] = found
    return found


def _text(said: Any) -> str:
    return json.dumps(plain(said), sort_keys=True, default=repr)


def _loaded(description: str | Mapping[str, Any]) -> Arm:
    if isinstance(description, str):
        return load_arm(description)
    fields = dict(description)
    if not isinstance(model := fields.pop("model", None), str):
        raise InvalidInputError("arm.model: must be given: a shipped arm or a model file")
    return load_arm(model, **fields)
