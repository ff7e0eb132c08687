"""How a guard leads arms to the goals of MotionBenchMaker, and how near the makers' meshes come.

The problems are those that VAMP distributes: the source distribution ``vamp-planner`` of PyPI holds
``resources/<arm>/problems.tar.bz2``. Unpack it anywhere, and give its folder::

    python benchmarks/motion_bench_maker.py FOLDER
    python benchmarks/motion_bench_maker.py FOLDER --capsules OTHERS  # OTHERS/<arm>/capsules.yaml
    python benchmarks/motion_bench_maker.py FOLDER --goals --first 1 --problems 700
    python benchmarks/motion_bench_maker.py FOLDER --plan --first 1 --problems 700

With ``--goals`` no arm moves: it is counted how many starts and goals are free by coarse and by
fine capsules, cylinders as they are.

With ``--plan`` a path is planned from start to goal, with fine capsules and cylinders as they are,
and the guard follows it. A goal is blocked if its capsules are within 1.5 mm of each other or of
an obstacle, a start within 1 mm. The guard has then so long as the plan, and half a second more.

Problems from ``--first`` on are taken of all scenarios in turn. The arms are bare, obstacles are
boxes; a cylinder is the box that holds it. The guard gets the goal as its target in every call.

The motion is judged by the meshes of `makers_meshes.SOURCES` (``--folder`` as for these) at every
sample and halfway between two: the least distance of two links that no joint joins, or of a link
but the base from an obstacle, a box or a true cylinder. Distances are coal's: of convex hulls, and
of triangles wherever a hull comes nearer than 3 cm.
"""

from __future__ import annotations

import argparse
import re
import sys
import tarfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw
from ruamel.yaml import YAML

from drake_rnn import (
    Arm,
    Array,
    Avoidance,
    Goal,
    Guard,
    InvalidInputError,
    JointLimits,
    JointStream,
    arm_clearance,
    load_arm,
    make_obstacles,
    plan_motion,
)
from fit_capsules import makers_surfaces
from kept_cases import cases
from makers_meshes import add_folders, bodies_of
from markdown_table import head, row
from mesh_distance import Joints, hull_shape, triangles
from shared_options import add_case_options

ARMS = ("panda", "ur5")
SCENARIOS = (
    "bookshelf_small",
    "bookshelf_tall",
    "bookshelf_thin",
    "box",
    "cage",
    "table_pick",
    "table_under_pick",
)
VELOCITY, ACCELERATION, JERK = 1.5, 6.0, 200.0
# Distance that is certified, and what a goal needs at least so that rows let the arm there [m].
FLOOR, ROOM = 0.005, 0.01
# With a plan: how near the guard lets the arm come, and what the plan stays away besides [m].
WITH_PLAN, MARGIN = Avoidance(floor=0.001, distance=0.0015, approach=50.0), 0.003
# Where hulls are farther apart than this, triangles are not looked at [m].
NEAR = 0.03
# The arm is at its goal if no joint is farther away [rad].
THERE = 0.01


@dataclass(frozen=True)
class Solid:
    """An obstacle of a scene.

    Attributes:
        kind: ``box``, ``cylinder`` or ``sphere``.
        dimensions: Its edges; its length and radius; its radius [m].
        X_WO: Its pose in the arm's base frame.
    """

    kind: str
    dimensions: tuple[float, ...]
    X_WO: RigidTransform

    @property
    def size(self) -> tuple[float, ...]:
        """Edges of the box that holds it, shape (3,) [m]."""
        if self.kind == "box":
            return self.dimensions
        radius = self.dimensions[-1]
        return (2.0 * radius, 2.0 * radius, self.dimensions[0])

    def settings(self) -> dict[str, Any]:
        """Return it as an obstacle of a document."""
        center = self.X_WO.translation().tolist()
        if self.kind == "sphere":
            return {"kind": "ball", "center": center, "radius": self.dimensions[0]}
        rpy = RollPitchYaw(self.X_WO.rotation()).vector().tolist()
        return {"kind": "box", "center": center, "size": list(self.size), "rpy": rpy}

    def cylinder(self) -> dict[str, Any]:
        """Return it as an obstacle of a document, a cylinder as what it is."""
        if self.kind != "cylinder":
            return self.settings()
        length, radius = self.dimensions
        return {
            **{key: value for key, value in self.settings().items() if key != "size"},
            "kind": "cylinder",
            "length": length,
            "radius": radius,
        }

    def exact(self) -> coal.CollisionGeometry:
        """Return it for coal."""
        if self.kind == "box":
            return coal.Box(*self.dimensions)
        if self.kind == "cylinder":
            return coal.Cylinder(self.dimensions[1], self.dimensions[0])
        return coal.Sphere(self.dimensions[0])


@dataclass(frozen=True)
class Problem:
    """A start, a goal, shape (n,) each [rad], and what is in the way."""

    start: Array
    goal: Array
    solids: tuple[Solid, ...]


def pose(given: Mapping[str, Any] | None) -> RigidTransform:
    """Return a pose of a scene; its quaternion has the real part last."""
    if given is None:
        return RigidTransform()
    x, y, z, w = np.array(given["orientation"]) / np.linalg.norm(given["orientation"])
    return RigidTransform(Quaternion(w, x, y, z), given["position"])


def solids_of(scene: Mapping[str, Any], X_SB: RigidTransform) -> Iterator[Solid]:
    """Yield the obstacles of a scene, of an arm whose base has the pose X_SB there."""
    for thing in scene["world"]["collision_objects"]:
        X_ST = pose(thing.get("pose"))
        for shape, place in zip(thing["primitives"], thing["primitive_poses"], strict=True):
            if shape["type"] not in ("box", "cylinder", "sphere"):
                raise SystemExit(f"{thing['id']}: {shape['type']} is not known here")
            X_BO = X_SB.inverse() @ X_ST @ pose(place)
            yield Solid(shape["type"], tuple(map(float, shape["dimensions"])), X_BO)


def base_pose(model: Path, base: str) -> RigidTransform:
    """Return the pose of a link in the first frame of a URDF, by fixed joints between."""
    joints = ElementTree.parse(model).getroot().findall("joint")
    above = {joint.find("child").get("link"): joint for joint in joints}
    X = RigidTransform()
    while base in above:
        joint = above[base]
        origin = joint.find("origin")
        xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), float) for key in ("xyz", "rpy"))
        X, base = RigidTransform(RollPitchYaw(rpy), xyz) @ X, joint.find("parent").get("link")
    return X


@cache
def problems_of(folder: Path, name: str, first: int, count: int) -> list[tuple[str, Problem]]:
    """Return problems of an arm with their names, of all scenarios in turn."""
    arm = load_arm(name, tool=None)
    X_SB = base_pose(folder / name / f"{name}.urdf", bodies_of(arm, arm.plant())[0].name())
    wanted = [(s, first + k) for k in range(count) for s in SCENARIOS][:count]
    texts: dict[tuple[str, int, str], bytes] = {}
    with tarfile.open(folder / name / "problems.tar.bz2") as archive:
        for member in archive:
            found = re.search(rf"/(\w+)_{name}/(scene|request)(\d+)\.yaml$", member.name)
            if found is not None and (found[1], int(found[3])) in wanted:
                file = archive.extractfile(member)
                assert file is not None
                texts[found[1], int(found[3]), found[2]] = file.read()
    read = YAML(typ="safe").load
    problems = []
    for scenario, number in wanted:
        scene, request = (read(texts[scenario, number, kind]) for kind in ("scene", "request"))
        state = request["start_state"]["joint_state"]
        begin = dict(zip(state["name"], state["position"], strict=True))
        goals = request["goal_constraints"][0]["joint_constraints"]
        end = {each["joint_name"]: each["position"] for each in goals}
        start, goal = (np.array([at[joint] for joint in arm.joints]) for at in (begin, end))
        problem = Problem(start, goal, tuple(solids_of(scene, X_SB)))
        problems.append((f"{scenario} {number}", problem))
    return problems


class Meshes:
    """The makers' meshes of an arm."""

    def __init__(self, name: str, folders: tuple[str, ...]) -> None:
        arm = load_arm(name, tool=None)
        self._joints = Joints(arm)
        surfaces = makers_surfaces(name, arm, list(folders)).values()
        placed = [self._joints.world(k, s.vertices) for k, s in enumerate(surfaces)]
        used = [np.unique(s.faces) for s in surfaces]
        self._hulls = [hull_shape(p[which]) for p, which in zip(placed, used, strict=True)]
        self._links = [triangles(p, s.faces) for p, s in zip(placed, surfaces, strict=True)]

    def least(self, q: Array, solids: tuple[Solid, ...], enough: float = np.inf) -> float:
        """Return the least distance of a posture, or of several, shape (n,) or (k, n) [m].

        At most ``enough`` is returned, and less is not looked for.
        """
        for posture in np.atleast_2d(q):
            moved = [self._joints.motion(0, posture[:k]) for k in range(len(posture) + 1)]
            enough = min([enough, *self._gaps(moved, solids, enough)])
        return enough

    def _gaps(
        self, X: list[coal.Transform3s], solids: tuple[Solid, ...], enough: float
    ) -> Iterator[float]:
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        links, near = range(len(X)), min(NEAR, enough)

        def gap(shapes: tuple[Any, Any], at: tuple[Any, Any]) -> float:
            result.clear()
            return float(coal.distance(shapes[0], at[0], shapes[1], at[1], request, result))

        for i, j in ((i, j) for i, j in combinations(links, 2) if j - i > 1):
            hulls = gap((self._hulls[i], self._hulls[j]), (X[i], X[j]))
            yield hulls if hulls > near else gap((self._links[i], self._links[j]), (X[i], X[j]))
        for solid in solids:
            R, p = solid.X_WO.rotation().matrix(), solid.X_WO.translation()
            exact, at = solid.exact(), coal.Transform3s(R, p)
            for link in links[1:]:
                hulls = gap((self._hulls[link], exact), (X[link], at))
                yield hulls if hulls > near else gap((self._links[link], exact), (X[link], at))


meshes_of = cache(Meshes)


def bounded(arm: Arm, jerk: float | None) -> JointLimits:
    """Return the limits that the guard keeps."""
    velocity = np.minimum(arm.limits.velocity, VELOCITY)
    return arm.limits.replace(velocity=velocity, acceleration=ACCELERATION, jerk=jerk)


def rates(q: Array, period: float) -> Iterator[Array]:
    """Yield the sizes of velocity, acceleration and jerk of a motion from rest, shape (k, n)."""
    v = np.diff(np.vstack((q[:1],) * 3 + (q,)), axis=0) / period
    for order in range(3):
        yield np.abs(np.diff(v, n=order, axis=0)) / period**order


def beyond(q: Array, limits: JointLimits, period: float) -> float:
    """Return by how much a motion from rest to rest passes its limits [rad, s]."""
    found = [float(limits.violation(q).max())]
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    for size, most in zip(rates(q, period), bounds, strict=True):
        if most is not None:
            found.append(float((size - most).max()))
    return max(found)


def judged(
    q: Array, problem: Problem, limits: JointLimits, period: float, meshes: Meshes
) -> dict[str, float]:
    """Return what a motion towards a goal comes to: times, distances and bounds."""
    away = np.abs(q - problem.goal).max(axis=1)
    there = int(np.flatnonzero(away > THERE)[-1]) + 1 if (away > THERE).any() else 0
    halves = np.stack((q[:-1], 0.5 * (q[:-1] + q[1:])), axis=1).reshape(-1, q.shape[1])
    return {
        "motion": there * period,
        "mesh": meshes.least(np.vstack((halves, q[-1:])), problem.solids),
        "beyond": beyond(q, limits, period),
        "jerk": float([*rates(q, period)][2].max()),
        "error": float(away[-1]),
    }


def run(number: int, options: argparse.Namespace, name: str, jerk: float | None) -> dict[str, Any]:
    """Return what a problem comes to."""
    given = problems_of(options.resources, name, options.first, options.problems)
    which, problem = given[number]
    own = options.capsules and {"capsules": str(options.capsules / name / "capsules.yaml")}
    arm = load_arm(name, tool=None, **(own or {}))
    obstacles = make_obstacles([solid.settings() for solid in problem.solids])
    clearance, _ = arm_clearance(arm, obstacles, arm.home)
    meshes = meshes_of(name, tuple(options.folder))
    ends = np.array([problem.start, problem.goal])
    found = {
        "problem": which,
        "ends": clearance.gaps(ends).min(axis=1).tolist(),
        "mesh_ends": [meshes.least(end, problem.solids) for end in ends],
    }
    limits = bounded(arm, jerk)
    try:
        law = JointStream(limits=limits, home=problem.start, clearance=clearance)
        guard = Guard(law, options.period, compiled=False)
    except InvalidInputError as error:
        return {**found, "refused": str(error)}
    began = time.process_time()
    calls = range(round(options.seconds / options.period))
    q = np.array([problem.start, *(guard.command(problem.goal) for _ in calls)])
    took = time.process_time() - began
    halves = np.stack((q[:-1], 0.5 * (q[:-1] + q[1:])), axis=1).reshape(-1, q.shape[1])
    return {
        **found,
        "least": float(clearance.least_along(q).min()),
        "mesh": meshes.least(np.vstack((halves, q[-1:])), problem.solids),
        "beyond": beyond(q, limits, options.period),
        "error": float(np.abs(q[-1] - problem.goal).max()),
        "held_back": guard.part("held_back").item(),
        "ms": 1e3 * took / len(calls),
    }


def ends_of(number: int, options: argparse.Namespace, name: str) -> dict[str, list[float]]:
    """Return the least distances of a problem's start and goal, by coarse and fine capsules."""
    _, problem = problems_of(options.resources, name, options.first, options.problems)[number]
    obstacles = make_obstacles([solid.cylinder() for solid in problem.solids])
    ends, found = np.array([problem.start, problem.goal]), {}
    for shapes in ("coarse", "fine"):
        arm = load_arm(name, tool=None, shapes=shapes)
        clearance, _ = arm_clearance(arm, obstacles, arm.home)
        found[shapes] = clearance.gaps(ends).min(axis=1).tolist()
    return found


def print_goals(options: argparse.Namespace) -> None:
    """Print how many starts and goals are free, goals of each scenario as well."""
    head("arm", "capsules", "problems", "starts free", "goals free", *SCENARIOS)
    for name in ARMS:
        task = partial(ends_of, options=options, name=name)
        key = f"goals {name}, {options.first}, {options.problems}"
        found = cases(task, range(options.problems), options.jobs, options.kept, key)
        for shapes in ("coarse", "fine"):
            free = np.array([each[shapes] for each in found]) > FLOOR
            each = [int(free[k :: len(SCENARIOS), 1].sum()) for k in range(len(SCENARIOS))]
            starts, goals = (int(count) for count in free.sum(axis=0))
            row(f"`{name}`", shapes, len(found), starts, goals, *each)


def planned(number: int, options: argparse.Namespace, name: str) -> dict[str, Any]:
    """Return what a problem comes to with a plan."""
    which, problem = problems_of(options.resources, name, options.first, options.problems)[number]
    arm = load_arm(name, tool=None, shapes="fine")
    arm = arm.with_limits(bounded(arm, JERK))
    obstacles = make_obstacles([solid.cylinder() for solid in problem.solids])
    clearance, _ = arm_clearance(arm, obstacles, arm.home)
    ends = clearance.gaps(np.array([problem.start, problem.goal])).min(axis=1).tolist()
    found: dict[str, Any] = {"problem": which, "ends": ends}
    goal = Goal(q=problem.goal, seconds=3600.0, margin=MARGIN, steps=options.steps)
    began = time.process_time()
    try:
        plan = plan_motion(
            arm, goal, problem.start, options.period, clearance, avoidance=WITH_PLAN, seed=number
        )
    except InvalidInputError as error:
        return {**found, "refused": str(error), "planning": time.process_time() - began}
    planning = time.process_time() - began
    law = JointStream(
        limits=arm.limits,
        home=problem.start,
        clearance=clearance,
        avoidance=WITH_PLAN,
        **plan.stream,
    )
    guard = Guard(law, options.period, compiled=False)
    targets = plan.targets(plan.duration + 0.5).position
    began = time.process_time()
    q = np.array([problem.start, *(guard.command(target) for target in targets)])
    took = time.process_time() - began
    meshes = meshes_of(name, tuple(options.folder))
    off = q[1 : len(plan.position)] - plan.position[1:]
    return {
        **found,
        "planning": planning,
        "steps": plan.steps,
        "planned": plan.duration,
        "off_plan": float(np.abs(off).max(initial=0.0)),
        "least": float(clearance.least_along(q).min()),
        **judged(q, problem, arm.limits, options.period, meshes),
        "held_back": guard.part("held_back").item(),
        "uncertified": guard.part("uncertified").item(),
        "ms": 1e3 * took / len(targets),
    }


def print_plans(options: argparse.Namespace) -> None:
    """Print what planning comes to for each arm."""
    head(
        "arm",
        "problems",
        "starts or goals blocked by the capsules",
        "goals beyond joint limits",
        "no path found",
        "reached",
        "of the others",
        "planning, s of the processor, median and 95 %",
        "motion, median and 95 % [s]",
        "least certified distance [mm]",
        "bounds beyond by",
        "least distance by the meshes [mm]",
        "collisions by these",
        "samples held back",
        *SCENARIOS,
    )
    for name in options.arms:
        task = partial(planned, options=options, name=name)
        key = f"plan {name}, {options.first}, {options.period}, {options.steps}, {WITH_PLAN}"
        found = cases(task, range(options.problems), options.jobs, options.kept, key)
        went = [each for each in found if "refused" not in each]
        nearest = np.array([WITH_PLAN.floor, WITH_PLAN.distance])
        blocked = [each for each in found if (each["ends"] <= nearest).any()]
        beyond = [each for each in found if each.get("refused", "").startswith("goal.q: ")]
        others = len(found) - len(blocked) - len(beyond)
        reached = [each for each in went if each["error"] < THERE]
        for each in found:
            if each not in reached:
                text = each.get("refused") or f"{each['error']:.3g} rad from its goal at the end"
                print(f"# {name} {each['problem']}: {text}", file=sys.stderr)
        times = [
            "{:.2f}, {:.2f}".format(*np.quantile([each[key] for each in reached], (0.5, 0.95)))
            for key in ("planning", "motion")
        ]
        names = {each["problem"] for each in reached}
        by_scene = (sum(each.startswith(f"{scene} ") for each in names) for scene in SCENARIOS)
        row(
            f"`{name}`",
            len(found),
            len(blocked),
            len(beyond),
            others - len(went),
            len(reached),
            f"{100.0 * len(reached) / max(1, others):.1f} %",
            *times,
            f"{1e3 * min(each['least'] for each in went):.3f}",
            f"{max(each['beyond'] for each in went):.0e}",
            f"{1e3 * min(each['mesh'] for each in went):.2f}",
            sum(each["mesh"] <= 0.0 for each in went),
            int(sum(each["held_back"] for each in went)),
            *by_scene,
        )


def print_row(name: str, jerk: float | None, found: list[dict[str, Any]]) -> None:
    """Print the row of an arm."""
    went = [each for each in found if "refused" not in each]
    free = [each for each in found if each["ends"][1] > ROOM]
    reached = [each for each in went if each["error"] < THERE]
    for each in found:
        near = "" if "refused" in each else f"{each['least']:.5f} m, meshes {each['mesh']:.5f} m"
        print(f"# {name} {each['problem']}: {each.get('refused', near)}", file=sys.stderr)
    row(
        f"`{name}`",
        "-" if jerk is None else f"{jerk:g}",
        len(found),
        len(found) - len(went),
        f"{sum(each['ends'][0] > FLOOR for each in found)}, {len(free)}",
        f"{sum(each['mesh_ends'][0] > FLOOR for each in found)}, "
        f"{sum(each['mesh_ends'][1] > FLOOR for each in found)}",
        len(reached),
        f"{1e3 * min(each['least'] for each in went):.4f}",
        f"{max(each['beyond'] for each in went):.0e}",
        int(sum(each["held_back"] for each in went)),
        f"{1e3 * min(each['mesh'] for each in went):.2f}",
        sum(each["mesh"] < FLOOR for each in went),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("resources", metavar="FOLDER", type=Path, help="the unpacked distribution")
    parser.add_argument("--problems", type=int, default=30, help="number of problems of each arm")
    parser.add_argument("--first", type=int, default=41, help="number of the first one")
    parser.add_argument("--seconds", type=float, default=3.5, help="for how long each is led")
    parser.add_argument("--period", type=float, default=0.01, help="time between two calls [s]")
    parser.add_argument("--capsules", type=Path, help="a folder of other capsules")
    parser.add_argument("--goals", action="store_true", help="count free starts and goals")
    parser.add_argument("--plan", action="store_true", help="plan a path, which the guard follows")
    parser.add_argument("--steps", type=int, default=20_000, help="longest search of a plan")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=ARMS)
    add_folders(parser)
    add_case_options(parser)
    options = parser.parse_args()
    options.resources = options.resources / "resources"
    if options.goals:
        return print_goals(options)
    if options.plan:
        return print_plans(options)
    motion = ("reached", "least certified distance [mm]", "bounds beyond by", "samples held back")
    head(
        "arm",
        "jerk [rad/s^3]",
        "problems",
        "refused",
        "starts and goals free",
        "by the meshes",
        *motion,
        "least distance by the meshes [mm]",
        "nearer than 5 mm by these",
    )
    for name in ARMS:
        for jerk in (None, JERK):
            task = partial(run, options=options, name=name, jerk=jerk)
            key = f"{name}, {jerk}, {options.first}, {options.period}, {options.capsules}"
            found = cases(task, range(options.problems), options.jobs, options.kept, key)
            print_row(name, jerk, found)
    return None


if __name__ == "__main__":
    main()
