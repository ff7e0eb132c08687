"""Print the table of prescribed performance as Markdown: what holds in samples of 1 ms.

`python benchmarks/prescribed_tables.py` runs changes of the shipped experiment
`zeroing_prescribed`, and the algorithm as its authors' code has it, from the same start.
"""

from __future__ import annotations

import numpy as np

from drake_rnn import load_experiment, simulate
from drake_rnn.claims.papers.prescribed_performance import funnel_share, velocity_share
from markdown_table import head, row

_BASE = "zeroing_prescribed"
_FEEDBACKS = (2.0, 5.0, 10.0, 20.0)
_FORMS = ("implicit", "four_step")
# From when on the distance to the path is looked at [s].
_LATE = 8.0


def prescribed_table() -> None:
    """Print what is kept of bounds and funnel against the position gain, and as printed."""
    head(
        *("`feedback`", "`discretization`", "velocity, of its bound", "residual, of the funnel"),
        *("within it from [s]", "path, from 8 s on [m]"),
    )
    for feedback in _FEEDBACKS:
        for form in _FORMS:
            changes = {"law.feedback": feedback, "law.discretization": form, "accept": None}
            result = simulate(load_experiment(_BASE, changes))
            used, series = result.series["funnel_share"][:, 0], result.series
            outside = result.time[used >= 1.0]
            off = np.linalg.norm(series["p_WE"] - series["p_WE_desired"], axis=1)
            row(
                f"{feedback:g}",
                f"`{form}`",
                f"{result.metrics['limit_ratio_1_max']:.4f}",
                f"{used.max():.2g}",
                f"{outside[-1]:.2f}" if outside.size else "0",
                f"{off[result.time >= _LATE].max():.1g}",
            )
        shares = velocity_share(None, feedback, 10.0), funnel_share(None, feedback, 10.0)  # type: ignore[arg-type]
        ended = shares[0] >= 1.0 or shares[1] >= 1.0
        row(
            f"{feedback:g}",
            "as printed",
            f"{shares[0]:.4f}",
            f"{shares[1]:.2g}",
            "ends there" if ended else "0",
            "",
        )


if __name__ == "__main__":
    prescribed_table()
