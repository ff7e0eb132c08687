"""How far vertices of models lie outside the capsules that are fitted to them.

::

    pip install example-robot-data
    python benchmarks/enclosed_vertices.py [--only NAME ...] [--fine | --grippers]

For each arm of `robots.py` it reads every drawn and every collision shape of the URDF file itself,
with trimesh alone. It prints how far the farthest vertex lies outside the capsule of its body, how
much larger capsules are than the hulls of what they hold, and which bodies have no shape. With
``--fine`` these are several capsules a body, round the links that the arm's joints move and its
base, and it is proved for every face. With ``--grippers`` they are those of the grippers and hands
of these robots, as far as `GRIPPERS` names them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.geometry import CalcVolume

from drake_rnn import Arm, load_arm
from drake_rnn.robot.clearance.arm_capsules import fine_capsules, fits_of, fitted_capsules
from drake_rnn.robot.clearance.arm_shapes import Enclosing, arm_shapes, arm_surfaces, convex
from drake_rnn.robot.model.ros_packages import Packages, parse_xml
from markdown_table import head, row
from robots import ROBOTS, Robot, package_folder

#: What the names of the bodies of some grippers and hands begin with, by robot.
GRIPPERS = {
    "Panda": ("panda_hand", "panda_leftfinger", "panda_rightfinger"),
    "Jaco 2": ("j2s6s200_link_finger",),
    "SO-101": ("gripper", "moving_jaw"),
    "PR2, right": ("r_gripper",),
    "TALOS, arm": ("gripper_left",),
    "TIAGo": ("hand_",),
}
# Points round a circle.
_ROUND = 60


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=[robot.name for robot in ROBOTS])
    parser.add_argument("--fine", action="store_true", help="fit several capsules a body")
    parser.add_argument("--grippers", action="store_true", help="the same of their grippers")
    options = parser.parse_args()
    robots = [robot for robot in ROBOTS if robot.name in options.only]
    if options.grippers:
        return print_fine([robot for robot in robots if robot.name in GRIPPERS], GRIPPERS)
    if options.fine:
        return print_fine(robots)
    head(
        "robot", "bodies", "farthest vertex outside [m]", "of", "volume over hull", "without shape"
    )
    for robot in ROBOTS:
        if robot.name in options.only:
            arm = load_arm(package_folder() / robot.file, frame=robot.frame)
            far, volumes = outside(arm), volume_ratios(arm)
            body = max(far, key=lambda name: far[name])
            ratios = f"{min(volumes):.2f} to {max(volumes):.2f}"
            bare = ", ".join(arm_shapes(arm).bare)
            row(robot.name, str(len(far)), f"{max(far[body], 0.0):.1e}", body, ratios, bare)
    return None


def print_fine(robots: list[Robot], of: Mapping[str, tuple[str, ...]] | None = None) -> None:
    """Print how closely fine capsules contain the links of arms, or other bodies of them.

    Args:
        robots: The robots.
        of: What the names of the other bodies begin with, by robot.
    """
    head(
        "robot",
        "bodies",
        "capsules",
        "volume of the unions over the hulls",
        "single capsules",
        "farthest vertex outside [m]",
        "farthest face outside [m]",
        "s of processor time to fit",
    )
    for robot in robots:
        arm = load_arm(package_folder() / robot.file, frame=robot.frame)
        every, moved = arm_surfaces(arm), set(joint_bodies(arm))
        if of is not None:
            moved = {body for body in every if body.startswith(of[robot.name])}
        surfaces = {body: each for body, each in every.items() if body in moved}
        began = time.process_time()
        capsules = fine_capsules(surfaces)
        took = time.process_time() - began
        fits = fits_of(surfaces, capsules)
        hull, far = sum(fit.hull for fit in fits), -np.inf
        for body, points in vertices(arm.model):
            if body in surfaces:
                own = [capsule.outside(points) for capsule in capsules if capsule.body == body]
                far = max(far, float(np.min(own, axis=0).max()))
        single = fitted_capsules([p for p in arm_shapes(arm).parts if p.body in surfaces])
        volume = sum(Enclosing(np.array(c.ends), c.radius).volume for c in single)
        row(
            robot.name,
            len(surfaces),
            len(capsules),
            f"{sum(fit.volume for fit in fits) / hull:.2f}",
            f"{volume / hull:.2f}",
            f"{max(far, 0.0):.1e}",
            f"{max(fit.outside for fit in fits):.1e}",
            f"{took:.0f}",
        )


def joint_bodies(arm: Arm) -> list[str]:
    """Return the names of the bodies that the joints of an arm connect."""
    plant = arm.plant()
    joints = [plant.GetJointByName(name) for name in arm.joints]
    return [joints[0].parent_body().name(), *(joint.child_body().name() for joint in joints)]


def outside(arm: Arm) -> dict[str, float]:
    """Return how far the farthest vertex of each body of an arm lies outside its capsules [m]."""
    capsules = fitted_capsules(arm_shapes(arm).parts)
    found = dict[str, float]()
    for body, points in vertices(arm.model):
        own = [capsule.outside(points) for capsule in capsules if capsule.body == body]
        far = float(np.min(own, axis=0).max()) if own else np.inf
        found[body] = max(found.get(body, -np.inf), far)
    return found


def volume_ratios(arm: Arm) -> list[float]:
    """Return the volume of each fitted capsule over that of the hull of what it holds."""
    parts = arm_shapes(arm).parts
    return [
        Enclosing(np.array(capsule.ends), capsule.radius).volume
        / CalcVolume(convex(part.points, part.body))
        for part, capsule in zip(parts, fitted_capsules(parts), strict=True)
    ]


def vertices(model: Path) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the body and the vertices of each shape of a URDF file, in the body's frame [m].

    Of primitives they are points of the surface.
    """
    root, packages = parse_xml(model.read_bytes()), Packages({}, model)
    assert root is not None
    for link in root.iter("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                if (points := _points(shape, packages)) is not None:
                    yield link.get("name", ""), _placed(points, shape.find("origin"))


def _points(shape: Element, packages: Packages) -> NDArray[np.float64] | None:
    """Return points of a shape in its own frame; None for a mesh that cannot be read."""
    if (mesh := shape.find("geometry/mesh")) is not None:
        file = packages.file(mesh.get("filename", ""))
        if file is None:
            return None
        scene = trimesh.load_scene(str(file), process=False)
        if not any(len(getattr(part, "faces", ())) for part in scene.geometry.values()):
            return None
        if all(part.metadata.get("units") for part in scene.geometry.values()):
            scene = scene.convert_units("meters")
        return np.asarray(scene.to_mesh().vertices * _numbers(mesh.get("scale", "1 1 1")))
    if (box := shape.find("geometry/box")) is not None:
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return np.asarray(signs * _numbers(box.get("size", "")))
    turn = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    circle = np.stack((np.cos(turn), np.sin(turn)), axis=1)
    if (cylinder := shape.find("geometry/cylinder")) is not None:
        half, r = (0.5 * float(cylinder.get("length", 0))), float(cylinder.get("radius", 0))
        ends = [np.column_stack((r * circle, np.full(_ROUND, z))) for z in (-half, half)]
        return np.concatenate(ends)
    if (ball := shape.find("geometry/sphere")) is not None:
        z = np.cos(turn)[:, None]
        side = np.sin(turn)[:, None, None] * circle
        ring = np.concatenate((side, np.broadcast_to(z[:, None], (_ROUND, _ROUND, 1))), axis=2)
        return float(ball.get("radius", 0)) * ring.reshape(-1, 3)
    return None


def _placed(points: NDArray[np.float64], origin: Element | None) -> NDArray[np.float64]:
    """Return points where the origin of their shape places them."""
    if origin is None:
        return points
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
    turn = trimesh.transformations.euler_matrix(roll, pitch, yaw, "sxyz")[:3, :3]
    return np.asarray(points @ turn.T + _numbers(origin.get("xyz", "0 0 0")))


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(part) for part in text.split()])


if __name__ == "__main__":
    main()
