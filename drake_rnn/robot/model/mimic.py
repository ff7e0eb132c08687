"""Joints that follow other joints, as URDF and SDF state them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element


class Mimic(NamedTuple):
    """A joint at ``multiplier`` times the position of ``joint`` plus ``offset`` [rad or m]."""

    joint: str
    multiplier: float
    offset: float


def mimics_of(root: Element) -> Mapping[str, Mimic]:
    """Return the joints of a model that follow others, by name.

    Raises:
        ValueError: If a multiplier or an offset is not a number.
    """
    found = {}
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
        found[joint.get("name", "")] = Mimic(leader, float(multiplier), float(offset))
    return found
