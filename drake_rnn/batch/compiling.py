"""Compilation for arrays of a few numbers, and what cannot be compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from ..arrays.jax_module import require_jax
from ..errors import InvalidInputError
from ..experiment import Described
from ..features.pairs import refusal
from .grouping import Robot
from .run import robots_of

# Operations one after the other: to hand small ones to threads takes longer than they do.
_OPTIONS = {"xla_cpu_scheduler_type": 1}


def compilable(described: Sequence[Described]) -> list[Robot]:
    """Return robots that `run_many` can run and JAX can compile.

    Args:
        described: Experiments, or what `load_experiment` takes.

    Raises:
        InvalidInputError: If one cannot be; the message says which and why.
    """
    robots = robots_of(described)
    for number, robot in enumerate(robots):
        if (why := refusal(replace(robot.experiment.combination, host="compiled run"))) is not None:
            raise InvalidInputError(f"experiments[{number}]: {why}")
    return robots


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
