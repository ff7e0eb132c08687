"""A robot's model file as it is given to Drake."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from ...errors import InvalidInputError
from ...inputs.given_file import content_of, is_file
from ..contact_mesh import require_coarse_balls
from ..drake_log import drake_warnings
from .expansion import expand_xacro, is_xacro
from .materials import mend_materials
from .meshes import LostMesh, Meshes
from .mimic import Mimic, mimics_of
from .mjcf import mend_mjcf
from .packages import Packages
from .sdf import mend_sdf
from .urdf import mend_urdf
from .xml_text import MOST_BYTES, parse_xml, write_xml

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
        warnings: Changes that alter the physics or the looks, and warnings of Drake.
        lost: Meshes of links that cannot be read.
    """

    file: Path
    packages: Mapping[str, str]
    text: str | None = None
    format: str = ""
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
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
        try:
            if self.text is None:
                instances = parser.AddModels(str(self.file))
            else:
                instances = parser.AddModelsFromString(self.text, self.format)
        # Drake exits where a condition of its own code fails, e.g. at a negative velocity limit.
        except (RuntimeError, ValueError, SystemExit) as error:
            lost = "unknown package" in str(error)
            hint = "; give the package's folder in arm.packages" if lost else ""
            raise InvalidInputError(
                f"arm.model: {self.file} cannot be read: {one_line(error)}{hint}"
            ) from None
        if len(instances) != 1:
            raise InvalidInputError(
                f"arm.model: {self.file} holds {len(instances)} models; it must hold one"
            )
        return instances[0]


def read_model(file: Path, packages: Mapping[str, str]) -> Model:
    """Return a model that Drake can read, checked by reading it with its geometry.

    A file that needs no change is given to Drake as it is.

    Args:
        file: URDF, SDF, MJCF or xacro file.
        packages: Folders of packages by name.

    Raises:
        InvalidInputError: If the file or a package does not exist, or Drake cannot read the model.
    """
    _require_files(file, packages)
    return _checked(_mended(file, packages))


def read_shapes(file: Path, packages: Mapping[str, str]) -> Model:
    """Return the same model with all of its collision meshes, which is read for distances alone.

    A run does not see it: there, only the tool makes contact.

    Args:
        file: A file that `read_model` has read.
        packages: Folders of packages by name.

    Raises:
        InvalidInputError: If the file cannot be read any more.
    """
    _require_files(file, packages)
    return _mended(file, packages, for_distances=True)


def _require_files(file: Path, packages: Mapping[str, str]) -> None:
    """Raise an InvalidInputError if a model file or the folder of a package does not exist."""
    if not is_file(file):
        raise InvalidInputError(f"arm.model: no file {str(file)!r}")
    for package, folder in packages.items():
        if not Path(folder).is_dir():
            raise InvalidInputError(f"arm.packages.{package}: no folder {folder!r}")


def _mended(file: Path, packages: Mapping[str, str], for_distances: bool = False) -> Model:
    places = Packages(packages, file)
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise InvalidInputError(f"arm.model: {file} {error}") from None
    expanded = root is not None and is_xacro(root)
    if expanded:
        root = parse_xml(expand_xacro(file, places))
    if root is None or root.tag not in _FORMATS:
        return Model(file, packages)
    require_coarse_balls(f"arm.model: {file.name}", root)
    before, meshes = write_xml(root), Meshes(places, for_distances)
    try:
        warnings = _mend(root, meshes, places)
        followers = mimics_of(root)
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(f"arm.model: {file} cannot be read: {one_line(error)}") from None
    warnings = [f"arm.model: {file.name}: {warning}" for warning in warnings]
    text, form, lost = write_xml(root), _FORMATS[root.tag], tuple(meshes.lost)
    if text == before and not expanded and file.suffix.lower() == f".{form}":
        return Model(file, packages, mimics=followers)
    return Model(file, packages, text, form, followers, tuple(warnings), lost)


def _mend(root: Element, meshes: Meshes, places: Packages) -> list[str]:
    return [*mend_materials(root, places), *_mend_bodies(root, meshes, places)]


def _mend_bodies(root: Element, meshes: Meshes, places: Packages) -> list[str]:
    if root.tag == "robot":
        return mend_urdf(root, meshes)
    if root.tag == "sdf":
        return mend_sdf(root, meshes, places)
    return mend_mjcf(root, meshes, places)


def _checked(model: Model) -> Model:
    """Return a model with Drake's warnings, after it was parsed with its geometry."""
    scene_graph = SceneGraph()
    plant = MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    with drake_warnings() as said:
        model.add_to(plant)
        try:
            plant.Finalize()
        except RuntimeError as error:
            raise InvalidInputError(f"arm.model: {model.file}: {one_line(error)}") from None
    _require_near(plant, model.file)
    warnings = []
    if (loops := plant.num_constraints() - len(model.mimics)) > 0:
        warnings.append(f"constraints such as closed loops are left out ({loops})")
    if said:
        times = "once" if len(said) == 1 else f"{len(said)} times"
        warnings.append(f"Drake warns {times}, first: {one_line(said[0])[:200]}")
    del plant  # it points to the scene graph, which must outlive it
    told = (f"arm.model: {model.file.name}: {warning}" for warning in warnings)
    return replace(model, warnings=(*model.warnings, *told))


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
