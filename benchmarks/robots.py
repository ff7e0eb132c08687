"""Load the manipulators of the PyPI package example-robot-data, run three laws on each.

Prints the table of `docs/robots.md` as Markdown::

    pip install example-robot-data
    python benchmarks/robots.py [folder] [--only NAME ...] [--playbacks FOLDER] [--jobs JOBS]

The folder is that of the package's robots; it is found by itself where the package is installed
beside this one. Every model that has a chain of five or more joints to a named tip is in the table,
except variants of the same arm.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import (
    Arm,
    DrakeRnnError,
    InvalidInputError,
    Result,
    load_arm,
    make_experiment,
    simulate,
    write_playback,
)
from markdown_table import head, row

# A circle of 20 mm in 2 s, from rest to rest; then the arm holds still.
COMMON = {
    "path": {"kind": "circle", "size": 0.02, "period": 2.0, "timing": "quintic", "laps": 1},
    "limits": {"acceleration": 10.0},
    "period": 1e-3,
    "duration": 3.0,
}
LAWS: dict[str, dict[str, Any]] = {
    "pseudoinverse": {"kind": "pseudoinverse"},
    "SLC, known Jacobian": {"kind": "simultaneous_learning", "jacobian": "known"},
    "NALJDF": {"kind": "joint_drift_free", "scheme": "naljdf"},
}


@dataclass(frozen=True)
class Robot:
    """A model and the tip that follows the path."""

    name: str
    maker: str
    file: str
    frame: str


ROBOTS = (
    Robot("UR3", "Universal Robots", "ur_description/urdf/ur3_robot.urdf", "tool0"),
    Robot("UR5", "Universal Robots", "ur_description/urdf/ur5_robot.urdf", "tool0"),
    Robot("UR5, gripper", "Universal Robots", "ur_description/urdf/ur5_gripper.urdf", "tool0"),
    Robot("UR10", "Universal Robots", "ur_description/urdf/ur10_robot.urdf", "tool0"),
    Robot("Panda", "Franka", "panda_description/urdf/panda.urdf", "panda_hand_tcp"),
    Robot("xArm7", "UFACTORY", "xarm_description/urdf/xarm7.urdf", "link_eef"),
    Robot("Jaco 2", "Kinova", "kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    Robot("Z1", "Unitree", "z1_description/urdf/z1.urdf", "link06"),
    Robot("B1 with Z1", "Unitree", "b1_description/urdf/b1-z1.urdf", "gripperStator"),
    Robot(
        "G1, left arm", "Unitree", "g1_description/urdf/g1_29dof_rev_1_0.urdf", "left_rubber_hand"
    ),
    Robot("SO-100", "TheRobotStudio", "so_arm_description/urdf/so100.urdf", "gripper"),
    Robot("SO-101", "TheRobotStudio", "so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
    Robot("Baxter, left", "Rethink", "baxter_description/urdf/baxter.urdf", "left_gripper"),
    Robot("Baxter, right", "Rethink", "baxter_description/urdf/baxter.urdf", "right_gripper"),
    Robot("PR2, right", "Willow Garage", "pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame"),
    Robot("TIAGo", "PAL", "tiago_description/robots/tiago.urdf", "hand_tool_link"),
    Robot("TIAGo, dual", "PAL", "tiago_description/robots/tiago_dual.urdf", "hand_left_tool_link"),
    Robot("TIAGo Pro", "PAL", "tiago_pro_description/robots/tiago_pro.urdf", "arm_left_tool_link"),
    Robot("TALOS, arm", "PAL", "talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link"),
    Robot("TALOS", "PAL", "talos_data/robots/talos_full_v2.urdf", "gripper_left_base_link"),
    Robot("Alex", "IHMC", "alex_description/urdf/alex_nub_hands.urdf", "leftNub"),
    Robot("Romeo", "Aldebaran", "romeo_description/urdf/romeo_small.urdf", "r_wrist"),
    Robot("iCub", "IIT", "icub_description/robots/icub.urdf", "l_gripper"),
    Robot("Centauro", "IIT", "centauro_description/urdf/centauro.urdf", "arm1_8"),
    Robot(
        "ANYmal with Jaco 2",
        "ANYbotics",
        "anymal_b_simple_description/robots/anymal-kinova.urdf",
        "j2s6s200_end_effector",
    ),
    Robot(
        "hextilt",
        "LAAS",
        "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
        "flying_arm_5__gripper",
    ),
    Robot(
        "simple humanoid",
        "Gepetto",
        "simple_humanoid_description/urdf/simple_humanoid.urdf",
        "l_wrist",
    ),
    Robot("human", "Gepetto", "human_description/robots/human.urdf", "left_hand"),
)


def package_folder() -> Path:
    """Return the folder of the robots of the installed package.

    Raises:
        InvalidInputError: If the package is not installed.
    """
    inside = "cmeel.prefix/share/example-robot-data/robots"
    for place in sys.path:
        if (folder := Path(place) / inside).is_dir():
            return folder
    raise InvalidInputError("folder: example-robot-data is not installed; give its robots' folder")


def dexterous_posture(arm: Arm) -> np.ndarray:
    """Return the best conditioned of 300 postures well inside the position limits, shape (n,)."""
    kinematics = arm.kinematics()
    lower = np.maximum(arm.limits.position_lower, -np.pi)
    upper = np.minimum(arm.limits.position_upper, np.pi)
    postures = np.random.default_rng(0).uniform(
        lower + 0.15 * (upper - lower), upper - 0.15 * (upper - lower), (300, arm.n)
    )

    def worst_direction(q: np.ndarray) -> float:
        return float(np.linalg.svd(kinematics.J(q), compute_uv=False)[-1])

    return max(postures, key=worst_direction)


def run(robot: Robot, folder: Path, law: dict[str, Any]) -> Result:
    """Return the result of one law on one robot."""
    arm = {"model": str(folder / robot.file), "frame": robot.frame}
    start = dexterous_posture(load_arm(**arm)).round(3).tolist()
    name = f"{robot.name}, {law['kind']}"
    return simulate(
        make_experiment({"name": name, "arm": arm, "start": start, "law": law, **COMMON})
    )


def two_digits(value: float) -> str:
    """Return a number rounded to two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def line(robot: Robot, folder: Path, playbacks: Path | None) -> list[str]:
    """Return a robot's cells of the table."""
    try:
        arm = load_arm(folder / robot.file, frame=robot.frame)
    except InvalidInputError as error:
        return [robot.name, robot.maker, "", f"refused: {error}"]
    kinds = "".join({"rad": "R", "m": "P"}[unit] for unit in arm.units)
    cells, drift = [robot.name, robot.maker, kinds], ""
    for name, law in LAWS.items():
        try:
            result = run(robot, folder, law)
        except DrakeRnnError as error:
            cells.append(f"refused: {error}")
            continue
        cells.append(two_digits(1e6 * result.metrics["position_error_max_m"]))
        drift = two_digits(1e3 * result.metrics["joint_drift_max_rad"])
        if playbacks is not None and name == "pseudoinverse":
            stem = robot.name.replace(",", "").replace(" ", "_").lower()
            write_playback(result, playbacks / f"{stem}.html")
    return [*cells, drift, str(len(arm.warnings))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", help="folder of the package's robots")
    parser.add_argument("--only", nargs="+", help="robots, by name; all of them by default")
    parser.add_argument("--playbacks", type=Path, help="write a page of each robot to this folder")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    folder = arguments.folder or package_folder()
    robots = [robot for robot in ROBOTS if arguments.only is None or robot.name in arguments.only]
    if arguments.playbacks is not None:
        arguments.playbacks.mkdir(parents=True, exist_ok=True)
    errors = (f"{name}: error [um]" for name in LAWS)
    head("robot", "maker", "joints", *errors, "NALJDF: drift [mrad]", "warnings")
    # Drake's threads do not survive a fork.
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool:
        count = len(robots)
        lines = pool.map(line, robots, [folder] * count, [arguments.playbacks] * count)
        for cells in lines:
            row(*cells)


if __name__ == "__main__":
    main()
