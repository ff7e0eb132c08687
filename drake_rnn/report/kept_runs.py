"""Runs that are kept in the folder of a report, and the numbers measured from them.

- Makes the runs that claims need, and judges the claims even if some of the runs fail.
- Pictures of the runs of a report: an overview of each, and playbacks of the main ones.
"""

from __future__ import annotations

import inspect
import json
import re
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from PIL import Image

from ..claims import Claim, Claims, Criterion, Finding, Judge, Judgement, Quantity, RunSource
from ..claims.claims import quantities_of
from ..diagrams import EXPERIMENTS
from ..errors import DrakeRnnError, InvalidInputError
from ..experiment.files import stamp
from ..figures import drawable, write_figures
from ..inputs.files import json_of
from ..inputs.kinds import describe
from ..jobs.campaign import simulate_each
from ..jobs.pool import Jobs, processes_of
from ..jobs.requests import RecordStore, RunRecord, RunRequest
from ..playback import write_playback
from ..runs.folder import RECORD, written_whole
from ..runs.result import Result

#: Statuses of runs that may succeed when repeated, such as on a machine with more memory.
_FAILURES = ("failed", "killed its worker")
_CLAIMS = Path(inspect.getfile(Claims)).parent
_ROWS = "rows"
# Names of the folders of runs, one for each state of the code.
_DIGEST = re.compile("[0-9a-f]{12}")


class MissingRunError(DrakeRnnError):
    """A run that has not been made yet.

    Attributes:
        request: What is to be run.
    """

    def __init__(self, request: RunRequest) -> None:
        super().__init__(f"the run of {request.document['name']} has not been made")
        self.request = request


class KeptRuns(RunSource):
    """Runs that are read from a folder.

    Each run is found by everything that it depends on, its document and the code, and each number
    also by the functions that measure it. Runs of other code are not read.

    Args:
        folder: The folder of the report, which is created if missing.

    Attributes:
        place: Folder of the runs of this code, each in a folder of the name of its key.
        rows: Records of the runs, also of those that failed.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.place = folder / "runs" / sha256(stamp().encode()).hexdigest()[:12]
        self.rows = RecordStore(self.place / _ROWS)
        self._measured: dict[str, list[RunRequest]] = {}

    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            MissingRunError: If it has not been made.
            DrakeRnnError: If it was refused or has failed.
        """
        request = self._run(name, changes)[0]
        try:
            return Result.load(self.place / request.key)
        except InvalidInputError:
            raise MissingRunError(request) from None

    def metrics(self, name: str, changes: Mapping[str, Any] | None = None, /) -> dict[str, float]:
        """Return the metrics of an experiment with changes by dotted key.

        Raises:
            MissingRunError: If it has not been made.
            DrakeRnnError: If it was refused or has failed.
        """
        return self._run(name, changes)[1].metrics

    def measure(self, claims: Claims, quantity: Quantity) -> float:
        """Return the number that a measure gives, and keep it for the next time.

        Raises:
            MissingRunError: If a run that it looks at has not been made.
            DrakeRnnError: If one was refused or has failed.
        """
        name = _name_of(claims, quantity)
        if (number := self._earlier_number(name)) is not None:
            return number
        used = self._measured[name] = []

        def run(experiment: str, changes: Mapping[str, Any] | None = None, /) -> Result:
            used.append(self.request(experiment, changes))
            return self.run(experiment, changes)

        measure = claims.measures[str(quantity.measure)]
        value = float(measure(run, **quantity.given))
        runs = [[each.experiment, each.changes, each.key] for each in used]
        file = self._file(name)
        file.parent.mkdir(exist_ok=True)
        with written_whole(file) as stream:
            stream.write(json.dumps({"value": value, "runs": runs}))
        return value

    def used_by(self, claims: Claims, quantity: Quantity) -> list[RunRequest]:
        """Return the runs that a number was taken from; none if it has not been measured."""
        if quantity.run is not None:
            with suppress(InvalidInputError):
                return [self.request(quantity.run, quantity.set)]
            return []
        return list(self._measured.get(_name_of(claims, quantity), []))

    def remove_others(self) -> None:
        """Remove the runs that reports of other code have kept, and nothing else."""
        for folder in self.place.parent.iterdir():
            is_own = _DIGEST.fullmatch(folder.name) and (folder / _ROWS).is_dir()
            if is_own and folder != self.place:
                shutil.rmtree(folder, ignore_errors=True)

    def forget_failed(self) -> None:
        """Forget the runs that failed or cannot be read, so that they are made again."""
        for key in self.rows.all_keys():
            record = self.rows.get(key)
            if record is not None and (record.status in _FAILURES or not self._is_whole(key)):
                self.rows.forget(key)

    def _is_whole(self, key: str) -> bool:
        """Return whether the result of a run can be read; a run that was refused has none."""
        folder = self.place / key
        try:
            return not folder.is_dir() or bool(Result.load(folder))
        except InvalidInputError:
            return False

    def _run(self, name: str, changes: Mapping[str, Any] | None) -> tuple[RunRequest, RunRecord]:
        request = self.request(name, changes)
        if (record := self.rows.get(request.key)) is None:
            raise MissingRunError(request)
        record.require_complete()
        return request, record

    def _earlier_number(self, name: str) -> float | None:
        """Return a number that was measured before, if its runs are still kept."""
        try:
            contents = json_of(self._file(name))
            used = [self.request(each, changes) for each, changes, _ in contents["runs"]]
            value = float(contents["value"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if [each.key for each in used] != [key for _, _, key in contents["runs"]]:
            return None
        if not all(self.rows.get(each.key) for each in used):
            return None
        self._measured[name] = used
        return value

    def _file(self, name: str) -> Path:
        return self.place / "measured" / f"{name}.json"


def _name_of(claims: Claims, quantity: Quantity) -> str:
    """Return the name under which a measured number is kept, a digest of measure and code."""
    measure = claims.measures[str(quantity.measure)]
    parts = [measure.__module__, measure.__name__, quantity.given, _code(measure.__module__)]
    return sha256(json.dumps(parts, sort_keys=True, default=repr).encode()).hexdigest()[:32]


@cache
def _code(module: str) -> str:
    """Return a digest of a module with measures, its imports from claims, and all experiments."""
    digest = sha256()
    own = _CLAIMS / "papers" / f"{module.rpartition('.')[2]}.py"
    files = (file for file in EXPERIMENTS.rglob("*") if file.suffix in {".yaml", ".csv"})
    for file in (own, *sorted(_CLAIMS.glob("*.py")), *sorted(files)):
        if file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()


#: Papers, each with the claims that a report is about.
ClaimChoice = Sequence[tuple[Claims, Sequence[Claim]]]
#: Called with the kind of parts being made, the number that have ended, and the number of all.
Progress = Callable[[str, int, int], None]


def gather(claims: ClaimChoice, runs: KeptRuns, jobs: int, progress: Progress) -> bool:
    """Make the missing runs, and return True; return False if interrupted.

    A measure has to be tried to learn which runs it needs, so there are a few rounds. Measures of
    times come last, when nothing else is running.

    Args:
        claims: The claims.
        runs: Where runs are kept; each is when it ends.
        jobs: Number of processes; 0 for this process itself.
        progress: Called when a run has ended.
    """
    done_keys: set[str] = set()
    for with_time in (False, True):
        while missing := [
            each for each in _missing_runs(claims, runs, with_time) if each.key not in done_keys
        ]:
            total = len(done_keys) + len(missing)
            progress("runs", len(done_keys), total)

            def take(request: RunRequest, record: RunRecord, total: int = total) -> None:
                done_keys.add(request.key)
                progress("runs", len(done_keys), total)

            # A run is made again whose record is there and whose result cannot be read.
            for request in missing:
                runs.rows.forget(request.key)
            requests = [replace(each, folder=runs.place / each.key) for each in missing]
            longest = sorted(requests, key=lambda request: request.effort, reverse=True)
            if not Jobs(longest, runs.rows).run(processes_of(jobs), simulate_each, take):
                return False
    return True


def judge(claims: Claims, claim: Claim, runs: KeptRuns) -> Judgement:
    """Return the judgement of a claim; its findings name the runs and measures that failed."""
    return _PatientJudge(claims, runs).judge(claim)


class _PatientJudge(Judge):
    """A judge who goes on when a run or a measure fails."""

    def find(self, criterion: Criterion) -> Finding:
        try:
            return super().find(criterion)
        except DrakeRnnError as error:
            return Finding(criterion, False, error=str(error))
        # A fault in a measure affects only the rows of this measure.
        except Exception as error:
            return Finding(criterion, False, error=describe(error))


def _missing_runs(choice: ClaimChoice, runs: KeptRuns, with_time: bool) -> list[RunRequest]:
    """Return the runs that are missing, each once."""
    missing = {
        request.key: request
        for claims, several in choice
        for claim in several
        if with_time or not any(criterion.timed for criterion in claim.criteria)
        for request in _missing(claims, claim, runs)
    }
    return list(missing.values())


def _missing(claims: Claims, claim: Claim, runs: KeptRuns) -> Iterator[RunRequest]:
    for quantity in quantities_of(claim):
        try:
            if quantity.measure is not None:
                runs.measure(claims, quantity)
            else:
                runs.metrics(str(quantity.run), quantity.set)
        except MissingRunError as missing:
            yield missing.request
        # The findings of the claim will report the fault.
        except Exception:
            continue


#: Where a run's pictures are in its folder, as `drake-rnn run` has them.
FIGURE, PLAYBACK = "figures/overview.png", "playback.html"
_RECORD = "pictures.json"
# Frame rate of playbacks, which keeps them small [1/s].
_RATE = 32
_PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Pictures:
    """The pictures of a run.

    Attributes:
        of: Digest of the code that drew it.
        size: Width and height of the overview [pixels]; none if there is no overview.
        playback: Whether a playback was asked for; a single instant has none.
        failure: What stopped the drawing; empty if nothing did.
    """

    of: str
    size: tuple[int, ...] = ()
    playback: bool = False
    failure: str = ""


def draw_missing(
    runs: KeptRuns, keys: Sequence[str], playbacks: Collection[str], jobs: int, progress: Progress
) -> bool:
    """Draw the missing pictures, and return True; return False if interrupted.

    Args:
        runs: Where runs are kept.
        keys: Keys of the runs, of those without results too.
        playbacks: Keys of those that get a playback.
        jobs: Number of processes; 0 for this process itself.
        progress: Called when a run has been drawn.
    """
    missing = [
        RunRequest(key, {})
        for key in keys
        if (runs.place / key / RECORD).is_file()
        and not _suffices(pictures_of(runs.place / key), key in playbacks)
    ]
    if not missing:
        return True
    failures: list[str] = []

    def take(request: RunRequest, record: RunRecord) -> None:
        failures.append(request.key)
        progress("pictures", len(failures), len(missing))

    progress("pictures", 0, len(missing))
    return Jobs(missing).run(
        processes_of(jobs), partial(_draw_each, runs.place, frozenset(playbacks)), take
    )


def pictures_of(folder: Path) -> Pictures | None:
    """Return the pictures in the folder of a run; None without any, or if other code drew them."""
    try:
        contents = json_of(folder / _RECORD)
        pictures = Pictures(**{**contents, "size": tuple(contents["size"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return pictures if pictures.of == _drawing_code() else None


def _suffices(pictures: Pictures | None, playbacks: bool) -> bool:
    return pictures is not None and not pictures.failure and pictures.playback >= playbacks


def _draw_each(
    place: Path, playbacks: Collection[str], requests: Sequence[RunRequest]
) -> list[RunRecord]:
    """Draw runs one after another; the folder of a run that fails says why."""
    return [_draw(place / request.key, request.key in playbacks) for request in requests]


def _draw(folder: Path, playbacks: bool) -> RunRecord:
    size: tuple[int, ...] = ()
    failure = ""
    try:
        result = Result.load(folder)
        if "overview" in drawable(result):
            write_figures(result, (folder / FIGURE).parent, ["overview"])
            with Image.open(folder / FIGURE) as picture:
                size = picture.size
        if playbacks and result.time.size > 1:
            write_playback(result, folder / PLAYBACK, _RATE)
    except DrakeRnnError as error:
        failure = str(error)
    # A fault in a figure is that run's alone.
    except Exception as error:
        failure = describe(error)
    with written_whole(folder / _RECORD) as stream:
        stream.write(json.dumps(asdict(Pictures(_drawing_code(), size, playbacks, failure))))
    return RunRecord("failed" if failure else "complete", failure)


@cache
def _drawing_code() -> str:
    """Return a digest of the code that draws figures and playbacks."""
    digest = sha256()
    rooms = [_PACKAGE / "figures", _PACKAGE / "playback"]
    files = (file for room in rooms for file in room.rglob("*") if "__pycache__" not in file.parts)
    for file in (_PACKAGE / "colours.py", *sorted(file for file in files if file.is_file())):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
