"""How a key varies: over all values of a list or range, or drawn from a distribution."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array, Count, Finite, FiniteEach, Positive, Whole, validated
from ..inputs.keys import Meaning
from ..inputs.messages import (
    nearest,
    short,
)


class Axis(ABC):
    """Values that are all run, in combination with the values of the other keys."""

    @abstractmethod
    def values_in_order(self) -> list[Any]:
        """Return the values, in their order."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of values, known without listing them."""

    @property
    def is_distinct(self) -> bool:
        """Whether no value can come twice, known without listing them."""
        return False


class Distribution(ABC):
    """Values that are drawn, one for each sample."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Any:
        """Return one value as plain data.

        Args:
            rng: Random generator of this value alone.
        """


@validated
class Values(Axis):
    """Values that are given one by one."""

    values: Annotated[list[Any], Meaning("The values.")]

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("values: must not be empty")

    def values_in_order(self) -> list[Any]:
        return self.values

    @property
    def size(self) -> int:
        return len(self.values)


@validated
class Range(Axis):
    """Values at equal distances, or in equal ratios."""

    low: Annotated[Whole | Finite, Meaning("First value.")]
    high: Annotated[Whole | Finite, Meaning("Last value.")]
    count: Annotated[
        Count,
        Meaning(
            "Number of values. The values are whole numbers if ``low``, ``high`` and the "
            "distance between two values are.",
        ),
    ]
    spacing: Annotated[
        Literal["linear", "log"],
        Meaning("``linear`` for equal distances, ``log`` for equal ratios."),
    ] = "linear"

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ValueError(f"high: must be at least low, {self.low:g}, not {self.high:g}")
        if self.spacing == "log" and self.low <= 0:
            raise ValueError(f"low: must be greater than 0 with log spacing, not {self.low:g}")

    def values_in_order(self) -> list[Any]:
        low, high, steps = self.low, self.high, max(self.count - 1, 1)
        if self.spacing == "log":
            return [float(v) for v in np.geomspace(low, high, self.count)]
        if isinstance(low, int) and isinstance(high, int) and (high - low) % steps == 0:
            return [low + (high - low) // steps * k for k in range(self.count)]
        return [float(v) for v in np.linspace(low, high, self.count)]

    @property
    def size(self) -> int:
        return self.count

    @property
    def is_distinct(self) -> bool:
        return self.low < self.high


@validated
class Grid:
    """A section of a document, some keys of which have several values."""

    fixed: Annotated[dict[str, Any], Meaning("Keys that have one value.")]
    over: Annotated[
        dict[str, list[Any]],
        Meaning(
            "Values of the other keys, by key; all combinations are run, the last key fastest.",
        ),
    ] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        for key, values in self.over.items():
            if key in self.fixed:
                raise ValueError(f"over.{key}: is also in fixed; it cannot be both")
            if not values:
                raise ValueError(f"over.{key}: must have one value or more, not []")

    def values_in_order(self) -> list[dict[str, Any]]:
        """Return the sections, in their order."""
        combinations = product(*self.over.values())
        return [{**self.fixed, **dict(zip(self.over, each, strict=True))} for each in combinations]


@validated
class Grids(Axis):
    """Sections of a document, one grid of them after the other.

    So laws are varied, each with gains of its own.
    """

    of: Annotated[list[Grid], Meaning("The grids.")]

    def __post_init__(self) -> None:
        if not self.of:
            raise ValueError("of: must not be empty")

    def values_in_order(self) -> list[Any]:
        return [section for grid in self.of for section in grid.values_in_order()]

    @property
    def size(self) -> int:
        return sum(math.prod(map(len, grid.over.values())) for grid in self.of)


@validated
class Uniform(Distribution):
    """A number, or each entry of a list, that is uniform between two bounds."""

    low: Annotated[FiniteEach, Meaning("The bounds, each a number or one for each entry.")]
    high: Annotated[FiniteEach, Meaning("The bounds, each a number or one for each entry.")]

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(rng.uniform(self.low, self.high))


@validated
class LogUniform(Distribution):
    """A number, or each entry of a list, whose logarithm is uniform."""

    low: Annotated[
        FiniteEach,
        Meaning("Bounds, greater than 0, each a number or one for each entry."),
    ]
    high: Annotated[
        FiniteEach,
        Meaning("Bounds, greater than 0, each a number or one for each entry."),
    ]

    def __post_init__(self) -> None:
        if not np.all(np.asarray(self.low) > 0):
            raise ValueError(f"low: must be greater than 0, not {short(self.low)}")
        _require_order(self.low, self.high)

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))


@validated
class Normal(Distribution):
    """A number, or each entry of a list, from a normal distribution."""

    mean: Annotated[FiniteEach, Meaning("Mean, a number or one for each entry.")]
    deviation: Annotated[FiniteEach, Meaning("Standard deviation, a number or one for each entry.")]

    def __post_init__(self) -> None:
        _require_sizes(self.mean, self.deviation, "mean", "deviation")
        if not np.all(np.asarray(self.deviation) >= 0):
            raise ValueError(f"deviation: must be at least 0, not {short(self.deviation)}")

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(rng.normal(self.mean, self.deviation))


@validated
class Integers(Distribution):
    """A whole number between two bounds, all equally likely."""

    low: Annotated[Whole, Meaning("The bounds, both included.")]
    high: Annotated[Whole, Meaning("The bounds, both included.")]

    def __post_init__(self) -> None:
        if not -(2**62) <= self.low <= self.high <= 2**62:
            raise ValueError(f"high: must be at least low, {self.low}, not {self.high}")

    def draw(self, rng: np.random.Generator) -> Any:
        return int(rng.integers(self.low, self.high, endpoint=True))


@validated
class Choice(Distribution):
    """One of some values."""

    values: Annotated[list[Any], Meaning("The values.")]
    weights: Annotated[
        list[Positive] | None,
        Meaning("Relative probabilities of the values; equal by default."),
    ] = None

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("values: must not be empty")
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(
                f"weights: must have {len(self.values)} entries, one per value, "
                f"not {len(self.weights)}"
            )

    def draw(self, rng: np.random.Generator) -> Any:
        if self.weights is None:
            return self.values[int(rng.integers(len(self.values)))]
        ends = np.cumsum(self.weights)
        return self.values[int(np.searchsorted(ends, rng.uniform(0.0, ends[-1]), "right"))]


#: Classes of variations, by ``kind``.
VARIATIONS: dict[str, type[Axis] | type[Distribution]] = {
    "values": Values,
    "range": Range,
    "grids": Grids,
    "uniform": Uniform,
    "log_uniform": LogUniform,
    "normal": Normal,
    "integers": Integers,
    "choice": Choice,
}


def variation_of(section: Any, place: str) -> Axis | Distribution:
    """Return the variation that a section of ``vary`` describes.

    Args:
        section: The section: a list of values, or a mapping with a ``kind``.
        place: Key of the section, for messages.

    Raises:
        InvalidInputError: If a key is wrong, missing or unknown.
    """
    if isinstance(section, list):
        section = {"kind": "values", "values": section}
    if not isinstance(section, Mapping):
        raise InvalidInputError(
            f"{place}: must be a list of values, or a mapping with a kind, not {short(section)}"
        )
    kind = section.get("kind")
    if kind not in VARIATIONS:
        may_be = nearest(str(kind), list(VARIATIONS))
        raise InvalidInputError(f"{place}.kind: no such kind, {kind!r}; {may_be}")
    return construct(VARIATIONS[kind], without_kind(section), place)


def _require_order(low: float | Array, high: float | Array) -> None:
    _require_sizes(low, high, "low", "high")
    if not np.all(np.asarray(low) <= np.asarray(high)):
        raise ValueError(f"high: must be at least low, {short(low)}, not {short(high)}")
    with np.errstate(over="ignore"):
        distance = np.asarray(high) - np.asarray(low)
    if not np.all(np.isfinite(distance)):
        raise ValueError("high: is too far from low for a number")


def _require_sizes(first: float | Array, second: float | Array, *names: str) -> None:
    sizes = {np.size(value) for value in (first, second) if np.ndim(value)}
    if len(sizes) > 1:
        raise ValueError(f"{names[1]}: must have as many entries as {names[0]}")


def _plain(value: Any) -> Any:
    plain = np.asarray(value, dtype=float).tolist()
    if isinstance(plain, float) and not math.isfinite(plain):
        raise InvalidInputError("vary: drew a number that is not finite")
    return plain
