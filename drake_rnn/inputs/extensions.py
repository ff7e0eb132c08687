"""Keys of a document that hold what several of its keys share, as in files of Docker Compose.

::

    x-arm: &arm {model: panda, tool: {length: 0.1}}
    arm: *arm

"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: What their names begin with.
EXTENSION = "x-"


def without_extensions(document: Any) -> Any:
    """Return the other keys of a document; what is no mapping as it is."""
    if not isinstance(document, Mapping):
        return document
    return {key: value for key, value in document.items() if not is_extension(key)}


def is_extension(key: Any) -> bool:
    """Return whether a key only holds what others share."""
    return isinstance(key, str) and key.startswith(EXTENSION)
