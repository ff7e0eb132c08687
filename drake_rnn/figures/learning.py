"""The figure of a sweep that compares how well the runs learned the Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from ..campaigns.sweep import Row
from .labels import key_label
from .looks import nth
from .style import label, log_axis, save, single, styled, ticks

#: Room for the names in a line of the legend, and that of a line beside its name [characters].
_LEGEND, _HANDLE = 55, 6


def learning_figure(
    keys: Sequence[str],
    rows: Sequence[Row],
    file: Path,
    units: Mapping[str, str] = MappingProxyType({}),
) -> Path | None:
    """Draw the Frobenius norm of J - J_hat over time, a curve for each run.

    Args:
        keys: Swept keys.
        rows: Rows of the sweep; those that learned no Jacobian have no curve.
        file: File to write.
        units: Units of the swept keys, as far as they are known.

    Returns:
        The file, or None if no run learned a Jacobian.
    """
    learned = [(row.values, *row.learning) for row in rows if row.learning is not None]
    if not learned:
        return None
    with styled():
        figure, ax = single()
        for k, (values, time, error) in enumerate(learned):
            ax.plot(time, error, label=", ".join(map(str, values)), **nth(k))
        log_axis(ax, [error for _, _, error in learned])
        ax.set_ylabel(label(r"error of $\hat J$, Frobenius norm", "J"))
        ax.set_xlim(0.0, max(float(time[-1]) for _, time, _ in learned))
        ticks(ax.xaxis, 5)
        ax.set_xlabel("time [s]")
        names = ", ".join(key_label(key.split(".")[-1], units.get(key, "")) for key in keys)
        longest = max(len(str(line.get_label())) for line in ax.lines)
        columns = max(1, min(len(learned), _LEGEND // (longest + _HANDLE)))
        figure.legend(title=names, loc="outside upper center", ncols=columns)
        save(figure, file)
    return file
