"""Settings of a film: its contents and its largest size."""

from __future__ import annotations

from typing import Annotated, Literal

from ..errors import InvalidInputError
from ..inputs.fields import Count, NonNegative, Positive, between, validated

_Side = Annotated[Count, between(160, 3840)]


@validated
class FilmSettings:
    """Contents and largest size of a film of a run.

    Args:
        size: Width and height of its pictures [px].
        frames_per_second: Pictures in each second of the film [1/s].
        seconds: Length of the film, but for its last picture, which stands for a second [s]. A
            longer run is shown faster, and the film says how much; a shorter one as fast as it was.
        begin: Time of the run at which the film begins [s].
        end: Time of the run at which it ends [s]; by default that of the run.
        view: The whole arm, its end, or the path; by default what the playback shows first.
        theme: Light or dark ground.
        most_bytes: Size of the file that is not exceeded. Quality is lowered and pictures are left
            out until it fits.
    """

    size: tuple[_Side, _Side] = (640, 400)
    frames_per_second: Annotated[Positive, between(1.0, 60.0)] = 12.0
    seconds: Annotated[Positive, between(0.1, 600.0)] = 8.0
    begin: NonNegative = 0.0
    end: Positive | None = None
    view: Literal["arm", "close", "path"] | None = None
    theme: Literal["light", "dark"] = "light"
    most_bytes: Count = 1_500_000

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.begin:
            raise InvalidInputError(
                f"end: must be later than the beginning, {self.begin:g} s, not {self.end:g} s"
            )
