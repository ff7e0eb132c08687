"""Press with arms of other makers, by YAML alone: 5 N along a circle on a plate, as Markdown.

Takes a folder with robot models, searched by file name, e.g. that of the package
``example-robot-data`` of PyPI, and the robots by name, all by default::

    python benchmarks/foreign_contact.py FOLDER [ROBOT ...]

Each document is `contact_circle` with another ``arm``; home postures are those that `drake-rnn arm`
proposes.
"""

import argparse
import logging
from pathlib import Path
from tempfile import TemporaryDirectory

from drake_rnn import InvalidInputError, SimulationError, load_experiment, simulate
from markdown_table import head, row

#: File, and the keys of `arm` besides `model`.
ROBOTS = {
    "xarm7": (
        "xarm7.urdf",
        "frame: link_eef, tool: {length: 0.1}, home: [1.92, -1.53, -1.08, 1.1, -1.47, 1.83, -0.44]",
    ),
    "ur10": (
        "ur10_robot.urdf",
        "frame: tool0, tool: {length: 0.1}, home: [-2.84, -1.55, -1.89, -1.25, 1.47, 1.28]",
    ),
    "ur3": (
        "ur3_robot.urdf",
        "frame: tool0, tool: {length: 0.1}, home: [-0.42, -1.63, 1.84, -2.04, -1.41, -1.78]",
    ),
    "kinova": (
        "kinova.urdf",
        "frame: j2s6s200_end_effector, tool: {axis: [1, 0, 0]}, "
        "home: [1.57, 2.99, 4.67, -0.02, 2.24, 0.43]",
    ),
    "z1": (
        "z1.urdf",
        "frame: link06, tool: {axis: [1, 0, 0], length: 0.25}, "
        "home: [0.03, 1.45, -1.44, 0.72, 0.0, -0.85]",
    ),
    "panda": (
        "panda.urdf",
        "frame: panda_link8, tool: {length: 0.18}, "
        "home: [1.39, 1.32, -2.05, -2.08, 1.37, 1.5, 0.5]",
    ),
    "kr16": (
        "kr16_2.urdf",
        "frame: tool0, tool: {axis: [1, 0, 0]}, home: [0.1, -0.98, 2.0, -1.82, 1.53, 2.62]",
    ),
}
DOCUMENT = """\
arm: {{model: {model}, {arm}}}
path: {{kind: circle, plane: xy, size: 0.03, period: 20, timing: sin2, laps: 1}}
law: {{kind: motion_force, stiffness: 8000, gain: 10}}
level: dynamic
environment: {{kind: plate, friction: 0.3}}
force: {{value: 5}}
feedback: measured
limits: {{velocity: 0.5, acceleration: null}}
period: 1e-3
duration: 20
window: [2, 20]
"""
METRICS = (
    "force_error_mean_N",
    "force_error_rms_N",
    "force_error_max_N",
    "lateral_error_max_m",
    "orientation_error_max_rad",
)


def press(name: str, folder: Path, scratch: Path) -> list[str]:
    """Run a robot's document, and return its figures or why there are none."""
    file, arm = ROBOTS[name]
    models = sorted(folder.rglob(file))
    if not models:
        return [f"no {file} in {folder}"]
    document = scratch / f"{name}.yaml"
    document.write_text(DOCUMENT.format(model=models[0].resolve(), arm=arm))
    try:
        result = simulate(load_experiment(document))
    except (InvalidInputError, SimulationError) as error:
        return [str(error)]
    figures = [*(result.metrics[metric] for metric in METRICS), result.timings["real_time_factor"]]
    return [f"{figure:.2g}" for figure in figures]


def main() -> None:
    """Print a table with one row for each robot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("robots", nargs="*", default=list(ROBOTS), metavar="ROBOT")
    given = parser.parse_args()
    logging.getLogger("drake").setLevel(logging.ERROR)
    columns = ("mean [N]", "rms [N]", "largest [N]", "aside [m]", "turned [rad]")
    head("arm", "keys of `arm`", *columns, "real-time factor")
    with TemporaryDirectory() as scratch:
        for name in given.robots:
            row(name, f"`{ROBOTS[name][1]}`", *press(name, given.folder, Path(scratch)))


if __name__ == "__main__":
    main()
