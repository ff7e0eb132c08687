"""A run as a web page: the arm, the path it should follow and the path it traced.

The page replays the recorded postures in real time, in a loop. It is one file that needs no
network: it contains Drake's Meshcat viewer, the scene and its animation.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..errors import InvalidInputError
from ..inputs.fields import (
    checked,
    each,
    instance,
)
from ..inputs.messages import (
    drawn_of,
    short,
)
from ..runs.folder import require_output
from ..runs.result import Result
from ..runs.folder import written_whole
from .page import make_page
from .replay import replayed_motion

__all__ = ["playback_in_notebook", "write_playback"]

#: Frame rate in a notebook [1/s], which keeps its file small, and style of the frame.
_NOTEBOOK_RATE, _FRAME = 32, "width: 100%; height: 480px; border: 0"


@checked(
    result=instance(Result),
    file=instance(str, Path),
    beside=each(Result),
)
def write_playback(
    result: Result,
    file: str | Path,
    frames_per_second: int = 64,
    beside: Sequence[Result] = (),
) -> Path:
    """Write a run as an HTML page that plays by itself, without a network.

    Args:
        result: The run.
        file: File to write; an existing one is replaced.
        frames_per_second: Frame rate of the animation [1/s].
        beside: Other runs whose paths are drawn beside those of ``result``, each with its name and
            its error, in a close view. Of the arms that of ``result`` is shown.

    Returns:
        The file.

    Raises:
        InvalidInputError: If the file cannot be written, the frame rate is not a positive
            integer, a run contains no posture, or ``result`` is none.
    """
    rate = frames_per_second
    if not isinstance(rate, int) or isinstance(rate, bool) or rate < 1:
        raise InvalidInputError(f"frames_per_second: must be a positive integer, not {short(rate)}")
    file = Path(file)
    require_output(file, "playback file", "playback.html")
    with drawn_of("playback"):
        page = make_page(replayed_motion(result), rate, [replayed_motion(each) for each in beside])
    try:
        with written_whole(file) as stream:
            stream.write(page)
    except OSError as error:
        raise InvalidInputError(f"playback file {file}: {error.strerror}") from None
    return file


def playback_in_notebook(result: Result) -> str:
    """Return the playback in a frame, as HTML; nothing for a result of a single instant."""
    if result.time.size < 2:
        return ""
    page = make_page(replayed_motion(result), _NOTEBOOK_RATE)
    return f'<iframe style="{_FRAME}" srcdoc="{escape(page)}"></iframe>'
