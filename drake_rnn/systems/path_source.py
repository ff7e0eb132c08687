"""Desired motion of the end effector as signals."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..paths import Path
from ..robot.task import named_task


class PathSource(LeafSystem):
    """Source of a path as signals.

    Outputs are ``p_WE_desired``, ``v_WE_desired`` and ``a_WE_desired``, shape (m,)
    [m, m/s, m/s^2].

    Args:
        path: Path of the end effector.
        p_WE: Start position of the end effector, shape (3,) [m].
        task: A key of `drake_rnn.robot.task.TASKS`, which determines the m axes.
        R_WE: Desired orientation, shape (3, 3), for the output ``R_WE_desired``, flattened; None
            for no such output.
        preview: Time ahead [s] of the outputs ``p_preview``, ``v_preview`` and ``a_preview``; None
            for no such outputs.

    Raises:
        InvalidInputError: If ``preview`` is negative, infinite or not a number.
    """

    def __init__(
        self,
        path: Path,
        p_WE: Array,
        task: str = "xyz",
        R_WE: Array | None = None,
        preview: float | None = None,
    ) -> None:
        super().__init__()
        if preview is not None and not (isinstance(preview, Real) and 0.0 <= preview < np.inf):
            raise InvalidInputError(f"preview: must be a time of 0 or more, not {preview!r}")
        self.path = path
        self.preview = preview
        self.start = path.start_point(p_WE)
        self._axes = list(named_task(task).axes)
        self._declare(("p_WE_desired", "v_WE_desired", "a_WE_desired"), 0.0)
        if preview is not None:
            self._declare(("p_preview", "v_preview", "a_preview"), preview)
        if R_WE is not None:
            self.DeclareVectorOutputPort(
                "R_WE_desired",
                9,
                lambda context, output: output.set_value(R_WE.ravel()),
                {self.nothing_ticket()},
            )

    def _declare(self, names: tuple[str, ...], ahead: float) -> None:
        """Declare the outputs of position, velocity and acceleration at ``ahead`` [s] from now."""
        # The three ports evaluate the path once per time.
        memo: list[Any] = [np.nan, []]

        def port(order: int) -> Callable[[Context, Any], None]:
            def calc(context: Context, output: Any) -> None:
                t = context.get_time() + ahead
                if memo[0] != t:
                    memo[:] = t, self._at(t)
                output.set_value(memo[1][order])

            return calc

        for order, name in enumerate(names):
            self.DeclareVectorOutputPort(name, len(self._axes), port(order), {self.time_ticket()})

    def _at(self, t: float) -> list[Array]:
        p, v, a = self.path.evaluate(t)
        values = [self.start + p, v, a]
        return values if len(self._axes) == 3 else [value[self._axes] for value in values]
