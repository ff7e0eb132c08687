"""Print what a campaign of networks has come to as Markdown, and draw it.

::

    drake-rnn campaign networks_500_hz
    python benchmarks/networks_compared.py networks_500_hz
    python benchmarks/networks_compared.py networks_500_hz --feedback-of "zeroing, linear"
    python benchmarks/networks_compared.py networks_500_hz --figure docs/networks_compared.png

The settings of each network are chosen by its first draw, on all arms: those whose medians of the
largest error have the least geometric mean over the disturbances. Medians below a micrometre count
as a micrometre. The tables have the other draws.

The column `in its grid` says of each key of a setting chosen whether smaller and larger values were
tried (`inside`), by how much the mean is worse with the value next to it, where that is below 1 %,
or whether the value is the largest that the law accepts (`limit`).
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
#: Errors below this one [m] are as good as it when settings are chosen.
SMALL = 1e-6
#: What the keys that a grid leaves out stand for.
_DEFAULTS = {"zeroing": "linear", "projection": "lvi", "adaptive": "known J", "recursive": "n = 1"}
_SHORT = {"simultaneous_learning": "slc", "discretization": "", "activation": "", "network": ""}
_TICKS = (1e-8, 1e-6, 1e-4, 1e-2)
_MARKERS = ("o", "s", "^", "D", "x")
#: Share of what a law accepts from which on a gain counts as the largest.
_LIMIT = 0.98
#: Change of the mean below which a gain counts as saturated [%].
_SATURATED = 1.0
_SHAKES = "shakes, `measured` [rad/s^2]"

#: Values of the keys that a grid varies, by key.
Setting = tuple[tuple[str, float], ...]


class Run(NamedTuple):
    """A row of the campaign.

    Attributes:
        network: Name of the network.
        setting: Its gains.
        period: Sampling period [s].
        disturbance: One of `DISTURBANCES`.
        draw: Number of the draw.
        error: Largest position error [m]; infinite if the run failed.
        shaking: Largest acceleration of what the law commands [rad/s^2].
    """

    network: str
    setting: Setting
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
                    tuple((key, _number(law[key])) for key in over),
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


def _number(value: Any) -> float:
    return float(value[0] if isinstance(value, list) else value)


def _text(setting: Setting) -> str:
    texts = (f"[{value:g}]" if key == "gains" else f"{value:g}" for key, value in setting)
    return ", ".join(f"`{key}: {text}`" for (key, _), text in zip(setting, texts, strict=True))


def _disturbance(line: dict[str, str]) -> str:
    if line["sensing"] not in ("", "null"):
        return "measured"
    given = json.loads(line["disturbance"] or "null")
    return "none" if given is None else str(given["kind"])


class Choice(NamedTuple):
    """The setting of a network.

    Attributes:
        setting: The setting.
        place: Where each of its values is among those that were tried, as a text.
    """

    setting: Setting
    place: str


def chosen(runs: list[Run]) -> dict[str, Choice]:
    """Return the settings by network, chosen by the first draw under all disturbances."""
    errors = _gathered(runs, lambda run: run.draw == 0)
    scores: dict[str, dict[Setting, float]] = defaultdict(dict)
    for network, setting, _ in errors:
        medians = [max(_median(errors[network, setting, kind]), SMALL) for kind in DISTURBANCES]
        scores[network][setting] = float(np.exp(np.mean(np.log(medians))))
    best = {network: min(each, key=each.__getitem__) for network, each in scores.items()}
    places = {n: _place(setting, scores[n], runs[0].period) for n, setting in best.items()}
    return {network: Choice(setting, places[network]) for network, setting in best.items()}


def _place(setting: Setting, scores: dict[Setting, float], period: float) -> str:
    """Return where each value of a setting is among those that were tried, as a text."""
    largest = {"feedback": 1.0 / period, "kappa": 1.0 / period, "gain": 1e9}
    places = {}
    for number, (key, value) in enumerate(setting):
        others = {
            other[number][1]: score
            for other, score in scores.items()
            if other[:number] + other[number + 1 :] == setting[:number] + setting[number + 1 :]
        }
        if min(others) < value < max(others):
            places[key] = "inside"
            continue
        next_to_it = sorted(others)[1 if value == min(others) else -2]
        change = 100.0 * (others[next_to_it] / others[value] - 1.0)
        is_limit = value >= _LIMIT * largest.get(key, np.inf)
        is_limit = is_limit and (key != "gain" or change > _SATURATED)
        places[key] = "limit" if is_limit else f"{change:.1f} %"
    if set(places.values()) == {"inside"}:
        return "inside"
    return ", ".join(f"`{key}` {place}" for key, place in places.items())


def _gathered(
    runs: Iterable[Run], wanted: Callable[[Run], bool]
) -> dict[tuple[str, Setting, str], list[float]]:
    errors = defaultdict(list)
    for run in runs:
        if wanted(run):
            errors[run.network, run.setting, run.disturbance].append(run.error)
    return errors


def _median(errors: list[float]) -> float:
    """Return the median; a run that failed counts as a metre."""
    return float(np.median([min(error, 1.0) for error in errors])) if errors else 1.0


def runs_to_show(runs: list[Run], best: dict[str, Choice]) -> dict[str, dict[str, list[Run]]]:
    """Return the runs of the other draws with the settings chosen, by network and disturbance."""
    table: dict[str, dict[str, list[Run]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        if run.draw and best[run.network].setting == run.setting:
            table[run.network][run.disturbance].append(run)
    return table


def _cell(runs: list[Run]) -> str:
    median = _median([run.error for run in runs])
    return "failed" if median >= LOST else f"{1e3 * median:.2g}"


def print_table(runs: list[Run]) -> None:
    """Print the table of a campaign, with settings chosen once for all disturbances."""
    best = chosen(runs)
    head("network", "settings", "in its grid", *DISTURBANCES, "failed", _SHAKES)
    for network, by_kind in runs_to_show(runs, best).items():
        every = [run for kind in DISTURBANCES for run in by_kind[kind]]
        failed = sum(run.error == np.inf for run in every)
        setting, place = best[network]
        row(network, _text(setting), place, *_cells(by_kind, f"{failed} of {len(every)}"))


def print_feedback(runs: list[Run], network: str) -> None:
    """Print what more feedback does to one network, with its other gains as they were chosen."""
    others = dict(chosen(runs)[network].setting)
    del others["feedback"]
    head("feedback [1/s]", *DISTURBANCES, _SHAKES)
    own = [run for run in runs if run.network == network and others.items() <= {*run.setting}]
    for feedback in sorted({dict(run.setting)["feedback"] for run in own}):
        of_it = {network: Choice((*others.items(), ("feedback", feedback)), "")}
        row(f"{feedback:g}", *_cells(runs_to_show(own, of_it)[network]))


def _cells(by_kind: dict[str, list[Run]], *further: str) -> list[str]:
    """Return the cells of a row: median errors, those given, and the accelerations under noise."""
    shaking = np.median([run.shaking for run in by_kind["measured"]])
    return [*(_cell(by_kind[kind]) for kind in DISTURBANCES), *further, f"{shaking:.2g}"]


def draw(runs: list[Run], file: Path) -> None:
    """Draw medians and ranges of the errors of each network under each disturbance."""
    table = runs_to_show(runs, chosen(runs))
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
            axis.set(xscale="log", title=kind, xlim=(1e-9, 2.0 * LOST), xticks=_TICKS)
            axis.minorticks_off()
            axis.axvline(LOST, color=INK, linewidth=0.6, linestyle=":")
            axis.grid(visible=True, axis="y", linewidth=0.3)
        axes[0].set_yticks(range(len(names)), names, fontsize=6)
        axes[0].invert_yaxis()
        figure.supxlabel("largest error [m]", fontsize=8)
        save(figure, file)


def main() -> None:
    """Print a table, or draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", help="its name")
    parser.add_argument("--feedback-of", metavar="NETWORK")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    runs = runs_of(Path(f"out/campaign_{given.campaign}"))
    if given.figure is not None:
        draw(runs, given.figure)
    elif given.feedback_of is not None:
        print_feedback(runs, given.feedback_of)
    else:
        print_table(runs)


if __name__ == "__main__":
    main()
