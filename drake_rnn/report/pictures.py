"""Pictures of the runs of a report: an overview of each, and playbacks of the main ones."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from hashlib import sha256
from pathlib import Path

from PIL import Image

from ..campaigns import Order, Outcome
from ..campaigns.engine import carry_out
from ..errors import DrakeRnnError
from ..experiment.fingerprint import stamp
from ..figures import drawable, write_figures
from ..inputs.given_file import json_of
from ..inputs.own_code import described
from ..playback import write_playback
from ..runs.folder import RECORD
from ..runs.result import Result
from ..runs.whole_file import written_whole
from .gathering import Done, told_to, workers
from .kept_runs import KeptRuns

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
    runs: KeptRuns, keys: Sequence[str], played: Collection[str], jobs: int, done: Done
) -> bool:
    """Draw the missing pictures, and return True; return False if interrupted.

    Args:
        runs: Where runs are kept.
        keys: Keys of the runs, of those without results too.
        played: Keys of those that get a playback.
        jobs: Number of processes; 0 for this process itself.
        done: Called when a run has been drawn.
    """
    missing = [
        Order(key, {}, stamp(), "")
        for key in keys
        if (runs.place / key / RECORD).is_file()
        and not _suffices(pictures_of(runs.place / key), key in played)
    ]
    if not missing:
        return True
    done("pictures", 0, len(missing))
    perform = partial(_draw_each, runs.place, frozenset(played))
    tasks = [[order] for order in missing]
    return carry_out(tasks, perform, workers(jobs), told_to(done, "pictures", len(missing)))


def pictures_of(folder: Path) -> Pictures | None:
    """Return the pictures in the folder of a run; None without any, or if other code drew them."""
    try:
        told = json_of(folder / _RECORD)
        found = Pictures(**{**told, "size": tuple(told["size"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if found.of == _code() else None


def _suffices(found: Pictures | None, played: bool) -> bool:
    return found is not None and not found.failure and found.playback >= played


def _draw_each(place: Path, played: Collection[str], orders: Sequence[Order]) -> list[Outcome]:
    """Draw runs one after another; the folder of a run that fails says why."""
    return [_drawn(place / order.key, order.key in played) for order in orders]


def _drawn(folder: Path, played: bool) -> Outcome:
    size: tuple[int, ...] = ()
    failure = ""
    try:
        result = Result.load(folder)
        if "overview" in drawable(result):
            write_figures(result, (folder / FIGURE).parent, ["overview"])
            with Image.open(folder / FIGURE) as picture:
                size = picture.size
        if played and result.time.size > 1:
            write_playback(result, folder / PLAYBACK, _RATE)
    except DrakeRnnError as error:
        failure = str(error)
    # A fault in a figure is that run's alone.
    except Exception as error:
        failure = described(error)
    with written_whole(folder / _RECORD) as stream:
        stream.write(json.dumps(asdict(Pictures(_code(), size, played, failure))))
    return Outcome("failed" if failure else "complete", failure)


@cache
def _code() -> str:
    """Return a digest of the code that draws figures and playbacks."""
    digest = sha256()
    rooms = [_PACKAGE / "figures", _PACKAGE / "playback"]
    files = (file for room in rooms for file in room.rglob("*") if "__pycache__" not in file.parts)
    for file in (_PACKAGE / "colours.py", *sorted(file for file in files if file.is_file())):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
