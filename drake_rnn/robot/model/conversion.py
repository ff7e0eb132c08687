"""Meshes in formats that Drake cannot show, converted with trimesh and pycollada.

- Meshes with fewer triangles, for pages that are not larger than need be.
- Modules that are imported when they are first used.
- The folders of the packages that a model names.
- XML as robot models use it, with prefixes that are not declared.
- Expansion of xacro, the macro language of ROS models.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element, TreeBuilder, tostring
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Convex, Mesh
from pydrake.multibody.parsing import PackageMap

from ...errors import InvalidInputError
from ...inputs.files import cached_file, content_of, is_file
from ...inputs.messages import nearest, short
from ...inputs.packages import packages_of


class _LateModule:
    """Stands for a module that is imported when one of its names is first used.

    Unlike one of `importlib.util.LazyLoader` it is not in `sys.modules`, where `inspect`, of which
    pydrake's templates make use, asks every module for its file, which would import it.
    """

    def __init__(self, name: str) -> None:
        vars(self)["name"] = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self.name), attribute)

    def __setattr__(self, attribute: str, value: Any) -> None:
        setattr(import_module(self.name), attribute, value)


def late_import(name: str) -> Any:
    """Return what stands for a module until one of its names is first used.

    For large modules that few runs need.

    Args:
        name: Full name of the module.

    Returns:
        The module, or None if it is not installed.
    """
    return None if find_spec(name) is None else _LateModule(name)


trimesh = late_import("trimesh")

#: Red, green, blue and opacity, each from 0 to 1.
Colour = tuple[float, float, float, float]

#: Colour of what has none.
GREY: Colour = (0.75, 0.75, 0.75, 1.0)

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
_COMPANION = re.compile(
    rb"<init_from>\s*([^<]+?)\s*</init_from>|^\s*(?:mtllib|map_\w+)\s+(?:-\S+\s+\S+\s+)*(.+?)\s*$",
    re.MULTILINE,
)


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
    if mesh.suffix.lower() not in {".dae", ".obj", ".mtl"}:
        return
    names = {one or other for one, other in _COMPANION.findall(mesh.read_bytes())}
    for name in sorted(names):
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


#: Size of a model file; its meshes are files of their own [bytes].
MOST_BYTES = 20_000_000


def parse_xml(text: bytes) -> Element | None:
    """Return the root element of a document; None if it is not well-formed.

    Prefixes stay part of the names, as in ``drake:acceleration``: models use them undeclared, which
    a parser that knows of namespaces refuses. Comments are left out.

    Raises:
        ValueError: If it has a document type, whose entities could be other files or without end.
    """
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return None
    return builder.close()


def _refuse_document_type(*_: object) -> None:
    raise ValueError("has a document type, <!DOCTYPE ...>; write out what its entities stand for")


def write_xml(root: Element) -> str:
    """Return a document as text."""
    return tostring(root, encoding="unicode")


# ROS packages of models are often renamed by adding or removing one of these.
_ENDINGS = ("_description", "_support")


class Packages:
    """The packages that a model's ``package://`` names may refer to.

    A package is looked for, in this order, among the folders that are given; in the folders above
    the model, by their name or their ``package.xml``; in ``ROS_PACKAGE_PATH`` and among Drake's
    own; and in ``AMENT_PREFIX_PATH``. Above the model it is also found under a name with
    ``_description`` or ``_support`` added or removed.

    Args:
        folders: Folders by package.
        model: Model file.
    """

    def __init__(self, folders: Mapping[str, str], model: Path) -> None:
        self._given = {name: Path(folder) for name, folder in folders.items()}
        self._folder = model.resolve().parent

    def beside(self, model: Path) -> Packages:
        """Return the packages that another model file may refer to, where the same are given."""
        return Packages({name: str(folder) for name, folder in self._given.items()}, model)

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None if there is none."""
        return next(self._candidates(name), None)

    def file(self, uri: str) -> Path | None:
        """Return the file that a model means by ``uri``; None if there is no such file.

        Args:
            uri: ``package://`` or ``model://`` and a package, ``file://`` and an absolute name, or
                a name relative to the model.
        """
        return next((place.resolve() for place in self._places(uri) if is_file(place)), None)

    def what_else(self, uri: str) -> str:
        """Return what there is instead of a file that a model means; empty for nothing."""
        place = next((each for each in self._places(uri) if each.exists()), None)
        if place is None:
            return ""
        return "it is a folder" if place.is_dir() else "it is no regular file"

    def _places(self, uri: str) -> Iterator[Path]:
        """Yield where a model may mean a file to be."""
        parts = urlparse(uri)
        if parts.scheme in {"package", "model"}:
            inside = unquote(parts.path).lstrip("/")
            yield from (folder / inside for folder in self._candidates(parts.netloc))
        elif parts.scheme == "file":
            yield Path(unquote(parts.netloc + parts.path))
        else:
            yield self._folder / uri

    @cached_property
    def _package_map(self) -> PackageMap:
        """Drake's own packages and those in ``ROS_PACKAGE_PATH``."""
        packages = PackageMap()
        packages.PopulateFromRosPackagePath()
        return packages

    def _candidates(self, name: str) -> Iterator[Path]:
        if name in self._given:
            yield self._given[name]
            return
        for other in (name, *_variants(name)):
            yield from self._above(other)
        if self._package_map.Contains(name):
            # Drake downloads its own models when they are first asked for.
            with suppress(RuntimeError):
                yield Path(self._package_map.GetPath(name))
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
            if prefix and (folder := Path(prefix) / "share" / name).is_dir():
                yield folder

    def _above(self, name: str) -> Iterator[Path]:
        """Yield folders above the model that are, contain or declare the package."""
        for folder in (self._folder, *self._folder.parents):
            if folder.name == name or _declared_name(folder) == name:
                yield folder
            if (inner := folder / name).is_dir():
                yield inner


def _variants(name: str) -> Iterator[str]:
    for ending in _ENDINGS:
        if name.endswith(ending):
            yield name.removesuffix(ending)
        yield name + ending


def _declared_name(folder: Path) -> str | None:
    """Return the package that a folder's ``package.xml`` declares."""
    try:
        root = parse_xml((folder / "package.xml").read_bytes())
    except (OSError, ValueError):
        return None
    return None if root is None else (root.findtext("name") or "").strip()


xacro = late_import("xacro")
substitution: Any = None if xacro is None else late_import("xacro.substitution_args")


def is_xacro(root: Element) -> bool:
    """Return whether a document contains macros."""
    return any(element.tag.startswith("xacro:") for element in root.iter())


class _Arguments(dict[str, str]):
    """Arguments of macros that note which of them are asked for."""

    def __init__(self, folders: Mapping[str, object]) -> None:
        words = {True: "true", False: "false"}
        texts = {k: words[v] if isinstance(v, bool) else str(v) for k, v in folders.items()}
        super().__init__(texts)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


_UNDEFINED = re.compile(r"[Uu]ndefined substitution argument '?(\w+)'?")


def expand_xacro(
    file: Path,
    packages: Packages,
    arguments: Mapping[str, object] | None = None,
    key: str = "arm.model",
) -> bytes:
    """Return a document with its macros expanded.

    Args:
        file: The document.
        packages: The packages that its ``$(find ...)`` name.
        arguments: Arguments of the macros; the others have their default values.
        key: Key of the file, for messages.

    Raises:
        InvalidInputError: If xacro is not installed or cannot expand the document, or it has no
            such argument.
    """
    mappings = _Arguments(arguments or {})
    stem = file.name.removesuffix(".xacro").removesuffix(".urdf")
    if xacro is None:
        by_hand = f"expand it with `xacro {file.name} > {stem}.urdf`"
        raise InvalidInputError(
            f"{key}: {file} is a xacro file; {by_hand}, or pip install {packages_of('xacro')}"
        )
    with _finding(packages) as missing:
        try:
            contents = bytes(
                xacro.process_file(str(file), mappings=mappings).toxml(encoding="utf-8")
            )
        # What macros raise is not known: they may contain Python.
        except Exception as error:
            if missing:
                raise InvalidInputError(
                    f"{key}: {file} names the unknown package {missing[0]!r}; give its folder in "
                    "arm.packages"
                ) from None
            text = " ".join(str(error).split())
            if (match := _UNDEFINED.search(text)) is not None:
                raise InvalidInputError(
                    f"{key}: {file} needs the argument {match[1]!r}; give it in "
                    f"arm.xacro_arguments: {{{match[1]}: ...}}"
                ) from None
            hint = ""
            if names_asked := ", ".join(sorted(mappings.asked)[:12]):
                hint = f"; its arguments are given in arm.xacro_arguments: {names_asked}"
            raise InvalidInputError(f"{key}: {file} cannot be expanded: {text}{hint}") from None
    if unknown := [name for name in mappings if name not in mappings.asked]:
        raise InvalidInputError(
            f"arm.xacro_arguments.{unknown[0]}: {file.name} has no such argument; "
            + nearest(unknown[0], sorted(mappings.asked))
        )
    return contents


@contextmanager
def _finding(packages: Packages) -> Iterator[list[str]]:
    """Have xacro find packages as we do; by itself it needs an installed ROS.

    Yields:
        The packages that were not found.
    """
    missing: list[str] = []

    def find(package: str) -> str:
        folder = packages.find(package)
        if folder is None:
            missing.append(package)
            raise LookupError(package)
        return str(folder)

    of_ros = substitution._eval_find
    substitution._eval_find = find
    try:
        yield missing
    finally:
        substitution._eval_find = of_ros
