"""JAX, an optional dependency."""

from __future__ import annotations

from typing import Any

from ..inputs.extras import needed


def require_jax() -> Any:
    """Return the module ``jax`` with 64-bit numbers, which are switched on for the whole process.

    Arrays that JAX made before have 32 bits; functions that need 64 refuse them.

    Raises:
        InvalidInputError: If JAX is not installed.
    """
    (jax,) = needed("compilation", "jax", "jax")
    jax.config.update("jax_enable_x64", True)
    return jax
