"""Error against cost of every scheme, as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

import matplotlib.pyplot as plt

from peer_schemes.rows import Row

_MARKERS = "osD^vP*X"


def draw(tables: Mapping[str, Sequence[Row]], file: Path) -> None:
    """Draw a panel for each task: one marker a scheme, hollow where a bound is exceeded.

    Args:
        tables: Rows by the name of the task.
        file: Picture to write.
    """
    names = list(dict.fromkeys(row.name for rows in tables.values() for row in rows))
    # One colour for each library or law of ours, one marker for each of its schemes.
    libraries = [name.split(",")[0] for name in names]
    looks = {
        name: (
            f"C{list(dict.fromkeys(libraries)).index(library)}",
            _MARKERS[libraries[:number].count(library) % len(_MARKERS)],
        )
        for number, (name, library) in enumerate(zip(names, libraries, strict=True))
    }
    fig, panels = plt.subplots(
        1, len(tables), figsize=(3.9 * len(tables), 4.6), squeeze=False, layout="constrained"
    )
    shown = {}
    for panel, (task, rows) in zip(panels[0], tables.items(), strict=True):
        for row in rows:
            if row.figures is None or not isfinite(row.cost):
                continue
            colour, marker = looks[row.name]
            shown[row.name] = panel.plot(
                row.cost,
                1e6 * row.figures.error_max,
                marker,
                color=colour,
                markerfacecolor=colour if row.keeps_bounds else "none",
                markersize=8,
                alpha=0.85,
                linestyle="none",
            )[0]
        panel.set(xscale="log", yscale="log", title=task, xlabel="cost of a step [u]")
        panel.set_xticks([2, 5, 10, 20, 50, 100], labels=["2", "5", "10", "20", "50", "100"])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0][0].set_ylabel("largest position error [um]")
    fig.legend(
        [shown[name] for name in names if name in shown],
        [name for name in names if name in shown],
        loc="outside lower center",
        ncols=3,
        fontsize=8,
    )
    fig.savefig(file, dpi=85)
    plt.close(fig)
