"""The scene and animation that Drake's Meshcat recorded, taken from the page that Drake writes."""

from __future__ import annotations

import re
from dataclasses import dataclass

# The viewer is the first script; what follows it makes a viewer, gives it its assets, and then one
# command after the other.
_SCRIPT = re.compile(r"<script[^>]*>(.*?)</script>", re.DOTALL)
_COMMAND = re.compile(r'fetch\("data:application/octet-binary;base64,([A-Za-z0-9+/=]+)"\)')
_ASSETS = re.compile(r"casAssets = \{\};.*?(?=fetch\(|\Z)", re.DOTALL)


@dataclass(frozen=True)
class Recorded:
    """A scene with its animation, as scripts and commands of Meshcat's viewer.

    Attributes:
        viewer: The viewer, which defines ``MeshCat``.
        assets: A script with what the commands refer to, such as images.
        commands: Commands that set up the scene, encoded in base64, in their order.
    """

    viewer: str
    assets: str
    commands: tuple[str, ...]


def recorded(page: str) -> Recorded:
    """Return the parts of a page that `pydrake.geometry.Meshcat.StaticHtml` has made.

    Raises:
        RuntimeError: If the page is made differently, as another version of Drake might do.
    """
    viewer, assets = _SCRIPT.search(page), _ASSETS.search(page)
    commands = tuple(_COMMAND.findall(page))
    if viewer is None or assets is None or not commands:
        raise RuntimeError("playback: this version of Drake writes pages of Meshcat differently")
    return Recorded(viewer[1], assets[0], commands)
