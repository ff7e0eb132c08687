"""Schemes among obstacles: the distances that they see, and gains that are chosen for them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, ClassVar

import numpy as np

from drake_rnn import Array
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.scheme import Scheme
from peer_schemes.shapes import Shapes

#: Distance that schemes are to keep if their library has one to give [m].
MARGIN = 0.01


class ObstacleScheme(Scheme):
    """A scheme that is told what is in the way.

    Attributes:
        chosen: Its gains and margins, by name.
        grid: Values among which they were chosen, by name.
    """

    chosen: ClassVar[Mapping[str, Any]]
    grid: ClassVar[Mapping[str, Sequence[Any]]]

    @abstractmethod
    def gaps(self, q: Array) -> Array:
        """Return the distances that the library sees, in the order of `Clearance.gaps` [m]."""

    @classmethod
    def told(cls) -> str:
        """Return the setting with the values that are chosen."""
        chosen = (f"{name} {_word(value)}" for name, value in cls.chosen.items())
        return ", ".join((cls.setting, *chosen))


def settings_of(scheme: type[ObstacleScheme]) -> Iterator[type[ObstacleScheme]]:
    """Yield a scheme with each combination of the values of its grid."""
    for values in product(*scheme.grid.values()):
        chosen = dict(zip(scheme.grid, values, strict=True))
        yield type(scheme.__name__, (scheme,), {"chosen": chosen})


def gap_difference(scheme: ObstacleScheme, shapes: Shapes, postures: int = 50) -> float:
    """Return the largest difference of a scheme's distances from ours [m].

    Pairs that overlap are not compared: libraries disagree on how deep they are.

    Args:
        scheme: The scheme.
        shapes: The shapes that it was given.
        postures: Number of random postures.
    """
    task: ObstacleTask = shapes.task
    rng, limits = np.random.default_rng(0), task.arm.limits
    found = 0.0
    for q in rng.uniform(limits.position_lower, limits.position_upper, (postures, task.arm.n)):
        ours = task.clearance.gaps(q)
        found = max(found, float(np.abs(scheme.gaps(q) - ours)[ours > 0.0].max()))
    return found


def _word(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
