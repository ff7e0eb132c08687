"""The start of the command line, before anything large is imported.

- The standard streams of a command, which may be full, closed or gone: its work goes on.
- How a command ends when it is told to: by Ctrl-C, or by SIGTERM, as on a server.
- Exit statuses of commands; 0 is that of success.
"""

from __future__ import annotations

import io
import logging
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, TextIO, cast

from ..inputs.packages import import_name

#: A run failed; the input is bad; a bound that was to be checked is broken.
FAILED, BAD_INPUT, NOT_MET = 1, 2, 3
#: The command was told to end before it was done.
INTERRUPTED = 130


_STDOUT, _STDERR = 1, 2


class _Output(io.FileIO):
    """A stream that drops what it cannot write.

    Args:
        number: Number of the stream.
        trouble: Why nothing can be written to it; empty if something can.

    Attributes:
        trouble: Why something could not be written; empty if all could.
        is_left: Whether its reader wants no more, as ``head`` does.
    """

    def __init__(self, number: int, trouble: str) -> None:
        super().__init__(number, "w", closefd=False)
        self.trouble, self._closed_before, self.is_left = "", trouble, False

    def write(self, data: Any, /) -> int:
        """Write, or note why that cannot be."""
        self.trouble = self.trouble or self._closed_before
        if not self.trouble:
            try:
                return super().write(data) or 0
            except BrokenPipeError as error:
                self.is_left, self.trouble = True, str(error.strerror)
            except OSError as error:
                self.trouble = error.strerror or str(error)
        return memoryview(data).nbytes


class Streams:
    """The standard streams of this process, made safe to print to.

    Files that are opened later never take the number of a stream that was closed, to which
    libraries in other languages print.
    """

    def __init__(self) -> None:
        missing = {number for number in range(3) if not _is_open(number)}
        for _ in missing:
            # The system gives the lowest number that is free.
            os.open(os.devnull, os.O_RDWR)
        troubles = [os.strerror(9) if number in missing else "" for number in range(3)]
        self._out = _Output(_STDOUT, troubles[_STDOUT])
        sys.stdout = _text(self._out, sys.stdout)
        sys.stderr = _text(_Output(_STDERR, troubles[_STDERR]), sys.stderr)

    def status(self, status: int) -> int:
        """Say what could not be printed, and return the exit status of the command.

        Args:
            status: The status without that.
        """
        sys.stdout.flush()
        if self._out.is_left:
            # As a program that a shell ends by this signal.
            return status or 128 + signal.SIGPIPE
        if not self._out.trouble:
            return status
        sys.stderr.write(f"error stdout: {self._out.trouble}; what was to be printed is lost\n")
        sys.stderr.flush()
        return status or BAD_INPUT


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _text(raw: _Output, before: TextIO | None) -> TextIO:
    """Return a stream of text like the one before, which is None if it was closed."""
    stream = cast("io.TextIOWrapper | None", before)
    if stream is not None:
        stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if stream is None else stream.encoding,
        errors="replace" if stream is None else stream.errors,
        line_buffering=raw.fileno() == _STDERR or raw.isatty(),
    )


# The first two calls stop what is being done, and what is being written of it; the next one waits
# for nothing.
_PATIENCE = 2


@contextmanager
def interruptible() -> Iterator[None]:
    """End this process with a sentence and the status 130 if it is told to end within.

    Before a command has called `note_start` that happens at once. From then on what is being done
    is stopped by a KeyboardInterrupt, so that the command can keep what it has. A third call ends
    the process at once, even where own code catches every exception; so does a second one if
    Python has not come to the first yet, because code in another language never returns. A shell
    that starts a command in the background of a script lets it ignore Ctrl-C.
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


def note_start() -> None:
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


# What the loader says of a library that it does not find.
_MISSING = "cannot open shared object file"


def main() -> None:
    """Run the command line ``drake-rnn``.

    Modules in the current folder can be named in a document, as with ``python -m``. The folder
    comes last, so that no file in it stands in for an installed module.
    """
    streams = Streams()
    try:
        with interruptible():
            _start()
    except SystemExit as end:
        # Typer ends each command so, with a number.
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        raise SystemExit(streams.status(code)) from end.__cause__


def _start() -> None:
    if sys.argv[1:] == ["--version"]:
        # The options of two dozen commands are not needed for that.
        sys.stdout.write(import_name("drake_rnn.inputs.packages:versions_text")())
        raise SystemExit(0)
    if not sys.flags.safe_path:
        # A folder that was removed has no modules.
        with suppress(OSError):
            sys.path.append(str(Path.cwd()))
    # Figures are written to files, whatever windows the environment asks for.
    os.environ["MPLBACKEND"] = "Agg"
    # Where its cache cannot be written to, it works nevertheless, and says so at length.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    # Importing it takes long enough to be interrupted.
    try:
        import_name(f"{__package__}.commands:app")()
    except ImportError as error:
        if _MISSING not in str(error):
            raise
        library = str(error).partition(":")[0]
        sys.stderr.write(
            f"error {library}: this library of the system, which Drake needs, is missing; "
            "on Debian and Ubuntu: apt-get install libglib2.0-0 libegl1 libgl1-mesa-dri\n"
        )
        raise SystemExit(FAILED) from None
