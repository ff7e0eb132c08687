"""The time of each picture in the run, and how long the film shows the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .settings import FilmSettings

#: Pictures that are kept until the film fits [bytes]: three of a point of a picture.
_MOST_MEMORY = 1.5e9
#: Time for which the last picture stands, so that a film that begins again can be read [s].
LAST = 1.0


@dataclass(frozen=True)
class FilmTimes:
    """The times of a film's pictures.

    Attributes:
        shown: Time of each picture in the run, shape (f,) [s].
        speed: How much faster than the run the film is.
    """

    shown: Array
    speed: float

    def every(self, step: int) -> tuple[FilmTimes, list[int]]:
        """Return the times and the numbers of each ``step``-th picture, and of the last one."""
        last = len(self.shown) - 1
        kept = sorted({*range(0, last, step), last})
        return FilmTimes(self.shown[kept], self.speed), kept

    def durations(self, unit: float) -> list[int]:
        """Return how long each picture is shown, in units of time that its format counts in.

        Rounding does not add up: each picture comes at its time, to half a unit.

        Args:
            unit: The unit [s].
        """
        begins = np.append(self.shown - self.shown[0], self.shown[-1] - self.shown[0])
        begins = begins / self.speed
        begins[-1] += LAST
        ticks: list[int] = np.diff(np.rint(begins / unit).astype(int)).tolist()
        return ticks


def film_times(duration: float, settings: FilmSettings) -> FilmTimes:
    """Return the times of a film's pictures, evenly from its beginning to its end.

    Args:
        duration: Duration of the run [s].
        settings: What the film shows.

    Raises:
        InvalidInputError: If the run is shorter than what should be shown of it, or the film would
            have too many pictures.
    """
    begin = settings.begin
    end = duration if settings.end is None else settings.end
    for name, time in (("begin", begin), ("end", end)):
        if time > duration * (1.0 + 1e-9):
            raise InvalidInputError(f"{name}: the run ends at {duration:g} s, before {time:g} s")
    if begin >= end:
        raise InvalidInputError(f"begin: must be before the end, {end:g} s, not {begin:g} s")
    speed = max(1.0, (end - begin) / settings.seconds)
    count = max(2, round((end - begin) / speed * settings.frames_per_second) + 1)
    width, height = settings.size
    if (memory := 3.0 * count * width * height) > _MOST_MEMORY:
        raise InvalidInputError(
            f"film: {count} pictures of {width}x{height} take {memory / 1e9:.1f} GB of memory; "
            "give a smaller size, fewer frames per second or fewer seconds"
        )
    return FilmTimes(np.linspace(begin, end, count), speed)
