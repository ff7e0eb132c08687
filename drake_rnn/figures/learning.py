"""The figure of a sweep that compares how well the runs learned the Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..campaigns.sweep import Row
from .style import COLOURS, label, legend, log_axis, save, single, styled, ticks


def learning_figure(keys: Sequence[str], rows: Sequence[Row], file: Path) -> Path | None:
    """Draw the Frobenius norm of J - J_hat over time, a curve for each run.

    Args:
        keys: Swept keys.
        rows: Rows of the sweep; those that learned no Jacobian have no curve.
        file: File to write.

    Returns:
        The file, or None if no run learned a Jacobian.
    """
    learned = [(row.values, *row.learning) for row in rows if row.learning is not None]
    if not learned:
        return None
    with styled():
        figure, ax = single()
        for k, (values, time, error) in enumerate(learned):
            pairs = zip(keys, values, strict=True)
            name = ", ".join(f"{key.split('.')[-1]} = {value}" for key, value in pairs)
            ax.plot(time, error, color=COLOURS[k % len(COLOURS)], label=name)
        log_axis(ax, [error for _, _, error in learned])
        ax.set_ylabel(label(r"error of $\hat J$, Frobenius norm", "J"))
        ax.set_xlim(0.0, max(float(time[-1]) for _, time, _ in learned))
        ticks(ax.xaxis, 5)
        ax.set_xlabel("time [s]")
        legend(ax)
        save(figure, file)
    return file
