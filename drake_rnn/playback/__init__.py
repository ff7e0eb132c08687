"""A run as a web page: the arm, the path it was asked to follow and the path it traced.

The page replays the recorded postures, over and over, in real time. It is one file that needs
no network: Drake's Meshcat, the scene and its animation are inside.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import InvalidInputError
from ..runs.result import Result
from .page import make_page
from .replayed_motion import replayed_motion

__all__ = ["write_playback"]


def write_playback(result: Result, file: str | Path, frames_per_second: int = 64) -> Path:
    """Write a run as an HTML page that plays by itself, without a network.

    Args:
        result: The run.
        file: Where to write; replaced if it is there.
        frames_per_second: Of the replay.

    Returns:
        The file.

    Raises:
        InvalidInputError: If the file cannot be written, the rate is no positive integer, or
            the run holds no posture.
    """
    rate = frames_per_second
    if not isinstance(rate, int) or isinstance(rate, bool) or rate < 1:
        raise InvalidInputError(f"frames_per_second: must be a positive integer, not {rate!r}")
    file = Path(file)
    page = make_page(replayed_motion(result), rate)
    try:
        file.write_text(page, encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(f"playback file {file}: {error.strerror}") from None
    return file
