"""The meshes of an arm's maker, in the frames of the bodies of a shipped arm.

The meshes are not shipped. Each source is found in its installed package or in the folder that the
option ``--folder PACKAGE=FOLDER`` names.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from drake_rnn import load_arm
from drake_rnn.inputs.fields import Array
from drake_rnn.robot.arm import Arm
from drake_rnn.robot.clearance.arm_shapes import arm_surfaces
from drake_rnn.robot.model.ros_packages import Packages, expand_xacro, is_xacro, parse_xml

# Where packages lie in a folder of installed packages.
INSTALLED = {
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
    "pybullet_data": "pybullet_data",
}
# Postures in which the frames of two models are compared, and how far these may be apart [m, rad].
POSTURES, EXACT = 20, 1e-9


@dataclass(frozen=True)
class Source:
    """A maker's model of an arm.

    Attributes:
        package: The package that holds it.
        version: Version or commit of the package.
        model: The model's file in the package.
        frame: A frame behind the last joint there.
        within: How far its bodies may be from those of the shipped arm in any posture [m, rad].
        bodies: Number of the bodies whose meshes are taken, the base is 0; None for all.
        more: Further meshes, in the frames of bodies of the shipped arm: file by body.
    """

    package: str
    version: str
    model: str
    frame: str
    within: float = EXACT
    bodies: tuple[int, ...] | None = None
    more: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        some = "" if self.bodies is None else f", links {', '.join(map(str, self.bodies))} alone"
        more = "".join(f", {file}" for file in self.more.values())
        return f"{self.package} {self.version}, {self.model}{some}{more}"


_FRANKA = ("franka_description", "commit 566ba44")
#: The sources of each shipped arm.
SOURCES = {
    "panda": (
        Source("example-robot-data", "6.0.0", "panda_description/urdf/panda.urdf", "panda_link8"),
        Source("pybullet_data", "3.2.7", "franka_panda/panda.urdf", "panda_link8"),
    ),
    # Its repository has no visual meshes of the FR3's links 0, 6 and 7, which are the Panda's
    # within a millimetre.
    "fr3": (
        Source(*_FRANKA, "robots/fr3/fr3.urdf.xacro", "fr3_link8"),
        Source(*_FRANKA, "robots/fer/fer.urdf.xacro", "fer_link8", bodies=(0, 6, 7)),
    ),
    "ur5": (Source("example-robot-data", "6.0.0", "ur_description/urdf/ur5_robot.urdf", "tool0"),),
    "iiwa14": (
        Source("lbr_description", "commit 218d723", "urdf/iiwa14/iiwa14.xacro", "lbr_link_ee"),
        Source("pybullet_data", "3.2.7", "kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    ),
    # That model rounds its angles to 1e-4 rad.
    "gen3": (
        Source(
            "kortex_description",
            "commit 6cd75d4",
            "robots/gen3.xacro",
            "end_effector_link",
            within=5e-5,
            more={"bracelet_link": "arms/gen3/7dof/meshes/bracelet_no_vision_link.STL"},
        ),
    ),
}

#: The sources of each shipped gripper, on an arm, and what names of its bodies begin with there.
GRIPPERS = {
    "franka_hand": (
        Source("example-robot-data", "6.0.0", "panda_description/urdf/panda.urdf", "panda_hand"),
        Source("pybullet_data", "3.2.7", "franka_panda/panda.urdf", "panda_hand"),
    )
}
PREFIXES = {"franka_hand": "panda_"}


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of a body, in its frame.

    Attributes:
        body: Name of the body of the shipped arm.
        role: ``collision`` or ``visual``.
        vertices: Vertices, shape (k, 3) [m].
        faces: Numbers of the corners of each triangle, shape (t, 3).
    """

    body: str
    role: str
    vertices: Array
    faces: NDArray[np.int64]

    @classmethod
    def of(cls, parts: Iterable[Surface]) -> Surface:
        """Return the triangles of several meshes of one body as one."""
        parts = list(parts)
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        faces = [part.faces + start for part, start in zip(parts, starts[:-1], strict=True)]
        vertices = np.concatenate([part.vertices for part in parts])
        return cls(parts[0].body, parts[0].role, vertices, np.concatenate(faces))

    @property
    def points(self) -> Array:
        """Corners of its triangles, shape (j, 3) [m]."""
        return self.vertices[np.unique(self.faces)]


def add_folders(parser: argparse.ArgumentParser) -> None:
    """Add the option that says where packages lie."""
    parser.add_argument(
        "--folder",
        action="append",
        default=[],
        metavar="PACKAGE=FOLDER",
        help="where a package of meshes lies; installed ones are found",
    )


def sources_of(arm: str, given: Iterable[str]) -> list[tuple[Source, Path]]:
    """Return the sources of a shipped arm, and where the package of each lies.

    Raises:
        SystemExit: If there are none, or a package is not found.
    """
    if arm not in SOURCES | GRIPPERS:
        raise SystemExit(f"no maker's meshes are known of {arm}; it is fitted to its own drawing")
    named = dict(each.split("=", 1) for each in given)
    found = []
    for source in (SOURCES | GRIPPERS)[arm]:
        places = [Path(folder) / INSTALLED.get(source.package, "-") for folder in sys.path]
        if source.package in named:
            places = [Path(named[source.package])]
        folder = next((place for place in places if (place / source.model).is_file()), None)
        if folder is None:
            raise SystemExit(
                f"{source} is not found; give its folder: --folder {source.package}=FOLDER"
            )
        found.append((source, folder))
    return found


def surfaces_of(arm: Arm, source: Source, folder: Path) -> list[Surface]:
    """Return the meshes of a maker's model, link by link, in the body frames of a shipped arm.

    Hands and other things at the flange are left out.

    Raises:
        SystemExit: If the two are not the same arm, or a shape is no mesh.
    """
    model, theirs, packages = folder / source.model, *_model_of(source, folder)
    places = Packages(packages, model)
    root = parse_xml(model.read_bytes())
    if root is not None and is_xacro(root):
        root = parse_xml(expand_xacro(model, places))
    assert root is not None
    links = {link.get("name"): link for link in root.iter("link")}
    found = []
    for number, (name, body, X_BL) in enumerate(_offsets(arm, theirs, source.within)):
        for role in ("collision", "visual"):
            for shape in links[name].findall(role):
                if source.bodies is None or number in source.bodies:
                    found += _surfaces(shape, role, body, X_BL, places)
    for body, file in source.more.items():
        found.append(_read(folder / file, np.ones(3), RigidTransform(), body, "collision"))
    return found


def _model_of(source: Source, folder: Path) -> tuple[Arm, dict[str, str]]:
    """Return a maker's model, and the folders of the packages that it names."""
    # Of example-robot-data the package is the folder above.
    inside = source.package == "example-robot-data"
    packages = {source.package: str(folder.parent if inside else folder)}
    model = folder / source.model
    return load_arm(model, frame=source.frame, packages=packages, limits=None, tool=None), packages


def gripper_surfaces(name: str, bodies: Iterable[str], folders: list[str]) -> dict[str, Array]:
    """Return all triangles that a maker has of bodies of a gripper, shape (t, 3, 3) each [m]."""
    found: dict[str, list[Array]] = {body: [] for body in bodies}
    for source, folder in sources_of(name, folders):
        theirs = arm_surfaces(_model_of(source, folder)[0])
        for body, each in found.items():
            each.append(theirs[PREFIXES[name] + body])
    return {body: np.concatenate(each) for body, each in found.items()}


def _surfaces(
    shape: Element, role: str, body: str, X_BL: RigidTransform, places: Packages
) -> list[Surface]:
    given = shape.find("geometry/mesh")
    if given is None:
        raise SystemExit(f"{body}: {role} is no mesh")
    file = places.file(given.get("filename", ""))
    if file is None:
        print(f"# {body}: there is no {role} mesh {given.get('filename')}", file=sys.stderr)
        return []
    scale = np.array([float(x) for x in given.get("scale", "1 1 1").split()])
    return [_read(file, scale, X_BL @ _origin(shape.find("origin")), body, role)]


def _read(file: Path, scale: Array, X: RigidTransform, body: str, role: str) -> Surface:
    scene = trimesh.load_scene(str(file), process=False)
    if all(part.metadata.get("units") for part in scene.geometry.values()):
        scene = scene.convert_units("meters")
    mesh = scene.to_mesh()
    vertices = (np.asarray(mesh.vertices) * scale) @ X.rotation().matrix().T + X.translation()
    return Surface(body, role, vertices, np.asarray(mesh.faces))


def _origin(element: Element | None) -> RigidTransform:
    if element is None:
        return RigidTransform()
    xyz, rpy = ([float(x) for x in element.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return RigidTransform(RollPitchYaw(rpy), xyz)


def bodies_of(arm: Arm, plant: MultibodyPlant) -> list[RigidBody]:
    """Return the bodies that the joints of an arm connect, from its base on."""
    joints = [plant.GetJointByName(name) for name in arm.joints]
    return [joints[0].parent_body(), *(joint.child_body() for joint in joints)]


def poses_of(arm: Arm, q: Array) -> dict[str, RigidTransform]:
    """Return the poses of these bodies in the world, by name."""
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, q))
    return {body.name(): body.EvalPoseInWorld(context) for body in bodies_of(arm, plant)}


def _offsets(arm: Arm, theirs: Arm, within: float) -> list[tuple[str, str, RigidTransform]]:
    """Return each link of a maker, our body, and the link's pose in it.

    Raises:
        SystemExit: If a link's pose in our body depends on the posture.
    """
    ours, other = poses_of(arm, np.zeros(arm.n)), poses_of(theirs, np.zeros(arm.n))
    X_BL = [B.inverse() @ L for B, L in zip(ours.values(), other.values(), strict=True)]
    rng, worst = np.random.default_rng(0), 0.0
    for q in rng.uniform(-np.pi, np.pi, (POSTURES, arm.n)):
        pairs = zip(poses_of(arm, q).values(), poses_of(theirs, q).values(), X_BL, strict=True)
        worst = max(worst, *(_apart(B @ X, L) for B, L, X in pairs))
    file = theirs.model.name
    print(f"# {file}: bodies agree to {worst:.0e} in {POSTURES} postures", file=sys.stderr)
    if worst > within:
        raise SystemExit(f"{file}: its bodies do not move as those of {arm.name}")
    # An offset that is nothing but rounding is none.
    exact = [RigidTransform() if _apart(X, RigidTransform()) <= within else X for X in X_BL]
    return list(zip(other, ours, exact, strict=True))


def _apart(one: RigidTransform, other: RigidTransform) -> float:
    return float(np.abs(one.GetAsMatrix34() - other.GetAsMatrix34()).max())
