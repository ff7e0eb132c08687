"""The best film that fits within a given file size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import InvalidInputError
from .encoding import Format, Pictures
from .timing import FilmTimes

#: Steps from one shown picture to the next: all pictures, every second one, and so on.
_STEPS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Fitted:
    """A film that fits.

    Attributes:
        contents: The bytes of its file.
        times: Times of the pictures that it has.
        quality: Its quality, in words.
        best: Whether it has the best quality and all pictures.
    """

    contents: bytes
    times: FilmTimes
    quality: str
    best: bool


def fitted(pictures: Pictures, times: FilmTimes, kind: Format, most_bytes: int) -> Fitted:
    """Return the best film whose file is no larger than ``most_bytes``.

    Pictures are left out once the quality is at its lowest; it may then be better again.

    Args:
        pictures: The pictures.
        times: Their times.
        kind: Format of the file.
        most_bytes: Size that is not exceeded.

    Raises:
        InvalidInputError: If not even the smallest film fits; the message says how large it is.
    """
    contents = b""
    for step, quality in _attempts(len(pictures), kind):
        some, kept = times.every(step)
        contents = kind.encode([pictures[k] for k in kept], some, quality)
        if len(contents) <= most_bytes:
            best = step == 1 and quality == kind.qualities[0]
            return Fitted(contents, some, f"{kind.called} {quality}", best)
    raise InvalidInputError(
        f"most_bytes: the smallest film has {len(contents)} bytes, more than {most_bytes}; "
        "allow more, or give a smaller size or fewer seconds"
    )


def _attempts(count: int, kind: Format) -> Iterator[tuple[int, int]]:
    """Yield the step between pictures and the quality of each attempt, the best film first."""
    for step in _STEPS:
        if step > 1 and count // step < 2:
            return
        for quality in kind.qualities if step == 1 else kind.qualities[1:]:
            yield step, quality
