"""The meshes that a model names, as files that Drake can read.

- Meshes of links, as URDF and SDF have them.
- Colours and textures of a model: what cannot be read of them is left out; no motion needs it.
- Meshes in formats that Drake cannot show, converted with trimesh and pycollada.
- Meshes with fewer triangles, for pages that are not larger than need be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import urlparse
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Convex, Mesh

from ...errors import InvalidInputError
from ...inputs.files import cached_file, content_of
from ...inputs.messages import decimal, short
from ...inputs.packages import late_import
from .ros_packages import Packages

trimesh = late_import("trimesh")

#: Red, green, blue and opacity, each from 0 to 1.
Colour = tuple[float, float, float, float]

#: Colour of what has none.
GREY: Colour = (0.75, 0.75, 0.75, 1.0)


@dataclass(frozen=True)
class LostMesh:
    """A mesh of a link that cannot be read.

    Attributes:
        link: Name of the link.
        mesh: Name of the mesh in the model.
        fault: Why, as the end of a sentence about the mesh.
    """

    link: str
    mesh: str
    fault: str


class Meshes:
    """The meshes that a model names, converted where necessary.

    Args:
        packages: Packages that the model may name.
        for_distances: Whether the model is read for distances, with all of its collision meshes;
            else those stay that make contact.
        whole: Whether meshes then stay what they are, in place of their convex hulls.

    Attributes:
        for_distances: The same.
        lost: The meshes of links that were looked for and cannot be read.
    """

    def __init__(
        self, packages: Packages, for_distances: bool = False, whole: bool = False
    ) -> None:
        self.for_distances = for_distances
        self._whole = whole
        self.lost: list[LostMesh] = []
        self._packages = packages
        self._missing: list[str] = []
        self._broken: dict[str, str] = {}

    def visual_mesh(self, uri: str, colour: Colour | None = None) -> Path | None:
        """Return a mesh as a glTF file, for looks.

        Args:
            uri: Name of the mesh in the model.
            colour: Colour of the parts that have no material of their own.

        Returns:
            The file, or None if the mesh is missing or broken, which `warnings` then says.
        """
        return self._readable(uri, ".gltf", lambda file: gltf_file(file, colour))

    def plain(self, uri: str) -> Path | None:
        """Return a mesh as an OBJ file with normals, for its shape; None as `visual_mesh`."""
        return self._readable(uri, ".obj", obj_file)

    def hull(self, uri: str, scale: str) -> Path | None:
        """Return the convex hull of a mesh, before it is scaled, as an OBJ file.

        Where meshes stay what they are it is the mesh.

        Args:
            uri: Name of the mesh in the model.
            scale: Its scale as the model has it, one number or three; empty for 1.
        """

        def convert(file: Path) -> Path:
            _require_scale(scale)
            # Drake reads the y of a glTF file as up.
            is_plain = self._whole and file.suffix.lower() not in {".gltf", ".vtk"}
            return obj_file(file) if is_plain else hull_file(file)

        return self._readable(uri, None, convert)

    def lose(self, link: str, uri: str) -> None:
        """Note that a mesh of a link could not be read."""
        file = self._packages.file(uri)
        fault = "is missing" if file is None else "cannot be read"
        if reason := self._broken.get(uri if file is None else str(file)):
            fault = f"cannot be read: {reason}"
        self.lost.append(LostMesh(link, uri, fault))

    def is_missing(self, uri: str) -> bool:
        """Return whether there is no file for a mesh."""
        return self._packages.file(uri) is None

    def collision_mesh(self, uri: str) -> Path | None:
        """Return a mesh that Drake reads as collision geometry; None if it does not."""
        file = self._packages.file(uri)
        if file is None or file.suffix.lower() not in {".obj", ".vtk", ".gltf"}:
            return None
        try:
            require_finite(file)
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            self._broken[str(file)] = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            return None
        return file

    def warnings(self) -> list[str]:
        """Return one warning about all missing meshes, and one about each broken mesh."""
        sentences = [
            f"the mesh {name} cannot be read: {fault}; the arm is drawn without it"
            for name, fault in self._broken.items()
        ]
        if self._missing:
            names = list(dict.fromkeys(self._missing))
            hint = self.hint(names)
            which = names[0] if len(names) == 1 else f"{len(names)} meshes, {names[0]} first,"
            verb = "is" if len(names) == 1 else "are"
            them = "it" if len(names) == 1 else "them"
            sentences.append(f"{which} {verb} missing; the arm is drawn without {them}{hint}")
        return sentences

    def hint(self, uris: Iterable[str]) -> str:
        """Return how packages of meshes that are not found are given, as the end of a sentence."""
        unknown = {urlparse(uri).netloc for uri in uris if uri.startswith("package://")}
        missing = sorted(name for name in unknown if self._packages.find(name) is None)
        return f"; give the folder of {', '.join(missing)} in arm.packages" if missing else ""

    def _readable(
        self, uri: str, suffix: str | None, convert: Callable[[Path], Path]
    ) -> Path | None:
        file = self._packages.file(uri)
        if file is None:
            if what_else := self._packages.what_else(uri):
                self._broken[uri] = what_else
            else:
                self._missing.append(uri)
            return None
        try:
            if file.suffix.lower() != suffix:
                return convert(file)
            if suffix == ".obj":
                _require_faces(file)
            require_finite(file)
            return convert(file) if suffix == ".obj" and not has_normals(file) else file
        except InvalidInputError:
            raise
        # What a reader of many formats raises at a broken file is not known.
        except Exception as error:
            self._broken[str(file)] = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            return None


def _require_faces(file: Path) -> None:
    """Raise a ValueError for an OBJ file without faces, of which Drake says no name."""
    kinds = {line.split(maxsplit=1)[0] for line in file.read_bytes().splitlines() if line.strip()}
    if not {b"v", b"f"} <= kinds:
        raise ValueError("it contains no faces")


def _require_scale(scale: str) -> None:
    """Raise a ValueError for a scale that is neither one number nor three, or that leaves none."""
    numbers = [float(part) for part in scale.split()] or [1.0]
    if len(numbers) not in {1, 3} or not np.isfinite(numbers).all() or not all(numbers):
        raise ValueError(f"its scale is {scale!r}")


@dataclass(frozen=True)
class MeshName:
    """Where a model names a mesh.

    Attributes:
        element: Element that holds the name.
        attribute: Its attribute that is the name; None if its text is.
        scale: Scale of the mesh, as the model has it; empty if it has none.
    """

    element: Element
    attribute: str | None = None
    scale: str = ""

    @property
    def uri(self) -> str:
        """The name."""
        text = self.element.text if self.attribute is None else self.element.get(self.attribute)
        return (text or "").strip()

    def change(self, file: Path) -> None:
        """Name another file."""
        if self.attribute is None:
            self.element.text = file.as_uri()
        else:
            self.element.set(self.attribute, file.as_uri())


def mend_geometry(
    root: Element,
    meshes: Meshes,
    mesh_of: Callable[[Element], MeshName | None],
    colour_of: Callable[[Element], Colour | None],
) -> list[str]:
    """Make the meshes of all links readable, and leave out those that nothing needs.

    Collision meshes are left out, because only the tool makes contact. One with properties that
    only Drake reads is meant for contact in Drake, and stays. If the model is read for distances,
    all meshes stay as their convex hulls.

    Args:
        root: The model, which is changed in place.
        meshes: The meshes that it names.
        mesh_of: Returns the mesh of a visual or collision element; None for another shape.
        colour_of: Returns the colour that a visual element gives to its mesh.

    Returns:
        Warnings about what is left out.
    """
    removals, missing = list[str](), list[tuple[str, str]]()
    for link in root.iter("link"):
        if meshes.for_distances:
            _keep_hulls(link, meshes, mesh_of)
            continue
        _show(link, meshes, mesh_of, colour_of)
        name = link.get("name", "")
        for uri in _drop_collisions(link, meshes, mesh_of):
            if meshes.is_missing(uri):
                missing.append((name, uri))
            else:
                removals.append(name)
    return [
        *about(removals, "collision meshes count for distances, but make no contact: those of"),
        *_missing(missing, meshes),
    ]


def _show(
    link: Element,
    meshes: Meshes,
    mesh_of: Callable[[Element], MeshName | None],
    colour_of: Callable[[Element], Colour | None],
) -> None:
    """Make the drawn meshes of a link readable, and leave out those that are not."""
    for visual in link.findall("visual"):
        if (mesh := mesh_of(visual)) is None:
            continue
        if (file := meshes.visual_mesh(mesh.uri, colour_of(visual))) is None:
            link.remove(visual)
        else:
            mesh.change(file)


def _drop_collisions(
    link: Element, meshes: Meshes, mesh_of: Callable[[Element], MeshName | None]
) -> Iterator[str]:
    """Leave out the collision meshes of a link that are not meant for Drake, and yield them."""
    for collision in link.findall("collision"):
        if (mesh := mesh_of(collision)) is None:
            continue
        file = meshes.collision_mesh(mesh.uri)
        if file is None or collision.find("drake:proximity_properties") is None:
            link.remove(collision)
            yield mesh.uri
        else:
            mesh.change(file)


def _keep_hulls(
    link: Element, meshes: Meshes, mesh_of: Callable[[Element], MeshName | None]
) -> None:
    """Put convex hulls in the places of a link's meshes, and leave out those that have none."""
    for number, shape in enumerate((*link.findall("visual"), *link.findall("collision"))):
        # Drake refuses a name that is given twice.
        shape.set("name", f"shape_{number}")
        for material in shape.findall("material"):
            shape.remove(material)
        if (mesh := mesh_of(shape)) is None:
            continue
        if (file := meshes.hull(mesh.uri, mesh.scale)) is None:
            link.remove(shape)
            meshes.lose(link.get("name", ""), mesh.uri)
        else:
            mesh.change(file)


def _missing(missing: Iterable[tuple[str, str]], meshes: Meshes) -> list[str]:
    """Return a warning about collision meshes that are missing, from their links and names."""
    hint = meshes.hint(uri for _, uri in missing)
    text = about((f"{uri} of {link!r}" for link, uri in missing), "collision meshes are missing:")
    return [warning + hint for warning in text]


def about(names: Iterable[str], what: str) -> list[str]:
    """Return one warning, ``what`` and some names; none if there are no names."""
    unique = list(dict.fromkeys(names))
    if not unique:
        return []
    text = ", ".join(unique[:4]) + (f" and {len(unique) - 4} more" if len(unique) > 4 else "")
    return [f"{what} {text}"]


# Files of textures that Drake and a playback read.
_PICTURES = {".png", ".jpg", ".jpeg", ".ktx2"}
_SDF_COLOURS = {"ambient", "diffuse", "specular", "emissive"}
_SDF_TEXTURE = "drake:diffuse_map"


def mend_materials(root: Element, packages: Packages) -> list[str]:
    """Leave out colours and textures that Drake refuses, and name textures by their files.

    Args:
        root: The model, which is changed in place.
        packages: Where its textures are looked for.

    Returns:
        Warnings about what is left out.
    """
    mend: dict[str, Callable[[Element, _Materials], None]] = {
        "robot": _mend_urdf,
        "sdf": _mend_sdf,
        "mujoco": _mend_mjcf,
    }
    materials = _Materials(packages)
    mend[root.tag](root, materials)
    return materials.warnings()


class _Materials:
    """What is said of materials, and left out of them."""

    def __init__(self, packages: Packages) -> None:
        self._packages = packages
        self._colours: list[str] = []
        self._textures: list[str] = []
        self.undefined: list[str] = []
        self.unreadable: set[str] = set()

    def is_colour(self, text: str | None, *sizes: int) -> bool:
        """Return whether a text is a colour of so many numbers; one that is none is noted."""
        try:
            numbers = [decimal(part) for part in (text or "").split()]
        except ValueError:
            numbers = []
        valid = len(numbers) in sizes and all(0.0 <= number <= 1.0 for number in numbers)
        if not valid:
            self._colours.append(short(text or ""))
        return valid

    def texture(self, name: str | None) -> str | None:
        """Return the file of a texture as a URI; None if there is none, which is noted."""
        name = (name or "").strip()
        file = self._packages.file(name) if name else None
        if file is None or file.suffix.lower() not in _PICTURES:
            self._textures.append(short(name))
            return None
        return file.as_uri()

    def warnings(self) -> list[str]:
        """Return one warning for each kind of what is left out."""
        unknown_names = [name for name in self.undefined if name not in self.unreadable]
        return [
            *about(self._colours, "colours that are not numbers from 0 to 1 are left out:"),
            *about(self._textures, "textures that are no picture or missing are left out:"),
            *about(unknown_names, "materials that are not defined are left out:"),
        ]


def _mend_urdf(root: Element, materials: _Materials) -> None:
    visuals = root.findall("link/visual")
    for material in [*root.findall("material"), *root.findall("link/visual/material")]:
        for colour in material.findall("color"):
            if not materials.is_colour(colour.get("rgba"), 4):
                material.remove(colour)
                materials.unreadable.add(material.get("name", ""))
        for texture in material.findall("texture"):
            if (uri := materials.texture(texture.get("filename"))) is None:
                material.remove(texture)
                materials.unreadable.add(material.get("name", ""))
            else:
                texture.set("filename", uri)
    _define(root, visuals, materials)


def _define(root: Element, visuals: list[Element], materials: _Materials) -> None:
    """Give each material that is only named what defines it, which Drake must have read before."""
    # Drake reads those of the robot first.
    names: set[str] = set()
    for material in root.findall("material"):
        if (name := material.get("name")) and len(material):
            names.add(name)
        else:
            root.remove(material)
    definitions = {m.get("name"): list(m) for v in visuals for m in v.findall("material") if len(m)}
    for visual in visuals:
        for material in visual.findall("material"):
            name = material.get("name", "")
            if not name or name in names:
                continue
            if not len(material):
                if name not in definitions:
                    visual.remove(material)
                    materials.undefined.append(name)
                    continue
                material.extend(deepcopy(definitions[name]))
            names.add(name)


def _mend_sdf(root: Element, materials: _Materials) -> None:
    for material in root.iter("material"):
        for child in list(material):
            if child.tag in _SDF_COLOURS:
                if child.text and not materials.is_colour(child.text, 3, 4):
                    material.remove(child)
            elif child.tag == _SDF_TEXTURE and child.text:
                if (uri := materials.texture(child.text)) is None:
                    material.remove(child)
                else:
                    child.text = uri


def _mend_mjcf(root: Element, materials: _Materials) -> None:
    for element in root.iter():
        if "rgba" in element.attrib and not materials.is_colour(element.get("rgba"), 4):
            del element.attrib["rgba"]


# Changes whenever the same mesh becomes another file.
_VERSION = b"2"
# Larger textures make a playback large and look no better in it [pixels].
_LARGEST_TEXTURE = 1024
# Size of a mesh, which takes ten times as much memory to convert [bytes].
_MOST_BYTES = 200_000_000
# Exponent between the two ways to give a colour, and what white paint reflects: a page is lit such
# that more than that shows no shape.
_GAMMA, _WHITEST = 2.2, 0.6
# A line of an OBJ file with a vertex that is not three decimal numbers, or one of 1e100 and more,
# and a number that is none of a VTK file, and of a list of Collada.
_DECIMAL = rb"[ \t]+[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?(?=[ \t\r\n]|\Z)"
_NO_VERTEX = re.compile(rb"^[ \t]*v(?=[ \t])(?!(?:" + _DECIMAL + rb"){3})[^\n]*", re.MULTILINE)
_NOT_FINITE = re.compile(rb"(?<![\w.])[-+]?(?:nan|inf(?:inity)?)(?![\w.])", re.IGNORECASE)
_NO_FLOAT = re.compile(
    rb"<float_array[^>]*>[^<]*?(?<![\w.])([-+]?(?:nan|inf(?:inity)?))(?![\w.])", re.IGNORECASE
)
# Faces of an OBJ file, one with a corner that names no normal, and the indices at their corners.
_FACE = re.compile(rb"^[ \t]*f(?=[ \t])([^\r\n]*)", re.MULTILINE)
_NO_NORMAL = re.compile(
    rb"^[ \t]*f(?=[ \t])(?!(?:[ \t]+-?\d+/(?:-?\d+)?/-?\d+)+[ \t]*\r?$)", re.MULTILINE
)
_CORNER = re.compile(rb"\d+/-?(\d*)/-?(\d+)")
# How Collada and OBJ files name other files: images and libraries of materials.
_OF_OBJ = re.compile(
    rb"^[ \t]*(?:mtllib|map_\w+)\s+(?:-\S+\s+\S+\s+)*(.+?)\s*$",
    re.MULTILINE,
)
_COMPANION = {
    ".dae": re.compile(rb"<init_from>\s*([^<]+?)\s*</init_from>"),
    ".obj": _OF_OBJ,
    ".mtl": _OF_OBJ,
}


def require_finite(mesh: Path) -> None:
    """Raise a ValueError if a mesh that Drake reads has a vertex that is no finite number.

    Drake takes it for 0. Meshes that are converted are checked on the way.
    """
    if mesh.suffix.lower() == ".gltf":
        _scene(mesh)
    else:
        _require_finite_text(mesh)


def _require_finite_text(mesh: Path) -> None:
    """Raise a ValueError for a number that readers of some formats take for 0 without a word."""
    kinds = {".obj": _NO_VERTEX, ".vtk": _NOT_FINITE, ".dae": _NO_FLOAT}
    wrong = kinds.get(mesh.suffix.lower())
    if wrong is not None and (match := wrong.search(content_of(mesh, _MOST_BYTES))):
        line = " ".join(match[match.lastindex or 0].decode(errors="replace").split())
        raise ValueError(f"it has a vertex that is not finite: {short(line)}")


def gltf_file(mesh: Path, colour: Colour | None) -> Path:
    """Return a mesh as a glTF file of the cache, in metres, with its materials.

    Args:
        mesh: File in any format that trimesh reads.
        colour: Colour of the parts that have no material of their own.

    Raises:
        Exception: Of any class, if the mesh cannot be read or is empty.
    """
    colour = colour or GREY
    name = content_name(mesh, b"gltf", repr(colour).encode())
    return cached_file(f"meshes/{name}.gltf", lambda: _gltf(mesh, colour))


def has_normals(mesh: Path) -> bool:
    """Return whether Drake's renderers draw an OBJ file: all corners have a normal of the file.

    Without one they raise an error, and a texture coordinate that is not there ends the process.
    """
    text = content_of(mesh, _MOST_BYTES)
    if _NO_NORMAL.search(text):
        return False
    corners = _CORNER.findall(b" ".join(_FACE.findall(text)))
    counts = [
        len(re.findall(rb"^[ \t]*%s[ \t]" % kind, text, re.MULTILINE)) for kind in (b"vt", b"vn")
    ]
    return all(
        max((int(corner[k] or 0) for corner in corners), default=0) <= count
        for k, count in enumerate(counts)
    )


def obj_file(mesh: Path) -> Path:
    """Return a mesh as an OBJ file of the cache, in metres, with normals and without materials.

    Args:
        mesh: File in any format that trimesh reads.

    Raises:
        Exception: Of any class, if the mesh cannot be read or is empty.
    """
    return cached_file(f"meshes/{content_name(mesh, b'obj')}.obj", lambda: _obj(mesh))


def hull_file(mesh: Path) -> Path:
    """Return the convex hull of a mesh as an OBJ file of the cache, in metres.

    Args:
        mesh: File in any format that trimesh reads.

    Raises:
        Exception: Of any class, if the mesh cannot be read, is empty or lies on a line.
    """
    return cached_file(f"meshes/{content_name(mesh, b'hull')}.obj", lambda: _hull(mesh))


def content_name(mesh: Path, *more: bytes) -> str:
    """Return a name that changes with the content of a mesh and of the files that it names."""
    content = sha256(_VERSION)
    for part in more:
        content.update(part)
    for file in (mesh, *companions(mesh)):
        content.update(sha256(content_of(file, _MOST_BYTES)).digest())
    return content.hexdigest()[:32]


def companions(mesh: Path) -> Iterator[Path]:
    """Yield the existing files that a mesh names, and those that they name."""
    if (pattern := _COMPANION.get(mesh.suffix.lower())) is None:
        return
    for name in sorted(set(pattern.findall(mesh.read_bytes()))):
        file = mesh.parent / name.decode(errors="replace")
        if file.is_file():
            yield file
            yield from companions(file)


def _scene(mesh: Path) -> Any:
    """Return a mesh file as a scene of trimesh, in metres."""
    _require_finite_text(mesh)
    scene = trimesh.load_scene(str(mesh), process=False)
    parts = scene.geometry.values()
    if not any(len(part.faces) for part in parts if isinstance(part, trimesh.Trimesh)):
        raise ValueError("it contains no faces")
    if not all(np.isfinite(part.vertices).all() for part in parts):
        raise ValueError("it has a vertex that is not finite")
    # Only some formats give a unit.
    if all(part.metadata.get("units") for part in parts):
        scene = scene.convert_units("meters")
    return scene


def triangles_of(mesh: Path) -> NDArray[np.float64]:
    """Return the triangles of a mesh file, shape (t, 3, 3) [m].

    Raises:
        ValueError: If the mesh cannot be read or is empty.
    """
    if not mesh.is_file():
        raise ValueError("there is no such file")
    try:
        return np.asarray(_scene(mesh).to_mesh().triangles, dtype=float)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    # What a reader of many formats raises at a broken file is not known.
    except Exception as error:
        raise ValueError(" ".join(f"{error}".split())[:120]) from None


def _gltf(mesh: Path, colour: Colour) -> bytes:
    scene = _scene(mesh)
    for part in scene.geometry.values():
        if isinstance(part, trimesh.Trimesh):
            _set_material(part, colour)
    # glTF's y is up, and Drake turns it back.
    scene.apply_transform(trimesh.transformations.rotation_matrix(-math.pi / 2, [1, 0, 0]))
    files = trimesh.exchange.gltf.export_gltf(scene, merge_buffers=True, embed_buffers=True)
    return bytes(files["model.gltf"])


def _set_material(part: Any, colour: Colour) -> None:
    """Give a part a material that looks the same from both sides, its own if it has one."""
    # An STL file repeats each vertex for each of its faces, and many others do for normals that
    # hardly differ: half the size of a playback is at stake.
    part.merge_vertices(digits_norm=1)
    if part.visual.kind in {"vertex", "face"}:
        part.visual.vertex_colors = _as_light(part.visual.vertex_colors)
        return
    if part.visual.kind is None:
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        part.visual = trimesh.visual.TextureVisuals(material=material)
    material = part.visual.material
    if isinstance(material, trimesh.visual.material.SimpleMaterial):
        material = material.to_pbr()
    if material.baseColorTexture is not None:
        material.baseColorTexture.thumbnail((_LARGEST_TEXTURE, _LARGEST_TEXTURE))
    elif material.baseColorFactor is not None:
        material.baseColorFactor = _as_light(material.baseColorFactor)
    material.metallicFactor = 0.0
    material.doubleSided = True
    if material.baseColorFactor is not None and material.baseColorFactor[3] < 255:
        material.alphaMode = "BLEND"
    part.visual.material = material


def _as_light(colour: Any) -> NDArray[np.uint8]:
    """Return colours as glTF wants them: shares of light, where others give shares on a screen.

    Args:
        colour: Red, green, blue and opacity, 0 to 255, shape (4,) or (k, 4).
    """
    shares = np.array(colour, dtype=float) / 255.0
    shares[..., :3] = np.minimum(shares[..., :3] ** _GAMMA, _WHITEST)
    return np.asarray(np.round(255.0 * shares), dtype=np.uint8)


def _obj(mesh: Path) -> bytes:
    whole = _scene(mesh).to_mesh()
    whole.merge_vertices(merge_norm=True, merge_tex=True)
    bare = trimesh.Trimesh(whole.vertices, whole.faces, process=False)
    # One normal for each face, as a page draws what has none.
    normals, places = np.unique(np.round(bare.face_normals, 3) + 0.0, axis=0, return_inverse=True)
    lines = [
        *(f"v {x:.10g} {y:.10g} {z:.10g}" for x, y, z in bare.vertices.tolist()),
        *(f"vn {x:g} {y:g} {z:g}" for x, y, z in normals.tolist()),
        *(
            f"f {a}//{n} {b}//{n} {c}//{n}"
            for (a, b, c), n in zip(
                (bare.faces + 1).tolist(), (places.ravel() + 1).tolist(), strict=True
            )
        ),
    ]
    return "\n".join((*lines, "")).encode()


def _hull(mesh: Path) -> bytes:
    if mesh.suffix.lower() in {".gltf", ".vtk"}:
        # As Drake draws the one, whose y is up, and touches the other.
        hull = Mesh(str(mesh)).GetConvexHull()
    else:
        points = np.asarray(_scene(mesh).to_mesh().vertices, dtype=float)
        if not np.isfinite(points).all():
            raise ValueError("it has vertices that are not finite")
        hull = Convex(points.T, "mesh").GetConvexHull()
    vertices = (hull.vertex(k) for k in range(hull.num_vertices()))
    faces = (hull.element(k) for k in range(hull.num_elements()))
    lines = [
        *(f"v {x!r} {y!r} {z!r}" for x, y, z in (vertex.tolist() for vertex in vertices)),
        *(
            " ".join(("f", *(str(face.vertex(i) + 1) for i in range(face.num_vertices()))))
            for face in faces
        ),
    ]
    return "\n".join((*lines, "")).encode()


# Least number of triangles that a part keeps.
_FEWEST = 20


def simplify(files: Sequence[Path], triangles: int) -> list[Path]:
    """Return glTF files with fewer triangles in all, as glTF files of the cache.

    Each part keeps the same share of its triangles, and 20 at least.

    Args:
        files: The glTF files.
        triangles: Number of triangles in all of them together; fewer are left as they are.
    """
    counts = [sum(len(part.faces) for part in _parts(_whole_scene(file))) for file in files]
    share = min(1.0, triangles / max(sum(counts), 1))
    return [_simplify(file, share) for file in files]


def _simplify(file: Path, share: float) -> Path:
    name = content_name(file, b"simplified", repr(share).encode())
    return cached_file(f"meshes/{name}.gltf", lambda: _simplified_gltf(file, share))


def _simplified_gltf(file: Path, share: float) -> bytes:
    scene = _whole_scene(file)
    for name, part in list(scene.geometry.items()):
        if not isinstance(part, trimesh.Trimesh):
            continue
        target = max(int(share * len(part.faces)), _FEWEST)
        if target < len(part.faces):
            # Vertices that are there twice, for their normals, would be torn apart.
            bare = trimesh.Trimesh(part.vertices, part.faces, process=True)
            bare.merge_vertices()
            less = bare.simplify_quadric_decimation(face_count=target)
            less = trimesh.graph.smooth_shade(less, angle=0.6)
            less.visual = trimesh.visual.TextureVisuals(material=_material(part))
            scene.geometry[name] = less
    files = trimesh.exchange.gltf.export_gltf(
        scene, merge_buffers=True, embed_buffers=True, include_normals=True
    )
    return bytes(files["model.gltf"])


def _material(part: Any) -> Any:
    """Return the material of a part, of one colour."""
    visual = part.visual
    if visual.kind == "texture":
        return visual.material
    return trimesh.visual.material.PBRMaterial(
        baseColorFactor=visual.main_color, metallicFactor=0.0, doubleSided=True
    )


def _whole_scene(file: Path) -> Any:
    return trimesh.load_scene(str(file), process=False)


def _parts(scene: Any) -> list[Any]:
    return [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
