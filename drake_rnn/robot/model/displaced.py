"""A robot's model with displaced joints."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from ...errors import InvalidInputError
from ...inputs.fields import Array
from ..rotation import rotation_by
from .model import Model
from .urdf import MOVING
from .xml_text import parse_xml, write_xml


def moving_joints(model: Model) -> list[str]:
    """Return the names of a model's movable joints, in the order in which it names them.

    Raises:
        InvalidInputError: If it is no URDF.
    """
    return [joint.get("name", "") for joint in _moving(_root(model))]


def displaced(model: Model, translation: Array, rotation: Array) -> Model:
    """Return a model whose movable joints are displaced, each in the axes of its own frame.

    Args:
        model: A model in URDF.
        translation: Displacement of each joint, in the order of the file, shape (k, 3) [m].
        rotation: Rotation of each as a rotation vector, shape (k, 3) [rad].

    Raises:
        InvalidInputError: If it is no URDF.
    """
    root = _root(model)
    for joint, shift, turn in zip(_moving(root), translation, rotation, strict=True):
        origin = joint.find("origin")
        if origin is None:
            origin = SubElement(joint, "origin")
        X_PF = RigidTransform(
            RollPitchYaw(_numbers(origin, "rpy")).ToRotationMatrix(), _numbers(origin, "xyz")
        )
        X_PG = X_PF @ RigidTransform(RotationMatrix(rotation_by(turn)), shift)
        origin.set("xyz", _text(X_PG.translation()))
        origin.set("rpy", _text(RollPitchYaw(X_PG.rotation()).vector()))
    return replace(model, text=write_xml(root), format="urdf")


def _root(model: Model) -> Element:
    text = model.file.read_bytes() if model.text is None else model.text.encode()
    root = parse_xml(text)
    if root is None or root.tag != "robot":
        raise InvalidInputError(
            f"arm.link_errors: only for models in URDF; {model.file.name} is none"
        )
    return root


def _moving(root: Element) -> list[Element]:
    return [joint for joint in root.findall("joint") if joint.get("type") in MOVING]


def _numbers(origin: Element, name: str) -> Array:
    return np.array([float(number) for number in origin.get(name, "0 0 0").split()])


def _text(numbers: Array) -> str:
    return " ".join(repr(float(number)) for number in numbers)
