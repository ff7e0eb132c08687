"""Compilation for arrays of a few numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from ..arrays.jax_module import require_jax

# Operations one after the other: to hand small ones to threads takes longer than they do.
_OPTIONS = {"xla_cpu_scheduler_type": 1}


def compiled_in_order(function: Callable[..., Any]) -> Any:
    """Return a function compiled by JAX, on a processor without threads for its operations.

    Args:
        function: What to compile, as for ``jax.jit``.
    """
    jax = require_jax()
    return jax.jit(function, compiler_options=_OPTIONS) if _can() else jax.jit(function)


@cache
def _can() -> bool:
    """Return whether this version of JAX, and what it computes on, know the option."""
    jax = require_jax()
    if jax.default_backend() != "cpu":
        return False
    try:
        jax.jit(lambda x: x + 1.0, compiler_options=_OPTIONS)(0.0)
    except Exception:
        return False
    return True
