"""Names of what a user makes, after which folders are called."""

from __future__ import annotations

import re

from .complaints import short

# A file system takes 255 bytes, and commands put a word before a name or after it.
_MOST_BYTES = 200
_NO_FOLDER = re.compile(r"[/\\\x00-\x1f\x7f\ud800-\udfff]|^\.+$|^\s|\s$")


def require_folder_name(key: str, name: str) -> None:
    """Raise a ValueError unless a folder can be called by a name, or the name is empty.

    Args:
        key: Key of the name, for the message.
        name: The name.
    """
    if _NO_FOLDER.search(name):
        raise ValueError(f"{key}: must be a valid folder name, not {name!r}")
    if name.startswith("-"):
        raise ValueError(
            f"{key}: must not begin with -, as options of a command do, not {short(name)}"
        )
    if (size := len(name.encode())) > _MOST_BYTES:
        raise ValueError(f"{key}: may have {_MOST_BYTES} bytes, and has {size}: {short(name)}")
