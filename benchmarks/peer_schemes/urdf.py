"""The shipped arm's URDF as peers read it: joints and links, without shapes."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from drake_rnn import Arm


def without_shapes(arm: Arm) -> str:
    """Return an arm's URDF without its visuals, for readers that know no capsules."""
    tree = ElementTree.fromstring(Path(arm.model).read_text())
    for link in tree.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    return ElementTree.tostring(tree, encoding="unicode")
