"""Arms that several experiments share, so that model and limits are read once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..errors import InvalidInputError
from ..inputs.complaints import plain
from ..robot.arm import Arm
from ..robot.load_arm import load_arm


class Arms:
    """Arms by what a document says of them, each loaded when it is first asked for.

    An arm never changes after it was made, so experiments may share it. Files that change
    meanwhile are not read again: keep this for one batch of experiments.
    """

    def __init__(self) -> None:
        self._known: dict[str, Arm] = {}

    def of(self, description: str | Mapping[str, Any]) -> Arm:
        """Return the arm that the section ``arm`` of a document describes.

        Raises:
            InvalidInputError: If there is no such arm, or a key of it is wrong.
        """
        name = json.dumps(plain(description), sort_keys=True, default=repr)
        if name not in self._known:
            self._known[name] = _loaded(description)
        return self._known[name]


def _loaded(description: str | Mapping[str, Any]) -> Arm:
    if isinstance(description, str):
        return load_arm(description)
    fields = dict(description)
    if not isinstance(model := fields.pop("model", None), str):
        raise InvalidInputError("arm.model: must be given: a shipped arm or a model file")
    return load_arm(model, **fields)
