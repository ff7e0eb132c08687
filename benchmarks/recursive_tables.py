"""Print the tables of the recursive network and its baselines as Markdown, and draw their figure.

`python benchmarks/recursive_tables.py [folder]` prints the tables and writes
`recursive_comparison.png` to the folder, by default `out`.

The paper is "Recursive recurrent neural network: a novel model for manipulator control with
different levels of physical constraints", CAAI Transactions on Intelligence Technology (2022).
"""

import sys
from pathlib import Path

from drake_rnn import Result, load_experiment, simulate
from drake_rnn.figures.comparison import comparison_figure
from drake_rnn.robot.limits import DERIVATIVE_UNITS
from markdown_table import head, row

SHAPES = ("circle", "square")
LAWS = ("recursive_{}_printed", "recursive_{}", "rnn_{}", "pinv_{}", "rnn_{}_smooth")
LAWS += ("pinv_{}_smooth", "stretched_{}")
EXPERIMENTS = [law.format(shape) for shape in SHAPES for law in LAWS]
# Experiments that the figure compares, by their names in it.
COMPARED = {
    "printed": "recursive_{}_printed",
    "pseudoinverse, at constant speed": "pinv_{}",
    "pseudoinverse, smooth and stretched": "stretched_{}",
}
FEWER = (1, 2, 3, 4)


def figures(result: Result) -> list[str]:
    """Return the largest error and the largest ratio to each bound, in bold if above 1."""
    cells = [f"{result.metrics['position_error_max_m']:.2g}"]
    for order in range(1, len(DERIVATIVE_UNITS) + 1):
        ratio = result.metrics[f"limit_ratio_{order}_max"]
        text = f"{ratio:.4g}"
        # Rounded: a ratio exactly at its bound may exceed 1 by a rounding error.
        cells.append(f"**{text}**" if float(text) > 1 else text)
    return cells


def experiments_table(results: dict[str, Result]) -> None:
    """Print the metrics of the experiments side by side."""
    head("`drake-rnn run ...`", "error, largest [m]", *(f"{name} / bound" for name in _ORDERS))
    for name, result in results.items():
        row(f"`{name}`", *figures(result))


def levels_table() -> None:
    """Print the errors of the printed law with fewer levels n, up to derivative n."""
    head("path", "n", "error, largest [m]", *(f"{name} / bound" for name in _ORDERS))
    for shape in SHAPES:
        name = f"recursive_{shape}_printed"
        gains = list(load_experiment(name).document.law["gains"])
        for n in FEWER:
            changes = {"law.gains": gains[:n], "accept": None}
            cells = figures(simulate(load_experiment(name, changes)))
            row(shape, n, *cells[: n + 1], *["" for _ in cells[n + 1 :]])


_ORDERS = tuple(DERIVATIVE_UNITS)

if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    folder.mkdir(parents=True, exist_ok=True)
    results = {name: simulate(load_experiment(name)) for name in EXPERIMENTS}
    experiments_table(results)
    levels_table()
    groups = {
        shape: {law: results[name.format(shape)] for law, name in COMPARED.items()}
        for shape in SHAPES
    }
    print(f"\n{comparison_figure(groups, folder / 'recursive_comparison.png')}")
