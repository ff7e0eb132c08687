"""Numbers as a page holds them."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

# Cameras and labels need points to a tenth of a millimetre.
_DECIMALS = 4


def packed(values: ArrayLike) -> str:
    """Return numbers of any shape as base64 of 32-bit floats, low byte first; NaN is kept."""
    with np.errstate(over="ignore"):
        return b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def rounded(points: ArrayLike, decimals: int = _DECIMALS) -> Any:
    """Return points as nested lists of rounded numbers."""
    return np.round(np.asarray(points, dtype=float), decimals).tolist()
