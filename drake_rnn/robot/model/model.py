"""A robot's model file as it is given to Drake.

- A robot's model with displaced joints.
- A model of any format as URDF, and two models as one, side by side.
- Models of things that stand still: what of their files is a shape, and where Drake places it.
- Settings of Drake: its log, and the resolution of contact meshes.
- Control of Drake's log.
- The meshes of balls in contact: how fine they may be.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pydrake.geometry import Role, SceneGraph, Shape
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex

from ...errors import InvalidInputError
from ...inputs.fields import Array
from ...inputs.files import content_of, is_file
from ...inputs.messages import nearest
from ..rotation import rotation_by
from .formats import (
    MOVING,
    Mimic,
    WrittenUrdf,
    mend_sdf,
    mend_sizes,
    mend_urdf,
    mimics_of,
    numbers_text,
)
from .meshes import LostMesh, Meshes, MeshName, about, mend_materials, obj_file, require_finite
from .mjcf import Flat, mend_mjcf
from .ros_packages import MOST_BYTES, Packages, expand_xacro, is_xacro, parse_xml, write_xml


@contextmanager
def quiet_drake(least: int) -> Iterator[None]:
    """Suppress Drake's messages below the `logging` level ``least`` within a with-block."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(max(level, least))
    try:
        yield
    finally:
        log.setLevel(level)


@contextmanager
def drake_warnings() -> Iterator[list[str]]:
    """Collect Drake's warnings within a with-block instead of logging them.

    They are collected even where the program has silenced Drake's log.
    """
    log = logging.getLogger("drake")
    level, is_disabled = log.level, log.disabled
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            messages.append(record.getMessage())
        return record.levelno != logging.WARNING

    log.setLevel(min(log.getEffectiveLevel(), logging.WARNING))
    log.disabled = False
    log.addFilter(collect)
    try:
        yield messages
    finally:
        log.removeFilter(collect)
        log.setLevel(level)
        log.disabled = is_disabled


#: Least edge length of a ball's mesh, in radii of the ball: it takes seconds to make, and a finer
#: one minutes.
FINEST = 0.04


def require_coarse(key: str, edge: float, radius: float) -> None:
    """Raise an InvalidInputError for a mesh that cannot be made in a reasonable time.

    Args:
        key: What gives the edge length, for the message.
        edge: Edge length of the mesh [m].
        radius: Radius of the ball [m].
    """
    if edge < FINEST * radius:
        raise InvalidInputError(
            f"{key}: must be at least {FINEST:g} of the ball's radius, {FINEST * radius:g} m, "
            f"not {edge:g}"
        )


def require_coarse_balls(key: str, root: Element) -> None:
    """Raise an InvalidInputError as `require_coarse` does, for the balls of a model file.

    Args:
        key: What names the file, for the message.
        root: The model, as URDF or SDF; MJCF has no such meshes.
    """
    for collision in root.iter("collision"):
        balls = [*collision.iter("sphere"), *collision.iterfind("geometry/sphere/radius")]
        radii = list(_numbers(balls, "radius"))
        for edge in _numbers(collision.iter("drake:mesh_resolution_hint"), "value"):
            for radius in radii:
                require_coarse(f"{key}: drake:mesh_resolution_hint", edge, radius)


def _numbers(elements: Iterable[Element], attribute: str) -> Iterator[float]:
    """Yield the numbers that elements have as an attribute or as text; Drake tells of others."""
    for element in elements:
        with suppress(TypeError, ValueError):
            yield float(element.get(attribute) or element.text or "")


_PLACE = re.compile(r"<literal-string>\.\w+(:\d+)?: ((error|warning): )?")
# Distance of a joint from its link [m].
_FARTHEST = 1e3
# Drake's names of the formats, by the root element.
_FORMATS = {"robot": "urdf", "sdf": "sdf", "mujoco": "xml"}


@dataclass(frozen=True)
class Model:
    """A model file, in a form that Drake reads.

    Attributes:
        file: The file.
        packages: Folders of the packages that it names.
        text: What Drake reads in place of the file; None if it reads the file itself.
        format: Format of the text: ``urdf``, ``sdf`` or ``xml``.
        mimics: Joints that follow others.
        postures: Positions of joints in the postures that the file names [rad or m].
        warnings: Changes that alter the physics or the looks, and warnings of Drake.
        lost: Meshes of links that cannot be read.
    """

    file: Path
    packages: Mapping[str, str]
    text: str | None = None
    format: str = ""
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    postures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    lost: tuple[LostMesh, ...] = ()

    def add_to(self, plant: MultibodyPlant) -> ModelInstanceIndex:
        """Parse the model into ``plant``, before it is finalized.

        Raises:
            InvalidInputError: If Drake cannot read it, or it holds several models.
        """
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        for package, folder in self.packages.items():
            try:
                parser.package_map().Add(package, folder)
            except RuntimeError as error:
                raise InvalidInputError(f"arm.packages.{package}: {one_line(error)}") from None
        before = plant.num_model_instances()
        try:
            if self.text is None:
                instances = parser.AddModels(str(self.file))
            else:
                instances = parser.AddModelsFromString(self.text, self.format)
        # Drake exits where a condition of its own code fails, e.g. at a negative velocity limit.
        except (RuntimeError, ValueError, SystemExit) as error:
            is_missing = "unknown package" in str(error)
            hint = "; give the package's folder in arm.packages" if is_missing else ""
            raise InvalidInputError(
                f"arm.model: {self.file} cannot be read: {one_line(error)}{hint}"
            ) from None
        # Drake does not return a model in another format that one of SDF includes.
        count = plant.num_model_instances() - before
        if len(instances) != 1 or count != 1:
            hint = "; what it includes becomes a part of it by <include merge='true'>"
            raise InvalidInputError(
                f"arm.model: {self.file} holds {max(len(instances), count)} models; it must hold "
                f"one{hint if instances else ''}"
            )
        return instances[0]


def read_model(
    file: Path, packages: Mapping[str, str], arguments: Mapping[str, object] | None = None
) -> Model:
    """Return a model that Drake can read, checked by reading it with its geometry.

    A file that needs no change is given to Drake as it is.

    Args:
        file: URDF, SDF, MJCF or xacro file.
        packages: Folders of packages by name.
        arguments: Arguments of the macros of a xacro file.

    Raises:
        InvalidInputError: If the file or a package does not exist, or Drake cannot read the model.
    """
    _require_files(file, packages)
    return _check(_mend_file(file, packages, arguments))


def read_shapes(
    file: Path,
    packages: Mapping[str, str],
    arguments: Mapping[str, object] | None = None,
    whole: bool = False,
) -> Model:
    """Return the same model with all of its collision meshes, which is read for distances alone.

    A run does not see it: there, only the tool makes contact. Meshes of URDF and SDF are replaced
    by their convex hulls unless they are to stay ``whole``.

    Args:
        file: A file that `read_model` has read.
        packages: Folders of packages by name.
        arguments: Arguments of the macros of a xacro file.
        whole: Whether meshes stay what they are.

    Raises:
        InvalidInputError: If the file cannot be read any more.
    """
    _require_files(file, packages)
    return _mend_file(file, packages, arguments, for_distances=True, whole=whole)


def _require_files(file: Path, packages: Mapping[str, str]) -> None:
    """Raise an InvalidInputError if a model file or the folder of a package does not exist."""
    if not is_file(file):
        raise InvalidInputError(f"arm.model: no file {str(file)!r}")
    for package, folder in packages.items():
        if not Path(folder).is_dir():
            raise InvalidInputError(f"arm.packages.{package}: no folder {folder!r}")


def _mend_file(
    file: Path,
    packages: Mapping[str, str],
    arguments: Mapping[str, object] | None,
    for_distances: bool = False,
    whole: bool = False,
) -> Model:
    places = Packages(packages, file)
    root, is_expanded = _open(file, places, arguments)
    if root is None:
        return Model(file, packages)
    require_coarse_balls(f"arm.model: {file.name}", root)
    before, meshes = write_xml(root), Meshes(places, for_distances, whole)
    try:
        told = mend_materials(root, places)
        told += [] if root.tag == "mujoco" else mend_sizes(root)
        read = _mend(root, meshes, places, file.stem)
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(f"arm.model: {file} cannot be read: {one_line(error)}") from None
    texts = (f"arm.model: {file.name}: {warning}" for warning in (*told, *read.warnings))
    model = Model(file, packages, mimics=read.mimics, postures=read.postures)
    text, form = write_xml(root), _FORMATS[root.tag]
    if text == before and not is_expanded and file.suffix.lower() == f".{form}":
        return model
    return replace(model, text=text, format=form, warnings=tuple(texts), lost=tuple(meshes.lost))


def _open(
    file: Path, places: Packages, arguments: Mapping[str, object] | None
) -> tuple[Element | None, bool]:
    """Return a model, None if it is not well-formed, and whether it had macros, now expanded."""
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise InvalidInputError(f"arm.model: {file} {error}") from None
    is_expanded = root is not None and is_xacro(root)
    if is_expanded:
        root = parse_xml(expand_xacro(file, places, arguments))
    elif arguments:
        raise InvalidInputError(f"arm.xacro_arguments: {file.name} has no macros")
    if root is not None:
        _require_whole(root, file)
    if is_expanded and root is not None and root.find("link") is None:
        raise InvalidInputError(
            f"arm.model: {file} defines macros and uses none, so it has no links; give the file "
            "that uses them"
        )
    return root, is_expanded


def _require_whole(root: Element, file: Path) -> None:
    """Raise an InvalidInputError for a part of a model, or another kind of document."""
    if root.tag == "mujocoinclude":
        raise InvalidInputError(
            f"arm.model: {file} is a part that models include (mujocoinclude); give the model"
        )
    if root.tag not in _FORMATS:
        raise InvalidInputError(
            f"arm.model: {file} is no URDF, SDF or MJCF: its outermost element is <{root.tag}>"
        )


def _mend(root: Element, meshes: Meshes, places: Packages, name: str) -> Flat:
    if root.tag == "mujoco":
        return mend_mjcf(root, meshes, places, name)
    is_urdf = root.tag == "robot"
    warnings = mend_urdf(root, meshes) if is_urdf else mend_sdf(root, meshes, places)
    return Flat({**mimics_of(root)}, warnings=warnings)


def _check(model: Model) -> Model:
    """Return a model with Drake's warnings, after it was parsed with its geometry."""
    scene_graph = SceneGraph()
    plant = MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    with drake_warnings() as messages:
        model.add_to(plant)
        try:
            plant.Finalize()
        except RuntimeError as error:
            raise InvalidInputError(f"arm.model: {model.file}: {one_line(error)}") from None
    _require_near(plant, model.file)
    for message in messages:
        # But for a plane, which has no ends.
        if "sing default value" in message and "Plane" not in message:
            raise InvalidInputError(
                f"arm.model: {model.file.name}: a value is not read as it stands there: "
                f"{one_line(message)[:200]}"
            )
    warnings = []
    # Drake has one for each joint that follows another, but for those of MJCF.
    followers = 0 if model.format == "xml" else len(model.mimics)
    if (loops := plant.num_constraints() - followers) > 0:
        warnings.append(f"constraints such as closed loops are left out ({loops})")
    if messages:
        times = "once" if len(messages) == 1 else f"{len(messages)} times"
        warnings.append(f"Drake warns {times}, first: {one_line(messages[0])[:200]}")
    del plant  # it points to the scene graph, which must outlive it
    warnings_of_model = (f"arm.model: {model.file.name}: {warning}" for warning in warnings)
    return replace(model, warnings=(*model.warnings, *warnings_of_model))


def _require_near(plant: MultibodyPlant, file: Path) -> None:
    """Raise an InvalidInputError for a joint far off, beside which no number keeps its digits."""
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        far = max(
            float(np.abs(frame.GetFixedPoseInBodyFrame().translation()).max())
            for frame in (joint.frame_on_parent(), joint.frame_on_child())
        )
        if far > _FARTHEST:
            raise InvalidInputError(
                f"arm.model: {file.name}: {joint.name()!r} is {far:.3g} m from the link that it "
                f"belongs to; it may be up to {_FARTHEST:g} m"
            )


def one_line(message: object) -> str:
    """Return a message of Drake without line breaks and places in a text that no user sees."""
    return " ".join(_PLACE.sub("", str(message)).split())


def in_urdf(model: Model, key: str = "arm.model") -> Model:
    """Return the same model in URDF, in which models are joined and joints are displaced.

    Of another format, what Drake reads of it is written as URDF.

    Args:
        model: A model that Drake reads.
        key: Its key in a document, for messages.

    Raises:
        InvalidInputError: If URDF does not have such a model.
    """
    root = _root(model)
    if root is not None and root.tag == "robot":
        return model
    scene_graph = SceneGraph()
    plant = MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    with quiet_drake(logging.ERROR):
        instance = model.add_to(plant)
        plant.Finalize()
    written = WrittenUrdf(
        plant, scene_graph.model_inspector(), instance, f"{key}: {model.file.name}"
    )
    told = written.warnings
    # A base of SDF floats without a word; one of MJCF is said to.
    if root is not None and root.tag == "mujoco":
        free = [plant.get_body(index).name() for index in plant.GetFloatingBaseBodies()]
        told += about(free, "bodies that float are fixed where the file has them:")
    warnings = (f"{key}: {model.file.name}: {warning}" for warning in told)
    text = write_xml(written.root)
    del plant  # it points to the scene graph, which must outlive it
    return replace(model, text=text, format="urdf", warnings=(*model.warnings, *warnings))


def moving_joints(model: Model) -> list[str]:
    """Return the names of the movable joints of a model in URDF, in the order of the model."""
    return [joint.get("name", "") for joint in _moving(_urdf(model))]


def displace_joints(model: Model, translation: Array, rotation: Array) -> Model:
    """Return a model whose movable joints are displaced, each in the axes of its own frame.

    Args:
        model: A model in URDF.
        translation: Displacement of each joint, in the order of the file, shape (k, 3) [m].
        rotation: Rotation of each as a rotation vector, shape (k, 3) [rad].
    """
    root = _urdf(model)
    for joint, shift, turn in zip(_moving(root), translation, rotation, strict=True):
        origin = joint.find("origin")
        if origin is None:
            origin = SubElement(joint, "origin")
        X_PF = RigidTransform(
            RollPitchYaw(_numbers_of(origin, "rpy")).ToRotationMatrix(),
            _numbers_of(origin, "xyz"),
        )
        X_PG = X_PF @ RigidTransform(RotationMatrix(rotation_by(turn)), shift)
        origin.set("xyz", numbers_text(X_PG.translation()))
        origin.set("rpy", numbers_text(RollPitchYaw(X_PG.rotation()).vector()))
    return replace(model, text=write_xml(root), format="urdf")


# Elements whose names others refer to, and attributes that do so.
_NAMED = ("link", "joint", "material", "transmission", "frame", "actuator")
_REFERENCES = ("name", "link", "joint", "group", "parent", "child")


def place_beside(
    model: Model,
    other: Model,
    prefix: str,
    X_AB: RigidTransform,
    key: str = "arm.pair",
    mount: str | None = None,
) -> Model:
    """Return one model of two, in URDF, of which the second one is welded to a link of the first.

    Args:
        model: The first model.
        other: The second one; its links, joints and frames get a prefix.
        prefix: The prefix.
        X_AB: Where its base is in that link.
        key: Key of the second one in a document, for messages.
        mount: Name of the link; by default the base of the first model.

    Raises:
        InvalidInputError: If one of them cannot be written as URDF, has several bases, or has no
            such link.
    """
    model, other = in_urdf(model), in_urdf(other, key)
    one, two = _urdf(model), _urdf(other)
    links = [link.get("name", "") for link in one.findall("link")]
    if mount is not None and mount not in links:
        raise InvalidInputError(
            f"{key}.mount: no link {mount!r} in {model.file.name}; {nearest(mount, links)}"
        )
    names = {part.get("name") for tag in _NAMED for part in two.iter(tag)}
    for part in two.iter():
        for attribute in _REFERENCES:
            if (name := part.get(attribute)) in names and name:
                part.set(attribute, prefix + name)
    base = mount or _base_of(one, model, key)
    other_base = _base_of(two, other, key)
    joint = SubElement(one, "joint", {"name": f"{prefix}base", "type": "fixed"})
    SubElement(joint, "parent", {"link": base})
    SubElement(joint, "child", {"link": other_base})
    rpy = RollPitchYaw(X_AB.rotation()).vector()
    SubElement(joint, "origin", {"xyz": numbers_text(X_AB.translation()), "rpy": numbers_text(rpy)})
    one.extend(two)
    mimics = {
        prefix + name: mimic._replace(joint=mimic.joint and prefix + mimic.joint)
        for name, mimic in other.mimics.items()
    }
    return replace(
        model,
        packages={**other.packages, **model.packages},
        text=write_xml(one),
        format="urdf",
        mimics={**model.mimics, **mimics},
        postures={} if mount is None else model.postures,
        warnings=(*model.warnings, *other.warnings),
        lost=(*model.lost, *(replace(each, link=prefix + each.link) for each in other.lost)),
    )


def _base_of(root: Element, model: Model, key: str) -> str:
    """Return the name of the one link that no joint carries."""
    carried = {
        child.get("link") for joint in root.findall("joint") for child in joint.iter("child")
    }
    bases = [link.get("name", "") for link in root.findall("link")]
    bases = [name for name in bases if name not in carried]
    if len(bases) != 1:
        raise InvalidInputError(
            f"{key}: {model.file.name} must have one base, not {len(bases)}: {', '.join(bases)}"
        )
    return bases[0]


def _root(model: Model) -> Element | None:
    return parse_xml(model.file.read_bytes() if model.text is None else model.text.encode())


def _urdf(model: Model) -> Element:
    root = _root(model)
    assert root is not None
    assert root.tag == "robot"
    return root


def _moving(root: Element) -> list[Element]:
    return [joint for joint in root.findall("joint") if joint.get("type") in MOVING]


def _numbers_of(origin: Element, name: str) -> Array:
    return np.array([float(number) for number in origin.get(name, "0 0 0").split()])


# Drake's names of the formats, by the root element.
_STILL_FORMATS = {"robot": "urdf", "sdf": "sdf"}
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
        root = _still_root(file)
        require_sizes(file.name, root)
        count = _keep_shapes(root, Packages({}, file), file.name)
        # The plant points to the scene graph, which must outlive it.
        self._scene_graph = SceneGraph()
        self._plant = MultibodyPlant(0.0)
        self._plant.RegisterAsSourceForSceneGraph(self._scene_graph)
        parser = Parser(self._plant)
        parser.SetAutoRenaming(True)
        try:
            with drake_warnings():
                parser.AddModelsFromString(write_xml(root), _STILL_FORMATS[root.tag])
                self._plant.Finalize()
        # Drake exits where a condition of its own code fails.
        except (RuntimeError, ValueError, SystemExit) as error:
            raise ValueError(f"{file.name} cannot be read: {one_line(error)}") from None
        self._context = self._plant.CreateDefaultContext()
        self._inspector = self._scene_graph.model_inspector()
        shape_count = len(list(self.shapes()))
        if shape_count == 0:
            raise ValueError(f"{file.name} has no geometry")
        if shape_count != count:
            raise ValueError(f"{file.name}: Drake reads {shape_count} of its {count} shapes")

    def shapes(self) -> Iterator[tuple[str, RigidTransform, Shape]]:
        """Yield the body, the pose in the model's frame and the shape of each geometry."""
        for body in map(self._plant.get_body, map(BodyIndex, range(self._plant.num_bodies()))):
            frame = self._plant.GetBodyFrameIdOrThrow(body.index())
            X_MB = body.EvalPoseInWorld(self._context)
            for role in (Role.kProximity, Role.kIllustration):
                for geometry in self._inspector.GetGeometries(frame, role):
                    X_BG = self._inspector.GetPoseInFrame(geometry)
                    yield body.name(), X_MB @ X_BG, self._inspector.GetShape(geometry)


def _still_root(file: Path) -> Element:
    """Return the root element of a model file."""
    if not is_file(file):
        raise ValueError(f"no file {str(file)!r}")
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise ValueError(f"{file.name} {error}") from None
    if root is None or root.tag not in _STILL_FORMATS:
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
        visuals, collisions = link.findall("visual"), link.findall("collision")
        for visual in visuals if collisions else ():
            link.remove(visual)
        for shape in collisions or visuals:
            count += 1
            for mesh in shape.iterfind("geometry/mesh"):
                uri = mesh.find("uri")
                mesh_name = MeshName(mesh, "filename") if uri is None else MeshName(uri)
                mesh_name.change(_readable(mesh_name.uri, packages, name))
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
        text = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise ValueError(f"{name}: its mesh {uri!r} cannot be read: {text}") from None


def require_sizes(key: str, root: Element) -> None:
    """Raise a ValueError if a shape of a model in URDF or SDF has no thickness.

    Args:
        key: What names the model, for the message.
        root: The model.
    """
    if root.tag not in _STILL_FORMATS:
        return
    try:
        told = mend_sizes(root)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    if told:
        raise ValueError(f"{key}: {told[0].partition(' are ')[0]}:{told[0].partition(':')[2]}")


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
        if (mesh_file := packages.file(uri.strip())) is None:
            continue
        try:
            require_finite(mesh_file)
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            text = " ".join(str(error).split())[:120]
            raise ValueError(f"{key}: its mesh {uri!r} cannot be read: {text}") from None
