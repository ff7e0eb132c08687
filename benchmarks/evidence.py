"""What campaigns have come to, as a table, and how their worst runs go, as a figure.

Reads the folders that `drake-rnn campaign` has written, and simulates three rows of
`warm_up_anywhere`: the median one, one in the middle of those that do not stay on the path, and
the worst::

    drake-rnn campaign warm_up_anywhere --samples 2000
    python benchmarks/evidence.py --out out --figure docs/evidence.png
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from drake_rnn import Experiment, Result, load_experiment, simulate
from drake_rnn.experiment import forecasts, read_document
from markdown_table import head, row

#: Campaigns, and the name of each in the figure.
CAMPAIGNS = {
    "warm_up_anywhere": "learned Jacobian, links with errors",
    "drift_free_clovers": "drift-free clovers",
    "recursive_targets": "recursive, one level, points at rest",
    "chain_circles": "circles behind a chain of filters",
}
LEARNING, ERROR = "warm_up_anywhere", "position_error_max_m"
#: Metrics of limits: none of a row that keeps them exceeds 1, but for the rounding of a secant.
RATIOS = tuple(f"limit_ratio_{order}_max" for order in range(1, 6))


def lines_of(folder: Path) -> list[dict[str, str]]:
    """Return the lines of a campaign's table."""
    with (folder / "table.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(lines: list[dict[str, str]], name: str) -> np.ndarray:
    """Return a column of the complete rows, without those that have no such number."""
    found = [line[name] for line in lines if line["status"] == "complete" and line.get(name)]
    return np.array(found, dtype=float)


def told(name: str, folder: Path) -> None:
    """Print the line of a campaign."""
    lines = lines_of(folder)
    record = json.loads((folder / "campaign.json").read_text())
    complete = sum(line["status"] == "complete" for line in lines)
    errors = np.sort(numbers(lines, ERROR))
    ratios = [numbers(lines, ratio).max(initial=0.0) for ratio in RATIOS]
    keeps = record["shares"].get("limits that the law keeps", [np.nan])[0] * len(lines)
    accepted, low, high = record["shares"]["accept"]
    row(
        f"`{name}`",
        len(lines),
        f"{complete}",
        f"{keeps:.0f}",
        f"{max(ratios) - 1.0:.1e}",
        f"{accepted:.1%} [{low:.1%}, {high:.1%}]",
        *(f"{np.quantile(errors, p):.2g}" for p in (0.5, 0.95, 0.99)),
        f"{errors[-1]:.2g}",
    )


def experiment_of(folder: Path, line: dict[str, str]) -> Experiment:
    """Return the experiment of a row."""
    keys = list(line)[1 : list(line).index("status")]
    changes = {key: json.loads(line[key]) for key in keys}
    return load_experiment(read_document(str(folder / "experiment.yaml"), changes))


def fates(folder: Path) -> None:
    """Print how rows that learn end, and of how many it was foreseen that a limit is too low."""
    lines = [line for line in lines_of(folder) if line["status"] == "complete"]
    classes = {
        "stays within 0.5 mm": (0.0, 5e-4),
        "0.5 mm to 2 cm": (5e-4, 2e-2),
        "beyond 2 cm": (2e-2, np.inf),
    }
    head("error in the window", "rows", "path asks for more than a limit", "acceleration limit")
    for name, (low, high) in classes.items():
        some = [line for line in lines if low <= float(line[ERROR]) < high]
        among = some[:60]
        foreseen = sum(_too_low(experiment_of(folder, line)) for line in among)
        limits = np.array([float(line["limits.acceleration"]) for line in some])
        row(name, len(some), f"{foreseen} of {len(among)}", f"{np.median(limits):.2f} (median)")


def _too_low(experiment: Experiment) -> bool:
    """Return whether the path is foreseen to ask for more than a limit."""
    return any(forecast.limit is not None for forecast in forecasts(experiment))


def chosen(folder: Path) -> dict[str, dict[str, str]]:
    """Return rows of the campaign that learns, by what they show."""
    lines = [line for line in lines_of(folder) if line["status"] == "complete"]
    lines.sort(key=lambda line: float(line[ERROR]))
    between = [line for line in lines if 2e-3 <= float(line[ERROR]) < 2e-2]
    return {
        "median": lines[len(lines) // 2],
        "limits too low": between[len(between) // 2],
        "worst": lines[-1],
    }


def figure(out: Path, file: Path) -> None:
    """Draw the errors of all campaigns, and three runs."""
    fig, (shares, errors, learned) = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    for name, label in CAMPAIGNS.items():
        folder = out / f"campaign_{name}"
        if not (folder / "table.csv").is_file():
            continue
        found = np.sort(numbers(lines_of(folder), ERROR))
        shares.semilogx(found, np.arange(1, found.size + 1) / found.size, label=label)
    shares.set(xlabel="largest error in the window [m]", ylabel="share of the runs", ylim=(0, 1))
    shares.legend(fontsize=7, loc="upper left", bbox_to_anchor=(0.28, 0.62))
    folder = out / f"campaign_{LEARNING}"
    for (label, line), colour in zip(chosen(folder).items(), ("C0", "C1", "C3"), strict=True):
        result = simulate(experiment_of(folder, line))
        told_as = f"{label}, row {line['row']}"
        print(f"{told_as}: {result.metrics[ERROR]:.3g} m, as a batch {float(line[ERROR]):.3g} m")
        errors.semilogy(result.time, result.position_error, colour, label=told_as)
        true, guessed = (_least(result, name) for name in ("J", "J_hat"))
        learned.semilogy(result.time, guessed, colour, label=told_as)
        learned.semilogy(result.time, true, colour, linestyle=":")
    errors.set(xlabel="time [s]", ylabel="position error [m]")
    learned.set(xlabel="time [s]", ylabel="least singular value of J (dotted) and J_hat [m]")
    learned.yaxis.label.set_fontsize(8)
    errors.legend(fontsize=7)
    for each in (shares, errors, learned):
        each.grid(alpha=0.3)
    fig.savefig(file, dpi=110)


def _least(result: Result, name: str) -> np.ndarray:
    return np.linalg.svd(result.series[name], compute_uv=False)[:, -1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    columns = ("largest ratio to a limit - 1", "keep `accept`", "median", "95 %", "99 %", "worst")
    head("campaign", "rows", "complete", "keep their limits", *columns)
    for name in CAMPAIGNS:
        if (options.out / f"campaign_{name}" / "table.csv").is_file():
            told(name, options.out / f"campaign_{name}")
    print()
    fates(options.out / f"campaign_{LEARNING}")
    if options.figure is not None:
        figure(options.out, options.figure)


if __name__ == "__main__":
    main()
