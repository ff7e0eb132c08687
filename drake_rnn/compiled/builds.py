"""Steps in C that are found by what they are of, or built by a process beside this one.

To build a step takes seconds: JAX traces the law, and a compiler reads the source. A loop that
commands an arm does not wait for that. Until the library is there the steps are made by NumPy, in
the same arrays, and from one sample to the next by the library, equal but for rounding. A library
that was built before is found by the law's numbers and the period, without tracing, and makes the
steps from the first one on.

One build runs at a time for all processes of a user, at a low priority. It goes on when the process
that has started it ends, so that the next one finds the library.
"""

from __future__ import annotations

import fcntl
import os
import pickle
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, Literal

import numpy as np

from ..errors import DrakeRnnError, InvalidInputError
from ..inputs.files import cache_folder, cached_file, kept_file
from ..inputs.messages import fields_of, short
from ..inputs.packages import packages_of
from ..inputs.progress import telling
from ..laws.call_checks import without_checks
from ..laws.checks import Numbers
from ..laws.guard import StepInPlace
from ..laws.law import SampledReading
from ..robot.clearance import Clearance
from .library import FLAGS, LOOP_FLAGS, BuiltStep, built_step, compiler, law_step

#: How steps are made where nobody says: by NumPy, in C after a wait, or in C once it is built.
Way = Literal["never", "wait", "background"]
#: Variable of the environment that says so.
VARIABLE = "DRAKE_RNN_COMPILE"
_WAYS: tuple[Way, ...] = ("never", "wait", "background")
_PACKAGE = __package__.partition(".")[0]
# Folders of this package whose sources a traced law may depend on.
_SOURCES = ("arrays", "compiled", "inputs", "laws", "robot")
# Time between two looks for a library that is being built [s], and a build's longest time [s].
_LOOKS, _LONGEST = 0.1, 900
# Builds of a step that end without it, before it is left to NumPy.
_MOST_TRIES = 3
# By how much a build gives way to other processes.
_NICE = 5


def way_of(compiled: bool | None) -> Way:
    """Return how steps are made, of an argument ``compiled`` and of the environment.

    Raises:
        InvalidInputError: If the environment says something else.
    """
    if compiled is not None:
        return "wait" if compiled else "never"
    text = os.environ.get(VARIABLE) or "background"
    for way in _WAYS:
        if text == way:
            return way
    raise InvalidInputError(f"{VARIABLE}: may be {', '.join(_WAYS)}, not {short(text)}")


class Steps:
    """How the steps of laws are made, here and in a process that it is sent to.

    Args:
        compiled: Whether they are compiled: True to wait for the compiler, and to fail where they
            cannot be; False for NumPy; None for what the environment says, by default C as soon as
            it is built, if it can be.

    Raises:
        InvalidInputError: If the environment says something else.
    """

    def __init__(self, compiled: bool | None) -> None:
        self._way = way_of(compiled)
        self._is_asked = compiled is True
        # Steps that have been built, by the class of the reading; None of one that is left to JAX.
        self._built: dict[str, BuiltStep | None] = {}
        # Those that are not built yet, and why others never are; when they are looked for again.
        self._late: list[_LateStep] = []
        self._reason, self._due = "", 0.0
        self._source = "from the cache"

    def anew(self) -> Steps:
        """Return how steps of other numbers are made while a loop runs, which no build delays.

        Those that are compiled are made by NumPy until they are built.
        """
        steps = Steps(False)
        if self.are_compiled:
            steps._way = "background"
        return steps

    def __getstate__(self) -> dict[str, Any]:
        # A process that this is sent to looks for libraries itself.
        return {**vars(self), "_late": [], "_reason": ""}

    @property
    def are_compiled(self) -> bool:
        """Whether a compiler is asked for steps, now or beside this process."""
        return self._way != "never"

    @property
    def text(self) -> str:
        """How they are made, in a line."""
        self.look(now=True)
        if self._way == "never":
            return "NumPy"
        texts = []
        if self._built:
            is_left = None in self._built.values()
            texts.append("JAX" if is_left else f"C ({_compiler_name()}), {self._source}")
        if self._late:
            names = ", ".join(type(late.reading).__name__ for late in self._late)
            until = f"until {_compiler_name()} has built it"
            texts.append(f"NumPy {until}" if not self._built else f"{names} by NumPy {until}")
        if self._reason:
            texts.append(f"NumPy: {self._reason}")
        return "; ".join(texts)

    def bind(self, reading: SampledReading, period: float) -> StepInPlace:
        """Return the step of a reading at a period [s].

        Raises:
            InvalidInputError: If it must be compiled and cannot be.
        """
        if self._way == "never":
            return StepInPlace.by(without_checks(reading.step), reading, period)
        name = type(reading).__name__
        if name not in self._built:
            key = step_key(reading, period)
            found = None if key is None else _found_step(reading, key)
            if found is None and self._way == "wait":
                return self._by_build(reading, period, key)
            if found is None:
                return self._in_time(reading, period, key)
            self._built[name] = found
        built = self._built[name]
        if built is not None:
            return built.in_place()
        return StepInPlace.by(law_step(reading, period), reading, period)

    def _by_build(self, reading: SampledReading, period: float, key: str | None) -> StepInPlace:
        """Return a step in C, which is built now."""
        if not self._is_asked and (reason := _missing()):
            # The environment asks for a wait where there is something to wait for.
            self._reason = reason
            return StepInPlace.by(without_checks(reading.step), reading, period)
        begin = time.perf_counter()
        with telling("the steps of the law are compiled to C"):
            built = built_step(reading, period)
        self._source = f"built in {time.perf_counter() - begin:.1f} s"
        if built is not None and key is not None:
            _keep(key, built.library)
        self._built[type(reading).__name__] = built
        if built is not None:
            return built.in_place()
        return StepInPlace.by(law_step(reading, period), reading, period)

    def _in_time(self, reading: SampledReading, period: float, key: str | None) -> StepInPlace:
        """Return a step by NumPy, which is one in C once that is built, if it can be."""
        reason = _missing()
        if not reason and key is None:
            reason = "the law is of a class of one's own; compiled=True waits for the compiler"
        if reason or key is None:
            self._reason = reason
            return StepInPlace.by(without_checks(reading.step), reading, period)
        late = _LateStep(reading, period, key)
        self._late.append(late)
        step = without_checks(reading.step)
        in_place = late.built(Path()).arrays()
        x, u = in_place.x, in_place.u

        def by_numpy() -> None:
            x[:] = step(0.0, x, u, period)

        make, is_late = by_numpy, True

        def make_step() -> None:
            nonlocal make, is_late
            if is_late:
                self.look()
                if late.library is not None:
                    make = in_place.by(late.library)
                is_late = late in self._late
            make()

        self.look(now=True)
        return StepInPlace(x, u, make_step)

    def look(self, *, now: bool = False) -> None:
        """Look for libraries that are being built, at most ten times a second; start a build.

        Args:
            now: Whether to look whenever that was done last.
        """
        if not self._late or ((t := time.perf_counter()) < self._due and not now):
            return
        for late in list(self._late):
            late.look()
            if late.library is not None or late.failure:
                self._late.remove(late)
                self._reason = self._reason or late.failure
                if late.library is not None:
                    self._source = late.source
                    self._built[type(late.reading).__name__] = late.built(late.library)
        self._due = t + _LOOKS


class _LateStep:
    """A step that is being built, or is to be.

    Args:
        reading: Reading of the law.
        period: Its period [s].
        key: See `step_key`.

    Attributes:
        library: The library; None before it is built.
        source: Where it is from, in words.
        failure: Why there will be none; empty for no reason.
    """

    def __init__(self, reading: SampledReading, period: float, key: str) -> None:
        self.reading, self._period, self._key = reading, period, key
        self.library: Path | None = None
        self.failure, self.source = "", ""
        self._begin = time.perf_counter()
        self._process: subprocess.Popen[bytes] | None = None
        # What the build says on standard error, and how many there have been.
        self._said: IO[bytes] = TemporaryFile()  # noqa: SIM115
        self._tries = 0

    def built(self, library: Path) -> BuiltStep:
        """Return the step by a library."""
        return BuiltStep.of(self.reading, library)

    def look(self) -> None:
        """Look for the library, and have it built if nobody does so."""
        has_ended = self._process is not None and self._process.poll() is not None
        if self._process is not None and not has_ended:
            return
        self.library = kept_file(_name(self._key))
        if self.library is not None:
            self.source = f"built in {time.perf_counter() - self._begin:.1f} s"
            self._process = None
        elif self._process is None:
            self._start()
        elif self._process.returncode == 0 and self._tries < _MOST_TRIES:
            # Of a copy of the process that has started it, or its library was removed.
            self._process = None
        else:
            self._said.seek(0)
            lines = self._said.read().decode(errors="replace").strip().splitlines()
            status = f"its build ended with status {self._process.returncode}"
            self.failure = lines[-1] if lines else status

    def _start(self) -> None:
        """Start a build, unless another one runs; that may be the same."""
        folder = cache_folder() / "steps"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(folder / "build.lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            self.failure = f"XDG_CACHE_HOME: {folder} cannot be written: {error.strerror}"
            return
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _RUNNING[:] = [each for each in _RUNNING if each.poll() is None]
            task, self._tries = (self.reading, self._period, self._key), self._tries + 1
            self._process = _start_build(task, lock, self._said)
            # It goes on without this, and is then to be no zombie.
            _RUNNING.append(self._process)
        except BlockingIOError:
            pass
        except (OSError, TypeError, AttributeError, pickle.PicklingError) as error:
            self.failure = f"a build cannot be started: {error}"
        finally:
            os.close(lock)


_RUNNING: list[subprocess.Popen[bytes]] = []

# What a build's process does. It gives way before it imports anything.
_PROGRAM = f"""\
import os
os.nice({_NICE})
from {__name__} import build_in_process
build_in_process()
"""


def _start_build(
    task: tuple[SampledReading, float, str], lock: int, said: IO[bytes]
) -> subprocess.Popen[bytes]:
    """Return a process that builds a step, and holds a lock while it runs.

    Args:
        task: Reading of the law, its period and its key.
        lock: File descriptor of the lock.
        said: Where its standard error goes.
    """
    paths = os.pathsep.join(path for path in sys.path if path)
    surroundings = {"OMP_NUM_THREADS": "1", "JAX_PLATFORMS": "cpu", **os.environ}
    with TemporaryFile() as given:
        pickle.dump(task, given)
        given.seek(0)
        return subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM],
            stdin=given,
            stdout=subprocess.DEVNULL,
            stderr=said,
            pass_fds=(lock,),
            # Ctrl-C in a terminal is not for it.
            start_new_session=True,
            env={**surroundings, "PYTHONPATH": paths},
        )


def build_in_process() -> None:
    """Build the step that standard input names, and keep it; end with a line that says why not."""
    signal.alarm(_LONGEST)
    try:
        reading, period, key = pickle.load(sys.stdin.buffer)
        if (built := built_step(reading, period)) is None:
            raise InvalidInputError("no C compiler is found")
        cached_file(_name(key), built.library.read_bytes)
    except DrakeRnnError as error:
        sys.exit(" ".join(str(error).split()))


def _name(key: str) -> str:
    """Return the name of the file of a step by its key."""
    return f"steps/{key}.so"


def _keep(key: str, library: Path) -> None:
    """Keep a library under the key of its step, too; where that cannot be, it is built again."""
    with suppress(OSError, InvalidInputError):
        cached_file(_name(key), library.read_bytes)


def _found_step(reading: SampledReading, key: str) -> BuiltStep | None:
    """Return a step that was built before; None if there is none that can be loaded."""
    file = kept_file(_name(key))
    if file is None:
        return None
    built = BuiltStep.of(reading, file)
    try:
        built.in_place()
    except InvalidInputError:
        return None
    return built


def _missing() -> str:
    """Return why nothing can be compiled; empty if it can be."""
    try:
        if compiler() is None:
            return f"no C compiler is found: pip install {packages_of('compiler')}"
    except InvalidInputError as error:
        return str(error)
    if find_spec("jax") is None:
        return f"C needs JAX, which is not installed: pip install {packages_of('jax')}"
    return ""


def _compiler_name() -> str:
    command = compiler() or ("",)
    return "ziglang" if "ziglang" in command else Path(command[0]).name


def step_key(reading: SampledReading, period: float) -> str | None:
    """Return a text that two steps have in common only if one build in C serves both.

    Numbers that are given with each call, see `Numbers`, are not in it.

    Args:
        reading: Reading of a law.
        period: Its period [s].

    Returns:
        The text; None if the step may depend on what is not known, such as on a class of a user's
        own, whose code may change.
    """
    try:
        program = compiler()
    except InvalidInputError:
        return None
    parts = [_toolchain(), repr(program), *map(repr, (*FLAGS, *LOOP_FLAGS)), float(period).hex()]
    given = Numbers.of([reading], of_start=True).shapes
    try:
        parts += _contents("", reading, given)
    except _UnknownError:
        return None
    return sha256("\n".join(parts).encode()).hexdigest()[:32]


class _UnknownError(Exception):
    """An object may hold what is not seen."""


def _contents(place: str, value: Any, given: Mapping[str, object]) -> Iterator[str]:
    """Yield texts that together say all that there is in an object.

    Raises:
        _UnknownError: If that cannot be said.
    """
    text, parts = f"given {given[place]}" if place in given else _plain_text(value), {}
    if text is None and isinstance(value, (tuple, list)):
        parts = {str(number): part for number, part in enumerate(value)}
        text = f"{type(value).__name__} {len(value)}"
    elif text is None:
        kind = type(value)
        parts, text = fields_of(value), f"{kind.__module__}.{kind.__qualname__}"
        if not parts or not text.startswith(f"{_PACKAGE}."):
            raise _UnknownError(place)
    yield f"{place} {text}"
    for name, part in parts.items():
        yield from _contents(f"{place}.{name}".lstrip("."), part, given)


def _plain_text(value: Any) -> str | None:
    """Return what there is in a value without parts of its own; None of another one."""
    if value is None or isinstance(value, (bool, int, str)):
        return repr(value)
    if isinstance(value, float):
        return float(value).hex()
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return f"{value.dtype.str} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, Clearance):
        bases = value.arm.poses.bases
        return f"{None if bases is None else np.shape(bases)} {value.structure!r}"
    return None


@cache
def _toolchain() -> str:
    """Return what the C of a step depends on besides the law: code, packages and the machine."""
    root, digest = Path(__file__).parent.parent, sha256()
    for folder in _SOURCES:
        for file in sorted((root / folder).rglob("*.py")):
            digest.update(str(file.relative_to(root)).encode() + b"\0" + file.read_bytes())
    texts = [digest.hexdigest(), platform.machine(), platform.system(), platform.python_version()]
    for package in ("jax", "jaxlib", "numpy"):
        try:
            texts.append(version(package))
        except PackageNotFoundError:
            texts.append("")
    return " ".join(texts)
