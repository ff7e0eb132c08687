"""How a command ends when it is told to: by Ctrl-C, or by SIGTERM, as on a server."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from .statuses import INTERRUPTED

# The first two calls stop what is being done, and what is being written of it; the next one waits
# for nothing.
_PATIENCE = 2


@contextmanager
def interruptible() -> Iterator[None]:
    """End this process with a sentence and the status 130 if it is told to end within.

    Before a command has `begun` that happens at once. From then on what is being done is stopped by
    a KeyboardInterrupt, so that the command can keep what it has. A third call ends the process at
    once, even where own code catches every exception; so does a second one if Python has not come
    to the first yet, because code in another language never returns. A shell that starts a command
    in the background of a script lets it ignore Ctrl-C.
    """
    calls = _CALLS
    try:
        calls.hear()
        yield
    except KeyboardInterrupt:
        _say("interrupted")
        raise SystemExit(INTERRUPTED) from None
    except SystemExit as end:
        if calls.count and end.code:
            raise SystemExit(INTERRUPTED) from None
        raise
    except Exception:
        # An interrupt may become another error, as in an import of compiled code.
        if not calls.count:
            raise
        _say("interrupted")
        raise SystemExit(INTERRUPTED) from None


class _Calls:
    """The signals that have told this process to end.

    Attributes:
        count: How many there were.
        begun: Whether there may be something to keep.
    """

    def __init__(self) -> None:
        self.count, self.begun = 0, False

    def hear(self) -> None:
        """Let the signals end this process, unless it was started to ignore them."""
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._answer)

    def begin(self) -> None:
        """Let the signals raise a KeyboardInterrupt from now on."""
        self.begun = True
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) == self._answer:
                _die_of_the_next(number)

    def _answer(self, number: int, frame: Any) -> None:
        self.count += 1
        if not self.begun:
            # To stop an import of compiled code in the usual way makes it complain.
            _say("interrupted")
            os._exit(INTERRUPTED)
        if self.count > _PATIENCE:
            _say("interrupted again: left at once")
            os._exit(INTERRUPTED)
        signal.signal(number, self._answer)
        _die_of_the_next(number)
        raise KeyboardInterrupt


# Of this process, as its signals are.
_CALLS = _Calls()


def begun() -> None:
    """Note that a command does what it is asked, after all that it needs has been imported."""
    _CALLS.begin()


def _die_of_the_next(number: int) -> None:
    """Let a signal end the process if it comes twice before Python can answer.

    Python answers between two of its own instructions only. The C library can install the same
    handler for a single signal, after which the next one has its usual effect.
    """
    # What needs no robot does without it.
    ctypes = import_module("ctypes")
    libc = ctypes.CDLL(None)
    try:
        install_once = libc.sysv_signal
    except AttributeError:
        # Not the C library of GNU.
        return
    for function in (libc.signal, install_once):
        function.restype, function.argtypes = ctypes.c_void_p, (ctypes.c_int, ctypes.c_void_p)
    install_once(number, libc.signal(number, None))


def _say(what: str) -> None:
    sys.stderr.write(f"{what}\n")
    sys.stderr.flush()
