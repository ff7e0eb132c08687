"""JAX, an optional dependency."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InvalidInputError


def require_jax() -> Any:
    """Return the module ``jax`` with 64-bit numbers, which are switched on for the whole process.

    Arrays that JAX made before have 32 bits; functions that need 64 refuse them.

    Raises:
        InvalidInputError: If JAX is not installed.
    """
    try:
        jax = import_module("jax")
    except ImportError:
        raise InvalidInputError(
            'jax: is not installed; get it with pip install "drake-rnn[jax]"'
        ) from None
    jax.config.update("jax_enable_x64", True)
    return jax
