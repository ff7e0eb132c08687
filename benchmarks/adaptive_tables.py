"""Print the tables of the adaptive law as Markdown, and draw its figure; `make tables` runs this.

`python benchmarks/adaptive_tables.py --only seeds jerk` prints some of the tables, and
`--figure docs/adaptive_sensing.png` draws the errors against what is wrong with measurements.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drake_rnn import Experiment, Result, load_experiment, make_experiment, run_many, simulate
from drake_rnn.experiment import Arms
from drake_rnn.figures.style import PAGE, common_style, nth, save
from drake_rnn.jobs.summary import rank_correlation
from markdown_table import head, row

ERROR, TURN, SETTLES = "position_error_max_m", "orientation_error_max_rad", "settling_time_s"
EXCESS = {
    "a": "acceleration_violation_max_rad_s2",
    "j": "held_jerk_violation_max_rad_s3",
}
#: Bounds of the jerk [rad/s^3], and the gain of the feedback that a learned Jacobian is given.
JERKS = {100.0: 100.0, 20.0: 30.0, 5.0: 30.0}
SEEDS, MANY_SEEDS, FEW_SEEDS = range(20), range(100), range(3)
POSES = {"Panda": "", "iiwa 14": "_iiwa14", "UR5": "_ur5"}
MICRO = 1e-6

Sensing = tuple[tuple[str, float], ...]
#: What is wrong with measurements, by the words of the table.
SENSED: dict[str, Sensing] = {
    "position from outside, 10 um": (("p_WE_noise", 1e-5),),
    "position from outside, 100 um": (("p_WE_noise", 1e-4),),
    "encoders of 20 bits": (("encoder_bits", 20),),
    "encoders of 17 bits": (("encoder_bits", 17),),
    "1 ms late": (("delay", 1e-3),),
    "2 ms late": (("delay", 2e-3),),
    "5 ms late": (("delay", 5e-3),),
    "20 bits, 10 um, 1 ms": (("encoder_bits", 20), ("p_WE_noise", 1e-5), ("delay", 1e-3)),
    "17 bits, 100 um, 5 ms": (("encoder_bits", 17), ("p_WE_noise", 1e-4), ("delay", 5e-3)),
}
POSE_SENSED: Sensing = (("p_WE_noise", 1e-5), ("R_WE_noise", 5e-5))
#: Panels of the figure: name of the axis, key of ``sensing``, values, factor to the axis.
PANELS = (
    ("noise of the position [µm]", "p_WE_noise", (1e-6, 3e-6, 1e-5, 3e-5, 1e-4), 1e6),
    ("bits of the encoders", "encoder_bits", (15, 17, 18, 20, 22), 1),
    ("delay [ms]", "delay", (1e-3, 2e-3, 5e-3, 1e-2), 1e3),
)
#: Arms with motors, and what differs from the Panda's nephroid.
_SMALL = {"kind": "nephroid", "plane": "yz", "size": 0.02, "period": 8, "offset": [0.05, 0, 0]}
MOVED: dict[str, dict[str, Any]] = {
    "panda": {},
    "panda, jerk 20 rad/s^3": {"limits": {"velocity": 0.5, "acceleration": 1.0, "jerk": 20.0}},
    "iiwa14": {"arm": "iiwa14", "path": _SMALL},
    "ur5": {"arm": "ur5", "start": [0, -1.2, 1.8, -2.2, -1.57, 0], "path": _SMALL},
    "planar6": {"arm": "planar6", "task": "xy", "path": {**_SMALL, "plane": "xy"}},
}


def with_seeds(name: str, seeds: Sequence[int], changes: Mapping[str, Any]) -> list[Experiment]:
    """Return an experiment, changed, once for each seed."""
    document = load_experiment(name, {"accept": None, **changes}).document.contents()
    shared = Arms()
    return [make_experiment({**document, "seed": seed}, arms=shared) for seed in seeds]


def spread(values: np.ndarray, unit: float = MICRO) -> str:
    """Return median and largest of some values, as text."""
    if (missing := int(np.sum(~np.isfinite(values)))) > 0:
        return f"{np.nanmedian(values) / unit:.4g} / none in {missing}"
    return f"{np.median(values) / unit:.4g} / {values.max() / unit:.4g}"


def excess(metrics: Mapping[str, Any], name: str) -> str:
    """Return by how much a bound is exceeded at most, as text; rounding is what is expected."""
    return f"{np.max(metrics[EXCESS[name]]):.0e}"


def in_turn(*cases: list[Experiment]) -> Iterator[dict[str, np.ndarray]]:
    """Yield the metrics of each list of experiments, after all have run side by side."""
    found, done = run_many([experiment for case in cases for experiment in case]), 0
    for case in cases:
        yield {name: values[done : done + len(case)] for name, values in found.metrics.items()}
        done += len(case)


def seeds_table() -> None:
    """Print what a Jacobian learned from a hundred random ones comes to."""
    head("J", "error max [um]", "settles [s]", "a beyond its bound by [rad/s^2]")
    known = simulate(load_experiment("adaptive_nephroid_known")).metrics
    row("known", f"{known[ERROR] / MICRO:.2g}", f"{known[SETTLES]:.3f}", excess(known, "a"))
    (found,) = in_turn(with_seeds("adaptive_nephroid", MANY_SEEDS, {}))
    row(
        f"learned, {len(MANY_SEEDS)} seeds: median / worst",
        spread(found[ERROR]),
        spread(found[SETTLES], 1.0),
        excess(found, "a"),
    )


def jerk_table() -> None:
    """Print what bounds of the jerk cost."""
    head(
        *("bound of the jerk [rad/s^3]", "J", "kappa [1/s]", "error max [um]", "settles [s]"),
        *("a beyond its bound by [rad/s^2]", "jerk by [rad/s^3]"),
    )
    cases = [
        with_seeds("adaptive_jerk_learned", MANY_SEEDS, {"limits.jerk": jerk, "law.kappa": kappa})
        for jerk, kappa in JERKS.items()
    ]
    learned = f"learned, {len(MANY_SEEDS)} seeds: median / worst"
    for (jerk, kappa), found in zip(JERKS.items(), in_turn(*cases), strict=True):
        experiment = load_experiment("adaptive_jerk", {"limits.jerk": jerk})
        known, chosen = simulate(experiment).metrics, experiment.law.loop_gains["kappa"]
        figures = (f"{known[ERROR] / MICRO:.2g}", f"{known[SETTLES]:.3f}")
        beyond = (excess(known, name) for name in EXCESS)
        row(f"{jerk:g}", "known", f"{chosen:g}", *figures, *beyond)
        figures = (spread(found[ERROR]), spread(found[SETTLES], 1.0))
        beyond = (excess(found, name) for name in EXCESS)
        row(f"{jerk:g}", learned, f"{kappa:g}", *figures, *beyond)
    unrest_table()


def unrest_table() -> None:
    """Print why a learned Jacobian and a low bound of the jerk do not go together."""
    head(
        *("`drake-rnn run ...`", "error median [um]", "max [um]"),
        *(
            "samples with a joint at its bound of the jerk",
            "rank correlation of error and J_hat's change",
        ),
    )
    for name in ("adaptive_jerk", "adaptive_jerk_learned"):
        run = simulate(load_experiment(name, {"accept": None, "log_period": 1e-3}))
        first, last = run.experiment.document.window
        inside = (run.time >= first) & (run.time <= last)
        errors, bound = run.position_error[inside], run.experiment.limits.bounds["jerk"]
        jerks = np.abs(np.diff(run.series["velocity"][inside], n=2, axis=0)) * 1e6
        share = float(np.mean((jerks >= 0.999 * bound).any(axis=1)))
        figures = (f"{np.median(errors) / MICRO:.2g}", f"{errors.max() / MICRO:.2g}")
        row(f"`{name}`", *figures, f"{share:.2f}", unrest(run, inside))


def unrest(run: Result, inside: np.ndarray) -> str:
    """Return how errors go with the change of J_hat over the last 50 ms, as text."""
    if "J_hat" not in run.series:
        return ""
    entries = run.series["J_hat"].reshape(len(run.time), -1)
    change = np.linalg.norm(entries - np.roll(entries, 50, axis=0), axis=1)
    return f"{rank_correlation(change[inside], run.position_error[inside]):.2f}"


def pose_table() -> None:
    """Print errors with the orientation, for three arms."""
    head("arm", "J", "position max [um]", "orientation max [urad]", "a beyond its bound by")
    cases = [with_seeds(f"adaptive_pose_learned{suffix}", SEEDS, {}) for suffix in POSES.values()]
    learned = f"learned, {len(SEEDS)} seeds: median / worst"
    for (arm, suffix), found in zip(POSES.items(), in_turn(*cases), strict=True):
        known = simulate(load_experiment(f"adaptive_pose{suffix}")).metrics
        figures = (f"{known[name] / MICRO:.2g}" for name in (ERROR, TURN))
        row(arm, "known", *figures, excess(known, "a"))
        row(arm, learned, spread(found[ERROR]), spread(found[TURN]), excess(found, "a"))


@cache
def sensed(name: str, jacobian: str, seed: int, sensing: Sensing) -> Result:
    """Return a run with measurements of a given quality; the law chooses its numbers for them."""
    law = {"kind": "adaptive", "jacobian": jacobian}
    changes = {"accept": None, "law": law, "seed": seed, "sensing": dict(sensing)}
    return simulate(load_experiment(name, {**changes, "log_period": 1e-3}))


def several(name: str, jacobian: str, sensing: Sensing) -> list[Result]:
    """Return runs with one seed, or with a few where J_hat starts from a random one as well."""
    seeds = FEW_SEEDS if jacobian == "learned" else FEW_SEEDS[:1]
    return [sensed(name, jacobian, seed, sensing) for seed in seeds]


def shaking(run: Result) -> float:
    """Return the root mean square of the joints' largest acceleration in the window [rad/s^2]."""
    first, last = run.experiment.document.window
    inside = (run.time >= first) & (run.time <= last)
    accelerations = np.diff(run.series["velocity"][inside], axis=0) / 1e-3
    return float(np.sqrt(np.mean(np.abs(accelerations).max(axis=1) ** 2)))


def middle(runs: Sequence[Result], metric: str) -> str:
    """Return the median of a metric in millionths, as text."""
    return f"{median(run.metrics[metric] for run in runs) / MICRO:.3g}"


def sensing_table() -> None:
    """Print errors with measurements as they are; with a learned J medians of a few seeds."""
    head(
        *("measurement", "J known: error max [um]", "rms of the largest acceleration [rad/s^2]"),
        *("J learned: error max [um]", "likewise", "a beyond its bound by"),
    )
    tasks = {words: ("adaptive_nephroid", sensing) for words, sensing in SENSED.items()}
    tasks["pose from outside, 10 um and 50 urad"] = ("adaptive_pose_learned", POSE_SENSED)
    for words, (name, sensing) in tasks.items():
        cells, worst = [], 0.0
        for jacobian in ("known", "learned"):
            runs = several(name, jacobian, sensing)
            turn = f", {middle(runs, TURN)} urad" if TURN in runs[0].metrics else ""
            cells += [middle(runs, ERROR) + turn, f"{median(map(shaking, runs)):.2f}"]
            worst = max(worst, *(run.metrics[EXCESS["a"]] for run in runs))
        row(words, *cells, f"{worst:.0e}")


def dynamic_table() -> None:
    """Print what arms with motors make of the commands."""
    head(
        *("arm", "J", "error max [um]", "settles [s]", "commanded acceleration [rad/s^2]"),
        *("the arm's acceleration [rad/s^2]", "the arm's speed [rad/s]"),
    )
    for arm, changes in MOVED.items():
        for jacobian in ("known", "learned"):
            law = {"kind": "adaptive", "jacobian": jacobian}
            changed = {"accept": None, **changes, "law": law, "level": "dynamic"}
            found = simulate(load_experiment("adaptive_nephroid_known", changed)).metrics
            row(
                *(arm, jacobian, f"{found[ERROR] / MICRO:.3g}", f"{found[SETTLES]:.2f}"),
                f"{found['network_acceleration_max_rad_s2']:.9f}",
                f"{found['joint_acceleration_max_rad_s2']:.3g}",
                f"{found['joint_velocity_max_rad_s']:.3g}",
            )


def draw(file: Path) -> None:
    """Draw errors against noise, bits and delay."""
    with common_style():
        fig = Figure(figsize=(PAGE, 2.5), layout="constrained")
        _fill(fig.subplots(1, len(PANELS), sharey=True))
        save(fig, file)


def _fill(panels: Sequence[Axes]) -> None:
    for panel, (label, key, values, factor) in zip(panels, PANELS, strict=True):
        for k, (jacobian, marker) in enumerate((("known", "o"), ("learned", "s"))):
            runs = [several("adaptive_nephroid", jacobian, ((key, value),)) for value in values]
            errors = [median(run.metrics[ERROR] for run in each) / MICRO for each in runs]
            shown = [value * factor for value in values]
            panel.plot(shown, errors, marker=marker, markersize=4, label=f"J {jacobian}", **nth(k))
        panel.set(yscale="log", xlabel=label)
        if key != "encoder_bits":
            panel.set_xscale("log")
        panel.set_xticks(shown, labels=[f"{value:g}" for value in shown])
        panel.minorticks_off()
        panel.margins(x=0.05)
    panels[0].set_ylabel("largest position error [µm]")
    panels[0].legend()


SECTIONS: dict[str, Callable[[], None]] = {
    "seeds": seeds_table,
    "jerk": jerk_table,
    "pose": pose_table,
    "sensing": sensing_table,
    "dynamic": dynamic_table,
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=SECTIONS, default=list(SECTIONS))
    parser.add_argument("--figure", type=Path, help="picture to write")
    arguments = parser.parse_args()
    for name in arguments.only:
        SECTIONS[name]()
    if arguments.figure is not None:
        draw(arguments.figure)
