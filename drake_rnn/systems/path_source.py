"""What the end effector is asked to do."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from ..fields import Array
from ..paths import Path
from ..task import named_task


class PathSource(LeafSystem):
    """A path as ``p_WE_desired``, ``v_WE_desired`` and ``a_WE_desired``, (m,) [m, m/s, m/s^2].

    Args:
        path: The path.
        p_WE: Where the end effector starts, shape (3,) [m].
        task: A key of `drake_rnn.task.TASKS`, which names the m axes.
        R_WE: Orientation to keep, shape (3, 3), if the task has one; it is the output
            ``R_WE_desired``, flat.
        preview: Time ahead [s] of the outputs ``p_preview``, ``v_preview`` and ``a_preview``, in
            case a law sees ahead.
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
        self.path = path
        self.start = path.start_point(p_WE)
        self._axes = list(named_task(task).axes)
        # A pure function of time, asked for three times at each.
        self._memo: tuple[float, list[Array]] = (np.nan, [])
        self._memo_ahead: tuple[float, list[Array]] = (np.nan, [])
        for order, name in enumerate(("p_WE_desired", "v_WE_desired", "a_WE_desired")):
            self.DeclareVectorOutputPort(
                name,
                len(self._axes),
                lambda context, output, order=order: self._calc(context, output, order),
                {self.time_ticket()},
            )
        if preview is not None:
            for order, name in enumerate(("p_preview", "v_preview", "a_preview")):
                self.DeclareVectorOutputPort(
                    name,
                    len(self._axes),
                    lambda context, output, order=order: self._calc_ahead(
                        context, output, order, preview
                    ),
                    {self.time_ticket()},
                )
        if R_WE is not None:
            self.DeclareVectorOutputPort(
                "R_WE_desired",
                9,
                lambda context, output: output.set_value(R_WE.ravel()),
                {self.nothing_ticket()},
            )

    def _calc(self, context: Context, output: Any, order: int) -> None:
        t = context.get_time()
        if self._memo[0] != t:
            self._memo = (t, self._at(t))
        output.set_value(self._memo[1][order])

    def _calc_ahead(self, context: Context, output: Any, order: int, preview: float) -> None:
        t = context.get_time() + preview
        if self._memo_ahead[0] != t:
            self._memo_ahead = (t, self._at(t))
        output.set_value(self._memo_ahead[1][order])

    def _at(self, t: float) -> list[Array]:
        p, v, a = self.path.evaluate(t)
        values = [self.start + p, v, a]
        return values if len(self._axes) == 3 else [value[self._axes] for value in values]
