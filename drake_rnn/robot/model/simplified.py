"""Meshes with fewer triangles, for pages that are not larger than need be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .cache import cached_file
from .conversion import content_name
from .late_import import late_import

trimesh = late_import("trimesh")

# Least number of triangles that a part keeps.
_FEWEST = 20


def simplified(files: Sequence[Path], triangles: int) -> list[Path]:
    """Return glTF files with fewer triangles in all, as glTF files of the cache.

    Each part keeps the same share of its triangles, and 20 at least.

    Args:
        files: The glTF files.
        triangles: Number of triangles in all of them together; fewer are left as they are.
    """
    counts = [sum(len(part.faces) for part in _parts(_scene(file))) for file in files]
    share = min(1.0, triangles / max(sum(counts), 1))
    return [_simplified(file, share) for file in files]


def _simplified(file: Path, share: float) -> Path:
    name = content_name(file, b"simplified", repr(share).encode())
    return cached_file(f"meshes/{name}.gltf", lambda: _gltf(file, share))


def _gltf(file: Path, share: float) -> bytes:
    scene = _scene(file)
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


def _scene(file: Path) -> Any:
    return trimesh.load_scene(str(file), process=False)


def _parts(scene: Any) -> list[Any]:
    return [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
