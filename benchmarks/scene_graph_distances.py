"""What Drake's SceneGraph says of a planned motion, beside coal's distances of triangles.

SceneGraph takes each mesh by its convex hull in queries of distance. For problems of
MotionBenchMaker, see `motion_bench_maker`, a path is planned, and both judge every tenth sample::

    python benchmarks/scene_graph_distances.py FOLDER --arms panda ur5 --numbers 4
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    FramePoseVector,
    GeometryFrame,
    GeometryId,
    GeometryInstance,
    Mesh,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform

from drake_rnn import Arm, Array, Goal, arm_clearance, load_arm, make_obstacles, plan_motion
from fit_capsules import makers_surfaces
from makers_meshes import Surface, add_folders, poses_of
from markdown_table import head, row
from motion_bench_maker import (
    ARMS,
    JERK,
    MARGIN,
    SCENARIOS,
    WITH_PLAN,
    Meshes,
    Problem,
    Solid,
    bounded,
    problems_of,
)

# Every so many samples are looked at.
EVERY = 10


def shape_of(solid: Solid) -> Shape:
    """Return an obstacle for SceneGraph."""
    if solid.kind == "box":
        return Box(*solid.dimensions)
    if solid.kind == "cylinder":
        return Cylinder(solid.dimensions[1], solid.dimensions[0])
    return Sphere(solid.dimensions[0])


def with_proximity(X: RigidTransform, shape: Shape, name: str) -> GeometryInstance:
    """Return a geometry of which distances can be asked."""
    instance = GeometryInstance(X, shape, name)
    instance.set_proximity_properties(ProximityProperties())
    return instance


def write_obj(file: Path, surface: Surface) -> Path:
    """Write a surface to a file, and return it."""
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*vertex) for vertex in surface.vertices]
    lines += ["f {} {} {}".format(*(face + 1)) for face in surface.faces]
    file.write_text("\n".join(lines) + "\n")
    return file


def least(arm: Arm, surfaces: dict[str, Surface], problem: Problem, q: Array) -> tuple[float, str]:
    """Return the least distance that SceneGraph finds in postures, and of what [m].

    Pairs are those of `motion_bench_maker`.

    Args:
        arm: The arm.
        surfaces: Its maker's meshes, by body.
        problem: What is in the way.
        q: The postures, shape (k, n) [rad].
    """
    graph = SceneGraph()
    source = graph.RegisterSource("arm")
    frames = [graph.RegisterFrame(source, GeometryFrame(body)) for body in surfaces]
    with tempfile.TemporaryDirectory() as folder:
        links = [
            graph.RegisterGeometry(
                source,
                frame,
                with_proximity(
                    RigidTransform(), Mesh(str(write_obj(Path(folder, f"{k}.obj"), each))), body
                ),
            )
            for k, (frame, (body, each)) in enumerate(zip(frames, surfaces.items(), strict=True))
        ]
    solids = [
        graph.RegisterAnchoredGeometry(source, with_proximity(s.X_WO, shape_of(s), f"solid {k}"))
        for k, s in enumerate(problem.solids)
    ]
    context = graph.CreateDefaultContext()
    names = [*surfaces, *(f"obstacle {k}" for k in range(len(solids)))]
    every = [*links, *solids]
    pairs = [(i, j) for i, j in combinations(range(len(links)), 2) if j - i > 1]
    pairs += [(i, len(links) + j) for i in range(1, len(links)) for j in range(len(solids))]
    found: tuple[float, str] = (np.inf, "")
    for posture in q:
        poses = FramePoseVector()
        for frame, X in zip(frames, poses_of(arm, posture).values(), strict=True):
            poses.set_value(frame, X)
        graph.get_source_pose_port(source).FixValue(context, poses)
        query = graph.get_query_output_port().Eval(context)

        def distance(a: GeometryId, b: GeometryId, query=query) -> float:  # type: ignore[no-untyped-def]
            return float(query.ComputeSignedDistancePairClosestPoints(a, b).distance)

        gaps = [distance(every[a], every[b]) for a, b in pairs]
        k = int(np.argmin(gaps))
        found = min(found, (gaps[k], f"{names[pairs[k][0]]}, {names[pairs[k][1]]}"))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("resources", metavar="FOLDER", type=Path, help="the unpacked distribution")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=ARMS)
    parser.add_argument("--numbers", nargs="+", type=int, default=[4], help="which problems")
    add_folders(parser)
    options = parser.parse_args()
    head("arm", "problem", "postures", "by SceneGraph [mm]", "of", "by the triangles [mm]")
    for name in options.arms:
        bare = load_arm(name, tool=None)
        surfaces = makers_surfaces(name, bare, options.folder)
        meshes = Meshes(name, tuple(options.folder))
        arm = load_arm(name, tool=None, shapes="fine")
        arm = arm.with_limits(bounded(arm, JERK))
        for number in options.numbers:
            folder, count = options.resources / "resources", 4 * len(SCENARIOS)
            which, problem = problems_of(folder, name, 1, count)[number]
            obstacles = make_obstacles([solid.cylinder() for solid in problem.solids])
            clearance, _ = arm_clearance(arm, obstacles, arm.home)
            goal = Goal(q=problem.goal, seconds=3600.0, margin=MARGIN)
            aim = (arm, goal, problem.start, 0.01, clearance)
            q = plan_motion(*aim, avoidance=WITH_PLAN, seed=number).position[::EVERY]
            hulls, pair = least(bare, surfaces, problem, q)
            exact = meshes.least(q, problem.solids)
            row(name, which, len(q), f"{1e3 * hulls:.2f}", pair, f"{1e3 * exact:.2f}")


if __name__ == "__main__":
    main()
