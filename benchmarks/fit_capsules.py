"""Fit capsules to the links of an arm, and write them to a file, or check a file.

Those of a shipped arm are fitted to its maker's meshes, collision and visual ones alike, every
vertex inside; the sources are those of `makers_meshes.SOURCES`::

    python benchmarks/fit_capsules.py panda models/panda/capsules.yaml
    python benchmarks/fit_capsules.py fr3 models/fr3/capsules.yaml --folder franka_description=...
    python benchmarks/fit_capsules.py fr3 --check --folder franka_description=...

``--check`` writes nothing and says how far vertices are outside of the capsules that the arm has;
with ``--capsules FILE`` of another file. With ``--postures N`` it is counted in how many random
postures two links are in contact by the meshes while all capsules are 5 mm apart. An arm of which
no meshes are known, and an arm of your own, is fitted to its model::

    python benchmarks/fit_capsules.py my.urdf capsules.yaml --frame tool

With ``--fine`` the file gets several capsules a link beside those that it has, which contain every
vertex and every face; `drake-rnn arm my.urdf --fit FILE` does that for an arm of your own::

    python benchmarks/fit_capsules.py panda models/panda/capsules.yaml --fine --most 5 --effort 4
    python benchmarks/fit_capsules.py panda --check --fine

A shipped gripper gets one capsule a body and fine ones at once, and is checked likewise::

    python benchmarks/fit_capsules.py franka_hand models/franka_hand/capsules.yaml
    python benchmarks/fit_capsules.py franka_hand --check --fine

Some links are cut by planes, and each piece gets a capsule: where one capsule would keep the arm
from postures in which nothing touches (`CUTS`). Pairs whose capsules come close, and of which the
search of `mesh_distance` proves that the meshes do not, are left out, with that distance.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path

import numpy as np
from pydrake.geometry import CalcVolume, Convex
from scipy.spatial import ConvexHull
from trimesh.intersections import slice_faces_plane

from drake_rnn import load_arm
from drake_rnn.inputs.fields import Array
from drake_rnn.robot.arm import Arm
from drake_rnn.robot.arm_description import GRIPPER
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.clearance.arm_capsules import (
    Fit,
    capsules_of,
    capsules_text,
    covering_capsules,
    fine_capsules,
    fine_text,
    fits_of,
    fitted_capsules,
    place_capsules,
    rounded,
    union_volume,
)
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.arm_shapes import (
    Enclosing,
    enclosing_capsule,
    parts_of,
)
from drake_rnn.robot.clearance.capsules import Capsule, Solids, number_names
from makers_meshes import (
    GRIPPERS,
    SOURCES,
    Surface,
    add_folders,
    bodies_of,
    gripper_surfaces,
    sources_of,
    surfaces_of,
)
from markdown_table import head, row
from mesh_distance import Joints, least_distance, meshes_touch, triangles

# Postures in which it is looked whether capsules come close, and the distance [m] that meshes keep
# of which the pair is left out.
POSTURES, FLOOR = 5000, 0.005
# Capsules that come nearer than this are close [m].
CLOSE = 0.01
# Most joints between two bodies that the search goes through.
MOST_JOINTS = 3


@dataclass(frozen=True)
class Cut:
    """A plane that cuts a piece off a body: what is below it.

    Attributes:
        normal: Its normal in the body's frame.
        level: Where it is along the normal [m].
    """

    normal: tuple[float, float, float]
    level: float


_Y, _Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
#: The cuts of each body, in order; what is above the last one is its last piece. They part what a
#: neighbour's neighbour can touch from what it cannot.
CUTS = {
    "panda": {"panda_link5": (Cut(_Z, -0.02),)},
    "ur5": {
        "base_link": (Cut(_Y, -0.07),),
        "upper_arm_link": (Cut(_Z, 0.045), Cut(_Z, 0.0946), Cut(_Z, 0.342)),
        "forearm_link": (Cut(_Z, 0.1), Cut(_Z, 0.345)),
    },
}
#: Links that are cut, of which fine capsules are close enough round the whole link.
UNCUT = {"panda": ("panda_link5",)}
# Most fine capsules of a base: each makes a pair with those of nearly all links.
OF_BASE = 3


def pieces_of(arm: str, surface: Surface) -> list[Surface]:
    """Return the pieces of a body."""
    rest, found = surface, []
    for cut in CUTS.get(arm, {}).get(surface.body, ()):
        below, rest = _cut(rest, cut)
        found.append(below)
    return [*found, rest]


def _cut(surface: Surface, cut: Cut) -> tuple[Surface, Surface]:
    """Return what of a surface is below a plane and what is above; both have the line between."""
    normal = np.array(cut.normal)
    sides = []
    for side in (-normal, normal):
        vertices, faces, _ = slice_faces_plane(
            surface.vertices, surface.faces, side, cut.level * normal
        )
        sides.append(Surface(surface.body, surface.role, vertices, faces))
    return sides[0], sides[1]


def makers_surfaces(name: str, arm: Arm, folders: list[str]) -> dict[str, Surface]:
    """Return all that a maker has of each body of a shipped arm, base to tip."""
    found: dict[str, list[Surface]] = {b.name(): [] for b in bodies_of(arm, arm.plant())}
    for source, folder in sources_of(name, folders):
        for surface in surfaces_of(arm, source, folder):
            found[surface.body].append(surface)
    return {body: Surface.of(parts) for body, parts in found.items()}


def fit(name: str, surfaces: dict[str, Surface]) -> tuple[list[Capsule], list[Surface]]:
    """Return the capsules of an arm, and the piece that each holds."""
    capsules, pieces = [], []
    for surface in surfaces.values():
        for piece in pieces_of(name, surface):
            points = piece.points
            hull = points[ConvexHull(points).vertices]
            ends, radius = enclosing_capsule(hull)
            one = Capsule(body=surface.body, ends=(ends[0], ends[1]), radius=radius)
            capsules.append(rounded(one, points))
            pieces.append(piece)
    return capsules, pieces


def close_pairs(arm: Arm, capsules: list[Capsule]) -> list[tuple[int, int]]:
    """Return the pairs of capsules that come close somewhere, of bodies that no joint joins."""
    placed = place_capsules(arm, capsules)
    own = np.array(
        [
            (a, b)
            for a, b in combinations(range(len(capsules)), 2)
            if abs(placed.links[a] - placed.links[b]) > 1
        ]
    )
    q = random_postures(arm, POSTURES)
    near = Clearance(placed, own, Solids.of([])).gaps(q).min(axis=0) < CLOSE
    return [(int(a), int(b)) for a, b in own[near]]


def random_postures(arm: Arm, count: int, seed: int = 0) -> Array:
    """Return postures within the limits, those of a joint at most one turn, shape (count, n)."""
    joints = Joints(arm)
    return np.random.default_rng(seed).uniform(joints.lower, joints.upper, (count, arm.n))


def left_out_pairs(
    arm: Arm, capsules: list[Capsule], pieces: list[Surface]
) -> list[tuple[int, int, float]]:
    """Return the pairs of capsules that come close though their meshes never do, and how near.

    That distance is proven to be that of no posture.
    """
    joints, links = Joints(arm), place_capsules(arm, capsules).links
    found = []
    for a, b in close_pairs(arm, capsules):
        if links[b] - links[a] > MOST_JOINTS:
            continue
        least = least_distance(joints, (int(links[a]), pieces[a]), (int(links[b]), pieces[b]))
        print(f"# {capsules[a].body}, {capsules[b].body}: {least}", file=sys.stderr, flush=True)
        if least.proven >= FLOOR:
            found.append((a, b, least.proven))
    return found


def written(
    capsules: list[Capsule], left_out: list[tuple[int, int, float]], sources: list[str]
) -> str:
    """Return the text of a file of capsules."""
    lines = ["# Every vertex of these is inside, collision and visual ones."] if sources else []
    lines += ["source:", *(f"- {source}" for source in sources)] if sources else []
    labels = number_names([capsule.body for capsule in capsules])
    pairs = [
        (labels[a], labels[b], f"never nearer than {1e3 * least:.1f} mm")
        for a, b, least in left_out
    ]
    return "".join(f"{line}\n" for line in lines) + capsules_text(capsules, pairs)


def fitted_beside(own: dict[str, Capsule], label: str, triangles: Array) -> Capsule:
    """Return one of the capsules of a link, fitted again to what the others leave of triangles.

    Where that takes more space it is the same.
    """
    others = [Enclosing(np.array(c.ends), c.radius) for name, c in own.items() if name != label]
    [found] = covering_capsules(triangles, most=1, beside=others)
    ends = (found.ends[0], found.ends[1])
    again = Capsule(body=own[label].body, ends=ends, radius=found.radius)
    return min(own[label], again, key=lambda one: union_volume([*others, one]))


def write_fine(arm: Arm, surfaces: dict[str, Surface], file: Path, most: int, effort: int) -> None:
    """Fit several capsules to each link, and write them beside those that a file has.

    Links that are cut, but those of `UNCUT`, keep their capsules, so that pairs which the file
    leaves out, proved for the meshes of the pieces, are left out of these as well. A capsule that
    it leaves out by its number is fitted again to what the others leave of its piece.
    """
    triangles = {body: surface.vertices[surface.faces] for body, surface in surfaces.items()}
    coarse, pairs = capsules_of(arm.replace(capsules=str(file), shapes="coarse"))
    labels = dict(zip(number_names([c.body for c in coarse]), coarse, strict=True))
    capsules, uncut = [], UNCUT.get(arm.name, ())
    for number, body in enumerate(surfaces):
        if body in CUTS.get(arm.name, {}) and body not in uncut:
            own = {label: capsule for label, capsule in labels.items() if capsule.body == body}
            for label in own.keys() & {name for pair in pairs for name in pair}:
                own[label] = fitted_beside(own, label, triangles[body])
            capsules += own.values()
        else:
            own_most = most if number else min(most, OF_BASE)
            capsules += fine_capsules({body: triangles[body]}, own_most, effort)
    fits = fits_of(triangles, capsules)
    made_by = (
        f"python benchmarks/fit_capsules.py {arm.name} models/{arm.name}/capsules.yaml --fine "
        f"--most {most} --effort {effort}"
    )
    text = file.read_text().partition("fine:\n")[0]
    lines = [line[3:].split("]  # ") for line in text.splitlines() if "]  # never" in line]
    left_out = [(*names.split(", "), note) for names, note in lines]
    left_out = [pair for pair in left_out if not {n.split()[0] for n in pair[:2]} & {*uncut}]
    file.write_text(text + fine_text(capsules, left_out, fits, made_by))


def print_table(surfaces: dict[str, Surface], capsules: list[Capsule]) -> None:
    """Print how far vertices are outside, and the volume of the capsules over that of the hull."""
    head("body", "capsules", "radii [mm]", "farthest vertex outside [mm]", "volume over the hull's")
    for body, surface in surfaces.items():
        own = [capsule for capsule in capsules if capsule.body == body]
        radii = ", ".join(f"{1e3 * capsule.radius:.1f}" for capsule in own)
        ratio = union_volume(own) / ConvexHull(surface.points).volume
        out = 1e3 * float(np.min([c.outside(surface.vertices) for c in own], axis=0).max())
        row(body, len(own), radii, f"{out:.4f}", f"{ratio:.2f}")


def print_fits(arm: Arm, surfaces: dict[str, Surface]) -> None:
    """Print how closely fine capsules contain the links, and how far faces are outside."""
    triangles = {body: surface.vertices[surface.faces] for body, surface in surfaces.items()}
    print_row(arm.name, fits_of(triangles, capsules_of(arm)[0]))


def print_row(name: str, fits: Sequence[Fit]) -> None:
    """Print how closely capsules fit, in a row of a table."""
    ratios = [fit.volume / fit.hull for fit in fits]
    row(
        f"`{name}`",
        sum(len(fit.radii) for fit in fits),
        f"{sum(fit.volume for fit in fits) / sum(fit.hull for fit in fits):.2f}",
        f"{min(ratios):.2f} to {max(ratios):.2f}",
        f"{max(fit.outside for fit in fits):.1e}",
    )


def print_postures(arm: Arm, surfaces: dict[str, Surface], count: int) -> None:
    """Print in how many random postures meshes touch, and what the law says of these."""
    joints, parts = Joints(arm), enumerate(surfaces.values())
    shapes = [triangles(joints.world(k, part.vertices), part.faces) for k, part in parts]
    clearance, _ = arm_clearance(arm, [], arm.home)
    q = random_postures(arm, count, seed=1)
    apart = clearance.gaps(q).min(axis=1) >= FLOOR
    touch = np.array([meshes_touch(joints, shapes, posture) is not None for posture in q])
    head("postures", "apart by capsules", "meshes touch", "apart by capsules and meshes touch")
    row(count, int(apart.sum()), int(touch.sum()), int((apart & touch).sum()))


def of_gripper(options: argparse.Namespace) -> None:
    """Fit capsules to a shipped gripper and write them, or say how closely those there fit."""
    arm, name = load_arm("panda", gripper={"model": options.arm}, shapes="fine"), options.arm
    parts = [part.body for part in parts_of(arm) if part.body.startswith(GRIPPER)]
    bodies = [body.removeprefix(GRIPPER) for body in parts]
    triangles = gripper_surfaces(name, bodies, options.folder)
    if options.points is not None:
        surfaces = {
            body: Surface(body, "collision", each.reshape(-1, 3), np.arange(each.size // 3)[None])
            for body, each in triangles.items()
        }
        return write_extremes(options.points, name, surfaces)
    if options.check:
        own = [c for c in capsules_of(arm)[0] if c.body in parts]
        own = [replace(c, body=c.body.removeprefix(GRIPPER)) for c in own]
        return print_row(name, fits_of(triangles, own))
    coarse = []
    for body, surface in triangles.items():
        points = surface.reshape(-1, 3)
        ends, radius = enclosing_capsule(points[ConvexHull(points).vertices])
        one = Capsule(body=body, ends=(ends[0], ends[1]), radius=radius)
        coarse.append(rounded(one, points))
    fine = fine_capsules(triangles, options.most, options.effort)
    sources = [str(source) for source in GRIPPERS[name]]
    made_by = f"python benchmarks/fit_capsules.py {name} models/{name}/capsules.yaml"
    made_by += f" --most {options.most} --effort {options.effort}"
    text = written(coarse, [], sources) + fine_text(fine, [], fits_of(triangles, fine), made_by)
    options.file.write_text(text)
    return None


def extremes(surface: Surface) -> Array:
    """Return the points of a body that are farthest in 26 directions, shape (k, 3) [m]."""
    directions = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)])
    points = surface.points
    return points[np.unique((points @ directions.T).argmax(axis=0))]


def write_extremes(file: Path, name: str, surfaces: dict[str, Surface]) -> None:
    """Write the farthest points of each body, in its frame, with their source."""
    lines = [*(f"# {source}" for source in (SOURCES | GRIPPERS)[name])]
    for body, surface in surfaces.items():
        lines.append(f"{body}:")
        lines += [f"- [{x:.6f}, {y:.6f}, {z:.6f}]" for x, y, z in extremes(surface)]
    file.write_text("\n".join(lines) + "\n")


def fit_model(options: argparse.Namespace) -> None:
    """Fit capsules to what an arm's own model has, and write them."""
    changes = {} if options.frame is None else {"frame": options.frame}
    arm = load_arm(options.arm, capsules=None, **changes)
    tool = None if arm.tool is None else "tool"
    parts = [part for part in parts_of(arm) if part.body != tool]
    capsules = fitted_capsules(parts)
    head("body", "radius [m]", "length [m]", "volume over that of the hull")
    for part, capsule in zip(parts, capsules, strict=True):
        ends = np.array(capsule.ends)
        volume = Enclosing(ends, capsule.radius).volume / CalcVolume(
            Convex(part.points.T, part.body)
        )
        length = float(np.linalg.norm(ends[1] - ends[0]))
        row(part.body, f"{capsule.radius:.4f}", f"{length:.4f}", f"{volume:.2f}")
    placed = place_capsules(arm, capsules)
    own = np.array(
        [
            (a, b)
            for a, b in combinations(range(len(capsules)), 2)
            if abs(placed.links[a] - placed.links[b]) > 1
        ]
    )
    home = np.zeros(arm.n) if arm.home is None else arm.home
    near = Clearance(placed, own, Solids.of([])).gaps(home) < CLOSE
    for a, b in own[near]:
        names = f"{capsules[a].body} and {capsules[b].body}"
        print(f"# {names} touch where the arm is at home: give them smaller ones")
    exact = [rounded(c, part.points) for c, part in zip(capsules, parts, strict=True)]
    options.file.write_text(written(exact, [], []))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arm", help="a shipped arm, or a model file")
    parser.add_argument("file", type=Path, nargs="?", help="the file to write")
    parser.add_argument("--frame", help="frame of a model file's end effector")
    parser.add_argument("--check", action="store_true", help="check the capsules that the arm has")
    parser.add_argument("--capsules", type=Path, help="a file of capsules to check")
    parser.add_argument("--postures", type=int, help="compare meshes and capsules in so many")
    parser.add_argument("--points", type=Path, help="write the farthest points of the meshes here")
    parser.add_argument("--fine", action="store_true", help="add several capsules a link")
    parser.add_argument("--most", type=int, default=3, help="most of a link")
    parser.add_argument("--effort", type=int, default=1, help="searches for those of a link")
    add_folders(parser)
    options = parser.parse_args()
    if options.arm in GRIPPERS:
        return of_gripper(options)
    if options.arm not in SOURCES and not (options.check or options.points or options.postures):
        return fit_model(options)
    changes = {} if options.capsules is None else {"capsules": str(options.capsules)}
    arm = load_arm(options.arm, tool=None, **changes)
    surfaces = makers_surfaces(options.arm, arm, options.folder)
    if options.postures:
        return print_postures(arm, surfaces, options.postures)
    if options.points is not None:
        return write_extremes(options.points, options.arm, surfaces)
    if options.check and options.fine:
        return print_fits(arm.replace(shapes="fine"), surfaces)
    if options.check:
        return print_table(surfaces, capsules_of(arm)[0])
    if options.fine:
        return write_fine(arm, surfaces, options.file, options.most, options.effort)
    capsules, pieces = fit(options.arm, surfaces)
    print_table(surfaces, capsules)
    sources = [str(source) for source in SOURCES[options.arm]]
    text = written(capsules, left_out_pairs(arm, capsules, pieces), sources)
    options.file.write_text(text)
    return None


if __name__ == "__main__":
    main()
