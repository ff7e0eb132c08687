"""Pictures whose films are as large as those of a run, without a browser."""

import numpy as np
from PIL import Image

from drake_rnn.film.encoding import FilmTimes


def pictures(count: int, size: tuple[int, int] = (160, 120)) -> list[Image.Image]:
    """A square that moves over a ground with some texture, from left to right."""
    rng = np.random.default_rng(0)
    width, height = size
    ground = rng.integers(90, 160, (height, width, 3), dtype=np.uint8)
    made = []
    for k in range(count):
        picture = ground.copy()
        left = place(k, count, size)
        picture[height // 3 : height // 2, left : left + height // 6] = (213, 94, 0)
        made.append(Image.fromarray(picture))
    return made


def place(k: int, count: int, size: tuple[int, int]) -> int:
    """Left edge of the square in a picture."""
    return round(k / (count - 1) * (size[0] - size[1] // 6))


def evenly(count: int, per_second: float = 10.0, speed: float = 1.0) -> FilmTimes:
    return FilmTimes(np.arange(count) * speed / per_second, speed)
