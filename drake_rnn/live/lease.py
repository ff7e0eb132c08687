"""Who has the controls: one page at a time, and what it has sent."""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Callable
from typing import Any

from ..errors import InvalidInputError

#: A page that has not been heard of for so long loses the controls [s].
SILENCE = 5.0
#: Largest message that is read [bytes], and most settings in it.
MOST_BYTES, MOST_SETTINGS = 16384, 64
# Most presses of buttons, and names, that wait for the next slice.
_MOST_WAITING = 64


class Lease:
    """The right to set controls, which one page holds, and what it has set since the last slice.

    The page that asks first gets a key, and holds the controls until it gives them back or is
    silent for some seconds. Of what is set more than once between two slices, the last counts.
    Its methods may be called by several threads.

    Args:
        clock: Returns the time [s].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._key, self._heard = "", 0.0
        self._waiting: dict[str, Any] = {}

    def ask(self, key: str = "") -> str:
        """Return the key of a page that holds the controls from now on; empty if another does.

        Args:
            key: The key that the page had, if any.
        """
        with self._lock:
            if self._is_held and not secrets.compare_digest(key.encode(), self._key.encode()):
                return ""
            if not (self._is_held and key):
                self._key = secrets.token_urlsafe(24)
            self._heard = self._clock()
            return self._key

    def give_back(self, key: str) -> None:
        """Let another page have the controls."""
        with self._lock:
            if self._fits(key):
                self._key = ""

    def fits(self, key: str) -> bool:
        """Return whether this is the key of the page that has the controls."""
        with self._lock:
            return self._fits(key)

    def take(self, key: str, text: bytes) -> None:
        """Take a message of the page that holds the controls: a list of pairs of name and value.

        Args:
            key: The page's key.
            text: The message, as JSON.

        Raises:
            PermissionError: If that page does not hold the controls.
            InvalidInputError: If it is no such message.
        """
        with self._lock:
            if not self._fits(key):
                raise PermissionError("another page has the controls")
            self._heard = self._clock()
        settings = _read(text)
        with self._lock:
            for name, value in settings:
                if name in self._waiting or len(self._waiting) < _MOST_WAITING:
                    # What is set again comes later.
                    self._waiting.pop(name, None)
                    self._waiting[name] = value

    def taken(self) -> dict[str, Any]:
        """Return what was set since the last call, by name, in its order."""
        with self._lock:
            found, self._waiting = self._waiting, {}
            return found

    @property
    def is_held(self) -> bool:
        """Whether a page has the controls."""
        with self._lock:
            return self._is_held

    @property
    def _is_held(self) -> bool:
        return bool(self._key) and self._clock() - self._heard < SILENCE

    def _fits(self, key: str) -> bool:
        same = secrets.compare_digest(key.encode(), self._key.encode())
        return bool(self._key) and same


def _read(text: bytes) -> list[tuple[str, Any]]:
    """Return the settings of a message.

    Raises:
        InvalidInputError: If it is none.
    """
    if len(text) > MOST_BYTES:
        raise InvalidInputError(f"message: may have {MOST_BYTES} bytes, not {len(text)}")
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidInputError("message: must be JSON") from None
    if not isinstance(found, list) or len(found) > MOST_SETTINGS:
        raise InvalidInputError(f"message: must be a list of up to {MOST_SETTINGS} settings")
    for each in found:
        if not (isinstance(each, list) and len(each) == 2 and isinstance(each[0], str)):
            raise InvalidInputError("message: must be a list of pairs of name and value")
    return [(name, value) for name, value in found]
