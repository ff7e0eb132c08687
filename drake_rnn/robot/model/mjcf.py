"""MJCF, MuJoCo's format, written out so that Drake reads it as MuJoCo does.

- Files that are included or attached, frames and replicas: one tree of bodies without them.
- Classes of defaults and settings of the compiler: attributes and radians of each element.
- Joints: one in each body, zero where MuJoCo's position is zero.
- Sites as frames; masses; what the actuators of a joint can exert together.
- Joints that follow others, and named postures, the keyframes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import chain, count
from math import pi
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis, Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from ...errors import InvalidInputError
from ...inputs.fields import Array
from ...inputs.files import content_of
from ...inputs.messages import decimal, plural
from .formats import Mimic, numbers_text
from .meshes import Meshes, about
from .ros_packages import MOST_BYTES, Packages, parse_xml, require_shallow


@dataclass
class Flat:
    """What Drake does not read of a model.

    Attributes:
        mimics: Joints that follow others, by name.
        postures: Positions of joints by the name of the posture [rad or m].
        warnings: What is left out, and changes that alter the physics.
    """

    mimics: dict[str, Mimic] = field(default_factory=dict)
    postures: dict[str, dict[str, float]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def mend_mjcf(root: Element, meshes: Meshes, packages: Packages, name: str) -> Flat:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.
        packages: Where its files are.
        name: Name of a model that has none.

    Raises:
        InvalidInputError: If a file that it includes cannot be read, or it has what is not read.
    """
    flat = _flatten(root, packages)
    if not root.get("model"):
        root.set("model", name)
    _read_meshes(root, meshes)
    _place_by_ends(root)
    flat.warnings += _state_masses(root)
    flat.warnings += _sites_as_bodies(root)
    flat.warnings += _state_motors(root)
    _drop_what_is_read(root)
    flat.warnings += meshes.warnings()
    return flat


# What orients an element, at most one of them, and how many numbers each has.
_TURNS = {"quat": 4, "axisangle": 4, "xyaxes": 6, "zaxis": 3, "euler": 3}
_SINGLE = ("hinge", "slide")
# Positions that a joint takes in a keyframe.
_SIZES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
# Copies of a replica, and files inside of each other.
_MOST_COPIES, _DEEPEST = 1000, 20
# Elements of all replicas, and files that a model includes or attaches, in all.
_MOST_ELEMENTS, _MOST_FILES = 100_000, 1000
_ENDLESS = "arm.model: its files include or attach each other without end"


class _Compiler:
    """Settings of the compiler that say how attributes are read: the last ones of a model.

    Args:
        root: The model, without includes.
    """

    def __init__(self, root: Element) -> None:
        settings: dict[str, str] = {}
        for section in root.findall("compiler"):
            settings |= section.attrib
        if settings.get("coordinate", "local") != "local":
            raise InvalidInputError(
                "arm.model: coordinate: global is read by MuJoCo before 2.3.4 alone; let that "
                "version save the model"
            )
        self.settings = settings
        self.unit = 1.0 if settings.get("angle", "degree") == "radian" else pi / 180.0
        self.sequence = settings.get("eulerseq", "xyz")
        self.autolimits = settings.get("autolimits", "true") == "true"
        self.folder = settings.get("meshdir") or settings.get("assetdir") or "."
        self.strips = settings.get("strippath") == "true"

    def state(self, root: Element) -> None:
        """Give a model one section of settings, as elements are once all is written out."""
        for section in root.findall("compiler"):
            root.remove(section)
        read = {"meshdir", "assetdir", "strippath", "eulerseq", "inertiagrouprange", "coordinate"}
        left = {name: value for name, value in self.settings.items() if name not in read}
        root.insert(0, Element("compiler", {**left, "angle": "radian", "autolimits": "true"}))

    def is_limited(self, attributes: Mapping[str, str], flag: str, values: str) -> bool:
        """Return whether limits count, by their flag or because they are given."""
        value = attributes.get(flag, "auto")
        return value == "true" or (value == "auto" and self.autolimits and values in attributes)

    def turn(self, attributes: Mapping[str, str]) -> RotationMatrix:
        """Return the orientation of an element."""
        names = [name for name in _TURNS if name in attributes]
        if not names:
            return RotationMatrix()
        numbers = _numbers(attributes, names[0], _TURNS[names[0]])
        if names[0] == "euler":
            return self._euler(numbers * self.unit)
        if names[0] == "axisangle":
            length = float(np.linalg.norm(numbers[:3]))
            return RotationMatrix(AngleAxis(float(numbers[3] * self.unit), numbers[:3] / length))
        if names[0] == "zaxis":
            return shortest_turn(numbers)
        if names[0] == "quat":
            return RotationMatrix(Quaternion(numbers / np.linalg.norm(numbers)))
        x = numbers[:3] / np.linalg.norm(numbers[:3])
        y = numbers[3:] - x * (x @ numbers[3:])
        y /= np.linalg.norm(y)
        return RotationMatrix(np.column_stack((x, y, np.cross(x, y))))

    def _euler(self, angles: Array) -> RotationMatrix:
        """Return successive turns: about axes that turn along, or of the parent if in capitals."""
        whole = RotationMatrix()
        for axis, angle in zip(self.sequence, angles, strict=True):
            turn = RotationMatrix(AngleAxis(float(angle), np.eye(3)["xyz".index(axis.lower())]))
            whole = turn @ whole if axis.isupper() else whole @ turn
        return whole

    def pose(self, attributes: Mapping[str, str]) -> RigidTransform:
        """Return the pose of an element in its parent."""
        return RigidTransform(self.turn(attributes), _numbers(attributes, "pos", 3, "0 0 0"))


def _numbers(attributes: Mapping[str, str], name: str, size: int, default: str = "") -> Array:
    """Return an attribute as numbers.

    Raises:
        ValueError: If it is not so many finite numbers.
    """
    parts = attributes.get(name, default).split()
    try:
        numbers = np.array([decimal(part) for part in parts])
    except ValueError as error:
        raise ValueError(f"{name} of {attributes.get('name', '')!r}: {error}") from None
    if numbers.size != size:
        raise ValueError(
            f"{name} of {attributes.get('name', '')!r} must be {size} numbers, "
            f"not {attributes.get(name)!r}"
        )
    return numbers


def _set_pose(element: Element, X: RigidTransform, compiler: _Compiler) -> None:
    """Place an element whose own pose counts in a frame at ``X`` of its parent."""
    if "fromto" in element.attrib:
        ends = _numbers(element.attrib, "fromto", 6).reshape(2, 3)
        element.set("fromto", numbers_text(np.ravel([X @ end for end in ends])))
        return
    pose = X @ compiler.pose(element.attrib)
    turns = [name for name in _TURNS if name in element.attrib]
    for name in turns:
        del element.attrib[name]
    if turns or not X.rotation().IsExactlyIdentity():
        element.set("quat", numbers_text(pose.rotation().ToQuaternion().wxyz()))
    if "pos" in element.attrib or not X.IsExactlyIdentity():
        element.set("pos", numbers_text(pose.translation()))


def _flatten(
    root: Element, packages: Packages, depth: int = 0, files: list[str] | None = None
) -> Flat:
    """Write out all that stands for other elements or attributes of a model."""
    files = [] if files is None else files
    include_files(root, packages, depth, files)
    require_shallow(root)
    compiler, classes = _Compiler(root), _Classes(root)
    parts = _Parts(root, packages, depth, files)
    _state_assets(root, compiler, classes)
    for world in root.findall("worldbody"):
        _unfold(world, RigidTransform(), "main", (compiler, classes, parts))
    _state_drives(root, compiler, classes)
    for section in root.findall("default"):
        root.remove(section)
    root.extend(parts.sections)
    require_shallow(root)
    _require_sizes(root)
    _name(root)
    _leave_out_groups(root, compiler)
    flat = Flat(warnings=[*parts.warnings])
    flat.mimics = parts.mimics | _followers(root, flat.warnings)
    flat.postures = parts.postures | _keyframes(root, flat.warnings)
    parents = {child: parent for parent in root.iter() for child in parent}
    for body in [*root.iter("body")]:
        _split(body, parents[body])
    for element in root.iter():
        element.attrib.pop("class", None)
    compiler.state(root)
    return flat


def _state_assets(root: Element, compiler: _Compiler, classes: _Classes) -> None:
    """Give meshes and materials all that classes say of them, and meshes their names and files."""
    for asset in root.iterfind("asset/*"):
        if asset.tag in {"mesh", "material"}:
            classes.state(asset, "main")
        if asset.tag == "mesh" and (name := asset.get("file")) is not None:
            asset.set("name", asset.get("name") or Path(name).stem)
            last = Path(name).name if compiler.strips else name
            asset.set("file", str(Path(compiler.folder) / last))


def _state_drives(root: Element, compiler: _Compiler, classes: _Classes) -> None:
    """Give actuators all that classes say of them, and say which of their limits count."""
    for drive in root.iterfind("actuator/*"):
        if drive.tag not in _SHORTCUTS:
            continue
        classes.state(drive, "main")
        for name in ("ctrl", "force"):
            counts = compiler.is_limited(drive.attrib, f"{name}limited", f"{name}range")
            drive.set(f"{name}limited", "true" if counts else "false")


def include_files(
    root: Element, packages: Packages, depth: int = 0, files: list[str] | None = None
) -> None:
    """Put the content of included files in the place of their names, as MuJoCo does.

    Args:
        root: The model.
        packages: Where its files are.
        depth: How many files it is within.
        files: Files so far.
    """
    files = [] if files is None else files
    if depth > _DEEPEST:
        raise InvalidInputError(_ENDLESS)
    for parent in list(root.iter()):
        for place, element in reversed(list(enumerate(parent))):
            if element.tag != "include":
                continue
            content_root = _read(element.get("file", ""), packages, "includes", files)
            include_files(content_root, packages, depth + 1, files)
            if root.get("model") is None and content_root.get("model") is not None:
                root.set("model", content_root.get("model", ""))
            parent[place : place + 1] = list(content_root)


def _read(name: str, packages: Packages, verb: str, files: list[str]) -> Element:
    files.append(name)
    if len(files) > _MOST_FILES:
        raise InvalidInputError(_ENDLESS)
    file = packages.file(name)
    try:
        root = None if file is None else parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise InvalidInputError(f"arm.model: the file {name!r} {error}") from None
    if root is None:
        raise InvalidInputError(f"arm.model: the file {name!r} that it {verb} cannot be read")
    return root


# Shortcuts of an actuator and what they say of its force by control: that of a motor alone is no
# function of the posture.
_MOTOR = {"gaintype": "fixed", "gainprm": "1", "biastype": "none", "dyntype": "none"}
_SHORTCUTS: dict[str, Mapping[str, str]] = {
    "general": {},
    "motor": _MOTOR,
    **{tag: {"biastype": "affine"} for tag in ("position", "velocity", "intvelocity", "cylinder")},
    "damper": {"gaintype": "affine"},
    "muscle": {"gaintype": "muscle"},
    "adhesion": {},
    "plugin": {"gaintype": "user"},
    "dcmotor": {"gaintype": "user"},
}
_DRIVE = "drive"


class _Classes:
    """Classes of defaults, each with the attributes that it inherits.

    All kinds of actuators share theirs.
    """

    def __init__(self, root: Element) -> None:
        self._known: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for top in root.findall("default"):
            self._add(top, top.get("class", "main"), self._known["main"])
            # That of the outermost level goes by main, whatever it is called.
            self._known["main"] = self._known[top.get("class", "main")]

    def _add(
        self, section: Element, name: str, defaults_above: Mapping[str, dict[str, str]]
    ) -> None:
        defaults = {tag: dict(values) for tag, values in defaults_above.items()}
        for child in section:
            if child.tag in _SHORTCUTS:
                _override(defaults.setdefault(_DRIVE, {}), _SHORTCUTS[child.tag], child.attrib)
            elif child.tag != "default":
                _override(defaults.setdefault(child.tag, {}), child.attrib)
        self._known[name] = defaults
        for child in section.findall("default"):
            self._add(child, child.get("class", ""), defaults)

    def state(self, element: Element, class_above: str) -> None:
        """Give an element the attributes of its class, and take the name of the class.

        Raises:
            ValueError: If there is no such class.
        """
        name = element.attrib.pop("class", class_above)
        if name not in self._known:
            raise ValueError(f"no class {name!r} of defaults")
        is_drive = element.tag in _SHORTCUTS
        defaults = dict(self._known[name].get(_DRIVE if is_drive else element.tag, {}))
        own = dict(element.attrib)
        _override(defaults, *([_SHORTCUTS[element.tag]] if is_drive else []), own)
        if "fromto" in own:
            defaults.pop("pos", None)
        element.attrib.clear()
        element.attrib.update(defaults)


def _override(known: dict[str, str], *later: Mapping[str, str]) -> None:
    """Change attributes to later ones, of which any orientation replaces another."""
    for attributes in later:
        if any(name in _TURNS for name in attributes):
            for name in _TURNS:
                known.pop(name, None)
        known |= attributes


@dataclass
class _Parts:
    """Models that are attached to a model, and what is said of them."""

    root: Element
    packages: Packages
    depth: int
    files: list[str]
    copied: int = 0
    sections: list[Element] = field(default_factory=list)
    mimics: dict[str, Mimic] = field(default_factory=dict)
    postures: dict[str, dict[str, float]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def _elements_to_attach(self, element: Element) -> list[Element]:
        """Return the bodies of another model that an element attaches, and take what they need.

        Raises:
            InvalidInputError: If there is no such model or body.
        """
        name, prefix = element.get("model", ""), element.get("prefix", "")
        files = {m.get("name"): m.get("file", "") for m in self.root.iterfind("asset/model")}
        if name not in files:
            raise InvalidInputError(f"arm.model: it attaches the model {name!r}, which it has not")
        part = _read(files[name], self.packages, "attaches", self.files)
        place = self.packages.file(files[name])
        assert place is not None
        flat = _flatten(part, self.packages.beside(place), self.depth + 1, self.files)
        for mesh in part.iterfind("asset/mesh"):
            if (file := mesh.get("file")) is not None:
                mesh.set("file", str(place.parent / file))
        _prefix(part, prefix)
        self.mimics |= {
            prefix + joint: mimic._replace(joint=prefix + mimic.joint if mimic.joint else "")
            for joint, mimic in flat.mimics.items()
        }
        self.postures |= {
            prefix + key: {prefix + joint: q for joint, q in posture.items()}
            for key, posture in flat.postures.items()
        }
        self.warnings += flat.warnings
        for tag in ("asset", "actuator", "tendon"):
            self.sections += part.findall(tag)
        body = element.get("body")
        elements = part.findall("worldbody/*") if body is None else _bodies(part, prefix + body)
        if not elements:
            raise InvalidInputError(f"arm.model: the model {name!r} has no body {body!r} to attach")
        return elements


def _bodies(root: Element, name: str) -> list[Element]:
    return [body for body in root.iter("body") if body.get("name") == name]


# Attributes that name another element.
_REFERENCES = frozenset(
    ("name", "mesh", "material", "texture", "hfield", "joint", "jointinparent", "tendon")
)


def _prefix(root: Element, prefix: str) -> None:
    for element in root.iter():
        for name in _REFERENCES & set(element.attrib):
            element.set(name, prefix + element.get(name, ""))


def shortest_turn(axis: Array) -> RotationMatrix:
    """Return the rotation by the smallest angle that turns z to ``axis``; about x from z to -z.

    Args:
        axis: A direction, of any length but zero, shape (3,).
    """
    x, y, z = axis / np.linalg.norm(axis)
    across = float(np.hypot(x, y))
    if across == 0.0:
        return RotationMatrix() if z > 0.0 else RotationMatrix.MakeXRotation(np.pi)
    turn = np.array([-y, x, 0.0]) / across
    return RotationMatrix(AngleAxis(float(np.arctan2(across, z)), turn))


_Context = tuple[_Compiler, _Classes, _Parts]


def _unfold(parent: Element, X: RigidTransform, class_above: str, context: _Context) -> None:
    """Write out the children of a body, a frame or a replica, whose own pose is ``X``.

    Args:
        parent: The element, whose children are changed in place.
        X: Pose in which its children are given, in the body that they then belong to.
        class_above: Class of defaults of elements that name none.
        context: How attributes are read, the classes and what is attached.
    """
    compiler, classes, parts = context
    elements: list[Element] = []
    for child in list(parent):
        parent.remove(child)
        scope = child.get("childclass", class_above)
        if child.tag == "frame":
            _unfold(child, X @ compiler.pose(child.attrib), scope, context)
            elements += list(child)
        elif child.tag == "replicate":
            elements += _replicas(child, X, scope, context)
        elif child.tag == "attach":
            for body in parts._elements_to_attach(child):
                _set_pose(body, X, _RADIANS)
                elements.append(body)
        else:
            if child.tag == "body":
                _unfold(child, RigidTransform(), child.attrib.pop("childclass", scope), context)
            elif child.tag in {"geom", "site", "joint"}:
                classes.state(child, class_above)
            _place(child, X, compiler)
            elements.append(child)
    parent.extend(elements)


def _replicas(
    element: Element, X: RigidTransform, class_above: str, context: _Context
) -> Iterator[Element]:
    """Yield the copies that an element stands for, each placed from the one before."""
    compiler = context[0]
    count_text = element.get("count", "")
    copies = int(count_text) if count_text.isdecimal() and len(count_text) < _DEEPEST else 0
    if not 1 <= copies <= _MOST_COPIES:
        raise ValueError(f"count of a replica must be 1 to {_MOST_COPIES}, not {count_text!r}")
    euler = {"euler": element.get("euler", "0 0 0"), "pos": element.get("offset", "0 0 0")}
    step, width = compiler.pose(euler), len(str(copies))
    # Replicas within others multiply.
    parts = context[2]
    parts.copied += copies * sum(1 for _ in element.iter())
    if parts.copied > _MOST_ELEMENTS:
        raise ValueError(f"its replicas have more than {_MOST_ELEMENTS} elements")
    for number in range(copies):
        copy = deepcopy(element)
        _unfold(copy, X, class_above, context)
        for item in copy.iter():
            if copy is not item and "name" in item.attrib:
                ending = f"{element.get('sep', '')}{number:0{width}d}"
                item.set("name", item.get("name", "") + ending)
        yield from copy
        X = X @ step


def _place(child: Element, X: RigidTransform, compiler: _Compiler) -> None:
    """Place a child of a frame in the body that it belongs to, and state its angles."""
    if child.tag in {"body", "geom", "site", "inertial"}:
        _set_pose(child, X, compiler)
    if child.tag != "joint":
        return
    _state_joint(child, compiler)
    if not X.IsExactlyIdentity():
        child.set("pos", numbers_text(X @ _numbers(child.attrib, "pos", 3, "0 0 0")))
        axis = X.rotation() @ _numbers(child.attrib, "axis", 3, "0 0 1")
        child.set("axis", numbers_text(axis))


# How many numbers are the size of a shape.
_SHAPES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "ellipsoid": 3}


def _require_sizes(root: Element) -> None:
    """Raise a ValueError for a shape without a size, which MuJoCo refuses as well."""
    for body in root.iter("body"):
        for geom in body.findall("geom"):
            kind = geom.get("type", "sphere")
            if "mesh" in geom.attrib or kind not in _SHAPES:
                continue
            count = 1 if "fromto" in geom.attrib else _SHAPES[kind]
            where = f"the {kind} {geom.get('name', '')!r} of {body.get('name', '')!r}"
            sizes = [decimal(part) for part in geom.get("size", "").split()[:count]]
            if len(sizes) < count or min(sizes) <= 0.0:
                raise ValueError(
                    f"{where}: size must be {plural(count, 'number')} above 0, not "
                    f"{geom.get('size', '')!r}"
                )
            if count == 1 and kind != "sphere":
                ends = _numbers(geom.attrib, "fromto", 6)
                if not (ends[:3] - ends[3:]).any():
                    raise ValueError(f"{where}: fromto must be two places, not one twice")


def _name(root: Element) -> None:
    """Give bodies and joints without a name one, as Drake does: joints that of their bodies."""
    names_in_use = {element.get("name") for tag in ("body", "joint") for element in root.iter(tag)}

    def free(wish: str, first: str = "") -> str:
        numbers = map(str, count(1))
        name = next(
            n for n in (wish + end for end in chain([first], numbers)) if n not in names_in_use
        )
        names_in_use.add(name)
        return name

    def look(body: Element, own: str) -> None:
        for child in body.findall("body"):
            child.set("name", child.get("name") or free("body", "1"))
            name = child.get("name", "")
            for joint in child:
                if joint.tag in {"joint", "freejoint"} and not joint.get("name"):
                    joint.set("name", free(f"{own}-{name}"))
            look(child, name)

    for world in root.findall("worldbody"):
        look(world, "world")


def _state_joint(joint: Element, compiler: _Compiler) -> None:
    """State which limits of a joint count, and all of its angles in radians.

    Raises:
        InvalidInputError: If the limits of a joint are none.
    """
    kind = joint.get("type", "hinge")
    if kind not in _SIZES:
        raise ValueError(
            f"the joint {joint.get('name', '')!r} may be {', '.join(_SIZES)}, not {kind!r}"
        )
    unit = 1.0 if kind == "slide" else compiler.unit
    counts = compiler.is_limited(joint.attrib, "limited", "range")
    joint.set("limited", "true" if counts else "false")
    range_text = joint.attrib.pop("range", None)
    if counts:
        lower, upper = _numbers({"range": range_text or "0 0", **joint.attrib}, "range", 2) * unit
        if kind in _SINGLE and not lower < upper:
            raise InvalidInputError(
                f"arm.model: the limits of {joint.get('name', '')!r}: lower is {lower:g}, and must "
                f"be below upper, {upper:g}"
            )
        joint.set("range", numbers_text((lower, upper)))
    for name in ("ref", "springref"):
        if name in joint.attrib:
            joint.set(name, numbers_text(_numbers(joint.attrib, name, 1) * unit))
    force = compiler.is_limited(joint.attrib, "actuatorfrclimited", "actuatorfrcrange")
    joint.attrib.pop("actuatorfrclimited", None)
    if not force:
        joint.attrib.pop("actuatorfrcrange", None)


def _split(body: Element, parent: Element) -> None:
    """Give a body of several joints one for each, and let its joints be zero at position zero.

    MuJoCo states the body where its joints have the position ``ref``.

    Args:
        body: The body.
        parent: What holds it.
    """
    joints = body.findall("joint")
    frames = [_at_zero(joint) for joint in joints]
    if not joints or (len(joints) == 1 and frames[0].IsExactlyIdentity()):
        return
    place, outermost = list(parent).index(body), None
    holder = parent
    for number, (joint, X) in enumerate(zip(joints, frames, strict=True)):
        inner = body
        if number < len(joints) - 1:
            inner = Element("body", name=f"{body.get('name')}__{joint.get('name')}")
        pose = _RADIANS.pose(body.attrib) @ X if number == 0 else X
        if number == 0:
            outermost = inner
        if inner is not body:
            body.remove(joint)
            inner.append(joint)
        if holder is not parent:
            holder.append(inner)
        _write_pose(inner, pose)
        holder = inner
    assert outermost is not None
    parent[place] = outermost


def _write_pose(element: Element, X: RigidTransform) -> None:
    for name in _TURNS:
        element.attrib.pop(name, None)
    element.set("pos", numbers_text(X.translation()))
    element.set("quat", numbers_text(X.rotation().ToQuaternion().wxyz()))


def _at_zero(joint: Element) -> RigidTransform:
    """Return the motion of a joint from where its body is stated to its position zero."""
    ref = float(joint.attrib.pop("ref", 0.0))
    kind = joint.get("type", "hinge")
    if ref == 0.0 or kind not in _SINGLE:
        return RigidTransform()
    axis = _numbers(joint.attrib, "axis", 3, "0 0 1")
    axis = axis / np.linalg.norm(axis)
    if kind == "slide":
        return RigidTransform(-ref * axis)
    anchor = _numbers(joint.attrib, "pos", 3, "0 0 0")
    R = RotationMatrix(AngleAxis(-ref, axis))
    return RigidTransform(R, anchor - R @ anchor)


def _joints(root: Element) -> Iterator[tuple[str, str, float]]:
    """Yield name, type and ``ref`` of each joint, in the order of a keyframe."""
    for world in root.findall("worldbody"):
        for joint in world.iter():
            if joint.tag == "freejoint":
                yield joint.get("name", ""), "free", 0.0
            elif joint.tag == "joint":
                kind = joint.get("type", "hinge")
                yield joint.get("name", ""), kind, float(joint.get("ref", 0.0))


def _followers(root: Element, warnings: list[str]) -> dict[str, Mimic]:
    """Return the joints that follow others in proportion; tell of those that do otherwise."""
    followers, refs = dict[str, Mimic](), {n: ref for n, _, ref in _joints(root)}
    curved_names, unknown_names = list[str](), list[str]()
    for rule in root.iterfind("equality/joint"):
        follower, leader = rule.get("joint1", ""), rule.get("joint2", "")
        if rule.get("active", "true") != "true":
            continue
        if unknown := [name for name in (follower, leader or follower) if name not in refs]:
            unknown_names += unknown
            continue
        terms = np.zeros(5)
        keys = [decimal(part) for part in rule.get("polycoef", "0 1 0 0 0").split()]
        terms[: len(keys)] = keys
        if leader and terms[2:].any():
            curved_names.append(follower)
            continue
        # MuJoCo relates positions as they differ from `ref`.
        offset = refs[follower] + terms[0]
        if leader:
            followers[follower] = Mimic(leader, terms[1], offset - terms[1] * refs[leader])
        else:
            followers[follower] = Mimic("", 0.0, offset)
    warnings += about(curved_names, "joints that follow another by a curve move on their own:")
    warnings += about(unknown_names, "left out are equalities of joints that are not in the model:")
    return followers


def _keyframes(root: Element, warnings: list[str]) -> dict[str, dict[str, float]]:
    """Return the positions of joints in each keyframe, by its name or its number."""
    joints = [(name, kind, _SIZES[kind]) for name, kind, _ in _joints(root)]
    size, keyframes, wrong = sum(entry[2] for entry in joints), {}, []
    for number, key in enumerate(root.iterfind("keyframe/key")):
        name = key.get("name") or f"key{number}"
        values = [decimal(part) for part in key.get("qpos", "").split()]
        if not values:
            continue
        if len(values) != size:
            wrong.append(f"{name} ({len(values)} positions of {size})")
            continue
        begins = np.cumsum([0, *(entry[2] for entry in joints)])
        keyframes[name] = {
            joint: values[begin]
            for (joint, kind, _), begin in zip(joints, begins, strict=False)
            if kind in _SINGLE
        }
    warnings += about(wrong, "keyframes of other sizes are left out:")
    return keyframes


def _drop_what_is_read(root: Element) -> None:
    """Leave out joints that follow others and keyframes, which Drake does not read, and contacts.

    Parts of an arm make no contact with each other, whatever the model says.
    """
    for section in root.findall("equality"):
        for rule in section.findall("joint"):
            section.remove(rule)
    for section in (*root.findall("keyframe"), *root.findall("contact")):
        root.remove(section)


def _leave_out_groups(root: Element, compiler: _Compiler) -> None:
    """Take the mass from geometries whose group does not count for inertia."""
    if (group_range := compiler.settings.get("inertiagrouprange")) is None:
        return
    first, last = (int(part) for part in group_range.split())
    for geometry in root.iter("geom"):
        if not first <= int(geometry.get("group", 0)) <= last:
            geometry.set("mass", "0")


#: How attributes are read that were written out.
_RADIANS = _Compiler(Element("mujoco"))
_RADIANS.unit = 1.0


def _read_meshes(root: Element, meshes: Meshes) -> None:
    """Name the meshes by files that Drake reads; leave out those that there are not."""
    missing = dict[str, str]()
    for assets in root.findall("asset"):
        for mesh in assets.findall("mesh"):
            if (uri := mesh.get("file")) is None:
                continue
            file = meshes.plain(uri)
            if file is None:
                assets.remove(mesh)
                missing[mesh.get("name", "")] = uri
            else:
                mesh.set("file", str(file))
    _use_meshes(root, meshes, missing)


def _use_meshes(root: Element, meshes: Meshes, missing: Mapping[str, str]) -> None:
    """Leave out the geometries of meshes that there are not."""
    for body in root.iter():
        for geometry in body.findall("geom"):
            if (name := geometry.get("mesh", "")) in missing:
                body.remove(geometry)
                meshes.lose(body.get("name", ""), missing[name])
            elif name:
                # MuJoCo may fit another shape to a mesh; the mesh itself is what it stands for.
                geometry.set("type", "mesh")


def _place_by_ends(root: Element) -> None:
    """Give boxes and ellipsoids from one point to another a pose and sizes, as MuJoCo does.

    Sites get a pose, whatever their shape is.
    """
    for element in root.iter():
        if "fromto" not in element.attrib or element.tag not in {"geom", "site"}:
            continue
        kind = element.get("type")
        if element.tag == "geom" and kind not in {"box", "ellipsoid"}:
            continue
        ends = _numbers(element.attrib, "fromto", 6).reshape(2, 3)
        del element.attrib["fromto"]
        # The way from the second to the first end is z.
        _write_pose(element, RigidTransform(shortest_turn(ends[0] - ends[1]), ends.mean(axis=0)))
        width = float(element.get("size", "0").split()[0])
        half = 0.5 * float(np.linalg.norm(ends[1] - ends[0]))
        element.set("size", f"{width!r} {width!r} {half!r}")


def _state_masses(root: Element) -> list[str]:
    """Take the inertia from bodies without mass, of which Drake accepts none."""
    bare = []
    for body in root.iter("body"):
        for inertial in body.findall("inertial"):
            if "fullinertia" not in inertial.attrib:
                inertial.attrib.setdefault("diaginertia", "0 0 0")
            if float(inertial.get("mass", 1.0)) == 0.0:
                body.remove(inertial)
                bare.append(body.get("name", ""))
                for geometry in body.findall("geom"):
                    geometry.set("mass", "0")
    return about(bare, "bodies with an inertia and no mass have neither here:")


def _sites_as_bodies(root: Element) -> list[str]:
    """Turn named sites, which Drake leaves out, into bodies without mass: frames of that name.

    Returns:
        A warning about those that have another name, as a body has theirs.
    """
    names_in_use = {body.get("name") for body in root.iter("body")}
    other = list[str]()
    for parent in [*root.iter("body")]:
        for site in parent.findall("site"):
            if (name := site.get("name")) is None:
                continue
            if name in names_in_use:
                other.append(name)
                name += "_site"
                if name in names_in_use:
                    continue
            names_in_use.add(name)
            place = {key: value for key, value in site.items() if key in {"pos", "quat"}}
            site.tag = "body"
            site.attrib.clear()
            site.attrib.update(place, name=name)
    return about(other, "sites with the name of a body are frames called NAME_site:")


def _state_motors(root: Element) -> list[str]:
    """Turn what drives a joint into one motor with its limit: Drake does not know the others.

    Returns:
        Warnings about limits that Drake cannot state.
    """
    joints = {joint.get("name", ""): joint for joint in root.iter("joint") if joint.get("name")}
    bounds: dict[str, Array] = {}
    tendons = {t.get("name"): t for t in root.iterfind("tendon/fixed")}
    sections = root.findall("actuator")
    for section in sections:
        for drive in list(section):
            section.remove(drive)
            for joint, factor in _driven_joints(drive, tendons):
                if joint in joints and joints[joint].get("type", "hinge") in _SINGLE:
                    bounds[joint] = bounds.get(joint, np.zeros(2)) + _force(drive, factor)
    return _motors(sections[0] if sections else SubElement(root, "actuator"), joints, bounds)


def _driven_joints(
    drive: Element, tendons: Mapping[str | None, Element]
) -> list[tuple[str, float]]:
    """Return the joints that an actuator drives, and the factor from its force to theirs."""
    gear = float(drive.get("gear", "1").split()[0])
    if (joint := drive.get("joint") or drive.get("jointinparent")) is not None:
        return [(joint, gear)]
    tendon = tendons.get(drive.get("tendon"))
    ends = [] if tendon is None else tendon.findall("joint")
    return [(end.get("joint", ""), gear * float(end.get("coef", 1.0))) for end in ends]


def _force(drive: Element, factor: float) -> Array:
    """Return the least and largest force or torque that an actuator exerts on a joint, (2,)."""
    attributes = drive.attrib
    if factor == 0.0:
        return np.zeros(2)
    if attributes.get("forcelimited") == "true":
        bounds = _numbers(attributes, "forcerange", 2, "0 0")
    elif attributes.get("ctrllimited") == "true" and all(
        attributes.get(name, value) == value for name, value in _MOTOR.items() if name != "gainprm"
    ):
        gain = float(attributes.get("gainprm", "1").split()[0])
        bounds = gain * _numbers(attributes, "ctrlrange", 2, "0 0")
    else:
        bounds = np.array([-np.inf, np.inf])
    return np.sort(factor * bounds)


def _motors(
    section: Element, joints: Mapping[str, Element], bounds: Mapping[str, Array]
) -> list[str]:
    """State a motor for each joint that is driven or whose force is limited."""
    unlike, none = list[str](), list[str]()
    for name, joint in joints.items():
        force = bounds.get(name, np.array([-np.inf, np.inf]))
        if (force_range := joint.attrib.pop("actuatorfrcrange", None)) is not None:
            lower, upper = _numbers({"range": force_range}, "range", 2)
            force = np.array([max(force[0], lower), min(force[1], upper)])
        elif name not in bounds:
            continue
        motor = SubElement(section, "motor", name=f"{name}_motor", joint=name)
        least, most = sorted(np.abs(force).tolist())
        if most == 0.0:
            none.append(name)
        elif np.isfinite(most):
            if not np.isclose(least, most, rtol=1e-9):
                unlike.append(f"{name} ({force[0]:g} to {force[1]:g})")
            both = min(least, most) if force[0] < 0.0 < force[1] else most
            motor.set("forcerange", numbers_text((-both, both)))
            motor.set("forcelimited", "true")
    return [
        *about(none, "a limit of 0 is taken for an unknown effort limit:"),
        *about(unlike, "efforts that differ by direction count as the smaller one:"),
    ]
