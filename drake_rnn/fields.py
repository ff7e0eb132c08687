"""Arguments that check themselves, in Python and in a YAML file alike."""

from __future__ import annotations

from typing import Annotated, Any, dataclass_transform

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field
from pydantic.dataclasses import dataclass

Array = NDArray[np.float64]


def _vector(value: Any) -> Array:
    """A read-only copy, so that whoever holds it can rely on it."""
    if not isinstance(value, (list, tuple, np.ndarray)):
        raise ValueError("must be a list of numbers")
    try:
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError("must be a list of numbers") from None
    if vector.ndim != 1 or np.isnan(vector).any():
        raise ValueError("must be one list of numbers, none of them NaN")
    vector.setflags(write=False)
    return vector


def _finite(vector: Array) -> Array:
    if not np.isfinite(vector).all():
        raise ValueError("must be finite")
    return vector


def _finite_vector(value: Any) -> Array:
    return _finite(_vector(value))


def _point(value: Any) -> Array:
    vector = _finite_vector(value)
    if vector.size != 3:
        raise ValueError(f"must have 3 entries, not {vector.size}")
    return vector


Bounds = Annotated[Array, BeforeValidator(_vector)]
Vector = Annotated[Array, BeforeValidator(_finite_vector)]
Point = Annotated[Array, BeforeValidator(_point)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]


@dataclass_transform(frozen_default=True, kw_only_default=True)
def validated(cls: type) -> type:
    """A frozen, keyword-only dataclass whose fields are checked, unknown ones refused."""
    config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
    return dataclass(frozen=True, eq=False, kw_only=True, config=config)(cls)
