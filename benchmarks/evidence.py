"""What campaigns have come to, as a table, and how their worst runs go, as a figure.

Reads the folders that `drake-rnn campaign` has written, and simulates three rows of
`warm_up_anywhere`: the median one, one in the middle of those that do not stay on the path, and
the worst::

    drake-rnn campaign warm_up_anywhere --samples 2000
    python benchmarks/evidence.py --out out --figure docs/evidence.png
    python benchmarks/evidence.py --out out --otherwise 100
    python benchmarks/evidence.py --out out --paired 300

The last two run rows again: so many of those that do not stay on the path, with other laws and
limits; and the first so many, with each of the laws that learn a Jacobian or know it.
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drake_rnn import Experiment, Result, load_experiment, run_many, simulate
from drake_rnn.experiment import forecasts, read_document
from drake_rnn.figures.style import PAGE, common_style, nth, save
from drake_rnn.jobs.summary import rank_correlation
from markdown_table import head, row

#: Campaigns, and the name of each in the figure.
CAMPAIGNS = {
    "warm_up_anywhere": "learned Jacobian",
    "drift_free_clovers": "drift-free",
    "recursive_targets": "recursive",
    "chain_circles": "behind filters",
}
LEARNING, ERROR = "warm_up_anywhere", "position_error_max_m"
#: Errors [m] by which rows that learn are told apart.
NEAR, FAR = 5e-4, 2e-2
CLASSES = {
    "up to 0.5 mm": (0.0, NEAR),
    "0.5 mm to 2 cm": (NEAR, FAR),
    "beyond 2 cm": (FAR, np.inf),
}
#: Least singular value above which no clover errs by more than its bound [m].
APART = 0.12
#: The same law with the arm's Jacobian.
KNOWN = {
    "kind": "simultaneous_learning",
    "jacobian": "known",
    "kappa": 15,
    "feedback_limit": 0.1,
}
#: Laws that the same rows are run with; None is the campaign's own.
PAIRED: dict[str, dict[str, Any] | None] = {
    "simultaneous learning, after a warm-up": None,
    "adaptive, Jacobian learned": {
        "kind": "adaptive",
        "jacobian": "learned",
        "kappa": 1000,
        "braking": 0.08,
    },
    "adaptive, Jacobian known": {"kind": "adaptive", "kappa": 1000},
}
#: Metrics of limits: none of a row that keeps them exceeds 1, but for the rounding of a secant.
MARGIN = "joint_limit_margin_min_rad"
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
    shares = record["shares"]
    # Those that are expected to be kept, as the law or a filter does it by construction.
    ratios = [numbers(lines, ratio).max(initial=0.0) for ratio in RATIOS if ratio in shares]
    limits = [shares[limit][0] for limit in (*RATIOS, MARGIN) if limit in shares]
    accepted, low, high = shares.get("accept", shares["all bounds"])
    row(
        f"`{name}`",
        len(lines),
        f"{complete}",
        f"{min(limits) * len(lines):.0f}",
        f"{max(ratios):.15g}",
        f"{accepted:.1%} [{low:.1%}, {high:.1%}]",
        *(f"{np.quantile(errors, p):.2g}" for p in (0.5, 0.95, 0.99)),
        f"{errors[-1]:.2g}",
    )


def changes_of(line: dict[str, str]) -> dict[str, Any]:
    """Return the values of a row's varied keys."""
    return {key: json.loads(line[key]) for key in list(line)[1 : list(line).index("status")]}


def experiment_of(folder: Path, line: dict[str, str]) -> Experiment:
    """Return the experiment of a row."""
    return load_experiment(str(folder / "experiment.yaml"), changes_of(line))


def otherwise(folder: Path, count: int) -> None:
    """Print what becomes of rows that do not stay on the path, run in another way."""
    lines = [line for line in lines_of(folder) if line["status"] == "complete"]
    document = read_document(str(folder / "experiment.yaml"))

    def changed(line: dict[str, str], way: str) -> dict[str, Any]:
        own = changes_of(line)
        if way == "the Jacobian known":
            own["law"] = KNOWN
        elif way == "limits doubled":
            own |= {key: 2.0 * own[key] for key in own if key.startswith("limits.")}
        else:
            own["law.rho"] = 1e-6
        return read_document(document, own)

    head("rows with an error", "run with", "rows", "within 0.5 mm", "within 2 cm")
    for name, (low, high) in list(CLASSES.items())[1:]:
        some = [line for line in lines if low <= float(line[ERROR]) < high][:count]
        for way in ("the Jacobian known", "limits doubled", "rho 1e-6"):
            error = run_many([changed(line, way) for line in some]).metrics[ERROR]
            row(name, way, len(some), (error < NEAR).sum(), (error < FAR).sum())


def paired(folder: Path, count: int) -> None:
    """Print how the same rows end with each law: same starts, links, limits and seeds."""
    document = read_document(str(folder / "experiment.yaml"))
    rows = [changes_of(line) for line in lines_of(folder)[:count]]
    head("law", "rows", "within 1 um", "within 0.5 mm", "within 2 cm", "median [m]", "worst [m]")
    for name, law in PAIRED.items():
        own = {} if law is None else {"law": law}
        error = run_many([read_document(document, values | own) for values in rows]).metrics[ERROR]
        shares = (f"{(error < bound).mean():.1%}" for bound in (1e-6, NEAR, FAR))
        row(name, len(rows), *shares, f"{np.median(error):.2g}", f"{error.max():.2g}")
        missed = error >= NEAR
    foreseen = np.array([_too_low(load_experiment(document, values)) for values in rows])
    print(
        f"\nof the {missed.sum()} rows that the last law misses by {NEAR:g} m and more, "
        f"{(foreseen & missed).sum()} were said to ask for more than a limit, and "
        f"{(foreseen & ~missed).sum()} of the other {(~missed).sum()}"
    )


def fates(folder: Path) -> None:
    """Print how rows that learn end, and of how many it was foreseen that a limit is too low."""
    lines = [line for line in lines_of(folder) if line["status"] == "complete"]
    head("error in the window", "rows", "path asks for more than a limit", "acceleration limit")
    for name, (low, high) in CLASSES.items():
        some = [line for line in lines if low <= float(line[ERROR]) < high]
        among = some[:60]
        foreseen = sum(_too_low(experiment_of(folder, line)) for line in among)
        limits = np.array([float(line["limits.acceleration"]) for line in some])
        row(name, len(some), f"{foreseen} of {len(among)}", f"{np.median(limits):.2f} (median)")


def singular(folder: Path) -> None:
    """Print how errors of clovers go with the distance from a singular posture."""
    lines = lines_of(folder)
    error, least = numbers(lines, ERROR), numbers(lines, "singular_value_min")
    drift, ratio = numbers(lines, "joint_drift_max_rad"), numbers(lines, "limit_ratio_2_max")
    far = least >= APART
    print(
        f"\nclovers: rank correlation of error and least singular value "
        f"{rank_correlation(error, least):.2f}; {(error > 1e-5).sum()} rows err by over 10 um, "
        f"{(error[~far] > 1e-5).sum()} of them among the {(~far).sum()} below {APART:g} m; above, "
        f"the largest error is {error[far].max():.2g} m; {(drift > 0.01).sum()} come back further "
        f"than 0.01 rad from home; {(ratio > 1.0 - 1e-9).sum()} reach the bound"
    )


def _too_low(experiment: Experiment) -> bool:
    """Return whether the path is foreseen to ask for more than a limit."""
    return any(forecast.limit is not None for forecast in forecasts(experiment))


def chosen(folder: Path) -> dict[str, dict[str, str]]:
    """Return rows of the campaign that learns, by what they show.

    Of those whose limits are too low, it is the first from the middle on that `simulate` warns of.
    """
    lines = [line for line in lines_of(folder) if line["status"] == "complete"]
    lines.sort(key=lambda line: float(line[ERROR]))
    between = [line for line in lines if 2e-3 <= float(line[ERROR]) < 2e-2]
    from_middle = between[len(between) // 2 :]
    return {
        "median": lines[len(lines) // 2],
        "limits too low": next(r for r in from_middle if _too_low(experiment_of(folder, r))),
        "worst": lines[-1],
    }


def figure(out: Path, file: Path) -> None:
    """Draw the errors of all campaigns, and three runs."""
    with common_style():
        fig = Figure(figsize=(PAGE, 2.9), layout="constrained")
        shares, errors, learned = fig.subplots(1, 3)
        _shares(shares, out)
        _chosen_runs(errors, learned, out / f"campaign_{LEARNING}")
        save(fig, file)


def _shares(shares: Axes, out: Path) -> None:
    """Draw what share of the runs of each campaign has at most an error."""
    for k, (name, label) in enumerate(CAMPAIGNS.items()):
        folder = out / f"campaign_{name}"
        if not (folder / "table.csv").is_file():
            continue
        found = np.sort(numbers(lines_of(folder), ERROR))
        shares.semilogx(found, np.arange(1, found.size + 1) / found.size, label=label, **nth(k))
    shares.set(
        xlabel="largest error in the window [m]", ylabel="share of the runs [-]", ylim=(0, 1)
    )
    shares.legend(fontsize=6.5, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _chosen_runs(errors: Axes, learned: Axes, folder: Path) -> None:
    """Draw errors and least singular values of the rows that are chosen."""
    for k, (label, line) in enumerate(chosen(folder).items()):
        result = simulate(experiment_of(folder, line))
        told_as = f"{label}, row {line['row']}"
        print(f"{told_as}: {result.metrics[ERROR]:.3g} m, as a batch {float(line[ERROR]):.3g} m")
        errors.semilogy(result.time, result.position_error, label=told_as, **nth(k))
        true, guessed = (_least(result, name) for name in ("J", "J_hat"))
        learned.semilogy(result.time, guessed, **nth(k))
        learned.semilogy(result.time, true, **{**nth(k), "linewidth": 2.6, "alpha": 0.35})
    errors.set(xlabel="time [s]", ylabel="position error [m]")
    learned.set(xlabel="time [s]", ylabel="least singular value of\nJ (wide, pale) and J_hat [m]")
    errors.legend(fontsize=6.5, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _least(result: Result, name: str) -> np.ndarray:
    return np.linalg.svd(result.series[name], compute_uv=False)[:, -1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--otherwise", type=int, default=0, metavar="ROWS")
    parser.add_argument("--paired", type=int, default=0, metavar="ROWS")
    options = parser.parse_args()
    for again, count in ((otherwise, options.otherwise), (paired, options.paired)):
        if count:
            again(options.out / f"campaign_{LEARNING}", count)
    if options.otherwise or options.paired:
        return
    columns = ("largest ratio to a limit", "keep `accept`", "median", "95 %", "99 %", "worst")
    head("campaign", "rows", "complete", "keep their limits", *columns)
    for name in CAMPAIGNS:
        if (options.out / f"campaign_{name}" / "table.csv").is_file():
            told(name, options.out / f"campaign_{name}")
    print()
    fates(options.out / f"campaign_{LEARNING}")
    singular(options.out / "campaign_drift_free_clovers")
    if options.figure is not None:
        figure(options.out, options.figure)


if __name__ == "__main__":
    main()
