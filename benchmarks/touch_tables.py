"""Print the tables of touch as Markdown: admittance beside laws that press.

`make tables` runs this.
"""

from pathlib import Path

from drake_rnn import Result, load_experiment, simulate
from markdown_table import head, row

TASKS = (
    "contact_circle",
    "adaptive_contact_circle",
    "adaptive_admittance",
    "adaptive_admittance_dome",
)
FIGURES = (
    "force_error_rms_N",
    "force_error_max_N",
    "normal_force_peak_N",
    "lateral_error_max_m",
    "orientation_error_max_rad",
)
MODEL = Path(__file__).parents[1] / "diagrams" / "experiments" / "adaptive" / "dome.sdf"
DOME = {
    "arm": {"model": "iiwa14", "frame": "tip"},
    "task": "pose",
    "path": {"kind": "line", "by": [0, 0.04, 0], "period": 2.5, "timing": "quintic"},
    "level": "dynamic",
    "environment": {"kind": "model", "model": str(MODEL), "offset": [0, 0, -0.3]},
    "force": {"value": 5, "rise_time": 0.3},
    "period": 1e-3,
    "duration": 2.5,
    "window": [1.0, 2.5],
}
BOUNDED, UNBOUNDED = {"velocity": 0.5, "acceleration": 10.0}, {"velocity": 0.5}
ADMITTANCE = {"law": {"kind": "adaptive"}, "limits": BOUNDED, "force.kind": "admittance"}
#: What presses on the dome, and the changes of the document.
OVER_THE_DOME = {
    "motion-force control, gain 10": {
        "law": {"kind": "motion_force", "stiffness": 8000, "gain": 10},
        "task": "xyz",
        "limits": {**UNBOUNDED, "acceleration": None},
    },
    "adaptive, `force_control`, gain 10": {
        "law": {"kind": "adaptive", "force_control": {"stiffness": 8000, "gain": 10}},
        "limits": BOUNDED,
    },
    "admittance, 400 N s/m": ADMITTANCE,
    "the same, 200 N s/m and `follow: 10`": {
        **ADMITTANCE,
        "force.damping": 200.0,
        "force.follow": 10.0,
    },
}


def figures(result: Result, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return metrics of a run as text, with two digits more than tell the size of a force."""
    return tuple(f"{result.metrics[name]:.3g}" for name in names)


def tasks_table() -> None:
    """Print the forces of the circle on a plate, by each way of pressing, and on the dome."""
    head(
        *("`drake-rnn run ...`", "rms [N]", "largest error [N]", "peak [N]"),
        *("aside [m]", "turned [rad]"),
    )
    for name in TASKS:
        row(f"`{name}`", *figures(simulate(load_experiment(name)), FIGURES))


def dome_table() -> None:
    """Print the force errors over a dome, told the normal of the start, and that below the tool."""
    head(
        *("over a dome, from 1 to 2.5 s", "start: rms [N]", "largest [N]"),
        *("local: rms [N]", "largest [N]"),
    )
    for name, changes in OVER_THE_DOME.items():
        errors: list[str] = []
        for normals in ("start", "local"):
            document = load_experiment({**DOME, **_whole(changes)}, _keys(changes, normals))
            errors += figures(simulate(document), FIGURES[:2])
        row(name, *errors)


def _whole(changes: dict[str, object]) -> dict[str, object]:
    """Return the sections that are given as a whole."""
    return {key: value for key, value in changes.items() if "." not in key}


def _keys(changes: dict[str, object], normals: str) -> dict[str, object]:
    """Return the single keys, with the normals that the law is told."""
    return {k: v for k, v in changes.items() if "." in k} | {"environment.normals": normals}


if __name__ == "__main__":
    tasks_table()
    dome_table()
