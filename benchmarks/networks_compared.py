"""Print what the campaign `networks_compared` has come to as Markdown, and draw it.

::

    drake-rnn campaign networks_compared
    python benchmarks/networks_compared.py
    python benchmarks/networks_compared.py --period 1e-3
    python benchmarks/networks_compared.py --figure docs/networks_compared.png

The settings of each network are chosen by its first draw, on all arms: those whose medians of the
largest error have the least geometric mean over the disturbances. The tables have the other draws.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from drake_rnn.figures.style import (
    INK,
    PAGE,
    SERIES,
    common_style,
    save,
)
from drake_rnn.inputs.documents import read_yaml
from markdown_table import head, row

DISTURBANCES = ("none", "constant", "ramp", "random", "measured")
ERROR, SHAKING = "position_error_max_m", "network_acceleration_max_rad_s2"
#: Largest error of a run that has not failed [m].
LOST = 0.01
#: What the keys that a grid leaves out stand for.
_DEFAULTS = {"zeroing": "linear", "projection": "lvi", "adaptive": "known J", "recursive": "n = 1"}
_SHORT = {"simultaneous_learning": "slc", "discretization": "", "activation": "", "network": ""}
_TICKS = (1e-8, 1e-6, 1e-4, 1e-2)
_MARKERS = ("o", "s", "^", "D", "x")


class Run(NamedTuple):
    """A row of the campaign.

    Attributes:
        network: Name of the network.
        setting: Its gains, as a text.
        period: Sampling period [s].
        disturbance: One of `DISTURBANCES`.
        draw: Number of the draw.
        error: Largest position error [m]; infinite if the run failed.
        shaking: Largest acceleration of what the law commands [rad/s^2].
    """

    network: str
    setting: str
    period: float
    disturbance: str
    draw: int
    error: float
    shaking: float


def named(fixed: dict[str, Any]) -> str:
    """Return the name of a network, of the keys that its grid fixes."""
    kind = fixed["kind"]
    own = [f"{_SHORT.get(k, k)} {v}".strip() for k, v in fixed.items() if k != "kind"]
    own = [text.replace("jacobian ", "J ") for text in own]
    if not any(key in fixed for key in ("activation", "network", "jacobian")):
        own[:0] = [_DEFAULTS[kind]] if kind in _DEFAULTS else []
    return ", ".join([_SHORT.get(kind, kind), *own]).replace("_", " ")


def runs_of(folder: Path) -> list[Run]:
    """Return the rows of a campaign that have ended."""
    campaign = read_yaml(folder / "campaign.yaml")
    grids = [(each["fixed"], each.get("over", {})) for each in campaign["vary"]["law"]["of"]]
    found = []
    with (folder / "table.csv").open(newline="") as stream:
        for line in csv.DictReader(stream):
            law = json.loads(line["law"])
            fixed, over = next(grid for grid in grids if _is_of(law, *grid))
            error = float(line[ERROR]) if line["status"] == "complete" else np.inf
            found.append(
                Run(
                    named(fixed),
                    ", ".join(f"`{key}: {_text(law[key])}`" for key in over),
                    float(line["period"]),
                    _disturbance(line),
                    int(line["row"]) % campaign["samples"],
                    error if error <= LOST else np.inf,
                    float(line.get(SHAKING) or line["joint_acceleration_max_rad_s2"] or np.inf),
                )
            )
    return found


def _is_of(law: dict[str, Any], fixed: dict[str, Any], over: dict[str, Any]) -> bool:
    return law.keys() == fixed.keys() | over.keys() and all(law[k] == v for k, v in fixed.items())


def _text(value: Any) -> str:
    return json.dumps(value) if isinstance(value, list) else f"{value:g}"


def _disturbance(line: dict[str, str]) -> str:
    if line["sensing"] not in ("", "null"):
        return "measured"
    given = json.loads(line["disturbance"] or "null")
    return "none" if given is None else str(given["kind"])


Choice = dict[tuple[str, str], str]


def chosen(runs: Iterable[Run], *, each: bool) -> Choice:
    """Return the settings by network and disturbance, chosen by the first draw.

    Args:
        runs: The runs of one period.
        each: Whether they are chosen for each disturbance alone, or once for all of them.
    """
    errors = _gathered(runs, lambda run: run.draw == 0)
    best: Choice = {}
    for network in dict.fromkeys(name for name, _, _ in errors):
        settings = dict.fromkeys(setting for name, setting, _ in errors if name == network)
        scores = {
            setting: [_median(errors[network, setting, kind]) for kind in DISTURBANCES]
            for setting in settings
        }
        for number, kind in enumerate(DISTURBANCES):
            pick = (number,) if each else range(len(DISTURBANCES))
            best[network, kind] = min(
                settings, key=lambda s, pick=pick: sum(np.log(scores[s][k]) for k in pick)
            )
    return best


def _gathered(
    runs: Iterable[Run], wanted: Callable[[Run], bool]
) -> dict[tuple[str, str, str], list[float]]:
    errors = defaultdict(list)
    for run in runs:
        if wanted(run):
            errors[run.network, run.setting, run.disturbance].append(run.error)
    return errors


def _median(errors: list[float]) -> float:
    """Return the median; a run that failed counts as a metre."""
    return float(np.median([min(error, 1.0) for error in errors])) if errors else 1.0


def shown(runs: list[Run], best: Choice) -> dict[str, dict[str, list[Run]]]:
    """Return the runs of the other draws with the settings chosen, by network and disturbance."""
    table: dict[str, dict[str, list[Run]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        if run.draw and best.get((run.network, run.disturbance)) == run.setting:
            table[run.network][run.disturbance].append(run)
    return table


def _cell(runs: list[Run]) -> str:
    median = _median([run.error for run in runs])
    return "failed" if median >= LOST else f"{1e3 * median:.2g}"


def print_table(runs: list[Run]) -> None:
    """Print the table of one period: settings chosen once for all disturbances."""
    best = chosen(runs, each=False)
    head("network", "settings", *DISTURBANCES, "failed", "shakes, `measured` [rad/s^2]")
    for network, by_kind in shown(runs, best).items():
        every = [run for kind in DISTURBANCES for run in by_kind[kind]]
        failed = sum(run.error == np.inf for run in every)
        shakes = np.median([run.shaking for run in by_kind["measured"]])
        row(
            network,
            best[network, "none"],
            *(_cell(by_kind[kind]) for kind in DISTURBANCES),
            f"{failed} of {len(every)}",
            f"{shakes:.2g}",
        )


def print_each(runs: list[Run]) -> None:
    """Print the table of one period with settings chosen for each disturbance alone."""
    best = chosen(runs, each=True)
    head("network", *DISTURBANCES)
    for network, by_kind in shown(runs, best).items():
        row(network, *(_cell(by_kind[kind]) for kind in DISTURBANCES))


def draw(runs: list[Run], file: Path) -> None:
    """Draw medians and ranges of the errors of each network under each disturbance."""
    table = shown(runs, chosen(runs, each=False))
    names = list(table)
    with common_style():
        figure = Figure(figsize=(PAGE, 0.19 * len(names) + 1.0), layout="constrained")
        axes = figure.subplots(1, len(DISTURBANCES), sharex=True, sharey=True)
        for k, (kind, axis) in enumerate(zip(DISTURBANCES, axes, strict=True)):
            for place, name in enumerate(names):
                errors = np.array([min(run.error, 1.0) for run in table[name][kind]])
                if not errors.size:
                    continue
                axis.plot([errors.min(), errors.max()], [place, place], color=INK, linewidth=0.8)
                axis.plot(
                    np.median(errors), place, _MARKERS[k], color=SERIES[k], markersize=4, zorder=3
                )
            axis.set(xscale="log", title=kind, xlim=(1e-8, 2.0 * LOST), xticks=_TICKS)
            axis.minorticks_off()
            axis.axvline(LOST, color=INK, linewidth=0.6, linestyle=":")
            axis.grid(visible=True, axis="y", linewidth=0.3)
        axes[0].set_yticks(range(len(names)), names, fontsize=6)
        axes[0].invert_yaxis()
        figure.supxlabel("largest error [m]", fontsize=8)
        save(figure, file)


def main() -> None:
    """Print the tables, or draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("out/campaign_networks_compared"))
    parser.add_argument("--period", type=float, default=2e-3)
    parser.add_argument("--each", action="store_true", help="settings for each disturbance alone")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    runs = [run for run in runs_of(given.folder) if abs(run.period - given.period) < 1e-9]
    if given.figure is not None:
        draw(runs, given.figure)
    elif given.each:
        print_each(runs)
    else:
        print_table(runs)


if __name__ == "__main__":
    main()
