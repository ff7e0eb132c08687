"""Models of things that stand still: what of their files is a shape, and where Drake places it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from pydrake.geometry import Role, SceneGraph, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from ...errors import InvalidInputError
from ...inputs.given_file import content_of, is_file
from ..drake_log import drake_warnings
from .conversion import obj_file, require_finite
from .geometry import MeshName
from .model import one_line
from .packages import Packages
from .xml_text import MOST_BYTES, parse_xml, write_xml

# Drake's names of the formats, by the root element.
_FORMATS = {"robot": "urdf", "sdf": "sdf"}
# What says nothing of a shape, and could be at fault.
_NO_SHAPE = {"material", "inertial", "transmission"}


class StillModel:
    """A URDF or SDF file whose bodies do not move, as Drake places them in the world.

    A body counts with its collision geometry, or with what it draws where it has none. Bodies that
    are not fixed to others are where the file places them.

    Args:
        file: The file.

    Raises:
        ValueError: If it cannot be read, has joints that move, no geometry, or geometry that Drake
            does not read. The message is a sentence that names the file.
    """

    def __init__(self, file: Path) -> None:
        root = _root(file)
        count = _keep_shapes(root, Packages({}, file), file.name)
        # The plant points to the scene graph, which must outlive it.
        self._scene_graph = SceneGraph()
        self._plant = MultibodyPlant(0.0)
        self._plant.RegisterAsSourceForSceneGraph(self._scene_graph)
        parser = Parser(self._plant)
        parser.SetAutoRenaming(True)
        try:
            with drake_warnings():
                parser.AddModelsFromString(write_xml(root), _FORMATS[root.tag])
                self._plant.Finalize()
        # Drake exits where a condition of its own code fails.
        except (RuntimeError, ValueError, SystemExit) as error:
            raise ValueError(f"{file.name} cannot be read: {one_line(error)}") from None
        self._context = self._plant.CreateDefaultContext()
        self._inspector = self._scene_graph.model_inspector()
        found = len(list(self.shapes()))
        if found == 0:
            raise ValueError(f"{file.name} has no geometry")
        if found != count:
            raise ValueError(f"{file.name}: Drake reads {found} of its {count} shapes")

    def shapes(self) -> Iterator[tuple[str, RigidTransform, Shape]]:
        """Yield the body, the pose in the model's frame and the shape of each geometry."""
        for body in map(self._plant.get_body, map(BodyIndex, range(self._plant.num_bodies()))):
            frame = self._plant.GetBodyFrameIdOrThrow(body.index())
            X_MB = body.EvalPoseInWorld(self._context)
            for role in (Role.kProximity, Role.kIllustration):
                for geometry in self._inspector.GetGeometries(frame, role):
                    X_BG = self._inspector.GetPoseInFrame(geometry)
                    yield body.name(), X_MB @ X_BG, self._inspector.GetShape(geometry)


def _root(file: Path) -> Element:
    """Return the root element of a model file."""
    if not is_file(file):
        raise ValueError(f"no file {str(file)!r}")
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise ValueError(f"{file.name} {error}") from None
    if root is None or root.tag not in _FORMATS:
        raise ValueError(f"{file.name} is neither URDF nor SDF")
    if next(root.iter("include"), None) is not None:
        raise ValueError(f"{file.name} includes other models; write out what they hold")
    for joint in root.iter("joint"):
        # A transmission of URDF names joints, too.
        if (kind := joint.get("type")) not in {None, "fixed"}:
            raise ValueError(
                f"{file.name}: the joint {joint.get('name')!r} is {kind}; all must be fixed"
            )
    return root


def _keep_shapes(root: Element, packages: Packages, name: str) -> int:
    """Leave the shapes of a model that count, with meshes that Drake reads; return their number."""
    count = 0
    for link in root.iter("link"):
        drawn, touched = link.findall("visual"), link.findall("collision")
        for visual in drawn if touched else ():
            link.remove(visual)
        for shape in touched or drawn:
            count += 1
            for mesh in shape.iterfind("geometry/mesh"):
                uri = mesh.find("uri")
                named = MeshName(mesh, "filename") if uri is None else MeshName(uri)
                named.change(_readable(named.uri, packages, name))
    for parent in [*root.iter()]:
        for child in [child for child in parent if child.tag in _NO_SHAPE]:
            parent.remove(child)
    return count


def _readable(uri: str, packages: Packages, name: str) -> Path:
    """Return a mesh as a file of whose vertices Drake makes a hull."""
    file = packages.file(uri)
    if file is None:
        raise ValueError(f"{name}: its mesh {uri!r} is missing")
    try:
        if file.suffix.lower() in {".obj", ".gltf"}:
            require_finite(file)
            return file
        return obj_file(file)
    except InvalidInputError:
        raise
    # What a reader of many formats raises at a broken file is not known.
    except Exception as error:
        told = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise ValueError(f"{name}: its mesh {uri!r} cannot be read: {told}") from None


def require_finite_meshes(key: str, root: Element, file: Path) -> None:
    """Raise a ValueError if a mesh that a model names has a vertex that is not finite.

    Args:
        key: What names the model, for the message.
        root: The model.
        file: Its file.
    """
    packages = Packages({}, file)
    for mesh in root.iter("mesh"):
        uri = mesh.findtext("uri") or mesh.get("filename") or mesh.get("file") or ""
        if (found := packages.file(uri.strip())) is None:
            continue
        try:
            require_finite(found)
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            told = " ".join(str(error).split())[:120]
            raise ValueError(f"{key}: its mesh {uri!r} cannot be read: {told}") from None
