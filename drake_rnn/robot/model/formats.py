"""Changes to URDF and SDF where Drake cannot read them.

- Changes to URDF where Drake cannot read it, or reads it differently from its meaning.
- Moments of inertia that a body can have.
- Changes to SDF where Drake cannot read its meshes.
- Joints that follow other joints, as URDF and SDF state them.
- A model of any format, as Drake has read it, written as URDF.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    Mesh,
    Role,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Joint,
    JointActuator,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    WeldJoint,
)

from ...errors import InvalidInputError
from ...inputs.fields import Array
from ...inputs.files import content_of
from ...inputs.messages import decimal
from .meshes import Colour, Meshes, MeshName, about, mend_geometry
from .ros_packages import MOST_BYTES, Packages, parse_xml


def nearest_possible(entries: Sequence[float]) -> tuple[float, ...] | None:
    """Return the physically possible rotational inertia nearest to an impossible one.

    The principal moments of a body are positive, and none exceeds the sum of the other two. Where
    one does, it becomes that sum; a negative one first becomes a thousandth of the largest.

    Args:
        entries: Moments and products of inertia xx, yy, zz, xy, xz, yz [kg m^2].

    Returns:
        Entries in the same order; None if those given are possible, or all zero.
    """
    xx, yy, zz, xy, xz, yz = entries
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    # Drake accepts the same rounding error.
    rounding = 10.0 * np.finfo(float).eps * abs(moments).max()
    if moments[0] >= -rounding and moments[2] <= moments[0] + moments[1] + rounding:
        return None
    moments = np.maximum(moments, 1e-3 * moments[2])
    if moments[2] <= 0.0:
        return None
    # A little less than the sum, so that rounding cannot exceed it.
    moments[2] = min(moments[2], (moments[0] + moments[1]) * (1.0 - 1e-9))
    possible = axes @ np.diag(moments) @ axes.T
    return tuple(float(possible[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def numbers_text(numbers: Iterable[float] | Array) -> str:
    """Return numbers as an attribute of XML, to the last digit."""
    return " ".join(repr(float(number)) for number in numbers)


_SIMPLE = "SimpleTransmission"
#: Types of joints that move.
MOVING = frozenset({"revolute", "continuous", "prismatic"})
_POSITIONS = ("lower", "upper")
# Position limits between two turns in radians and in degrees are suspected to be degrees.
_TURNS, _DEGREES = 4.0 * math.pi + 0.1, 720.0


def mend_urdf(root: Element, meshes: Meshes) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.

    Returns:
        Warnings about changes that alter the physics or the looks.
    """
    _check_limits(root)
    _rename_materials(root)
    missing = _drop_lost_mimics(root)
    _state_motors(root)
    colours = _named_colours(root)
    return [
        *missing,
        *mend_geometry(root, meshes, _mesh, lambda visual: _colour(visual, colours)),
        *_fix_floating_joints(root),
        *_drop_zero_limits(root),
        *_suspected_degrees(root),
        *_mend_inertias(root),
        *meshes.warnings(),
    ]


# What says how large a shape is: attributes in URDF, elements in SDF.
_SIZES = {
    "box": ("size",),
    "sphere": ("radius",),
    **dict.fromkeys(("cylinder", "capsule", "drake:capsule"), ("radius", "length")),
    "ellipsoid": ("radii",),
    "drake:ellipsoid": ("a", "b", "c"),
    "mesh": ("scale",),
}
# Thickness of a shape that has none: Drake refuses such a one in URDF, and takes 1 m in SDF [m].
_THIN = 1e-6


def mend_sizes(root: Element) -> list[str]:
    """Give shapes of URDF or SDF without a thickness one; a drawn one of no size is left out.

    Returns:
        Warnings about both.

    Raises:
        ValueError: If a shape has no size, or a negative one, by its link.
    """
    thin, empty = list[str](), list[str]()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            for solid in shape.iterfind("geometry/*"):
                kind = solid.tag.removeprefix("drake:")
                name = f"the {kind} of {link.get('name')!r}"
                values = [_size(name, solid, key) for key in _SIZES.get(solid.tag, ())]
                numbers = [number for _, each in values for number in each]
                if all(numbers):
                    continue
                if shape.tag == "visual" and not any(numbers):
                    empty.append(name)
                    link.remove(shape)
                    break
                thin.append(name)
                for (key, each), attribute in zip(values, _SIZES[solid.tag], strict=True):
                    text = numbers_text(number or _THIN for number in each)
                    if key is None:
                        solid.set(attribute, text)
                    else:
                        key.text = text
    return [
        *about(empty, "drawn shapes of no size are left out:"),
        *about(thin, "shapes without thickness are taken as 1 um thick:"),
    ]


def _size(where: str, solid: Element, key: str) -> tuple[Element | None, list[float]]:
    """Return the numbers of a size, and the element whose text they are, None of an attribute.

    What is no number Drake tells of; no size has none.
    """
    element = solid.find(key)
    text = solid.get(key) if element is None else element.text
    if text is None:
        # Drake takes 1 m in SDF.
        if solid.tag != "mesh":
            raise ValueError(f"{where}: {key} must be given")
        return element, []
    try:
        numbers = [decimal(part) for part in text.split()]
    except ValueError as error:
        raise ValueError(f"{where}: {key} {error}") from None
    if solid.tag != "mesh" and min(numbers, default=0.0) < 0.0:
        raise ValueError(f"{where}: {key} must not be negative, not {text.strip()!r}")
    return element, numbers


def _mesh(geometry: Element) -> MeshName | None:
    mesh = geometry.find("geometry/mesh")
    return None if mesh is None else MeshName(mesh, "filename", mesh.get("scale", ""))


def _named_colours(root: Element) -> dict[str, Colour]:
    return {
        name: colour
        for material in _materials(root)
        if (name := material.get("name")) and (colour := _own_colour(material)) is not None
    }


def _rename_materials(root: Element) -> None:
    """Take the name from a material that was defined in another colour before: Drake refuses it."""
    colours: dict[str, Colour] = {}
    for material in _materials(root):
        name, colour = material.get("name", ""), _own_colour(material)
        if name and colour is not None and colours.setdefault(name, colour) != colour:
            material.set("name", "")


def _materials(root: Element) -> list[Element]:
    return [*root.findall("material"), *root.findall("link/visual/material")]


def _own_colour(material: Element) -> Colour | None:
    colour = material.find("color")
    numbers = [] if colour is None else [float(part) for part in colour.get("rgba", "").split()]
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if len(numbers) == 4 else None


def _colour(visual: Element, colours: Mapping[str, Colour]) -> Colour | None:
    if (material := visual.find("material")) is None:
        return None
    return _own_colour(material) or colours.get(material.get("name", ""))


def _fix_floating_joints(root: Element) -> list[str]:
    floating = [joint for joint in root.findall("joint") if joint.get("type") == "floating"]
    for joint in floating:
        joint.set("type", "fixed")
    return about(_names(floating), "floating joints are fixed:")


def _drop_lost_mimics(root: Element) -> list[str]:
    """Leave out what Drake refuses: fixed joints that follow or are followed."""
    joints = root.findall("joint")
    names = {joint.get("name") for joint in joints}
    moving = {joint.get("name") for joint in joints if joint.get("type") != "fixed"}
    dropped_names = []
    for joint in joints:
        for mimic in joint.findall("mimic"):
            if mimic.get("joint") not in names:
                dropped_names.append(joint.get("name", ""))
            if not {joint.get("name"), mimic.get("joint")} <= moving:
                joint.remove(mimic)
    return about(
        dropped_names, "joints that should follow one that there is not move on their own:"
    )


def _limits(root: Element) -> Iterator[tuple[Element, Element]]:
    """Yield the joints that move and their limits."""
    for joint in root.findall("joint"):
        if joint.get("type") in MOVING and (limit := joint.find("limit")) is not None:
            yield joint, limit


def _check_limits(root: Element) -> None:
    """Raise an InvalidInputError for limits that no joint has; Drake's errors name no joint."""
    for joint, limit in _limits(root):
        where = f"arm.model: the limits of {joint.get('name')!r}"
        if joint.get("type") != "continuous":
            lower, upper = (_limit(where, limit, name) for name in ("lower", "upper"))
            if lower > upper:
                raise InvalidInputError(f"{where}: lower is {lower:g}, above upper, {upper:g}")
        for name in ("velocity", "effort"):
            if (value := _limit(where, limit, name)) < 0.0:
                raise InvalidInputError(f"{where}: {name} must not be negative, as {value:g} is")


def _limit(where: str, limit: Element, name: str) -> float:
    """Return a limit as a number, 0 if it is not given.

    Raises:
        InvalidInputError: If it is none, by the name of the joint.
    """
    try:
        return decimal(limit.get(name, "0"))
    except ValueError as error:
        hint = ""
        if "inf" in limit.get(name, "").lower():
            hint = "; without limits of position it is of the type continuous"
            if name not in _POSITIONS:
                hint = "; leave out what is not known"
        raise InvalidInputError(f"{where}: {name} {error}{hint}") from None


def _suspected_degrees(root: Element) -> list[str]:
    joints = [
        joint
        for joint, limit in _limits(root)
        if joint.get("type") == "revolute"
        and any(_TURNS < abs(float(limit.get(name, 0.0))) <= _DEGREES for name in _POSITIONS)
    ]
    return about(_names(joints), "position limits of more than two turns; are they in degrees?")


def _drop_zero_limits(root: Element) -> list[str]:
    warnings = []
    for name in ("velocity", "effort"):
        zero = [joint for joint, limit in _limits(root) if float(limit.get(name, 1.0)) == 0.0]
        for joint in zero:
            for limit in joint.findall("limit"):
                limit.attrib.pop(name, None)
        warnings += about(_names(zero), f"a limit of 0 is taken for an unknown {name} limit:")
    return warnings


def _state_motors(root: Element) -> None:
    """Give each joint whose effort is known one transmission, as Drake takes the effort from it."""
    limits = {
        joint.get("name", ""): joint.find("limit")
        for joint in root.findall("joint")
        if joint.get("type") in MOVING
    }
    motor_joints: set[str] = set()
    actuators: set[str] = set()
    for transmission in root.findall("transmission"):
        joints = {joint.get("name", "") for joint in transmission.findall("joint")}
        names = {motor.get("name", "") for motor in transmission.findall("actuator")}
        simple = _SIMPLE in (transmission.findtext("type") or transmission.get("type") or "")
        if (
            simple
            and joints <= set(limits) - motor_joints
            and not names & actuators
            and len(joints) == 1
        ):
            motor_joints |= joints
            actuators |= names
        else:
            root.remove(transmission)
    for name, limit in limits.items():
        if name not in motor_joints and limit is not None and limit.get("effort") is not None:
            _add_transmission(root, name)


def _add_transmission(root: Element, joint: str) -> Element:
    """Add a motor of a joint; return its element."""
    transmission = SubElement(root, "transmission", name=f"{joint}_transmission")
    SubElement(transmission, "type").text = f"transmission_interface/{_SIMPLE}"
    SubElement(transmission, "joint", name=joint)
    return SubElement(transmission, "actuator", name=f"{joint}_motor")


def _mend_inertias(root: Element) -> list[str]:
    names = []
    for link in root.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is not None and (value := float(mass.get("value", 0.0))) < 0.0:
            raise InvalidInputError(
                f"arm.model: the mass of {link.get('name')!r} must be at least 0, not {value:g} kg"
            )
        if mass is None or inertia is None or value == 0.0:
            continue
        products = {name: float(inertia.get(name, 0.0)) for name in _ENTRIES}
        if (possible := nearest_possible(tuple(products.values()))) is not None:
            inertia.attrib.update({n: repr(v) for n, v in zip(_ENTRIES, possible, strict=True)})
            names.append(link.get("name", ""))
    return about(names, "no body has the inertia given; the nearest possible one is taken:")


_ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def _names(elements: Iterable[Element]) -> Iterator[str]:
    return (element.get("name", "") for element in elements)


def mend_sdf(root: Element, meshes: Meshes, packages: Packages) -> list[str]:
    """Change a model in place so that Drake reads it.

    Args:
        root: The model.
        meshes: The meshes that it names.
        packages: Where the models are that it includes.

    Returns:
        Warnings about changes that alter the physics or the looks.
    """
    warnings = mend_geometry(root, meshes, _sdf_mesh, _sdf_colour)
    resolve_includes("arm.model", root, (packages,), [])
    return [*warnings, *meshes.warnings()]


# Files that a model may include, one within the other and in all.
_DEEPEST, _MOST_FILES = 20, 1000


def resolve_includes(
    key: str, root: Element, places: tuple[Packages, ...], files: list[Path], depth: int = 0
) -> None:
    """Name the models that a model of SDF includes by their files.

    A file that includes itself ends the process in Drake, which leaves out one that is no model.

    Args:
        key: Key of the model, for messages.
        root: The model.
        places: Where its files are; of an included one also where those of the others are.
        files: The files so far.
        depth: How many files it is within.

    Raises:
        InvalidInputError: If there is no such model, or they include each other without end.
    """
    for include in root.iter("include"):
        uri = include.find("uri")
        name = "" if uri is None else (uri.text or "").strip()
        candidates = dict.fromkeys(filter(None, (_included(name, each) for each in places)))
        if uri is None or not candidates:
            raise InvalidInputError(f"{key}: there is no file {name!r}, which it includes")
        uri.text = next(iter(candidates)).as_uri()
        for file in candidates:
            files.append(file)
            if depth == _DEEPEST or len(files) > _MOST_FILES:
                raise InvalidInputError(
                    f"{key}: its files include each other without end: {file.name} among them"
                )
            inner = _included_model(key, name, file)
            if inner.tag == "sdf":
                resolve_includes(key, inner, (*places, places[0].beside(file)), files, depth + 1)


def _included_model(key: str, name: str, file: Path) -> Element:
    """Return a model that another one includes by a name."""
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
    except ValueError as error:
        raise InvalidInputError(f"{key}: the file {name!r} {error}") from None
    if root is None or not (root.tag in {"robot", "mujoco"} or root.find("model") is not None):
        raise InvalidInputError(f"{key}: {name!r}, which it includes, is no model")
    return root


def _included(uri: str, packages: Packages) -> Path | None:
    """Return the file of a model that is included by its name or that of its folder."""
    if (file := packages.file(uri)) is not None:
        return file
    config = packages.file(f"{uri.rstrip('/')}/model.config")
    root = None if config is None else parse_xml(content_of(config, MOST_BYTES))
    if config is None or root is None:
        return None
    # The last one is of the newest version.
    names = [(each.text or "").strip() for each in root.findall("sdf")]
    return packages.beside(config).file(names[-1]) if names else None


def _sdf_mesh(geometry: Element) -> MeshName | None:
    uri = geometry.find("geometry/mesh/uri")
    scale = geometry.findtext("geometry/mesh/scale", "")
    return None if uri is None else MeshName(uri, scale=scale)


def _sdf_colour(visual: Element) -> Colour | None:
    numbers = [float(part) for part in visual.findtext("material/diffuse", "").split()]
    if len(numbers) not in {3, 4}:
        return None
    return (numbers[0], numbers[1], numbers[2], numbers[3] if len(numbers) == 4 else 1.0)


class Mimic(NamedTuple):
    """A joint at ``multiplier`` times the position of ``joint`` plus ``offset`` [rad or m].

    One that follows none, whose ``joint`` is empty, is held at ``offset``.
    """

    joint: str
    multiplier: float
    offset: float


def mimics_of(root: Element) -> Mapping[str, Mimic]:
    """Return the joints of a model that follow others, by name.

    Raises:
        ValueError: If a multiplier or an offset is not a number.
    """
    mimics = {}
    for joint in root.iter("joint"):
        if (follows := joint.find("mimic")) is not None:
            multiplier, offset = follows.get("multiplier", 1.0), follows.get("offset", 0.0)
        elif (follows := joint.find("axis/mimic")) is not None:
            multiplier = follows.findtext("multiplier", "1")
            reference = float(follows.findtext("reference", "0"))
            offset = float(follows.findtext("offset", "0")) - float(multiplier) * reference
        else:
            continue
        leader = follows.get("joint", "")
        mimics[joint.get("name", "")] = Mimic(leader, float(multiplier), float(offset))
    return mimics


# Drake takes a link of this name in URDF for the world.
_WORLD = "world"


class WrittenUrdf:
    """A model of any format, as Drake has read it, written as URDF.

    Bodies, joints and frames keep their names and numbers, so that nothing of the format has to be
    interpreted a second time. Frames become links without mass, as a joint can carry those alone.
    A body that floats is fixed where the file places it.

    Args:
        plant: A finalized plant of the model alone.
        inspector: Inspector of its SceneGraph.
        instance: The model.
        key: Key of the model in a document and its file, for messages.

    Attributes:
        root: The model.
        warnings: What URDF cannot carry, and is left out.

    Raises:
        InvalidInputError: If it has several bases, or a joint of another kind.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        instance: ModelInstanceIndex,
        key: str,
    ) -> None:
        self._plant, self._inspector, self._key = plant, inspector, key
        self._unknown: list[str] = []
        self.root = Element("robot", name="model")
        bodies = [plant.get_body(index) for index in plant.GetBodyIndices(instance)]
        SubElement(self.root, "link", name=_WORLD)
        joints = [plant.get_joint(index) for index in plant.GetJointIndices(instance)]
        self._require_one_base(joints)
        for body in bodies:
            self._add_link(body)
        motors = {
            motor.joint().name(): motor
            for motor in map(plant.get_joint_actuator, plant.GetJointActuatorIndices(instance))
        }
        for joint in joints:
            self._add_joint(joint, motors.get(joint.name()))
        self._add_frames(instance, joints)
        self.warnings = self._warnings(joints)

    def _require_one_base(self, joints: Sequence[Joint]) -> None:
        """Raise an InvalidInputError if a body floats beside others that the world carries."""
        bases = [joint for joint in joints if joint.parent_body() is self._plant.world_body()]
        names = [joint.child_body().name() for joint in bases]
        if len(names) > 1 and any(joint.num_velocities() == 6 for joint in bases):
            raise InvalidInputError(
                f"{self._key} must have one base, not {len(names)}: {', '.join(names)}"
            )

    def _add_link(self, body: RigidBody) -> None:
        link = SubElement(self.root, "link", name=body.name())
        inertia = body.default_spatial_inertia()
        if (mass := inertia.get_mass()) > 0.0:
            inertial = SubElement(link, "inertial")
            SubElement(inertial, "origin", xyz=numbers_text(inertia.get_com()))
            SubElement(inertial, "mass", value=repr(float(mass)))
            about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
            entries = (*about_com.get_moments(), *about_com.get_products())
            numbers = {n: repr(float(v)) for n, v in zip(_ENTRIES, entries, strict=True)}
            SubElement(inertial, "inertia", numbers)
        frame = self._plant.GetBodyFrameIdOrThrow(body.index())
        for role, tag in ((Role.kIllustration, "visual"), (Role.kProximity, "collision")):
            for number, geometry in enumerate(self._inspector.GetGeometries(frame, role)):
                shape = _geometry_of(self._inspector.GetShape(geometry))
                if shape is None:
                    self._unknown.append(body.name())
                    continue
                element = SubElement(link, tag, name=f"{tag}_{number}")
                _add_origin(element, self._inspector.GetPoseInFrame(geometry))
                SubElement(element, "geometry").append(shape)
                if role == Role.kIllustration:
                    self._add_colour(element, geometry)
                else:
                    self._add_contact(element, geometry)

    def _add_colour(self, element: Element, geometry: GeometryId) -> None:
        properties = self._inspector.GetIllustrationProperties(geometry)
        material = SubElement(element, "material")
        if properties.HasProperty("phong", "diffuse"):
            rgba = properties.GetProperty("phong", "diffuse")
            colour = (rgba.r(), rgba.g(), rgba.b(), rgba.a())
            SubElement(material, "color", rgba=numbers_text(colour))
        if properties.HasProperty("phong", "diffuse_map"):
            file = properties.GetProperty("phong", "diffuse_map")
            SubElement(material, "texture", filename=Path(file).as_uri())
        if not len(material):
            element.remove(material)

    def _add_contact(self, element: Element, geometry: GeometryId) -> None:
        """Add what contacts of a shape are like."""
        properties = self._inspector.GetProximityProperties(geometry)
        contact = Element("drake:proximity_properties")
        for tag, (group, name) in _CONTACT.items():
            if properties.HasProperty(group, name):
                value = properties.GetProperty(group, name)
                SubElement(contact, f"drake:{tag}", value=repr(float(value)))
        if properties.HasProperty("material", "coulomb_friction"):
            friction = properties.GetProperty("material", "coulomb_friction")
            for tag, value in (
                ("mu_dynamic", friction.dynamic_friction()),
                ("mu_static", friction.static_friction()),
            ):
                SubElement(contact, f"drake:{tag}", value=repr(float(value)))
        if properties.HasProperty("hydroelastic", "compliance_type"):
            # Python cannot read the type; what is compliant has a modulus.
            is_compliant = properties.HasProperty(*_CONTACT["hydroelastic_modulus"])
            kind = "compliant" if is_compliant else "rigid"
            SubElement(contact, f"drake:{kind}_hydroelastic")
        if len(contact):
            element.append(contact)

    def _add_joint(self, joint: Joint, motor: JointActuator | None) -> None:
        """Add a joint; one whose frame is not that of its body carries a link without mass."""
        kind, child = _kind_of(joint, self._key), joint.child_body().name()
        X_PF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        if joint.num_velocities() == 6:
            X_PF = self._plant.GetDefaultFloatingBaseBodyPose(joint.child_body())
        X_MB = joint.frame_on_child().GetFixedPoseInBodyFrame().inverse()
        if kind == "fixed":
            if isinstance(joint, WeldJoint):
                X_PF = X_PF @ joint.X_FM()
            self._connect(joint.name(), joint.parent_body().name(), child, X_PF @ X_MB)
            return
        carried = child
        if not X_MB.IsExactlyIdentity():
            carried = f"{joint.name()}_moves"
            SubElement(self.root, "link", name=carried)
            self._connect(f"{joint.name()}_carries", carried, child, X_MB)
        element = self._connect(joint.name(), joint.parent_body().name(), carried, X_PF, kind)
        _add_motion(element, joint, motor)
        if motor is not None:
            actuator = _add_transmission(self.root, joint.name())
            actuator.set("name", motor.name())
            for tag, value in (
                ("rotor_inertia", motor.default_rotor_inertia()),
                ("gear_ratio", motor.default_gear_ratio()),
            ):
                SubElement(actuator, f"drake:{tag}", value=repr(float(value)))

    def _connect(
        self, name: str, parent: str, child: str, X: RigidTransform, kind: str = "fixed"
    ) -> Element:
        joint = SubElement(self.root, "joint", name=name, type=kind)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        _add_origin(joint, X)
        return joint

    def _add_frames(self, instance: ModelInstanceIndex, joints: Sequence[Joint]) -> None:
        """Add the frames that the file names, but not those that Drake makes for joints."""
        own = {joint.name() + end for joint in joints for end in ("_parent", "_child")}
        for index in self._plant.GetFrameIndices(instance):
            frame = self._plant.get_frame(index)
            name = frame.name()
            if not isinstance(frame, FixedOffsetFrame) or name in own or name.startswith("__"):
                continue
            SubElement(self.root, "link", name=name)
            X_BF = frame.GetFixedPoseInBodyFrame()
            self._connect(f"{name}_at", frame.body().name(), name, X_BF)

    def _warnings(self, joints: Sequence[Joint]) -> list[str]:
        plant = self._plant
        world = plant.GetBodyFrameIdOrThrow(plant.world_body().index())
        singles = [joint for joint in joints if joint.num_velocities() == 1]
        elsewhere = [joint.name() for joint in singles if any(joint.default_positions())]
        warnings = about(self._unknown, "shapes that URDF does not have are left out: those of")
        if self._inspector.NumGeometriesForFrame(world) > 0:
            warnings.append("shapes that no body has, such as a floor, are left out")
        if plant.num_force_elements() > 1:
            warnings.append("springs are left out")
        return [*warnings, *about(elsewhere, "joints begin at zero, not where the file has them:")]


# Elements of Drake that state what contacts are like, and the properties that they become.
_CONTACT = {
    "mesh_resolution_hint": ("hydroelastic", "resolution_hint"),
    "hydroelastic_modulus": ("hydroelastic", "hydroelastic_modulus"),
    "hunt_crossley_dissipation": ("material", "hunt_crossley_dissipation"),
    "relaxation_time": ("material", "relaxation_time"),
    "point_contact_stiffness": ("material", "point_contact_stiffness"),
}


def _kind_of(joint: Joint, key: str) -> str:
    """Return the type of a joint in URDF.

    Raises:
        InvalidInputError: If there is none of one axis.
    """
    if isinstance(joint, WeldJoint) or joint.num_velocities() == 6:
        return "fixed"
    if isinstance(joint, PrismaticJoint):
        return "prismatic"
    if not isinstance(joint, RevoluteJoint):
        raise InvalidInputError(
            f"{key}: its joint {joint.name()!r} is {joint.type_name()}; it may be revolute, "
            "prismatic or fixed"
        )
    limits = (*joint.position_lower_limits(), *joint.position_upper_limits())
    return "revolute" if np.isfinite(limits).any() else "continuous"


def _add_motion(element: Element, joint: Joint, motor: JointActuator | None) -> None:
    """Add axis, damping and limits of a joint; one that is not known is left out."""
    is_revolute = isinstance(joint, RevoluteJoint)
    axis = joint.revolute_axis() if is_revolute else joint.translation_axis()
    SubElement(element, "axis", xyz=numbers_text(axis))
    SubElement(element, "dynamics", damping=repr(float(joint.default_damping())))
    limits = {
        "lower": joint.position_lower_limit(),
        "upper": joint.position_upper_limit(),
        "velocity": joint.velocity_upper_limit(),
        "drake:acceleration": joint.acceleration_upper_limit(),
        "effort": np.inf if motor is None else motor.effort_limit(),
    }
    known = {name: repr(float(value)) for name, value in limits.items() if np.isfinite(value)}
    SubElement(element, "limit", known)


def _geometry_of(shape: Shape) -> Element | None:
    """Return a shape as URDF has it; None if it has none."""
    if isinstance(shape, (Mesh, Convex)):
        if not shape.source().is_path():
            return None
        mesh = Element("mesh", filename=shape.source().path().as_uri())
        mesh.set("scale", numbers_text(shape.scale3()))
        if isinstance(shape, Convex):
            SubElement(mesh, "drake:declare_convex")
        return mesh
    if isinstance(shape, Box):
        return Element("box", size=numbers_text(shape.size()))
    if isinstance(shape, Sphere):
        return Element("sphere", radius=repr(shape.radius()))
    if isinstance(shape, Ellipsoid):
        axes = {"a": shape.a(), "b": shape.b(), "c": shape.c()}
        return Element("drake:ellipsoid", {name: repr(value) for name, value in axes.items()})
    if isinstance(shape, (Cylinder, Capsule)):
        tag = "cylinder" if isinstance(shape, Cylinder) else "drake:capsule"
        return Element(tag, radius=repr(shape.radius()), length=repr(shape.length()))
    return None


def _add_origin(element: Element, X: RigidTransform) -> None:
    rpy = RollPitchYaw(X.rotation()).vector()
    SubElement(element, "origin", xyz=numbers_text(X.translation()), rpy=numbers_text(rpy))
